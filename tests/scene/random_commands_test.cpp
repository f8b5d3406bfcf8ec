// Whatever clients say, in whatever order: what is published stays consistent.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <random>
#include <set>
#include <tuple>

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
  RC_ASSERT(o.surface.dynamicFriction <= o.surface.staticFriction);
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

bool same(const std::shared_ptr<const std::vector<Vec3f>>& a,
          const std::shared_ptr<const std::vector<Vec3f>>& b) {
  if (!a || !b) return a == b;
  const auto equal = [](const Vec3f& p, const Vec3f& q) {
    return p == q || (!p.allFinite() && !q.allFinite());
  };
  return std::equal(a->begin(), a->end(), b->begin(), b->end(), equal);
}

void checkSame(const SceneDescription& a, const SceneDescription& b) {
  RC_ASSERT(a.workspace.T_world_device.matrix() == b.workspace.T_world_device.matrix());
  RC_ASSERT(a.faces == b.faces);
  RC_ASSERT(a.T_world_scene.matrix() == b.T_world_scene.matrix());
  RC_ASSERT(a.objects.size() == b.objects.size());
  for (std::size_t i = 0; i < a.objects.size(); ++i) {
    const ObjectDescription& x = a.objects[i];
    const ObjectDescription& y = b.objects[i];
    RC_ASSERT(std::tie(x.id, x.parent, x.touchable, x.name, x.worldUnits) ==
              std::tie(y.id, y.parent, y.touchable, y.name, y.worldUnits));
    RC_ASSERT(x.T_world_object.matrix() == y.T_world_object.matrix());
    RC_ASSERT(x.T_object_mesh.matrix() == y.T_object_mesh.matrix());
    RC_ASSERT(x.surface.stiffness_N_per_m == y.surface.stiffness_N_per_m);
    RC_ASSERT(x.surface.damping_Ns_per_m == y.surface.damping_Ns_per_m);
    RC_ASSERT(x.surface.staticFriction == y.surface.staticFriction);
    RC_ASSERT(x.surface.dynamicFriction == y.surface.dynamicFriction);
    RC_ASSERT(same(x.vertices, y.vertices));
    RC_ASSERT(!x.triangles == !y.triangles);
    if (x.triangles) RC_ASSERT(*x.triangles == *y.triangles);
  }
  RC_ASSERT(a.effects.size() == b.effects.size());
  for (std::size_t i = 0; i < a.effects.size(); ++i) {
    const Effect& x = a.effects[i].effect;
    const Effect& y = b.effects[i].effect;
    RC_ASSERT(std::tie(x.index, x.type, x.gain, x.magnitude_N, x.duration, x.angularFrequency_rad_per_s) ==
              std::tie(y.index, y.type, y.gain, y.magnitude_N, y.duration, y.angularFrequency_rad_per_s));
    RC_ASSERT(x.position == y.position && x.direction == y.direction);
    RC_ASSERT(a.effects[i].active == b.effects[i].active);
  }
  RC_ASSERT(a.planes.size() == b.planes.size());
  for (std::size_t i = 0; i < a.planes.size(); ++i) {
    RC_ASSERT(a.planes[i].normal == b.planes[i].normal && a.planes[i].offset == b.planes[i].offset);
    RC_ASSERT(a.planes[i].surface.stiffness_N_per_m == b.planes[i].surface.stiffness_N_per_m);
  }
  RC_ASSERT(!a.constraint == !b.constraint);
  if (a.constraint) {
    RC_ASSERT(a.constraint->mode == b.constraint->mode && a.constraint->point == b.constraint->point);
    RC_ASSERT(a.constraint->stiffness_N_per_m == b.constraint->stiffness_N_per_m);
  }
  RC_ASSERT(a.fields.size() == b.fields.size());
  for (std::size_t i = 0; i < a.fields.size(); ++i) {
    RC_ASSERT(a.fields[i].origin == b.fields[i].origin && a.fields[i].force_N == b.fields[i].force_N);
    RC_ASSERT(a.fields[i].jacobian_N_per_unit == b.fields[i].jacobian_N_per_unit);
  }
}

// What a recording that starts at any time begins with.
RC_GTEST_PROP(RandomCommands, TheCommandsOfASceneMakeItAgain, (std::uint64_t seed)) {
  Speaker speaker(seed);
  SceneConfig config;
  config.stopwatch = [] { return Nanos{0}; };
  SceneBuilder builder(config);
  std::vector<Notice> notices;
  Nanos now = 0;
  builder.apply(0, SetObjectNumber{6}, now, notices);
  for (std::int32_t id = 0; id < 6; ++id) {
    builder.apply(0, SetSurfaceProperty{id, "stiffness", 0.5}, now, notices);
    builder.apply(0, SetVertices{id, 0, oneTriangle()}, now, notices);
  }
  for (int step = 0; step < 200; ++step) {
    now += speaker.pick(3) == 0 ? speaker.pick(30) * kMillisecond : 0;
    const auto client = static_cast<ClientId>(speaker.pick(3));
    switch (speaker.pick(12)) {
      case 0:
        builder.apply(client, SetConstraintEnabled{speaker.pick(4) != 0}, now, notices);
        break;
      case 1:
        builder.apply(client, SetConstraintMode{1 + speaker.pick(3)}, now, notices);
        break;
      case 2:
        builder.apply(client, SetConstraintVector{ConstraintVector::point, {0, 0, 0.01 * speaker.pick(9)}},
                      now, notices);
        break;
      case 3:
        builder.apply(client, SetObjectName{speaker.pick(6), std::to_string(step)}, now, notices);
        break;
      default:
        builder.apply(client, speaker.next(), now, notices);
    }
    if (speaker.pick(60) == 0) builder.clientGone(client, now);
    if (speaker.pick(3) == 0) builder.publish(now, notices);
  }
  now += 1000 * kMillisecond;  // what ramps out is gone
  builder.publish(now, notices);

  SceneBuilder again(config);
  for (ClientCommand& c : builder.commands(now)) again.apply(c.client, std::move(c.command), now, notices);
  now += 500 * kMillisecond;
  again.publish(now, notices);
  builder.publish(now, notices);
  checkSame(builder.describe(), again.describe());
  // Nothing accumulates, and open batches are there: both go on alike.
  RC_ASSERT(again.commands(now).size() <= builder.commands(now).size());
  for (ClientId client = 0; client < 3; ++client) {
    for (SceneBuilder* one : {&builder, &again}) one->apply(client, CommitBatch{}, now, notices);
  }
  now += 500 * kMillisecond;
  again.publish(now, notices);
  builder.publish(now, notices);
  checkSame(builder.describe(), again.describe());
}

void checkSameMesh(const MeshGeometry& a, const MeshGeometry& b, Nanos now) {
  RC_ASSERT(a.index.size() == b.index.size());
  RC_ASSERT(*a.triangles == *b.triangles);
  RC_ASSERT(!a.fans == !b.fans);
  for (std::uint32_t id = 0; id < a.triangles->size(); ++id) {
    for (const Nanos time : {now, now + 3 * kMillisecond, now + 1000 * kMillisecond}) {
      const Corners p = a.corners(id, time);
      const Corners q = b.corners(id, time);
      RC_ASSERT(p.a.hasNaN() == q.a.hasNaN());
      if (p.a.hasNaN() || p.b.hasNaN() || p.c.hasNaN()) continue;
      RC_ASSERT(p.a == q.a && p.b == q.b && p.c == q.c);
    }
  }
}

void checkSameSnapshot(const SceneSnapshot& a, const SceneSnapshot& b, Nanos now) {
  RC_ASSERT(a.workspace.T_world_device.matrix() == b.workspace.T_world_device.matrix());
  RC_ASSERT(a.faces == b.faces);
  RC_ASSERT(a.objects.size() == b.objects.size());
  for (std::size_t i = 0; i < a.objects.size(); ++i) {
    const ObjectState& x = *a.objects[i];
    const ObjectState& y = *b.objects[i];
    RC_ASSERT(x.id == y.id);
    RC_ASSERT(x.surface.stiffness_N_per_m == y.surface.stiffness_N_per_m);
    RC_ASSERT(x.surface.damping_Ns_per_m == y.surface.damping_Ns_per_m);
    RC_ASSERT(x.surface.staticFriction == y.surface.staticFriction);
    RC_ASSERT(x.surface.dynamicFriction == y.surface.dynamicFriction);
    checkSameMesh(*x.mesh, *y.mesh, now);
    for (const Nanos time : {now, now + 7 * kMillisecond, now + 1000 * kMillisecond})
      RC_ASSERT(x.motion.at(time).matrix() == y.motion.at(time).matrix());
  }
}

// A recording that starts at any time shows what comes after its beginning as the server did.
RC_GTEST_PROP(RandomCommands, ACopyOfASceneGoesOnAsTheScene, (std::uint64_t seed)) {
  Speaker speaker(seed);
  SceneConfig config;
  config.stopwatch = [] { return Nanos{0}; };
  config.limits.verticesPerObject = 100'000;
  SceneBuilder builder(config);
  std::vector<Notice> notices;
  Nanos now = 1000 * kMillisecond;
  builder.apply(0, SetObjectNumber{6}, now, notices);
  for (std::int32_t id = 0; id < 6; ++id) {
    builder.apply(0, SetSurfaceProperty{id, "stiffness", 0.5}, now, notices);
    builder.apply(0, SetVertices{id, 0, oneTriangle()}, now, notices);
  }
  const auto wait = [&] { now += speaker.pick(3) == 0 ? speaker.pick(30) * kMillisecond : 0; };
  for (int step = 0; step < 150; ++step) {
    wait();
    builder.apply(static_cast<ClientId>(speaker.pick(3)), speaker.next(), now, notices);
    if (speaker.pick(60) == 0) builder.clientGone(static_cast<ClientId>(speaker.pick(3)), now);
    if (speaker.pick(3) == 0) builder.publish(now, notices);
  }
  builder.publish(now, notices);

  SceneBuilder copy(config);
  for (ClientCommand& c : builder.commands(now)) copy.apply(c.client, std::move(c.command), c.at, notices);
  copy.publish(now - 200 * kMillisecond, notices);
  for (ClientCommand& c : builder.editsUnderWay(now))
    copy.apply(c.client, std::move(c.command), c.at, notices);
  std::shared_ptr<const SceneSnapshot> original;
  std::shared_ptr<const SceneSnapshot> copied;
  const auto publish = [&] {
    if (auto next = builder.publish(now, notices)) original = std::move(next);
    if (auto next = copy.publish(now, notices)) copied = std::move(next);
  };
  for (int i = 0; i < 100; ++i) {
    now += 10 * kMillisecond;
    publish();
  }
  for (SceneBuilder* one : {&builder, &copy}) one->apply(9, SetTouchableFaces{2}, now, notices);
  publish();
  checkSameSnapshot(*original, *copied, now);
  for (int step = 0; step < 150; ++step) {
    wait();
    const auto client = static_cast<ClientId>(speaker.pick(3));
    SceneCommand command = speaker.next();
    copy.apply(client, SceneCommand(command), now, notices);
    builder.apply(client, std::move(command), now, notices);
    if (speaker.pick(3) != 0) continue;
    publish();
    checkSameSnapshot(*original, *copied, now);
  }
}

}  // namespace
}  // namespace hapticd::scene
