// What the guard can object to, in words: what happens to the force, what it was, what helps. docs/safety.md has the same list.

export interface Trip {
  force: "shaped" | "held" | "latched";
  words: string;
}

const TRIPS: Record<string, Trip> = {
  not_finite: {
    force: "held",
    words: "The rendered force was not a number. Look for a broken mesh or effect.",
  },
  peak_force: { force: "shaped", words: "The force is cut to the peak of the device." },
  thermal: {
    force: "shaped",
    words: "The force is lowered: its mean over 5 s reached what the device can hold.",
  },
  slew: { force: "shaped", words: "The force rises no faster than 1 N in 1 ms." },
  speed: { force: "latched", words: "The device moved faster than 1.2 m/s. Hold it still and re-arm." },
  late: { force: "held", words: "A tick came more than 3 ms late: the machine is busy." },
  stalled: {
    force: "latched",
    words: "A tick came more than 50 ms late. Re-arm when the machine is free again.",
  },
  no_state: {
    force: "held",
    words: "The device gives no state or does not take the force. Check its cable.",
  },
  not_calibrated: {
    force: "held",
    words: "The device is not calibrated. Start the server with --calibrate.",
  },
  dead_man: { force: "held", words: "The dead-man switch is open. Take the stylus in the hand." },
  inkwell: { force: "held", words: "The stylus is docked. Take it out." },
  hot: { force: "held", words: "The motors are too hot. Let them cool." },
  device_fault: { force: "latched", words: "The driver reports an error. Clear it, then re-arm." },
  stopped: { force: "held", words: "Forces were stopped. Re-arm to go on." },
  disarmed: {
    force: "held",
    words: "Forces are not enabled for this device. Start the server with --enable-forces.",
  },
  geometry_jump: { force: "shaped", words: "Geometry jumped under the hand; the force is blended." },
  deep_contact: {
    force: "shaped",
    words: "The first contact was too deep; it is felt again once the hand has left.",
  },
};

export const tripOf = (name: string): Trip => TRIPS[name] ?? { force: "held", words: "See docs/safety.md." };
