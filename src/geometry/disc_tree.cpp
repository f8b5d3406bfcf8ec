#include "geometry/disc_tree.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "geometry/space_curve.h"

namespace hapticd::geometry {
namespace {

constexpr float kRounding = 2e-6F;  // relative: more than the operations of a test add up to
// Of height to length: the corners are exact here, so that the normal of a needle is, too. Many needles are
// as long as the mesh; balls around them would rule out none.
constexpr double kThinness = 1e-6;

struct Placed {
  std::uint64_t key;
  std::uint32_t triangle;
};

struct CornersOf {
  std::span<const Vec3f> vertices;
  bool areUsable(const Triangle& t) const {
    return std::all_of(t.begin(), t.end(),
                       [&](std::uint32_t v) { return v < vertices.size() && vertices[v].allFinite(); });
  }
  Vec3 at(std::uint32_t v) const { return vertices[v].cast<double>(); }
  Vec3 middle(const Triangle& t) const { return (at(t[0]) + at(t[1]) + at(t[2])) / 3; }
};

// The usable triangles along the curve.
std::vector<Placed> ordered(const CornersOf& corners, std::span<const Triangle> triangles,
                            const std::vector<bool>& leftOut) {
  Box bounds;
  std::vector<Placed> order;
  order.reserve(triangles.size());
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    if ((!leftOut.empty() && leftOut[i]) || !corners.areUsable(triangles[i])) continue;
    bounds.extend(corners.middle(triangles[i]));
    order.push_back({0, static_cast<std::uint32_t>(i)});
  }
  const double size = order.empty() ? 0 : bounds.extents().maxCoeff();
  if (size == 0) return order;  // in one place
  for (Placed& placed : order) {
    placed.key = placeOnCurve((corners.middle(triangles[placed.triangle]) - bounds.min) / size);
  }
  std::sort(order.begin(), order.end(), [](const Placed& a, const Placed& b) {
    return a.key != b.key ? a.key < b.key : a.triangle < b.triangle;
  });
  return order;
}

unsigned maskOf(const std::array<float, 8>& misses) {
  unsigned mask = 0;
  // What is not a number may be near.
  for (unsigned i = 0; i < misses.size(); ++i) mask |= (misses[i] > 0 ? 0U : 1U) << i;
  return mask;
}

unsigned validOf(std::size_t count, std::size_t group) {
  const std::size_t left = count - 8 * group;
  return left >= 8 ? 0xFFU : (1U << left) - 1;
}

}  // namespace

struct DiscTree::Query {
  NearPath path;
  float perLength2;
  std::span<std::uint32_t> found;
  std::size_t count;
  int left;  // groups that may still be tested
  void giveUp() { count = found.size() + 1; }
};

struct DiscTree::FloatBox {
  Vec3f lower = Vec3f::Constant(std::numeric_limits<float>::infinity());
  Vec3f upper = Vec3f::Constant(-std::numeric_limits<float>::infinity());
};

DiscTree::DiscTree(std::span<const Vec3f> vertices, std::span<const Triangle> triangles,
                   const std::vector<bool>& leftOut) {
  const std::vector<Placed> order = ordered({vertices}, triangles, leftOut);
  if (order.empty()) return;
  triangles_.resize(order.size());
  discs_.resize(groupsFor(order.size()));
  std::vector<FloatBox> boxes(discs_.size());
  for (std::size_t place = 0; place < order.size(); ++place) {
    triangles_[place] = order[place].triangle;
    const Triangle& t = triangles[order[place].triangle];
    setDisc(place, vertices, t);
    FloatBox& box = boxes[place / kGroup];
    for (const std::uint32_t v : t) {
      box.lower = box.lower.cwiseMin(vertices[v]);
      box.upper = box.upper.cwiseMax(vertices[v]);
    }
  }
  buildLevels(std::move(boxes));
}

void DiscTree::setDisc(std::size_t place, std::span<const Vec3f> vertices, const Triangle& t) {
  const CornersOf corners{vertices};
  const Vec3 middle = corners.middle(t);
  const Vec3f centre = middle.cast<float>();
  const Vec3 a = corners.at(t[0]) - middle;
  const Vec3 b = corners.at(t[1]) - middle;
  const Vec3 c = corners.at(t[2]) - middle;
  const double radius2 = std::max({a.squaredNorm(), b.squaredNorm(), c.squaredNorm()});
  const Vec3 square = (b - a).cross(c - a);
  const double square2 = square.squaredNorm();
  Vec3f normal = Vec3f::Zero();
  if (square2 > kThinness * kThinness * radius2 * radius2)
    normal = (square / std::sqrt(square2)).cast<float>();
  DiscGroup& group = discs_[place / kGroup];
  const std::size_t i = place % kGroup;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    group.centre[axis][i] = centre[static_cast<int>(axis)];
    group.normal[axis][i] = normal[static_cast<int>(axis)];
  }
  const float error = kRounding * centre.cwiseAbs().maxCoeff();
  group.radius[i] = (1 + kRounding) * static_cast<float>(std::sqrt(radius2)) + error;
  rounding_ = std::max(rounding_, static_cast<double>(error));
}

void DiscTree::buildLevels(std::vector<FloatBox> boxes) {
  while (true) {
    Level level{std::vector<BoxGroup>(groupsFor(boxes.size())), boxes.size()};
    std::vector<FloatBox> above(level.groups.size());
    for (std::size_t k = 0; k < boxes.size(); ++k) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        level.groups[k / kGroup].lower[axis][k % kGroup] = boxes[k].lower[static_cast<int>(axis)];
        level.groups[k / kGroup].upper[axis][k % kGroup] = boxes[k].upper[static_cast<int>(axis)];
      }
      above[k / kGroup].lower = above[k / kGroup].lower.cwiseMin(boxes[k].lower);
      above[k / kGroup].upper = above[k / kGroup].upper.cwiseMax(boxes[k].upper);
    }
    levels_.push_back(std::move(level));
    if (above.size() == 1) return;
    boxes = std::move(above);
  }
}

unsigned DiscTree::near(const Query& query, const DiscGroup& group) noexcept {
  const auto& [cx, cy, cz] = group.centre;
  const auto& [nx, ny, nz] = group.normal;
  const NearPath& path = query.path;
  Column misses;
  for (std::size_t i = 0; i < kGroup; ++i) {
    misses[i] = missOfDisc(path, path.from.x() - cx[i], path.from.y() - cy[i], path.from.z() - cz[i], nx[i],
                           ny[i], nz[i], group.radius[i], kRounding);
  }
  return maskOf(misses);
}

// The box is behind the plane that touches it where it is nearest to the point of the segment that is nearest
// to its middle. How far the ends of the segment are before that plane is a lower bound.
unsigned DiscTree::near(const Query& query, const BoxGroup& group) noexcept {
  const auto& [lx, ly, lz] = group.lower;
  const auto& [ux, uy, uz] = group.upper;
  Column misses;
  for (std::size_t i = 0; i < kGroup; ++i) {
    const float along = ((0.5F * (lx[i] + ux[i]) - query.path.from.x()) * query.path.way.x() +
                         (0.5F * (ly[i] + uy[i]) - query.path.from.y()) * query.path.way.y() +
                         (0.5F * (lz[i] + uz[i]) - query.path.from.z()) * query.path.way.z()) *
                        query.perLength2;
    const float share = std::min(std::max(along, 0.0F), 1.0F);
    const float px = query.path.from.x() + share * query.path.way.x();
    const float py = query.path.from.y() + share * query.path.way.y();
    const float pz = query.path.from.z() + share * query.path.way.z();
    const float ax = px - std::min(std::max(px, lx[i]), ux[i]);
    const float ay = py - std::min(std::max(py, ly[i]), uy[i]);
    const float az = pz - std::min(std::max(pz, lz[i]), uz[i]);
    const float away2 = ax * ax + ay * ay + az * az;
    const float rise = ax * query.path.way.x() + ay * query.path.way.y() + az * query.path.way.z();
    const float lowest = away2 + std::min(-share * rise, (1 - share) * rise);  // times the distance
    misses[i] = lowest > 0 ? lowest * lowest - query.path.distance2 * away2 : 0.0F;
  }
  return maskOf(misses);
}

void DiscTree::descend(Query& query, std::size_t level, std::size_t group) const noexcept {
  if (--query.left < 0) return query.giveUp();
  const Level& boxes = levels_[level];
  unsigned mask = near(query, boxes.groups[group]) & validOf(boxes.count, group);
  for (; mask != 0; mask &= mask - 1) {
    const std::size_t child = kGroup * group + static_cast<std::size_t>(std::countr_zero(mask));
    if (level > 0) {
      descend(query, level - 1, child);
    } else {
      if (--query.left < 0) return query.giveUp();
      unsigned discs = near(query, discs_[child]) & validOf(triangles_.size(), child);
      for (; discs != 0 && query.count < query.found.size(); discs &= discs - 1) {
        query.found[query.count++] =
            static_cast<std::uint32_t>(kGroup * child + static_cast<std::size_t>(std::countr_zero(discs)));
      }
      if (discs != 0) query.giveUp();
    }
    if (query.count > query.found.size()) return;
  }
}

std::size_t DiscTree::findNear(const Vec3& from, const Vec3& way, double distance, int most,
                               std::span<std::uint32_t> found, int& groups) const noexcept {
  if (levels_.empty()) return 0;
  Query query{{from.cast<float>(), way.cast<float>(), 0, 0, 0}, 0, found, 0, most};
  query.path.length2 = query.path.way.squaredNorm();
  query.perLength2 = query.path.length2 > 0 ? 1 / query.path.length2 : 0;
  query.path.distance = (1 + kRounding) * static_cast<float>(distance + rounding_) +
                        kRounding * (query.path.from.cwiseAbs() + query.path.way.cwiseAbs()).maxCoeff();
  query.path.distance2 = query.path.distance * query.path.distance;
  descend(query, levels_.size() - 1, 0);
  groups += most - std::max(query.left, 0);
  return query.count;
}

}  // namespace hapticd::geometry
