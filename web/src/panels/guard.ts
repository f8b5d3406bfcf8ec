// What holds the force back, in words.
import type { DeviceState } from "../state_types";
import { el, Rows, setText } from "./dom";
import { tripOf } from "./trips";

interface Line {
  name: string;
  latched: boolean;
}

export class GuardPanel {
  private readonly summary = el("p", { className: "summary" });
  private readonly list = el("ul", { className: "trips" });
  private readonly rows = new Rows<Line, { root: HTMLElement; update(line: Line): void }>(
    this.list,
    (line) => numberOf(line),
    makeRow,
  );

  constructor(parent: HTMLElement) {
    parent.append(this.summary, this.list);
  }

  update(device: DeviceState): void {
    const { guard } = device;
    const zero =
      guard.stopped ||
      !guard.armed ||
      guard.latched.length > 0 ||
      guard.active.some((n) => tripOf(n).force !== "shaped");
    this.summary.dataset["level"] = zero || device.fault ? "bad" : guard.active.length > 0 ? "warn" : "good";
    setText(this.summary, device.fault ? `Device fault: ${device.fault}` : summaryOf(device, zero));
    const lines = guard.latched.map((name): Line => ({ name, latched: true }));
    lines.push(
      ...guard.active
        .filter((name) => !guard.latched.includes(name))
        .map((name): Line => ({ name, latched: false })),
    );
    this.rows.update(lines);
  }
}

function summaryOf(device: DeviceState, zero: boolean): string {
  const { guard } = device;
  if (guard.stopped) return "Stopped: no force until it is re-armed.";
  if (guard.latched.length > 0) return "Tripped: no force until it is re-armed.";
  if (!guard.armed) return "Not armed: no force.";
  if (zero) return "The force is held at zero for now.";
  return guard.active.length > 0
    ? "Armed; the guard shapes the force."
    : "Armed. Nothing holds the force back.";
}

// Names are few: their letters make a number.
const numberOf = (line: Line): number =>
  [...line.name].reduce((sum, c) => (sum * 31 + c.charCodeAt(0)) % 1e9, line.latched ? 1 : 0);

function makeRow(line: Line): { root: HTMLElement; update(): void } {
  const trip = tripOf(line.name);
  const root = el(
    "li",
    { data: { level: trip.force === "shaped" ? "warn" : "bad" } },
    el("code", {}, line.name),
    line.latched ? " (latched) " : " ",
    trip.words,
  );
  return { root, update: () => undefined };
}
