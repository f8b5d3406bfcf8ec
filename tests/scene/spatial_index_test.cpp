// The index visits a superset of what is there: against brute force, on boxes and queries of every size.
#include "scene/spatial_index.h"

#include <gtest/gtest.h>

#include <rapidcheck/gtest.h>
#include <chrono>

#include <algorithm>
#include <limits>
#include <random>
#include <set>

#include "reduced.h"

namespace hapticd::scene {
namespace {

double distance(const Box& box, const Vec3& p) {
  return (p - p.cwiseMax(box.min).cwiseMin(box.max)).norm();
}

bool touches(const Box& box, const Vec3& from, const Vec3& to) {
  double begin = 0;
  double end = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const double d = to[axis] - from[axis];
    if (d == 0) {
      if (from[axis] < box.min[axis] || from[axis] > box.max[axis]) return false;
      continue;
    }
    const double a = (box.min[axis] - from[axis]) / d;
    const double b = (box.max[axis] - from[axis]) / d;
    begin = std::max(begin, std::min(a, b));
    end = std::min(end, std::max(a, b));
  }
  return begin <= end;
}

std::set<std::uint32_t> near(const SpatialIndex& index, const Vec3& centre, double radius) {
  std::set<std::uint32_t> ids;
  index.visitNear(centre, radius, [&](std::uint32_t id) { ids.insert(id); });
  return ids;
}

// The smallest distance within `radius`; Infinity when there is none.
double nearest(const SpatialIndex& index, const std::vector<Box>& boxes, const Vec3& centre, double radius) {
  double best = INFINITY;
  index.visitNearest(centre, radius, [&](std::uint32_t id) {
    best = std::min(best, distance(boxes[id], centre));
    return std::min(best, radius);
  });
  return best;
}

std::set<std::uint32_t> along(const SpatialIndex& index, const Vec3& from, const Vec3& to) {
  std::set<std::uint32_t> ids;
  index.visitSegment(from, to, [&](std::uint32_t id) {
    ids.insert(id);
    return 1.0;
  });
  return ids;
}

SpatialIndex indexOver(const std::vector<Box>& boxes) {
  return SpatialIndex::build(static_cast<std::uint32_t>(boxes.size()),
                             [&](std::uint32_t id) { return boxes[id]; });
}

// Sizes and places over many orders of magnitude, on a grid often enough that queries graze exactly.
struct World {
  std::mt19937_64 random;
  double size;
  Vec3 offset;

  explicit World(std::uint64_t seed) : random(seed) {
    size = std::pow(10.0, std::uniform_int_distribution<int>(-12, 12)(random));
    offset = size * std::pow(10.0, std::uniform_int_distribution<int>(-2, 5)(random)) * unit();
  }
  double coordinate() {
    const double x = std::uniform_real_distribution<double>(-1, 1)(random);
    return random() % 2 == 0 ? std::round(8 * x) / 8 : x;
  }
  Vec3 unit() { return {coordinate(), coordinate(), coordinate()}; }
  Vec3 point() { return offset + size * unit(); }
  Box box() {
    Box b;
    b.extend(point());
    const int kind = static_cast<int>(random() % 8);
    if (kind == 0) return b;                                      // a point
    if (kind == 1) return {};                                     // left out
    if (kind == 2) return {Vec3::Constant(std::nan("")), b.max};  // left out
    if (kind == 3) return {b.min, Vec3::Constant(INFINITY)};      // left out
    b.extend(Vec3(b.min + std::pow(10.0, -static_cast<int>(random() % 7)) * size * unit()));
    return b;
  }
  std::vector<Box> boxes(std::size_t count) {
    std::vector<Box> all(count);
    for (Box& b : all) b = box();
    return all;
  }
};

bool leftOut(const Box& b) {
  return b.empty() || !b.min.allFinite() || !b.max.allFinite();
}

void checkSuperset(const SpatialIndex& index, const std::vector<Box>& boxes, World& world) {
  for (int query = 0; query < 20; ++query) {
    const double far = query % 4 == 3 ? 1e5 : 1;
    const Vec3 p = world.offset + far * world.size * world.unit();
    Vec3 q = world.point();
    if (query % 5 == 1) q = p;
    if (query % 5 == 2) q = p + Vec3(world.size * 1e-9, 0, 0);
    if (query % 5 == 3 && !leftOut(boxes[0])) q = boxes[0].max;  // exactly at a corner
    const double radius = query % 5 == 0 ? 0 : (q - p).norm() * world.random() / 1.8e19;
    const auto foundNear = near(index, p, radius);
    const auto foundAlong = along(index, p, q);
    const double foundNearest = nearest(index, boxes, p, radius);
    for (std::uint32_t id = 0; id < boxes.size(); ++id) {
      if (leftOut(boxes[id])) {
        RC_ASSERT(foundNear.count(id) + foundAlong.count(id) == 0U);
        continue;
      }
      if (distance(boxes[id], p) <= radius) RC_ASSERT(foundNear.count(id) == 1U);
      if (distance(boxes[id], p) <= radius) RC_ASSERT(foundNearest <= distance(boxes[id], p));
      if (touches(boxes[id], p, q)) RC_ASSERT(foundAlong.count(id) == 1U);
    }
  }
}

RC_GTEST_PROP(SpatialIndex, VisitsAtLeastWhatIsThere, (std::uint64_t seed)) {
  World world(seed);
  const std::vector<Box> boxes = world.boxes(1 + world.random() % 200);
  checkSuperset(indexOver(boxes), boxes, world);
}

// Triangles over corners that have boxes; some triangles lack a corner, some corners a triangle.
class Sheet {
 public:
  explicit Sheet(World& world) {
    const auto corners = static_cast<std::uint32_t>(1 + world.random() % 100);
    lower_.resize(3 * corners + 1, std::numeric_limits<float>::max());
    upper_.resize(3 * corners + 1, std::numeric_limits<float>::lowest());
    for (std::size_t count = 1 + world.random() % 200; count > 0; --count) {
      Triangle t;
      for (std::uint32_t& corner : t) corner = static_cast<std::uint32_t>(world.random() % corners);
      if (world.random() % 8 == 0) t[world.random() % 3] = world.random() % 2 == 0 ? corners : 0xFFFFFFFF;
      triangles_.push_back(t);
    }
    place(world);
  }

  void place(World& world) {
    for (const Triangle& t : triangles_) {
      if (std::max({t[0], t[1], t[2]}) >= lower_.size() / 3) continue;
      for (const std::uint32_t corner : t) set(corner, world.box(), world.point());
    }
  }
  void move(const Vec3& by) {
    for (std::size_t i = 0; i + 1 < lower_.size(); ++i) {
      if (lower_[i] > upper_[i]) continue;
      lower_[i] += static_cast<float>(by[static_cast<Eigen::Index>(i % 3)]);
      upper_[i] += static_cast<float>(by[static_cast<Eigen::Index>(i % 3)]);
    }
  }

  BoxedTriangles boxed() const { return {triangles_, lower_, upper_}; }
  std::vector<Box> boxes() const {
    std::vector<Box> all(triangles_.size());
    for (std::size_t i = 0; i < all.size(); ++i) {
      const Triangle& t = triangles_[i];
      if (std::max({t[0], t[1], t[2]}) >= lower_.size() / 3) continue;
      for (const std::size_t corner : t) {
        all[i].extend(Box{{lower_[3 * corner], lower_[3 * corner + 1], lower_[3 * corner + 2]},
                          {upper_[3 * corner], upper_[3 * corner + 1], upper_[3 * corner + 2]}});
      }
    }
    return all;
  }

 private:
  void set(std::size_t corner, const Box& box, const Vec3& otherwise) {
    for (int axis = 0; axis < 3; ++axis) {
      const std::size_t at = 3 * corner + static_cast<std::size_t>(axis);
      lower_[at] = static_cast<float>(leftOut(box) ? otherwise[axis] : box.min[axis]);
      upper_[at] = static_cast<float>(leftOut(box) ? otherwise[axis] : box.max[axis]);
    }
  }
  std::vector<Triangle> triangles_;
  std::vector<float> lower_, upper_;
};

RC_GTEST_PROP(SpatialIndex, StillDoesAfterRefitting, (std::uint64_t seed)) {
  World world(seed);
  Sheet sheet(world);
  SpatialIndex index = SpatialIndex::build(sheet.boxed());
  for (int i = 0; i < 3; ++i) {
    if (world.random() % 2 == 0) {
      sheet.place(world);
    } else {
      sheet.move(world.size * world.unit());
    }
    index.refit(sheet.boxed());
    const std::vector<Box> boxes = sheet.boxes();
    const SpatialIndex built = SpatialIndex::build(sheet.boxed());
    const Box around = indexOver(boxes).bounds();
    for (const Box& bounds : {built.bounds(), around}) {
      RC_ASSERT(index.bounds().empty() == bounds.empty());
      if (bounds.empty()) continue;
      RC_ASSERT(index.bounds().min == bounds.min);  // who takes lengths from them needs the same bits
      RC_ASSERT(index.bounds().max == bounds.max);
    }
    checkSuperset(index, boxes, world);
  }
}

// Floats are not enough for them, so a new tree is built in doubles.
TEST(SpatialIndex, RefitsOfHugeAndTinyBoxesAreRight) {
  const std::vector<Triangle> triangles{{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, {3, 3, 3}, {4, 4, 4}, {5, 5, 5}};
  for (const float size : {3e38F, 1e32F, 1e-32F, 1e-38F, 1e-45F}) {
    std::vector<float> all(19);
    SpatialIndex index = SpatialIndex::build(BoxedTriangles{triangles, all, all});
    for (const float sign : {1.0F, -1.0F}) {
      for (std::size_t i = 0; i < 18; ++i) all[i] = i / 3 % 2 == 0 ? sign * size : -sign * size;
      index.refit({triangles, all, all});
      const auto found = near(index, Vec3::Constant(sign * size), 0);
      for (const std::uint32_t id : {0U, 2U, 4U}) EXPECT_EQ(found.count(id), 1U) << size << " " << id;
    }
  }
}

// The pad of a tree is a share of its size.
TEST(SpatialIndex, RefitsThatShrinkProposeFew) {
  constexpr std::uint32_t kCount = 1'000;
  std::vector<Triangle> triangles;
  for (std::uint32_t i = 0; i < kCount; ++i) triangles.push_back({i, i, i});
  const auto row = [](float step) {
    std::vector<float> all(3 * kCount + 1);
    for (std::size_t i = 0; i < kCount; ++i) all[3 * i] = step * static_cast<float>(i);
    return all;
  };
  const std::vector<float> kilometres = row(1e6F);
  const std::vector<float> millimetres = row(1);
  SpatialIndex index = SpatialIndex::build(BoxedTriangles{triangles, kilometres, kilometres});
  index.refit({triangles, millimetres, millimetres});
  const std::set<std::uint32_t> found = near(index, Vec3(500, 0, 0), 0.1);
  EXPECT_EQ(found.count(500), 1U);
  EXPECT_LE(found.size(), 16U);
}

TEST(SpatialIndex, RefitsAreCountedFromTheBuildOn) {
  World world(7);
  const Sheet sheet(world);
  SpatialIndex index = SpatialIndex::build(sheet.boxed());
  EXPECT_EQ(index.refits(), 0);
  index.refit(sheet.boxed());
  index.refit(sheet.boxed());
  EXPECT_EQ(index.refits(), 2);
}

TEST(SpatialIndex, OfNothingFindsNothing) {
  for (const SpatialIndex& index : {SpatialIndex(), indexOver({}), indexOver({Box{}, Box{}})}) {
    EXPECT_TRUE(index.bounds().empty());
    EXPECT_TRUE(near(index, Vec3::Zero(), 1e9).empty());
    EXPECT_TRUE(along(index, Vec3(-1, 0, 0), Vec3(1, 0, 0)).empty());
  }
}

TEST(SpatialIndex, QueriesThatAreNoNumbersFindNothingAndDoNotCrash) {
  const SpatialIndex index = indexOver({Box{Vec3(0, 0, 0), Vec3(1, 1, 1)}});
  const Vec3 nan = Vec3::Constant(std::nan(""));
  const Vec3 inf = Vec3::Constant(INFINITY);
  EXPECT_TRUE(near(index, nan, 1).empty());
  EXPECT_TRUE(near(index, Vec3::Zero(), std::nan("")).empty());
  EXPECT_EQ(near(index, Vec3::Zero(), INFINITY).size(), 1U);
  EXPECT_TRUE(along(index, nan, Vec3::Zero()).empty());
  EXPECT_TRUE(along(index, Vec3::Zero(), inf).empty());
  EXPECT_TRUE(along(index, inf, Vec3::Zero()).empty());
}

// Only a proposal, but not an idle one.
TEST(SpatialIndex, VisitsFewBoxesThatAreFarOff) {
  std::vector<Box> boxes;
  for (int x = 0; x < 100; ++x) {
    for (int y = 0; y < 100; ++y) boxes.push_back({Vec3(x, y, 0), Vec3(x + 0.9, y + 0.9, 0)});
  }
  const SpatialIndex index = indexOver(boxes);
  EXPECT_LE(near(index, Vec3(50.5, 50.5, 0), 0.1).size(), 16U);
  EXPECT_LE(along(index, Vec3(50.5, 50.5, 1), Vec3(50.5, 50.5, -1)).size(), 16U);
}

// A ball outside the bounds reaches little of them.
TEST(SpatialIndex, ABallOnASurfaceVisitsWhatItReaches) {
  std::vector<Box> boxes;
  for (int i = 0; i < 10'000; ++i) {
    const Vec3 corner(i % 100, i / 100, 0);
    boxes.push_back({corner, corner + Vec3(1, 1, 0)});
  }
  const SpatialIndex index = SpatialIndex::build(10'000, [&](std::uint32_t i) { return boxes[i]; });
  for (const Vec3& centre : {Vec3(50, 50, 40), Vec3(50, 50, -40), Vec3(-40, 50, 0), Vec3(-25, -31, 3)}) {
    const double radius = std::max(distance({Vec3(0, 0, 0), Vec3(100, 100, 0)}, centre), 39.8) + 0.2;
    const auto reached = static_cast<std::size_t>(std::count_if(
        boxes.begin(), boxes.end(), [&](const Box& box) { return distance(box, centre) <= radius; }));
    ASSERT_GT(reached, 0U);
    const std::set<std::uint32_t> visited = near(index, centre, radius);
    EXPECT_LE(visited.size(), 4 * reached + 64) << centre.transpose();
    for (std::uint32_t i = 0; i < boxes.size(); ++i)
      EXPECT_TRUE(distance(boxes[i], centre) > radius || visited.contains(i)) << i;
    int asked = 0;
    index.visitNearest(centre, radius, [&](std::uint32_t) {
      ++asked;
      return radius;
    });
    EXPECT_LE(asked, 4 * static_cast<int>(reached) + 64) << centre.transpose();
  }
}

// From any distance, and with a radius that just reaches them.
TEST(SpatialIndex, ACentreFarOffMissesNothing) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto point = [&] { return Vec3(unit(random), unit(random), unit(random)); };
  for (const double offset : {0.0, 3.0, 1000.0}) {
    std::vector<Box> boxes;
    for (int i = 0; i < 500; ++i) {
      const Vec3 corner = Vec3::Constant(offset) + point();
      boxes.push_back({corner, corner + 0.01 * point().cwiseAbs()});
    }
    const SpatialIndex index = indexOver(boxes);
    for (int i = 0; i < reduced(3000); ++i) {
      const double away = std::exp2(8 * unit(random) + 3);
      const Vec3 centre = Vec3::Constant(offset) + away * point();
      const double radius = distance(boxes[random() % boxes.size()], centre);
      const std::set<std::uint32_t> visited = near(index, centre, radius);
      for (std::uint32_t k = 0; k < boxes.size(); ++k)
        ASSERT_TRUE(distance(boxes[k], centre) > radius || visited.contains(k)) << away << " away";
    }
  }
}

TEST(SpatialIndex, SegmentIsCutAtTheAnswerAndTiesAreStillVisited) {
  std::vector<Box> boxes;
  for (int i = 0; i < 200; ++i) boxes.push_back({Vec3(i / 2, -1, -1), Vec3(i / 2, 1, 1)});  // in pairs
  const SpatialIndex index = indexOver(boxes);
  std::set<std::uint32_t> visited;
  double nearest = 1;
  index.visitSegment(Vec3(-10, 0, 0), Vec3(190, 0, 0), [&](std::uint32_t id) {
    visited.insert(id);
    nearest = std::min(nearest, (id / 2 + 10) / 200.0);
    return nearest;
  });
  EXPECT_EQ(nearest, 10 / 200.0);
  EXPECT_EQ(visited.count(0) + visited.count(1), 2U);
  EXPECT_LT(visited.size(), 50U);
}

TEST(SpatialIndex, MovedIndexAnswersLikeBefore) {
  SpatialIndex a = indexOver({Box{Vec3(0, 0, 0), Vec3(1, 1, 1)}});
  SpatialIndex b = std::move(a);
  EXPECT_EQ(near(b, Vec3(0.5, 0.5, 0.5), 0.1).size(), 1U);
  const std::vector<Triangle> triangle{{0, 0, 0}};
  b.refit({triangle, std::vector<float>(4, 5), std::vector<float>(4, 6)});
  EXPECT_TRUE(near(b, Vec3(0.5, 0.5, 0.5), 0.1).empty());
  EXPECT_EQ(near(b, Vec3(5.5, 5.5, 5.5), 0.1).size(), 1U);
}

// However many boxes are around the point: an attacker sends a million of them.
TEST(SpatialIndex, AQueryThatIsEndedExaminesNothingMore) {
  constexpr std::uint32_t kBoxes = 100'000;
  const SpatialIndex index = SpatialIndex::build(kBoxes, [](std::uint32_t i) {
    const double e = 1e-7 * i;
    return Box{Vec3(-1 - e, -1, -1 + e), Vec3(1, 1 + e, 1)};
  });
  const Vec3 p(0.1, 0, 0);
  int visits = 0;
  index.visitNearest(p, 0.01, [&](std::uint32_t) noexcept { return ++visits < 100 ? 0.01 : -1; });
  EXPECT_EQ(visits, 100);
  visits = 0;
  index.visitSegment(p, Vec3(0.2, 0, 0), [&](std::uint32_t) noexcept { return ++visits < 100 ? 1.0 : -1.0; });
  EXPECT_LT(visits, 120);
  // Calls that the caller does not see take time all the same.
  const auto timeOf = [&](int most) {
    auto least = std::chrono::steady_clock::duration::max();
    for (int i = 0; i < 5; ++i) {
      visits = 0;
      const auto begin = std::chrono::steady_clock::now();
      index.visitNear(p, 0.01, [&](std::uint32_t) noexcept -> bool { return ++visits < most; });
      least = std::min(least, std::chrono::steady_clock::now() - begin);
    }
    return least;
  };
  const auto all = timeOf(2 * kBoxes);
  EXPECT_EQ(visits, kBoxes);
  EXPECT_LT(20 * timeOf(100), all);
}

}  // namespace
}  // namespace hapticd::scene
