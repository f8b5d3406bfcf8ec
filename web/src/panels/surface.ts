// Sliders for the surface of one object, each from 0 to 1, the range of setHapticProperty.
import type { SurfaceState } from "../state_types";
import type { SurfaceProperty } from "../wire";
import { el, setText } from "./dom";

interface Slider {
  property: SurfaceProperty;
  label: string;
  of(surface: SurfaceState): number;
  text(value: number): string;
}

/** The values at 1 with material_scale = "reference" (docs/haptics.md). */
const REFERENCE: SurfaceState = {
  stiffness_N_per_m: 500,
  damping_Ns_per_m: 2,
  static_friction: 1,
  dynamic_friction: 1,
  popthrough: 3.3,
};

const plain = (value: number): string => value.toFixed(2);

const SLIDERS: Slider[] = [
  {
    property: "stiffness",
    label: "Stiffness",
    of: (o) => o.stiffness_N_per_m,
    text: (v) => `${v.toFixed(0)} N/m`,
  },
  {
    property: "damping",
    label: "Damping",
    of: (o) => o.damping_Ns_per_m,
    text: (v) => `${plain(v)} N s/m`,
  },
  {
    property: "static friction",
    label: "Static friction",
    of: (o) => o.static_friction,
    text: plain,
  },
  {
    property: "dynamic friction",
    label: "Dynamic friction",
    of: (o) => o.dynamic_friction,
    text: plain,
  },
  {
    property: "popthrough",
    label: "Popthrough",
    of: (o) => o.popthrough,
    text: (v) => (v === 0 ? "never" : `${plain(v)} N`),
  },
];

export class SurfaceForm {
  readonly root = el("div", { className: "sliders" });
  private readonly rows: { slider: Slider; input: HTMLInputElement; output: HTMLOutputElement }[] = [];

  /** The values at 1. */
  private one = REFERENCE;

  constructor(private readonly onChange: (property: SurfaceProperty, share: number) => void) {
    for (const slider of SLIDERS) {
      const input = el("input", {
        type: "range",
        min: "0",
        max: "1",
        step: "0.01",
        value: "0",
        name: slider.property,
      });
      const output = el("output");
      input.addEventListener("input", () => {
        setText(output, slider.text(input.valueAsNumber * slider.of(this.one)));
        this.onChange(slider.property, input.valueAsNumber);
      });
      this.root.append(el("label", {}, el("span", {}, slider.label), input, output));
      this.rows.push({ slider, input, output });
    }
  }

  /** The values, each from 0 to 1. */
  values(): [SurfaceProperty, number][] {
    return this.rows.map(({ slider, input }) => [slider.property, input.valueAsNumber]);
  }

  set(shares: Partial<Record<SurfaceProperty, number>>, one: SurfaceState | null | undefined): void {
    this.one = one ?? REFERENCE;
    for (const { slider, input, output } of this.rows) {
      input.value = String(shares[slider.property] ?? 0);
      setText(output, slider.text(input.valueAsNumber * slider.of(this.one)));
    }
  }

  /** Shows the values of the server; a slider in use keeps its position. */
  update(o: SurfaceState, one: SurfaceState | null | undefined): void {
    this.one = one ?? REFERENCE;
    for (const { slider, input, output } of this.rows) {
      if (document.activeElement !== input) input.value = String(slider.of(o) / slider.of(this.one));
      setText(output, slider.text(slider.of(o)));
    }
  }
}
