// Replays a recording: the ticks of its devices and the commands of its clients, at the recorded times,
// faster or slower.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>

#include "base/thread.h"
#include "record/recording_reader.h"
#include "server/config/config.h"

namespace hapticd::server {

struct ReplayOptions {
  std::filesystem::path file;
  double speed = 1;
  bool loop = false;  ///< start again at the end instead of keeping the last state
};

/// Runs in its own thread between start() and stop(). Reads 0.2 s ahead and sorts by time, because a
/// recording stores the ticks in blocks of one device each.
class Player {
 public:
  /// Called in the player's thread; the times in the reports are converted to the present.
  struct Callbacks {
    std::function<void(std::uint32_t device, const realtime::TickReport&)> tick;
    /// Null: the client disconnected.
    std::function<void(std::uint32_t scene, scene::ClientId, const scene::SceneCommand*)> command;
    /// Called before the recording starts again.
    std::function<void()> restart;
    /// Called once at the end, with the reason if the file could not be read to its end, else empty.
    std::function<void(const std::string&)> ended;
  };

  /// Reads the header. Throws record::RecordingError.
  explicit Player(ReplayOptions options);
  ~Player() { stop(); }
  Player(const Player&) = delete;
  Player& operator=(const Player&) = delete;

  const record::RecordingHeader& header() const noexcept { return header_; }
  /// The recorded configuration, adapted for a server that replays it. Throws ConfigError when this version
  /// cannot read it.
  ServerConfig config() const;

  void start(Callbacks callbacks);
  /// Idempotent.
  void stop();

 private:
  std::optional<base::Nanos> step();
  void readAhead();
  void endPass(const std::string& remark);
  base::Nanos dueAt(base::Nanos recorded);
  base::Nanos liveTime(base::Nanos recorded) const;
  void play(record::RecordingEvent& event);

  const ReplayOptions options_;
  record::RecordingHeader header_;
  Callbacks callbacks_;

  // Used by the thread only.
  std::unique_ptr<record::RecordingReader> reader_;  // null between passes through the file
  std::multimap<base::Nanos, record::RecordingEvent> buffer_;
  bool atEnd_ = false;    // the reader reached the end of the file
  bool started_ = false;  // an event of this pass was played
  bool ended_ = false;
  base::Nanos firstRecorded_ = 0;
  base::Nanos firstLive_ = 0;

  std::atomic<bool> stopping_{false};
  base::Thread thread_;
};

}  // namespace hapticd::server
