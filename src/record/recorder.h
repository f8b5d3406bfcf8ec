// Writes a session while it happens, in a thread of its own. Nobody ever waits for it: the servo pushes into
// a ring, the scene thread appends to a buffer, and what does not fit is counted, in the log and in the file.
#pragma once

#include <condition_variable>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "record/archive.h"
#include "record/block_file.h"
#include "record/recording.h"
#include "record/tick_codec.h"

namespace hapticd::record {

struct RecorderOptions {
  std::size_t ticks = 4096;              ///< of one device that may wait to be written
  std::size_t sceneBytes = 256U << 20U;  ///< of scene events that may wait
};

/// What was written so far, and what was not.
struct RecorderCounts {
  std::uint64_t bytes = 0;
  std::uint64_t ticks = 0;
  std::uint64_t lostTicks = 0;
  std::uint64_t lostSceneEvents = 0;
};

class Recorder {
 public:
  /// Told from the recorder's thread, when the file cannot be written further, and once in a second when
  /// something was lost: what, why, and what helps.
  using OnTrouble = std::function<void(const std::string&)>;

  /// Creates the file. Throws RecordingError when it cannot, and when there is one already.
  Recorder(std::filesystem::path file, OnTrouble onTrouble, const RecorderOptions& options = {});
  ~Recorder() { finish(); }
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  const std::filesystem::path& path() const noexcept { return path_; }

  // Before start():

  /// Adds a device; its number counts from 0.
  std::uint32_t addDevice(RecordedDevice device);
  /// For Tick::recordTo(); lives as long as the recorder.
  realtime::RecordRing& ring(std::uint32_t device) { return devices_[device]->ring; }
  /// For SceneConfig::stopwatch of a device: remembers what it said for the next published() of it. Its scene
  /// thread calls it.
  std::function<Nanos()> stopwatch(std::uint32_t device);
  /// Writes the header and starts the thread.
  void start(Nanos wallOffset, std::string config);

  // From start() on, in the scene's thread:

  /// Before the builders are told. Null: the client is gone.
  void told(std::uint32_t scene, scene::ClientId client, Nanos time, const scene::SceneCommand* command);
  /// After publish() of the device's builder, before its servo can see the snapshot. Revision 0: there was
  /// none.
  void published(std::uint32_t device, Nanos time, std::uint64_t revision);

  /// When servos and scenes have ended: writes what is left and closes the file. Idempotent.
  void finish();
  /// After finish().
  const RecorderCounts& counts() const noexcept { return counts_; }

 private:
  struct Device {
    explicit Device(std::size_t ticks) : ring(ticks) {}
    realtime::RecordRing ring;
    std::vector<Nanos> readings;  // the scene thread's
    TickPacker packer;            // the recorder thread's, as the rest
    Bytes run;
    std::uint64_t lost = 0;
    Nanos newest = 0;
  };

  void run();
  void drain();
  void appendEvent(BlockKind kind, Bytes&& content);
  void appendTicks(std::uint32_t number, Device& device);
  void appendLost(LostEvent::What what, std::uint32_t device, std::uint64_t total, std::uint64_t& known);
  void write();
  void fail(int error);
  void tellLosses();

  const std::filesystem::path path_;
  const OnTrouble onTrouble_;
  const RecorderOptions options_;
  int file_ = -1;
  std::vector<RecordedDevice> header_;
  std::vector<std::unique_ptr<Device>> devices_;
  RecorderCounts counts_;
  Bytes out_;  // whole blocks on their way to the file
  std::uint64_t toldLosses_ = 0;
  Nanos tellAfter_ = 0;

  std::mutex mutex_;
  std::condition_variable wake_;
  Bytes events_;                  // whole blocks of the scene's events
  std::uint64_t lostEvents_ = 0;  // that found no room
  bool failed_ = false;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace hapticd::record
