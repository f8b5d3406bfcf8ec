// The configuration of the server as one typed value: from defaults, a TOML file and the command line.
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

/// Invalid configuration; the text names file, line, key, value and remedy.
class ConfigError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// An invalid value. Names its key, so that the reader of a file can add file and line.
class InvalidValue : public ConfigError {
 public:
  /// `device` counts from 0; empty for a key of the server itself.
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
/// Which clients may command: all, the first to command until it disconnects, or those at listed addresses.
enum class Control { any, first, list };

/// The box to which the paper's server fits scenes: min xyz, max xyz.
inline constexpr std::array<double, 6> kPaperWorkspace_mm{-80, -80, -70, 80, 80, 20};

/// One haptic device and its names.
struct DeviceConfig {
  std::vector<std::string> names{"Phantom"};
  std::string driver = "simulated";
  std::string hardware;  ///< which device, as its driver names it: a device name, an index, /dev/input/event5
  std::map<std::string, std::string>
      driverKeys;          ///< keys that only some drivers read, as Driver::keys names them
  bool calibrate = false;  ///< consent to calibrate at start and at a re-arm; may move the arm
  /// Run the driver in a separate process: its crash is a fault of the device, not of the server, and that
  /// process ends the force when the server hangs or dies. Nothing: as the driver needs it.
  std::optional<bool> isolate;
  bool enableForces = false;    ///< real devices start without force unless this is set
  std::string hand = "script";  ///< simulated device: "script", or a CSV file with the intended path
  double servoRate_Hz = 1000;
  double reportRate_Hz = 1000;
  double linearTolerance_m = 0.001;  ///< of the reported position (world / 1000)
  double angularTolerance_rad = 0.02;
  double toolRadius_m = 0;
  std::vector<double> workspace_mm;  ///< min xyz, max xyz; empty: that of the device
  bool forceShading = false;  ///< turn the force towards the interpolated vertex normals of smooth meshes
  double stribeckSpeed_m_per_s = 0;    ///< over which friction falls from static to dynamic; 0: at once
  bool vibrationContactPulls = false;  ///< contact vibrations may exceed the normal force
  MaterialScale materialScale = MaterialScale::reference;
  QuaternionOrder quaternionOrder = QuaternionOrder::xyzw;
  ForceReport forceReport = ForceReport::total;
  WorkspaceFit workspaceFit = WorkspaceFit::published;
  VibrationUnit vibrationContactUnit = VibrationUnit::radPerSecond;
  VibrationFrame vibrationMotorFrame = VibrationFrame::stylus;
  std::string scene;  ///< devices with the same name share a scene; empty: not shared
  SceneOnDisconnect sceneOnDisconnect = SceneOnDisconnect::keep;
  Control control = Control::any;
  std::vector<std::string>
      controlList;          ///< IPv4 addresses of the clients that may command, for Control::list
  std::string blackBoxDir;  ///< empty: the user's state directory
  int blackBoxKeep = 10;    ///< how many of the newest black boxes are kept; 0: write none

  bool operator==(const DeviceConfig&) const = default;
};

/// `http` values besides ADDR:PORT. Auto: 127.0.0.1:8080, or no viewer when that port is in use.
inline constexpr const char* kHttpAuto = "auto";
inline constexpr const char* kHttpOff = "off";

struct ServerConfig {
  std::string listenAddress = "127.0.0.1";
  std::uint16_t port = 3883;
  bool allowNoRealtime = false;
  double seconds = 0;                      ///< 0: until stopped
  std::vector<std::string> callbackHosts;  ///< hosts that a UDP request may name besides its source address
  std::string record;                  ///< recording to write; strftime conversions (%) allowed; empty: none
  std::string http = kHttpAuto;        ///< endpoint of the viewer: ADDR:PORT, kHttpAuto or kHttpOff
  int connections = 4096;              ///< of clients at once; further ones may only stop forces
  int connectionsPerAddress = 2048;    ///< the same for each address
  std::vector<std::string> httpAllow;  ///< additional Host names accepted at the web port: HOST or HOST:PORT
  std::vector<DeviceConfig> devices{DeviceConfig{}};

  bool operator==(const ServerConfig&) const = default;
};

/// Reads a TOML file, or a vrpn.cfg (extension .cfg), over the defaults. Throws ConfigError; an unknown key
/// is an error that names the nearest known key. For each skipped line of a vrpn.cfg a text is appended to
/// `warnings`.
ServerConfig loadConfig(const std::filesystem::path& file, std::vector<std::string>& warnings);

/// Parses the text of a TOML configuration; `source` names it in errors.
ServerConfig parseConfig(const std::string& text, const std::string& source);

/// The configuration as TOML with every key; parseConfig() of it returns an equal configuration.
std::string toToml(const ServerConfig& config);

/// Default directory of black boxes: $XDG_STATE_HOME/hapticd, else ~/.local/state/hapticd, else (without
/// $HOME) hapticd in the directory for temporary files.
std::filesystem::path defaultBlackBoxDir();

/// Splits "ADDR:PORT", "ADDR" or ":PORT" over the given defaults. Throws ConfigError.
void parseListen(const std::string& text, std::string& address, std::uint16_t& port);

/// Checks ranges and combinations. Throws InvalidValue.
void validate(const ServerConfig& config);

}  // namespace hapticd::server
