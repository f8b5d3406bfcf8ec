#include "server/player.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "base/world.h"
#include "server/session/wall_clock.h"
#include "server/time_line.h"

namespace hapticd::server {
namespace {

using base::Nanos;
using record::RecordingEvent;
using record::SceneEvent;
using record::TickEvent;

// Nobody sees a shorter one move, and its passes would take a core.
constexpr Nanos kShortestLoop = 10'000'000;
constexpr Nanos kReadAhead = 200'000'000;
// After a stalled disk, a recording has the ticks of one device for seconds, then those of the next.
constexpr Nanos kFarthestAhead = 10'000'000'000;
constexpr std::size_t kMostAhead = 32'768;
constexpr Nanos kBetweenQuestions = 1'000'000;  // whether the scene is still behind
// Offset that keeps the ids of recorded clients apart from those of connected clients.
constexpr scene::ClientId kRecordedClients = 1U << 30U;

// The recorded time; empty for events that are not replayed.
std::optional<Nanos> timeOf(const RecordingEvent& event) {
  if (const auto* tick = std::get_if<TickEvent>(&event)) return tick->tick.report.time;
  if (const auto* scene = std::get_if<SceneEvent>(&event)) return scene->time;
  if (const auto* marker = std::get_if<record::MarkerEvent>(&event)) return marker->time;
  return std::nullopt;
}

}  // namespace

Player::Player(ReplayOptions options)
    : options_(std::move(options)),
      header_(record::RecordingReader(options_.file).header()),
      newestRead_(header_.devices.size()),
      speed_(options_.speed) {
  status_.file = options_.file.filename().string();
  status_.speed = options_.speed;
  status_.loop = options_.loop;
}

ServerConfig recordedConfig(const record::RecordingHeader& header, const std::string& file) {
  ServerConfig config = parseRecordedConfig(header.config, file);
  if (config.devices.size() != header.devices.size()) {
    throw std::runtime_error("'" + file + "' names " + std::to_string(config.devices.size()) +
                             " devices in its configuration but contains " +
                             std::to_string(header.devices.size()) + "; the recording is damaged");
  }
  return config;
}

ServerConfig Player::config() const {
  return recordedConfig(header_, options_.file.string());
}

void Player::start(Callbacks callbacks) {
  callbacks_ = std::move(callbacks);
  // Beside the replay: a long recording is read for some seconds.
  scan_ = base::Thread({.name = "time line", .niceness = 10}, [this]() -> std::optional<Nanos> {
    if (stopping_ || status().timeLine) return std::nullopt;
    auto line = std::make_shared<TimeLine>();
    try {
      *line = readTimeLine(options_.file, stopping_);
    } catch (const record::RecordingError&) {
      // The replay itself reports it.
    }
    const std::lock_guard lock(mutex_);
    status_.timeLine = std::move(line);
    return std::nullopt;
  });
  thread_ = base::Thread({.name = "player"}, [this] { return step(); });
}

void Player::stop() {
  stopping_ = true;
  thread_.stop();
  scan_.stop();
}

void Player::order(const ReplayOrder& order) {
  {
    const std::lock_guard lock(mutex_);
    std::optional<double> seek;
    if (order_) seek = order_->position_s;
    order_ = order;
    if (!order_->position_s) order_->position_s = seek;
  }
  thread_.wake();
}

ReplayStatus Player::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

std::optional<Nanos> Player::step() {
  while (!stopping_) {
    takeOrder();
    if (ended_) return std::nullopt;
    try {
      if (!reader_) reader_ = std::make_unique<record::RecordingReader>(options_.file);
      readAhead();
      if (buffer_.empty()) {
        endPass(reader_->ending(), reader_->remark());
        continue;
      }
      const auto next = buffer_.begin();
      if (!std::exchange(started_, true)) {
        begin_ = next->first;
        setPresent(begin_);
      }
      if (seek_s_) {
        skipTo_ = begin_ + base::toNanos(*std::exchange(seek_s_, std::nullopt));
        toShow_.assign(header_.devices.size(), 1);
      }
      const bool skips = skipTo_ && next->first < *skipTo_;
      if (skipTo_ && !skips) {
        setPresent(*skipTo_);
        skipTo_.reset();
      }
      // A device that has no tick soon shows none.
      if (!skips && next->first > firstRecorded_ + kReadAhead) toShow_.clear();
      const bool shows = std::find(toShow_.begin(), toShow_.end(), 1) != toShow_.end();
      if (!skips) {
        if (paused_ && !shows) return std::nullopt;
        if (const Nanos due = liveTime(next->first); !paused_ && base::now() < due) return due;
      }
      const auto* command = std::get_if<SceneEvent>(&next->second);
      if (command != nullptr && callbacks_.behind && callbacks_.behind(command->scene))
        return base::now() + kBetweenQuestions;
      if (!skips || command != nullptr) play(next->second);
      const auto* tick = std::get_if<TickEvent>(&next->second);
      if (tick != nullptr && !skips && !toShow_.empty()) toShow_[tick->device] = 0;
      position_ = next->first;
      buffer_.erase(next);
    } catch (const record::RecordingError& error) {
      endPass(error.what(), error.what());
    }
    const std::lock_guard lock(mutex_);
    status_.position_s = base::toSeconds(position_ - begin_);
  }
  return std::nullopt;
}

void Player::takeOrder() {
  const std::lock_guard lock(mutex_);
  if (!order_) return;
  const ReplayOrder order = *std::exchange(order_, std::nullopt);
  const Nanos now = base::now();
  // While it runs, the moment between two events counts, too.
  const Nanos present = paused_ || ended_ || !started_ ? position_ : recordedTime(now);
  paused_ = order.paused;
  if (std::isfinite(order.speed) && order.speed > 0) speed_ = std::clamp(order.speed, kSlowest, kFastest);
  setPresent(present);
  if (order.position_s && std::isfinite(*order.position_s)) {
    seek_s_ = std::clamp(*order.position_s, 0.0, 1e9);
    if (ended_ || (started_ && begin_ + base::toNanos(*seek_s_) <= position_)) rewind();
    ended_ = false;
  }
  status_.paused = paused_;
  status_.speed = speed_;
  status_.ended = ended_;
}

std::string Player::remark() const {
  const std::lock_guard lock(mutex_);
  return remark_;
}

void Player::readAhead() {
  while (!atEnd_ && !isAhead()) {
    RecordingEvent event;
    atEnd_ = !reader_->next(event);
    if (atEnd_) return;
    const auto time = timeOf(event);
    if (!time) continue;
    if (const auto* tick = std::get_if<TickEvent>(&event)) newestRead_[tick->device] = *time;
    buffer_.emplace(*time, std::move(event));
  }
}

// Whether nothing that is still to be read comes before what is due soon. A device that has no more ticks is
// not waited for.
bool Player::isAhead() const {
  if (buffer_.empty()) return false;
  const Nanos first = buffer_.begin()->first;
  if (buffer_.rbegin()->first - first < kReadAhead) return false;
  const auto [behind, before] = std::minmax_element(newestRead_.begin(), newestRead_.end());
  return newestRead_.empty() || *behind - kReadAhead >= first || *before - kFarthestAhead >= first ||
         buffer_.size() >= kMostAhead;
}

// To the beginning of the file. The recorded clients leave, so that no batch of theirs stays open.
void Player::rewind() {
  for (const auto& [scene, client] : std::exchange(clients_, {})) callbacks_.command(scene, client, nullptr);
  callbacks_.restart();
  reader_.reset();
  buffer_.clear();
  std::fill(newestRead_.begin(), newestRead_.end(), 0);
  atEnd_ = false;
  started_ = false;
  skipTo_.reset();
}

// `reason`: why the file ended early; empty at its regular end. `remark`: the same, and what it lacks before.
void Player::endPass(const std::string& reason, const std::string& remark) {
  {
    const std::lock_guard lock(mutex_);
    remark_ = remark;
  }
  if (options_.loop && reason.empty() && started_ && position_ - begin_ >= kShortestLoop) {
    rewind();
    return;
  }
  ended_ = true;
  callbacks_.ended(reason);
  reader_.reset();
  buffer_.clear();
  std::fill(newestRead_.begin(), newestRead_.end(), 0);
  skipTo_.reset();
  atEnd_ = false;
  started_ = false;
  const std::lock_guard lock(mutex_);
  status_.ended = true;
}

// From now on, this recorded moment is the present one.
void Player::setPresent(Nanos recorded) {
  firstRecorded_ = recorded;
  firstLive_ = base::now();
}

Nanos Player::liveTime(Nanos recorded) const {
  return firstLive_ + static_cast<Nanos>(static_cast<double>(recorded - firstRecorded_) / speed_);
}

Nanos Player::recordedTime(Nanos live) const {
  return firstRecorded_ + static_cast<Nanos>(static_cast<double>(live - firstLive_) * speed_);
}

void Player::play(RecordingEvent& event) {
  if (auto* tick = std::get_if<TickEvent>(&event)) {
    tick->tick.report.time = paused_ ? base::now() : liveTime(tick->tick.report.time);
    tick->tick.report.device.time = tick->tick.report.time;
    callbacks_.tick(tick->device, tick->tick.report);
  } else if (const auto* scene = std::get_if<SceneEvent>(&event)) {
    const scene::ClientId client = kRecordedClients + scene->client;
    if (scene->command) {
      clients_.emplace(scene->scene, client);
    } else {
      clients_.erase({scene->scene, client});
    }
    callbacks_.command(scene->scene, client, scene->command ? &*scene->command : nullptr);
  } else if (const auto* marker = std::get_if<record::MarkerEvent>(&event)) {
    if (callbacks_.marker) callbacks_.marker(liveTime(marker->time), marker->text);
  }
}

}  // namespace hapticd::server
