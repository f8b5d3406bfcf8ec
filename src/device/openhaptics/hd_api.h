// Our own declarations of the HDAPI functions that this driver calls, bound at run time.
#pragma once

#include <cstdint>

#include "device/dynamic_library.h"

#if defined(_WIN32) && !defined(_WIN64)
#define HAPTICD_HD_CALL __stdcall
#else
#define HAPTICD_HD_CALL
#endif

namespace hapticd::device::hd {

using Handle = unsigned int;
using Enum = unsigned int;
using Code = unsigned int;
using SchedulerHandle = unsigned long;
using Boolean = unsigned char;
using Callback = Code(HAPTICD_HD_CALL*)(void*);

struct ErrorInfo {
  Enum code;
  int internalCode;
  Handle device;
};

inline constexpr Handle kInvalidHandle = 0xFFFFFFFF;  // 0 is a device
inline constexpr Code kContinue = 1;
inline constexpr unsigned short kFirstPriority = 65535;

inline constexpr Enum kCurrentButtons = 0x2000;
inline constexpr Enum kCurrentSafetySwitch = 0x2001;
inline constexpr Enum kCurrentInkwellSwitch = 0x2002;
inline constexpr Enum kCurrentPosition = 0x2050;         // mm
inline constexpr Enum kCurrentVelocity = 0x2051;         // mm/s
inline constexpr Enum kCurrentTransform = 0x2052;        // column-major
inline constexpr Enum kCurrentAngularVelocity = 0x2053;  // rad/s
inline constexpr Enum kModel = 0x2501;
inline constexpr Enum kDriverVersion = 0x2502;
inline constexpr Enum kSerialNumber = 0x2504;
inline constexpr Enum kUsableWorkspace = 0x2551;  // mm
inline constexpr Enum kInputDof = 0x2553;
inline constexpr Enum kOutputDof = 0x2554;
inline constexpr Enum kCalibrationStyle = 0x2555;
inline constexpr Enum kMaxStiffness = 0x2602;  // N/mm
inline constexpr Enum kMaxForce = 0x2603;
inline constexpr Enum kMaxContinuousForce = 0x2604;
inline constexpr Enum kMotorTemperature = 0x2605;       // 0 … 1 for each of up to 6 motors
inline constexpr Enum kSoftwareVelocityLimit = 0x2606;  // mm/s
inline constexpr Enum kSoftwareImpulseLimit = 0x2607;   // N in one tick
inline constexpr Enum kCurrentForce = 0x2700;
inline constexpr Enum kCurrentGimbalTorque = 0x2704;  // mNm
inline constexpr Enum kForceOutput = 0x4000;

inline constexpr Enum kCalibrationOk = 0x5000;
inline constexpr Enum kCalibrationNeedsUpdate = 0x5001;
inline constexpr int kStyleEncoderReset = 1;
inline constexpr int kStyleAuto = 2;
inline constexpr int kStyleInkwell = 4;

inline constexpr Enum kSuccess = 0;
inline constexpr Enum kWarmMotors = 0x200;
inline constexpr Enum kForceErrors = 0x200;      // … 0x2FF
inline constexpr Enum kDeviceErrors = 0x300;     // … 0x3FF
inline constexpr Enum kFrameErrors = 0x400;      // … 0x4FF
inline constexpr Enum kSchedulerErrors = 0x500;  // … 0x5FF

/// An error of the device or its link: only reopening helps.
inline bool isDeviceError(Enum code) noexcept {
  return code >= kDeviceErrors && code < kFrameErrors;
}
/// The name of an error in the vendor's manual.
const char* errorName(Enum code) noexcept;

/// All functions that the driver calls. Most of them crash inside the library when no device is open.
struct Api {
  Handle(HAPTICD_HD_CALL* initDevice)(const char*) = nullptr;
  void(HAPTICD_HD_CALL* disableDevice)(Handle) = nullptr;
  void(HAPTICD_HD_CALL* makeCurrentDevice)(Handle) = nullptr;
  void(HAPTICD_HD_CALL* beginFrame)(Handle) = nullptr;
  void(HAPTICD_HD_CALL* endFrame)(Handle) = nullptr;
  void(HAPTICD_HD_CALL* enable)(Enum) = nullptr;
  void(HAPTICD_HD_CALL* getBooleanv)(Enum, Boolean*) = nullptr;
  void(HAPTICD_HD_CALL* getIntegerv)(Enum, int*) = nullptr;
  void(HAPTICD_HD_CALL* getDoublev)(Enum, double*) = nullptr;
  void(HAPTICD_HD_CALL* setDoublev)(Enum, const double*) = nullptr;
  const char*(HAPTICD_HD_CALL* getString)(Enum) = nullptr;
  ErrorInfo(HAPTICD_HD_CALL* getError)() = nullptr;
  Enum(HAPTICD_HD_CALL* checkCalibration)() = nullptr;
  void(HAPTICD_HD_CALL* updateCalibration)(Enum) = nullptr;
  void(HAPTICD_HD_CALL* startScheduler)() = nullptr;
  void(HAPTICD_HD_CALL* stopScheduler)() = nullptr;
  void(HAPTICD_HD_CALL* setSchedulerRate)(unsigned long) = nullptr;
  SchedulerHandle(HAPTICD_HD_CALL* scheduleAsynchronous)(Callback, void*, unsigned short) = nullptr;
  void(HAPTICD_HD_CALL* unschedule)(SchedulerHandle) = nullptr;

  /// Binds all functions. Throws LibraryError with all missing names.
  explicit Api(DynamicLibrary library);
};

/// Names of the library; HAPTICD_HDAPI_LIB overrides them.
LibraryNames libraryNames();

}  // namespace hapticd::device::hd
