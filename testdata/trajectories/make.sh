#!/usr/bin/env bash
# Writes the trajectories of this folder into the current one. README.md has the formulas.
set -euo pipefail

make() {  # FILE, z of the position, force along x, force along z: awk expressions in z and d
  awk "BEGIN {
    print \"# t/s x/mm y/mm z/mm fx/N fy/N fz/N\"
    for (k = 0; k <= 200; k++) {
      d = k <= 40 ? 0 : k <= 80 ? 1.52 * (k - 40) / 40 : k <= 160 ? 1.52 : 1.52 * (200 - k) / 40
      z = k < 40 ? 1 - k / 40 : 0 - d
      printf \"%.4f %.3f %.3f %.6f %.6f 0 %.6f\\n\", 12 + k * 0.0025, -5 + k * 0.05, $2, $3, $4, $5
    }
  }" >"$1"
}

make in.traj 0 z 0 0
make proxy.traj 0 '(z > 0 ? z : 0)' 0 '0.5 * d'
make probe.traj 0.2 '(z > 0 ? z : 0)' '0 - 0.375 * d' '0.5 * d'
