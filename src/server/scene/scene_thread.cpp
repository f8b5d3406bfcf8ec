#include "server/scene/scene_thread.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "base/world.h"

namespace hapticd::server {
namespace {

constexpr base::Nanos kCollectAfter = 50'000'000;

bool has(const std::vector<scene::Notice>& notices, const scene::Notice& notice) {
  return std::any_of(notices.begin(), notices.end(), [&](const scene::Notice& known) {
    return known.client == notice.client && known.text == notice.text;
  });
}

void lowerTo(std::optional<base::Nanos>& next, std::optional<base::Nanos> at) {
  if (at) next = std::min(next.value_or(*at), *at);
}

}  // namespace

SceneThread::SceneThread(std::vector<SceneDevice> devices, Callbacks callbacks)
    : stopwatch_(devices.size()), callbacks_(std::move(callbacks)) {
  for (SceneDevice& device : devices) {
    device.config.stopwatch = [this] { return stopwatch_.read(); };
    device.config.clock = [this] { return stopwatch_.readClock(); };
    scene::SceneBuilder builder(device.config);
    seats_.push_back({std::move(device), std::move(builder)});
  }
}

SceneThread::~SceneThread() {
  stop();
}

void SceneThread::start() {
  publish();
  thread_ = base::Thread({.name = "scene"}, [this] { return step(); });
}

void SceneThread::stop() {
  if (!thread_.running()) return;
  thread_.stop();
  while (!queue_.empty()) step();
}

void SceneThread::push(SceneParcel&& parcel) {
  queue_.push(std::move(parcel));
  thread_.wake();
}

void SceneThread::pushUrgent(SceneTask&& task) {
  SceneParcel parcel{.client = task.client, .tasks = {}, .bytes = 0};
  parcel.tasks.push_back(std::move(task));
  queue_.pushFront(std::move(parcel));
  thread_.wake();
}

std::optional<base::Nanos> SceneThread::step() {
  applySlice();
  publish();
  describeScene();
  inspect();
  const std::optional<base::Nanos> oldestEdit = this->oldestEdit();
  queue_.published(oldestEdit);
  callPublishWaiters(oldestEdit);
  return queue_.empty() ? nextDeadline() : base::now();
}

// After a publication the servo returns the replaced snapshot, which may hold a large mesh: wake once to free
// it.
std::optional<base::Nanos> SceneThread::nextDeadline() const {
  std::optional<base::Nanos> next = collectAt_;
  for (const Seat& seat : seats_) lowerTo(next, seat.builder.nextDeadline());
  return next;
}

void SceneThread::applySlice() {
  for (std::size_t bytes = 0; bytes < kSlice_bytes;) {
    std::optional<SceneParcel> parcel = queue_.take();
    if (!parcel) return;
    apply(*parcel);
    bytes += parcel->bytes;
    const bool relieved = queue_.done(parcel->client, parcel->bytes, base::now());
    if (relieved && callbacks_.relieved) callbacks_.relieved(parcel->client);
  }
}

void SceneThread::apply(SceneParcel& parcel) {
  for (SceneTask& task : parcel.tasks) {
    try {
      apply(std::move(task));
    } catch (const std::exception& error) {
      noteFailure(task.client, error.what());
    }
  }
}

// Where memory has run out, the text may find none either.
void SceneThread::noteFailure(scene::ClientId client, const char* reason) noexcept {
  try {
    notices_.push_back(
        {client, scene::Notice::Severity::error, std::string("the command failed: ") + reason});
  } catch (const std::exception&) {
    notices_.clear();
    spdlog::error("a command of client {} failed, and so did its text: {}", client, reason);
  }
}

void SceneThread::apply(SceneTask&& task) {
  if (auto* request = std::get_if<DescribeScene>(&task.what)) {
    descriptionRequests_.push_back(std::move(*request));
    return;
  }
  if (auto* wanted = std::get_if<WhenPublished>(&task.what)) {
    publishWaiters_.push_back({base::now(), std::move(wanted->reached)});
    return;
  }
  if (auto* inspect = std::get_if<Inspect>(&task.what)) {
    inspections_.push_back(std::move(*inspect));
    return;
  }
  const std::shared_ptr<scene::ForceOwners>& owners = seats_.front().device.config.owners;
  if (const auto* back = std::get_if<ForcesReturn>(&task.what)) {
    if (owners) owners->comeBack(task.client, back->leaves);
    return;
  }
  const base::Nanos now = base::now();
  auto* command = std::get_if<scene::SceneCommand>(&task.what);
  if (callbacks_.applying) callbacks_.applying(task.client, now, command);
  const std::uint64_t resets = seats_.front().builder.resets();
  for (std::size_t i = seats_.size(); i-- > 0;) {
    auto& [device, builder, notices] = seats_[i];
    if (command == nullptr) {
      builder.clientGone(task.client, now);
    } else if (i > 0) {
      builder.apply(task.client, scene::SceneCommand(*command), now, notices);
    } else {
      builder.apply(task.client, std::move(*command), now, notices);
    }
  }
  takeNotices(true);
  if (seats_.front().builder.resets() != resets && callbacks_.wasReset) callbacks_.wasReset();
  // Not after ReleaseForces, which overtakes: what the client sent before it must not be felt.
  if (command == nullptr && owners) owners->forget(task.client);
}

// What all devices say is said once; what only some say, such as a bound, names them. `again`: also what
// waits to be said already.
void SceneThread::takeNotices(bool again) {
  for (std::size_t i = 0; i < seats_.size(); ++i) {
    for (scene::Notice notice : seats_[i].notices) {
      const bool ofAll = std::all_of(seats_.begin(), seats_.end(),
                                     [&](const Seat& seat) { return has(seat.notices, notice); });
      if (ofAll && i > 0) continue;
      if (!ofAll) notice.text += " (device '" + seats_[i].device.name + "')";
      if (again || !has(notices_, notice)) notices_.push_back(std::move(notice));
    }
  }
  for (Seat& seat : seats_) seat.notices.clear();
}

// Builders delay the publication of a mesh until its edits have paused.
std::optional<base::Nanos> SceneThread::oldestEdit() const {
  std::optional<base::Nanos> oldest;
  for (const Seat& seat : seats_) lowerTo(oldest, seat.builder.oldestEdit());
  return oldest;
}

void SceneThread::callPublishWaiters(std::optional<base::Nanos> oldestEdit) {
  const auto published = [&](const PublishWaiter& waiter) {
    return !oldestEdit || *oldestEdit > waiter.since;
  };
  for (const PublishWaiter& waiter : publishWaiters_) {
    if (published(waiter)) waiter.reached();
  }
  std::erase_if(publishWaiters_, published);
}

void SceneThread::publish() {
  collectAt_.reset();
  const base::Nanos now = base::now();
  stopwatch_.beginRound();
  for (Seat& seat : seats_) {
    try {
      publishTo(seat, now);
    } catch (const std::exception& error) {
      // Out of memory, or the index could not be built: the servo keeps the previous snapshot.
      spdlog::error("the scene could not be published: {}", error.what());
    }
  }
  takeNotices(false);
  if (!notices_.empty() && callbacks_.notices) callbacks_.notices(std::exchange(notices_, {}));
}

// One description serves all devices: their scenes differ only in the passivity bounds.
void SceneThread::describeScene() {
  if (descriptionRequests_.empty()) return;
  std::shared_ptr<const scene::SceneDescription> description;
  try {
    description = std::make_shared<const scene::SceneDescription>(seats_.front().builder.describe());
  } catch (const std::exception& error) {
    spdlog::error("the scene could not be described: {}", error.what());
  }
  for (const DescribeScene& request : std::exchange(descriptionRequests_, {})) request.reply(description);
}

void SceneThread::inspect() {
  for (const Inspect& inspection : std::exchange(inspections_, {})) {
    try {
      std::vector<const scene::SceneBuilder*> builders;
      for (const Seat& seat : seats_) builders.push_back(&seat.builder);
      inspection.call(builders);
    } catch (const std::exception& error) {
      noteFailure(0, error.what());
    }
  }
}

void SceneThread::publishTo(Seat& seat, base::Nanos now) {
  std::shared_ptr<const scene::SceneSnapshot> snapshot;
  // First, so that the builder can refit the index that the servo returned instead of building a new one.
  seat.device.slot->collect();
  stopwatch_.beginBuilder();
  try {
    snapshot = seat.builder.publish(now, seat.notices);
  } catch (...) {
    if (seat.device.publishing) seat.device.publishing(now, 0, stopwatch_.given());
    throw;
  }
  if (seat.device.publishing)
    seat.device.publishing(now, snapshot ? snapshot->revision : 0, stopwatch_.given());
  if (!snapshot) return;
  seat.device.slot->publish(snapshot);
  collectAt_ = base::now() + kCollectAfter;
  if (seat.device.published) seat.device.published(snapshot);
}

}  // namespace hapticd::server
