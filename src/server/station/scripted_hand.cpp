#include "server/station/scripted_hand.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>

#include "base/time.h"
#include "device/simulated/simulated_device.h"
#include "geometry/rotation.h"
#include "realtime/render/renderer.h"

namespace hapticd::server {
namespace {

using base::Nanos;
using geometry::Affine;
using geometry::Box;
using geometry::Quat;
using geometry::Vec3;

constexpr int kStrokes = 14;
constexpr int kAttempts = 8;             // approaches that are tried for each stroke
constexpr double kPressDepth_m = 0.004;  // target below the surface; the hand's spring reaches part of it
constexpr double kThinShare = 0.4;       // of the thickness below the surface, where that is less
constexpr double kClearance_m = 0.012;   // above the surface before a stroke, and around everything
constexpr double kLift_m = 0.003;  // above the surface: what must be free between two points of a stroke
constexpr double kStep_m = 0.003;  // between neighbouring points of a stroke
constexpr double kLongestStroke_m = 0.1;
constexpr std::size_t kShortestStroke = 5;  // points; shorter ones are taken only for want of others
constexpr double kSlideSpeed_m_per_s = 0.06;
constexpr double kFreeSpeed_m_per_s = 0.15;
constexpr double kSteepest = 0.5;  // lower bound of the cosine between surface normal and approach
constexpr double kLag_m = 0.0035;  // of the hand behind the path: more, and something holds it back
constexpr Nanos kRehearsedTick = 2'000'000;
// In all, three times what fourteen strokes take that succeed at once: about half a second, more where many
// objects move.
constexpr int kRehearsedTicks = 120'000;
constexpr double kMargin_m = 0.004;  // of surface around each point: near a border the hand slips behind it
constexpr double kSharpest = 0.77;   // lower bound of the cosine between normals of neighbouring points
constexpr double kCurl_rad = 0.05;   // turn of the heading from point to point
constexpr double kSmallObject_m = 0.06;   // diagonal below which steps and depths shrink with the object
constexpr double kAboveSurface_m = 2e-5;  // start of a segment that must not hit the surface it starts from

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

// Plans single strokes over what is in a scene.
class StrokePlanner {
 public:
  StrokePlanner(const scene::SceneSnapshot& scene, const Box& bounds, Nanos now)
      : scene_(scene),
        now_(now),
        centre_(bounds.centre()),
        outside_(0.5 * bounds.extents().norm() + kClearance_m),
        size_(std::min(1.0, bounds.extents().norm() / kSmallObject_m)) {}

  /// Where the surface is met from `start`, a point on the sphere around everything, on the way to `target`;
  /// nothing where it is too steep to press on, or where there is no way out.
  std::optional<SurfacePoint> approach(const Vec3& start, const Vec3& target, bool roomy) const {
    const Vec3 way = (target - start).normalized();
    const auto found = first(start, start + 2 * outside_ * way);
    if (!found || found->normal.dot(-way) < kSteepest || (roomy && !goesOn(*found)) || !wayOut(*found))
      return std::nullopt;
    return found;
  }

  /// Follows the surface like a finger: straight over it with a slow turn, and to another side in front of an
  /// edge, a wall or a place without a way out. Starts with `from`.
  std::vector<SurfacePoint> stroke(const SurfacePoint& from, Vec3 heading, bool roomy) const {
    static constexpr double kTurns_rad[] = {0, 0.9, -0.9, 1.8, -1.8};
    std::vector<SurfacePoint> points{from};
    const int most = static_cast<int>(kLongestStroke_m / kStep_m);
    while (static_cast<int>(points.size()) < most) {
      const SurfacePoint& last = points.back();
      heading -= heading.dot(last.normal) * last.normal;
      if (heading.norm() < 1e-9) heading = last.normal.unitOrthogonal();
      heading.normalize();
      std::optional<SurfacePoint> next;
      Vec3 chosen;
      for (const double turn : kTurns_rad) {
        chosen = Eigen::AngleAxisd(turn + kCurl_rad, last.normal) * heading;
        next = step(last, chosen, roomy);
        if (next) break;
      }
      if (!next) break;
      heading = chosen;
      points.push_back(*next);
    }
    return points;
  }

  /// A straight way from the surface to the sphere around everything: its end on the sphere.
  std::optional<Vec3> wayOut(const SurfacePoint& at) const {
    const Vec3 radial = (at.position - centre_).normalized();
    for (const Vec3& way : {at.normal, Vec3((at.normal + radial).normalized()), radial}) {
      if (!way.allFinite() || way.dot(at.normal) < kSteepest) continue;
      const Vec3 from = at.position - centre_;
      const double along = from.dot(way);
      const double inside = outside_ * outside_ - from.squaredNorm() + along * along;
      const Vec3 end = at.position + (std::sqrt(std::max(inside, 0.0)) - along) * way;
      if (!first(at.position + kAboveSurface_m * at.normal, end)) return end;
    }
    return std::nullopt;
  }

  /// How far below the surface the hand aims: less where the object is thin.
  double pressDepth(const SurfacePoint& at) const {
    const double depth = size_ * kPressDepth_m;
    const auto behind =
        first(at.position - kAboveSurface_m * at.normal, at.position - depth / kThinShare * at.normal);
    return behind ? std::min(depth, kThinShare * (behind->position - at.position).norm()) : depth;
  }

  const Vec3& centre() const { return centre_; }
  double outside() const { return outside_; }
  double size() const { return size_; }

 private:
  std::optional<SurfacePoint> first(const Vec3& from, const Vec3& to) const {
    return firstSurface(scene_, from, to, now_);
  }

  // Whether the surface goes on around a point.
  bool goesOn(const SurfacePoint& at) const {
    const double margin = size_ * kMargin_m;
    const Vec3 u = margin * at.normal.unitOrthogonal();
    const Vec3 v = at.normal.cross(u);
    for (const Vec3& side : {u, v, Vec3(-u), Vec3(-v)}) {
      const Vec3 above = at.position + side + margin * at.normal;
      if (!first(above, above - 2 * margin * at.normal)) return false;
    }
    return true;
  }

  std::optional<SurfacePoint> step(const SurfacePoint& from, const Vec3& heading, bool roomy) const {
    const double lift = size_ * kLift_m;
    const Vec3 above = from.position + size_ * kStep_m * heading + lift * from.normal;
    if (first(from.position + lift * from.normal, above)) return std::nullopt;
    auto next = first(above, above - 2 * lift * from.normal);
    if (!next || next->normal.dot(from.normal) < kSharpest || (roomy && !goesOn(*next)) || !wayOut(*next))
      return std::nullopt;
    return next;
  }

  const scene::SceneSnapshot& scene_;
  const Nanos now_;
  const Vec3 centre_;
  const double outside_;
  const double size_;  // 1, less for small objects
};

// Appends waypoints to a path, with times from the speed.
class PathBuilder {
 public:
  explicit PathBuilder(const Vec3& start) { path_.push_back({0, start, Quat::Identity(), 0}); }

  void moveTo(const Vec3& position, const Quat& orientation, double speed_m_per_s, bool press = false) {
    const double distance = (position - path_.back().position_m).norm();
    const double time = path_.back().time_s + std::max(distance / speed_m_per_s, 0.05);
    path_.push_back({time, position, orientation, press ? 1U : 0U});
  }
  // Comes to rest: the hand would swing out of a sharp turn.
  void rest() {
    device::Waypoint still = path_.back();
    still.time_s += 0.05;
    path_.push_back(still);
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
  /// Waypoints from the present position on.
  void append(const std::vector<device::Waypoint>& more) {
    const double offset = path_.back().time_s - more.front().time_s;
    for (auto waypoint = more.begin() + 1; waypoint != more.end(); ++waypoint) {
      path_.push_back(*waypoint);
      path_.back().time_s += offset;
    }
  }
  std::vector<device::Waypoint> take() { return std::move(path_); }

 private:
  std::vector<device::Waypoint> path_;
};

// Feels a path over the scene as the hand will, and returns the time at which it is held back from it, by a
// rim, a gap or another part in front; nothing when it can follow. Counts its ticks down.
std::optional<double> heldBackAt(const std::vector<device::Waypoint>& path, const scene::SceneSnapshot& scene,
                                 Nanos now, int& ticks) {
  const auto way =
      std::make_shared<device::WaypointPath>(path, device::WaypointPath::Repeat::no, kScriptedStrength_N);
  device::SimulatedDevice hand;
  hand.open();
  hand.setPath(way);
  realtime::Renderer renderer;
  realtime::Rendering rendering;
  device::DeviceState state;
  for (Nanos t = 0; t < way->duration(); t += kRehearsedTick, --ticks) {
    hand.read(t, state);
    if ((state.position_m - way->at(t).position_m).norm() > kLag_m)
      return path.front().time_s + base::toSeconds(t);
    renderer.step(scene, state, now, kRehearsedTick, rendering);
    hand.write(rendering.force_N);
  }
  return std::nullopt;
}

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

bool turnsSharply(const Vec3& before, const Vec3& at, const Vec3& after) {
  return (at - before).normalized().dot((after - at).normalized()) < 0.8;
}

// From `start` on the sphere around everything along the points and out to the sphere again.
std::vector<device::Waypoint> strokePath(const StrokePlanner& planner, const Vec3& start,
                                         const std::vector<SurfacePoint>& points, const Quat& stylus,
                                         bool pressButton) {
  std::vector<Vec3> targets;
  for (const SurfacePoint& point : points)
    targets.push_back(point.position - planner.pressDepth(point) * point.normal);
  PathBuilder path(start);
  const Vec3& first = points.front().position;
  path.moveTo(first + planner.size() * kClearance_m * (start - first).normalized(), stylus,
              kFreeSpeed_m_per_s);
  path.rest();
  for (std::size_t i = 0; i < targets.size(); ++i) {
    path.moveTo(targets[i], stylus, kSlideSpeed_m_per_s, pressButton && i == 2);
    if (i == 0 || i + 1 == targets.size() || turnsSharply(targets[i - 1], targets[i], targets[i + 1]))
      path.rest();
  }
  const SurfacePoint& last = points.back();
  path.moveTo(last.position + planner.size() * kLift_m * last.normal, stylus, kSlideSpeed_m_per_s);
  path.rest();
  path.moveTo(planner.wayOut(last).value_or(start), stylus, kFreeSpeed_m_per_s);
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
                                          Nanos now, const std::atomic<bool>* ended) {
  const Box bounds = boundsInDevice(scene, now);
  if (bounds.empty()) return idleCircle(workspace_m);
  const StrokePlanner planner(scene, bounds, now);
  const Vec3 centre = planner.centre();
  const double outside = planner.outside();

  const Vec3 home = centre + outside * Vec3::UnitY();
  PathBuilder path(home);
  int ticks = kRehearsedTicks;
  const auto mayGoOn = [&] { return ticks > 0 && (ended == nullptr || !*ended); };
  for (int stroke = 0; stroke < kStrokes; ++stroke) {
    for (int attempt = 0; attempt < kAttempts && mayGoOn(); ++attempt) {
      const int number = stroke * kAttempts + attempt;
      const bool roomy = attempt + 2 < kAttempts;  // then also narrow places, for want of others
      const Vec3 ray = direction(number, kStrokes * kAttempts);
      const Vec3 start = centre + outside * ray;
      // Not only towards the centre: flat and hollow things have their surface elsewhere.
      const Vec3 aside = 0.35 * bounds.extents().cwiseProduct(direction((7 * number) % 31, 31));
      const auto first = planner.approach(start, attempt == 0 ? centre : Vec3(centre + aside), roomy);
      if (!first) continue;
      std::vector<SurfacePoint> points = planner.stroke(*first, ray.unitOrthogonal(), roomy);
      const Vec3 along = ray.unitOrthogonal();
      const Quat stylus = geometry::rotationBetween(Vec3::UnitY(), (ray + 0.4 * along).normalized());
      std::vector<device::Waypoint> found;
      while (points.size() >= (roomy ? kShortestStroke : 1) && found.empty()) {
        std::vector<device::Waypoint> tried = strokePath(planner, start, points, stylus, stroke % 3 == 0);
        if (const auto heldBack = heldBackAt(tried, scene, now, ticks)) {
          const auto reached = std::count_if(tried.begin() + 2, tried.end(),
                                             [&](const auto& w) { return w.time_s < *heldBack; });
          points.resize(std::min(points.size(), static_cast<std::size_t>(reached)) * 2 / 3);
        } else {
          found = std::move(tried);
        }
      }
      if (found.empty()) continue;
      path.arcTo(start, centre, stylus);
      path.rest();  // as felt: a path that passes a point in motion bends before and after it
      path.append(found);
      path.rest();
      break;
    }
  }
  path.arcTo(home, centre, Quat::Identity());
  return path.take();
}

}  // namespace hapticd::server
