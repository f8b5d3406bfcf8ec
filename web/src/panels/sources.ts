// Planes, force fields and the constraint of the scene: switched off and on again. The server forgets what is switched off; this
// page remembers it. Remote contacts are listed only: their client states them anew many times per second.
import { enableConstraint, type Outgoing, setForceField, setPlane, type Vec3 } from "../wire";
import type { ConstraintState, FieldState, PlaneState, SceneState } from "../state_types";
import type { RemoteContact } from "../sources";
import { el, Rows, setText } from "./dom";
import { Switch } from "./switch";

type Send = (...messages: Outgoing[]) => void;
/** World units of a stock metre. */
const METRE = 1000;

interface Source {
  key: string;
  name: string;
  facts: string;
  on: boolean;
  /** Without: it cannot be switched here. */
  messages?(on: boolean): Outgoing[];
}

const round = (numbers: number[]): string => numbers.map((x) => Number(x.toPrecision(3))).join(" ");

function planeSource(p: PlaneState, on: boolean): Source {
  const [a, b, c, d] = p.plane as [number, number, number, number];
  const stock = [p.stiffness_N_per_m / 1000, p.damping_Ns_per_m / 1000] as const;
  return {
    key: `plane ${p.index}`,
    name: `Plane ${p.index}`,
    facts: `${round(p.plane)}, ${p.stiffness_N_per_m.toFixed(0)} N/m`,
    on,
    messages: (wanted) => [
      setPlane(p.index, wanted ? [a, b, c, d / METRE] : [0, 0, 0, 0], ...stock, p.static_friction, p.dynamic_friction),
    ],
  };
}

function fieldSource(f: FieldState, on: boolean): Source {
  const none = new Array<number>(9).fill(0);
  return {
    key: "field",
    name: "Force field",
    facts: `${round(f.force_N)} N at ${round(f.origin)}`,
    on,
    messages: (wanted) => [
      setForceField(
        f.origin.map((x) => x / METRE) as Vec3,
        (wanted ? f.force_N : [0, 0, 0]) as Vec3,
        wanted ? f.jacobian_N_per_unit.map((x) => x * METRE) : none,
        (f.radius ?? 1e9) / METRE,
      ),
    ],
  };
}

const constraintSource = (c: ConstraintState, on: boolean): Source => ({
  key: "constraint",
  name: "Constraint",
  facts: `${c.mode}, ${c.stiffness_N_per_m.toFixed(0)} N/m`,
  on,
  messages: (wanted) => [enableConstraint(wanted)],
});

const remoteSource = (c: RemoteContact): Source => ({
  key: `remote contact ${c.id}`,
  name: `Remote contact ${c.id}`,
  facts: `${Math.hypot(...c.force_N).toFixed(2)} N, ${(1000 * c.depth).toFixed(1)} mm`,
  on: true,
});

class SourceRow {
  readonly root: HTMLElement;
  private readonly facts = el("span", { className: "quiet" });
  private readonly active: Switch;
  private source: Source;

  constructor(source: Source, onSwitch: (source: Source, on: boolean) => void) {
    this.source = source;
    this.active = new Switch("on", `${source.name} is on`, (on) => onSwitch(this.source, on));
    const row = el("div", { className: "row" }, el("strong", {}, source.name), this.facts);
    if (source.messages) row.append(this.active.root);
    this.root = el("li", { data: { source: source.key } }, row);
  }
  update(source: Source): void {
    this.source = source;
    setText(this.facts, source.facts);
    this.active.update(source.on);
  }
}

export class SourcesPanel {
  private readonly rows: Rows<Source, SourceRow>;
  private readonly none = el("p", { className: "quiet" }, "Planes, force fields, constraints and remote contacts of clients appear here.");
  private readonly off = new Map<string, Source>();

  constructor(parent: HTMLElement, send: Send) {
    const list = el("ul", { className: "cards" });
    this.rows = new Rows(
      list,
      (s) => s.key,
      (s) =>
        new SourceRow(s, (source, on) => {
          if (on) this.off.delete(source.key);
          else this.off.set(source.key, { ...source, on: false });
          send(...(source.messages?.(on) ?? []));
        }),
    );
    parent.append(list, this.none);
  }

  /** Another scene: nothing of this one is remembered. */
  clear(): void {
    this.off.clear();
  }

  update(scene: SceneState | undefined, remote: RemoteContact[]): void {
    const present = [
      ...(scene?.planes ?? []).map((p) => planeSource(p, true)),
      ...(scene?.fields ?? []).map((f) => fieldSource(f, true)),
      ...(scene?.constraint ? [constraintSource(scene.constraint, true)] : []),
      ...remote.map(remoteSource),
    ];
    const off = [...this.off.values()].filter((s) => !present.some((p) => p.key === s.key));
    const all = [...present, ...off].sort((a, b) => a.key.localeCompare(b.key));
    this.rows.update(all);
    this.none.hidden = all.length > 0;
  }
}
