#include "geometry/crossings.h"

#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "reduced.h"

namespace hapticd::geometry {
namespace {

CrossingReport find(const TriangleMesh& mesh) {
  return findCrossings(mesh.vertices, mesh.triangles);
}

// A closed ball of n by 2n quads, each two triangles.
void addBall(TriangleMesh& mesh, const Vec3f& centre, float radius, std::uint32_t n) {
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  for (std::uint32_t i = 0; i <= n; ++i) {
    for (std::uint32_t j = 0; j < 2 * n; ++j) {
      const float polar = std::numbers::pi_v<float> * static_cast<float>(i) / static_cast<float>(n);
      const float around = std::numbers::pi_v<float> * static_cast<float>(j) / static_cast<float>(n);
      const float ring = i == 0 || i == n ? 0 : std::sin(polar);
      mesh.vertices.emplace_back(
          centre + radius * Vec3f(ring * std::cos(around), ring * std::sin(around), std::cos(polar)));
    }
  }
  const auto at = [&](std::uint32_t i, std::uint32_t j) { return first + i * 2 * n + j % (2 * n); };
  for (std::uint32_t i = 0; i < n; ++i) {
    for (std::uint32_t j = 0; j < 2 * n; ++j) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
      mesh.triangles.push_back({at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)});
    }
  }
}

TriangleMesh randomSoup(std::mt19937& random, std::uint32_t triangles, float size) {
  std::uniform_real_distribution<float> place(-1, 1);
  TriangleMesh mesh;
  for (std::uint32_t i = 0; i < triangles; ++i) {
    const Vec3f centre(place(random), place(random), place(random));
    for (int corner = 0; corner < 3; ++corner)
      mesh.vertices.emplace_back(centre + size * Vec3f(place(random), place(random), place(random)));
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  return mesh;
}

std::uint64_t countAllPairs(const TriangleMesh& mesh) {
  const auto corners = [&](const Triangle& t) {
    return Corners3f{mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]};
  };
  std::uint64_t pairs = 0;
  ExactCount exact = 0;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    for (std::size_t j = i + 1; j < mesh.triangles.size(); ++j)
      pairs += cross(corners(mesh.triangles[i]), corners(mesh.triangles[j]), exact) ? 1 : 0;
  }
  return pairs;
}

TEST(Crossings, OneBallHasNone) {
  TriangleMesh mesh;
  EXPECT_EQ(find(mesh).pairs, 0U);
  EXPECT_TRUE(find(mesh).complete);
  addBall(mesh, Vec3f::Zero(), 30, 20);
  const CrossingReport report = find(mesh);
  EXPECT_EQ(report.pairs, 0U);
  EXPECT_TRUE(report.complete);
  EXPECT_TRUE(describe(report).empty());
}

TEST(Crossings, TwoBallsCrossOnlyWhereTheyOverlap) {
  constexpr auto kRings = static_cast<std::uint32_t>(reduced(16, 8));
  for (const float distance : {10.0F, 59.0F, 61.0F}) {
    TriangleMesh mesh;
    addBall(mesh, Vec3f::Zero(), 30, kRings);
    addBall(mesh, Vec3f(distance, 0.123F, 0.0456F), 30, kRings);
    const CrossingReport report = find(mesh);
    EXPECT_EQ(report.pairs, countAllPairs(mesh)) << distance;
    EXPECT_EQ(report.pairs > 0, distance < 60) << distance;
    EXPECT_TRUE(report.complete);
  }
}

TEST(Crossings, AsManyAsAllPairsTell) {
  std::mt19937 random(4);
  std::uint64_t most = 0;
  for (std::uint32_t i = 1; i < static_cast<std::uint32_t>(reduced(60, 40)); ++i) {
    const TriangleMesh mesh = randomSoup(random, i * i / 4, 0.3F);
    const CrossingReport report = find(mesh);
    ASSERT_EQ(report.pairs, countAllPairs(mesh)) << i;
    ASSERT_TRUE(report.complete);
    most = std::max(most, report.pairs);
  }
  EXPECT_GT(most, static_cast<std::uint64_t>(reduced(1'000)));
}

TEST(Crossings, OneLargeTriangleAmongSmallOnesIsFound) {
  std::mt19937 random(5);
  TriangleMesh mesh = randomSoup(random, 2'000, 0.01F);
  mesh.vertices.insert(mesh.vertices.end(), {Vec3f(-9, -9, 0.1F), Vec3f(9, -9, 0.1F), Vec3f(0, 9, 0.1F)});
  mesh.triangles.push_back({6'000, 6'001, 6'002});
  const CrossingReport report = find(mesh);
  EXPECT_EQ(report.pairs, countAllPairs(mesh));
  EXPECT_GT(report.pairs, 5U);
}

TEST(Crossings, DuplicatesAndTrianglesWithoutAllCornersAreNotCounted) {
  TriangleMesh mesh;
  mesh.vertices = {Vec3f(0, 0, 0), Vec3f(1, 0, 0), Vec3f(0, 1, 0),
                   Vec3f(0, 0, std::numeric_limits<float>::quiet_NaN()), Vec3f(0, 0, 0)};
  mesh.triangles = {{0, 1, 2}, {2, 1, 4}, {0, 1, 3}, {0, 1, 99}};
  EXPECT_EQ(find(mesh).pairs, 0U);
  mesh.vertices.emplace_back(0.5F, 0.6F, 0);
  mesh.triangles.push_back({0, 1, 5});
  EXPECT_EQ(find(mesh).pairs, 2U) << "the one folded onto both";
}

TEST(Crossings, SlicesGiveTheSameAsOneRun) {
  std::mt19937 random(6);
  const TriangleMesh mesh = randomSoup(random, 500, 0.3F);
  CrossingSearch search(mesh.vertices, mesh.triangles);
  int slices = 1;
  for (; !search.run(10'000); ++slices) EXPECT_FALSE(search.report().complete);
  EXPECT_GT(slices, 10);
  EXPECT_TRUE(search.done());
  EXPECT_TRUE(search.report().complete);
  EXPECT_EQ(search.report().pairs, find(mesh).pairs);
}

// Every triangle crosses nearly all others: 200 million pairs, more than the budget allows.
TEST(Crossings, AHopelessMeshEndsWithWhatWasFound) {
  std::mt19937 random(7);
  const TriangleMesh mesh = randomSoup(random, 20'000, 100);
  constexpr std::uint64_t kWork = 20'000'000;
  CrossingSearch search(mesh.vertices, mesh.triangles);
  std::uint64_t work = 0;
  while (!search.run(kWork)) {
    work += kWork;
    ASSERT_LE(work, CrossingSearch::budgetFor(mesh.triangles.size())) << "the budget is an end";
  }
  EXPECT_FALSE(search.report().complete);
  EXPECT_GT(search.report().pairs, 10'000U);
}

TEST(Crossings, AreToldWithWhatTheyMean) {
  using Texts = std::vector<std::string>;
  EXPECT_EQ(describe({.pairs = 0, .complete = true}), Texts{});
  EXPECT_EQ(describe({.pairs = 1, .complete = true}),
            Texts{"1 pair of triangles runs through each other: all are felt, the outermost first, and what "
                  "lies inside is out of reach; the mesh was left as it is."});
  EXPECT_EQ(describe({.pairs = 12, .complete = false}),
            Texts{"At least 12 pairs of triangles run through each other: all are felt, the outermost first, "
                  "and what lies inside is out of reach; the mesh was left as it is. The search was stopped "
                  "before its end: there may be more."});
  EXPECT_EQ(
      describe({.pairs = 0, .complete = false}),
      Texts{
          "No triangles that run through each other were found, but the search was stopped before its end."});
}

}  // namespace
}  // namespace hapticd::geometry
