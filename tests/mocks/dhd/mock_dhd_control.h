// How a test plays with the mock of libdrd/libdhd. Vendor frame: x to the user, y right, z up.
#pragma once

extern "C" {

struct MockDhd {
  /// As freshly loaded: one calibrated omega.3, closed.
  void (*reset)();
  void (*devices)(int count, const char* name);
  void (*calibrated)(int yes);
  void (*hand)(const double position[3], const double velocity[3]);
  void (*turn)(const double rowMajor[9]);
  void (*buttons)(int mask);
  void (*gripper)(int has, double angle);
  void (*gripperFails)(int yes);
  /// So many reads from now on fail; -1: all.
  void (*failReads)(int count);
  void (*status)(int index, int value);
  /// Time passes for the device: its watchdog may fire.
  void (*elapse)(double seconds);
  /// Seconds that a calibration takes; below 0: it fails at once.
  void (*calibrationTime)(double seconds);

  /// What the motors give: zero with the amplifiers off.
  void (*force)(double force_N[3]);
  /// Torque xyz and the gripper's force; what a program before this one left there until they are set.
  void (*torque)(double torque_Nm[3], double* grip_N);
  int (*amplifiersOn)();
  int (*isOpen)();
  int (*calibrations)();
  int (*gravityCompensation)();
  int (*timeGuard)();
  int (*watchdog)();
  double (*maxForce)();
  /// A thread of the library drives the motors.
  int (*regulating)();
  /// Two arms, 0 and 1, have the serial numbers 4711 and 4712. One without power is out of the order of
  /// numbers.
  void (*power)(int arm, int on);
  void (*forceOf)(int arm, double force_N[3]);
  int (*isOpenArm)(int arm);
};

const MockDhd* mockDhd();
}
