// How the proxy goes on where the method of planes does not see the way: off a corner whose faces end there,
// and along what is round.
#include <algorithm>
#include <cmath>
#include <tuple>

#include "realtime/render/proxy.h"

namespace hapticd::realtime {
namespace {

constexpr double kTouching = 256;  // in skins: planes at their skins meet that far from a sharp corner
constexpr double kLifts[] = {4, 4 * kTouching};
constexpr double kMinDescent = 1e-3;  // of the pull; flatter ways end where they begin
constexpr double kClimb = 1e-3;       // of the radius

}  // namespace

// Ways down from a place among a few faces.
struct Proxy::Ways {
  static constexpr int kMaxFaces = 32;
  static constexpr int kMaxWays = 4 * kMaxFaces + 9;

  std::array<Facet, kMaxFaces> faces;  // copies: what is gathered changes on the way
  int faceCount = 0;
  std::array<Vec3, kMaxWays> ways;
  int count = 0;
  Vec3 out = Vec3::Zero();  // away from the faces

  void add(const Vec3& way, double shortest) {
    if (count < kMaxWays && way.norm() > shortest) ways[static_cast<std::size_t>(count++)] = way;
  }
};

// The faces that the tool touches, by their numbers, so that nothing depends on the order of visits.
void Proxy::findFaces(Ways& ways) noexcept {
  const auto before = [this](const Facet& a, const Facet& b) {
    return std::tuple(nearby_.object(a.object).state->id, a.triangle) <
           std::tuple(nearby_.object(b.object).state->id, b.triangle);
  };
  const double farthest = nearby_.toolRadius() + kTouching * nearby_.thickestSkin();
  nearby_.forEachGathered(position_, farthest, [&](const Facet& f) {
    const double touching = nearby_.toolRadius() + kTouching * f.skin;
    if (std::abs(f.normal.dot(position_ - f.a)) > touching) return;
    if ((position_ - nearestPointOf(f, position_)).norm() > touching) return;
    if (ways.faceCount == Ways::kMaxFaces && before(ways.faces.back(), f)) return;
    int k = ways.faceCount < Ways::kMaxFaces ? ways.faceCount++ : Ways::kMaxFaces - 1;
    for (; k > 0 && before(f, ways.faces[static_cast<std::size_t>(k - 1)]); --k) {
      ways.faces[static_cast<std::size_t>(k)] = ways.faces[static_cast<std::size_t>(k - 1)];
    }
    ways.faces[static_cast<std::size_t>(k)] = f;
  });
}

// The steepest way down in a room bounded by faces is the pull laid on a face, or an edge between two.
void Proxy::findWays(const Vec3& pull, const ActiveSet& active, Ways& ways) const noexcept {
  const double shortest = kMinDescent * pull.norm();
  const Vec3 p = position_;
  for (int i = 0; i < ways.faceCount; ++i) {
    const Facet& f = ways.faces[static_cast<std::size_t>(i)];
    const Vec3 foot = nearestPointOf(f, p);
    const Vec3 n = nearby_.toolRadius() > 0 ? Vec3((p - foot).normalized())
                                            : Vec3(f.normal.dot(p - f.a) < 0 ? -f.normal : f.normal);
    ways.out += n;
    ways.add(pull - n * n.dot(pull), shortest);
    const std::array<Vec3, 3> corners{f.a, f.b, f.c};
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 edge = (corners[(k + 1) % 3] - corners[k]).normalized();
      const bool onEdge = edge.cross(foot - corners[k]).norm() <= kTouching * f.skin;
      if (onEdge) ways.add(edge * edge.dot(pull), shortest);
    }
  }
  for (int i = 0; i < active.count; ++i) {
    const Vec3& n = active.hits[static_cast<std::size_t>(i)].plane.normal;
    ways.out += n;
    ways.add(pull - n * n.dot(pull), shortest);
    for (int k = 0; k < i; ++k) {
      const Vec3 along = n.cross(active.hits[static_cast<std::size_t>(k)].plane.normal);
      if (along.norm() > 0) ways.add(along * (along.dot(pull) / along.squaredNorm()), shortest);
    }
  }
  std::sort(ways.ways.begin(), ways.ways.begin() + ways.count, [](const Vec3& a, const Vec3& b) {
    return std::tuple(-a.squaredNorm(), a.x(), a.y(), a.z()) <
           std::tuple(-b.squaredNorm(), b.x(), b.y(), b.z());
  });
}

// How far, 0 … 1, the faces at hand leave the way free.
double Proxy::freeAmong(const Ways& ways, const Vec3& from, const Vec3& to) const noexcept {
  double free = 1;
  Hit hit;
  for (int i = 0; i < ways.faceCount; ++i) {
    if (nearby_.meets(ways.faces[static_cast<std::size_t>(i)], from, to, hit))
      free = std::min(free, hit.stop);
  }
  return free;
}

// Planes hold the proxy, but the faces of some of them may end where it is, and beyond there is room that no
// plane shows. Looks among the faces that really are there for a way that brings it nearer, and goes it.
bool Proxy::escape(const Vec3& target, const ActiveSet& active) noexcept {
  const double skin = nearby_.finestSkin();
  const Vec3 pull = target - position_;
  const double enough = pull.norm() - 2 * kLifts[0] * skin;
  if (!nearby_.gathered(position_)) nearby_.surround(position_, 1.5 * stride_m_ + kGatherMargin_m);
  if (!nearby_.gathered(position_)) return false;
  Ways ways;
  findFaces(ways);
  findWays(pull, active, ways);
  if (!(ways.out.norm() > 0)) return false;
  for (const double lift : kLifts) {
    const Vec3 start = position_ + lift * skin * ways.out.normalized();
    if (freeAmong(ways, position_, start) < 1) continue;
    for (int i = 0; i < ways.count && casts_ < kMaxCasts; ++i) {
      const Vec3& way = ways.ways[static_cast<std::size_t>(i)];
      const double free = freeAmong(ways, start, start + way);
      if (!((target - start - free * way).norm() < enough)) continue;
      Hit hit;
      ++casts_;
      if (nearby_.cast(position_, start, hit)) break;
      ++casts_;
      const Vec3 end = start + (nearby_.cast(start, start + way, hit) ? hit.stop : 1.0) * way;
      if (!((target - end).norm() < enough)) continue;
      position_ = end;
      return true;
    }
  }
  return false;
}

// A ball nears its rest on edges and corners in many small steps that point the same way: takes the last one
// again before the next approach, so that they double. The way is straight and the room is round: it may
// climb a little.
void Proxy::leap(const Vec3& stride, const Vec3& target) noexcept {
  const Vec3 pull = target - position_;
  const double farthest = pull.norm() + kClimb * nearby_.toolRadius();
  const double a = stride.squaredNorm();
  const double b = stride.dot(pull);
  const double c = pull.squaredNorm() - farthest * farthest;
  const Vec3 way = std::min((b + std::sqrt(b * b - a * c)) / a, 1.0) * stride;
  Hit hit;
  ++casts_;
  position_ += (nearby_.cast(position_, position_ + way, hit) ? hit.stop : 1.0) * way;
}

}  // namespace hapticd::realtime
