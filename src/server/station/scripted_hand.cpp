#include "server/station/scripted_hand.h"

#include <cmath>
#include <numbers>
#include <optional>

#include "base/time.h"
#include "geometry/rotation.h"

namespace hapticd::server {
namespace {

using base::Nanos;
using geometry::Affine;
using geometry::Box;
using geometry::Quat;
using geometry::Vec3;

constexpr double kPressDepth_m = 0.004;  // target below the surface; the hand's spring reaches part of it
constexpr double kClearance_m = 0.012;   // above the surface before and after a stroke
constexpr double kSlideSpeed_m_per_s = 0.06;
constexpr double kFreeSpeed_m_per_s = 0.15;
constexpr int kStrokes = 12;
constexpr int kPointsInStroke = 7;
constexpr double kLongestStep_m = 0.025;  // between the lift-off positions of neighbouring points of a stroke
constexpr double kSteepest = 0.3;  // lower bound of the cosine between surface normal and approach direction
constexpr double kStrokeAngle_rad = 0.12;  // between neighbouring points of a stroke, seen from the centre

struct SurfacePoint {
  Vec3 position;
  Vec3 normal;  // outward, against the approach direction
};

Box boundsInDevice(const scene::SceneSnapshot& scene, Nanos now) {
  Box box;
  for (const auto& object : scene.objects) {
    const Affine T_device_object = scene.workspace.T_device_world * object->motion.at(now);
    const Box& own = object->mesh->index.bounds();
    if (own.empty()) continue;
    for (int corner = 0; corner < 8; ++corner) {
      box.extend(Vec3(T_device_object * Vec3((corner & 1) ? own.max.x() : own.min.x(),
                                             (corner & 2) ? own.max.y() : own.min.y(),
                                             (corner & 4) ? own.max.z() : own.min.z())));
    }
  }
  return box;
}

// First surface on the segment from `from` to `to`. For planning only, so an inexact test is sufficient.
std::optional<SurfacePoint> firstSurface(const scene::SceneSnapshot& scene, const Vec3& from, const Vec3& to,
                                         Nanos now) {
  double best = 1.0;
  std::optional<SurfacePoint> found;
  for (const auto& object : scene.objects) {
    const Affine T_device_object = scene.workspace.T_device_world * object->motion.at(now);
    const Affine T_object_device = T_device_object.inverse();
    object->mesh->index.visitSegment(T_object_device * from, T_object_device * to, [&](std::uint32_t id) {
      const scene::Corners local = object->mesh->corners(id, now);
      const Vec3 a = T_device_object * local.a;
      const Vec3 edge1 = T_device_object * local.b - a;
      const Vec3 edge2 = T_device_object * local.c - a;
      const Vec3 direction = to - from;
      const Vec3 p = direction.cross(edge2);
      const double determinant = edge1.dot(p);
      if (determinant == 0) return best;
      const Vec3 s = from - a;
      const double u = s.dot(p) / determinant;
      const Vec3 q = s.cross(edge1);
      const double v = direction.dot(q) / determinant;
      const double t = edge2.dot(q) / determinant;
      if (u < 0 || v < 0 || u + v > 1 || t < 0 || t >= best) return best;
      best = t;
      Vec3 normal = edge1.cross(edge2).normalized();
      if (normal.dot(direction) > 0) normal = -normal;
      found = SurfacePoint{from + t * direction, normal};
      return best;
    });
  }
  return found;
}

// Appends waypoints to a path, with times from the speed.
class PathBuilder {
 public:
  explicit PathBuilder(const Vec3& start) { path_.push_back({0, start, Quat::Identity(), 0}); }

  void moveTo(const Vec3& position, const Quat& orientation, double speed_m_per_s, bool press = false) {
    const double distance = (position - path_.back().position_m).norm();
    const double time = path_.back().time_s + std::max(distance / speed_m_per_s, 0.05);
    path_.push_back({time, position, orientation, press ? 1U : 0U});
  }
  // On a great circle around the centre: a straight line could cross the objects.
  void arcTo(const Vec3& position, const Vec3& centre, const Quat& orientation) {
    const Vec3 from = path_.back().position_m - centre;
    const Quat turn = geometry::rotationBetween(from, position - centre);
    const double angle = Eigen::AngleAxisd(turn).angle();
    const int steps = 1 + static_cast<int>(angle / 0.3);
    for (int i = 1; i <= steps; ++i) {
      const double s = static_cast<double>(i) / steps;
      moveTo(centre + Quat::Identity().slerp(s, turn) * from, orientation, kFreeSpeed_m_per_s);
    }
  }
  std::vector<device::Waypoint> take() { return std::move(path_); }

 private:
  std::vector<device::Waypoint> path_;
};

std::vector<device::Waypoint> idleCircle(const Box& workspace) {
  constexpr int kSteps = 32;
  // At the top of the workspace: clients place objects in the middle, and a mesh that appears around the hand
  // would trap it.
  const double radius = 0.1 * workspace.extents().minCoeff();
  const Vec3 centre = workspace.centre() + Vec3(0, 0.5 * workspace.extents().y() - radius, 0);
  PathBuilder path(centre + Vec3(radius, 0, 0));
  for (int i = 1; i <= kSteps; ++i) {
    const double angle = 2 * std::numbers::pi * i / kSteps;
    const Quat turn(Eigen::AngleAxisd(0.3 * std::sin(angle), Vec3::UnitX()));
    path.moveTo(centre + radius * Vec3(std::cos(angle), 0, std::sin(angle)), turn, 0.05, i == kSteps / 2);
  }
  return path.take();
}

// Fibonacci sphere: evenly distributed directions; consecutive ones are far apart.
Vec3 direction(int i, int count) {
  const double y = 1 - 2 * (i + 0.5) / count;
  const double radius = std::sqrt(1 - y * y);
  const double turn = i * std::numbers::pi * (3 - std::sqrt(5.0));
  return {radius * std::cos(turn), y, radius * std::sin(turn)};
}

}  // namespace

std::vector<device::Waypoint> planStrokes(const scene::SceneSnapshot& scene, const Box& workspace_m,
                                          Nanos now) {
  const Box bounds = boundsInDevice(scene, now);
  if (bounds.empty()) return idleCircle(workspace_m);
  const Vec3 centre = bounds.centre();
  const double outside = 0.5 * bounds.extents().norm() + kClearance_m;

  const Vec3 home = centre + outside * Vec3::UnitY();
  PathBuilder path(home);
  for (int stroke = 0; stroke < kStrokes; ++stroke) {
    const Vec3 first = direction(stroke, kStrokes);
    const Vec3 along = first.unitOrthogonal();
    const Quat stylus = geometry::rotationBetween(Vec3::UnitY(), (first + 0.4 * along).normalized());
    bool down = false;
    Vec3 liftOff = centre + outside * first;
    path.arcTo(liftOff, centre, stylus);
    for (int i = 0; i < kPointsInStroke; ++i) {
      const Vec3 ray = Eigen::AngleAxisd(kStrokeAngle_rad * i, first.cross(along)) * first;
      const auto surface = firstSurface(scene, centre + outside * ray, centre - outside * ray, now);
      if (!surface || surface->normal.dot(ray) < kSteepest) break;
      // The next point is on another part of the object: a straight line to it may cross this part.
      if (down && (surface->position - liftOff).norm() > kLongestStep_m) break;
      if (!down) path.moveTo(surface->position + kClearance_m * ray, stylus, kFreeSpeed_m_per_s);
      path.moveTo(surface->position - kPressDepth_m * surface->normal, stylus, kSlideSpeed_m_per_s,
                  i == 2 && stroke % 3 == 0);
      liftOff = surface->position + kClearance_m * surface->normal;
      down = true;
    }
    if (down) path.moveTo(liftOff, stylus, kSlideSpeed_m_per_s);
    path.moveTo(centre + outside * (liftOff - centre).normalized(), stylus, kFreeSpeed_m_per_s);
  }
  path.arcTo(home, centre, Quat::Identity());
  return path.take();
}

}  // namespace hapticd::server
