#include "device/force_dimension/dhd_api.h"

namespace hapticd::device::dhd {

LibraryNames libraryNames() {
  // drd contains dhd, and can calibrate.
  return {"HAPTICD_DHD_LIB",
          {"libdrd.so.3", "libdrd.so", "libdhd.so.3", "libdhd.so"},
          {"drd64.dll", "dhd64.dll"}};
}

Api::Api(DynamicLibrary library) {
  library.bind(getDeviceCount, "dhdGetDeviceCount");
  library.bind(openID, "dhdOpenID");
  library.bind(close, "dhdClose");
  library.bind(getSystemName, "dhdGetSystemName");
  library.bind(getStatus, "dhdGetStatus");
  library.bind(getPosition, "dhdGetPosition");
  library.bind(getLinearVelocity, "dhdGetLinearVelocity");
  library.bind(getOrientationFrame, "dhdGetOrientationFrame");
  library.bind(getButtonMask, "dhdGetButtonMask");
  library.bind(setForceAndTorqueAndGripperForce, "dhdSetForceAndTorqueAndGripperForce");
  library.bind(enableForce, "dhdEnableForce");
  library.bind(setGravityCompensation, "dhdSetGravityCompensation");
  library.bind(setTimeGuard, "dhdSetTimeGuard");
  library.bind(stop, "dhdStop");
  library.bind(errorGetLastStr, "dhdErrorGetLastStr");
  library.complain();

  library.bindOptional(getSerialNumber, "dhdGetSerialNumber");
  library.bindOptional(hasGripper, "dhdHasGripper");
  library.bindOptional(getGripperAngleRad, "dhdGetGripperAngleRad");
  library.bindOptional(setEffectorMass, "dhdSetEffectorMass");
  library.bindOptional(setMaxForce, "dhdSetMaxForce");
  library.bindOptional(setWatchdog, "dhdSetWatchdog");
  library.bindOptional(openForCalibration, "drdOpenID");
  library.bindOptional(closeForCalibration, "drdClose");
  library.bindOptional(isInitialized, "drdIsInitialized");
  library.bindOptional(autoInit, "drdAutoInit");
  library.bindOptional(stopRegulation, "drdStop");
}

}  // namespace hapticd::device::dhd
