// hapticd render --mesh: renders a mesh along a recorded hand, offline and deterministic.
#pragma once

#include <string>

#include "device/simulated/trajectory_file.h"

namespace hapticd::apps {

struct MeshRenderOptions {
  std::string mesh;
  std::string meshUnit = "mm";
  double size_mm = 0;
  std::string hand;
  std::string compare;  ///< trajectory whose forces the rendered ones are compared with; or empty
  device::TrajectoryFormat trajectory;  ///< of `hand` and `compare`
  std::string out;
  double stiffness_N_per_m = 500;
  double damping_Ns_per_m = 0;
  double staticFriction = 0;
  double dynamicFriction = 0;
  std::string faces = "both";
  double toolRadius_mm = 0;
  bool raw = false;
  bool timing = false;
};

/// Writes the CSV and prints a summary; returns 0. Throws with a remedy in the text.
int renderMesh(const MeshRenderOptions& options);

}  // namespace hapticd::apps
