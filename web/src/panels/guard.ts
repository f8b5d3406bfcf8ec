// The state of the guard: whether it lets the force through, and its trips with their remedies.
import { type Trip, TRIPS } from "../server_tables";
import type { DeviceState } from "../state_types";
import { el, Rows, setText } from "./dom";

interface Line {
  name: string;
  latched: boolean;
}

export class GuardPanel {
  private readonly summary = el("p", { className: "summary" });
  private readonly list = el("ul", { className: "trips" });
  private readonly rows = new Rows<Line, { root: HTMLElement; update(line: Line): void }>(
    this.list,
    ({ name, latched }) => `${name} ${latched}`,
    makeRow,
  );

  constructor(parent: HTMLElement) {
    parent.append(this.summary, this.list);
  }

  /** Nothing is known of the guard. */
  lost(): void {
    this.summary.dataset["level"] = "bad";
    setText(this.summary, "Unknown: no connection to the server.");
    this.rows.update([]);
  }

  /** `recent`: trips of the last second, which the polled state may have missed. */
  update(device: DeviceState, recent: string[] = []): void {
    const { guard } = device;
    const active = [...new Set([...guard.active, ...recent])];
    const zero = guard.stopped || !guard.armed || guard.latched.length > 0 || guard.active.some(removesForce);
    this.summary.dataset["level"] = zero || device.fault ? "bad" : active.length > 0 ? "warn" : "good";
    setText(this.summary, device.fault ? `Device fault: ${device.fault}` : summaryOf(device, zero, active));
    const lines = guard.latched.map((name): Line => ({ name, latched: true }));
    lines.push(
      ...active
        .filter((name) => !guard.latched.includes(name))
        .map((name): Line => ({ name, latched: false })),
    );
    this.rows.update(lines);
  }
}

/** Of the present; `active` also names the trips of the last second. */
function summaryOf(device: DeviceState, zero: boolean, active: string[]): string {
  const { guard } = device;
  if (guard.stopped) return "Stopped: no force until re-armed.";
  if (guard.latched.length > 0) return "Tripped: no force until re-armed.";
  if (!guard.armed) return "Not armed: no force.";
  if (zero) return "The guard holds the force at zero.";
  if (active.some(removesForce)) return "Armed. The guard held the force at zero in the last second.";
  return active.length > 0 ? "Armed. The guard limits the force." : "Armed. The guard does not change the force.";
}

function makeRow(line: Line): { root: HTMLElement; update(): void } {
  const trip = tripOf(line.name);
  const root = el(
    "li",
    { data: { level: trip?.action === "clamp" ? "warn" : "bad" } },
    el("code", {}, line.name),
    line.latched ? " (latched) " : " ",
    ...(trip ? withCode(`${trip.what} ${trip.remedy}`) : ["This page is older than the server: see docs/safety.md."]),
  );
  return { root, update: () => undefined };
}

/** The trip of a name; none for a name of a newer server. */
const tripOf = (name: string): Trip | undefined => (TRIPS as Record<string, Trip>)[name];

const removesForce = (name: string): boolean => tripOf(name)?.action !== "clamp";

/** Text in backticks becomes code. */
const withCode = (text: string): (Node | string)[] =>
  text.split("`").map((part, i) => (i % 2 === 1 ? el("code", {}, part) : part));
