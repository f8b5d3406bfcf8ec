// The configuration of the server as one typed value: from defaults, a TOML file and the command line.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "base/printable.h"
#include "scene/config.h"

namespace hapticd::server {

/// Invalid configuration; the text names file, line, key, value and remedy, in one line whatever the values
/// are.
class ConfigError : public std::runtime_error {
 public:
  explicit ConfigError(const std::string& text) : std::runtime_error(base::printable(text)) {}
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

/// What a client finds under a name of the device. Stock clients take every sensor for the first one and
/// every button for one of the device, so anything beyond them has a name of its own.
enum class View {
  device,   ///< everything that the client subscribed to
  hand,     ///< tracker whose sensor 0 is the HIP
  contact,  ///< tracker whose sensor 0 is the surface contact point, during contact
  touch,    ///< button 0 is "touching"; the analog channels mirror the contact
};

/// The mirrors of a device NAME are called NAME.hand, NAME.contact and NAME.touch.
inline constexpr std::array<std::pair<View, const char*>, 3> kMirrors{
    {{View::hand, ".hand"}, {View::contact, ".contact"}, {View::touch, ".touch"}}};

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
  bool isolateWatch = false;    ///< the servo watches for the state of an isolated driver, and does not sleep
  bool enableForces = false;    ///< real devices start without force unless this is set
  std::string hand = "script";  ///< simulated device: "script", or a CSV file with the intended path
  double servoRate_Hz = 1000;
  double reportRate_Hz = 1000;
  double linearTolerance_m = 0.001;  ///< of the device
  double angularTolerance_rad = 0.02;
  double toolRadius_m = 0;
  std::vector<double> workspace_mm;  ///< min xyz, max xyz; empty: that of the device
  bool forceShading = false;  ///< turn the force towards the interpolated vertex normals of smooth meshes
  double stribeckSpeed_m_per_s = 0;    ///< over which friction falls from static to dynamic; 0: at once
  bool vibrationContactPulls = false;  ///< contact vibrations may exceed the normal force
  double heldForcePower_W = 0.020;     ///< that a held force may add to the hand in the long run
  MaterialScale materialScale = MaterialScale::reference;
  QuaternionOrder quaternionOrder = QuaternionOrder::xyzw;
  ForceReport forceReport = ForceReport::total;
  WorkspaceFit workspaceFit = WorkspaceFit::published;
  VibrationUnit vibrationContactUnit = VibrationUnit::radPerSecond;
  VibrationFrame vibrationMotorFrame = VibrationFrame::stylus;
  bool mirrors = false;  ///< also offer NAME.hand, NAME.contact and NAME.touch, see View
  bool compatMirrors =
      false;  ///< send hand, contact point, touch button and contact channels under the device's names
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

/// `socket` values besides a path. Auto: net::defaultSocketPath(), or none where that fails.
inline constexpr const char* kSocketAuto = "auto";
inline constexpr const char* kSocketOff = "off";

/// `tls` values besides a file.
inline constexpr const char* kTlsOff = "off";
inline constexpr const char* kTlsGenerated = "generated";

/// A range of IPv4 addresses in host byte order.
struct Subnet {
  std::uint32_t network = 0;
  std::uint32_t mask = 0;
  bool has(std::uint32_t address) const noexcept { return (address & mask) == network; }
};
/// Reads "10.0.0.0/8" or one address. Throws ConfigError.
std::vector<Subnet> parseSubnets(const std::vector<std::string>& texts);
/// The system's numbers of users, given as names or numbers. Throws ConfigError that names `key`.
std::vector<std::uint32_t> usersNamed(const std::vector<std::string>& names, const std::string& key);
/// The port of the service whose clients `haply` serves.
inline constexpr std::uint16_t kHaplyPort = 10001;

/// Ports for programs written for other services.
struct CompatConfig {
  std::string haply;                      ///< ADDR:PORT, by default kHaplyPort; empty: none
  double haplyHold_s = 0.1;               ///< how long a force is held without another message
  std::vector<std::string> haplyOrigins;  ///< origins of pages that may use it, "http://localhost:5173"

  bool operator==(const CompatConfig&) const = default;
};

/// Limits on what clients may use. docs/limits.md has what happens beyond each.
struct LimitsConfig {
  int connections = 4096;             ///< of clients at once; further ones may only stop forces
  int connectionsPerAddress = 2048;   ///< the same for each address
  int unfinishedConnections = 512;    ///< without a VRPN greeting so far
  int memory_MB = 1024;               ///< that waits for all clients together, without open batches
  int clientMemory_MB = 64;           ///< the same for each client
  int sendQueue_MB = 8;               ///< unsent reliable data of one connection
  int batches_MB = 512;               ///< open batches of all clients together
  int objects = 10'000;               ///< of one scene
  int vertices = 6'000'000;           ///< of all objects of one scene
  int triangles = 6'000'000;          ///< the same
  int effects = 64;                   ///< of one scene
  int commandsPerSecond = 1'000'000;  ///< of one client, without those that fill meshes
  int recording_MB = 100'000;         ///< of one recording
  int blackBoxes_MB = 100;            ///< of all black boxes of one device
  int log_kB_per_s = 256;             ///< of log lines that clients cause

  bool operator==(const LimitsConfig&) const = default;
};

struct ServerConfig {
  std::string listenAddress = "127.0.0.1";
  std::uint16_t port = 3883;
  bool allowNoRealtime = false;
  double seconds = 0;                      ///< 0: until stopped
  std::vector<std::string> callbackHosts;  ///< hosts that a UDP request may name besides its source address
  std::string record;                   ///< recording to write; strftime conversions (%) allowed; empty: none
  std::string http = kHttpAuto;         ///< endpoint of the viewer: ADDR:PORT, kHttpAuto or kHttpOff
  std::string socket = kSocketAuto;     ///< path of the Unix socket, kSocketAuto or kSocketOff
  std::string tokens;                   ///< file of tokens, mode 0600; empty: none
  std::vector<std::string> ownerUsers;  ///< users that are owners over the Unix socket
  std::vector<std::string> operatorUsers;    ///< users that are operators over the Unix socket
  std::vector<std::string> trustedNetworks;  ///< whose clients are owners: "10.0.0.0/24"
  std::string tls = kTlsOff;                 ///< kTlsOff, kTlsGenerated, or the file of a certificate (PEM)
  std::string tlsKey;                        ///< file of its key, mode 0600
  bool tlsLoopback = false;                  ///< TLS for clients on this machine, too
  bool insecure = false;                     ///< other machines may command without TLS
  std::vector<std::string> httpAllow;  ///< additional Host names accepted at the web port: HOST or HOST:PORT
  bool announce = true;                ///< on the network by DNS-SD, when other machines may connect
  CompatConfig compat;
  LimitsConfig limits;
  std::vector<DeviceConfig> devices{DeviceConfig{}};

  bool operator==(const ServerConfig&) const = default;
};

/// Whether a configuration file is a vrpn.cfg: by its extension .cfg, in letters of any case.
bool isVrpnCfg(const std::filesystem::path& file);

/// Reads a TOML file, or a vrpn.cfg, over the defaults. Throws ConfigError; an unknown key
/// is an error that names the nearest known key. For each skipped line of a vrpn.cfg a text is appended to
/// `warnings`.
ServerConfig loadConfig(const std::filesystem::path& file, std::vector<std::string>& warnings);

/// "FILE:LINE: " of a value that only its user found invalid; empty without a TOML file.
std::string placeOf(const InvalidValue& error, const std::filesystem::path& file);

/// Parses the text of a TOML configuration; `source` names it in errors.
ServerConfig parseConfig(const std::string& text, const std::string& source);

/// The configuration in a recording, without what belongs to the machine that recorded: addresses, ports,
/// users, paths, hardware. Throws std::runtime_error: a recording is nobody's configuration to mend.
ServerConfig parseRecordedConfig(const std::string& text, const std::string& source);

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
