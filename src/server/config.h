// What the operator chose: one typed value for everything, from defaults, a TOML file and the command line.
#pragma once

#include <cstdint>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "scene/config.h"

namespace hapticd::server {

/// Wrong configuration; the text names file, line, key, value and remedy.
class ConfigError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

using scene::MaterialScale;
using scene::VibrationFrame;
using scene::VibrationUnit;
using scene::WorkspaceFit;
enum class QuaternionOrder { xyzw, wxyz };
enum class ForceReport { total, normal };
enum class SceneOnDisconnect { keep, clear };

/// One haptic device and the names it answers to.
struct DeviceConfig {
  std::vector<std::string> names{"Phantom"};
  std::string driver = "simulated";
  std::string hardware;      ///< which one, in the driver's words: a device name, an index, /dev/input/event5
  std::string wheelProfile;  ///< evdev: TOML file with the newtons of a wheel or joystick
  bool calibrate = false;    ///< consent to calibrate at the start, which may move the arm
  bool enableForces = false;    ///< real devices start without force unless this is set
  std::string hand = "script";  ///< simulated device: "script", or a CSV file with the intended path
  double servoRate_Hz = 1000;
  double reportRate_Hz = 1000;
  double linearTolerance_m = 0.001;  ///< of the reported position (world / 1000)
  double angularTolerance_rad = 0.02;
  double toolRadius_m = 0;
  std::vector<double> workspace_mm;  ///< empty: the device's own; else min xyz, max xyz
  MaterialScale materialScale = MaterialScale::reference;
  QuaternionOrder quaternionOrder = QuaternionOrder::xyzw;
  ForceReport forceReport = ForceReport::total;
  WorkspaceFit workspaceFit = WorkspaceFit::published;
  VibrationUnit vibrationContactUnit = VibrationUnit::radPerSecond;
  VibrationFrame vibrationMotorFrame = VibrationFrame::stylus;
  SceneOnDisconnect sceneOnDisconnect = SceneOnDisconnect::keep;
};

struct ServerConfig {
  std::string listenAddress = "127.0.0.1";
  std::uint16_t port = 3883;
  bool allowNoRealtime = false;
  double seconds = 0;                      ///< 0: until stopped
  std::vector<std::string> callbackHosts;  ///< hosts that a UDP request may name besides the sender's own
  std::vector<DeviceConfig> devices{DeviceConfig{}};
};

/// Reads a TOML file over the defaults. Throws ConfigError; unknown keys are errors, with the nearest known
/// key named.
ServerConfig loadConfig(const std::filesystem::path& file);

/// Parses the text of a configuration; `source` names it in errors.
ServerConfig parseConfig(const std::string& text, const std::string& source);

/// Splits "ADDR:PORT", "ADDR" or ":PORT" over the given defaults. Throws ConfigError.
void parseListen(const std::string& text, std::string& address, std::uint16_t& port);

/// Checks ranges and combinations. Throws ConfigError.
void validate(const ServerConfig& config);

}  // namespace hapticd::server
