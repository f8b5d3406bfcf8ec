#include "realtime/render/stiffness_blend.h"

#include <algorithm>
#include <cmath>

#include "realtime/render/proxy.h"

namespace hapticd::realtime {
namespace {

constexpr double kSmallestWidth_m = 1e-3;
// Width per depth. The force stays below the stiffest spring's from 1.1 on. From sqrt(3) on, a proxy that
// runs over a convex edge between two surfaces never gains energy: the stiffer spring beyond the edge is
// shorter by more than it is stiffer.
constexpr double kWidthPerDepth = 1.75;
// Heights below the tangent plane count that many times. What the touched face hides, a floor below a sheet
// or the rest of a face that passes through it, lies far below; the next faces of a round surface do not.
constexpr double kHidden = 6;
constexpr double kHiddenExcess = kHidden * kHidden - 1;
constexpr double kFacing_m = 10e-6;  // a face that is lower than the proxy by less does not show its back
constexpr double kQueryMargin = 1 + 1e-6;  // covers the rounding of queries that change frames
constexpr double kSameDirection = 1e-7;    // |n1 x n2|^2 of faces that are one plane
constexpr Nanos kLately = base::toNanos(kLongestTick_s);
constexpr int kMaxStiffnesses = 16;
constexpr int kMaxNeighbours = 64;
constexpr int kMaxVisits = 4096;  // triangles in one search
constexpr int kWholeVisit = 8;    // of one that neither its box nor its height rules out
constexpr double kGaugeRounding_m = 1e-12;
constexpr std::size_t kFewObjects = 4;  // fewer than a query of the index would cost

// The nearest surface of one stiffness.
struct Neighbour {
  double stiffness = 0;
  double distance = 0;
  double share = 1;               // less for a plane that ramps out
  Vec3 offset = Vec3::Zero();     // of its point from the proxy
  std::int64_t triangle = kNone;  // that it is of, by object and number
  static constexpr std::int64_t kNone = -1;
};

// Distance of points from the proxy: as usual above the tangent plane, longer below it. It is convex, its
// derivative is continuous, and along the tangent plane it changes by at most one metre per metre. With a
// ball, the distance of its surface.
struct Gauge {
  Vec3 up;
  double radius;

  double below(const Vec3& offset) const { return std::min(0.0, up.dot(offset) + radius); }
  double length(const Vec3& offset) const {
    const double b = below(offset);
    return std::sqrt(offset.squaredNorm() + kHiddenExcess * b * b);
  }
  double operator()(const Vec3& offset) const { return length(offset) - radius; }
  // Of all points whose height above the proxy is at most this.
  double leastBelow(double height) const {
    const double b = std::min(0.0, height + radius);
    return b < 0 ? std::sqrt(height * height + kHiddenExcess * b * b) - radius : 0;
  }
  // Half the gradient of the squared length.
  Vec3 rise(const Vec3& offset) const { return offset + kHiddenExcess * below(offset) * up; }
};

Vec3 nearestOnSegment(const Vec3& a, const Vec3& b) {
  const Vec3 ab = b - a;
  const double length2 = ab.squaredNorm();
  if (!(length2 > 0)) return a;
  return a + std::clamp(-a.dot(ab) / length2, 0.0, 1.0) * ab;
}

// The point of a triangle nearest to the origin; the triangle may be a segment or a point.
Vec3 nearestToOrigin(const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 n = (b - a).cross(c - a);
  const double n2 = n.squaredNorm();
  if (n2 > 0 && n.dot(a.cross(b)) > 0 && n.dot(b.cross(c)) > 0 && n.dot(c.cross(a)) > 0) {
    return n * (n.dot(a) / n2);
  }
  Vec3 best = nearestOnSegment(a, b);
  for (const Vec3& other : {nearestOnSegment(b, c), nearestOnSegment(c, a)}) {
    if (other.squaredNorm() < best.squaredNorm()) best = other;
  }
  return best;
}

// A convex polygon with up to four corners: the part of a triangle on one side of the tangent plane.
struct Part {
  std::array<Vec3, 4> corners;
  int count = 0;

  void add(const Vec3& corner) {
    if (count < 4) corners[static_cast<std::size_t>(count++)] = corner;
  }
  Vec3 nearest() const {
    Vec3 best = corners[0];
    if (count == 2) best = nearestOnSegment(corners[0], corners[1]);
    for (std::size_t i = 2; i < static_cast<std::size_t>(count); ++i) {
      const Vec3 point = nearestToOrigin(corners[0], corners[i - 1], corners[i]);
      if (i == 2 || point.squaredNorm() < best.squaredNorm()) best = point;
    }
    return best;
  }
};

Part partOf(const std::array<Vec3, 3>& corners, const std::array<double, 3>& heights, double side) {
  Part part;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t k = (i + 1) % 3;
    if (side * heights[i] >= 0) part.add(corners[i]);
    if (heights[i] * heights[k] < 0) {
      part.add(corners[i] + heights[i] / (heights[i] - heights[k]) * (corners[k] - corners[i]));
    }
  }
  return part;
}

// The point of least gauge, in the part below the tangent plane or in all of the triangle. Below, the gauge
// is a distance in a stretched frame. False when there is no such point.
bool nearestInGauge(const Gauge& gauge, const std::array<Vec3, 3>& corners, bool belowOnly, Vec3& best) {
  std::array<double, 3> heights;
  for (std::size_t i = 0; i < 3; ++i) heights[i] = gauge.up.dot(corners[i]) + gauge.radius;
  const auto [lowest, highest] = std::minmax({heights[0], heights[1], heights[2]});
  if (lowest >= 0) {
    best = nearestToOrigin(corners[0], corners[1], corners[2]);
    return !belowOnly;
  }
  Part below = partOf(corners, heights, -1);
  const double shift = gauge.radius * kHiddenExcess / (1 + kHiddenExcess);
  for (Vec3& corner : below.corners) {
    const double height = gauge.up.dot(corner);
    corner += (kHidden * (height + shift) - height) * gauge.up;
  }
  best = below.nearest();
  const double stretched = gauge.up.dot(best);
  best += (stretched / kHidden - shift - stretched) * gauge.up;
  if (belowOnly || !(highest > 0)) return true;
  const Vec3 above = partOf(corners, heights, 1).nearest();
  if (gauge.length(above) < gauge.length(best)) best = above;
  return true;
}

Vec3 nearestInGauge(const Gauge& gauge, const Facet& plane, const Vec3& proxy) {
  const Vec3& n = plane.normal;
  const double height = n.dot(proxy - plane.a);
  const Vec3 foot = -height * n;
  if (gauge.below(foot) == 0) return foot;
  constexpr double kShare = kHiddenExcess / (1 + kHiddenExcess);
  const Vec3 centre = -kShare * gauge.radius * gauge.up;
  const Vec3 direction = n - kShare * gauge.up.dot(n) * gauge.up;
  return centre - (height + n.dot(centre)) / n.dot(direction) * direction;
}

// The derivative of the proxy's position by the HIP is the projection on what all touched faces leave free.
Vec3 alongContactSet(const ContactSet& contactSet, const Vec3& v) {
  const auto& c = contactSet.constraints;
  if (contactSet.count > 2) return Vec3::Zero();
  const Vec3& n = c[0].halfSpace.normal;
  if (contactSet.count == 2) {
    const Vec3 edge = n.cross(c[1].halfSpace.normal);
    const double length2 = edge.squaredNorm();
    // Faces of one plane act as one: the proxy is in their edge for less than a micrometre.
    if (length2 > kSameDirection) return edge * (edge.dot(v) / length2);
  }
  return v - n * n.dot(v);
}

class NeighbourSearch {
 public:
  NeighbourSearch(const SceneAtTime& now, const ContactQuery& query, double width, const Gauge& gauge,
                  const Vec3& proxy)
      : now_(now), query_(query), width_(width), gauge_(gauge), proxy_(proxy) {}

  void addTouched(const PlacedPlanes& planes, const ContactConstraint& constraint) {
    Neighbour* const n = neighbourOf(constraint.surface.stiffness_N_per_m);
    if (n == nullptr) return;
    const double share = constraint.source < 0 ? planes[-1 - constraint.source].share : 1;
    n->share = n->distance > 0 ? share : std::max(n->share, share);
    n->distance = 0;
  }
  void addPlanes(const PlacedPlanes& planes) {
    for (const PlacedPlane& plane : planes) {
      Neighbour* const n = neighbourOf(plane.state->surface.stiffness_N_per_m);
      if (n == nullptr || !(n->distance > 0)) continue;
      consider(*n, nearestInGauge(gauge_, plane.facet, proxy_), plane.share);
      rests_ = rests_ && (plane.rests || !(n->distance < width_));
    }
  }
  void addObjects();

  bool complete() const { return complete_; }
  bool rests() const { return rests_; }
  const Neighbour* begin() const { return neighbours_.data(); }
  const Neighbour* end() const { return neighbours_.data() + count_; }

 private:
  // Null when there is no room for another stiffness.
  Neighbour* neighbourOf(double stiffness) {
    Neighbour* const end = neighbours_.data() + count_;
    Neighbour* const known = std::find_if(
        neighbours_.data(), end, [stiffness](const Neighbour& n) { return n.stiffness == stiffness; });
    if (known != end) return known;
    if (count_ == kMaxStiffnesses) {
      complete_ = false;
      return nullptr;
    }
    ++count_;
    *known = {stiffness, width_, 1, Vec3::Zero(), Neighbour::kNone};
    return known;
  }
  bool isTouched(double stiffness) const {
    return std::any_of(begin(), end(), [stiffness](const Neighbour& n) {
      return n.stiffness == stiffness && n.distance == 0;
    });
  }
  bool mayTakePart(const scene::ObjectState& state) const {
    return !isTouched(state.surface.stiffness_N_per_m) && !query_.isLeftOut(state.id);
  }
  // Of two points at the same distance that of the lower number, for the order of visits is not defined.
  void consider(Neighbour& n, const Vec3& offset, double share,
                std::int64_t triangle = Neighbour::kNone) const {
    const double distance = std::max(0.0, gauge_(offset));
    if (!(distance < n.distance) && !(distance == n.distance && triangle < n.triangle)) return;
    n = {n.stiffness, distance, share, offset, triangle};
  }
  // A face that is turned away counts below the tangent plane: it may begin at a ridge.
  bool facesProxy(const Facet& f) const {
    const double height = f.normal.dot(proxy_ - f.a);
    if (now_.scene->faces == scene::TouchableFaces::both) return true;
    return (now_.scene->faces == scene::TouchableFaces::front ? height : -height) > -kFacing_m;
  }
  void addObject(const scene::ObjectState& state);

  const SceneAtTime& now_;
  const ContactQuery& query_;
  double width_;
  Gauge gauge_;
  const Vec3& proxy_;
  std::array<Neighbour, kMaxStiffnesses> neighbours_;
  int count_ = 0;
  int visits_ = 0;
  bool complete_ = true;
  bool rests_ = true;
};

void NeighbourSearch::addObjects() {
  const scene::SceneSnapshot& scene = *now_.scene;
  if (!scene.objectIndex || scene.objects.size() <= kFewObjects) {
    for (const auto& object : scene.objects) {
      if (mayTakePart(*object)) addObject(*object);
    }
    return;
  }
  std::array<std::uint32_t, kMaxNeighbours> found{};
  std::size_t count = 0;
  const Affine& T_world_device = scene.workspace.T_world_device;
  const double reach = (width_ + gauge_.radius) * kQueryMargin * stretchOf(T_world_device.linear());
  scene.objectIndex->visitNear(T_world_device * proxy_, reach, [&](std::uint32_t i) noexcept {
    if (!mayTakePart(*scene.objects[i])) return;
    if (count == found.size()) {
      complete_ = false;
    } else {
      found[count++] = i;
    }
  });
  // By id, so that a search that ends early does not depend on the order of visits.
  std::sort(found.begin(), found.begin() + count);
  for (std::size_t k = 0; k < count; ++k) addObject(*scene.objects[found[k]]);
}

void NeighbourSearch::addObject(const scene::ObjectState& state) {
  Neighbour* const n = neighbourOf(state.surface.stiffness_N_per_m);
  if (n == nullptr) return;
  PlacedObject placed;
  placed.state = &state;
  placed.T_device_object = now_.scene->workspace.T_device_world * state.motion.at(now_.time);
  const double determinant = placed.T_device_object.linear().determinant();
  if (determinant == 0 || !std::isfinite(determinant)) return;
  placed.mirrored = determinant < 0;
  const Affine T_object_device = placed.T_device_object.inverse();
  const double stretch = kQueryMargin * stretchOf(T_object_device.linear());
  const Vec3 proxy = T_object_device * proxy_;
  const auto reach = [&] { return (n->distance + gauge_.radius) * stretch; };
  const Vec3 up = placed.T_device_object.linear().transpose() * gauge_.up;
  const double base = gauge_.up.dot(placed.T_device_object.translation() - proxy_);
  const scene::SpatialIndex& index = state.mesh->indexAt(now_.time);
  index.visitNearest(proxy, reach(), [&](std::uint32_t triangle) noexcept {
    if (visits_ >= kMaxVisits) {
      complete_ = false;
      return -1.0;
    }
    ++visits_;
    const scene::Corners k = state.mesh->corners(triangle, now_.time);
    const double within = reach();
    const Vec3 away =
        (k.a.cwiseMin(k.b).cwiseMin(k.c) - proxy).cwiseMax(proxy - k.a.cwiseMax(k.b).cwiseMax(k.c));
    if (away.cwiseMax(0.0).squaredNorm() > within * within) return within;
    const double highest = base + std::max({up.dot(k.a), up.dot(k.b), up.dot(k.c)});
    if (gauge_.leastBelow(highest) > n->distance + kGaugeRounding_m) return within;
    visits_ += kWholeVisit - 1;
    Facet f;
    if (!makeFacet(placed.corners(triangle, now_.time), 0, f)) return reach();
    Vec3 offset;
    if (nearestInGauge(gauge_, {f.a - proxy_, f.b - proxy_, f.c - proxy_}, !facesProxy(f), offset)) {
      consider(*n, offset, 1, (std::int64_t{state.id} << 32) + triangle);
    }
    return reach();
  });
  const Nanos lately = now_.time - kLately;
  const bool moves = state.motion.movingAfter(lately) || state.mesh->deformingAfter(lately);
  rests_ = rests_ && !(moves && n->distance < width_);
}

// The weight of a surface at distance t * width: 1 at 0, 0 at 1, and between two surfaces
// kappa = K_1 + (K_2 - K_1) s with s = 1/2 (1 - 3 t^2 + 2 t^3). s has no slope at either end, so the force
// has no step where a second surface is touched or leaves the width.
struct Weight {
  double value;
  double slope;  // by t

  explicit Weight(double t) {
    const double s = 0.5 * (1 - t * t * (3 - 2 * t));
    value = s / (1 - s);
    slope = -3 * t * (1 - t) / ((1 - s) * (1 - s));
  }
};

struct Width {
  double value;
  double growth;  // by the distance between HIP and proxy

  explicit Width(double distance) {
    const double part = kWidthPerDepth * distance;
    value = std::sqrt(kSmallestWidth_m * kSmallestWidth_m + part * part);
    growth = kWidthPerDepth * part / value;
  }
};

// With t = rho / w and m = growth d / w < 1, two surfaces K and K + D give the force
//   d (K + D x) along the spring, x = s + 3/2 t^2 (1 - t) m <= 1/2 + 2/9,
//   d |D| y along the face, y <= 3/2 t (1 - t) sqrt(m) / c.
// The stiffer spring bounds the sum if y^2 <= 2 x - x^2: that is the case D = -K, and smaller |D| follow.
// 2 x - x^2 >= 1.28 x >= 1.9 t^2 (1 - t) m, and y^2 <= 2.25 / c^2 t^2 (1 - t) m.
// More than two unequal surfaces at one place can exceed the bound: limit() scales the force there.
void limit(double stiffest, const Vec3& spring, BlendedSpring& out) {
  const double allowed = stiffest * spring.norm();
  const double force = (out.stiffness_N_per_m * spring + out.slope_N + out.turn_N).norm();
  if (!(force > allowed * (1 + 1e-12))) return;
  const double share = allowed / force;
  out.stiffness_N_per_m *= share;
  out.slope_N *= share;
  out.turn_N *= share;
}

void combine(const NeighbourSearch& search, const Gauge& gauge, const Width& width,
             const ContactSet& contactSet, BlendedSpring& out) {
  double sum = 0;
  double weights = 0;
  double stiffest = 0;
  for (const Neighbour& n : search) {
    const double weight = n.share * Weight(n.distance / width.value).value;
    sum += weight * n.stiffness;
    weights += weight;
    if (weight > 0) stiffest = std::max(stiffest, n.stiffness);
  }
  if (!(weights > 0)) return;
  const double kappa = sum / weights;
  const Vec3 spring = contactSet.normal_m + contactSet.lateral_m;
  const double distance = spring.norm();
  const double depth = contactSet.normal_m.norm();
  Vec3 byPosition = Vec3::Zero();
  Vec3 byDirection = Vec3::Zero();
  double byDistance = 0;
  for (const Neighbour& n : search) {
    const double t = n.distance / width.value;
    if (!(t > 0 && t < 1)) continue;
    const double slope = n.share * (n.stiffness - kappa) / weights * Weight(t).slope / width.value;
    const double length = gauge.length(n.offset);
    byPosition -= slope / length * gauge.rise(n.offset);
    byDistance -= slope * t * width.growth;
    const double turn = kHiddenExcess * gauge.below(n.offset) / (length * depth);
    byDirection += slope * turn * (n.offset - gauge.up * gauge.up.dot(n.offset));
  }
  const double half = 0.5 * distance * distance;
  out.kappa_N_per_m = kappa;
  out.stiffness_N_per_m = kappa + 0.5 * distance * byDistance;
  out.slope_N = -half * alongContactSet(contactSet, byPosition);
  out.turn_N = half * (byDirection - alongContactSet(contactSet, byDirection));
  if (contactSet.count == 1) out.turn_N.setZero();  // the direction is fixed
  limit(stiffest, spring, out);
}

}  // namespace

BlendedSpring blendedSpring(const SceneAtTime& now, const ContactQuery& query, const PlacedPlanes& planes,
                            double toolRadius_m, const Vec3& proxy, const ContactSet& contactSet) noexcept {
  BlendedSpring out;
  const ContactConstraint& first = contactSet.constraints[0];
  out.stiffness_N_per_m = first.surface.stiffness_N_per_m;
  out.kappa_N_per_m = out.stiffness_N_per_m;
  const double depth = contactSet.normal_m.norm();
  if (!(depth > 0)) return out;
  const Gauge gauge{contactSet.normal_m / depth, toolRadius_m};
  const Width width((contactSet.normal_m + contactSet.lateral_m).norm());
  NeighbourSearch search(now, query, width.value, gauge, proxy);
  for (int i = 0; i < contactSet.count; ++i) {
    search.addTouched(planes, contactSet.constraints[static_cast<std::size_t>(i)]);
  }
  search.addPlanes(planes);
  search.addObjects();
  out.complete = search.complete();
  out.rests = search.rests();
  if (search.end() - search.begin() > 1) combine(search, gauge, width, contactSet, out);
  return out;
}

double blendReach(double toolRadius_m, const ContactSet& contactSet) noexcept {
  return Width((contactSet.normal_m + contactSet.lateral_m).norm()).value + toolRadius_m;
}

}  // namespace hapticd::realtime
