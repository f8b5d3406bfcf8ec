#include <gmock/gmock.h>

#include <cmath>

#include "scene_fixture.h"

namespace hapticd::scene {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class ObjectChecks : public SceneTest {
 protected:
  ObjectChecks() {
    restart([] { return Nanos{0}; });
  }

  void restart(std::function<Nanos()> stopwatch) {
    SceneConfig config = simulated({});
    config.checkMeshes = true;
    config.stopwatch = std::move(stopwatch);
    builder_ = SceneBuilder(config);
    notices_.clear();
  }

  // Triangles that all stand on the z axis like the pages of a book, and run through it.
  static std::vector<Vec3f> book(int pages) {
    std::vector<Vec3f> vertices;
    for (int i = 0; i < pages; ++i) {
      const float angle = 3.0F * static_cast<float>(i) / static_cast<float>(pages);
      const Vec3f across(std::cos(angle), std::sin(angle), 0);
      vertices.insert(vertices.end(), {-across, across, Vec3f(0.1F, 0.2F, 1)});
    }
    return vertices;
  }
};

TEST_F(ObjectChecks, TrianglesThatRunThroughEachOtherAreToldWithTheRest) {
  say(SetVertices{
      0,
      0,
      {Vec3f(0, 0, 0), Vec3f(4, 0, 0), Vec3f(0, 4, 0), Vec3f(1, 1, -1), Vec3f(1, 1, 1), Vec3f(9, 9, 0)}});
  run(1'000 * kMillisecond);
  EXPECT_EQ(
      onlyNotice(Notice::Severity::normal),
      "mesh of object 0: 6 edges have a triangle on one side only: the hand can go around or through there. "
      "1 pair of triangles runs through each other: all are felt, the outermost first, and what lies inside "
      "is out of reach; the mesh was left as it is.");
}

// World units are millimetres.
TEST_F(ObjectChecks, CoordinatesThatAreTooLargeForFloatsAreReported) {
  const auto upload = [&](float far) {
    restart([] { return Nanos{0}; });
    say(SetVertices{0, 0, {Vec3f(far, 0, 0), Vec3f(far + 64, 0, 0), Vec3f(far, 64, 0)}});
    run(1'000 * kMillisecond);
    return onlyNotice(Notice::Severity::normal);
  };
  EXPECT_THAT(upload(1e5F), Not(HasSubstr("float")));
  EXPECT_THAT(
      upload(4e5F),
      AllOf(HasSubstr("Coordinates are as large as 400064, where four steps of a float are 190.765 um"),
            HasSubstr("place the object by its position")));
}

TEST_F(ObjectChecks, TouchingTrianglesAreNoCrossing) {
  say(SetVertices{
      0,
      0,
      {Vec3f(0, 0, 0), Vec3f(4, 0, 0), Vec3f(0, 4, 0), Vec3f(1, 1, 0), Vec3f(1, 1, 1), Vec3f(9, 9, 0)}});
  run(1'000 * kMillisecond);
  EXPECT_THAT(onlyNotice(Notice::Severity::normal), Not(HasSubstr("through each other")));
}

// A search that takes long goes on in slices: what is quick to find out is told at once, the rest later, and
// commands in between do not wait.
TEST_F(ObjectChecks, ALongSearchGoesOnInSlices) {
  Nanos worked = 0;
  restart([&] { return worked += kMillisecond; });
  say(SetVertices{0, 0, book(300)});
  run(20 * kMillisecond);
  int publications = 0;
  while (notices_.empty() && ++publications < 100) {
    now_ = std::max(now_, builder_.nextDeadline().value_or(now_));
    publish();
  }
  EXPECT_THAT(onlyNotice(Notice::Severity::normal), Not(HasSubstr("through each other")));
  publications = 0;
  while (notices_.empty() && ++publications < 10'000) {
    const auto next = builder_.nextDeadline();
    ASSERT_TRUE(next);
    EXPECT_GT(*next, now_) << "three quarters of the time are for others";
    now_ = std::max(now_, *next);
    const Nanos before = worked;
    publish();
    EXPECT_LE(worked - before, 10 * kMillisecond);
  }
  EXPECT_GT(publications, 5);
  EXPECT_THAT(
      onlyNotice(Notice::Severity::normal),
      AllOf(HasSubstr("mesh of object 0: "), HasSubstr(" pairs of triangles run through each other")));
}

TEST_F(ObjectChecks, ASearchEndsWithItsMesh) {
  Nanos worked = 0;
  for (const bool removed : {true, false}) {
    restart([&] { return worked += kMillisecond; });
    say(SetObjectNumber{2});
    say(SetVertices{1, 0, book(300)});
    run(20 * kMillisecond);
    while (notices_.empty()) {
      now_ = std::max(now_, builder_.nextDeadline().value_or(now_));
      publish();
    }
    notices_.clear();
    if (removed) {
      say(RemoveObject{1});
    } else {
      say(ResetScene{});
    }
    run(5'000 * kMillisecond);
    EXPECT_TRUE(notices_.empty());
    EXPECT_EQ(builder_.nextDeadline(), std::nullopt);
  }
}

TEST_F(ObjectChecks, SeveralMeshesTakeTurns) {
  Nanos worked = 0;
  restart([&] { return worked += kMillisecond / 10; });
  say(SetObjectNumber{3});
  for (std::int32_t id = 0; id < 3; ++id) say(SetVertices{id, 0, book(100)});
  run(60'000 * kMillisecond);
  int found = 0;
  for (const Notice& notice : notices_)
    found += notice.text.find("through each other") != std::string::npos ? 1 : 0;
  EXPECT_EQ(found, 3);
  EXPECT_EQ(builder_.nextDeadline(), std::nullopt);
}

}  // namespace
}  // namespace hapticd::scene
