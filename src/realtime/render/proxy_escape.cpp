// Moves that half-spaces cannot show: past a corner where the faces end but their planes do not, and along
// round surfaces.
#include <algorithm>
#include <cmath>
#include <tuple>

#include "realtime/render/proxy.h"

namespace hapticd::realtime {
namespace {

constexpr double kTouching = 256;  // in skins: planes at their skins meet that far from a sharp corner
constexpr double kLifts[] = {4, 4 * kTouching};
constexpr double kLiftShare = 0.25;  // of the radius of a small ball
constexpr double kSmallBall_m =
    kLargestGapTolerance_m;           // its rounding is smaller than the places where faces end
constexpr double kMinDescent = 1e-3;  // share of the pull; flatter directions lead nowhere
constexpr double kClimb = 1e-3;       // share of the tool radius

// The smallest t, at least 0, for which t d comes within `distance` of x, or a little less; more than 1 when
// none in [0, 1] does.
double shareWithin(double distance, const Vec3& x, const Vec3& d) {
  const double a = d.squaredNorm();
  const double b = d.dot(x);
  const double c = x.squaredNorm() - distance * distance;
  constexpr double kRounding = 1e-9;
  if (c <= kRounding * x.squaredNorm()) return 0;
  const double discriminant = b * b - a * c;
  if (b <= 0 || discriminant < -kRounding * b * b) return 2;
  return (1 - 1e-3) * (b - std::sqrt(std::max(0.0, discriminant))) / a;
}

}  // namespace

// The faces that the proxy touches, and the directions in which it could come nearer to its target.
struct Proxy::DescentDirections {
  static constexpr int kMaxFaces = 32;
  static constexpr int kMaxDirections = 4 * kMaxFaces + 9;

  std::array<Facet, kMaxFaces> faces;  // copies: later casts may gather others
  int faceCount = 0;
  int lastBlocker = 0;
  std::array<Vec3, kMaxDirections> directions;
  int count = 0;
  Vec3 outward = Vec3::Zero();  // sum of the normals

  void add(const Vec3& direction, double shortest) {
    if (count < kMaxDirections && direction.norm() > shortest) {
      directions[static_cast<std::size_t>(count++)] = direction;
    }
  }
};

// How far from the proxy, beyond its radius, faces and edges may be that a corner is made of.
double Proxy::cornerSlack() const noexcept {
  const double rounding = query_.radius() <= kSmallBall_m ? query_.radius() : 0;
  return kTouching * query_.maxSkin() + rounding;
}

// Sorted by id, so that the result does not depend on the order of visits.
void Proxy::collectTouchedFaces(DescentDirections& descent) noexcept {
  const auto before = [this](const Facet& a, const Facet& b) {
    return std::tuple(query_.object(a.object).state->id, a.triangle) <
           std::tuple(query_.object(b.object).state->id, b.triangle);
  };
  const double slack = cornerSlack();
  const double farthest = query_.radius() + slack;
  query_.forEachGathered(position_, farthest, [&](const Facet& f) {
    const double touching = f.radius + slack;
    if (std::abs(f.normal.dot(position_ - f.a)) > touching) return;
    if ((position_ - nearestPointOf(f, position_)).norm() > touching) return;
    if (descent.faceCount == DescentDirections::kMaxFaces && before(descent.faces.back(), f)) return;
    int k = descent.faceCount < DescentDirections::kMaxFaces ? descent.faceCount++
                                                             : DescentDirections::kMaxFaces - 1;
    for (; k > 0 && before(f, descent.faces[static_cast<std::size_t>(k - 1)]); --k) {
      descent.faces[static_cast<std::size_t>(k)] = descent.faces[static_cast<std::size_t>(k - 1)];
    }
    descent.faces[static_cast<std::size_t>(k)] = f;
  });
}

// The direction of steepest descent among faces is the pull projected onto one face, or onto the edge between
// two.
void Proxy::findDescentDirections(const Vec3& pull, const ActiveSet& active,
                                  DescentDirections& descent) const noexcept {
  const double shortest = kMinDescent * pull.norm();
  const Vec3 p = position_;
  for (int i = 0; i < descent.faceCount; ++i) {
    const Facet& f = descent.faces[static_cast<std::size_t>(i)];
    const Vec3 foot = nearestPointOf(f, p);
    const Vec3 n = (p - foot).normalized();
    descent.outward += n;
    descent.add(pull - n * n.dot(pull), shortest);
    const std::array<Vec3, 3> corners{f.a, f.b, f.c};
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 edge = (corners[(k + 1) % 3] - corners[k]).normalized();
      const bool onEdge = edge.cross(foot - corners[k]).norm() <= cornerSlack();
      if (onEdge) descent.add(edge * edge.dot(pull), shortest);
    }
  }
  for (int i = 0; i < active.count; ++i) {
    const Vec3& n = active.hits[static_cast<std::size_t>(i)].halfSpace.normal;
    descent.outward += n;
    descent.add(pull - n * n.dot(pull), shortest);
    for (int k = 0; k < i; ++k) {
      const Vec3 along = n.cross(active.hits[static_cast<std::size_t>(k)].halfSpace.normal);
      if (along.norm() > 0) descent.add(along * (along.dot(pull) / along.squaredNorm()), shortest);
    }
  }
  std::sort(descent.directions.begin(), descent.directions.begin() + descent.count,
            [](const Vec3& a, const Vec3& b) {
              return std::tuple(-a.squaredNorm(), a.x(), a.y(), a.z()) <
                     std::tuple(-b.squaredNorm(), b.x(), b.y(), b.z());
            });
}

// The share, 0 … 1, of the path that the touched faces leave free; 0 when it is less than `enough`.
double Proxy::freeShare(DescentDirections& descent, const Vec3& from, const Vec3& to,
                        double enough) const noexcept {
  double free = 1;
  ObjectHit hit;
  const auto meet = [&](int i) {
    if (!query_.castAtFacet(descent.faces[static_cast<std::size_t>(i)], from, to, hit)) return true;
    free = std::min(free, hit.stop);
    if (free >= enough) return true;
    descent.lastBlocker = i;
    return false;
  };
  // The face that ended the last path often ends this one.
  if (descent.lastBlocker < descent.faceCount && !meet(descent.lastBlocker)) return 0;
  for (int i = 0; i < descent.faceCount; ++i) {
    if (i != descent.lastBlocker && !meet(i)) return 0;
  }
  return free;
}

// The half-spaces hold the proxy, but some of their faces may end at this corner, with free space beyond.
// Searches the touched faces for a free direction that brings the proxy nearer to the target, and moves along
// it.
bool Proxy::escapeCorner(const Vec3& target, const ActiveSet& active) noexcept {
  const double skin = query_.minSkin();
  const Vec3 pull = target - position_;
  const double enough = pull.norm() - 2 * kLifts[0] * skin;
  if (!query_.isGathered(position_)) {
    query_.ensureGathered(position_, 1.5 * expectedTravel_m_ + kGatherMargin_m);
  }
  if (!query_.isGathered(position_)) return false;
  DescentDirections descent;
  collectTouchedFaces(descent);
  findDescentDirections(pull, active, descent);
  if (!(descent.outward.norm() > 0)) return false;
  const double first = query_.radius() <= kSmallBall_m ? kLiftShare * query_.radius() : kLifts[0] * skin;
  for (const double lift : {first, kLifts[1] * skin}) {
    const Vec3 start = position_ + lift * descent.outward.normalized();
    if (freeShare(descent, position_, start, 1) < 1) continue;
    for (int i = 0; i < descent.count && casts_ < kMaxCasts; ++i) {
      const Vec3& direction = descent.directions[static_cast<std::size_t>(i)];
      const double needed = shareWithin(enough, target - start, direction);
      if (needed > 1) continue;
      const double free = freeShare(descent, start, start + direction, needed);
      if (!((target - start - free * direction).norm() < enough)) continue;
      ObjectHit hit;
      ++casts_;
      if (query_.cast(position_, start, hit)) break;
      ++casts_;
      const Vec3 end = start + (query_.cast(start, start + direction, hit) ? hit.stop : 1.0) * direction;
      if (!((target - end).norm() < enough)) continue;
      position_ = end;
      return true;
    }
  }
  return false;
}

// A ball converges on edges and corners in many small steps of one direction. Repeating the last step before
// the next approach doubles them. The step is straight and the free space is round, so it may climb a little.
void Proxy::extrapolateStep(const Vec3& step, const Vec3& target) noexcept {
  const Vec3 pull = target - position_;
  const double farthest = pull.norm() + kClimb * query_.radius();
  const double a = step.squaredNorm();
  const double b = step.dot(pull);
  const double c = pull.squaredNorm() - farthest * farthest;
  const Vec3 displacement = std::min((b + std::sqrt(b * b - a * c)) / a, 1.0) * step;
  ObjectHit hit;
  ++casts_;
  position_ += (query_.cast(position_, position_ + displacement, hit) ? hit.stop : 1.0) * displacement;
}

}  // namespace hapticd::realtime
