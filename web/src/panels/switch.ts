// A check box that shows what the server has, and after a click what was asked for, until the server has had time to say so.
import { el } from "./dom";

const PATIENCE_MS = 2000;

export class Switch {
  readonly root: HTMLElement;
  private readonly input = el("input", { type: "checkbox" });
  private askedUntil_ms = 0;

  constructor(label: string, name: string, onChange: (on: boolean) => void) {
    this.input.ariaLabel = name;
    this.input.addEventListener("change", () => {
      this.askedUntil_ms = performance.now() + PATIENCE_MS;
      onChange(this.input.checked);
    });
    this.root = el("label", { className: "switch" }, this.input, label);
  }

  update(on: boolean): void {
    if (on === this.input.checked) this.askedUntil_ms = 0;
    else if (performance.now() > this.askedUntil_ms) this.input.checked = on;
  }
}
