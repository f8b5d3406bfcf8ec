#include "server/station.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <set>

#include "device/simulated/hand_file.h"
#include "device/simulated/simulated_device.h"
#include "realtime/servo/servo_thread.h"
#include "realtime/servo/tick.h"
#include "server/devices.h"
#include "server/explorer.h"
#include "server/inbox.h"
#include "wire/text.h"

namespace hapticd::server {
namespace {

using geometry::Box;
using geometry::Vec3;

std::unique_ptr<device::Device> openDevice(const DeviceConfig& config) {
  auto device = makeDevice(config);
  device->open();
  // A self-paced one calibrates in its own loop, with the consent it was made with.
  if (config.calibrate && !device->selfPaced()) device->calibrate();
  return device;
}

Box workspaceOf(const DeviceConfig& config, const device::DeviceProfile& profile) {
  const auto& box = config.workspace_mm;
  if (box.size() != 6) return profile.workspace_m;
  return {Vec3(box[0], box[1], box[2]) * 1e-3, Vec3(box[3], box[4], box[5]) * 1e-3};
}

scene::SceneConfig sceneConfig(const DeviceConfig& config, const device::DeviceProfile& profile) {
  scene::SceneConfig scene;
  scene.materialScale = config.materialScale;
  scene.workspaceFit = config.workspaceFit;
  scene.contactVibrationUnit = config.vibrationContactUnit;
  scene.motorVibrationFrame = config.vibrationMotorFrame;
  scene.deviceWorkspace_m = workspaceOf(config, profile);
  scene.nominalStiffness_N_per_m = profile.nominalStiffness_N_per_m;
  scene.nominalForce_N = profile.peakForce_N;
  scene.ownDamping_Ns_per_m = profile.ownDamping_Ns_per_m;
  scene.servoPeriod_s = 1 / config.servoRate_Hz;
  scene.transportDelay_s = profile.transportDelay_s;
  return scene;
}

realtime::TickOptions tickOptions(const DeviceConfig& config, const device::DeviceProfile& profile) {
  realtime::TickOptions options;
  options.rate_Hz = config.servoRate_Hz;
  options.render.toolRadius_m = config.toolRadius_m;
  options.guard = realtime::GuardOptions::of(profile);
  options.guard.selfRecover = config.driver == "simulated";  // nobody there to be hurt, or to re-arm
  return options;
}

// Reports of one or more ticks, encoded for one name.
struct Frames {
  std::shared_ptr<const net::Buffer> lowLatency;
  std::shared_ptr<const net::Buffer> reliable;
};

std::shared_ptr<const net::Buffer> takeBuffer(wire::FrameEncoder& encoder) {
  if (encoder.empty()) return nullptr;
  net::Buffer bytes;
  encoder.swapOut(bytes);
  return std::make_shared<const net::Buffer>(std::move(bytes));
}

wire::F64x3 array(const Vec3& v) {
  return {v.x(), v.y(), v.z()};
}

}  // namespace

struct Station::Impl {
  Impl(const DeviceConfig& config_, std::vector<wire::LocalSender> names_, bool allowNoRealtime)
      : config(config_),
        names(std::move(names_)),
        device(openDevice(config)),
        simulated(dynamic_cast<device::SimulatedDevice*>(device.get())),
        tick(*device, clock, tickOptions(config, device->profile())),
        servo([this](const realtime::Pacing& pacing) { tick(pacing); }, clock,
              {.rate_Hz = config.servoRate_Hz, .request = {}, .requireRealtime = !allowNoRealtime}),
        reporter(config, device->profile().buttons, config.reportRate_Hz),
        frames(names.size()) {
    if (simulated != nullptr && config.hand != "script")
      simulated->setPath(device::HandFile::load(config.hand));
  }

  void onPublished(const scene::SceneSnapshot& snapshot);
  void answer(Session& session, wire::LocalSender name, const wire::MessageReceived& message);
  void encode(const std::vector<Outgoing>& messages, wire::Time time);

  const DeviceConfig config;
  const std::vector<wire::LocalSender> names;
  realtime::MonotonicClock clock;
  std::unique_ptr<device::Device> device;
  device::SimulatedDevice* simulated;  // null for other drivers
  realtime::Tick tick;
  realtime::ServoThread servo;
  std::unique_ptr<SceneThread> scene;
  bool running = false;

  // The net thread's.
  Inbox inbox;
  std::set<scene::ClientId> commanders;  // who has said something to the scene
  Reporter reporter;
  realtime::TickReport last;
  std::vector<Outgoing> outgoing;
  std::vector<wire::FrameEncoder> lowLatency{names.size()};
  std::vector<wire::FrameEncoder> reliable{names.size()};
  std::vector<Frames> frames;
  std::uint64_t droppedReports = 0;
  std::string fault;  // as last logged

  // The scene thread's: what the scripted hand was planned for.
  std::vector<std::pair<std::int32_t, std::uint64_t>> explored{{-1, 0}};
};

Station::Station(const DeviceConfig& config, std::vector<wire::LocalSender> names, bool allowNoRealtime)
    : impl_(std::make_unique<Impl>(config, std::move(names), allowNoRealtime)) {}

Station::~Station() {
  stop();
}

void Station::start(Callbacks callbacks) {
  Impl& my = *impl_;
  my.scene = std::make_unique<SceneThread>(
      sceneConfig(my.config, my.device->profile()), my.tick.snapshots(),
      SceneThread::Callbacks{.notices = std::move(callbacks.notices),
                             .published = [&my](const auto& snapshot) { my.onPublished(*snapshot); },
                             .drained = std::move(callbacks.drained)});
  my.scene->start();
  my.running = true;
  if (my.config.enableForces) my.tick.control().arm();
  if (my.device->selfPaced()) {
    my.device->start([&my](geometry::Nanos now) { my.tick(now); });
    spdlog::info("servo loop of '{}': paced by the device", my.config.names.front());
    return;
  }
  const realtime::ThreadSetup& setup = my.servo.start();
  for (const realtime::SetupAnswer* answer : setup.all()) {
    if (!answer->asked) continue;
    if (answer->granted) {
      spdlog::info("servo loop of '{}': {}", my.config.names.front(), answer->text);
    } else {
      spdlog::warn("servo loop of '{}': {}; {}", my.config.names.front(), answer->text, answer->remedy);
    }
  }
}

void Station::stop() {
  Impl& my = *impl_;
  if (!std::exchange(my.running, false)) return;
  my.tick.control().stop();
  if (my.device->selfPaced()) {
    my.device->stop();
  } else {
    my.servo.stop();
  }
  my.tick.finish();
  my.device->close();
  my.scene->stop();
  const auto wake = my.tick.histograms().wakeupError.copy();
  const auto compute = my.tick.histograms().compute.copy();
  const realtime::TickReport& end = my.tick.last();
  const auto us = [](geometry::Nanos t) { return static_cast<double>(t) * 1e-3; };
  spdlog::info("servo loop of '{}': {} ticks, {} overruns, {} periods skipped, {} reports dropped",
               my.config.names.front(), end.tick, end.timing.overruns, end.timing.skippedPeriods,
               my.droppedReports);
  spdlog::info("  wake-up error p50 {:.1f} us, p99 {:.1f} us, max {:.1f} us", us(wake.quantile(0.5)),
               us(wake.quantile(0.99)), us(wake.max));
  spdlog::info("  read-render-write p50 {:.1f} us, p99 {:.1f} us, max {:.1f} us", us(compute.quantile(0.5)),
               us(compute.quantile(0.99)), us(compute.max));
  for (const realtime::TripInfo& trip : realtime::kTrips) {
    const std::uint32_t count = end.guard.counts[static_cast<std::size_t>(trip.trip)];
    if (count > 0 && trip.trip != realtime::Trip::stopped)
      spdlog::info("  guard: {} {} times: {}", trip.name, count, trip.text);
  }
}

void Station::checkHealth() {
  Impl& my = *impl_;
  std::string text = my.device->faultText();
  if (text == my.fault) return;
  if (text.empty()) {
    spdlog::info("device '{}': all is well again", my.config.names.front());
  } else {
    spdlog::warn("device '{}': {}", my.config.names.front(), text);
  }
  my.fault = std::move(text);
}

bool Station::has(wire::LocalSender name) const noexcept {
  return std::find(impl_->names.begin(), impl_->names.end(), name) != impl_->names.end();
}

wire::LocalSender Station::nameFor(const Session& session) const noexcept {
  for (const wire::LocalSender name : impl_->names) {
    if (session.wants(name)) return name;
  }
  return impl_->names.front();
}

void Station::onMessage(Session& session, const wire::MessageReceived& message) {
  Impl& my = *impl_;
  std::string error;
  switch (my.inbox.take(session.id(), message, error)) {
    case Inbox::Outcome::taken:
      my.commanders.insert(session.id());
      // What is felt after a reset comes in gently.
      if (message.kind == wire::kindOf<wire::ResetScene>) my.tick.control().rampIn();
      return;
    case Inbox::Outcome::malformed:
      session.refuse("malformed message: " + error);
      return;
    case Inbox::Outcome::notACommand:
      my.answer(session, message.local_sender, message);
      return;
  }
}

// Questions that the net thread answers by itself.
void Station::Impl::answer(Session& session, wire::LocalSender name, const wire::MessageReceived& message) {
  constexpr std::int32_t kSensors = 3;
  if (message.kind == wire::kindOf<wire::Ping>) {
    session.send(name, wire::Pong{});
    session.send(name, reporter.buttonStates(last.device.buttons));
  } else if (message.kind == wire::kindOf<wire::TrackerRequestToRoom>) {
    session.send(name, wire::TrackerToRoom{});
  } else if (message.kind == wire::kindOf<wire::TrackerRequestUnitToSensor>) {
    for (std::int32_t sensor = 0; sensor < kSensors; ++sensor) {
      session.send(name, wire::TrackerUnitToSensor{
                             .sensor = sensor, .filler = 0, .position = {}, .orientation = {0, 0, 0, 1}});
    }
  } else if (message.kind == wire::kindOf<wire::TrackerRequestWorkspace>) {
    const Box box = workspaceOf(config, device->profile());
    Box world;
    for (int corner = 0; corner < 8; ++corner) {
      world.extend(Vec3(last.T_world_device *
                        Vec3((corner & 1) != 0 ? box.max.x() : box.min.x(),
                             (corner & 2) != 0 ? box.max.y() : box.min.y(),
                             (corner & 4) != 0 ? box.max.z() : box.min.z()) *
                        1e-3));
    }
    session.send(name, wire::TrackerWorkspace{array(world.min), array(world.max)});
  } else if (message.kind == wire::kindOf<wire::Text>) {
    if (const auto text = wire::decode<wire::Text>(message.payload)) {
      session.remark("says " + wire::inQuotes(text->text.text));
    }
  }
}

bool Station::flushCommands() {
  Impl& my = *impl_;
  if (!my.scene) return true;
  if (!my.inbox.empty()) {
    const std::size_t bytes = my.inbox.bytes();
    my.scene->enqueue(my.inbox.release(), bytes);
  }
  return !my.scene->full();
}

void Station::clientGone(scene::ClientId client) {
  Impl& my = *impl_;
  my.inbox.add({client, ClientGone{}});
  const bool lastToCommand = my.commanders.erase(client) == 1 && my.commanders.empty();
  if (lastToCommand && my.config.sceneOnDisconnect == SceneOnDisconnect::clear) {
    my.inbox.add({client, scene::SceneCommand{scene::ResetScene{}}});
  }
  flushCommands();
}

int Station::wakeFd() const noexcept {
  return impl_->tick.wake().descriptor();
}

bool Station::collectReports(const WallClock& clock) {
  Impl& my = *impl_;
  my.tick.reports().consume([&](const realtime::TickReport& report) {
    const bool first = my.last.tick == 0;
    my.last = report;
    my.droppedReports = report.dropped;
    my.outgoing.clear();
    // Who came before the first tick has heard nothing yet.
    if (first) my.outgoing.push_back({my.reporter.buttonStates(report.device.buttons), true});
    my.reporter.update(report, my.outgoing);
    my.encode(my.outgoing, clock.at(report.time));
  });
  bool any = false;
  for (std::size_t i = 0; i < my.names.size(); ++i) {
    my.frames[i] = {takeBuffer(my.lowLatency[i]), takeBuffer(my.reliable[i])};
    any = any || my.frames[i].lowLatency || my.frames[i].reliable;
  }
  return any;
}

void Station::Impl::encode(const std::vector<Outgoing>& messages, wire::Time time) {
  for (const Outgoing& out : messages) {
    std::visit(
        [&]<class M>(const M& message) {
          const bool mayBeLost = !out.reliable && M::kInfo.reliability == wire::Reliability::kLowLatency;
          auto& encoders = mayBeLost ? lowLatency : reliable;
          for (std::size_t i = 0; i < names.size(); ++i) encoders[i].add(time, names[i], message);
        },
        out.message);
  }
}

void Station::sendReports(Session& session) const {
  const Impl& my = *impl_;
  for (std::size_t i = 0; i < my.names.size(); ++i) {
    if (!session.wants(my.names[i])) continue;
    if (my.frames[i].lowLatency) session.sendShared(my.frames[i].lowLatency, net::Delivery::lowLatency);
    if (my.frames[i].reliable) session.sendShared(my.frames[i].reliable, net::Delivery::reliable);
  }
}

void Station::sendPresentState(Session& session, wire::LocalSender name) const {
  const Impl& my = *impl_;
  if (my.last.tick == 0) return;  // the first tick will tell
  std::vector<Outgoing> messages;
  my.reporter.presentState(my.last, messages);
  for (const Outgoing& out : messages)
    std::visit([&](const auto& message) { session.send(name, message); }, out.message);
  session.flush();
}

void Station::Impl::onPublished(const scene::SceneSnapshot& snapshot) {
  if (simulated == nullptr || config.hand != "script") return;
  std::vector<std::pair<std::int32_t, std::uint64_t>> now;
  for (const auto& object : snapshot.objects) now.emplace_back(object->id, object->mesh->topology);
  if (now == explored) return;
  explored = std::move(now);
  simulated->setPath(std::make_shared<const device::WaypointPath>(
      explore(snapshot, workspaceOf(config, device->profile()), monotonicNow()),
      device::WaypointPath::Repeat::yes));
}

}  // namespace hapticd::server
