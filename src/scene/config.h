// What the operator and the device decide about a scene.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "base/time.h"
#include "geometry/types.h"
#include "scene/force_owner.h"

namespace hapticd::scene {

/// What surface values 0…1 refer to: fixed reference numbers on every device, or the connected device's own.
enum class MaterialScale { reference, device };
/// How a view volume is fitted: the published mean of two ratios, or all of it within reach.
enum class WorkspaceFit { published, enclose };
enum class VibrationUnit { radPerSecond, hertz };
enum class VibrationFrame { stylus, device };

/// Beyond these a client gets an error and the scene stays as it was.
struct SceneLimits {
  std::int32_t objects = 10'000;
  std::int32_t nesting = 64;  ///< parents above an object
  std::uint32_t verticesPerObject = 16'000'000;
  std::uint32_t trianglesPerObject = 16'000'000;
  std::uint64_t verticesInAll = 32'000'000;
  std::uint64_t trianglesInAll = 32'000'000;
  std::size_t effects = 64;
  std::size_t batch_bytes = 512U << 20;
};

/// Fixed for the life of a scene.
struct SceneConfig {
  MaterialScale materialScale = MaterialScale::reference;
  WorkspaceFit workspaceFit = WorkspaceFit::published;
  VibrationUnit contactVibrationUnit = VibrationUnit::radPerSecond;
  VibrationFrame motorVibrationFrame = VibrationFrame::stylus;

  /// Reach of the device that workspaces are fitted to, in its own frame.
  geometry::Box deviceWorkspace_m{geometry::Vec3(-0.080, -0.060, -0.035),
                                  geometry::Vec3(0.080, 0.060, 0.035)};
  double nominalStiffness_N_per_m = 1000;  ///< for MaterialScale::device
  double nominalForce_N = 3.3;             ///< for MaterialScale::device
  double ownDamping_Ns_per_m = 5;          ///< device plus grip, for the passivity bound
  double servoPeriod_s = 0.001;
  double transportDelay_s = 0;

  /// No passivity clamp and no limits on surfaces: for measuring.
  bool raw = false;
  /// Tells clients what is wrong with a mesh once it has been complete for a while.
  bool checkMeshes = true;
  SceneLimits limits;

  /// A ball touches the meshes: they get the discs that it gathers by (35 bytes for each triangle).
  /// Without them it works more for the same force. Not recorded.
  bool ballTool = true;

  /// Measures how long building takes, so that it takes at most a quarter of the thread; empty: steady clock.
  /// What is built when follows from it: the builders of a scene that several devices share get the same
  /// readings.
  std::function<base::Nanos()> stopwatch;
  /// When a build has ended, on the same scale: its shape travels from then on; empty: the stopwatch.
  std::function<base::Nanos()> clock;

  /// Tells the servo which clients are gone; null: it learns so from snapshots only. Shared by all builders
  /// of a scene.
  std::shared_ptr<ForceOwners> owners;
};

}  // namespace hapticd::scene
