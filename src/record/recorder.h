// Writes a recording while the server runs, in a thread "recorder". No other thread waits for it: the servo
// pushes into a ring, the scene thread appends to a buffer, and what does not fit is counted, reported and
// marked in the file.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "base/files.h"
#include "base/thread.h"
#include "record/archive.h"
#include "record/block_file.h"
#include "record/recording.h"
#include "record/tick_codec.h"

namespace hapticd::record {

struct RecorderOptions {
  std::size_t ticks = 4096;              ///< of one device that may wait to be written
  std::size_t streamed = 512;            ///< values that clients stream to one device, the same
  std::size_t sceneBytes = 256U << 20U;  ///< of scene events that may wait to be written
  std::uint64_t fileBytes = UINT64_MAX;  ///< of the file; the recording ends before it would exceed them
};

/// What was written and what was lost so far.
struct RecorderCounts {
  std::uint64_t bytes = 0;  ///< of what was written without an error
  std::uint64_t ticks = 0;  ///< the same
  std::uint64_t lostTicks = 0;
  std::uint64_t lostSceneEvents = 0;
  std::uint64_t lostStreamed = 0;
};

/// The file of a new recording exists.
class RecordingExists : public RecordingError {
 public:
  using RecordingError::RecordingError;
};

enum class RecorderProblem {
  losses,   ///< something was lost, and the recording goes on; at most once a second
  stopped,  ///< the file cannot be written further
};

class Recorder {
 public:
  /// Called in the recorder's thread with a text for the log.
  using OnProblem = std::function<void(RecorderProblem, const std::string&)>;

  /// Creates the file. Throws RecordingExists when it or a directory exists, and RecordingError when it
  /// cannot be created.
  Recorder(std::filesystem::path file, OnProblem onProblem, const RecorderOptions& options = {});
  ~Recorder() { finish(); }
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  const std::filesystem::path& path() const noexcept { return path_; }

  // Before start():

  /// Adds a device and returns its number, from 0.
  std::uint32_t addDevice(RecordedDevice device);
  /// For Tick::recordTo(); lives as long as the recorder.
  realtime::RecordRing& ring(std::uint32_t device) { return devices_[device]->ring; }
  /// The same for what clients stream.
  realtime::StreamRing& streamRing(std::uint32_t device) { return devices_[device]->streams; }
  /// The same for what a servo knows, of a recording that begins while it runs.
  realtime::MemoryRing& memoryRing(std::uint32_t device) { return devices_[device]->memories; }
  /// Writes the header and starts the thread. Throws RecordingError, with the remedy, when the file does not
  /// take the header; it is removed then.
  void start(Nanos wallOffset, std::string config);

  // From start() on, in the scene thread:

  /// Before the builders apply the command. Null: the client left.
  void recordCommand(std::uint32_t scene, scene::ClientId client, Nanos time,
                     const scene::SceneCommand* command);
  /// After publish() of the device's builder, before its servo can see the snapshot. Revision 0: nothing had
  /// changed.
  void recordPublish(std::uint32_t device, Nanos time, std::uint64_t revision,
                     const std::vector<Nanos>& readings = {});

  /// From any thread, before a servo can see it: the forces of a client must end from this time on; 0: what
  /// it commands from here on is felt again.
  void recordLeft(std::uint32_t scene, scene::ClientId client, Nanos time);
  /// From any thread: a client marked a moment.
  void recordMarker(Nanos time, const std::string& text);

  /// While the server runs, after nothing records any more: the thread writes what is left and closes the
  /// file. Any thread.
  void end();
  /// After end(): the file is complete. Any thread.
  bool ended() const noexcept { return ended_.load(std::memory_order_acquire); }
  /// After servos and scenes have ended: writes what is left and closes the file. Idempotent.
  void finish();
  /// Whether the file is still written. Any thread.
  bool writes() const noexcept { return writes_.load(std::memory_order_acquire); }
  /// After finish(), or when ended(): something could not be written.
  bool failed() const noexcept { return !writes(); }
  /// The same.
  const RecorderCounts& counts() const noexcept { return counts_; }

 private:
  struct Device {
    Device(std::size_t ticks, std::size_t streamed) : ring(ticks), streams(streamed) {}
    realtime::RecordRing ring;
    realtime::StreamRing streams;
    realtime::MemoryRing memories{2};
    TickPacker packer;  // from here on: recorder thread
    Bytes run;
    std::uint64_t lost = 0;
    std::uint64_t lostStreamed = 0;
    Nanos newest = 0;
  };

  std::optional<Nanos> step();
  void drain();
  void followWallClock();
  void close();
  void appendEvent(BlockKind kind, Bytes&& content);
  void appendTicks(std::uint32_t number, Device& device);
  void appendMemories(std::uint32_t number, Device& device);
  void appendStreamed(std::uint32_t number, Device& device);
  void appendLost(LostEvent::What what, std::uint32_t device, std::uint64_t total, std::uint64_t& known);
  std::error_code tryWrite();
  void write();
  void lookForFile();
  void fail(const std::error_code& error);
  void endFile();
  void closeFile() noexcept;
  void reportLosses();

  const std::filesystem::path path_;
  const OnProblem onProblem_;
  const RecorderOptions options_;
  std::unique_ptr<base::OutputFile> file_;  // null once it cannot be written further
  std::vector<RecordedDevice> header_;
  std::vector<std::unique_ptr<Device>> devices_;
  RecorderCounts counts_;
  Bytes out_;                         // whole blocks on their way to the file
  std::uint64_t unwrittenTicks_ = 0;  // in them
  std::uint64_t reportedLosses_ = 0;
  Nanos nextLossReport_ = 0;
  Nanos nextLook_ = 0;
  Nanos wallOffset_ = 0;    // in the file
  Nanos measuredWall_ = 0;  // of the machine when that was written
  std::atomic<bool> writes_{true};
  std::atomic<bool> ending_{false};
  std::atomic<bool> ended_{false};

  std::mutex mutex_;
  Bytes events_;                  // whole blocks of scene events
  std::uint64_t lostEvents_ = 0;  // that found no room
  bool failed_ = false;
  base::Thread thread_;  // last: it uses the others
};

}  // namespace hapticd::record
