#include "record/rerender.h"

#include <new>
#include <string>
#include <utility>

#include "base/clock.h"
#include "record/archive.h"
#include "record/changed_surfaces.h"
#include "record/fields.h"
#include "scene/builder.h"

namespace hapticd::record {
namespace {

using realtime::GuardControl;
using realtime::TickReport;

// A recorded force lives until a tick says that it does not: longer than from write to write otherwise.
constexpr Nanos kForceLife = 10 * realtime::kOldestForce;

// Its states and the results of its writes are the recorded ones; it takes the time that made a recorded
// force too old.
class RecordedHand final : public device::Device {
 public:
  explicit RecordedHand(base::SimulatedClock& clock) noexcept : clock_(clock) {}
  void use(const realtime::TickRecord& tick) noexcept { tick_ = &tick; }

  void open() override {}
  void close() noexcept override {}
  const device::DeviceProfile& profile() const noexcept override { return profile_; }
  bool read(Nanos /*now*/, device::DeviceState& state) noexcept override {
    if (tick_->discarded) clock_.sleepUntil(clock_.now() + realtime::kOldestForce + 1);
    if (tick_->haveState) state = tick_->report.device;
    return tick_->haveState;
  }
  bool write(const geometry::Vec3& /*force_N*/) noexcept override {
    return tick_ == nullptr || tick_->written;
  }

 private:
  base::SimulatedClock& clock_;
  const device::DeviceProfile profile_;
  const realtime::TickRecord* tick_ = nullptr;
};

[[noreturn]] void failToRebuild(const std::string& why) {
  throw RecordingError("the recorded scene cannot be rebuilt on this machine: " + why);
}

// The builder refuses what finds no memory, and continues: the recorded server went on with the whole scene.
void requireMemory(const std::vector<scene::Notice>& notices) {
  for (const scene::Notice& notice : notices) {
    if (notice.text.find(scene::kOutOfMemory) != std::string::npos) failToRebuild(notice.text);
  }
}

Bytes outcome(const TickReport& report) {
  Bytes bytes;
  Packer pack(bytes);
  pack.put(report.revision);
  pack.put(report.rendering);
  for (std::uint32_t i = 0; i < report.rendering.contactCount; ++i) pack.put(report.rendering.contacts[i]);
  pack.put(report.force_N);
  pack.put(report.guard);
  pack.put(report.guard.counts);
  pack.put(report.T_world_device);
  return bytes;
}

realtime::TickOptions changed(realtime::TickOptions options, const RerenderChanges& changes) {
  options.render.toolRadius_m = changes.toolRadius_m.value_or(options.render.toolRadius_m);
  options.render.forceShading = changes.forceShading.value_or(options.render.forceShading);
  if (changes.raw) options.guard.enabled = false;
  options.forceLife = kForceLife;
  options.reports = 1;
  options.blackBox_s = 0;
  return options;
}

scene::SceneConfig changedScene(const RecordedDevice& recorded, const RerenderChanges& changes) {
  scene::SceneConfig config = recorded.sceneConfig;
  config.raw = config.raw || changes.raw;
  config.ballTool = changed(recorded.tick, changes).render.toolRadius_m > 0;
  return config;
}

}  // namespace

bool RerenderChanges::surfaces() const noexcept {
  return stiffness_N_per_m || damping_Ns_per_m || staticFriction || dynamicFriction;
}

bool RerenderChanges::none() const noexcept {
  return !surfaces() && !toolRadius_m && !forceShading && !raw;
}

bool sameOutcome(const TickReport& a, const TickReport& b) {
  return outcome(a) == outcome(b);
}

// One device with its builder.
struct Rerenderer::Seat {
  Seat(const RecordedDevice& recorded, const RerenderChanges& changes)
      : scene(recorded.scene),
        control{false, recorded.tick.guard.armed, 0, 0},
        surfaces(changes, changedScene(recorded, changes)),
        builder(withSeams(changedScene(recorded, changes))),
        tick(device, clock, changed(recorded.tick, changes)) {}

  scene::SceneConfig withSeams(scene::SceneConfig config) {
    config.owners = owners;
    config.stopwatch = [this] {
      if (readings.empty()) return lastReading;
      lastReading = readings.front();
      readings.pop_front();
      return lastReading;
    };
    return config;
  }

  // Gives the guard the control that it saw; it reacts to changes only.
  void apply(const GuardControl::Seen& wanted) {
    if (wanted.rearms != control.rearms) tick.control().rearm();
    if (wanted.ramps != control.ramps) tick.control().rampIn();
    if (wanted.stopped) tick.control().stop();
    if (wanted.armed) {
      tick.control().arm();
    } else {
      tick.control().disarm();
    }
    control = wanted;
  }

  // A recording that began while the server ran starts between two ticks: the state of its first tick is the
  // recorded one, as far as that tells, until a tick whose whole state is in the file. Older files have no
  // such tick: there, both are taken to be the same once both are free of contact.
  void follow(const TickReport& recorded) {
    const bool first = !std::exchange(begun, true);
    if (first && recorded.tick > 1) {
      tick.resume(recorded);
      settled = false;
    }
    if (settled) return;
    if (memory) {
      settled = memory->whole && recorded.tick >= memory->tick;
      if (settled) tick.resume(recorded, *memory);
    } else if (!first && !recorded.rendering.touching && !tick.last().rendering.touching) {
      settled = true;
      guessed = true;
      tick.resume(recorded);  // without the trips of a contact that began here only
    }
  }

  void publish(std::uint64_t revision) {
    if (revision == shown) return;
    while (!unseen.empty() && unseen.front().first < revision) unseen.pop_front();
    if (unseen.empty() || unseen.front().first != revision) return;  // lost
    tick.snapshots().publish(unseen.front().second);
    unseen.pop_front();
    shown = revision;
  }

  const std::uint32_t scene;
  GuardControl::Seen control;
  std::deque<Nanos> readings;  // of the stopwatch, in the publish at hand
  Nanos lastReading = 0;
  ChangedSurfaces surfaces;
  const std::shared_ptr<scene::ForceOwners> owners = std::make_shared<scene::ForceOwners>();
  scene::SceneBuilder builder;
  std::shared_ptr<const scene::SceneSnapshot> newest;
  std::deque<std::pair<std::uint64_t, std::shared_ptr<const scene::SceneSnapshot>>> unseen;
  std::uint64_t shown = 0;
  std::deque<realtime::StreamRecord> streamed;  // not yet seen by a tick

  bool begun = false;
  bool settled = true;
  bool guessed = false;  // what the servo knew when the recording began
  std::optional<realtime::ServoMemory> memory;

  base::SimulatedClock clock;
  RecordedHand device{clock};
  realtime::Tick tick;
};

Rerenderer::Rerenderer(const RecordingHeader& header, const RerenderChanges& changes) {
  for (const RecordedDevice& device : header.devices) {
    seats_.push_back(std::make_unique<Seat>(device, changes));
  }
}

Rerenderer::~Rerenderer() = default;

const TickReport* Rerenderer::feed(const RecordingEvent& event) {
  if (const auto* command = std::get_if<SceneEvent>(&event)) on(*command);
  if (const auto* published = std::get_if<PublishEvent>(&event)) on(*published);
  if (const auto* streamed = std::get_if<StreamEvent>(&event)) on(*streamed);
  if (const auto* remembered = std::get_if<MemoryEvent>(&event)) on(*remembered);
  if (const auto* left = std::get_if<LeftEvent>(&event)) on(*left);
  if (const auto* tick = std::get_if<TickEvent>(&event)) return on(*tick);
  return nullptr;
}

void Rerenderer::on(const SceneEvent& event) {
  std::vector<scene::Notice> notices;
  for (const auto& seat : seats_) {
    if (seat->scene != event.scene) continue;
    try {
      if (event.command) {
        seat->builder.apply(event.client, scene::SceneCommand(*event.command), event.time, notices);
      } else {
        seat->builder.clientGone(event.client, event.time);
      }
      requireMemory(notices);
    } catch (const std::bad_alloc&) {
      failToRebuild("out of memory");
    } catch (const std::exception&) {
      // The scene thread, too, reported it and continued.
    }
    if (!event.command) seat->owners->forget(event.client);
  }
}

void Rerenderer::on(const LeftEvent& event) {
  for (const auto& seat : seats_) {
    if (seat->scene != event.scene) continue;
    if (event.time > 0) {
      seat->owners->leave(event.client, event.time);
    } else {
      seat->owners->comeBack(event.client, seat->owners->leaves(event.client));
    }
  }
}

void Rerenderer::on(const PublishEvent& event) {
  Seat& seat = *seats_.at(event.device);
  seat.readings.assign(event.stopwatch.begin(), event.stopwatch.end());
  std::vector<scene::Notice> notices;
  try {
    if (auto snapshot = seat.builder.publish(event.time, notices)) {
      seat.newest = seat.surfaces.of(std::move(snapshot));
    }
  } catch (const std::exception& error) {
    // In the recording, too, the published scene stays as it is; otherwise the reason is in this machine.
    if (event.revision != 0) failToRebuild(error.what());
  }
  // Other surfaces may make another number of revisions: pair the recorded one with the newest snapshot.
  if (event.revision == 0 || !seat.newest) return;
  if (seat.newest->revision != event.revision) {
    auto numbered = std::make_shared<scene::SceneSnapshot>(*seat.newest);
    numbered->revision = event.revision;
    seat.newest = std::move(numbered);
  }
  seat.unseen.emplace_back(event.revision, seat.newest);
}

void Rerenderer::on(const StreamEvent& event) {
  seats_.at(event.device)->streamed.push_back(event.stream);
}

void Rerenderer::on(const MemoryEvent& event) {
  seats_.at(event.device)->memory = event.memory;
}

const TickReport* Rerenderer::on(const TickEvent& event) {
  Seat& seat = *seats_.at(event.device);
  const TickReport& recorded = event.tick.report;
  seat.publish(recorded.revision);
  seat.apply(event.tick.control);
  for (; !seat.streamed.empty() && seat.streamed.front().tick <= recorded.tick; seat.streamed.pop_front())
    seat.tick.remote().write(seat.streamed.front().input);
  seat.device.use(event.tick);
  if (event.tick.expired) seat.clock.sleepUntil(seat.clock.now() + kForceLife + 1);
  seat.tick(
      {recorded.time, recorded.timing.wakeupError, recorded.timing.overruns, recorded.timing.skippedPeriods});
  seat.follow(recorded);
  return &seat.tick.last();
}

bool Rerenderer::comparable(std::uint32_t device) const {
  return seats_.at(device)->settled;
}

bool Rerenderer::knowsPast(std::uint32_t device) const {
  return !seats_.at(device)->guessed;
}

}  // namespace hapticd::record
