// The recorder with full rings, full disks and impossible paths.
#include "record/recorder.h"

#include <gtest/gtest.h>

#include <sys/resource.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <fstream>
#include <mutex>
#include <thread>

#include "base/fake_world.h"
#include "record/recording_file.h"
#include "record/recording_reader.h"
#include "record/sidecar.h"

namespace hapticd::record {
namespace {

using test::RecordingFile;

// Collects the problems that the recorder reports.
class Problems {
 public:
  Recorder::OnProblem listener() {
    return [this](RecorderProblem problem, const std::string& text) {
      const std::lock_guard lock(mutex_);
      all_ += (problem == RecorderProblem::losses ? "goes on: " : "stopped: ") + text + "\n";
    };
  }
  std::string all() {
    const std::lock_guard lock(mutex_);
    return all_;
  }
  bool until(const std::string& text) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    while (all().find(text) == std::string::npos) {
      if (std::chrono::steady_clock::now() > end) return false;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return true;
  }

 private:
  std::mutex mutex_;
  std::string all_;
};

RecordedDevice phantom() {
  RecordedDevice device;
  device.names = {"Phantom"};
  return device;
}

std::string openError(const std::filesystem::path& path) {
  try {
    Recorder recorder(path, [](RecorderProblem, const std::string&) {});
  } catch (const RecordingError& error) {
    return error.what();
  }
  return "";
}

TEST(Recorder, AFileThatCannotBeCreatedIsRefusedAtOnce) {
  EXPECT_NE(openError("/nowhere/x.haptics").find("cannot record to '/nowhere/x.haptics': No such file"),
            std::string::npos);
  RecordingFile file;
  std::ofstream(file.path()) << "precious";
  EXPECT_NE(openError(file.path()).find("File exists; name another"), std::string::npos);
  std::ifstream in(file.path());
  std::string kept;
  in >> kept;
  EXPECT_EQ(kept, "precious");
  EXPECT_NE(openError(file.path().parent_path()).find("Is a directory; name a file"), std::string::npos);
}

TEST(Recorder, TicksOfAFullRingAreCountedInTheLogAndInTheFile) {
  RecordingFile file;
  Problems problems;
  Recorder recorder(file.path(), problems.listener(), {.ticks = 8, .sceneBytes = 1U << 20U});
  recorder.addDevice(phantom());
  realtime::TickRecord tick;
  for (std::uint64_t i = 1; i <= 20; ++i) {  // before the recorder starts
    tick.report.tick = i;
    recorder.ring(0).push(tick);
  }
  recorder.start(0, "");
  EXPECT_TRUE(problems.until("goes on: recording to '" + file.path().string() +
                             "': 12 ticks, 0 scene events and 0 streamed values lost so far"));
  recorder.finish();
  EXPECT_EQ(recorder.counts().ticks, 8U);
  EXPECT_EQ(recorder.counts().lostTicks, 12U);
  std::uint64_t lost = 0;
  RecordingReader reader(file.path());
  for (RecordingEvent event; reader.next(event);) {
    const auto* gap = std::get_if<LostEvent>(&event);
    if (gap != nullptr && gap->what == LostEvent::What::ticks) lost += gap->count;
  }
  EXPECT_EQ(lost, 12U);
}

TEST(Recorder, SceneEventsBeyondTheMemoryAreCounted) {
  RecordingFile file;
  Problems problems;
  Recorder recorder(file.path(), problems.listener(), {.ticks = 8, .sceneBytes = 1000});
  recorder.addDevice(phantom());
  recorder.start(0, "");
  const scene::SceneCommand large = scene::SetVertices{0, 0, std::vector<geometry::Vec3f>(1000)};
  recorder.recordCommand(0, 1, 2, &large);
  recorder.recordCommand(0, 1, 3, nullptr);
  recorder.finish();
  EXPECT_EQ(recorder.counts().lostSceneEvents, 1U);
  EXPECT_NE(problems.all().find("1 scene events and 0 streamed values lost"), std::string::npos);
}

TEST(Recorder, MarkersAreKept) {
  RecordingFile file;
  Problems problems;
  Recorder recorder(file.path(), problems.listener());
  recorder.addDevice(phantom());
  recorder.start(0, "");
  recorder.recordMarker(77, "trial 3 begins");
  // For XML and JSON: nothing that is not UTF-8.
  recorder.recordMarker(78, "20 \xe2\x84\x83, \xf0\x9f\x98\x80");
  recorder.recordMarker(79,
                        "a\x1b[2Jb\nc\xe9"
                        "d\xe2\x84\xed\xa0\x80\xc0\x80");
  recorder.finish();
  RecordingReader reader(file.path());
  std::vector<MarkerEvent> markers;
  for (RecordingEvent event; reader.next(event);) {
    if (const auto* marker = std::get_if<MarkerEvent>(&event)) markers.push_back(*marker);
  }
  ASSERT_EQ(markers.size(), 3U);
  EXPECT_EQ(markers[0].time, 77);
  EXPECT_EQ(markers[0].text, "trial 3 begins");
  EXPECT_EQ(markers[1].text, "20 \xe2\x84\x83, \xf0\x9f\x98\x80");
  const std::string no = "\xef\xbf\xbd";
  EXPECT_EQ(markers[2].text, "a\x1b[2Jb\nc" + no + "d" + no + no + no + no + no + no + no);
  EXPECT_NE(sidecarOf(file.path()).json.find(R"("a\u001b[2Jb\nc)"), std::string::npos);
}

TEST(Recorder, AFileThatIsRemovedEndsTheRecording) {
  RecordingFile file;
  Problems problems;
  Recorder recorder(file.path(), problems.listener());
  recorder.addDevice(phantom());
  recorder.start(0, "");
  EXPECT_TRUE(recorder.writes());
  std::filesystem::remove(file.path());
  EXPECT_TRUE(problems.until("stopped: recording to '" + file.path().string() +
                             "' has stopped: another program removed the file"));
  EXPECT_FALSE(recorder.writes());
  recorder.ring(0).push(realtime::TickRecord());
  recorder.finish();
  EXPECT_EQ(recorder.counts().ticks, 0U) << "lost ticks were not recorded";
}

// Emptied, or replaced by a larger one, as by 'cp'.
TEST(Recorder, AFileThatAnotherProgramWritesToEndsTheRecording) {
  for (const std::uintmax_t size : {0, 1'000'000}) {
    RecordingFile file;
    Problems problems;
    Recorder recorder(file.path(), problems.listener());
    recorder.addDevice(phantom());
    recorder.start(0, "");
    std::filesystem::resize_file(file.path(), size);
    recorder.ring(0).push(realtime::TickRecord());
    EXPECT_TRUE(problems.until("stopped: recording to '" + file.path().string() +
                               "' has stopped: another program removed the file, or wrote to it"))
        << size;
    EXPECT_FALSE(recorder.writes());
    recorder.finish();
  }
}

// It would be in the way of the next start, and hide why the first one failed.
TEST(Recorder, AFileWithoutAHeaderDoesNotStay) {
  const std::filesystem::path file = "/session.haptics";
  base::FakeWorld world;
  Problems problems;
  { const Recorder neverStarted(file, problems.listener()); }
  EXPECT_FALSE(world.files.exists(file));
  {
    Recorder recorder(file, problems.listener());
    recorder.addDevice(phantom());
    world.files.freeBytes = 10;
    try {
      recorder.start(0, "");
      ADD_FAILURE();
    } catch (const RecordingError& error) {
      EXPECT_STREQ(error.what(),
                   "cannot record to '/session.haptics': No space left on device; make room on the disk");
    }
    EXPECT_FALSE(recorder.writes());
  }
  EXPECT_EQ(problems.all(), "") << "nothing has begun that could have stopped";
  EXPECT_FALSE(world.files.exists(file));
  world.files.freeBytes.reset();
  {
    const Recorder removed(file, problems.listener());
    world.files.remove(file);
    world.files.create(file, base::Existing::refuse)->write("precious");
  }
  EXPECT_EQ(world.files.text(file), "precious");
}

// One tick in each.
void recordSeconds(std::uint64_t count, Recorder& recorder, base::FakeWorld& world) {
  for (std::uint64_t i = 1; i <= count; ++i) {
    realtime::TickRecord tick;
    tick.report.tick = i;
    recorder.ring(0).push(tick);
    world.threads.runUntil(world.clock.now() + 1'000'000'000);
  }
}

TEST(Recorder, AWallClockThatIsSetIsFollowed) {
  constexpr Nanos kHour = 3'600'000'000'000;
  base::FakeWorld world;
  Problems problems;
  Recorder recorder("/session.haptics", problems.listener());
  recorder.addDevice(phantom());
  recorder.start(1000, "");
  for (const bool set : {false, true}) {
    if (set) world.clock.setWall(world.clock.wallNow() + kHour);
    world.threads.runUntil(world.clock.now() + 1'000'000'000);
    realtime::TickRecord tick;
    tick.report.time = world.clock.now();
    recorder.ring(0).push(tick);
    recorder.recordMarker(tick.report.time, "");
  }
  recorder.finish();
  std::vector<Nanos> offsets;
  RecordingReader reader("/session.haptics");
  for (RecordingEvent event; reader.next(event);) {
    if (const auto* marker = std::get_if<MarkerEvent>(&event))
      offsets.push_back(reader.wallOffsetAt(marker->time));
    if (const auto* tick = std::get_if<TickEvent>(&event))
      offsets.push_back(reader.wallOffsetAt(tick->tick.report.time));
  }
  EXPECT_EQ(offsets, std::vector<Nanos>({1000, 1000, 1000 + kHour, 1000 + kHour}));
  EXPECT_EQ(reader.wallOffsetAt(0), 1000);
}

TEST(Recorder, AFileThatIsRenamedIsRecordedOn) {
  RecordingFile file;
  const RecordingFile renamed;
  base::SystemFiles files;
  const std::unique_ptr<base::OutputFile> open = files.create(file.path(), base::Existing::refuse);
  std::filesystem::rename(file.path(), renamed.path());
  EXPECT_FALSE(open->isGone());
  std::filesystem::remove(renamed.path());
  EXPECT_TRUE(open->isGone());

  base::FakeWorld world;
  Problems problems;
  Recorder recorder("/session.haptics", problems.listener());
  recorder.addDevice(phantom());
  recorder.start(0, "");
  world.files.rename("/session.haptics", "/another.haptics");
  recordSeconds(5, recorder, world);
  EXPECT_TRUE(recorder.writes());
  recorder.finish();
  EXPECT_EQ(recorder.counts().ticks, 5U);
  EXPECT_EQ(problems.all(), "");
}

TEST(Recorder, AMachineOutOfDescriptorsDoesNotEndTheRecording) {
  base::FakeWorld world;
  Problems problems;
  Recorder recorder("/session.haptics", problems.listener());
  recorder.addDevice(phantom());
  recorder.start(0, "");
  world.files.failures.open = EMFILE;
  recordSeconds(5, recorder, world);
  EXPECT_TRUE(recorder.writes());
  recorder.finish();
  EXPECT_EQ(recorder.counts().ticks, 5U);
  EXPECT_EQ(problems.all(), "");
}

TEST(Recorder, AFullDiskEndsTheRecordingAndNothingElse) {
  RecordingFile link;
  std::filesystem::create_symlink("/dev/full", link.path());
  Problems problems;
  EXPECT_NE(openError(link.path()), "") << "a link is not a new file";
  std::filesystem::remove(link.path());

  // A limit on file sizes stands in for a disk that fills up.
  std::atomic<bool> ended{false};
  Recorder recorder(link.path(), problems.listener());
  recorder.addDevice(phantom());
  recorder.start(0, std::string(1U << 16U, 'x'));
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit small = before;
  small.rlim_cur = 1U << 17U;
  setrlimit(RLIMIT_FSIZE, &small);
  std::thread servo([&] {
    for (std::uint64_t i = 1; !ended; ++i) {
      realtime::TickRecord tick;
      tick.report.tick = i;
      recorder.ring(0).push(tick);
      if (i % 100 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  });
  EXPECT_TRUE(problems.until("has stopped: File too large"));
  ended = true;
  servo.join();
  recorder.finish();
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_LE(recorder.counts().bytes, std::filesystem::file_size(link.path()));

  RecordingReader reader(link.path());
  for (RecordingEvent event; reader.next(event);) {
  }
  EXPECT_NE(reader.remark(), "");
  EXPECT_NE(reader.remark().find("cut"), std::string::npos) << reader.remark();
}

TEST(Recorder, EndsBeforeTheFileExceedsItsLimit) {
  constexpr std::uint64_t kMost = 200'000;
  RecordingFile file;
  Problems problems;
  Recorder recorder(file.path(), problems.listener(), {.fileBytes = kMost});
  recorder.addDevice(phantom());
  recorder.start(0, "");
  for (int i = 0; i < 1000; ++i) recorder.recordMarker(i, std::string(1000, 'm'));
  EXPECT_TRUE(problems.until("has stopped: File too large")) << problems.all();
  recorder.finish();
  EXPECT_LE(std::filesystem::file_size(file.path()), kMost);
}

std::uint64_t ticksIn(const std::filesystem::path& file) {
  std::uint64_t ticks = 0;
  RecordingReader reader(file);
  for (RecordingEvent event; reader.next(event);) ticks += std::holds_alternative<TickEvent>(event) ? 1 : 0;
  return ticks;
}

TEST(Recorder, CountsTheTicksOfTheFile) {
  const std::filesystem::path file = "/session.haptics";
  base::FakeWorld world;
  Problems problems;
  Recorder recorder(file, problems.listener(), {.fileBytes = 200'000});
  recorder.addDevice(phantom());
  recorder.start(0, "");
  for (std::uint64_t i = 1; i <= 1000; ++i) {
    realtime::TickRecord tick;
    tick.report.tick = i;
    recorder.ring(0).push(tick);
    if (i % 10 == 0) world.threads.runUntil(world.clock.now() + 20'000'000);
  }
  recorder.finish();
  EXPECT_NE(problems.all(), "") << "the file is full";
  EXPECT_GT(recorder.counts().ticks, 0U);
  EXPECT_LT(recorder.counts().ticks, 1000U);
  EXPECT_EQ(recorder.counts().ticks, ticksIn(file));
}

}  // namespace
}  // namespace hapticd::record
