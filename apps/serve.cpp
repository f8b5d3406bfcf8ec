// hapticd serve: owns the devices and serves them to VRPN clients.
#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <stdexcept>
#include <system_error>

#include "announce.h"
#include "commands.h"
#include "device/drivers/drivers.h"
#include "device/simulated/text_rows.h"
#include "log_writer.h"
#include "network_finder.h"
#include "server/server.h"
#include "server/station/devices.h"
#include "service_manager.h"
#include "stop_on_signal.h"
#include "system_bus/sleep_guard.h"

namespace hapticd::apps {
namespace {

struct ServeOptions {
  std::string configFile;
  std::string listen;
  int port = -1;
  std::string http;
  std::vector<std::string> httpAllow;
  std::vector<std::string> names;
  std::string driver;
  std::string hand;
  bool enableForces = false;
  bool calibrate = false;
  bool isolate = false;
  bool inProcess = false;
  double reportRate_Hz = 0;
  std::optional<double> seconds;
  std::string record;
  bool allowNoRealtime = false;
  bool insecure = false;
  bool verbose = false;
  bool checkConfig = false;
};

void applyFlags(const ServeOptions& options, server::DeviceConfig& device) {
  if (!options.driver.empty()) {
    const std::size_t colon = options.driver.find(':');
    const std::string driver = options.driver.substr(0, colon);
    // The hardware name, the keys, the hand and the isolation of one driver mean nothing to another.
    if (driver != device.driver) {
      const device::Driver* const next = device::findDriver(driver);
      if (next == nullptr || !next->hasHand) device.hand = server::DeviceConfig().hand;
      device.hardware.clear();
      device.driverKeys.clear();
      device.isolate.reset();
      device.isolateWatch = false;
    }
    device.driver = driver;
    if (colon != std::string::npos) device.hardware = options.driver.substr(colon + 1);
  }
  if (options.enableForces) device.enableForces = true;
  if (options.calibrate) device.calibrate = true;
  if (options.isolate) device.isolate = true;
  if (options.inProcess) device.isolate = false;
  if (!options.hand.empty()) device.hand = options.hand;
  if (options.reportRate_Hz > 0) device.reportRate_Hz = options.reportRate_Hz;
}

// Makes each driver, without opening it: files and hardware names that only the driver understands.
void checkDrivers(const server::ServerConfig& config) {
  for (std::size_t i = 0; i < config.devices.size(); ++i) {
    server::DeviceConfig device = config.devices[i];
    device.isolate = false;
    const std::string place = "device '" + device.names.front() + "': ";
    try {
      server::makeDevice(device);
    } catch (const server::ConfigError&) {
      throw;
    } catch (const device::HandFileError& error) {
      throw server::InvalidValue(i, "hand", place + "hand: " + error.what());
    } catch (const std::exception& error) {
      throw server::ConfigError(place + error.what());
    }
  }
}

// The files that the configuration names.
void checkFiles(const server::ServerConfig& config, const ServeOptions& options) {
  try {
    checkDrivers(config);
  } catch (const server::InvalidValue& error) {
    if (!options.hand.empty()) throw;
    throw server::ConfigError(server::placeOf(error, options.configFile) + error.what());
  }
  const auto check = [&](const char* key, const auto& read) {
    try {
      read();
    } catch (const std::runtime_error& error) {
      const server::InvalidValue located({}, key, error.what());
      throw server::ConfigError(server::placeOf(located, options.configFile) + error.what());
    }
  };
  check("tokens", [&] { server::Credentials(config, geteuid()); });
  if (config.tlsKey.empty()) return;
  try {
    tls::Context::server(config.tls, config.tlsKey);
  } catch (const tls::KeyError&) {
    check("tls_key", [] { throw; });
  } catch (const tls::Error&) {
    check("tls", [] { throw; });
  }
}

server::ServerConfig configOf(const ServeOptions& options, std::vector<std::string>& remarks) {
  server::ServerConfig config;
  const std::filesystem::path file = options.configFile;
  if (!file.empty()) config = server::loadConfig(file, remarks);
  if (!options.listen.empty()) server::parseListen(options.listen, config.listenAddress, config.port);
  if (options.port >= 0) config.port = static_cast<std::uint16_t>(options.port);
  if (!options.http.empty()) config.http = options.http;
  config.httpAllow.insert(config.httpAllow.end(), options.httpAllow.begin(), options.httpAllow.end());
  if (options.insecure) config.insecure = true;
  if (options.allowNoRealtime) config.allowNoRealtime = true;
  if (options.seconds) config.seconds = *options.seconds;
  if (!options.record.empty()) config.record = options.record;
  for (const std::string& name : options.names) {
    if (name.starts_with("--")) throw server::ConfigError("--name needs a name, got the option " + name);
  }
  if (!options.names.empty()) config.devices.front().names = options.names;
  applyFlags(options, config.devices.front());
  // vrpn.cfg has no fields for most flags, so they apply to all of its devices.
  if (server::isVrpnCfg(file)) {
    for (server::DeviceConfig& device : config.devices) applyFlags(options, device);
  }
  server::validate(config);
  checkFiles(config, options);
  return config;
}

bool hasRealDevice(const server::ServerConfig& config) {
  return std::any_of(config.devices.begin(), config.devices.end(),
                     [](const server::DeviceConfig& device) { return device.driver != "simulated"; });
}

// A driver knows what its device or library answered; 'hapticd devices' knows the remedy.
std::unique_ptr<server::Server> openServer(const server::ServerConfig& config) {
  try {
    return std::make_unique<server::Server>(config);
  } catch (const net::Error&) {
    throw;
  } catch (const std::runtime_error& error) {
    if (!hasRealDevice(config)) throw;
    throw std::runtime_error(
        std::string(error.what()) +
        "\nhapticd: 'hapticd devices' lists what was found, and the remedy for each driver");
  }
}

// Many systems give 1024, which 400 clients use up.
void raiseDescriptorLimit() {
  constexpr rlim_t kEnough = 16'384;
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0 || limit.rlim_cur >= kEnough) return;
  limit.rlim_cur = std::min(limit.rlim_max, kEnough);
  setrlimit(RLIMIT_NOFILE, &limit);
}

// Present while a service runs, so that one which the service manager restarts after a crash knows of it.
class CrashMark {
 public:
  CrashMark() {
    const char* const folder = secure_getenv("RUNTIME_DIRECTORY");
    if (folder == nullptr || *folder != '/') return;
    file_ = std::filesystem::path(folder) / "running";
    crashed_ = std::filesystem::exists(file_);
  }
  void set() const {
    if (file_.empty()) return;
    errno = 0;
    if (const std::ofstream mark(file_); !mark)
      spdlog::warn("forces are not stopped after a crash: cannot create {}: {}", file_.string(),
                   std::generic_category().message(errno));
  }
  bool crashed() const { return crashed_; }
  void endedInOrder() const {
    std::error_code ignored;
    if (!file_.empty()) std::filesystem::remove(file_, ignored);
  }

 private:
  std::filesystem::path file_;
  bool crashed_ = false;
};

// The thread of the signals uses the server: it ends before the server does, also after an exception.
struct SignalsEndFirst {
  StopOnSignal& stopper;
  ~SignalsEndFirst() { stopper.finish(); }
};

int run(const ServeOptions& options) {
  std::vector<std::string> remarks;
  server::ServerConfig config = configOf(options, remarks);
  if (options.checkConfig) {
    for (const std::string& remark : remarks) std::printf("# %s\n", remark.c_str());
    for (server::DeviceConfig& device : config.devices) {
      const device::Driver* const driver = device::findDriver(device.driver);
      if (driver->canBeIsolated) device.isolate = device.isolate.value_or(driver->isolatedByDefault);
    }
    std::printf("%s", server::toToml(config).c_str());
    return 0;
  }
  raiseDescriptorLimit();
  StopOnSignal stopper;
  const LogWriter log;
  spdlog::set_level(options.verbose ? spdlog::level::debug : spdlog::level::info);
  for (const std::string& remark : remarks) spdlog::warn("{}", remark);
  const std::unique_ptr<server::Server> server = openServer(config);
  const SignalsEndFirst signals{stopper};
  logAddresses(*server, config);
  const std::unique_ptr<zeroconf::Announcer> announcer = announceOnNetwork(*server, config);
  listNetworkOnPage(*server);
  stopper.watch(*server);
  std::optional<system_bus::SleepGuard> sleepGuard;
  if (hasRealDevice(config)) {
    sleepGuard.emplace([&] { return server->armed(); }, [&] { server->stopForces(); });
  }
  const CrashMark mark;
  if (mark.crashed()) {
    server->stopForces();
    spdlog::warn("the server did not end in order last time: forces are stopped until re-armed");
  }
  server->onAlive([] { notifyServiceManager("WATCHDOG=1"); });
  server->onRunning([&] {
    mark.set();
    notifyServiceManager("READY=1");
  });
  server->run();
  notifyServiceManager("STOPPING=1");
  mark.endedInOrder();
  return 0;
}

// `options` must live as long as `command`.
void addNetworkOptions(CLI::App& command, ServeOptions& options) {
  command
      .add_option("--listen", options.listen,
                  "ADDR:PORT for TCP and UDP [127.0.0.1:3883]; 0.0.0.0 for all networks")
      ->check(notEmpty());
  command.add_option("--port", options.port, "Only the port; 0: any free one")
      ->check(withinIntegers(0, 65535));
  command
      .add_option("--http", options.http,
                  "ADDR:PORT of the viewer, its data and the metrics [127.0.0.1:8080 if free, otherwise\n"
                  "none]; 'off' for none; 0.0.0.0:8080 for all networks")
      ->check(notEmpty());
  command.add_option("--http-allow", options.httpAllow,
                     "HOST or HOST:PORT by which browsers may open the viewer; repeat it for more.\n"
                     "IP addresses and localhost are always allowed");
  command.add_flag(
      "--insecure", options.insecure,
      "Let other machines in without encryption: everybody who reaches the port can move the arm");
}

// The same.
void addDeviceOptions(CLI::App& command, ServeOptions& options) {
  command.add_option("--name", options.names,
                     "Device name that clients open [Phantom]; repeat it for more names");
  command
      .add_option("--device", options.driver,
                  "Driver [simulated]: " + device::driverNames() +
                      "\nDRIVER:WHICH selects one of several devices, e.g. evdev:/dev/input/event5")
      ->check(notEmpty());
  command.add_flag("--enable-forces", options.enableForces,
                   "Enable forces on a real device; without this flag it starts disarmed");
  command.add_flag("--calibrate", options.calibrate,
                   "Consent to calibration at the start and at a re-arm after it was lost; MAY MOVE THE ARM");
  CLI::Option* const isolate = command.add_flag(
      "--isolate", options.isolate,
      "Run the driver in its own process: a crash is then a fault, not the end of the server, and that\n"
      "process ends the force when the server hangs or dies. Default for openhaptics, which has no watchdog");
  command
      .add_flag("--in-process", options.inProcess,
                "Run the driver in the server's process: saves one tick of delay and that protection")
      ->excludes(isolate);
  command
      .add_option(
          "--hand", options.hand,
          "Simulated device: 'script' strokes the objects of the scene [script], FILE.csv follows the path\n"
          "t_s,x_m,y_m,z_m[,qx,qy,qz,qw][,buttons], FILE.traj a measured one")
      ->check(notEmpty());
  command.add_flag(
      "--allow-no-rt", options.allowNoRealtime,
      "Run a real device even if the system refuses realtime rights; the simulated hand always runs");
}

}  // namespace

void addServe(CLI::App& app) {
  auto options = std::make_shared<ServeOptions>();
  CLI::App* command = app.add_subcommand("serve", "Own a haptic device and serve it to VRPN clients");
  command
      ->add_option("--config", options->configFile,
                   "TOML file with all settings, or a vrpn.cfg; flags override it")
      ->check(existingFile());
  command->add_flag("--check-config", options->checkConfig,
                    "Print the configuration in effect as TOML, or the error in it, and exit");
  addNetworkOptions(*command, *options);
  addDeviceOptions(*command, *options);
  command->add_option("--report-rate", options->reportRate_Hz, "Reports per second [1000]")
      ->check(within(0.1, 4000));
  command->add_option("--seconds", options->seconds, "Stop after this time; 0: run until a signal [0]")
      ->check(within(0, kLongest_s));
  command
      ->add_option(
          "--record", options->record,
          "Write a recording (all scene commands and ticks) for replay, render and export; %Y%m%d-%H%M%S\n"
          "in the name becomes the time")
      ->check(notEmpty());
  command->add_flag("-v,--verbose", options->verbose, "Log more");
  command->footer(
      "Clients open NAME@HOST, NAME@HOST:PORT or NAME@tcp://HOST:PORT as Tracker, Button or ForceDevice.\n"
      "Examples:\n"
      "  hapticd serve                                    the simulated hand, on this machine only\n"
      "  hapticd serve --name Tracker0 --name Button0     more names for one device\n"
      "  hapticd serve --listen 0.0.0.0:3883 --insecure   for all of a network where you trust everybody\n"
      "  hapticd serve --http 0.0.0.0:8080 --http-allow lab7 --insecure  the page at http://lab7:8080/\n"
      "  hapticd serve --config vrpn.cfg --device simulated   a VRPN server's file, without its hardware\n"
      "  hapticd serve --config my.toml --check-config    check a file and print its settings\n"
      "'hapticd doctor' explains how to get realtime rights.");
  command->callback([options] { exitCode = run(*options); });
}

}  // namespace hapticd::apps
