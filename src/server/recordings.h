// The recordings of a server: one at a time, from the start of the server or begun and ended at any time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/thread.h"
#include "record/recorder.h"
#include "server/scene/scene_host.h"
#include "server/station/station.h"

namespace hapticd::server {

/// Net thread, except command().
class Recordings {
 public:
  using Scenes = std::vector<std::unique_ptr<SceneHost>>;
  using Stations = std::vector<std::unique_ptr<Station>>;
  using Post = std::function<void(std::function<void()>)>;

  struct Options {
    std::filesystem::path folder;           ///< takes recordings that clients begin
    std::uint64_t mostBytes = UINT64_MAX;   ///< of one file
    record::Recorder::OnProblem onProblem;  ///< net thread
  };

  /// Both must outlive this object; `post` calls in the net thread.
  Recordings(const Scenes& scenes, const Stations& stations, Post post, Options options);

  /// Creates the file; strftime conversions in `name` get the local time. For a recording from the first tick
  /// on: call begin() before the scenes start. Throws record::RecordingError.
  void create(const std::string& name);
  /// Before the scenes start. Records to the file that was created, if there is one. The recording of a scene
  /// that runs begins with the commands that make it, and its ticks follow.
  void begin(base::Nanos wallOffset, std::string config);
  /// Gets a text for the client: why the recording was refused, or nothing, and the file to which it records.
  /// What goes wrong with it is told later, also when it happened sooner.
  using Begun = std::function<void(const std::string& refusal, const std::string& file)>;
  /// The client that gets a text once the file is complete.
  struct Listener {
    scene::ClientId client = 0;
    std::function<void(const std::string&)> tell;
  };
  /// The same for a client, which may name a file in the folder; empty: named by the time. A thread of its
  /// own creates the file, because a disk may hang; `begun` is called later, and the client is told of the
  /// end, whoever ends it. Throws record::RecordingError with a text for the client.
  void start(const std::string& name, base::Nanos wallOffset, std::string config, Begun begun,
             Listener listener);
  /// Call once after begin(), when the scenes have started.
  void scenesStarted();
  /// Ends the recording at hand, or the one that begins, if its file has this name; empty: whatever its name.
  /// Throws record::RecordingError with a text for the client when there is none, or another one.
  void end(const std::string& name, Listener listener);

  /// The file of the recording at hand; empty when there is none, or it cannot be written further.
  std::string file() const;
  void marker(base::Nanos time, const std::string& text);
  /// Scene threads: a command of this scene.
  void command(std::uint32_t scene, scene::ClientId client, base::Nanos now, const scene::SceneCommand* c);

  /// Frees what ended. Call a few times per second.
  void poll();
  /// After the servos and scenes have ended: completes all files.
  void finish();

 private:
  struct Ended {
    std::unique_ptr<record::Recorder> recorder;
    std::size_t scenes = 0;  // that still write to it
    base::Nanos at = 0;      // when none did any more
    std::vector<Listener> listeners;
    bool told = false;
  };

  // A recording that a client asked for, until its file is there. The thread writes the last two.
  struct Beginning {
    std::filesystem::path path;
    bool numbered = false;  // a number may follow where the name exists
    std::vector<record::RecordedDevice> devices;
    base::Nanos wallOffset = 0;
    std::string config;
    Begun begun;
    Listener listener;
    std::optional<Listener> ended;  // a client that asked meanwhile that it ends
    std::vector<std::pair<record::RecorderProblem, std::string>> problems;  // meanwhile
    std::unique_ptr<record::Recorder> recorder;
    std::string refusal;
  };

  std::unique_ptr<record::Recorder> createFile(const std::filesystem::path& path) const;
  std::unique_ptr<record::Recorder> createNumberedFile(const std::filesystem::path& path) const;
  std::vector<record::RecordedDevice> devices() const;
  void onProblem(record::RecorderProblem problem, const std::string& text) const;
  void beginIn(Beginning& beginning) const noexcept;
  void begun();
  void endPresent(std::optional<Listener> listener);
  void attach();
  bool beginScene(SceneHost& scene);
  void watch(std::uint32_t scene, const scene::SceneBuilder& builder, record::Recorder* recorder);
  void sceneEnded(const record::Recorder* recorder);

  const Scenes& scenes_;
  const Stations& stations_;
  const Post post_;
  const Options options_;
  std::unique_ptr<record::Recorder> recorder_;
  std::optional<Listener> beganBy_;  // the client that began it
  std::shared_ptr<Beginning> beginning_;
  base::Thread beginner_;
  std::vector<std::unique_ptr<Ended>> ended_;
  // Of each scene; touched by its thread once that runs.
  std::vector<record::Recorder*> recorderOf_;
  std::vector<std::shared_ptr<scene::ForceOwners>> owners_;
};

}  // namespace hapticd::server
