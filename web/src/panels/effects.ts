// Force effects: starts and stops defined ones, defines new ones.
import { type Effect, type Outgoing, setEffect, startEffect, stopEffect } from "../wire";
import type { EffectState } from "../state_types";
import { el, Rows, setText } from "./dom";
import { Switch } from "./switch";

type Send = (...messages: Outgoing[]) => void;

/** Parameters of a new effect of each type; gains in N/mm and N per mm/s of the device. */
const NEW: Record<string, { label: string; effect: Partial<Effect> }> = {
  constant: { label: "Constant, 1 N up", effect: { magnitude_N: 1, direction: [0, 1, 0] } },
  spring: { label: "Spring to the origin", effect: { gain: 0.05, magnitude_N: 2 } },
  viscous: { label: "Viscous", effect: { gain: 0.003, magnitude_N: 2 } },
  friction: { label: "Friction", effect: { gain: 0.2, magnitude_N: 0.5 } },
  vibrationMotor: { label: "Vibration, 60 Hz", effect: { magnitude_N: 0.5, frequency: 60 } },
  vibrationContact: { label: "Vibration in contact", effect: { magnitude_N: 0.5, frequency: 400 } },
};

class EffectRow {
  readonly root: HTMLElement;
  private readonly facts = el("span", { className: "quiet" });
  private readonly active: Switch;

  constructor({ index }: EffectState, send: Send) {
    this.active = new Switch("on", `Effect ${index} is on`, (on) =>
      send(on ? startEffect(index) : stopEffect(index)),
    );
    const row = el(
      "div",
      { className: "row" },
      el("strong", {}, `Effect ${index}`),
      this.facts,
      this.active.root,
    );
    this.root = el("li", { data: { effect: String(index) } }, row);
  }

  update(e: EffectState): void {
    const limit = e.duration_ms > 0 ? `, ${e.duration_ms} ms` : "";
    setText(this.facts, `${e.type}, ${e.magnitude_N} N${limit}`);
    this.active.update(e.active);
  }
}

export class EffectsPanel {
  private readonly list = el("ul", { className: "cards" });
  private readonly rows: Rows<EffectState, EffectRow>;
  private used: number[] = [];

  constructor(parent: HTMLElement, send: Send) {
    this.rows = new Rows(
      this.list,
      (e) => String(e.index),
      (e) => new EffectRow(e, send),
    );
    const type = el(
      "select",
      { ariaLabel: "Type of the new effect" },
      ...Object.entries(NEW).map(([value, { label }]) => el("option", { value }, label)),
    );
    const add = el("button", { type: "button" }, "Add");
    add.addEventListener("click", () => {
      const effect = this.newEffect(type.value);
      send(setEffect(effect), startEffect(effect.index));
    });
    parent.append(this.list, el("div", { className: "row adder" }, type, add));
  }

  update(effects: EffectState[]): void {
    this.used = effects.map((e) => e.index);
    this.rows.update(effects);
  }

  private newEffect(type: string): Effect {
    let index = 0;
    while (this.used.includes(index)) ++index;
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
