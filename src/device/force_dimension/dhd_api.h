// Our own declarations of the DHD and DRD functions of Force Dimension that this driver calls, bound at run
// time.
#pragma once

#include "device/dynamic_library.h"

#if defined(_WIN32) && !defined(_WIN64)
#define HAPTICD_DHD_CALL __stdcall
#else
#define HAPTICD_DHD_CALL
#endif

namespace hapticd::device::dhd {

inline constexpr int kStatusLength = 32;  // more than any version fills
inline constexpr int kStatusNeedsCalibration = 3;
inline constexpr int kStatusForce = 5;
inline constexpr int kStatusError = 9;

/// All functions that the driver calls; every result below 0 is a failure. Metres, newtons, radians; x
/// towards the user, y to the right, z up. The last argument is always the device.
struct Api {
  int(HAPTICD_DHD_CALL* getDeviceCount)() = nullptr;
  int(HAPTICD_DHD_CALL* openID)(char index) = nullptr;
  int(HAPTICD_DHD_CALL* close)(char) = nullptr;
  const char*(HAPTICD_DHD_CALL* getSystemName)(char) = nullptr;
  int(HAPTICD_DHD_CALL* getStatus)(int* status, char) = nullptr;
  int(HAPTICD_DHD_CALL* getPosition)(double*, double*, double*, char) = nullptr;
  int(HAPTICD_DHD_CALL* getLinearVelocity)(double*, double*, double*, char) = nullptr;
  int(HAPTICD_DHD_CALL* getOrientationFrame)(double (*rowMajor)[3], char) = nullptr;
  int(HAPTICD_DHD_CALL* getButtonMask)(char) = nullptr;
  int(HAPTICD_DHD_CALL* setForceAndTorqueAndGripperForce)(double fx, double fy, double fz, double tx,
                                                          double ty, double tz, double grip, char) = nullptr;
  int(HAPTICD_DHD_CALL* enableForce)(unsigned char, char) = nullptr;
  int(HAPTICD_DHD_CALL* setGravityCompensation)(int, char) = nullptr;
  int(HAPTICD_DHD_CALL* setTimeGuard)(int microseconds, char) = nullptr;
  int(HAPTICD_DHD_CALL* stop)(char) = nullptr;
  const char*(HAPTICD_DHD_CALL* errorGetLastStr)() = nullptr;

  // Not in every version, or only in libdrd.
  int(HAPTICD_DHD_CALL* getSerialNumber)(unsigned short*, char) = nullptr;
  bool(HAPTICD_DHD_CALL* hasGripper)(char) = nullptr;
  int(HAPTICD_DHD_CALL* getGripperAngleRad)(double*, char) = nullptr;
  int(HAPTICD_DHD_CALL* setEffectorMass)(double kg, char) = nullptr;
  int(HAPTICD_DHD_CALL* setMaxForce)(double, char) = nullptr;
  int(HAPTICD_DHD_CALL* setWatchdog)(unsigned char steps, char) = nullptr;  // of 125 µs; 0: off
  int(HAPTICD_DHD_CALL* openForCalibration)(char index) = nullptr;
  int(HAPTICD_DHD_CALL* closeForCalibration)(char) = nullptr;
  bool(HAPTICD_DHD_CALL* isInitialized)(char) = nullptr;
  int(HAPTICD_DHD_CALL* autoInit)(char) = nullptr;  // moves the arm
  int(HAPTICD_DHD_CALL* stopRegulation)(bool forceOn, char) = nullptr;

  /// Binds all functions. Throws LibraryError with all missing names.
  explicit Api(DynamicLibrary library);
  /// Whether the library can calibrate.
  bool canCalibrate() const noexcept {
    return openForCalibration != nullptr && closeForCalibration != nullptr && isInitialized != nullptr &&
           autoInit != nullptr && stopRegulation != nullptr;
  }
};

/// Names of the library; HAPTICD_DHD_LIB overrides them.
LibraryNames libraryNames();

}  // namespace hapticd::device::dhd
