// How a test plays with the mock of libHD: the arm's pose, faults on demand, and what the motors get.
#pragma once

extern "C" {

/// All functions may be called from any thread. `device` is 0 or 1.
struct MockHd {
  /// As freshly loaded: no device open, calibrated, cold, nobody touching anything.
  void (*reset)();
  /// No thread of its own: the scheduler ticks only in step().
  void (*stepped)(int on);
  /// Runs so many ticks in the calling thread; nothing when the scheduler is stopped.
  void (*step)(int ticks);
  /// The only name that opens a device from now on; null: the default; "*": every name.
  void (*onlyName)(const char* name);
  void (*model)(const char* name, int calibrationStyle);
  /// Axes with motors: 3, or 6 with those of the gimbal.
  void (*outputDof)(int axes);
  /// Prints a banner and reads a key from stdin in every init.
  void (*banner)(int on);

  /// mm, mm/s; at the next frame.
  void (*hand)(int device, const double position[3], const double velocity[3]);
  /// Column-major rotation.
  void (*turn)(int device, const double rotation[9]);
  void (*buttons)(int device, int bits);
  /// 0 with the stylus docked.
  void (*inkwellSwitch)(int device, int value);
  void (*safetySwitch)(int device, int value);
  void (*temperature)(int device, double value);
  void (*calibration)(int device, unsigned status);
  /// Puts this error on the stack in the next tick.
  void (*fail)(int device, unsigned code);
  /// Every frame fails from now on and the arm is where it was, as with the cable pulled; the library tells
  /// it only the first time.
  void (*unplug)(int device);
  void (*plugIn)(int device);

  /// What the motors give now: zero without scheduler or force output.
  void (*force)(int device, double force_N[3]);
  /// mNm; what a program before this one left there until it is set.
  void (*torque)(int device, double torque_mNm[3]);
  int (*frames)(int device);
  int (*calibrationUpdates)(int device);
  int (*isOpen)(int device);
  int (*schedulerRuns)();
  unsigned short (*priority)();
};

const MockHd* mockHd();
}
