// Moves that half-spaces cannot show: past a corner where the faces end but their planes do not, and along
// round surfaces.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <new>
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
// Of a tick, for the search out of corners. At a vertex of very many faces it takes several ticks.
constexpr int kMaxSearchVisits = 512;

// Beside a vertex; lengths in radii of the small ball.
constexpr double kVertexLift = 4;        // valleys of 90 degrees need that
constexpr double kOnPlane = 0.9;         // a ball at this height lies on the face
constexpr double kInPlane = 1e-2;        // share of a direction along the normal of a face that it lies in
constexpr double kAlong = 0.1;           // how far a way may be from the face that it runs along
constexpr double kSamePlane = 1 - 1e-6;  // cosine between normals

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

// A face, and the place where the proxy touches it.
struct Proxy::TouchedFace {
  Facet face;  // a copy: later casts may gather others
  Vec3 foot = Vec3::Zero();
  Vec3 away = Vec3::Zero();  // unit, from the foot to the proxy
  double blocked2 = 0;       // see prepareStart()

  /// Whether the face surely stops a path to `end`: the distance from it is convex along the path.
  bool surelyBlocks(const Vec3& end) const {
    return (end - nearestPointOf(face, end)).squaredNorm() < blocked2;
  }
};

// The faces that the proxy touches, and the directions in which it could come nearer to its target.
struct Proxy::DescentDirections {
  static constexpr int kMaxFaces = 32;
  static constexpr int kMaxLearned = 16;
  static constexpr int kMaxDirections = 4 * kMaxFaces + 9;

  // Room for the faces; insert() and learn() make them. Making all of them took a third of the search.
  alignas(TouchedFace) std::array<std::byte, (kMaxFaces + kMaxLearned) * sizeof(TouchedFace)> room;
  std::array<std::uint8_t, kMaxFaces + kMaxLearned> order{};  // of the faces
  int faceCount = 0;
  int lastBlocker = 0;
  int learned = 0;  // faces after those, which blocked a path and are not among them
  int next = 0;     // the direction at which descendFrom() ended
  std::array<Vec3, kMaxDirections> directions;
  int count = 0;
  Vec3 outward = Vec3::Zero();  // sum of the normals

  int blockers() const { return faceCount + learned; }
  void* at(std::size_t place) { return &room[place * sizeof(TouchedFace)]; }
  TouchedFace& operator[](int i) {
    return *std::launder(static_cast<TouchedFace*>(at(order[static_cast<std::size_t>(i)])));
  }
  TouchedFace& insert(int i) {
    const bool full = faceCount == kMaxFaces;
    const std::uint8_t place = full ? order[kMaxFaces - 1] : static_cast<std::uint8_t>(faceCount++);
    std::copy_backward(order.begin() + i, order.begin() + faceCount - 1, order.begin() + faceCount);
    order[static_cast<std::size_t>(i)] = place;
    return *::new (at(place)) TouchedFace;
  }
  TouchedFace& learn() {
    const int place = kMaxFaces + learned++;
    order[static_cast<std::size_t>(blockers() - 1)] = static_cast<std::uint8_t>(place);
    return *::new (at(static_cast<std::size_t>(place))) TouchedFace;
  }
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
    const bool full = descent.faceCount == DescentDirections::kMaxFaces;
    if (full && before(descent[descent.faceCount - 1].face, f)) return;
    const Vec3 foot = nearestPointOf(f, position_);
    if ((position_ - foot).norm() > touching) return;
    int k = full ? DescentDirections::kMaxFaces - 1 : descent.faceCount;
    while (k > 0 && before(f, descent[k - 1].face)) --k;
    descent.insert(k) = {f, foot, (position_ - foot).normalized(), 0};
  });
}

// The direction of steepest descent among faces is the pull projected onto one face, or onto the edge between
// two.
void Proxy::findDescentDirections(const Vec3& pull, const ActiveSet& active,
                                  DescentDirections& descent) const noexcept {
  const double shortest = kMinDescent * pull.norm();
  for (int i = 0; i < descent.faceCount; ++i) {
    const Facet& f = descent[i].face;
    const Vec3& foot = descent[i].foot;
    const Vec3& n = descent[i].away;
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
  const auto end = descent.directions.begin() + descent.count;
  std::sort(descent.directions.begin(), end, [](const Vec3& a, const Vec3& b) {
    return std::tuple(-a.squaredNorm(), a.x(), a.y(), a.z()) <
           std::tuple(-b.squaredNorm(), b.x(), b.y(), b.z());
  });
  // Two faces share an edge.
  descent.count = static_cast<int>(std::unique(descent.directions.begin(), end) - descent.directions.begin());
}

// Paths from `start` that end nearer to the face than a radius are not free. This holds only where the tool
// does not overlap the face at the start, and is not behind it.
void Proxy::prepareStart(TouchedFace& touched, const Vec3& start) const noexcept {
  const Facet& f = touched.face;
  const double height = touched.away.dot(start - touched.foot);
  const double blocked = std::max(0.0, f.radius - 0.5 * f.skin);
  const bool holds = height > f.radius + 0.75 * f.skin && isTouchable(f, query_.faces(), start);
  touched.blocked2 = holds ? blocked * blocked : 0;
}

// Whether a touched face surely stops a path from the prepared start on its way to `end`.
bool Proxy::isSurelyBlocked(DescentDirections& descent, const Vec3& direction, const Vec3& end) noexcept {
  // The face that the path enters most steeply often stops it, and the one that stopped the last path.
  int steepest = 0;
  double slope = 0;
  for (int i = 0; i < descent.blockers(); ++i) {
    const TouchedFace& touched = descent[i];
    if ((end - touched.foot).squaredNorm() < touched.blocked2) return true;
    const double s = touched.away.dot(direction);
    if (s >= slope) continue;
    slope = s;
    steepest = i;
  }
  const auto blocks = [&](int i) {
    if (i >= descent.blockers()) return false;
    query_.countTests(1);
    if (!descent[i].surelyBlocks(end)) return false;
    descent.lastBlocker = i;
    return true;
  };
  if (blocks(steepest) || blocks(descent.lastBlocker)) return true;
  for (int i = 0; i < descent.blockers(); ++i) {
    if (blocks(i)) return true;
  }
  return false;
}

// The share, 0 … 1, of the path that the touched faces leave free; 0 when it is less than `enough`.
double Proxy::freeShare(DescentDirections& descent, const Vec3& from, const Vec3& to,
                        double enough) const noexcept {
  double free = 1;
  ObjectHit hit;
  for (int i = 0; i < descent.blockers(); ++i) {
    if (query_.castAtFacet(descent[i].face, from, to, hit)) free = std::min(free, hit.stop);
    if (free < enough) return 0;
  }
  return free;
}

// Whether the tool can take the first `share` of the path. A face that is in the way and is not among the
// touched ones joins them: it often ends the next paths, too.
bool Proxy::isFree(DescentDirections& descent, const Vec3& from, const Vec3& to, double share,
                   const Vec3& start) noexcept {
  ObjectHit hit;
  ++casts_;
  if (!query_.castUpTo(share, from, to, hit)) return true;
  if (hit.unexamined || descent.learned == DescentDirections::kMaxLearned) return false;
  const Facet* const blocker = query_.gatheredFacet(hit.object, hit.triangle);
  if (blocker == nullptr) return false;
  const Vec3 foot = nearestPointOf(*blocker, position_);
  TouchedFace& touched = descent.learn();
  touched = {*blocker, foot, (position_ - foot).normalized(), 0};
  prepareStart(touched, start);
  return false;
}

// Moves to `start` and on in the first of the directions from `first` on whose way is free and ends nearer to
// the target than `enough`.
bool Proxy::descendFrom(const Vec3& start, int first, int last, const Vec3& target, double enough,
                        DescentDirections& descent) noexcept {
  if (freeShare(descent, position_, start, 1) < 1) return false;
  for (int i = 0; i < descent.blockers(); ++i) prepareStart(descent[i], start);
  bool lifted = false;
  for (int& i = descent.next = first; i < last && casts_ < kMaxCasts && !searchSpent(); ++i) {
    const Vec3& direction = descent.directions[static_cast<std::size_t>(i)];
    const double needed = shareWithin(enough, target - start, direction);
    if (needed > 1 || isSurelyBlocked(descent, direction, start + needed * direction)) continue;
    const double free = freeShare(descent, start, start + direction, needed);
    if (!((target - start - free * direction).norm() < enough)) continue;
    if (!lifted && !isFree(descent, position_, start, 1, start)) return false;
    lifted = true;
    if (needed > 0 && !isFree(descent, start, start + direction, needed, start)) continue;
    ObjectHit hit;
    ++casts_;
    const Vec3 end = start + (query_.cast(start, start + direction, hit) ? hit.stop : 1.0) * direction;
    if (!((target - end).norm() < enough)) continue;
    position_ = end;
    return true;
  }
  return false;
}

// The search of this tick has used its share of the work.
bool Proxy::searchSpent() const noexcept {
  return search_.visits + query_.visits() - search_.begin >= kMaxSearchVisits;
}

// The half-spaces hold the proxy, but some of their faces may end at this corner, with free space beyond.
// Searches the touched faces for a free direction that brings the proxy nearer to the target, and moves along
// it.
bool Proxy::escapeCorner(const Vec3& target, const ActiveSet& active) noexcept {
  search_.begin = query_.visits();
  const bool found = searchDescent(target, active);
  if (found || !searchSpent()) search_.stage = search_.direction = 0;
  search_.visits += query_.visits() - search_.begin;
  return found;
}

bool Proxy::searchDescent(const Vec3& target, const ActiveSet& active) noexcept {
  const double skin = query_.minSkin();
  const double radius = query_.radius();
  const Vec3 pull = target - position_;
  const double enough = pull.norm() - 2 * kLifts[0] * skin;
  if (!query_.isGathered(position_)) {
    const double reach = 1.5 * expectedTravel_m_ + kGatherMargin_m;
    query_.ensureGathered(position_, reach);
    // What was gathered before may cover that with the proxy at its rim.
    if (!query_.isGathered(position_)) query_.gather(position_, reach);
  }
  if (!query_.isGathered(position_) || query_.workSpent()) return false;
  DescentDirections descent;
  collectTouchedFaces(descent);
  findDescentDirections(pull, active, descent);
  if (!(descent.outward.norm() > 0)) return false;
  const Vec3 outward = descent.outward.normalized();
  const std::array lifts{radius <= kSmallBall_m ? kLiftShare * radius : kLifts[0] * skin, kLifts[1] * skin};
  for (; search_.stage < 2; ++search_.stage, search_.direction = 0) {
    const Vec3 start = position_ + lifts[static_cast<std::size_t>(search_.stage)] * outward;
    if (descendFrom(start, search_.direction, descent.count, target, enough, descent)) return true;
    search_.direction = descent.next;
    if (searchSpent()) return false;
  }
  return radius <= kSmallBall_m && active.count == kMaxActive && passVertex(target, enough, descent);
}

// A ball that three planes hold may have to climb by about its own size to a way on which the point that it
// stands for slides: along a face that begins at a vertex of theirs, or along an edge between two. For each
// such way it is lifted away from all faces, or to either side of those of the way: of one face, alone and
// together with each of the others.
bool Proxy::passVertex(const Vec3& target, double enough, DescentDirections& descent) noexcept {
  const double radius = query_.radius();
  const int faces = descent.faceCount;
  bool begins = false;
  for (int i = 0; i < faces && !begins; ++i) {
    const Facet& f = descent[i].face;
    begins = std::abs(f.normal.dot(position_ - f.a)) < kOnPlane * radius;
  }
  if (!begins) return false;
  // The ball touches the vertex: down the faces themselves, not along what is square to the way to it.
  const Vec3 pull = target - position_;
  for (int i = 0; i < faces; ++i) {
    const Vec3& n = descent[i].face.normal;
    descent.add(pull - n * n.dot(pull), kMinDescent * pull.norm());
  }
  const Vec3 away = position_ + radius * descent.outward.normalized();
  for (int& i = search_.direction; i < descent.count && !searchSpent(); ++i) {
    const Vec3 direction = descent.directions[static_cast<std::size_t>(i)].normalized();
    const auto holdsWay = [&](int k) {
      const Facet& f = descent[k].face;
      if (std::abs(f.normal.dot(direction)) > kInPlane) return false;
      const Vec3 along = descent[k].foot + radius * direction;
      return (along - nearestPointOf(f, along)).norm() <= kAlong * radius;
    };
    const auto descend = [&](const Vec3& start) {
      return descendFrom(start, i, i + 1, target, enough, descent);
    };
    const auto lift = [&](const Vec3& up) {
      return descend(position_ + kVertexLift * radius * up.normalized());
    };
    const auto liftOffBoth = [&](const Vec3& n, const Vec3& m) {
      return lift(n + m) || lift(m - n) || lift(n - m) || lift(-n - m);
    };
    int first = 0;
    while (first < faces && !holdsWay(first)) ++first;
    if (first == faces) continue;
    if (descend(away)) return true;
    const Vec3 n = descent[first].face.normal;
    const auto isBeside = [&](int k) { return std::abs(n.dot(descent[k].face.normal)) <= kSamePlane; };
    int second = first + 1;
    while (second < faces && !(isBeside(second) && holdsWay(second))) ++second;
    if (second < faces) {
      if (liftOffBoth(n, descent[second].face.normal)) return true;
      continue;
    }
    if (lift(n) || lift(-n)) return true;
    for (int k = 0; k < faces && !searchSpent(); ++k) {
      if (isBeside(k) && liftOffBoth(n, descent[k].face.normal)) return true;
    }
  }
  return false;
}

// A ball converges on edges and corners in many small steps of one direction. Repeating the last step before
// the next approach doubles them. The step is straight and the free space is round, so it may climb a little.
void Proxy::extrapolateStep(const Vec3& step, const Vec3& target, const ActiveSet& active) noexcept {
  constexpr double kSideways = 1e-6;
  const Vec3 pull = target - position_;
  const double farthest = pull.norm() + kClimb * query_.radius();
  const double a = step.squaredNorm();
  const double b = step.dot(pull);
  // On one face there is no nearer place; where the slide ended at its edge, the next approach goes on.
  const bool onFace = active.count == 1 && !active.hits[0].atEdge;
  if (onFace && std::abs(b) <= kSideways * step.norm() * pull.norm()) return;
  const double c = pull.squaredNorm() - farthest * farthest;
  const Vec3 displacement = std::min((b + std::sqrt(b * b - a * c)) / a, 1.0) * step;
  ObjectHit hit;
  ++casts_;
  position_ += (query_.cast(position_, position_ + displacement, hit) ? hit.stop : 1.0) * displacement;
}

}  // namespace hapticd::realtime
