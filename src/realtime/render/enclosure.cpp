#include "realtime/render/enclosure.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace hapticd::realtime {
namespace {

// Three lines in both directions, oblique to the axes and diagonals along which meshes are built.
const std::array<Vec3, 3> kLines{Vec3(0.7312, 0.4419, 0.5196), Vec3(-0.4871, 0.8163, 0.3103),
                                 Vec3(0.2957, -0.4217, 0.8572)};
constexpr int kRays = 2 * static_cast<int>(kLines.size());
// More, all around, so that the way out of a cup or a pocket is not missed: an opening of 5 % of what is seen
// from the point is found in 24 of 25 cases.
constexpr int kMoreRays = 58;

Vec3 rayAlong(int ray) noexcept {
  if (ray < kRays) return (ray % 2 == 0 ? 1.0 : -1.0) * kLines[static_cast<std::size_t>(ray / 2)];
  // Points of a spiral on the sphere, each a golden angle farther.
  const double height = 1 - (2.0 * (ray - kRays) + 1) / kMoreRays;
  const double angle = (3 - std::sqrt(5.0)) * M_PI * ray;
  const double away = std::sqrt(1 - height * height);
  return {away * std::cos(angle), away * std::sin(angle), height};
}

// Whether the segment from p to p + d crosses the triangle: 1 when it leaves through the front, -1 when it
// enters, 0 when it misses (Moeller and Trumbore 1997).
int crossing(const scene::Corners& t, const Vec3& p, const Vec3& d) noexcept {
  const Vec3 ab = t.b - t.a;
  const Vec3 ac = t.c - t.a;
  const Vec3 h = d.cross(ac);
  const double determinant = ab.dot(h);
  if (determinant == 0) return 0;
  const Vec3 s = (p - t.a) / determinant;
  const double u = s.dot(h);
  if (!(u >= 0 && u <= 1)) return 0;
  const Vec3 q = s.cross(ab);
  const double v = d.dot(q);
  if (!(v >= 0 && u + v <= 1)) return 0;
  const double along = ac.dot(q);
  if (!(along >= 0 && along <= 1)) return 0;
  return determinant < 0 ? 1 : -1;
}

// A test in the frame of the object, where a mirrored placement does not reverse the winding.
class Test {
 public:
  Test(const PlacedObject& object, scene::TouchableFaces faces, Nanos now, const Vec3& p,
       EnclosureBudget& budget) noexcept
      : object_(object),
        mesh_(*object.state->mesh),
        faces_(faces),
        now_(now),
        p_(object.T_object_device * p),
        budget_(budget) {
    const geometry::Box& box = mesh_.index.bounds();
    reach_ = 1.5 * (box.extents().norm() + (p_ - box.centre()).norm());
    isInBox_ = (p_.array() >= box.min.array()).all() && (p_.array() <= box.max.array()).all();
  }

  bool isInBox() const noexcept { return isInBox_; }
  bool isSpent() const noexcept { return budget_.visits <= 0; }

  bool enclosedAlong(int ray) noexcept {
    if (isSpent()) return true;
    budget_.visits -= EnclosureBudget::kRayVisits;
    const Vec3 d = reach_ * rayAlong(ray);
    int sum = 0;
    mesh_.indexAt(now_).visitSegment(p_, p_ + d, [&](std::uint32_t triangle) noexcept {
      if (--budget_.visits <= 0) return -1.0;
      sum += crossing(mesh_.corners(triangle, now_), p_, d);
      return 1.0;
    });
    const bool behind = faces_ == scene::TouchableFaces::front  ? sum > 0
                        : faces_ == scene::TouchableFaces::back ? sum < 0
                                                                : sum != 0;
    return behind || isSpent();
  }

  bool isWithin(double radius_m) noexcept {
    if (radius_m == 0) return false;
    if (isSpent()) return true;
    bool within = false;
    const Vec3 at = object_.T_device_object * p_;
    mesh_.indexAt(now_).visitNear(p_, radius_m * object_.stretch,
                                  [&](std::uint32_t triangle) noexcept -> bool {
                                    if (--budget_.visits <= 0) return false;
                                    Facet facet;
                                    if (!makeFacet(object_.corners(triangle, now_), object_.skin, facet))
                                      return true;
                                    within = (nearestPointOf(facet, at) - at).norm() < radius_m;
                                    return !within;
                                  });
    return within || isSpent();
  }

 private:
  const PlacedObject& object_;
  const scene::MeshGeometry& mesh_;
  scene::TouchableFaces faces_;
  Nanos now_;
  Vec3 p_;
  EnclosureBudget& budget_;
  double reach_ = 0;
  bool isInBox_ = false;
};

}  // namespace

bool encloses(const PlacedObject& object, scene::TouchableFaces faces, Nanos now, const Vec3& p,
              double toolRadius_m, EnclosureBudget& budget) noexcept {
  Test test(object, faces, now, p, budget);
  bool inside = test.isInBox();
  for (int ray = 0; ray < kRays + kMoreRays && inside; ++ray) inside = test.enclosedAlong(ray);
  return inside || test.isWithin(toolRadius_m);
}

bool isClear(const PlacedObject& object, Nanos now, const Vec3& p, double toolRadius_m,
             EnclosureBudget& budget) noexcept {
  Test test(object, scene::TouchableFaces::both, now, p, budget);
  int unequal = 0;  // one ray may meet an edge, and both of its faces or none
  for (int ray = 0; ray < kRays + kMoreRays && unequal <= 1; ++ray)
    unequal += test.enclosedAlong(ray) ? 1 : 0;
  return unequal <= 1 && !test.isWithin(toolRadius_m) && !test.isSpent();
}

bool hasLeft(const PlacedObject& object, scene::TouchableFaces faces, Nanos now, const Vec3& p,
             double toolRadius_m, EnclosureBudget& budget) noexcept {
  Test test(object, faces, now, p, budget);
  int enclosing = 0;
  for (int ray = 0; ray < kRays && test.isInBox(); ++ray) enclosing += test.enclosedAlong(ray) ? 1 : 0;
  return enclosing <= 2 && !test.isWithin(toolRadius_m) && !test.isSpent();
}

}  // namespace hapticd::realtime
