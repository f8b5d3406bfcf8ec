#include "realtime/render/facet.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace hapticd::realtime {
namespace {

using scene::TouchableFaces;

// Beside an edge the distance grows with the square of the overhang, so that a normal from it is precise to
// 1e-4 only.
constexpr double kFlat = 1 - 0.5e-8;
constexpr double kThinness = 1e-3;  // ratio of height to length below which the normal is corrected

// The side of a facet that faces the start of the path, and the heights of both ends above it.
struct Heights {
  double sign = 1;
  double start = 0;
  double end = 0;
};

inline bool touchableSide(const Facet& f, TouchableFaces faces, const Vec3& p, const Vec3& d, double limit,
                          Heights& h) {
  h.start = f.normal.dot(p - f.a);
  h.end = h.start + limit * f.normal.dot(d);
  const bool fromBack = faces == TouchableFaces::back || (faces == TouchableFaces::both && h.start < 0);
  if (fromBack && !f.unbounded) h = {-1.0, -h.start, -h.end};
  return h.start >= -0.5 * f.skin;
}

// Calls visit(outward, corner) for the sides of a facet, seen along its normal, until it returns false.
// `outward` has the length of the side.
template <class Visit>
inline bool forEachSide(const Facet& f, Visit&& visit) {
  return f.unbounded || (visit(f.outward[0], f.a) && visit(f.outward[1], f.b) && visit(f.outward[2], f.c));
}

// Whether the path from x to x + d passes outside one of the sides by more than the margin.
inline bool beyondSide(const Facet& f, const Vec3& x, const Vec3& d, double margin) {
  return !forEachSide(f, [&](const Vec3& outward, const Vec3& corner) {
    const double out = outward.dot(x - corner) + std::min(0.0, outward.dot(d));
    return !(out > 0 && out * out > margin * margin * outward.squaredNorm());
  });
}

// Whether both ends of the path from x to x + d are above the facet.
inline bool overFacet(const Facet& f, const Vec3& x, const Vec3& d) {
  return forEachSide(f, [&](const Vec3& outward, const Vec3& corner) {
    return outward.dot(x - corner) + std::max(0.0, outward.dot(d)) <= 0;
  });
}

// Whether the path from p to p + limit d stays farther than `clearance` from the half of the plane that ends
// at the side which p is beyond most, or from the whole plane. The facet is part of it.
inline bool staysClear(const Facet& f, const Vec3& p, const Vec3& d, double limit, double clearance) {
  double beyond2 = 0;
  double approach = 0;  // along that side's outward normal, for each unit of the parameter
  forEachSide(f, [&](const Vec3& outward, const Vec3& corner) {
    const double out = outward.dot(p - corner);
    const double length2 = outward.squaredNorm();
    if (!(out > 0 && out * out > beyond2 * length2)) return true;
    beyond2 = out * out / length2;
    approach = -outward.dot(d) / std::sqrt(length2);
    return true;
  });
  const double beyond = std::sqrt(beyond2);
  const double height = f.normal.dot(p - f.a);
  const double rise = f.normal.dot(d);
  // Beside the half-plane up to `over`, above it from there on.
  double over = beyond > 0 ? limit : 0;
  if (approach * limit > beyond) over = beyond / approach;
  const double speed2 = rise * rise + approach * approach;
  const double nearest = speed2 > 0 ? std::clamp((beyond * approach - height * rise) / speed2, 0.0, over) : 0;
  const double aside = beyond - nearest * approach;
  const double up = height + nearest * rise;
  if (!(aside * aside + up * up > clearance * clearance)) return false;
  const double begin = height + over * rise;
  const double end = height + limit * rise;
  return over == limit || (std::min(std::abs(begin), std::abs(end)) > clearance && begin * end > 0);
}

// The distance to a convex set is convex along a line: Newton's steps from the start never pass the first
// root, and without a negative slope there is none.
bool castBallAtEdges(const Facet& f, const Vec3& up, const Vec3& p, const Vec3& d, double limit,
                     double latest, CastHit& out) {
  const double standoff = f.radius + f.skin;
  const double contact = standoff - 0.5 * f.skin;
  const double fine = 1e-3 * f.skin;
  double t = 0;
  bool stopped = false;
  for (int i = 0; i < 32 && t <= (stopped ? limit : latest); ++i) {
    // Where the path grazes an edge, the steps become ever shorter.
    if (i == 1 && staysClear(f, p, d, limit, contact + 4 * fine)) return false;
    const Vec3 x = p + t * d;
    const Vec3 foot = nearestPointOf(f, x);
    const Vec3 away = x - foot;
    const double distance = away.norm();
    Vec3 n = distance > f.skin ? Vec3(away / distance) : up;
    if (n.dot(up) > kFlat) n = up;
    const double slope = n.dot(d);
    if (!stopped && distance <= standoff + fine) {
      out = {t, -slope, {n, foot, standoff}, n != up};
      stopped = true;
    }
    if (!(slope < 0)) return false;
    if (stopped && distance <= contact + fine) return true;
    t += (distance - (stopped ? contact : standoff)) / -slope;
  }
  return stopped && t <= limit;
}

}  // namespace

bool makeFacet(const scene::Corners& corners, double skin, Facet& f) noexcept {
  const double ab = (corners.b - corners.a).squaredNorm();
  const double bc = (corners.c - corners.b).squaredNorm();
  const double ca = (corners.a - corners.c).squaredNorm();
  double longest2 = ab;
  if (bc > ab && bc >= ca) {
    f.a = corners.b, f.b = corners.c, f.c = corners.a;
    longest2 = bc;
  } else if (ca > ab) {
    f.a = corners.c, f.b = corners.a, f.c = corners.b;
    longest2 = ca;
  } else {
    f.a = corners.a, f.b = corners.b, f.c = corners.c;
  }
  const Vec3 edge = f.b - f.a;
  Vec3 n = edge.cross(f.c - f.a);
  const double area2 = n.norm();
  if (!(area2 * area2 > skin * skin * longest2) || !std::isfinite(area2)) return false;
  n /= area2;
  if (area2 < kThinness * longest2) {
    // Let rounding turn the normal of a needle only about its long axis, where it does no harm.
    n -= edge * (n.dot(edge) / longest2);
    n.normalize();
  }
  f.normal = n;
  f.outward = {(f.b - f.a).cross(n), (f.c - f.b).cross(n), (f.a - f.c).cross(n)};
  f.extent = std::sqrt(std::max(0.25 * longest2, (f.c - 0.5 * (f.a + f.b)).squaredNorm()));
  f.skin = skin;
  return true;
}

Disc discAround(const scene::Corners& k) noexcept {
  Disc disc;
  disc.centre = (k.a + k.b + k.c) / 3;
  const double radius2 = std::max({(k.a - disc.centre).squaredNorm(), (k.b - disc.centre).squaredNorm(),
                                   (k.c - disc.centre).squaredNorm()});
  disc.radius = std::sqrt(radius2);
  const Vec3 normal = (k.b - k.a).cross(k.c - k.a);
  const double normal2 = normal.squaredNorm();
  if (normal2 > kThinness * kThinness * radius2 * radius2) disc.normal = normal / std::sqrt(normal2);
  return disc;
}

double distanceFrom(const Disc& disc, const Vec3& x) noexcept {
  const Vec3 offset = x - disc.centre;
  const double up = disc.normal.dot(offset);
  const double aside = std::sqrt(std::max(0.0, offset.squaredNorm() - up * up)) - disc.radius;
  return aside > 0 ? std::sqrt(up * up + aside * aside) : std::abs(up);
}

Vec3 nearestPointOf(const Facet& f, const Vec3& x) noexcept {
  if (f.unbounded) return x - f.normal * f.normal.dot(x - f.a);
  const Vec3 ab = f.b - f.a;
  const Vec3 ac = f.c - f.a;
  const Vec3 ax = x - f.a;
  const double d1 = ab.dot(ax);
  const double d2 = ac.dot(ax);
  if (d1 <= 0 && d2 <= 0) return f.a;
  const Vec3 bx = x - f.b;
  const double d3 = ab.dot(bx);
  const double d4 = ac.dot(bx);
  if (d3 >= 0 && d4 <= d3) return f.b;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return f.a + ab * (d1 / (d1 - d3));
  const Vec3 cx = x - f.c;
  const double d5 = ab.dot(cx);
  const double d6 = ac.dot(cx);
  if (d6 >= 0 && d5 <= d6) return f.c;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return f.a + ac * (d2 / (d2 - d6));
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 >= d3 && d5 >= d6) {
    return f.b + (f.c - f.b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
  }
  // Above the face, the foot of the perpendicular is more precise than barycentric weights.
  return x - f.normal * f.normal.dot(ax);
}

bool isTouchable(const Facet& f, TouchableFaces faces, const Vec3& p) noexcept {
  Heights h;
  return touchableSide(f, faces, p, Vec3::Zero(), 0, h);
}

bool castBall(const Facet& f, TouchableFaces faces, const Vec3& p, const Vec3& d, double limit, double latest,
              CastHit& out) noexcept {
  const double standoff = f.radius + f.skin;
  const double contact = standoff - 0.5 * f.skin;
  Heights h;
  if (!touchableSide(f, faces, p, d, limit, h)) return false;
  const double fall = (h.start - h.end) / limit;
  // A path that rises past the standoff may meet an edge before. With a margin, so that it does not depend on
  // rounding, and thus on which facet comes first, whether one that stops the path as early is seen.
  if (!(h.start < standoff) && !(h.start - latest * fall < standoff + 1e-3 * f.skin)) return false;
  if (beyondSide(f, p, latest * d, standoff)) return false;
  // Most paths end above the face itself.
  if (fall > 0 && h.end <= contact) {
    const double stop = std::max(0.0, (h.start - standoff) / fall);
    const double through = std::max(0.0, (h.start - contact) / fall);
    if (overFacet(f, p + stop * d, (through - stop) * d)) {
      out = {stop, fall, {h.sign * f.normal, f.a, standoff}, false};
      return true;
    }
  }
  return castBallAtEdges(f, h.sign * f.normal, p, d, limit, latest, out);
}

bool castPoint(const Facet& f, scene::TouchableFaces faces, const Vec3& p, const Vec3& d, double widening,
               double& stop) noexcept {
  Heights h;
  if (!touchableSide(f, faces, p, d, 1, h) || !(h.end < f.skin) || !(h.start > h.end)) return false;
  stop = std::max(0.0, (h.start - f.skin) / (h.start - h.end));
  const Vec3 x = p + stop * d;
  return (x - nearestPointOf(f, x)).norm() <= widening + f.skin;
}

}  // namespace hapticd::realtime
