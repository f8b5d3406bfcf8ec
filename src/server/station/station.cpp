#include <spdlog/spdlog.h>

#include <algorithm>

#include "base/world.h"
#include "device/simulated/simulated_device.h"
#include "server/station/replies.h"
#include "server/station/devices.h"
#include "server/station/scripted_hand.h"
#include "server/station/station_impl.h"

namespace hapticd::server {
namespace {

// Stands for one that was recorded: its profile is asked for, and nothing else.
std::unique_ptr<device::Device> standIn(const record::RecordedDevice& recorded) {
  device::SimulatedOptions options;
  if (const auto* profile = device::findProfile(recorded.model)) options.profile = *profile;
  options.profile.workspace_m = recorded.sceneConfig.deviceWorkspace_m;
  options.profile.buttons = recorded.buttons;
  return std::make_unique<device::SimulatedDevice>(options);
}

std::unique_ptr<device::Device> openDevice(const DeviceConfig& config) {
  auto device = makeDevice(config);
  device->open();
  if (config.calibrate && !device->traits().calibratesInLoop) device->calibrate();
  return device;
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

realtime::TickOptions tickOptions(const DeviceConfig& config, const device::Device& device) {
  realtime::TickOptions options;
  options.rate_Hz = config.servoRate_Hz;
  options.render.toolRadius_m = config.toolRadius_m;
  options.render.forceShading = config.forceShading;
  options.guard = realtime::GuardOptions::of(device.profile());
  options.guard.selfRecover = !device.traits().needsRearm;
  return options;
}

BlackBoxFiles blackBoxFiles(const DeviceConfig& config) {
  if (config.blackBoxDir.empty()) return {defaultBlackBoxDir(), config.blackBoxKeep};
  return {config.blackBoxDir, config.blackBoxKeep};
}

wire::Text healthText(const std::string& fault) {
  return {.severity = wire::kTextError, .level = 0, .text = "the device gives no force: " + fault};
}

}  // namespace

Station::Impl::Impl(const DeviceConfig& config_, std::vector<wire::LocalSender> names_, SceneHost& scene_,
                    std::unique_ptr<device::Device> device_, bool allowNoRealtime)
    : config(config_),
      names(std::move(names_)),
      scene(scene_),
      device(std::move(device_)),
      hand(device->steered()),
      profile(device->profile()),
      tick(*device, clock, tickOptions(config, *device)),
      keeper(*device, tick, clock,
             {.name = config.names.front(),
              .rate_Hz = config.servoRate_Hz,
              .requireRealtime = !allowNoRealtime,
              .vendorsThread = device->traits().ticksInVendorThread}),
      control(tick.control(), hand, workspaceOf(config, profile)),
      roles(config.control, config.controlList),
      modes(profile.buttons),
      outbox(config, profile.buttons, names),
      recorder(config.names.front(), blackBoxFiles(config), tick.blackBox()) {}

Station::Station(const DeviceConfig& config, std::vector<wire::LocalSender> names, SceneHost& scene,
                 bool allowNoRealtime, record::Recorder* recorder)
    : impl_(std::make_unique<Impl>(config, std::move(names), scene, openDevice(config), allowNoRealtime)) {
  Impl& my = *impl_;
  SceneDevice seat{.config = sceneConfig(my.config, my.profile),
                   .slot = &my.tick.snapshots(),
                   .published = [&my](const auto& snapshot) { my.onPublished(*snapshot); },
                   .publishing = {}};
  if (recorder != nullptr) my.recordTo(*recorder, seat);
  scene.add(std::move(seat));
}

Station::Station(const DeviceConfig& config, std::vector<wire::LocalSender> names, SceneHost& scene,
                 const record::RecordedDevice& recorded)
    : impl_(std::make_unique<Impl>(config, std::move(names), scene, standIn(recorded), true)) {
  impl_->played = true;
  scene.add(
      {.config = recorded.sceneConfig, .slot = &impl_->tick.snapshots(), .published = {}, .publishing = {}});
}

void Station::play(const realtime::TickReport& report) noexcept {
  impl_->tick.reports().push(report);
  impl_->tick.wake().notify();
}

void Station::Impl::recordTo(record::Recorder& session, SceneDevice& seat) {
  const std::uint32_t number = session.addDevice({.names = config.names,
                                                  .driver = config.driver,
                                                  .model = profile.model,
                                                  .buttons = profile.buttons,
                                                  .scene = scene.number(),
                                                  .sceneConfig = seat.config,
                                                  .tick = tickOptions(config, *device)});
  seat.config.stopwatch = session.stopwatch(number);
  seat.publishing = [&session, number](base::Nanos now, std::uint64_t revision) {
    session.recordPublish(number, now, revision);
  };
  tick.recordTo(&session.ring(number));
}

Station::~Station() {
  stop();
}

void Station::start() {
  Impl& my = *impl_;
  if (my.played) return;
  my.running = true;
  spdlog::info("device '{}': {}", my.config.names.front(), device::inWords(my.profile));
  if (my.config.enableForces) my.tick.control().arm();
  my.keeper.start();
}

void Station::stop() {
  Impl& my = *impl_;
  if (!std::exchange(my.running, false)) return;
  my.tick.control().stop();
  my.keeper.stop();
  my.tick.finish();
  my.device->close();
  my.recorder.finish();
  const auto wake = my.tick.histograms().wakeupError.copy();
  const auto compute = my.tick.histograms().compute.copy();
  const realtime::TickReport& end = my.tick.last();
  const auto us = [](base::Nanos t) { return static_cast<double>(t) * 1e-3; };
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
      spdlog::info("  guard: {} {} times: {}", trip.name, count, trip.what);
  }
}

std::optional<wire::Text> Station::checkHealth() {
  Impl& my = *impl_;
  std::string text = my.keeper.look(base::now());
  if (text == my.fault) return std::nullopt;
  my.fault = std::move(text);
  if (!my.fault.empty()) {
    spdlog::warn("device '{}': {}", my.config.names.front(), my.fault);
    return healthText(my.fault);
  }
  spdlog::info("device '{}': all is well again", my.config.names.front());
  const bool latched = my.outbox.last().guard.latched != 0;
  return wire::Text{
      .severity = wire::kTextNormal,
      .level = 0,
      .text = std::string("the device is well again") + (latched ? "; re-arm to feel forces" : "")};
}

void Station::checkBlackBox() {
  impl_->recorder.look();
}

SceneHost& Station::scene() noexcept {
  return impl_->scene;
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

void Station::onSubscribed(Session& session, wire::LocalSender name) {
  impl_->outbox.subscribe(session, name);
  if (!impl_->fault.empty()) session.send(name, healthText(impl_->fault));
}

void Station::clientGone(scene::ClientId client) {
  impl_->control.clientGone(client);
  impl_->roles.clientGone(client);
  std::erase_if(impl_->rearming, [client](const Session* session) { return session->id() == client; });
  impl_->outbox.clientGone(client);
}

int Station::wakeFd() const noexcept {
  return impl_->tick.wake().descriptor();
}

bool Station::collectReports(const WallClock& clock, const std::function<void()>& onTick) {
  Impl& my = *impl_;
  bool any = false;
  my.tick.reports().consume([&](const realtime::TickReport& report) {
    my.droppedReports = report.dropped;
    my.frame.buttons = my.modes.apply(report.device.buttons, my.alerts);
    const wire::Time time = clock.at(report.time);
    my.outbox.add(report, my.frame, time);
    for (const wire::ButtonAlert& alert : my.alerts) my.outbox.add(wire::Message(alert), time);
    my.alerts.clear();
    if (!my.outbox.collect()) return;
    any = true;
    onTick();
  });
  return any;
}

void Station::sendReports(Session& session) {
  impl_->outbox.send(session);
}

void Station::Impl::onPublished(const scene::SceneSnapshot& snapshot) {
  if (hand == nullptr || config.hand != "script") return;
  std::vector<std::pair<std::int32_t, std::uint64_t>> now;
  for (const auto& object : snapshot.objects) now.emplace_back(object->id, object->mesh->topology);
  if (now == explored) return;
  explored = std::move(now);
  hand->setPath(std::make_shared<const device::WaypointPath>(
      planStrokes(snapshot, workspaceOf(config, profile), base::now()), device::WaypointPath::Repeat::yes));
}

DeviceStatus Station::status() const {
  const Impl& my = *impl_;
  const device::DeviceProfile& profile = my.profile;
  DeviceStatus status;
  status.names = my.config.names;
  status.driver = my.config.driver;
  status.simulated = my.hand != nullptr;
  status.workspace_m = workspaceOf(my.config, profile);
  status.peakForce_N = profile.peakForce_N;
  status.rate_Hz = my.config.servoRate_Hz;
  status.realtime = my.keeper.realtime();
  status.heldBy = my.control.holder();
  status.hand = !status.simulated            ? "user"
                : status.heldBy              ? "held"
                : my.config.hand == "script" ? "scripted"
                                             : "file";
  status.fault = my.fault;
  status.droppedReports = my.droppedReports;
  status.last = my.outbox.last();
  status.period = my.tick.histograms().period.copy();
  status.wakeup = my.tick.histograms().wakeupError.copy();
  status.compute = my.tick.histograms().compute.copy();
  return status;
}

double Station::rateOf(const Session& session) const {
  return impl_->outbox.choiceOf(session.id()).rate_Hz;
}

bool Station::couldCommand(const Session& session) const {
  return !impl_->played && impl_->roles.couldCommand(session.id(), session.address());
}

}  // namespace hapticd::server
