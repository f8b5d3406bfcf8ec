// One scene for all drivers: a plane at z = 0 that faces the user, a hand that goes 3 mm into it, and the
// force that the simulated device gets at each of the same places.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/clock.h"
#include "device/simulated/hand_file.h"
#include "device/simulated/simulated_device.h"
#include "realtime/render/meshes.h"
#include "realtime/render/scene_fixture.h"
#include "realtime/servo/tick.h"

namespace hapticd::device::plane_scene {

inline constexpr Nanos kTick = 1'000'000;
inline constexpr double kStiffness_N_per_m = 500;

inline std::shared_ptr<const scene::SceneSnapshot> snapshot() {
  realtime::fixture::SceneFixture scene;
  scene.add(realtime::fixture::heightField(0.2, 4, [](double, double) { return 0; }),
            realtime::fixture::surface(kStiffness_N_per_m));
  return scene.snapshot();
}

/// Forces as they are rendered, so that every device gets the same.
inline realtime::TickOptions raw() {
  realtime::TickOptions options;
  options.guard.enabled = false;
  return options;
}

/// One place for each tick: down to 3 mm below the plane, and up again, on a slant that stays in x and z.
inline std::vector<Vec3> places(int ticks = 120) {
  std::vector<Vec3> all;
  for (int i = 0; i < ticks; ++i) {
    const double s = static_cast<double>(i) / (ticks - 1);
    all.emplace_back(0.01 * s, 0, 0.005 - 0.008 * (1 - std::abs(2 * s - 1)));
  }
  return all;
}

/// The forces on an open-loop simulated device at these places.
inline std::vector<Vec3> referenceForces(const std::vector<Vec3>& at) {
  std::string rows = "t_s,x_m,y_m,z_m\n";
  for (std::size_t i = 0; i < at.size(); ++i) {
    rows += std::to_string(1e-3 * static_cast<double>(i));
    for (const double x : at[i]) rows += "," + std::to_string(x);
    rows += "\n";
  }
  SimulatedOptions options;
  options.openLoop = true;
  SimulatedDevice device(options);
  device.setPath(HandFile::parse(rows, "places"));
  device.open();
  base::SimulatedClock clock;
  realtime::Tick tick(device, clock, raw());
  tick.snapshots().publish(snapshot());
  std::vector<Vec3> forces;
  for (std::size_t i = 0; i < at.size(); ++i) {
    tick(static_cast<Nanos>(i) * kTick);
    forces.push_back(tick.last().force_N);
  }
  return forces;
}

}  // namespace hapticd::device::plane_scene
