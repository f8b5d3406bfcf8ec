// Scenes for the renderer, built by hand: meshes, placements and surfaces become a snapshot with its indexes.
#pragma once

#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "base/time.h"
#include "realtime/render/renderer.h"
#include "scene/snapshot.h"

namespace hapticd::realtime::fixture {

using base::Nanos;
using base::toNanos;
using geometry::Affine;
using geometry::Box;
using geometry::TriangleMesh;
using geometry::Vec3;
using geometry::Vec3f;

inline constexpr Nanos kTick = 1'000'000;

/// A frictionless surface of 1000 N/m.
inline scene::Surface surface(double stiffness = 1000, double mu_s = 0, double mu_d = 0) {
  scene::Surface s;
  s.stiffness_N_per_m = stiffness;
  s.staticFriction = mu_s;
  s.dynamicFriction = mu_d;
  return s;
}

/// Equal `topology` numbers promise equal triangle lists.
inline std::shared_ptr<scene::MeshGeometry> geometryOf(const TriangleMesh& mesh, std::uint64_t topology,
                                                       const std::vector<Vec3f>* target = nullptr,
                                                       Nanos morphBegin = 0, Nanos morphEnd = 0) {
  auto g = std::make_shared<scene::MeshGeometry>();
  g->topology = topology;
  g->triangles = std::make_shared<const std::vector<geometry::Triangle>>(mesh.triangles);
  g->vertices = std::make_shared<const std::vector<Vec3f>>(mesh.vertices);
  if (target != nullptr) g->target = std::make_shared<const std::vector<Vec3f>>(*target);
  g->morphBegin = morphBegin;
  g->morphEnd = morphEnd;
  const auto& triangles = *g->triangles;
  g->index = scene::SpatialIndex::build(static_cast<std::uint32_t>(triangles.size()), [&](std::uint32_t id) {
    Box box;
    for (const std::uint32_t v : triangles[id]) {
      if (!(*g->vertices)[v].allFinite()) return Box{};
      box.extend(Vec3((*g->vertices)[v].cast<double>()));
      if (g->target) box.extend(Vec3((*g->target)[v].cast<double>()));
    }
    return box;
  });
  g->bounds = g->boundsOnTheWay = g->index.bounds();
  if (g->target) return g;
  auto fans = std::make_shared<const geometry::Fans>(*g->vertices, triangles, std::vector<bool>());
  if (!fans->empty()) g->fans = std::move(fans);
  g->discs = std::make_shared<const geometry::DiscTree>(*g->vertices, triangles, std::vector<bool>());
  return g;
}

/// A scene under construction. `at` is the placement in device metres of a mesh given in its own unit.
class SceneFixture {
 public:
  scene::TouchableFaces faces = scene::TouchableFaces::front;
  scene::Workspace workspace;

  SceneFixture() { setWorldUnitsPerMetre(1); }

  void setWorldUnitsPerMetre(double units) {
    workspace.T_world_device = Affine(Eigen::UniformScaling<double>(units));
    workspace.T_device_world = Affine(Eigen::UniformScaling<double>(1 / units));
    workspace.worldUnitsPerMetre = units;
  }

  scene::ObjectState& add(std::shared_ptr<const scene::MeshGeometry> mesh, const scene::Surface& s,
                          const scene::Motion& motion = {}) {
    auto object = std::make_shared<scene::ObjectState>();
    object->id = static_cast<std::int32_t>(objects_.size());
    object->mesh = std::move(mesh);
    object->motion = motion;
    object->surface = s;
    objects_.push_back(object);
    return *objects_.back();
  }
  scene::ObjectState& add(const TriangleMesh& mesh, const scene::Surface& s, const Affine& T_world_object) {
    return add(geometryOf(mesh, 1 + objects_.size()), s, scene::Motion::fixed(T_world_object));
  }
  scene::ObjectState& add(const TriangleMesh& mesh, const scene::Surface& s) {
    return add(mesh, s, Affine::Identity());
  }

  std::vector<scene::Effect> effects;
  std::vector<scene::Plane> planes;
  std::vector<scene::ForceField> fields;
  std::optional<scene::Buzz> buzz;

  /// A picture of the scene as it stands; later changes of the fixture do not touch it.
  std::shared_ptr<const scene::SceneSnapshot> snapshot() const {
    auto s = std::make_shared<scene::SceneSnapshot>();
    s->workspace = workspace;
    s->faces = faces;
    s->effects = effects;
    s->planes = planes;
    s->fields = fields;
    s->buzz = buzz;
    for (const auto& object : objects_) s->objects.push_back(std::make_shared<scene::ObjectState>(*object));
    s->objectIndex = std::make_shared<scene::SpatialIndex>(
        scene::SpatialIndex::build(static_cast<std::uint32_t>(objects_.size()),
                                   [&](std::uint32_t i) { return sweptBox(*objects_[i]); }));
    return s;
  }

 private:
  static Box sweptBox(const scene::ObjectState& object) {
    const Box& box = object.mesh->index.bounds();
    Box swept;
    if (box.empty()) return swept;
    // Both ends, and as much again around them for the turn between.
    for (const Affine& t : {object.motion.origin(), object.motion.destination()}) {
      const Vec3 half = t.linear().cwiseAbs() * (0.5 * box.extents());
      swept.extend(Vec3(t * box.centre() - half));
      swept.extend(Vec3(t * box.centre() + half));
    }
    if (object.motion.movingAfter(0)) {
      const Vec3 more = 0.5 * swept.extents();
      swept.min -= more;
      swept.max += more;
    }
    return swept;
  }

  std::vector<std::shared_ptr<scene::ObjectState>> objects_;
};

/// A renderer, a clock and a hand that goes where the test says.
class Hand {
 public:
  explicit Hand(std::shared_ptr<const scene::SceneSnapshot> scene, const RenderOptions& options = {})
      : scene_(std::move(scene)), renderer_(options) {}

  /// One tick with the HIP at p.
  const Rendering& at(const Vec3& p) {
    device::DeviceState state;
    state.time = now_;
    state.position_m = p;
    state.velocity_m_per_s = started_ ? Vec3((p - last_) / base::toSeconds(kTick)) : Vec3(Vec3::Zero());
    state.orientation = orientation;
    renderer_.step(*scene_, state, now_, kTick, rendering_);
    started_ = true;
    last_ = p;
    now_ += kTick;
    return rendering_;
  }
  /// On a straight line from where it is to p at `speed` m/s; calls `each` after every tick.
  template <class Each>
  const Rendering& to(const Vec3& p, double speed, Each&& each) {
    const Vec3 from = last_;
    const int ticks = std::max(1, static_cast<int>(std::ceil((p - from).norm() / (speed * 1e-3) - 1e-9)));
    for (int i = 1; i <= ticks; ++i) {
      at(from + (p - from) * (static_cast<double>(i) / ticks));
      each(rendering_);
    }
    return rendering_;
  }
  const Rendering& to(const Vec3& p, double speed = 0.1) {
    return to(p, speed, [](const Rendering&) {});
  }
  /// The scene of the next tick; the old one stays alive.
  void show(std::shared_ptr<const scene::SceneSnapshot> scene) {
    shown_.push_back(std::exchange(scene_, std::move(scene)));
  }

  const Rendering& now() const { return rendering_; }
  Nanos time() const { return now_; }
  const Vec3& hip() const { return last_; }
  Renderer& renderer() { return renderer_; }

  geometry::Quat orientation = geometry::Quat::Identity();

 private:
  std::shared_ptr<const scene::SceneSnapshot> scene_;
  std::vector<std::shared_ptr<const scene::SceneSnapshot>> shown_;
  Renderer renderer_;
  Rendering rendering_;
  Nanos now_ = 0;
  bool started_ = false;
  Vec3 last_ = Vec3::Zero();
};

}  // namespace hapticd::realtime::fixture
