// Generated from include/hapticd/trips.h and src/server/session/refusal_codes.h. Do not edit; to update it, run
//   build/release/bin/page_tables > web/src/server_tables.ts

export interface Trip {
  /** Bit number in Tick.guardActive and in GuardState. */
  bit: number;
  /** clamp: shapes the force; hold: zero force while the cause lasts; latch: zero force until re-armed. */
  action: "clamp" | "hold" | "latch";
  what: string;
  remedy: string;
}

export const TRIPS = {
  not_finite: {
    bit: 0,
    action: "hold",
    what: "The rendered force or the device state was not a finite number.",
    remedy: "Check the meshes and effects for values that are not finite.",
  },
  peak_force: {
    bit: 1,
    action: "clamp",
    what: "The rendered force exceeded the peak force of the device.",
    remedy: "No action is needed; a lower stiffness or effect magnitude avoids it.",
  },
  thermal: {
    bit: 2,
    action: "clamp",
    what: "The mean force over 5 s reached the continuous force of the device.",
    remedy: "Press less for a few seconds; the full force returns by itself.",
  },
  slew: {
    bit: 3,
    action: "clamp",
    what: "The rendered force rose faster than 1 N in 1 ms.",
    remedy: "No action is needed; the force follows within a few milliseconds.",
  },
  speed: {
    bit: 4,
    action: "latch",
    what: "The device moved faster than 1.2 m/s.",
    remedy: "Hold the device still, then re-arm.",
  },
  late: {
    bit: 5,
    action: "hold",
    what: "A servo tick was more than 3 ms late.",
    remedy: "Reduce the load on the machine; `hapticd doctor` checks its real-time settings.",
  },
  stalled: {
    bit: 6,
    action: "latch",
    what: "A servo tick was more than 50 ms late.",
    remedy: "Re-arm when the machine is no longer overloaded.",
  },
  no_state: {
    bit: 7,
    action: "hold",
    what: "The device returned no state or did not accept the force.",
    remedy: "Check the cable and the power of the device.",
  },
  not_calibrated: {
    bit: 8,
    action: "hold",
    what: "The device is not calibrated.",
    remedy: "Start the server with --calibrate, or calibrate the device with the vendor's tool.",
  },
  dead_man: {
    bit: 9,
    action: "hold",
    what: "The dead-man or presence switch is open.",
    remedy: "Hold the stylus so that the switch closes.",
  },
  inkwell: {
    bit: 10,
    action: "hold",
    what: "The stylus is docked.",
    remedy: "Take the stylus out of the inkwell.",
  },
  hot: {
    bit: 11,
    action: "hold",
    what: "The motors are too hot.",
    remedy: "Let the motors cool; the force returns by itself.",
  },
  device_fault: {
    bit: 12,
    action: "latch",
    what: "The driver reports a fault.",
    remedy: "Clear the fault, then re-arm.",
  },
  stopped: {
    bit: 13,
    action: "hold",
    what: "A client stopped the forces.",
    remedy: "Re-arm to continue.",
  },
  disarmed: {
    bit: 14,
    action: "hold",
    what: "Forces are not enabled for this device.",
    remedy: "Start the server with --enable-forces.",
  },
  geometry_jump: {
    bit: 15,
    action: "clamp",
    what: "A command changed geometry or surface in contact at once, and the force was blended over 20 ms.",
    remedy: "No action is needed; smaller steps avoid it.",
  },
  deep_contact: {
    bit: 16,
    action: "clamp",
    what: "An object appeared around the device or jumped over it, or the first contact was too deep: it exerts no force.",
    remedy: "Move the device out of the object; then the object can be felt.",
  },
} as const satisfies Record<string, Trip>;

/** Why the server refused a command: the level of its text. */
export const REFUSAL = {
  none: 0,
  notPermitted: 1,
  handNotSimulated: 2,
  handHeldByOther: 3,
  handPoseInvalid: 4,
  streamedByOther: 5,
  streamInvalid: 6,
  stoppedByOther: 7,
  tokenRefused: 8,
  batchRefused: 9,
} as const;
