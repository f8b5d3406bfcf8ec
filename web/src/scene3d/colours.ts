// Colours of surface values: a ramp from dark blue to orange that is readable in grey and for colour-blind users.
import { Color } from "three";
import type { ObjectState } from "../state_types";

const RAMP = ["#27408b", "#2f7fb5", "#5fb4a2", "#d9c75f", "#e8743b"].map((c) => new Color(c));

export type Quantity = "object" | "stiffness" | "friction";

/** Told apart also without red or green; the violet of what is no object is not among them. */
const PALETTE = ["#d9a441", "#3f8fc4", "#4aa98b", "#c96f5e", "#8fa63f", "#b07ab0", "#6f8fa8", "#c4c04f"].map(
  (c) => new Color(c),
);
export const colourOfObject = (id: number): Color => PALETTE[id % PALETTE.length]!;

export function colourOf(o: ObjectState, quantity: Quantity, end: number): Color {
  return quantity === "object" ? colourOfObject(o.id) : rampColour(valueOf(o, quantity) / end);
}

/** The colour of a value from 0 to 1. */
export function rampColour(share: number): Color {
  const at = Math.min(Math.max(share, 0), 1) * (RAMP.length - 1);
  const from = Math.min(Math.floor(at), RAMP.length - 2);
  return RAMP[from]!.clone().lerp(RAMP[from + 1]!, at - from);
}

/** The ramp as CSS, for the legend. */
export const rampCss = (): string =>
  `linear-gradient(to right, ${RAMP.map((c) => `#${c.getHexString()}`).join(", ")})`;

export function valueOf(o: ObjectState, quantity: Quantity): number {
  return quantity === "friction" ? o.static_friction : o.stiffness_N_per_m;
}

/** Upper end of the legend: a round number at or above every value. */
export function rangeOf(objects: ObjectState[], quantity: Quantity): number {
  if (quantity === "friction") return 1;
  const most = Math.max(0, ...objects.map((o) => o.stiffness_N_per_m));
  return [500, 1000, 2000, 5000].find((end) => most <= end) ?? 10000;
}
