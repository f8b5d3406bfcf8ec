// The content of a recording as values. docs/recording-format.md describes the bytes.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "base/time.h"
#include "realtime/servo/tick.h"
#include "realtime/servo/tick_record.h"
#include "scene/commands.h"
#include "scene/config.h"
#include "scene/notice.h"

namespace hapticd::record {

using base::Nanos;

/// Changes when old readers would misread a file; new kinds of blocks alone do not change it.
inline constexpr std::uint32_t kFormatVersion = 2;  // 1 had no grippers

/// Why a file cannot be read or written; the text names it and the remedy.
class RecordingError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// One haptic device, with all options of its servo and its scene.
struct RecordedDevice {
  std::vector<std::string> names;
  std::string driver;
  std::string model;
  std::int32_t buttons = 0;
  std::uint32_t scene = 0;  ///< number of its scene
  scene::SceneConfig sceneConfig;
  realtime::TickOptions tick;
};

/// Options of a device's renderer that came with law 2.
struct LawOptions {
  double stribeckSpeed_m_per_s = 0;
  bool contactVibrationPulls = false;
};

/// By which laws the forces were made.
struct LawRecord {
  std::uint32_t number = 1;         ///< realtime::kForceLaw of the program that recorded
  std::vector<LawOptions> devices;  ///< in the order of the header
};

/// The credit of each device's passivity controller, in the order of the header. Recordings without one had
/// none.
struct PassivityRecord {
  std::vector<double> bareDamping_Ns_per_m;
};

/// The first block, and what belongs to it.
struct RecordingHeader {
  std::string program;
  Nanos wallOffset = 0;  ///< wall time minus servo time at the start
  std::string config;    ///< of the server, as TOML
  std::vector<RecordedDevice> devices;
  LawRecord law;  ///< the second block; files without one have law 1
};

/// A command as the scene applied it; without one, the client left.
struct SceneEvent {
  std::uint32_t scene = 0;
  scene::ClientId client = 0;
  Nanos time = 0;
  std::optional<scene::SceneCommand> command;
};

/// The forces of a client must end: it left, or they were stopped. The servos ramp them out from then on when
/// the scene is too busy to do it; the event of the scene follows when it has.
struct LeftEvent {
  std::uint32_t scene = 0;
  scene::ClientId client = 0;
  Nanos time = 0;  ///< 0: what the client commands from here on is felt again
};

/// The builder of a device was asked for a snapshot.
struct PublishEvent {
  std::uint32_t device = 0;
  Nanos time = 0;
  std::uint64_t revision = 0;    ///< 0: nothing had changed
  std::vector<Nanos> stopwatch;  ///< its readings since the previous event
};

/// What clients streamed, in the first tick that knew it; precedes that tick.
struct StreamEvent {
  std::uint32_t device = 0;
  realtime::StreamRecord stream;
};

/// What a servo knew of the ticks before the recording; precedes the tick after which it knew it.
struct MemoryEvent {
  std::uint32_t device = 0;
  realtime::ServoMemory memory;
};

/// One tick of a device.
struct TickEvent {
  std::uint32_t device = 0;
  realtime::TickRecord tick;
};

/// A client marked a moment.
struct MarkerEvent {
  Nanos time = 0;
  std::string text;  ///< as the client sent it; from a reader, UTF-8
};

/// Data is missing here because the disk was too slow.
struct LostEvent {
  enum class What : std::int32_t { ticks, sceneEvents, streamed };
  What what = What::ticks;
  std::uint32_t device = 0;  ///< for ticks and streamed values
  std::uint64_t count = 0;   ///< since the previous such event
};

/// The wall clock was set.
struct WallOffsetRecord {
  Nanos time = 0;    ///< from here on
  Nanos offset = 0;  ///< wall time minus servo time
};

/// The recording is complete.
struct EndEvent {
  Nanos time = 0;
};

using RecordingEvent = std::variant<SceneEvent, PublishEvent, StreamEvent, TickEvent, LostEvent, EndEvent,
                                    MarkerEvent, MemoryEvent, LeftEvent>;

}  // namespace hapticd::record
