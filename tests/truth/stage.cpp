#include "truth/stage.h"

#include <algorithm>
#include <utility>

namespace hapticd::truth {
namespace {

namespace fixture = realtime::fixture;
using geometry::Affine;

Affine placement(const Pose& pose, double worldUnitsPerMetre) {
  Affine t;
  t.linear() = worldUnitsPerMetre * (pose.rotation.toRotationMatrix() * pose.scale.asDiagonal());
  t.translation() = worldUnitsPerMetre * pose.position_m;
  return t;
}

scene::Surface surfaceOf(const Material& m) {
  scene::Surface s = fixture::surface(m.stiffness_N_per_m, m.staticFriction, m.dynamicFriction);
  s.damping_Ns_per_m = m.damping_Ns_per_m;
  s.popthrough_N = m.popthrough_N;
  return s;
}

}  // namespace

Stage::Stage(const Trial& trial) : trial_(trial) {
  for (const TrialObject& object : trial.objects) {
    const geometry::TriangleMesh mesh{object.vertices, object.triangles};
    geometry_.push_back(
        fixture::geometryOf(mesh, 1 + geometry_.size(), object.target.empty() ? nullptr : &object.target,
                            object.morphBegin * fixture::kTick, object.morphEnd * fixture::kTick));
    lastPhase_ = std::max(lastPhase_, static_cast<int>(object.poses.size()) - 1);
  }
}

const scene::SceneSnapshot& Stage::at(int tick) {
  const int phase = std::min(tick / kPoseTicks, lastPhase_);
  if (phase != phase_) {
    phase_ = phase;
    before_ = std::exchange(now_, snapshotOf(phase));
  }
  return *now_;
}

std::shared_ptr<const scene::SceneSnapshot> Stage::snapshotOf(int phase) const {
  fixture::SceneFixture built;
  built.faces = static_cast<scene::TouchableFaces>(trial_.sides);
  built.setWorldUnitsPerMetre(trial_.worldUnitsPerMetre);
  for (std::size_t i = 0; i < trial_.objects.size(); ++i) {
    const TrialObject& object = trial_.objects[i];
    const auto pose = [&](int k) {
      const std::size_t last = object.poses.size() - 1;
      return placement(object.poses[std::min(static_cast<std::size_t>(k), last)], trial_.worldUnitsPerMetre);
    };
    const bool moving = static_cast<std::size_t>(phase) + 1 < object.poses.size();
    built.add(geometry_[i], surfaceOf(object.material),
              moving
                  ? scene::Motion::between(pose(phase), pose(phase + 1), phase * kPoseTicks * fixture::kTick,
                                           (phase + 1) * kPoseTicks * fixture::kTick)
                  : scene::Motion::fixed(pose(phase)));
  }
  for (const TrialPlane& p : trial_.planes) {
    scene::Plane plane;
    plane.index = static_cast<std::int32_t>(built.planes.size());
    plane.normal = p.normal;
    plane.offset = p.offset_m * trial_.worldUnitsPerMetre;
    plane.surface = surfaceOf(p.material);
    built.planes.push_back(plane);
  }
  return built.snapshot();
}

}  // namespace hapticd::truth
