#include "device/whole_server/demo_scene.h"
#include "base/clock.h"

#include <cmath>
#include <stdexcept>

#include "device/simulated/simulated_device.h"
#include "realtime/render/meshes.h"
#include "realtime/servo/tick.h"
#include "scene/builder.h"

namespace hapticd::whole_server {
namespace {

constexpr base::Nanos kTick = 1'000'000;
constexpr double kHalf_mm = 60;
constexpr double kSpring_N_per_mm = 0.01;
constexpr double kSpring_N = 0.2;
constexpr std::array<double, 3> kSpringTo_mm{10, 5, 0};
constexpr double kStaticFriction = 0.4;
constexpr double kDynamicFriction = 0.3;

// A hand that is where it is put.
class Placed final : public device::HandPath {
 public:
  explicit Placed(std::vector<Vec3> places_m) : places_m_(std::move(places_m)) {}
  device::HandPose at(base::Nanos sinceStart) const noexcept override {
    device::HandPose pose;
    const auto last = static_cast<base::Nanos>(places_m_.size()) - 1;
    pose.position_m =
        places_m_[static_cast<std::size_t>(std::clamp<base::Nanos>(sinceStart / kTick, 0, last))];
    return pose;
  }
  base::Nanos duration() const noexcept override {
    return static_cast<base::Nanos>(places_m_.size()) * kTick;
  }

 private:
  const std::vector<Vec3> places_m_;
};

}  // namespace

geometry::TriangleMesh DemoScene::mesh(int object) const {
  const double height_mm = object == 0 ? 0 : -0.5;
  const double phase = object == 0 ? 0 : 1;
  return realtime::fixture::heightField(kHalf_mm, 24, [=](double x, double y) {
    const double edge = object == 0 && x > 0 ? -3 : 0;  // from there on the other one is on top
    return height_mm + edge + 0.4 * std::sin(0.15 * x + phase) * std::cos(0.1 * y);
  });
}

void DemoScene::upload(Client& client) const {
  client.batch([&] {
    client.resetScene();
    client.setObjectCount(kObjects);
    for (int object = 0; object < kObjects; ++object) {
      const geometry::TriangleMesh sheet = mesh(object);
      std::vector<std::array<float, 3>> vertices;
      for (const auto& v : sheet.vertices) vertices.push_back({v.x(), v.y(), v.z()});
      std::vector<std::array<std::uint32_t, 3>> triangles(sheet.triangles.begin(), sheet.triangles.end());
      client.uploadMesh(object, {vertices, triangles});
      Surface surface{.stiffness = stiffness};
      if (friction) surface.staticFriction = static_cast<float>(kStaticFriction);
      if (friction) surface.dynamicFriction = static_cast<float>(kDynamicFriction);
      client.setSurface(object, surface);
    }
    client.setEffect(0, Effect::spring(kSpringTo_mm, kSpring_N_per_mm, kSpring_N));
    client.startEffect(0);
  });
  client.flushAll();
}

std::vector<Vec3> DemoScene::stroke() const {
  std::vector<Vec3> all;
  const double high_m = 0.002;
  for (int i = 0; i < places; ++i) {
    const double round = 2 * M_PI * i / places;
    const double down = 0.5 * (1 - std::cos(round));
    all.emplace_back(0.012 * std::sin(round), 0.006 * std::sin(2 * round) + 0.002,
                     high_m - (high_m + depth_m) * down);
  }
  return all;
}

void DemoScene::script(mock::ArmBlock& block) const {
  const std::vector<Vec3> all = stroke();
  if (all.size() > static_cast<std::size_t>(mock::kMostPlaces)) throw std::length_error("stroke");
  for (std::size_t i = 0; i < all.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) block.place_m[i][axis] = all[i][axis];
  }
  block.places = static_cast<int>(all.size());
}

std::vector<Vec3> DemoScene::forces(const std::vector<Vec3>& places_m) const {
  scene::SceneBuilder builder;
  std::vector<scene::Notice> notices;
  const auto say = [&](scene::SceneCommand&& command) { builder.apply(1, std::move(command), 0, notices); };
  say(scene::BeginBatch{});
  say(scene::SetObjectNumber{kObjects});
  for (int object = 0; object < kObjects; ++object) {
    geometry::TriangleMesh sheet = mesh(object);
    say(scene::SetVertices{object, 0, std::move(sheet.vertices)});
    say(scene::SetTriangles{object, 0, std::move(sheet.triangles), false});
    say(scene::SetSurfaceProperty{object, "stiffness", stiffness});
    if (friction) say(scene::SetSurfaceProperty{object, "static friction", kStaticFriction});
    if (friction) say(scene::SetSurfaceProperty{object, "dynamic friction", kDynamicFriction});
  }
  const auto& to = kSpringTo_mm;
  say(scene::DefineEffect{.type = "spring",
                          .index = 0,
                          .gain = kSpring_N_per_mm,
                          .magnitude_N = kSpring_N,
                          .position = {to[0], to[1], to[2]}});
  say(scene::StartEffect{0});
  say(scene::CommitBatch{});

  device::SimulatedOptions options;
  options.openLoop = true;
  device::SimulatedDevice device(options);
  device.setPath(std::make_shared<Placed>(places_m));
  device.open();
  base::SimulatedClock clock;
  realtime::TickOptions tickOptions;
  tickOptions.guard.enabled = false;
  realtime::Tick tick(device, clock, tickOptions);
  tick.snapshots().publish(builder.publish(0, notices));
  for (const scene::Notice& notice : notices) throw std::runtime_error(notice.text);
  std::vector<Vec3> forces;
  for (std::size_t i = 0; i < places_m.size(); ++i) {
    tick(static_cast<base::Nanos>(i) * kTick);
    forces.push_back(tick.last().force_N);
  }
  return forces;
}

std::vector<Vec3> DemoScene::strokeForces() const {
  const std::vector<Vec3> once = stroke();
  std::vector<Vec3> twice = once;
  twice.insert(twice.end(), once.begin(), once.end());
  const std::vector<Vec3> all = forces(twice);
  return {all.end() - static_cast<long>(once.size()), all.end()};
}

}  // namespace hapticd::whole_server
