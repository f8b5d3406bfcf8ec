// Replays a recording: the ticks of its devices and the commands of its clients, at the recorded times,
// faster or slower, from any moment on.
#pragma once

#include <atomic>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <utility>

#include "base/thread.h"
#include "record/recording_reader.h"
#include "server/config/config.h"
#include "server/web/replay_status.h"

namespace hapticd::server {

struct ReplayOptions {
  std::filesystem::path file;
  double speed = 1;
  bool loop = false;  ///< start again at the end instead of keeping the last state
};

/// What a person changes while a recording is replayed.
struct ReplayOrder {
  bool paused = false;
  double speed = 0;                  ///< 0: as before
  std::optional<double> position_s;  ///< since the first event
};

/// The configuration of the server that wrote the recording `file`. Throws std::runtime_error when it has
/// other devices.
ServerConfig recordedConfig(const record::RecordingHeader& header, const std::string& file);

/// Runs in its own thread between start() and stop(). Reads 0.2 s ahead and sorts by time, because a
/// recording stores the ticks in blocks of one device each.
class Player {
 public:
  /// Called in the player's thread; the times in the reports are converted to the present.
  struct Callbacks {
    std::function<void(std::uint32_t device, const realtime::TickReport&)> tick;
    /// Null: the client disconnected.
    std::function<void(std::uint32_t scene, scene::ClientId, const scene::SceneCommand*)> command;
    /// The scene is behind: further commands wait. May be empty.
    std::function<bool(std::uint32_t scene)> behind{};
    std::function<void(base::Nanos time, const std::string& text)> marker;
    /// Called before the recording starts again, also to seek backwards.
    std::function<void()> restart;
    /// Called at the end, with the reason if the file could not be read to its end, else empty.
    std::function<void(const std::string&)> ended;
  };

  /// Slowest and fastest.
  static constexpr double kSlowest = 0.001;
  static constexpr double kFastest = 1000;

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

  /// From any thread, between start() and stop(). A seek applies the scene's commands up to the moment
  /// without waiting; a paused replay shows the ticks there and stays paused.
  void order(const ReplayOrder& order);
  /// From any thread.
  ReplayStatus status() const;
  /// What is missing of the recording, as far as passes have ended; empty: nothing. From any thread.
  std::string remark() const;

 private:
  std::optional<base::Nanos> step();
  void takeOrder();
  void readAhead();
  bool isAhead() const;
  void rewind();
  void endPass(const std::string& reason, const std::string& remark);
  void setPresent(base::Nanos recorded);
  base::Nanos liveTime(base::Nanos recorded) const;
  base::Nanos recordedTime(base::Nanos live) const;
  void play(record::RecordingEvent& event);

  const ReplayOptions options_;
  record::RecordingHeader header_;
  Callbacks callbacks_;

  // Used by the thread only.
  std::unique_ptr<record::RecordingReader> reader_;  // null between passes through the file
  std::multimap<base::Nanos, record::RecordingEvent> buffer_;
  std::set<std::pair<std::uint32_t, scene::ClientId>> clients_;  // recorded ones that are present, by scene
  std::vector<base::Nanos> newestRead_;                          // tick of each device, recorded time
  bool atEnd_ = false;                                           // the reader reached the end of the file
  bool started_ = false;                                         // an event of this pass was played
  bool ended_ = false;
  bool paused_ = false;
  double speed_ = 1;
  std::optional<double> seek_s_;       // not yet begun
  std::optional<base::Nanos> skipTo_;  // recorded time; ticks before it are not shown
  std::vector<char> toShow_;           // devices that show a tick although the replay is paused
  base::Nanos begin_ = 0;              // recorded time of the first event
  base::Nanos firstRecorded_ = 0;      // was, or is, due at
  base::Nanos firstLive_ = 0;
  base::Nanos position_ = 0;  // recorded time of the last event

  mutable std::mutex mutex_;
  std::optional<ReplayOrder> order_;
  ReplayStatus status_;
  std::string remark_;

  std::atomic<bool> stopping_{false};
  base::Thread scan_;
  base::Thread thread_;
};

}  // namespace hapticd::server
