#include "device/openhaptics/hd_api.h"

namespace hapticd::device::hd {

LibraryNames libraryNames() {
  return {"HAPTICD_HDAPI_LIB", {"libHD.so", "libHD.so.3.4", "libHD.so.3.0"}, {"hd.dll"}};
}

Api::Api(DynamicLibrary library) {
  library.bind(initDevice, "hdInitDevice");
  library.bind(disableDevice, "hdDisableDevice");
  library.bind(makeCurrentDevice, "hdMakeCurrentDevice");
  library.bind(beginFrame, "hdBeginFrame");
  library.bind(endFrame, "hdEndFrame");
  library.bind(enable, "hdEnable");
  library.bind(getBooleanv, "hdGetBooleanv");
  library.bind(getIntegerv, "hdGetIntegerv");
  library.bind(getDoublev, "hdGetDoublev");
  library.bind(setDoublev, "hdSetDoublev");
  library.bind(getString, "hdGetString");
  library.bind(getError, "hdGetError");
  library.bind(checkCalibration, "hdCheckCalibration");
  library.bind(updateCalibration, "hdUpdateCalibration");
  library.bind(startScheduler, "hdStartScheduler");
  library.bind(stopScheduler, "hdStopScheduler");
  library.bind(setSchedulerRate, "hdSetSchedulerRate");
  library.bind(scheduleAsynchronous, "hdScheduleAsynchronous");
  library.bind(unschedule, "hdUnschedule");
  library.complain();
}

const char* errorName(Enum code) noexcept {
  switch (code) {
    case 0x100:
      return "HD_INVALID_ENUM";
    case 0x101:
      return "HD_INVALID_VALUE";
    case 0x102:
      return "HD_INVALID_OPERATION";
    case 0x103:
      return "HD_INVALID_INPUT_TYPE";
    case 0x104:
      return "HD_BAD_HANDLE";
    case 0x200:
      return "HD_WARM_MOTORS";
    case 0x201:
      return "HD_EXCEEDED_MAX_FORCE";
    case 0x202:
      return "HD_EXCEEDED_MAX_FORCE_IMPULSE";
    case 0x203:
      return "HD_EXCEEDED_MAX_VELOCITY";
    case 0x204:
      return "HD_FORCE_ERROR";
    case 0x300:
      return "HD_DEVICE_FAULT";
    case 0x301:
      return "HD_DEVICE_ALREADY_INITIATED";
    case 0x302:
      return "HD_COMM_ERROR";
    case 0x303:
      return "HD_COMM_CONFIG_ERROR";
    case 0x304:
      return "HD_TIMER_ERROR";
    case 0x400:
      return "HD_ILLEGAL_BEGIN";
    case 0x401:
      return "HD_ILLEGAL_END";
    case 0x402:
      return "HD_FRAME_ERROR";
    case 0x500:
      return "HD_INVALID_PRIORITY";
    case 0x501:
      return "HD_SCHEDULER_FULL";
    case 0x600:
      return "HD_INVALID_LICENSE";
    default:
      return "an error without a name";
  }
}

}  // namespace hapticd::device::hd
