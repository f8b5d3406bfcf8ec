// hapticd-ros2: one device of a haptics server as topics of ROS 2, by DDS and without an installation of ROS.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cctype>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <optional>
#include <regex>
#include <stdexcept>
#include <stop_token>
#include <string>
#include <thread>

#include "../commands.h"
#include "../token_file.h"
#include "base/printable.h"
#include "control_in.h"
#include "hapticd/client.h"
#include "hapticd/error.h"
#include "objects_in.h"
#include "participant.h"
#include "state_out.h"
#include "topic_log.h"

namespace {

using namespace std::chrono_literals;
namespace ros2 = hapticd::apps::ros2;

std::atomic<int> ending = 0;  // set by signals, too
static_assert(std::atomic<int>::is_always_lock_free);
std::atomic<bool> failed = false;

struct Options {
  std::string server = "Phantom@localhost";
  std::string tokenFile;
  std::string nameSpace;
  std::string frame = "ros";
  std::uint32_t domain = 0;
  bool network = false;
  bool readOnly = false;
  double rate_Hz = 200;
  double tfRate_Hz = 50;
  ros2::ObjectSettings objects{{}, 0, {.stiffness = 0.8F}};
};

/// What all topics share.
struct Bridge {
  ros2::Participant participant;
  ros2::Frame frame;
  std::string base;  // frame_id
};

// A name of ROS: letters, digits and underscores, with a digit not first.
std::string rosName(std::string name) {
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return std::isalnum(c) == 0 || c > 127; }, '_');
  return name.empty() || std::isdigit(static_cast<unsigned char>(name[0])) != 0 ? "_" + name : name;
}

CLI::Validator matching(const std::string& pattern, const std::string& what) {
  return CLI::Validator(
      [pattern, what](std::string& text) {
        return std::regex_match(text, std::regex(pattern)) ? std::string()
                                                           : "must be " + what + ", got '" + text + "'";
      },
      "");
}

void addOptions(CLI::App& app, Options& options) {
  const auto fraction = hapticd::apps::within(0, 1);
  hapticd::Surface& surface = options.objects.surface;
  app.set_version_flag("--version", "hapticd-ros2 " HAPTICD_VERSION);
  app.add_option("--server", options.server, "NAME@host[:port] or NAME@tcp://host[:port]")
      ->capture_default_str();
  app.add_option("--namespace", options.nameSpace,
                 "Of the topics, such as /left [the device's name: /Phantom]")
      ->check(matching("(/[A-Za-z_][A-Za-z0-9_]*)+", "names behind slashes, such as /left"));
  app.add_option("--rate", options.rate_Hz, "Samples per second of each topic that measures")
      ->check(hapticd::apps::within(1, 10000))
      ->capture_default_str();
  app.add_option("--tf-rate", options.tfRate_Hz, "Transforms per second on /tf; 0: none")
      ->check(hapticd::apps::within(0, 1000))
      ->capture_default_str();
  app.add_option("--frame", options.frame, "Axes of all topics, see below")
      ->check(CLI::IsMember({"ros", "device"}))
      ->capture_default_str();
  app.add_option("--domain", options.domain, "DDS domain [$ROS_DOMAIN_ID, or 0]")
      ->envname("ROS_DOMAIN_ID")
      ->check(hapticd::apps::withinIntegers(0, 232));
  app.add_flag("--network", options.network, "Reach other machines, too; without it, this machine only");
  app.add_flag("--read-only", options.readOnly, "Take no commands: no forces, no stops, no objects");
  app.add_option("--object", options.objects.names,
                 "Touch the mesh of the topic NAME/mesh, placed by NAME/pose; may be repeated")
      ->type_name("NAME")
      ->check(matching("[A-Za-z_][A-Za-z0-9_]*", "a name of letters, digits and underscores"));
  app.add_option("--first-object", options.objects.first, "Object of the first --object in the scene")
      ->check(hapticd::apps::withinIntegers(0, 9000))
      ->capture_default_str();
  const auto addProperty = [&](const char* name, float& value) {
    app.add_option(name, value, "Of all objects")->check(fraction)->capture_default_str();
  };
  addProperty("--stiffness", surface.stiffness);
  addProperty("--damping", surface.damping);
  addProperty("--static-friction", surface.staticFriction);
  addProperty("--dynamic-friction", surface.dynamicFriction);
  addProperty("--popthrough", surface.popthrough);
  hapticd::apps::addTokenFile(app, options.tokenFile);
  app.footer(
      "Topics, below /Phantom or --namespace; lengths in metres, forces in newtons:\n"
      "  measured_cp, measured_cv, measured_cf   pose and velocity of the hand, force on it\n"
      "  proxy/measured_cp, contact/depth, contact/object, buttons, gripper/measured_js, operating_state\n"
      "  servo_cf           takes a force (WrenchStamped); 100 ms after the last one it ramps out\n"
      "  state_command      takes disable, pause, enable, resume (crtk_msgs/StringStamped)\n"
      "  NAME/mesh, NAME/pose of each --object   take shape_msgs/Mesh and geometry_msgs/PoseStamped\n\n"
      "Frames: with ros (REP 103), x is forward as the user looks, y left, z up. With device, x is right, y "
      "up,\n"
      "z towards the user.\n\n"
      "Example:\n"
      "  hapticd serve                                # in another terminal\n"
      "  hapticd-ros2 --object part\n"
      "  ros2 topic echo /Phantom/measured_cf         # where ROS 2 is installed");
}

// Signals end the loop; a second one ends the process.
void endOnSignals() {
  struct sigaction action = {};
  action.sa_handler = [](int) { ending = 1; };
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaction(signal, &action, nullptr);
}

// What the server says of the client's commands, and of its device.
void logTexts(hapticd::Client& client, hapticd::Severity least) {
  client.onText([least](const hapticd::TextReport& report) {
    if (report.severity >= least)
      ros2::log("server: " + std::string(nameOf(report.severity)) + ": " + report.text);
  });
}

// Calls what a lost connection ends: the client reports it, and connects again.
template <class Call>
void whileConnected(Call&& call) {
  try {
    call();
  } catch (const hapticd::ConnectionLost&) {  // NOLINT(bugprone-empty-catch)
  } catch (const hapticd::ConnectError&) {    // NOLINT(bugprone-empty-catch)
  }
}

hapticd::Client connect(const Options& options, const std::string& token) {
  hapticd::Client client(options.server);
  if (!token.empty()) client.presentToken(token);
  return client;
}

// Serves the objects by a client of its own, so that nothing else waits behind a large mesh.
void serveObjects(const std::stop_token& stop, const Options& options, const Bridge& bridge,
                  const std::string& token) try {
  hapticd::Client client = connect(options, token);
  logTexts(client, hapticd::Severity::error);
  client.subscribe(hapticd::Reports::none);
  ros2::ObjectsIn objects(client, bridge.participant, bridge.frame, bridge.base, options.objects);
  while (ending == 0 && !stop.stop_requested()) {
    client.poll(5ms);
    whileConnected([&] { objects.take(); });
  }
  whileConnected([&] {
    objects.clear();
    client.flushAll();
  });
} catch (const std::exception& error) {
  ros2::log(std::string("objects: ") + error.what());
  failed = true;
  ending = 1;
}

void run(Options options) {
  const auto& names = options.objects.names;
  for (auto name = names.begin(); name != names.end(); ++name)
    if (std::find(names.begin(), name, *name) != name)
      throw std::runtime_error("--object '" + *name + "' is given twice");
  const std::string token = hapticd::apps::tokenFor(options.server, options.tokenFile);
  hapticd::Client client = connect(options, token);
  logTexts(client, hapticd::Severity::warning);
  client.onConnection([&](const hapticd::ConnectionReport& report) {
    ros2::log((report.connected ? "connected to " : "lost ") + client.server() +
              (report.connected ? "" : ": " + report.reason));
  });
  client.subscribe(hapticd::Reports::tick | hapticd::Reports::hand, options.rate_Hz);

  if (options.nameSpace.empty()) options.nameSpace = "/" + rosName(client.device());
  const std::string name = options.nameSpace.substr(options.nameSpace.rfind('/') + 1);
  const Bridge bridge{{options.domain, options.network, options.nameSpace},
                      options.frame == "ros" ? ros2::Frame::ros() : ros2::Frame::device(),
                      name + "_base"};
  const ros2::StateOut out(client, bridge.participant, bridge.frame, name, options.tfRate_Hz);
  std::optional<ros2::ControlIn> control;
  std::jthread objects;
  if (!options.readOnly) {
    control.emplace(client, bridge.participant, bridge.frame, bridge.base);
    if (!names.empty()) {
      objects =
          std::jthread([&](const std::stop_token& stop) { serveObjects(stop, options, bridge, token); });
    }
  }
  ros2::log("topics below " + options.nameSpace + " in DDS domain " + std::to_string(options.domain) +
            (options.network ? ", on the network" : ", on this machine") + "; Ctrl-C ends");
  if (options.network && control)
    ros2::log(
        "warning: DDS has no passwords here: whoever reaches it can put forces on the hand; let in "
        "machines that you trust only, or use --read-only");
  while (ending == 0) {
    client.poll(1ms);
    if (control) whileConnected([&] { control->take(); });
  }
  if (objects.joinable()) objects.join();
  ros2::log("ended");
}

}  // namespace

int main(int count, char** arguments) {
  Options options;
  CLI::App app("One device of a haptics server as topics of ROS 2, by DDS: it needs no installation of ROS.",
               "hapticd-ros2");
  addOptions(app, options);
  try {
    app.parse(count, arguments);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;  // as hapticd
  }
  try {
    endOnSignals();
    run(options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "hapticd-ros2: %s\n", hapticd::base::printable(error.what()).c_str());
    return 1;
  }
  return failed ? 1 : 0;
}
