#include "record/recorder.h"

#include <algorithm>
#include <cmath>
#include <system_error>

#include "base/wall_offset.h"
#include "base/world.h"
#include "record/block_file.h"
#include "record/fields.h"
#include "record/scene_event_codec.h"

namespace hapticd::record {
namespace {

constexpr Nanos kPeriod = 20'000'000;  // a crash loses no more than this
constexpr Nanos kBetweenLossReports = 1'000'000'000;
constexpr Nanos kBetweenLooks = 1'000'000'000;

}  // namespace

Recorder::Recorder(std::filesystem::path file, OnProblem onProblem, const RecorderOptions& options)
    : path_(std::move(file)), onProblem_(std::move(onProblem)), options_(options) {
  try {
    file_ = base::world().files.create(path_, base::Existing::refuse);
  } catch (const std::system_error& error) {
    const std::string what = "cannot record to '" + path_.string() + "': " + error.code().message();
    std::error_code none;
    if (std::filesystem::is_other(path_, none))
      throw RecordingExists("cannot record to '" + path_.string() +
                            "': it is a device or a pipe; name a file");
    if (error.code() == std::errc::file_exists) throw RecordingExists(what + "; name another");
    if (error.code() == std::errc::is_a_directory) throw RecordingExists(what + "; name a file");
    throw RecordingError(what + "; name a file in a directory that can be written");
  }
}

std::uint32_t Recorder::addDevice(RecordedDevice device) {
  header_.push_back(std::move(device));
  devices_.push_back(std::make_unique<Device>(options_.ticks, options_.streamed));
  return static_cast<std::uint32_t>(devices_.size() - 1);
}

void Recorder::start(Nanos wallOffset, std::string config) {
  wallOffset_ = wallOffset;
  measuredWall_ = base::wallOffset();
  Bytes content;
  Packer pack(content);
  pack.put(kFormatVersion);
  pack.put(RecordingHeader{"hapticd " HAPTICD_VERSION, wallOffset, std::move(config), header_, {}});
  out_.assign(magic().begin(), magic().end());
  appendBlock(out_, BlockKind::header, content);
  LawRecord law{realtime::kForceLaw, {}};
  for (const RecordedDevice& device : header_) {
    const realtime::RenderOptions& render = device.tick.render;
    law.devices.push_back({render.stribeckSpeed_m_per_s, render.contactVibrationPulls});
  }
  content.clear();
  pack.put(law);
  appendBlock(out_, BlockKind::law, content);
  PassivityRecord passivity;
  for (const RecordedDevice& device : header_)
    passivity.bareDamping_Ns_per_m.push_back(device.tick.render.bareDamping_Ns_per_m);
  const auto controlled = [](double damping) { return std::isfinite(damping); };
  if (std::any_of(passivity.bareDamping_Ns_per_m.begin(), passivity.bareDamping_Ns_per_m.end(), controlled)) {
    content.clear();
    pack.put(passivity);
    appendBlock(out_, BlockKind::passivity, content);
  }
  if (const std::error_code error = tryWrite()) {
    endFile();
    throw RecordingError("cannot record to '" + path_.string() + "': " + error.message() +
                         (error == std::errc::no_space_on_device ? "; make room on the disk"
                          : error == std::errc::file_too_large   ? "; raise recording_MB in [limits]"
                                                                 : "; name a file on another disk"));
  }
  thread_ = base::Thread({.name = "recorder"}, [this] { return step(); });
}

std::optional<Nanos> Recorder::step() {
  if (ended()) return std::nullopt;
  const bool last = ending_.load(std::memory_order_acquire);
  drain();
  if (!last) return base::now() + kPeriod;
  close();
  ended_.store(true, std::memory_order_release);
  return std::nullopt;
}

void Recorder::end() {
  ending_.store(true, std::memory_order_release);
  thread_.wake();
}

void Recorder::close() {
  EndEvent end;
  for (const auto& device : devices_) end.time = std::max(end.time, device->newest);
  Bytes content;
  Packer(content).put(end);
  appendBlock(out_, BlockKind::end, content);
  write();
  file_.reset();
}

void Recorder::recordCommand(std::uint32_t scene, scene::ClientId client, Nanos time,
                             const scene::SceneCommand* command) {
  Bytes content;
  packSceneEvent(content, scene, client, time, command);
  appendEvent(BlockKind::scene, std::move(content));
}

void Recorder::recordLeft(std::uint32_t scene, scene::ClientId client, Nanos time) {
  Bytes content;
  Packer(content).put(LeftEvent{scene, client, time});
  appendEvent(BlockKind::left, std::move(content));
}

void Recorder::recordPublish(std::uint32_t device, Nanos time, std::uint64_t revision,
                             const std::vector<Nanos>& readings) {
  Bytes content;
  Packer(content).put(PublishEvent{device, time, revision, readings});
  appendEvent(BlockKind::publish, std::move(content));
}

void Recorder::recordMarker(Nanos time, const std::string& text) {
  Bytes content;
  Packer(content).put(MarkerEvent{time, text});
  appendEvent(BlockKind::marker, std::move(content));
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

void Recorder::followWallClock() {
  const Nanos now = base::now();
  const std::optional<Nanos> measured = base::tryWallOffset();
  if (!measured) return;
  const Nanos step = *measured - measuredWall_;
  if (std::abs(step) <= base::kWallStep) return;
  measuredWall_ += step;
  wallOffset_ += step;
  Bytes content;
  Packer(content).put(WallOffsetRecord{now, wallOffset_});
  appendEvent(BlockKind::wallOffset, std::move(content));
}

// The rings before the events: the commands that a tick saw were recorded before it, so they are in this
// batch, too.
void Recorder::drain() {
  followWallClock();
  for (const auto& device : devices_) {
    device->packer.restart();
    device->run.clear();
    device->ring.consume([&](const realtime::TickRecord& tick) {
      device->packer.add(tick, device->run);
      device->newest = tick.report.time;
      ++unwrittenTicks_;
    });
  }
  std::uint64_t lostEvents = 0;
  {
    const std::lock_guard lock(mutex_);
    out_.swap(events_);
    lostEvents = lostEvents_;
  }
  appendLost(LostEvent::What::sceneEvents, 0, lostEvents, counts_.lostSceneEvents);
  for (std::uint32_t i = 0; i < devices_.size(); ++i) {
    // After the rings of ticks for the same reason as the events.
    appendMemories(i, *devices_[i]);
    appendStreamed(i, *devices_[i]);
    appendTicks(i, *devices_[i]);
  }
  write();
  lookForFile();
  reportLosses();
}

// A file that was removed can be written and is lost; so is one that was emptied or replaced.
void Recorder::lookForFile() {
  if (!file_ || base::now() < nextLook_) return;
  nextLook_ = base::now() + kBetweenLooks;
  if (!file_->isGone()) return;
  endFile();
  onProblem_(RecorderProblem::stopped,
             "recording to '" + path_.string() +
                 "' has stopped: another program removed the file, or wrote to it; what was "
                 "recorded is lost or damaged; start a new recording");
}

void Recorder::reportLosses() {
  const std::uint64_t losses = counts_.lostTicks + counts_.lostSceneEvents + counts_.lostStreamed;
  if (losses == reportedLosses_ || base::now() < nextLossReport_ || !file_) return;
  reportedLosses_ = losses;
  nextLossReport_ = base::now() + kBetweenLossReports;
  onProblem_(RecorderProblem::losses,
             "recording to '" + path_.string() + "': " + std::to_string(counts_.lostTicks) + " ticks, " +
                 std::to_string(counts_.lostSceneEvents) + " scene events and " +
                 std::to_string(counts_.lostStreamed) +
                 " streamed values lost so far: the disk is too slow, or the machine too busy");
}

void Recorder::appendMemories(std::uint32_t number, Device& device) {
  device.memories.consume([&](const realtime::ServoMemory& memory) {
    Bytes content;
    if (memory.remote.contacts != 0 || memory.remote.force != 0) {
      Packer(content).put(number);
      packRemoteMemory(memory, content);
      appendBlock(out_, BlockKind::remoteMemory, content);
      content.clear();
    }
    Packer(content).put(number);
    packMemory(memory, content);
    appendBlock(out_, BlockKind::memory, content);
  });
}

void Recorder::appendStreamed(std::uint32_t number, Device& device) {
  device.streams.consume([&](const realtime::StreamRecord& stream) {
    Bytes content;
    Packer(content).put(number);
    packStream(stream, content);
    appendBlock(out_, BlockKind::stream, content);
  });
  const std::uint64_t before = device.lostStreamed;
  appendLost(LostEvent::What::streamed, number, device.streams.dropped(), device.lostStreamed);
  counts_.lostStreamed += device.lostStreamed - before;
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
  if (const std::error_code error = tryWrite()) fail(error);
}

std::error_code Recorder::tryWrite() {
  const Bytes bytes = std::exchange(out_, {});
  const std::uint64_t ticks = std::exchange(unwrittenTicks_, 0);
  if (!file_ || bytes.empty()) return {};
  if (counts_.bytes + bytes.size() > options_.fileBytes)
    return std::make_error_code(std::errc::file_too_large);
  try {
    file_->write(bytes);
    counts_.bytes += bytes.size();
    counts_.ticks += ticks;
    return {};
  } catch (const std::system_error& error) {
    return error.code();
  }
}

// One that has nothing in it is no recording, and would be in the way of the next one.
void Recorder::closeFile() noexcept {
  const bool isEmpty = file_ && counts_.bytes == 0 && !file_->isGone();
  file_.reset();
  try {
    if (isEmpty) base::world().files.remove(path_);
  } catch (const std::system_error&) {
    // It stays.
  }
}

void Recorder::endFile() {
  closeFile();
  writes_.store(false, std::memory_order_release);
  const std::lock_guard lock(mutex_);
  failed_ = true;
  events_ = {};
}

void Recorder::fail(const std::error_code& error) {
  endFile();
  const char* remedy = "";
  if (error == std::errc::no_space_on_device) remedy = "; make room on the disk and start a new recording";
  if (error == std::errc::file_too_large) remedy = "; start a new one, or raise recording_MB in [limits]";
  const char* const kept = counts_.bytes > 0 ? "; what was written before stays readable" : "";
  onProblem_(RecorderProblem::stopped,
             "recording to '" + path_.string() + "' has stopped: " + error.message() + kept + remedy);
}

void Recorder::finish() {
  if (thread_.running()) {
    thread_.stop();  // its last step drains
    if (!ended()) close();
  }
  closeFile();
}

}  // namespace hapticd::record
