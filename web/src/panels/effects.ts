// Force effects: starts, stops and edits defined ones, defines new ones, hides stopped ones.
import { type Effect, type Outgoing, setEffect, startEffect, stopEffect, type Vec3 } from "../wire";
import type { EffectState, VibrationUnit } from "../state_types";
import { el, NumberField, Rows, setText } from "./dom";
import { CONFIRM_MS, Switch } from "./switch";

type Send = (...messages: Outgoing[]) => void;

/** Parameters of a new effect of each type; gains in N/mm and N per mm/s of the device, frequencies in Hz. */
const NEW: Record<string, { label: string; effect: Partial<Effect> }> = {
  constant: { label: "Constant, 1 N up", effect: { magnitude_N: 1, direction: [0, 1, 0] } },
  spring: { label: "Spring to the origin", effect: { gain: 0.05, magnitude_N: 2 } },
  viscous: { label: "Viscous", effect: { gain: 0.003, magnitude_N: 2 } },
  friction: { label: "Friction", effect: { gain: 0.2, magnitude_N: 0.5 } },
  vibrationMotor: { label: "Vibration, 60 Hz", effect: { magnitude_N: 0.5, frequency: 60 } },
  vibrationContact: { label: "Vibration in contact", effect: { magnitude_N: 0.5, frequency: 64 } },
};

type Parameter = "magnitude_N" | "gain" | "frequency" | "duration_ms" | "position" | "direction";
/** What the server uses of each type, as src/scene/effect.h says. */
export const FIELDS: Record<string, Parameter[]> = {
  constant: ["magnitude_N", "direction", "duration_ms"],
  spring: ["gain", "magnitude_N", "position", "duration_ms"],
  viscous: ["gain", "magnitude_N", "duration_ms"],
  friction: ["gain", "magnitude_N", "duration_ms"],
  vibrationMotor: ["magnitude_N", "frequency", "duration_ms"],
  vibrationContact: ["magnitude_N", "frequency", "duration_ms"],
};
const LABELS: Record<Parameter, string> = {
  magnitude_N: "Limit, N",
  gain: "Gain, N/mm",
  frequency: "Hz",
  duration_ms: "Time, ms",
  position: "Position",
  direction: "Direction",
};

export const labelOf = (type: string, name: Parameter): string => {
  if (name === "magnitude_N" && type === "constant") return "Force, N";
  return name === "gain" && type === "viscous" ? "Gain, N per mm/s" : LABELS[name];
};

/** An effect with its frequency in Hz, as setEffect() takes it. */
export const onWire = (effect: Effect, unit: VibrationUnit): Effect =>
  effect.type === "vibrationContact" && unit === "rad/s" ? { ...effect, frequency: 2 * Math.PI * effect.frequency } : effect;

/** With the frequency in Hz. */
export const effectOf = (e: EffectState): Effect => ({
  type: e.type,
  index: e.index,
  gain: e.gain,
  magnitude_N: e.magnitude_N,
  duration_ms: e.duration_ms,
  frequency: e.frequency_Hz,
  position: e.position as Vec3,
  direction: e.direction as Vec3,
});

class EffectForm {
  readonly root = el("div", { className: "placing" });
  private readonly fields: [Parameter, number, NumberField][] = [];
  private latest: Effect | undefined;
  /** Until then the state of the server may be older than what was sent. */
  private sentUntil_ms = 0;

  constructor(
    e: EffectState,
    private readonly onChange: (effect: Effect) => void,
  ) {
    for (const name of FIELDS[e.type] ?? ["magnitude_N"]) {
      const count = name === "position" || name === "direction" ? 3 : 1;
      const label = labelOf(e.type, name);
      const parts = Array.from({ length: count }, (_, i) => {
        const what = count === 3 ? `${label} ${"xyz"[i]!}` : label;
        const input = el("input", { type: "number", step: "any", ariaLabel: `${what} of effect ${e.index}` });
        this.fields.push([name, i, new NumberField(input, 6)]);
        return input;
      });
      this.root.append(el("div", { className: "field" }, el("span", {}, label), ...parts));
    }
    this.root.addEventListener("change", () => this.change());
  }

  update(e: EffectState): void {
    if (performance.now() < this.sentUntil_ms) return;
    this.latest = effectOf(e);
    for (const [name, i, field] of this.fields) {
      const value = this.latest[name];
      field.show(typeof value === "number" ? value : value[i]!);
    }
  }

  private change(): void {
    if (!this.latest || this.fields.some(([, , field]) => !Number.isFinite(field.value))) return;
    const effect: Effect = { ...this.latest, position: [...this.latest.position], direction: [...this.latest.direction] };
    for (const [name, i, field] of this.fields) {
      if (name === "position" || name === "direction") effect[name][i] = field.value;
      else effect[name] = field.value;
    }
    this.latest = effect;
    this.sentUntil_ms = performance.now() + CONFIRM_MS;
    this.onChange(effect);
  }
}

class EffectRow {
  readonly root: HTMLElement;
  private readonly facts = el("span", { className: "quiet" });
  private readonly active: Switch;
  private readonly form: EffectForm;
  private readonly details = el("details");

  constructor(
    private state: EffectState,
    send: Send,
    define: (effect: Effect) => void,
    onRemove: () => void,
  ) {
    const { index } = state;
    this.active = new Switch("on", `Effect ${index} is on`, (on) =>
      send(on ? startEffect(index) : stopEffect(index)),
    );
    this.form = new EffectForm(state, define);
    const remove = el("button", { type: "button", className: "small", ariaLabel: `Remove effect ${index}` }, "Remove");
    remove.addEventListener("click", onRemove);
    const summary = el("summary", {}, "Parameters");
    // At the click, not at the later "toggle": by then a quick hand has begun to type.
    summary.addEventListener("click", () => this.form.update(this.state));
    this.details.append(summary, this.form.root, remove);
    const row = el("div", { className: "row" }, el("strong", {}, `Effect ${index}`), this.facts, this.active.root);
    this.root = el("li", { data: { effect: String(index) } }, row, this.details);
  }

  update(e: EffectState): void {
    this.state = e;
    const limit = e.duration_ms > 0 ? `, ${e.duration_ms} ms` : "";
    setText(this.facts, `${e.type}, ${Number(e.magnitude_N.toPrecision(4))} N${limit}`);
    this.active.update(e.active);
    if (this.details.open) this.form.update(e);
  }
}

export class EffectsPanel {
  private readonly list = el("ul", { className: "cards" });
  private readonly rows: Rows<EffectState, EffectRow>;
  private used: number[] = [];
  /** Indices of effects that were added here, until the state of the server must have them, ms. */
  private readonly added = new Map<number, number>();
  private unit: VibrationUnit = "rad/s";
  /** The wire has no call that forgets an effect: a removed one is stopped, hidden, and its index used again. */
  private readonly removed = new Set<number>();

  constructor(parent: HTMLElement, send: Send) {
    this.rows = new Rows(
      this.list,
      (e) => `${e.index} ${e.type}`,
      (e) =>
        new EffectRow(
          e,
          send,
          (effect) => send(setEffect(onWire(effect, this.unit))),
          () => {
            send(stopEffect(e.index));
            this.removed.add(e.index);
          },
        ),
    );
    const type = el(
      "select",
      { ariaLabel: "Type of the new effect" },
      ...Object.entries(NEW).map(([value, { label }]) => el("option", { value }, label)),
    );
    const add = el("button", { type: "button" }, "Add");
    add.addEventListener("click", () => {
      const effect = this.newEffect(type.value);
      this.removed.delete(effect.index);
      send(setEffect(onWire(effect, this.unit)), startEffect(effect.index));
    });
    parent.append(this.list, el("div", { className: "row adder" }, type, add));
  }

  /** Another scene: nothing of this one is remembered. */
  clear(): void {
    this.rows.update([]);
    this.removed.clear();
    this.added.clear();
    this.used = [];
  }

  update(effects: EffectState[], unit: VibrationUnit): void {
    this.unit = unit;
    for (const e of effects) if (e.active && !this.used.includes(e.index)) this.removed.delete(e.index);
    const shown = effects.filter((e) => e.active || !this.removed.has(e.index));
    this.used = shown.map((e) => e.index);
    this.rows.update(shown.filter((e) => !this.removed.has(e.index)));
  }

  private newEffect(type: string): Effect {
    let index = 0;
    const now_ms = performance.now();
    while (this.used.includes(index) || now_ms < (this.added.get(index) ?? 0)) ++index;
    this.added.set(index, now_ms + CONFIRM_MS);
    const none: Effect = {
      type,
      index,
      gain: 0,
      magnitude_N: 0,
      duration_ms: 0,
      frequency: 0,
      position: [0, 0, 0],
      direction: [0, 0, 0],
    };
    return { ...none, ...NEW[type]!.effect };
  }
}
