// Recordings that clients begin and end, on a simulated disk.
#include "server/recordings.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/fake_world.h"

namespace hapticd::server {
namespace {

class RecordingsTest : public testing::Test {
 protected:
  RecordingsTest() { recordings.begin(0, ""); }
  ~RecordingsTest() override { recordings.finish(); }

  Recordings::Listener client(scene::ClientId id) {
    return {id, [this, id](const std::string& text) {
              ended.push_back("to " + std::to_string(id) + ": " + text);
            }};
  }
  void start(const std::string& name) {
    recordings.start(
        name, 0, "",
        [this](const std::string& refusal, const std::string& file) {
          begun.push_back(refusal.empty() ? "recording to " + file : refusal);
        },
        client(1));
  }
  void end() { recordings.end("", client(1)); }
  // Only one that records a scene ends.
  void startScene() {
    scenes.push_back(std::make_unique<SceneHost>(0, "", SceneOnDisconnect::keep));
    scenes.back()->add({.config = {}, .slot = &slot, .published = {}, .publishing = {}});
    scenes.back()->start({.notices = {}, .relieved = {}, .applying = {}, .wasReset = {}}, post());
    recordings.begin(0, "");
  }
  std::function<void(std::function<void()>)> post() {
    return [this](std::function<void()> call) { posted.push_back(std::move(call)); };
  }
  // The threads, and what they post to the net thread.
  void run() {
    for (int i = 0; i < 10; ++i) {
      world.threads.runUntil(world.clock.now() + 20'000'000);
      for (auto calls = std::exchange(posted, {}); auto& call : calls) call();
      recordings.poll();
    }
  }

  base::FakeWorld world;
  scene::SnapshotSlot slot;
  Recordings::Scenes scenes;
  Recordings::Stations stations;
  std::vector<std::function<void()>> posted;
  std::vector<std::string> begun;
  std::vector<std::string> ended;
  std::vector<std::string> problems;
  Recordings recordings{
      scenes, stations, post(), {.folder = "/", .onProblem = [this](auto, const std::string& text) {
                                   problems.push_back(text);
                                   begun.push_back("problem: " + text);
                                 }}};
};

// A disk may hang; the net thread takes stops.
TEST_F(RecordingsTest, TheFileIsCreatedByAnotherThread) {
  start("a.haptics");
  EXPECT_TRUE(begun.empty());
  EXPECT_FALSE(world.files.exists("/a.haptics"));
  EXPECT_THROW(start("b.haptics"), record::RecordingError);
  run();
  EXPECT_EQ(begun, std::vector<std::string>{"recording to /a.haptics"});
  EXPECT_TRUE(world.files.exists("/a.haptics"));
  EXPECT_THROW(start("b.haptics"), record::RecordingError);
}

TEST_F(RecordingsTest, AnEndThatComesBeforeTheFileEndsIt) {
  start("a.haptics");
  end();
  EXPECT_THROW(end(), record::RecordingError) << "a second one";
  run();
  EXPECT_EQ(begun.size(), 1U);
  EXPECT_EQ(recordings.file(), "");
}

TEST_F(RecordingsTest, ARefusalOfTheDiskIsToldToBoth) {
  world.files.failures.open = EACCES;
  start("a.haptics");
  end();
  run();
  ASSERT_EQ(begun.size(), 1U);
  EXPECT_NE(begun[0].find("cannot record to '/a.haptics': Permission denied"), std::string::npos);
  EXPECT_EQ(ended, std::vector<std::string>{"to 1: nothing is recorded"});
  world.files.failures = {};
  start("");
  run();
  EXPECT_EQ(begun.size(), 2U);
  EXPECT_TRUE(begun[1].starts_with("recording to /session-2020")) << begun[1];
}

// Its header does not fit: nothing has begun, so nothing has ended either.
TEST_F(RecordingsTest, AFileThatTakesNoHeaderIsRefusedOnce) {
  for (const char* name : {"a.haptics", ""}) {
    world.files.freeBytes = 10;
    start(name);
    run();
    ASSERT_EQ(begun.size(), 1U);
    EXPECT_TRUE(begun[0].starts_with("cannot record to '/")) << begun[0];
    EXPECT_NE(begun[0].find(".haptics': No space left on device; make room on the disk"), std::string::npos)
        << begun[0];
    EXPECT_TRUE(problems.empty()) << problems.front();
    EXPECT_EQ(recordings.file(), "");
    EXPECT_FALSE(world.files.exists("/a.haptics"));
    begun.clear();
    world.files.freeBytes.reset();
  }
  start("a.haptics");
  run();
  EXPECT_EQ(begun, std::vector<std::string>{"recording to /a.haptics"});
}

// Before the net thread hears that it has begun. It learns of both in this order, and of the file.
TEST_F(RecordingsTest, OneThatFailsAsSoonAsItHasBegunIsNamed) {
  start("a.haptics");
  world.threads.runUntil(world.clock.now() + 1);
  ASSERT_TRUE(world.files.exists("/a.haptics"));
  world.files.remove("/a.haptics");
  world.threads.runUntil(world.clock.now() + 2'000'000'000);
  EXPECT_TRUE(begun.empty());
  run();
  ASSERT_EQ(begun.size(), 2U);
  EXPECT_EQ(begun[0], "recording to /a.haptics");
  EXPECT_TRUE(begun[1].starts_with("problem: ")) << begun[1];
  EXPECT_EQ(recordings.file(), "");
}

// Two operators: the first one's end must not be that of the second one's recording.
TEST_F(RecordingsTest, AnEndWithANameEndsNoOther) {
  EXPECT_THROW(recordings.end("a.haptics", client(1)), record::RecordingError) << "nothing is recorded";
  start("b.haptics");
  EXPECT_THROW(recordings.end("a.haptics", client(1)), record::RecordingError) << "before the file is there";
  run();
  EXPECT_THROW(recordings.end("a.haptics", client(1)), record::RecordingError);
  run();
  EXPECT_EQ(recordings.file(), "/b.haptics");
  recordings.end("b.haptics", client(1));
  EXPECT_EQ(recordings.file(), "");
}

TEST_F(RecordingsTest, TheClientThatBeganItIsToldOfTheEndToo) {
  startScene();
  start("a.haptics");
  run();
  recordings.end("", client(2));
  for (int i = 0; i < 2; ++i) recordings.end("a.haptics", client(3));  // at the same time
  run();
  const std::string text = "recorded 0 ticks, 0.0 MB, in /a.haptics";
  EXPECT_EQ(ended, (std::vector<std::string>{"to 1: " + text, "to 2: " + text, "to 3: " + text}));
}

// One that has ended keeps its memory until its scenes and servos have done with it.
TEST_F(RecordingsTest, WithoutPauseAreRefused) {
  const auto name = [](int i) { return std::to_string(i) + ".haptics"; };
  constexpr int kMost = 4;
  for (int i = 0; i < kMost; ++i) {
    start(name(i));
    end();
    run();
    EXPECT_EQ(begun.back(), "recording to /" + name(i));
  }
  EXPECT_THROW(start(name(kMost)), record::RecordingError);
  EXPECT_FALSE(world.files.exists("/" + name(kMost)));
}

TEST_F(RecordingsTest, OneThatBeginsAsTheServerEndsIsCompleted) {
  start("a.haptics");
  recordings.finish();
  EXPECT_TRUE(begun.empty());
}

}  // namespace
}  // namespace hapticd::server
