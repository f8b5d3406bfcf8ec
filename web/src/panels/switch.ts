// A check box for a value of the server. After a click it shows the requested value until the server confirms it or 2 s pass.
import { el } from "./dom";

export const CONFIRM_MS = 2000;

export class Switch {
  readonly root: HTMLElement;
  private readonly input = el("input", { type: "checkbox" });
  private requestedUntil_ms = 0;

  constructor(label: string, name: string, onChange: (on: boolean) => void) {
    this.input.ariaLabel = name;
    this.input.addEventListener("change", () => {
      this.requestedUntil_ms = performance.now() + CONFIRM_MS;
      onChange(this.input.checked);
    });
    this.root = el("label", { className: "switch" }, this.input, label);
  }

  update(on: boolean): void {
    if (on === this.input.checked) this.requestedUntil_ms = 0;
    else if (performance.now() > this.requestedUntil_ms) this.input.checked = on;
  }
}
