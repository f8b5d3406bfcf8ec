#include "record/recording_reader.h"

#include <limits>

#include "base/printable.h"
#include "record/fields.h"
#include "record/scene_event_codec.h"

namespace hapticd::record {
namespace {

constexpr int kMostButtons = 32;                                  // a tick has one bit for each
constexpr Nanos kLatest = std::numeric_limits<Nanos>::max() / 2;  // sums with it do not overflow

}  // namespace

RecordingReader::RecordingReader(const std::filesystem::path& file) : path_(file), blocks_(file) {
  readHeader();
  readLaw();
  readPassivity();
  wallOffsets_.emplace(std::numeric_limits<Nanos>::min(), header_.wallOffset);
}

Nanos RecordingReader::wallOffsetAt(Nanos time) const {
  return std::prev(wallOffsets_.upper_bound(time))->second;
}

void RecordingReader::fail(const std::string& what) const {
  throw RecordingError("'" + path_.string() + "', block at byte " + std::to_string(block_.offset) + ": " +
                       what);
}

void RecordingReader::readHeader() {
  if (!blocks_.next(block_)) {
    const std::string& damage = blocks_.damage();
    throw RecordingError("'" + path_.string() +
                         "' has no whole header: " + (damage.empty() ? "it is empty" : damage));
  }
  if (block_.kind != BlockKind::header) fail("the first block is not a header");
  Unpacker in(block_.content);
  const auto version = in.next<std::uint32_t>();
  if (in.ok() && (version < 1 || version > kFormatVersion)) {
    fail("the file has version " + std::to_string(version) +
         " of the format, this program reads versions 1 to " + std::to_string(kFormatVersion) +
         "; use the hapticd that wrote it");
  }
  in.take(header_);
  if (!in.ok() || !in.rest().empty()) fail("the length of the header does not match its content");
  for (const RecordedDevice& device : header_.devices) {
    if (device.names.empty()) fail("a device without a name");
    if (device.buttons < 0 || device.buttons > kMostButtons) {
      fail("a device with " + std::to_string(device.buttons) + " buttons, there are 0 to " +
           std::to_string(kMostButtons));
    }
  }
}

// The block after the header, if it is one of this kind: older files have none.
void RecordingReader::readLaw() {
  pending_ = blocks_.next(block_);
  if (!pending_ || block_.kind != BlockKind::law) return;
  pending_ = false;
  Unpacker in(block_.content);
  in.take(header_.law);
  if (!in.ok() || !in.rest().empty() || header_.law.devices.size() != header_.devices.size()) {
    fail("the force law does not match the devices");
  }
  for (std::size_t i = 0; i < header_.devices.size(); ++i) {
    realtime::RenderOptions& render = header_.devices[i].tick.render;
    render.stribeckSpeed_m_per_s = header_.law.devices[i].stribeckSpeed_m_per_s;
    render.contactVibrationPulls = header_.law.devices[i].contactVibrationPulls;
  }
}

// The block after the law, if it is one of this kind.
void RecordingReader::readPassivity() {
  if (!pending_) pending_ = blocks_.next(block_);
  if (!pending_ || block_.kind != BlockKind::passivity) return;
  pending_ = false;
  PassivityRecord record;
  Unpacker in(block_.content);
  in.take(record);
  if (!in.ok() || !in.rest().empty() || record.bareDamping_Ns_per_m.size() != header_.devices.size()) {
    fail("the passivity controllers do not match the devices");
  }
  for (std::size_t i = 0; i < header_.devices.size(); ++i)
    header_.devices[i].tick.render.bareDamping_Ns_per_m = record.bareDamping_Ns_per_m[i];
}

bool RecordingReader::next(RecordingEvent& event) {
  for (;;) {
    if (ticks_) {
      TickEvent& tick = event.emplace<TickEvent>();
      tick.device = ticksOf_;
      if (ticks_->next(tick.tick)) return true;
      if (!ticks_->ok()) fail("a damaged tick");
      ticks_.reset();
    }
    if (!pending_ && !blocks_.next(block_)) return false;
    pending_ = false;
    if (readBlock(event)) return true;
  }
}

template <class Event>
void RecordingReader::takeWhole(RecordingEvent& event) {
  Unpacker in(block_.content);
  in.take(event.emplace<Event>());
  if (!in.ok() || !in.rest().empty()) fail("the length of an event does not match its content");
}

void RecordingReader::readMemory(MemoryEvent& memory) {
  Unpacker in(block_.content);
  memory.device = in.next<std::uint32_t>();
  if (!unpackMemory(in, memory.memory) || !in.rest().empty()) fail("a damaged memory of a servo");
  const auto part = remote_.find(memory.device);
  if (part == remote_.end()) return;
  if (part->second.tick == memory.memory.tick) memory.memory.remote = part->second.remote;
  remote_.erase(part);
}

void RecordingReader::readRemoteMemory() {
  Unpacker in(block_.content);
  const auto device = in.next<std::uint32_t>();
  if (device >= header_.devices.size() || !unpackRemoteMemory(in, remote_[device]) || !in.rest().empty())
    fail("a damaged memory of a servo");
}

void RecordingReader::readWallOffset() {
  WallOffsetRecord record;
  Unpacker in(block_.content);
  in.take(record);
  if (!in.ok() || !in.rest().empty() || record.offset < -kLatest || record.offset > kLatest)
    fail("a damaged wall offset");
  wallOffsets_[record.time] = record.offset;
}

// False when the block is not an event by itself.
bool RecordingReader::readBlock(RecordingEvent& event) {
  std::uint32_t device = 0;
  switch (block_.kind) {
    case BlockKind::scene: {
      std::string error;
      if (!unpackSceneEvent(block_.content, event.emplace<SceneEvent>(), error)) fail(error);
      return true;
    }
    case BlockKind::publish:
      takeWhole<PublishEvent>(event);
      device = std::get<PublishEvent>(event).device;
      break;
    case BlockKind::ticks: {
      Unpacker in(block_.content);
      device = ticksOf_ = in.next<std::uint32_t>();
      ticks_.emplace(in.rest());
      break;
    }
    case BlockKind::stream: {
      Unpacker in(block_.content);
      StreamEvent& stream = event.emplace<StreamEvent>();
      device = stream.device = in.next<std::uint32_t>();
      if (!unpackStream(in, stream.stream) || !in.rest().empty()) fail("a damaged streamed value");
      break;
    }
    case BlockKind::memory:
      readMemory(event.emplace<MemoryEvent>());
      device = std::get<MemoryEvent>(event).device;
      break;
    case BlockKind::remoteMemory:
      readRemoteMemory();
      return false;
    case BlockKind::left:
      takeWhole<LeftEvent>(event);
      if (std::get<LeftEvent>(event).time < 0 || std::get<LeftEvent>(event).time > kLatest)
        fail("a client left at an impossible time");
      return true;
    case BlockKind::lost: {
      takeWhole<LostEvent>(event);
      const LostEvent& lost = std::get<LostEvent>(event);
      device = lost.device;
      if (const auto kind = static_cast<std::size_t>(lost.what); kind < lost_.size())
        lost_[kind] += lost.count;
      break;
    }
    case BlockKind::wallOffset:
      readWallOffset();
      return false;
    case BlockKind::marker:
      takeWhole<MarkerEvent>(event);
      std::get<MarkerEvent>(event).text = base::utf8(std::get<MarkerEvent>(event).text);
      return true;
    case BlockKind::end:
      takeWhole<EndEvent>(event);
      ended_ = true;
      return true;
    default:  // of a newer version that added something
      return false;
  }
  if (device >= header_.devices.size()) fail("there is no device " + std::to_string(device));
  return !ticks_;
}

std::string RecordingReader::ending() const {
  if (!blocks_.damage().empty()) return blocks_.damage() + "; everything before it was read";
  if (!ended_) return "the recording has no end: the server was killed or is still recording";
  return {};
}

std::string RecordingReader::remark() const {
  constexpr std::array<const char*, 3> kKinds = {" ticks", " scene events", " streamed values"};
  std::string lost;
  for (std::size_t kind = 0; kind < kKinds.size(); ++kind) {
    if (lost_[kind] > 0) lost += (lost.empty() ? "" : ", ") + std::to_string(lost_[kind]) + kKinds[kind];
  }
  if (lost.empty()) return ending();
  lost = "the recorder lost " + lost + ": what follows them may differ";
  return ending().empty() ? lost : lost + "; " + ending();
}

}  // namespace hapticd::record
