// What the operator chose: one typed value for everything, from defaults, a TOML file and the command line.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
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

/// A value that no server can live with. Knows where it is set, so that who read it can name file and line.
class InvalidValue : public ConfigError {
 public:
  /// `device` counts from 0; nothing for a key of the server itself.
  InvalidValue(std::optional<std::size_t> device, std::string key, const std::string& text)
      : ConfigError(text), device_(device), key_(std::move(key)) {}
  std::optional<std::size_t> device() const noexcept { return device_; }
  const std::string& key() const noexcept { return key_; }

 private:
  std::optional<std::size_t> device_;
  std::string key_;
};

using scene::MaterialScale;
using scene::VibrationFrame;
using scene::VibrationUnit;
using scene::WorkspaceFit;
enum class QuaternionOrder { xyzw, wxyz };
enum class ForceReport { total, normal };
enum class SceneOnDisconnect { keep, clear };
/// Who may change the scene: everybody, the first to try and as long as it stays, or listed addresses.
enum class Control { any, first, list };

/// The box that the paper's server fits scenes to: min xyz, max xyz.
inline constexpr std::array<double, 6> kPaperWorkspace_mm{-80, -80, -70, 80, 80, 20};

/// One haptic device and the names it answers to.
struct DeviceConfig {
  std::vector<std::string> names{"Phantom"};
  std::string driver = "simulated";
  std::string hardware;  ///< which one, in the driver's words: a device name, an index, /dev/input/event5
  std::map<std::string, std::string> driverKeys;  ///< keys that only some drivers read, as Driver::keys names them
  bool calibrate = false;                         ///< consent to calibrate at the start and at a re-arm; may move the arm
  bool isolate = false;  ///< the driver runs in a process of its own: its crash is a fault, not the end
  bool enableForces = false;    ///< real devices start without force unless this is set
  std::string hand = "script";  ///< simulated device: "script", or a CSV file with the intended path
  double servoRate_Hz = 1000;
  double reportRate_Hz = 1000;
  double linearTolerance_m = 0.001;  ///< of the reported position (world / 1000)
  double angularTolerance_rad = 0.02;
  double toolRadius_m = 0;
  std::vector<double> workspace_mm;  ///< empty: the device's own; else min xyz, max xyz
  bool forceShading = false;         ///< smooth meshes: the force turns from corner to corner
  MaterialScale materialScale = MaterialScale::reference;
  QuaternionOrder quaternionOrder = QuaternionOrder::xyzw;
  ForceReport forceReport = ForceReport::total;
  WorkspaceFit workspaceFit = WorkspaceFit::published;
  VibrationUnit vibrationContactUnit = VibrationUnit::radPerSecond;
  VibrationFrame vibrationMotorFrame = VibrationFrame::stylus;
  std::string scene;  ///< devices that name the same one share it; empty: one of its own
  SceneOnDisconnect sceneOnDisconnect = SceneOnDisconnect::keep;
  Control control = Control::any;
  std::vector<std::string> controlList;  ///< IPv4 addresses of who may command, for Control::list
  std::string blackBoxDir;               ///< empty: the user's state directory
  int blackBoxKeep = 10;                 ///< newest black boxes that stay; 0: none is written

  bool operator==(const DeviceConfig&) const = default;
};

/// The web port: 127.0.0.1:8080, or none when that is in use.
inline constexpr const char* kHttpAuto = "auto";
inline constexpr const char* kHttpOff = "off";

struct ServerConfig {
  std::string listenAddress = "127.0.0.1";
  std::uint16_t port = 3883;
  bool allowNoRealtime = false;
  double seconds = 0;                      ///< 0: until stopped
  std::vector<std::string> callbackHosts;  ///< hosts that a UDP request may name besides the sender's own
  std::string record;                      ///< session file to write; may hold strftime's %; empty: none
  std::string http = kHttpAuto;            ///< where the page is: ADDR:PORT, kHttpAuto or kHttpOff
  std::vector<std::string> httpAllow;      ///< further names of the web port: HOST, or HOST:PORT
  std::vector<DeviceConfig> devices{DeviceConfig{}};

  bool operator==(const ServerConfig&) const = default;
};

/// Reads a TOML file, or one called *.cfg in the form of vrpn.cfg, over the defaults. Throws ConfigError;
/// unknown keys are errors, with the nearest known key named. What was left out of a vrpn.cfg is appended to
/// `remarks`, one line each.
ServerConfig loadConfig(const std::filesystem::path& file, std::vector<std::string>& remarks);

/// Parses the text of a TOML configuration; `source` names it in errors.
ServerConfig parseConfig(const std::string& text, const std::string& source);

/// The configuration as TOML with every key: parseConfig() of it gives the same configuration.
std::string toToml(const ServerConfig& config);

/// Where black boxes are written unless configured: $XDG_STATE_HOME/hapticd, else ~/.local/state/hapticd,
/// else (no home) hapticd in the directory for temporary files.
std::filesystem::path defaultBlackBoxDir();

/// Splits "ADDR:PORT", "ADDR" or ":PORT" over the given defaults. Throws ConfigError.
void parseListen(const std::string& text, std::string& address, std::uint16_t& port);

/// Checks ranges and combinations. Throws InvalidValue.
void validate(const ServerConfig& config);

}  // namespace hapticd::server
