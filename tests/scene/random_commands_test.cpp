// Whatever clients say, in whatever order: what is published stays consistent.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <random>
#include <set>

#include "scene_fixture.h"

namespace hapticd::scene {
namespace {

// Mostly sensible values, and now and then one that is not.
class Speaker {
 public:
  explicit Speaker(std::uint64_t seed) : random_(seed) {}

  SceneCommand next() {
    switch (pick(34)) {
      case 0:
        return SetObjectNumber{id()};
      case 1:
      case 2:
      case 3:
      case 4:
        return SetVertices{id(), number(), vertices()};
      case 5:
      case 6:
        return SetTriangles{id(), number(), triangles()};
      case 7:
        return RemoveTriangle{id(), number()};
      case 8:
        return pick(9) == 0 ? SceneCommand(ClearMesh{id()}) : SetNormal{id()};
      case 9:
        return TransformMesh{id(), {f(), f(), f(), f(), f(), f(), f(), f(), f(), f(), f(), f(), 0, 0, 0, 1}};
      case 10:
        return AddObject{id(), id()};
      case 11:
        return pick(3) == 0 ? SceneCommand(AddObjectExScene{id()}) : MoveToParent{id(), id()};
      case 12:
        return pick(6) == 0 ? SceneCommand(RemoveObject{id()}) : SetTouchable{id(), true};
      case 13:
      case 14:
      case 15:
        return SetTransform{id(), {d(), d(), d(), 0, d(), d(), d(), 0, d(), d(), d(), 0, d(), d(), d(), 1}};
      case 16:
        return SetObjectPosition{id(), vec()};
      case 17:
        return SetObjectOrientation{id(), vec(), d()};
      case 18:
        return SetObjectScale{id(), vec()};
      case 19:
        return SetTouchable{id(), pick(3) != 0};
      case 20:
      case 21:
      case 22:
        return SetSurfaceProperty{id(), pick(2) == 0 ? "stiffness" : "damping", d()};
      case 23:
        return SetSurface{id(), d(), d() / 100, d(), d()};
      case 24:
        return SetTouchableFaces{number()};
      case 25:
        return SetWorkspaceBox{columns(Affine(Affine::Identity())), {d(), d(), d(), d(), d(), d()}};
      case 26:
        return SetHapticScale{d()};
      case 27:
        return DefineEffect{
            pick(2) == 0 ? "spring" : "constant", number(), d(), d(), 100 * d(), d(), vec(), vec()};
      case 28:
        return StartEffect{number()};
      case 29:
        return StopEffect{number()};
      case 30:
        return SetPlane{number(), {d(), d(), d(), d()}, d(), d(), d(), d(), number()};
      case 31:
        return SetForceField{vec(), vec(), {d(), d(), d(), d(), d(), d(), d(), d(), d()}, d()};
      case 32:
        return pick(20) == 0 ? SceneCommand(ResetScene{}) : SetSceneOrigin{vec(), vec(), d()};
      default:
        return pick(4) == 0 ? SceneCommand(BeginBatch{}) : CommitBatch{};
    }
  }
  int pick(int n) { return static_cast<int>(random_() % static_cast<std::uint64_t>(n)); }

 private:
  std::int32_t id() { return pick(20) == 0 ? pick(100'000) - 50'000 : pick(6) - (pick(10) == 0 ? 1 : 0); }
  std::int32_t number() { return pick(30) == 0 ? static_cast<std::int32_t>(random_()) : pick(12); }
  double d() {
    switch (pick(40)) {
      case 0:
        return std::nan("");
      case 1:
        return INFINITY;
      case 2:
        return 1e200;
      case 3:
        return 0;
      case 4:
        return -1e-200;
      default:
        return std::uniform_real_distribution<double>(-1, 2)(random_);
    }
  }
  float f() { return static_cast<float>(std::clamp(d(), -1e30, 1e30)); }
  Vec3 vec() { return {d(), d(), d()}; }
  std::vector<Vec3f> vertices() {
    std::vector<Vec3f> v(static_cast<std::size_t>(pick(7)));
    for (Vec3f& p : v) p = Vec3f(f(), f(), f());
    return v;
  }
  std::vector<Triangle> triangles() {
    std::vector<Triangle> t(static_cast<std::size_t>(pick(4)));
    for (Triangle& c : t) {
      for (std::uint32_t& i : c) i = static_cast<std::uint32_t>(number());
    }
    return t;
  }
  std::mt19937_64 random_;
};

void checkObject(const SceneSnapshot& scene, std::uint32_t position, Nanos now) {
  const ObjectState& o = *scene.objects[position];
  RC_ASSERT(o.surface.stiffness_N_per_m > 0);
  RC_ASSERT(o.surface.stiffness_N_per_m * 0.0005 + o.surface.damping_Ns_per_m < 5);
  RC_ASSERT(o.surface.dynamic_friction <= o.surface.static_friction);
  const MeshGeometry& mesh = *o.mesh;
  RC_ASSERT(mesh.index.size() == mesh.triangles->size());
  for (const Triangle& t : *mesh.triangles) {
    for (const std::uint32_t i : t) RC_ASSERT(i < mesh.vertices->size());
  }
  if (mesh.target) RC_ASSERT(mesh.target->size() == mesh.vertices->size());
  for (const Nanos time : {now, now + 7 * kMillisecond, now + kMillisecond * 1000}) {
    const Affine t = o.motion.at(time);
    RC_ASSERT(t.matrix().allFinite());
    RC_ASSERT(t.linear().determinant() != 0);
    // Each triangle that the mesh's index knows can be found through both indexes.
    std::set<std::uint32_t> ids;
    mesh.index.visitNear(mesh.index.bounds().centre(), INFINITY, [&](std::uint32_t id) { ids.insert(id); });
    RC_ASSERT(!ids.empty());
    for (const std::uint32_t id : ids) {
      const Corners c = mesh.corners(id, time);
      RC_ASSERT(c.a.allFinite() && c.b.allFinite() && c.c.allFinite());
      bool found = false;
      mesh.index.visitNear(c.a, 0, [&](std::uint32_t other) { found |= other == id; });
      RC_ASSERT(found);
      found = false;
      scene.objectIndex->visitNear(t * c.a, 0, [&](std::uint32_t other) { found |= other == position; });
      RC_ASSERT(found);
    }
  }
}

RC_GTEST_PROP(RandomCommands, LeaveAConsistentScene, (std::uint64_t seed)) {
  Speaker speaker(seed);
  SceneConfig config;
  config.limits.verticesPerObject = 2'000;
  config.limits.verticesInAll = 4'000;
  config.limits.trianglesPerObject = 1'000;
  config.limits.objects = 50;
  SceneBuilder builder(config);
  std::vector<Notice> notices;
  std::vector<std::shared_ptr<const SceneSnapshot>> held;
  Nanos now = 0;
  std::uint64_t revision = 0;
  builder.apply(0, SetObjectNumber{6}, now, notices);
  for (std::int32_t id = 0; id < 6; ++id) {
    builder.apply(0, SetSurfaceProperty{id, "stiffness", 0.5}, now, notices);
    builder.apply(0, SetVertices{id, 0, oneTriangle()}, now, notices);
  }
  for (int step = 0; step < 300; ++step) {
    now += speaker.pick(3) == 0 ? speaker.pick(30) * kMillisecond : 0;
    builder.apply(static_cast<ClientId>(speaker.pick(3)), speaker.next(), now, notices);
    if (speaker.pick(40) == 0) builder.clientGone(static_cast<ClientId>(speaker.pick(3)), now);
    if (speaker.pick(3) != 0) continue;
    const auto scene = builder.publish(now, notices);
    if (!scene) continue;
    RC_ASSERT(scene->revision == ++revision);
    RC_ASSERT(scene->objectIndex->size() == scene->objects.size());
    RC_ASSERT(std::isfinite(scene->workspace.worldUnitsPerMetre) && scene->workspace.worldUnitsPerMetre > 0);
    for (std::uint32_t i = 0; i < scene->objects.size(); ++i) {
      if (i > 0) RC_ASSERT(scene->objects[i - 1]->id < scene->objects[i]->id);
      checkObject(*scene, i, now);
    }
    for (const Effect& e : scene->effects) RC_ASSERT(std::isfinite(e.gain) && std::isfinite(e.magnitude_N));
    for (const Plane& p : scene->planes)
      RC_ASSERT(std::abs(p.normal.norm() - 1) < 1e-9 && std::isfinite(p.offset));
    for (const ForceField& f : scene->fields) RC_ASSERT(f.jacobian_N_per_unit.allFinite());
    if (speaker.pick(5) == 0) held.push_back(scene);
    if (held.size() > 3) held.erase(held.begin());
  }
  RC_ASSERT(builder.nextDeadline().value_or(now) >= 0);
}

}  // namespace
}  // namespace hapticd::scene
