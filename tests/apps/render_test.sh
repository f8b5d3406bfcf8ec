#!/usr/bin/env bash
# hapticd render on a real scan: the same bytes twice, the proxy holds, errors are plain.
set -euo pipefail
hapticd=$1
source_dir=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

feel() { "$hapticd" render --mesh "$source_dir/testdata/meshes/bunny.obj" --size-mm 73 --hand "$source_dir/examples/hands/bunny_outline.csv" --out "$@"; }
feel a.csv --raw >summary.txt
feel b.csv --raw >/dev/null
cmp a.csv b.csv
grep -q 'step time' summary.txt

# 500 N/m along the depth, never more; most of the stroke touches; the columns are the documented ones.
awk -F, 'NR == 1 { if ($0 != "t_s,hip_x_m,hip_y_m,hip_z_m,proxy_x_m,proxy_y_m,proxy_z_m,force_x_N,force_y_N,force_z_N,depth_m,touching,object,normal_x,normal_y,normal_z") { print "columns: " $0; exit 1 } next }
         { f = sqrt($8*$8 + $9*$9 + $10*$10); if (f > 500 * $11 * 1.0001 + 1e-9) { print "line " NR ": " f " N at depth " $11; exit 1 }
           if ($12 == 0 && ($13 != -1 || f != 0 || $14 != 0)) { print "line " NR ": free, but " $0; exit 1 }
           touching += $12; rows++ }
         END { if (rows < 5000 || touching < 0.8 * rows) { print touching " of " rows " touching"; exit 1 } }' a.csv

# The guard changes what is written, and never above the peak force.
feel guarded.csv --stiffness-N-per-m 1000 >/dev/null
awk -F, 'NR > 1 && $8*$8 + $9*$9 + $10*$10 > 3.3001 * 3.3001 { print "line " NR ": above the peak force"; exit 1 }' guarded.csv

if "$hapticd" render --mesh "$source_dir/README.md" --hand "$source_dir/examples/hands/bunny_outline.csv" --out c.csv 2>error.txt; then
  echo "a text file was taken for a mesh"
  exit 1
fi
grep -q README.md error.txt
printf 't_s,x_m,y_m,z_m\n0,0,zero,0\n' >bad.csv
if "$hapticd" render --mesh "$source_dir/testdata/meshes/bunny.obj" --hand bad.csv --out c.csv 2>error.txt; then
  echo "'zero' was taken for a number"
  exit 1
fi
grep -q 'bad.csv:2' error.txt
