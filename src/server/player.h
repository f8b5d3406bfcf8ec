// Plays a recorded session: what its servos reported and what its clients told the scene, at the times at
// which it was, or faster or slower.
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
  bool loop = false;  ///< from the beginning again, instead of resting at the end
};

/// A thread of its own, between start() and stop(). Reads ahead a little, because a file holds the ticks of
/// one moment device by device.
class Player {
 public:
  /// Called from the player's thread, times being those of now.
  struct Callbacks {
    std::function<void(std::uint32_t device, const realtime::TickReport&)> tick;
    /// Null: the client was gone.
    std::function<void(std::uint32_t scene, scene::ClientId, const scene::SceneCommand*)> told;
    /// Before the session begins again.
    std::function<void()> restart;
    /// Once, at the end, or where the file could not be read further: why.
    std::function<void(const std::string&)> over;
  };

  /// Reads the header. Throws record::RecordingError.
  explicit Player(ReplayOptions options);
  ~Player() { stop(); }
  Player(const Player&) = delete;
  Player& operator=(const Player&) = delete;

  const record::RecordingHeader& header() const noexcept { return header_; }
  /// The configuration that was recorded, for a server that replays it. Throws ConfigError when this version
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
  base::Nanos live(base::Nanos recorded) const;
  void play(record::RecordingEvent& event);

  const ReplayOptions options_;
  record::RecordingHeader header_;
  Callbacks callbacks_;

  // The thread's.
  std::unique_ptr<record::RecordingReader> reader_;  // of this pass through the file
  std::multimap<base::Nanos, record::RecordingEvent> ahead_;
  bool atEnd_ = false;  // of the file
  bool began_ = false;  // an event of this pass was played
  bool over_ = false;
  base::Nanos firstRecorded_ = 0;
  base::Nanos firstLive_ = 0;

  std::atomic<bool> stopping_{false};
  base::Thread thread_;
};

}  // namespace hapticd::server
