#include "geometry/crossings.h"

#include <algorithm>
#include <utility>

#include "geometry/mesh_check.h"
#include "geometry/space_curve.h"

namespace hapticd::geometry {
namespace {

constexpr std::uint32_t kLeaf = 4;
// Measured cost of the steps, in units of about two nanoseconds.
constexpr std::uint64_t kVisitWork = 8;
constexpr std::uint64_t kBoxWork = 4;
constexpr std::uint64_t kCrossWork = 60;
constexpr std::uint64_t kExactWork = 250;

Vec3f lowest(const Corners3f& t) {
  return t[0].cwiseMin(t[1]).cwiseMin(t[2]);
}

Vec3f highest(const Corners3f& t) {
  return t[0].cwiseMax(t[1]).cwiseMax(t[2]);
}

// Of a point in a box.
std::uint64_t placeIn(const Box& box, const Vec3& point) {
  Vec3 inCube = Vec3::Zero();
  for (int i = 0; i < 3; ++i) {
    const double extent = box.max[i] - box.min[i];
    if (extent > 0) inCube[i] = std::clamp((point[i] - box.min[i]) / extent, 0.0, 1.0);
  }
  return placeOnCurve(inCube);
}

bool sameCorners(const Corners3f& a, const Corners3f& b) {
  return std::is_permutation(a.begin(), a.end(), b.begin());
}

}  // namespace

CrossingSearch::CrossingSearch(std::span<const Vec3f> vertices, std::span<const Triangle> triangles)
    : vertices_(vertices), triangles_(triangles), budget_(budgetFor(triangles.size())) {
  sortTriangles();
  buildTree();
  if (!order_.empty()) pending_.push_back({static_cast<std::uint32_t>(levels_.size() - 1), 0, 0});
}

void CrossingSearch::sortTriangles() {
  const auto usable = [&](const Triangle& t) {
    return std::ranges::all_of(t, [&](std::uint32_t i) { return i < vertices_.size(); }) &&
           hasArea(vertices_[t[0]], vertices_[t[1]], vertices_[t[2]]);
  };
  const auto middle = [&](const Triangle& t) {
    return Vec3(
        (vertices_[t[0]].cast<double>() + vertices_[t[1]].cast<double>() + vertices_[t[2]].cast<double>()) /
        3);
  };
  Box box;
  for (const Triangle& t : triangles_) {
    if (usable(t)) box.extend(middle(t));
  }
  std::vector<std::pair<std::uint64_t, std::uint32_t>> places;
  places.reserve(triangles_.size());
  for (std::uint32_t i = 0; i < triangles_.size(); ++i) {
    if (usable(triangles_[i])) places.emplace_back(placeIn(box, middle(triangles_[i])), i);
  }
  std::sort(places.begin(), places.end());
  order_.reserve(places.size());
  for (const auto& [place, triangle] : places) order_.push_back(triangle);
}

void CrossingSearch::buildTree() {
  if (order_.empty()) return;
  std::vector<Bounds> leaves((order_.size() + kLeaf - 1) / kLeaf);
  for (std::uint32_t i = 0; i < order_.size(); ++i) {
    const Corners3f t = corners(i);
    Bounds& leaf = leaves[i / kLeaf];
    const bool first = i % kLeaf == 0;
    leaf.min = first ? lowest(t) : leaf.min.cwiseMin(lowest(t));
    leaf.max = first ? highest(t) : leaf.max.cwiseMax(highest(t));
  }
  levels_.push_back(std::move(leaves));
  while (levels_.back().size() > 1) {
    const std::vector<Bounds>& below = levels_.back();
    std::vector<Bounds> level((below.size() + 1) / 2);
    for (std::size_t i = 0; i < level.size(); ++i) {
      const Bounds& other = below[std::min(2 * i + 1, below.size() - 1)];
      level[i] = {below[2 * i].min.cwiseMin(other.min), below[2 * i].max.cwiseMax(other.max)};
    }
    levels_.push_back(std::move(level));
  }
}

Corners3f CrossingSearch::corners(std::uint32_t place) const {
  const Triangle& t = triangles_[order_[place]];
  return {vertices_[t[0]], vertices_[t[1]], vertices_[t[2]]};
}

bool CrossingSearch::run(std::uint64_t work) {
  const std::uint64_t end = std::min(budget_, work_ + work);
  while (!pending_.empty() && work_ < end) {
    const NodePair pair = pending_.back();
    pending_.pop_back();
    visit(pair);
  }
  return done();
}

void CrossingSearch::visit(const NodePair& pair) {
  work_ += kVisitWork;
  if (pair.a != pair.b) {
    const Bounds& a = levels_[pair.level][pair.a];
    const Bounds& b = levels_[pair.level][pair.b];
    if ((a.min.array() > b.max.array()).any() || (b.min.array() > a.max.array()).any()) return;
  }
  if (pair.level == 0) {
    testLeaves(pair.a, pair.b);
  } else {
    descend(pair);
  }
}

void CrossingSearch::descend(const NodePair& pair) {
  const std::uint32_t level = pair.level - 1;
  const auto end = [&](std::uint32_t parent) {
    return std::min<std::uint32_t>(2 * parent + 2, static_cast<std::uint32_t>(levels_[level].size()));
  };
  for (std::uint32_t a = 2 * pair.a; a < end(pair.a); ++a) {
    for (std::uint32_t b = pair.a == pair.b ? a : 2 * pair.b; b < end(pair.b); ++b)
      pending_.push_back({level, a, b});
  }
}

void CrossingSearch::testLeaves(std::uint32_t a, std::uint32_t b) {
  const auto end = [&](std::uint32_t leaf) {
    return std::min<std::uint32_t>((leaf + 1) * kLeaf, static_cast<std::uint32_t>(order_.size()));
  };
  for (std::uint32_t i = a * kLeaf; i < end(a); ++i) {
    for (std::uint32_t j = a == b ? i + 1 : b * kLeaf; j < end(b); ++j) test(i, j);
  }
}

void CrossingSearch::test(std::uint32_t first, std::uint32_t second) {
  work_ += kBoxWork;
  const Corners3f a = corners(first);
  const Corners3f b = corners(second);
  if ((lowest(a).array() > highest(b).array()).any() || (lowest(b).array() > highest(a).array()).any())
    return;
  ExactCount exact = 0;
  if (cross(a, b, exact) && !sameCorners(a, b)) ++pairs_;
  work_ += kCrossWork + exact * kExactWork;
}

CrossingReport findCrossings(std::span<const Vec3f> vertices, std::span<const Triangle> triangles) {
  CrossingSearch search(vertices, triangles);
  search.run(CrossingSearch::budgetFor(triangles.size()));
  return search.report();
}

std::vector<std::string> describe(const CrossingReport& report) {
  const std::string stopped = " The search was stopped before its end: there may be more.";
  if (report.pairs == 0) {
    if (report.complete) return {};
    return {
        "No triangles that run through each other were found, but the search was stopped before its end."};
  }
  std::string text = report.complete ? "" : "At least ";
  text += report.pairs == 1 ? "1 pair of triangles runs"
                            : std::to_string(report.pairs) + " pairs of triangles run";
  text +=
      " through each other: all are felt, the outermost first, and what lies inside is out of reach; the "
      "mesh was left as it is.";
  return {report.complete ? text : text + stopped};
}

}  // namespace hapticd::geometry
