#include "server/player.h"

#include <optional>

#include "base/world.h"
#include "server/session/wall_clock.h"

namespace hapticd::server {
namespace {

using base::Nanos;
using record::RecordingEvent;
using record::SceneEvent;
using record::TickEvent;

constexpr Nanos kReadAhead = 200'000'000;
// Offset that keeps the ids of recorded clients apart from those of connected clients.
constexpr scene::ClientId kRecordedClients = 1U << 30U;

// The recorded time; empty for events that are not replayed.
std::optional<Nanos> timeOf(const RecordingEvent& event) {
  if (const auto* tick = std::get_if<TickEvent>(&event)) return tick->tick.report.time;
  if (const auto* scene = std::get_if<SceneEvent>(&event)) return scene->time;
  return std::nullopt;
}

}  // namespace

Player::Player(ReplayOptions options)
    : options_(std::move(options)), header_(record::RecordingReader(options_.file).header()) {}

ServerConfig Player::config() const {
  ServerConfig config = parseConfig(header_.config, options_.file.string());
  if (config.devices.size() != header_.devices.size()) {
    throw ConfigError("'" + options_.file.string() + "' names " + std::to_string(config.devices.size()) +
                      " devices in its configuration but contains " + std::to_string(header_.devices.size()) +
                      "; the recording is damaged");
  }
  const ServerConfig defaults;
  config.listenAddress = defaults.listenAddress;
  config.port = defaults.port;
  config.http = defaults.http;
  config.httpAllow.clear();
  config.seconds = defaults.seconds;
  config.record.clear();
  for (DeviceConfig& device : config.devices)
    device.hand = DeviceConfig().hand;  // the hand file may not exist here
  return config;
}

void Player::start(Callbacks callbacks) {
  callbacks_ = std::move(callbacks);
  thread_ = base::Thread({.name = "player"}, [this] { return step(); });
}

void Player::stop() {
  stopping_ = true;
  thread_.stop();
}

std::optional<Nanos> Player::step() {
  while (!stopping_ && !ended_) {
    try {
      if (!reader_) reader_ = std::make_unique<record::RecordingReader>(options_.file);
      readAhead();
      if (buffer_.empty()) {
        endPass(reader_->remark());
        continue;
      }
      const auto next = buffer_.begin();
      if (const Nanos due = dueAt(next->first); base::now() < due) return due;
      play(next->second);
      buffer_.erase(next);
    } catch (const record::RecordingError& error) {
      endPass(error.what());
    }
  }
  return std::nullopt;
}

void Player::readAhead() {
  while (!atEnd_ && (buffer_.empty() || buffer_.rbegin()->first - buffer_.begin()->first < kReadAhead)) {
    RecordingEvent event;
    atEnd_ = !reader_->next(event);
    if (atEnd_) return;
    if (const auto time = timeOf(event)) buffer_.emplace(*time, std::move(event));
  }
}

// `remark`: why the file ended early; empty at its regular end.
void Player::endPass(const std::string& remark) {
  if (options_.loop && remark.empty() && started_) {
    callbacks_.restart();
  } else {
    ended_ = true;
    callbacks_.ended(remark);
  }
  reader_.reset();
  buffer_.clear();
  atEnd_ = false;
  started_ = false;
}

Nanos Player::liveTime(Nanos recorded) const {
  return firstLive_ + static_cast<Nanos>(static_cast<double>(recorded - firstRecorded_) / options_.speed);
}

// The live time of an event; the first event of a pass is due at once.
Nanos Player::dueAt(Nanos recorded) {
  if (!std::exchange(started_, true)) {
    firstRecorded_ = recorded;
    firstLive_ = base::now();
  }
  return liveTime(recorded);
}

void Player::play(RecordingEvent& event) {
  if (auto* tick = std::get_if<TickEvent>(&event)) {
    tick->tick.report.time = liveTime(tick->tick.report.time);
    tick->tick.report.device.time = tick->tick.report.time;
    callbacks_.tick(tick->device, tick->tick.report);
  } else if (const auto* scene = std::get_if<SceneEvent>(&event)) {
    callbacks_.command(scene->scene, kRecordedClients + scene->client,
                       scene->command ? &*scene->command : nullptr);
  }
}

}  // namespace hapticd::server
