#include "server/player.h"

#include <chrono>
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
  thread_ = std::thread([this] { run(); });
}

void Player::stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_one();
  if (thread_.joinable()) thread_.join();
}

void Player::run() {
  std::string remark = playOnce();
  while (options_.loop && remark.empty() && began_ && waitFor(firstRecorded_)) {
    callbacks_.restart();
    remark = playOnce();
  }
  const std::lock_guard lock(mutex_);
  if (!stopping_) callbacks_.over(remark);
}

// What ended the file early, if something did.
std::string Player::playOnce() {
  began_ = false;
  ahead_.clear();
  try {
    record::RecordingReader reader(options_.file);
    for (bool more = true; more || !ahead_.empty();) {
      more = more && readAhead(reader);
      if (ahead_.empty()) continue;
      const auto next = ahead_.begin();
      if (!waitFor(next->first)) return {};
      play(next->second);
      ahead_.erase(next);
    }
    return reader.remark();
  } catch (const record::RecordingError& error) {
    return error.what();
  }
}

// False at the end of the file.
bool Player::readAhead(record::RecordingReader& reader) {
  while (ahead_.empty() || ahead_.rbegin()->first - ahead_.begin()->first < kAhead) {
    RecordingEvent event;
    if (!reader.next(event)) return false;
    if (const auto time = timeOf(event)) ahead_.emplace(*time, std::move(event));
  }
  return true;
}

Nanos Player::live(Nanos recorded) const {
  return firstLive_ + static_cast<Nanos>(static_cast<double>(recorded - firstRecorded_) / options_.speed);
}

// False when it is time to leave.
bool Player::waitFor(Nanos recorded) {
  if (!std::exchange(began_, true)) {
    firstRecorded_ = recorded;
    firstLive_ = base::now();
  }
  std::unique_lock lock(mutex_);
  const auto wait = std::chrono::nanoseconds(std::max<Nanos>(live(recorded) - base::now(), 0));
  return !wake_.wait_for(lock, wait, [this] { return stopping_; });
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
