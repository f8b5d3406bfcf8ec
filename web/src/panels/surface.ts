// Sliders for the surface of one object: each from 0 to 1, as setHapticProperty takes them.
import type { DeviceState, ObjectState } from "../state_types";
import type { SurfaceProperty } from "../wire";
import { el, setText } from "./dom";

/** What 1 means (docs/haptics.md); a device with other materials says it in its state. */
export interface Materials {
  stiffness_N_per_m: number;
  damping_Ns_per_m: number;
  popthrough_N: number;
}
const REFERENCE: Materials = { stiffness_N_per_m: 500, damping_Ns_per_m: 2, popthrough_N: 3.3 };

export const materialsOf = (device: DeviceState & { material_one?: Materials }): Materials =>
  device.material_one ?? REFERENCE;

interface Slider {
  property: SurfaceProperty;
  label: string;
  /** The value from 0 to 1 in a state, and its text. */
  share(o: ObjectState, m: Materials): number;
  text(share: number, m: Materials): string;
}

const SLIDERS: Slider[] = [
  {
    property: "stiffness",
    label: "Stiffness",
    share: (o, m) => o.stiffness_N_per_m / m.stiffness_N_per_m,
    text: (v, m) => `${(v * m.stiffness_N_per_m).toFixed(0)} N/m`,
  },
  {
    property: "damping",
    label: "Damping",
    share: (o, m) => o.damping_Ns_per_m / m.damping_Ns_per_m,
    text: (v, m) => `${(v * m.damping_Ns_per_m).toFixed(2)} N s/m`,
  },
  {
    property: "static friction",
    label: "Static friction",
    share: (o) => o.static_friction,
    text: (v) => v.toFixed(2),
  },
  {
    property: "dynamic friction",
    label: "Dynamic friction",
    share: (o) => o.dynamic_friction,
    text: (v) => v.toFixed(2),
  },
  {
    property: "popthrough",
    label: "Popthrough",
    share: (o, m) => o.popthrough / m.popthrough_N,
    text: (v, m) => (v === 0 ? "never" : `${(v * m.popthrough_N).toFixed(2)} N`),
  },
];

export class SurfaceForm {
  readonly root = el("div", { className: "sliders" });
  private readonly inputs: { slider: Slider; input: HTMLInputElement; output: HTMLOutputElement }[] = [];
  private materials = REFERENCE;

  constructor(private readonly onChange: (property: SurfaceProperty, share: number) => void) {
    for (const slider of SLIDERS) {
      const input = el("input", { type: "range", min: "0", max: "1", step: "0.01", name: slider.property });
      const output = el("output");
      input.addEventListener("input", () => {
        setText(output, slider.text(input.valueAsNumber, this.materials));
        this.onChange(slider.property, input.valueAsNumber);
      });
      this.root.append(el("label", {}, el("span", {}, slider.label), input, output));
      this.inputs.push({ slider, input, output });
    }
  }

  /** The values as 0 to 1 each. */
  values(): [SurfaceProperty, number][] {
    return this.inputs.map(({ slider, input }) => [slider.property, input.valueAsNumber]);
  }

  set(shares: Partial<Record<SurfaceProperty, number>>, materials: Materials): void {
    this.materials = materials;
    for (const { slider, input, output } of this.inputs) {
      const value = shares[slider.property] ?? 0;
      if (document.activeElement !== input) input.value = String(value);
      setText(output, slider.text(input.valueAsNumber, materials));
    }
  }

  update(o: ObjectState, materials: Materials): void {
    this.set(Object.fromEntries(SLIDERS.map((s) => [s.property, s.share(o, materials)])), materials);
  }
}
