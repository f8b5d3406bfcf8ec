#include "server/player.h"

#include <optional>

#include "base/world.h"
#include "server/session/wall_clock.h"

namespace hapticd::server {
namespace {

using base::Nanos;
using record::SceneEvent;
using record::RecordingEvent;
using record::TickEvent;

constexpr Nanos kAhead = 200'000'000;
// Clients of the recording and those that watch it are not the same, whatever their numbers.
constexpr scene::ClientId kRecordedClients = 1U << 30U;

// When it was; nothing for what is not played.
std::optional<Nanos> timeOf(const RecordingEvent& event) {
  if (const auto* tick = std::get_if<TickEvent>(&event)) return tick->tick.report.time;
  if (const auto* told = std::get_if<SceneEvent>(&event)) return told->time;
  return std::nullopt;
}

}  // namespace

Player::Player(ReplayOptions options)
    : options_(std::move(options)), header_(record::RecordingReader(options_.file).header()) {}

ServerConfig Player::config() const {
  ServerConfig config = parseConfig(header_.config, options_.file.string());
  if (config.devices.size() != header_.devices.size()) {
    throw ConfigError("'" + options_.file.string() + "' names " + std::to_string(config.devices.size()) +
                      " devices in its configuration and has " + std::to_string(header_.devices.size()) +
                      "; it is damaged");
  }
  const ServerConfig usual;
  config.listenAddress = usual.listenAddress;
  config.port = usual.port;
  config.http = usual.http;
  config.httpAllow.clear();
  config.seconds = usual.seconds;
  config.record.clear();
  for (DeviceConfig& device : config.devices) device.hand = DeviceConfig().hand;  // the file may be gone
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
  while (!stopping_ && !over_) {
    try {
      if (!reader_) reader_ = std::make_unique<record::RecordingReader>(options_.file);
      readAhead();
      if (ahead_.empty()) {
        endPass(reader_->remark());
        continue;
      }
      const auto next = ahead_.begin();
      if (const Nanos due = dueAt(next->first); base::now() < due) return due;
      play(next->second);
      ahead_.erase(next);
    } catch (const record::RecordingError& error) {
      endPass(error.what());
    }
  }
  return std::nullopt;
}

void Player::readAhead() {
  while (!atEnd_ && (ahead_.empty() || ahead_.rbegin()->first - ahead_.begin()->first < kAhead)) {
    RecordingEvent event;
    atEnd_ = !reader_->next(event);
    if (atEnd_) return;
    if (const auto time = timeOf(event)) ahead_.emplace(*time, std::move(event));
  }
}

// `remark`: why the file ended early, if it did.
void Player::endPass(const std::string& remark) {
  if (options_.loop && remark.empty() && began_) {
    callbacks_.restart();
  } else {
    over_ = true;
    callbacks_.over(remark);
  }
  reader_.reset();
  ahead_.clear();
  atEnd_ = false;
  began_ = false;
}

Nanos Player::live(Nanos recorded) const {
  return firstLive_ + static_cast<Nanos>(static_cast<double>(recorded - firstRecorded_) / options_.speed);
}

// The first event of a pass is due at once.
Nanos Player::dueAt(Nanos recorded) {
  if (!std::exchange(began_, true)) {
    firstRecorded_ = recorded;
    firstLive_ = base::now();
  }
  return live(recorded);
}

void Player::play(RecordingEvent& event) {
  if (auto* tick = std::get_if<TickEvent>(&event)) {
    tick->tick.report.time = live(tick->tick.report.time);
    tick->tick.report.device.time = tick->tick.report.time;
    callbacks_.tick(tick->device, tick->tick.report);
  } else if (const auto* told = std::get_if<SceneEvent>(&event)) {
    callbacks_.told(told->scene, kRecordedClients + told->client, told->command ? &*told->command : nullptr);
  }
}

}  // namespace hapticd::server
