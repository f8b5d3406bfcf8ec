#include "server/recordings.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <ctime>
#include <optional>
#include <system_error>
#include <utility>

#include "base/world.h"

namespace hapticd::server {
namespace {

using base::Nanos;
using record::RecordingError;

// Before the begin of a recording, the publication of the commands that make its scene.
constexpr Nanos kPublished = 200'000'000;
// Of recordings whose memory, 8 MB for each device, a tick may still use.
constexpr std::size_t kMostEnded = 4;

constexpr int kMostOfASecond = 1000;

std::string withTime(const std::string& name) {
  const auto now = static_cast<std::time_t>(base::wallNow() / 1'000'000'000);
  std::tm local{};
  localtime_r(&now, &local);
  char path[4096] = {};
  if (std::strftime(path, sizeof path, name.c_str(), &local) == 0)
    throw RecordingError("record: '" + name + "' is too long for a file name");
  return path;
}

// A client names a file, never a folder.
void checkName(const std::string& name) {
  const auto allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
           c == '_' || c == '.';
  };
  const bool plain = std::all_of(name.begin(), name.end(), allowed) && name.front() != '.';
  if (!plain || name.size() > 100 || std::filesystem::path(name).extension() != ".haptics") {
    throw RecordingError(
        "refused: the name of a recording has letters, digits, '-', '_' and '.', at most 100, and ends with "
        ".haptics");
  }
}

std::string summary(const record::Recorder& recorder) {
  const record::RecorderCounts& counts = recorder.counts();
  return fmt::format("recorded {} ticks, {:.1f} MB, in {}{}", counts.ticks,
                     static_cast<double>(counts.bytes) * 1e-6, recorder.path().string(),
                     recorder.failed() ? ", which is incomplete" : "");
}

// Each client once.
void addTo(std::vector<Recordings::Listener>& listeners, Recordings::Listener listener) {
  const auto isThere = [&](const auto& other) { return other.client == listener.client; };
  if (std::none_of(listeners.begin(), listeners.end(), isThere)) listeners.push_back(std::move(listener));
}

}  // namespace

Recordings::Recordings(const Scenes& scenes, const Stations& stations, Post post, Options options)
    : scenes_(scenes), stations_(stations), post_(std::move(post)), options_(std::move(options)) {}

void Recordings::create(const std::string& name) {
  try {
    recorder_ = createFile(withTime(name));
  } catch (const record::RecordingExists& error) {
    throw RecordingError(std::string(error.what()) +
                         ", or put the time into the name: session-%Y%m%d-%H%M%S.haptics");
  }
}

std::unique_ptr<record::Recorder> Recordings::createFile(const std::filesystem::path& path) const {
  record::RecorderOptions options;
  options.fileBytes = options_.mostBytes;
  return std::make_unique<record::Recorder>(
      path,
      [this](record::RecorderProblem problem, const std::string& text) {
        spdlog::log(problem == record::RecorderProblem::losses ? spdlog::level::warn : spdlog::level::err,
                    "{}", text);
        post_([this, problem, text] { onProblem(problem, text); });
      },
      options);
}

// A disk that fails as soon as a file has begun may be heard of before its beginning.
void Recordings::onProblem(record::RecorderProblem problem, const std::string& text) const {
  if (beginning_) {
    beginning_->problems.emplace_back(problem, text);
  } else {
    options_.onProblem(problem, text);
  }
}

// Several may begin in one second.
std::unique_ptr<record::Recorder> Recordings::createNumberedFile(const std::filesystem::path& path) const {
  for (int number = 1;; ++number) {
    std::filesystem::path numbered = path;
    if (number > 1) numbered.replace_filename(fmt::format("{}-{}.haptics", path.stem().string(), number));
    try {
      return createFile(numbered);
    } catch (const record::RecordingExists&) {
      if (number == kMostOfASecond) throw;
    }
  }
}

std::vector<record::RecordedDevice> Recordings::devices() const {
  std::vector<record::RecordedDevice> devices;
  for (const auto& station : stations_) devices.push_back(station->recorded());
  return devices;
}

void Recordings::begin(Nanos wallOffset, std::string config) {
  recorderOf_.resize(scenes_.size(), nullptr);  // now: later the threads of the scenes read it
  owners_.resize(scenes_.size());
  if (!recorder_) return;
  for (record::RecordedDevice& device : devices()) recorder_->addDevice(std::move(device));
  try {
    recorder_->start(wallOffset, std::move(config));
  } catch (const RecordingError& error) {
    spdlog::error("{}; this server records nothing", error.what());
    recorder_.reset();
    return;
  }
  attach();
}

void Recordings::attach() {
  for (const auto& scene : scenes_) {
    if (beginScene(*scene)) continue;
    recorderOf_[scene->number()] = recorder_.get();
    for (std::uint32_t i = 0; i < stations_.size(); ++i) {
      if (&stations_[i]->scene() == scene.get()) stations_[i]->recordTo(recorder_.get(), i);
    }
  }
  spdlog::info("recording to {}", recorder_->path().string());
}

// In the scene's thread. The forces of a client that leaves end at that time, however busy this thread is.
void Recordings::watch(std::uint32_t scene, const scene::SceneBuilder& builder, record::Recorder* recorder) {
  owners_[scene] = builder.owners();
  if (!owners_[scene]) return;
  owners_[scene]->watch([scene, recorder](scene::ClientId client, std::optional<Nanos> left) {
    recorder->recordLeft(scene, client, left.value_or(0));
  });
}

void Recordings::scenesStarted() {
  if (!recorder_) return;
  for (const auto& scene : scenes_) {
    scene->inspect([this, number = scene->number(), recorder = recorder_.get()](const auto& builders) {
      watch(number, *builders.front(), recorder);
    });
  }
}

// In the scene's thread, so that no command and no publication comes between what is described and what is
// recorded. False: the scene has not started, so there is nothing to describe.
bool Recordings::beginScene(SceneHost& scene) {
  return scene.inspect([this, &scene, recorder = recorder_.get()](const auto& builders) {
    const Nanos now = base::now();
    watch(scene.number(), *builders.front(), recorder);
    for (const scene::ClientCommand& c : builders.front()->commands(now))
      recorder->recordCommand(scene.number(), c.client, c.at, &c.command);
    recorderOf_[scene.number()] = recorder;
    std::vector<std::uint32_t> seats;
    for (std::uint32_t i = 0; i < stations_.size(); ++i) {
      if (&stations_[i]->scene() == &scene) seats.push_back(i);
    }
    for (std::size_t k = 0; k < seats.size(); ++k)
      recorder->recordPublish(seats[k], now - kPublished, builders[k]->revision());
    for (const scene::ClientCommand& c : builders.front()->editsUnderWay(now))
      recorder->recordCommand(scene.number(), c.client, c.at, &c.command);
    for (std::size_t k = 0; k < seats.size(); ++k)
      stations_[seats[k]]->recordTo(recorder, seats[k], builders[k]);
  });
}

void Recordings::start(const std::string& name, Nanos wallOffset, std::string config, Begun begun,
                       Listener listener) {
  if (beginning_) throw RecordingError("refused: another recording begins");
  if (!file().empty())
    throw RecordingError("refused: this server records to " + file() +
                         " already; end that recording first ('hapticd record NAME@HOST --server --end')");
  if (!name.empty()) checkName(name);
  endPresent({});  // one that could not be written further
  if (ended_.size() >= kMostEnded)
    throw RecordingError(
        "refused: the last " + std::to_string(kMostEnded) +
        " recordings have not ended yet; try again in a second, or when the devices are back");
  beginning_ = std::make_shared<Beginning>();
  beginning_->numbered = name.empty();
  beginning_->path =
      withTime((options_.folder / (name.empty() ? "session-%Y%m%d-%H%M%S.haptics" : name)).string());
  beginning_->devices = devices();
  beginning_->wallOffset = wallOffset;
  beginning_->config = std::move(config);
  beginning_->begun = std::move(begun);
  beginning_->listener = std::move(listener);
  const auto step = [this, beginning = beginning_]() -> std::optional<Nanos> {
    if (beginning->recorder || !beginning->refusal.empty()) return std::nullopt;  // woken by its end
    beginIn(*beginning);
    post_([this] { this->begun(); });
    return std::nullopt;
  };
  try {
    beginner_ = base::Thread({.name = "recording"}, step);
  } catch (const std::system_error& error) {
    beginning_.reset();
    throw RecordingError(std::string("refused: the recording cannot begin: ") + error.what());
  }
}

// In a thread of its own.
void Recordings::beginIn(Beginning& beginning) const noexcept {
  try {
    auto recorder = beginning.numbered ? createNumberedFile(beginning.path) : createFile(beginning.path);
    for (record::RecordedDevice& device : beginning.devices) recorder->addDevice(std::move(device));
    recorder->start(beginning.wallOffset, std::move(beginning.config));
    beginning.recorder = std::move(recorder);
  } catch (const RecordingError& error) {
    beginning.refusal = error.what();
  } catch (const std::exception& error) {
    beginning.refusal = std::string("refused: the recording cannot begin: ") + error.what();
  }
}

void Recordings::begun() {
  beginner_.stop();
  const std::shared_ptr<Beginning> beginning = std::exchange(beginning_, nullptr);
  if (beginning->recorder) {
    recorder_ = std::move(beginning->recorder);
    beganBy_ = std::move(beginning->listener);
    attach();
  }
  beginning->begun(beginning->refusal, recorder_ ? recorder_->path().string() : "");
  for (const auto& [problem, text] : beginning->problems) options_.onProblem(problem, text);
  if (!beginning->ended) return;
  if (!recorder_) return beginning->ended->tell("nothing is recorded");
  endPresent(std::move(beginning->ended));
}

void Recordings::end(const std::string& name, Listener listener) {
  std::filesystem::path present;
  if (beginning_ && !beginning_->ended) present = beginning_->path;
  if (recorder_) present = recorder_->path();
  if (present.empty() || (!name.empty() && present.filename() != name)) {
    for (const auto& entry : ended_) {  // another client was a little faster
      if (!entry->told && entry->recorder->path().filename() == name)
        return addTo(entry->listeners, std::move(listener));
    }
    throw RecordingError(present.empty() ? "refused: nothing is recorded"
                                         : "refused: this server records to " + present.string() +
                                               ", which has another name");
  }
  if (beginning_) {
    beginning_->ended = std::move(listener);
  } else {
    endPresent(std::move(listener));
  }
}

void Recordings::endPresent(std::optional<Listener> listener) {
  if (!recorder_) return;
  record::Recorder* recorder = recorder_.get();
  auto entry = std::make_unique<Ended>();
  entry->recorder = std::move(recorder_);
  entry->scenes = scenes_.size();
  if (beganBy_) entry->listeners.push_back(*std::exchange(beganBy_, std::nullopt));
  if (listener) addTo(entry->listeners, std::move(*listener));
  ended_.push_back(std::move(entry));
  for (const auto& scene : scenes_) {
    scene->inspect([this, host = scene.get(), recorder](const auto&) {
      recorderOf_[host->number()] = nullptr;
      if (owners_[host->number()]) owners_[host->number()]->watch(nullptr);
      for (const auto& station : stations_) {
        if (&station->scene() == host) station->recordTo(nullptr, 0);
      }
      post_([this, recorder] { sceneEnded(recorder); });
    });
  }
}

void Recordings::sceneEnded(const record::Recorder* recorder) {
  for (const auto& entry : ended_) {
    if (entry->recorder.get() != recorder || --entry->scenes > 0) continue;
    entry->at = base::now();
    entry->recorder->end();
  }
}

std::string Recordings::file() const {
  return recorder_ && recorder_->writes() ? recorder_->path().string() : "";
}

void Recordings::marker(Nanos time, const std::string& text) {
  if (recorder_) recorder_->recordMarker(time, text);
}

void Recordings::command(std::uint32_t scene, scene::ClientId client, Nanos now,
                         const scene::SceneCommand* c) {
  if (scene < recorderOf_.size() && recorderOf_[scene] != nullptr)
    recorderOf_[scene]->recordCommand(scene, client, now, c);
}

// A tick that began before the end may still push into the rings: they live until a later one has finished,
// or the servos have ended.
void Recordings::poll() {
  std::erase_if(ended_, [this](const std::unique_ptr<Ended>& entry) {
    if (!entry->recorder->ended()) return false;
    if (!std::exchange(entry->told, true)) {
      const std::string text = summary(*entry->recorder);
      spdlog::info("{}", text);
      for (const Listener& listener : entry->listeners) listener.tell(text);
    }
    constexpr Nanos kLongestTick = 100'000'000;
    return std::all_of(stations_.begin(), stations_.end(),
                       [&](const auto& station) { return station->finishedAfter(entry->at + kLongestTick); });
  });
}

void Recordings::finish() {
  beginner_.stop();
  if (beginning_ && beginning_->recorder) recorder_ = std::move(beginning_->recorder);
  beginning_.reset();
  for (const auto& owners : owners_) {
    if (owners) owners->watch(nullptr);  // clients leave the server that ends, too
  }
  for (const auto& entry : ended_) {
    entry->recorder->finish();
    if (!entry->told) spdlog::info("{}", summary(*entry->recorder));
  }
  ended_.clear();
  if (!recorder_) return;
  recorder_->finish();
  spdlog::info("{}", summary(*recorder_));
  recorder_.reset();
}

}  // namespace hapticd::server
