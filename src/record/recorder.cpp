#include "record/recorder.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>

#include "base/world.h"
#include "record/block_file.h"
#include "record/fields.h"
#include "record/pack_commands.h"

namespace hapticd::record {
namespace {

using namespace std::chrono_literals;

constexpr auto kPause = 20ms;  // a crash costs no more than this

}  // namespace

Recorder::Recorder(std::filesystem::path file, OnTrouble onTrouble, const RecorderOptions& options)
    : path_(std::move(file)), onTrouble_(std::move(onTrouble)), options_(options) {
  file_ = ::open(path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (file_ < 0) {
    throw RecordingError("cannot record to '" + path_.string() + "': " + std::strerror(errno) +
                       (errno == EEXIST ? "; name another, or let the name hold the time: "
                                          "session-%Y%m%d-%H%M%S.haptics"
                                        : "; name a file in a directory that can be written"));
  }
}

std::uint32_t Recorder::addDevice(RecordedDevice device) {
  header_.push_back(std::move(device));
  devices_.push_back(std::make_unique<Device>(options_.ticks));
  return static_cast<std::uint32_t>(devices_.size() - 1);
}

std::function<Nanos()> Recorder::stopwatch(std::uint32_t device) {
  return [readings = &devices_[device]->readings] {
    readings->push_back(base::now());
    return readings->back();
  };
}

void Recorder::start(Nanos wallOffset, std::string config) {
  Bytes content;
  Packer pack(content);
  pack.put(kFormatVersion);
  pack.put(RecordingHeader{"hapticd " HAPTICD_VERSION, wallOffset, std::move(config), header_});
  out_.assign(magic().begin(), magic().end());
  appendBlock(out_, BlockKind::header, content);
  write();
  thread_ = std::thread([this] { run(); });
}

void Recorder::told(std::uint32_t scene, scene::ClientId client, Nanos time,
                    const scene::SceneCommand* command) {
  Bytes content;
  packSceneEvent(content, scene, client, time, command);
  appendEvent(BlockKind::scene, std::move(content));
}

void Recorder::published(std::uint32_t device, Nanos time, std::uint64_t revision) {
  PublishEvent event{device, time, revision, {}};
  event.stopwatch.swap(devices_[device]->readings);
  Bytes content;
  Packer(content).put(event);
  appendEvent(BlockKind::publish, std::move(content));
}

void Recorder::appendEvent(BlockKind kind, Bytes&& content) {
  const std::lock_guard lock(mutex_);
  if (failed_) return;
  if (events_.size() + content.size() > options_.sceneBytes) {
    ++lostEvents_;
    return;
  }
  appendBlock(events_, kind, content);
}

void Recorder::run() {
  for (;;) {
    bool last = false;
    {
      std::unique_lock lock(mutex_);
      wake_.wait_for(lock, kPause, [this] { return stopping_; });
      last = stopping_;
    }
    drain();
    if (last) return;
  }
}

// The rings first: what a tick has seen was told before it, so that it is in what is taken now.
void Recorder::drain() {
  for (const auto& device : devices_) {
    device->packer.restart();
    device->run.clear();
    device->ring.consume([&](const realtime::TickRecord& tick) {
      device->packer.add(tick, device->run);
      device->newest = tick.report.time;
      ++counts_.ticks;
    });
  }
  std::uint64_t lostEvents = 0;
  {
    const std::lock_guard lock(mutex_);
    out_.swap(events_);
    lostEvents = lostEvents_;
  }
  appendLost(LostEvent::What::sceneEvents, 0, lostEvents, counts_.lostSceneEvents);
  for (std::uint32_t i = 0; i < devices_.size(); ++i) appendTicks(i, *devices_[i]);
  write();
  tellLosses();
}

void Recorder::tellLosses() {
  const std::uint64_t losses = counts_.lostTicks + counts_.lostSceneEvents;
  if (losses == toldLosses_ || base::now() < tellAfter_ || file_ < 0) return;
  toldLosses_ = losses;
  tellAfter_ = base::now() + 1'000'000'000;
  onTrouble_("recording to '" + path_.string() + "': " + std::to_string(counts_.lostTicks) + " ticks and " +
             std::to_string(counts_.lostSceneEvents) +
             " scene events lost so far, the disk does not keep up; record to a faster one");
}

void Recorder::appendTicks(std::uint32_t number, Device& device) {
  if (!device.run.empty()) {
    Bytes content;
    Packer(content).put(number);
    content.insert(content.end(), device.run.begin(), device.run.end());
    appendBlock(out_, BlockKind::ticks, content);
  }
  const std::uint64_t before = device.lost;
  appendLost(LostEvent::What::ticks, number, device.ring.dropped(), device.lost);
  counts_.lostTicks += device.lost - before;
}

void Recorder::appendLost(LostEvent::What what, std::uint32_t device, std::uint64_t total,
                          std::uint64_t& known) {
  if (total == known) return;
  Bytes content;
  Packer(content).put(LostEvent{what, device, total - known});
  appendBlock(out_, BlockKind::lost, content);
  known = total;
}

void Recorder::write() {
  std::size_t done = 0;
  while (file_ >= 0 && done < out_.size()) {
    const ::ssize_t wrote = ::write(file_, out_.data() + done, out_.size() - done);
    if (wrote < 0 && errno == EINTR) continue;
    if (wrote < 0) {
      fail(errno);
      break;
    }
    done += static_cast<std::size_t>(wrote);
  }
  counts_.bytes += done;
  out_.clear();
}

void Recorder::fail(int error) {
  ::close(file_);
  file_ = -1;
  {
    const std::lock_guard lock(mutex_);
    failed_ = true;
    events_ = {};
  }
  onTrouble_("recording to '" + path_.string() + "' has stopped: " + std::strerror(error) +
             "; what was written before stays readable" +
             (error == ENOSPC ? ", make room on the disk and record anew" : ""));
}

void Recorder::finish() {
  if (thread_.joinable()) {
    {
      const std::lock_guard lock(mutex_);
      stopping_ = true;
    }
    wake_.notify_one();
    thread_.join();
    EndEvent end;
    for (const auto& device : devices_) end.time = std::max(end.time, device->newest);
    Bytes content;
    Packer(content).put(end);
    appendBlock(out_, BlockKind::end, content);
    write();
  }
  if (file_ >= 0) ::close(file_);
  file_ = -1;
}

}  // namespace hapticd::record
