#include <spdlog/spdlog.h>

#include <algorithm>
#include <iterator>

#include "base/world.h"
#include "device/drivers/drivers.h"
#include "device/profiles.h"
#include "device/simulated/simulated_device.h"
#include "server/station/devices.h"
#include "server/station/replies.h"
#include "server/station/station_impl.h"

namespace hapticd::server {
namespace {

// Stands in for a recorded device; only its profile is used.
std::unique_ptr<device::Device> placeholderFor(const record::RecordedDevice& recorded) {
  device::SimulatedOptions options;
  if (const auto* profile = device::findProfile(recorded.model)) options.profile = *profile;
  options.profile.workspace_m = recorded.sceneConfig.deviceWorkspace_m;
  options.profile.buttons = recorded.buttons;
  return std::make_unique<device::SimulatedDevice>(options);
}

// One of several may fail.
std::unique_ptr<device::Device> openDevice(const DeviceConfig& config) {
  auto device = makeDevice(config);
  try {
    device->open();
    if (config.calibrate && !device->traits().calibratesInLoop) device->calibrate();
  } catch (const std::runtime_error& error) {
    throw std::runtime_error("device '" + config.names.front() + "': " + error.what());
  }
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
  scene.ballTool = config.toolRadius_m > 0;
  return scene;
}

scene::SceneLimits sceneLimits(const LimitsConfig& config) {
  scene::SceneLimits limits;
  limits.objects = config.objects;
  limits.verticesInAll = static_cast<std::uint64_t>(config.vertices);
  limits.trianglesInAll = static_cast<std::uint64_t>(config.triangles);
  limits.effects = static_cast<std::size_t>(config.effects);
  limits.batch_bytes = static_cast<std::size_t>(config.batches_MB) << 20;
  return limits;
}

realtime::TickOptions tickOptions(const DeviceConfig& config, const device::Device& device) {
  realtime::TickOptions options;
  options.rate_Hz = config.servoRate_Hz;
  options.render.toolRadius_m = config.toolRadius_m;
  options.render.forceShading = config.forceShading;
  options.render.stribeckSpeed_m_per_s = config.stribeckSpeed_m_per_s;
  options.render.contactVibrationPulls = config.vibrationContactPulls;
  options.render.bareDamping_Ns_per_m = device::bareDampingOf(device.profile().model);
  options.guard = realtime::GuardOptions::of(device.profile());
  options.guard.selfRecover = !device.traits().needsRearm;
  options.forceLife = device.traits().forceLife;
  return options;
}

// A driver whose hand comes from a file, and which nobody steers.
bool hasRecordedHand(const DeviceConfig& config) {
  const device::Driver* const driver = device::findDriver(config.driver);
  return driver != nullptr && driver->hasHand;
}

realtime::EnergyBudget energyBudget(const DeviceConfig& config) {
  realtime::EnergyBudget budget;
  budget.refill_W = config.heldForcePower_W;
  return budget;
}

BlackBoxFiles blackBoxFiles(const DeviceConfig& config, const LimitsConfig& limits) {
  BlackBoxFiles files{.directory = config.blackBoxDir,
                      .keep = config.blackBoxKeep,
                      .bytes = static_cast<std::uint64_t>(limits.blackBoxes_MB) << 20};
  if (config.blackBoxDir.empty()) files.directory = defaultBlackBoxDir();
  return files;
}

wire::Text healthText(const std::string& fault) {
  return {.severity = wire::kTextError, .level = 0, .text = std::string(wire::kNoForceText) + ": " + fault};
}

}  // namespace

Station::Impl::Impl(const DeviceConfig& config_, std::vector<DeviceName> names_, SceneHost& scene_,
                    std::unique_ptr<device::Device> device_, bool allowNoRealtime)
    : config(config_),
      names(std::move(names_)),
      scene(scene_),
      device(std::move(device_)),
      hand(device->steered()),
      profile(device->profile()),
      canHurt(device->traits().needsRearm),
      tick(*device, clock, tickOptions(config, *device)),
      keeper(*device, tick, clock,
             {.name = config.names.front(),
              .rate_Hz = config.servoRate_Hz,
              // A device without a person at it cannot hurt: realtime rights are wanted, not demanded.
              .requireRealtime = !allowNoRealtime && canHurt,
              .vendorThread = device->traits().ticksInVendorThread}),
      control(tick.control(), hand, workspaceOf(config, profile), !hasRecordedHand(config)),
      streamed(tick.remote(), sceneConfig(config, profile), energyBudget(config), profile.outputDof > 3),
      roles(std::make_shared<Roles>(config.control, config.controlList)),
      modes(profile.buttons),
      outbox(config, profile.buttons, names),
      recorder(config.names.front(), blackBoxFiles(config, scene_.limits()), tick.blackBox()) {
  if (hand != nullptr && config.hand == "script")
    explorer.emplace(*hand, workspaceOf(config, profile), config.names.front());
}

Station::Station(const DeviceConfig& config, std::vector<DeviceName> names, SceneHost& scene,
                 bool allowNoRealtime)
    : impl_(std::make_unique<Impl>(config, std::move(names), scene, openDevice(config), allowNoRealtime)) {
  Impl& impl = *impl_;
  SceneDevice sceneDevice{.config = sceneConfig(impl.config, impl.profile),
                          .slot = &impl.tick.snapshots(),
                          .published =
                              [&impl](const auto& snapshot) {
                                impl.placement.write({snapshot->workspace.T_world_device});
                                impl.moving.published(*snapshot, base::now());
                                impl.onPublished(snapshot);
                              },
                          .publishing =
                              [&impl](base::Nanos now, std::uint64_t revision, const auto& readings) {
                                if (impl.recording == nullptr) return;
                                impl.recording->recordPublish(impl.recordedAs, now, revision, readings);
                                impl.showEdits();
                              },
                          .name = impl.config.names.front()};
  sceneDevice.config.limits = sceneLimits(scene.limits());
  impl.recordedScene = sceneDevice.config;
  impl.recordedOptions = tickOptions(impl.config, *impl.device);
  scene.add(std::move(sceneDevice));
}

Station::Station(const DeviceConfig& config, std::vector<DeviceName> names, SceneHost& scene,
                 const record::RecordedDevice& recorded)
    : impl_(std::make_unique<Impl>(config, std::move(names), scene, placeholderFor(recorded), true)) {
  impl_->replayed = true;
  Impl& impl = *impl_;
  scene.add({.config = recorded.sceneConfig,
             .slot = &impl.tick.snapshots(),
             .published = [&impl](const auto& snapshot) { impl.moving.published(*snapshot, base::now()); },
             .publishing = {}});
}

void Station::play(const realtime::TickReport& report) noexcept {
  impl_->tick.reports().push(report);
  impl_->tick.wake().notify();
}

record::RecordedDevice Station::recorded() const {
  const Impl& impl = *impl_;
  return {.names = impl.config.names,
          .driver = impl.config.driver,
          .model = impl.profile.model,
          .buttons = impl.profile.buttons,
          .scene = impl.scene.number(),
          .sceneConfig = impl.recordedScene,
          .tick = impl.recordedOptions};
}

void Station::recordTo(record::Recorder* recording, std::uint32_t number,
                       const scene::SceneBuilder* builder) {
  Impl& impl = *impl_;
  impl.recording = recording;
  impl.recordedAs = number;
  realtime::Tick::Rings rings;
  if (recording != nullptr) {
    rings.ticks = &recording->ring(number);
    rings.streams = &recording->streamRing(number);
    if (builder != nullptr) rings.memories = &recording->memoryRing(number);
  }
  if (builder != nullptr) rings.revision = realtime::Tick::Rings::kUnknown;
  impl.tick.recordTo(rings);
  impl.unshown = builder;
  impl.begunAt = base::now();
  impl.showEdits();
}

// In the scene's thread.
void Station::Impl::showEdits() noexcept {
  if (unshown == nullptr) return;
  const auto revision = unshown->revisionWith(begunAt);
  if (!revision) return;
  tick.rememberFrom(*revision);
  unshown = nullptr;
}

bool Station::finishedAfter(base::Nanos time) const noexcept {
  return impl_->keeper.isClosed() || impl_->tick.finishedAt() > time;
}

Station::~Station() {
  stop();
}

void Station::start() {
  Impl& impl = *impl_;
  if (impl.replayed) return;
  impl.running = true;
  spdlog::info("device '{}': {}", impl.config.names.front(), device::inWords(impl.profile));
  if (impl.config.enableForces) impl.tick.control().arm();
  impl.keeper.start();
}

void Station::stop() {
  Impl& impl = *impl_;
  if (!std::exchange(impl.running, false)) return;
  impl.tick.control().stop();
  impl.keeper.stop();
  impl.tick.finish();
  impl.device->close();
  const auto wake = impl.tick.histograms().wakeupError.copy();
  const auto compute = impl.tick.histograms().compute.copy();
  const realtime::TickReport& end = impl.tick.last();
  const auto us = [](base::Nanos t) { return static_cast<double>(t) * 1e-3; };
  spdlog::info("servo loop of '{}': {} ticks, {} overruns, {} periods skipped, {} reports dropped",
               impl.config.names.front(), end.tick, end.timing.overruns, end.timing.skippedPeriods,
               impl.droppedReports);
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

void Station::finishBlackBox() {
  impl_->recorder.finish();
}

void Station::stopForces() noexcept {
  impl_->tick.control().stop(base::now());
}

void Station::rampIn() noexcept {
  impl_->tick.control().rampIn();
}

bool Station::armed() const noexcept {
  const realtime::GuardControl& control = impl_->tick.control();
  return impl_->canHurt && control.armed() && !control.stopped();
}

bool Station::isStoppedAtZero() const noexcept {
  return impl_->tick.finishedAt() == 0 || impl_->tick.stoppedAtZero();
}

std::optional<wire::Text> Station::checkHealth() {
  Impl& impl = *impl_;
  if (impl.keeper.takeResumed()) {
    spdlog::warn("device '{}': the machine was suspended; forces are stopped until re-armed",
                 impl.config.names.front());
    return wire::Text{.severity = wire::kTextError,
                      .level = 0,
                      .text = "the machine was suspended: forces are stopped until re-armed"};
  }
  std::string text = impl.keeper.poll(base::now());
  if (text == impl.fault) return std::nullopt;
  impl.fault = std::move(text);
  if (!impl.fault.empty()) {
    spdlog::warn("device '{}': {}", impl.config.names.front(), impl.fault);
    return healthText(impl.fault);
  }
  spdlog::info("device '{}': works again", impl.config.names.front());
  const bool latched = impl.outbox.last().guard.latched != 0;
  return wire::Text{
      .severity = wire::kTextNormal,
      .level = 0,
      .text = std::string("the device works again") + (latched ? "; re-arm to enable its forces" : "")};
}

void Station::checkBlackBox() {
  impl_->recorder.poll();
}

SceneHost& Station::scene() noexcept {
  return impl_->scene;
}

bool Station::has(wire::LocalSender name) const noexcept {
  return std::any_of(impl_->names.begin(), impl_->names.end(),
                     [name](const DeviceName& known) { return known.sender == name; });
}

wire::LocalSender Station::nameFor(const Session& session) const noexcept {
  for (const DeviceName& name : impl_->names) {
    if (session.wants(name.sender)) return name.sender;
  }
  return impl_->names.front().sender;
}

void Station::onConnected(Session& session) {
  impl_->outbox.join(session);
}

void Station::sendPresentState(Session& session) {
  impl_->outbox.sendPresentState(session);
}

void Station::onSubscribed(Session& session, wire::LocalSender name) {
  impl_->outbox.subscribe(session, name);
  if (!impl_->fault.empty()) session.send(name, healthText(impl_->fault));
}

void Station::endStreams(scene::ClientId client) {
  impl_->streamed.clientGone(client);
}

void Station::clientEnds(scene::ClientId client) {
  impl_->control.letGo(client);
  impl_->streamed.clientGone(client);
  impl_->roles->release(client);
}

void Station::clientGone(scene::ClientId client) {
  clientEnds(client);
  impl_->control.clientGone(client);
  impl_->holding.erase(client);
  impl_->outbox.clientGone(client);
}

void Station::setKey(scene::ClientId client, std::uint64_t key) {
  impl_->control.setKey(client, key);
}

std::optional<wire::Text> Station::sessionGone(Session& session) {
  impl_->waiting.erase(impl_->waiting.lower_bound({session.id(), 0}),
                       impl_->waiting.lower_bound({session.id() + 1, 0}));
  auto text = impl_->dropRearms(session);
  clientGone(session.id());
  return text;
}

int Station::wakeFd() const noexcept {
  return impl_->tick.wake().descriptor();
}

// Encodes the ticks that wait; false when nothing is to be sent.
bool Station::Impl::takeTicks(const WallClock& wallClock) {
  bool any = false;
  const std::size_t admitted = freshTicks.affordable();
  tick.reports().consume([&](const realtime::TickReport& report, std::size_t newer) {
    droppedReports = report.dropped;
    frame.buttons = modes.apply(report.device.buttons, alerts);
    const wire::Time time = wallClock.at(report.time);
    outbox.add(report, frame, time, newer >= admitted);
    for (const wire::ButtonAlert& alert : alerts) outbox.add(wire::Message(alert), time);
    alerts.clear();
    any = outbox.collect() || any;
  });
  return tellOfStop(wallClock) || any;
}

// No tick tells what was done to a device that is closed. It acts from the first one on.
bool Station::Impl::tellOfStop(const WallClock& wallClock) {
  constexpr std::uint32_t kStopped = realtime::bit(realtime::Trip::stopped);
  const bool stopped = tick.control().stopped();
  realtime::TickReport last = outbox.last();
  if (!keeper.isClosed() || last.tick == 0 || last.guard.stopped == stopped) return false;
  last.guard.stopped = stopped;
  last.guard.active = stopped ? last.guard.active | kStopped : last.guard.active & ~kStopped;
  outbox.add(last, frame, wallClock.at(base::now()), true);
  return outbox.collect();
}

bool Station::report(const WallClock& clock, const Sessions& clients) {
  Impl& impl = *impl_;
  const bool newer = impl.takeTicks(clock);
  if (impl.passUpTo) {
    impl.clientsBehind = impl.clientsBehind || newer;  // those that this pass has served
  } else {
    if (!newer && !impl.clientsBehind) return false;
    impl.clientsBehind = false;
    impl.outbox.beginPass();
  }
  if (newer) impl.serveFirst(clients);
  const auto next = serveSlice(
      impl.passUpTo ? clients.upper_bound(*impl.passUpTo) : clients.begin(), clients.end(), clients.size(),
      impl.freshTicks,
      [&](const auto& entry, std::size_t most) { return impl.outbox.send(*entry.second, most); },
      [](const auto& entry) { entry.second->flush(); });
  impl.passUpTo.reset();
  if (next != clients.end()) impl.passUpTo = std::prev(next)->first;
  return impl.passUpTo.has_value();
}

void Station::reportToFirst(const WallClock& clock, const Sessions& clients) {
  if (!impl_->takeTicks(clock)) return;
  impl_->clientsBehind = true;
  impl_->serveFirst(clients);
}

void Station::Impl::serveFirst(const Sessions& clients) {
  constexpr std::size_t kFirst = 32;
  if (clients.size() <= kFirst) return;  // a slice serves them all
  const auto end = std::next(clients.begin(), kFirst);
  std::for_each(clients.begin(), end, [&](const auto& entry) {
    outbox.send(*entry.second, freshTicks.affordable());
    entry.second->flush();
  });
}

void Station::Impl::onPublished(const std::shared_ptr<const scene::SceneSnapshot>& snapshot) {
  if (!explorer) return;
  std::vector<std::pair<std::int32_t, std::uint64_t>> now;
  for (const auto& object : snapshot->objects) now.emplace_back(object->id, object->mesh->topology);
  if (now == plannedFor) return;
  plannedFor = std::move(now);
  explorer->explore(snapshot);
}

DeviceStatus Station::status() const {
  const Impl& impl = *impl_;
  const device::DeviceProfile& profile = impl.profile;
  DeviceStatus status;
  status.names = impl.config.names;
  status.driver = impl.config.driver;
  status.simulated = impl.hand != nullptr && !impl.replayed;
  status.workspace_m = workspaceOf(impl.config, profile);
  status.peakForce_N = profile.peakForce_N;
  status.rate_Hz = impl.config.servoRate_Hz;
  status.realtime = impl.keeper.realtime();
  status.heldBy = impl.control.holder();
  status.hand = impl.replayed                  ? "recorded"
                : !status.simulated            ? hasRecordedHand(impl.config) ? "file" : "user"
                : status.heldBy                ? "held"
                : impl.config.hand == "script" ? "scripted"
                                               : "file";
  status.fault = impl.fault;
  status.droppedReports = impl.droppedReports;
  status.last = impl.outbox.last();
  status.period = impl.tick.histograms().period.copy();
  status.wakeup = impl.tick.histograms().wakeupError.copy();
  status.compute = impl.tick.histograms().compute.copy();
  return status;
}

const realtime::TickReport& Station::lastTick() const noexcept {
  return impl_->outbox.last();
}

const std::string& Station::name() const noexcept {
  return impl_->config.names.front();
}

double Station::rateOf(const Session& session) const {
  return impl_->outbox.choiceOf(session.id()).rate_Hz;
}

bool Station::couldCommand(const Commander& client) const {
  return !impl_->replayed && client.identity.role == ClientRole::owner &&
         impl_->roles->couldCommand(client.id, client.address);
}

}  // namespace hapticd::server
