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

# 500 N/m along the depth, never more; most of the stroke touches.
awk -F, 'NR == 1 { for (i = 1; i <= NF; i++) c[$i] = i; next }
         { fx = $c["force_x_N"]; fy = $c["force_y_N"]; fz = $c["force_z_N"]; depth = $c["depth_m"]; f = sqrt(fx*fx + fy*fy + fz*fz)
           if (f > 500 * depth * 1.0001 + 1e-9) { print "line " NR ": " f " N at depth " depth; exit 1 }
           if ($c["touching"] == 0 && ($c["object"] != -1 || f != 0 || $c["normal_x"] != 0)) { print "line " NR ": free, but " $0; exit 1 }
           touching += $c["touching"]; rows++ }
         END { if (rows < 5000 || touching < 0.8 * rows) { print touching " of " rows " touching"; exit 1 } }' a.csv

# The guard changes what is written, and never above the peak force.
feel guarded.csv --stiffness-N-per-m 1000 >/dev/null
awk -F, 'NR == 1 { for (i = 1; i <= NF; i++) c[$i] = i; next }
         $c["force_x_N"]^2 + $c["force_y_N"]^2 + $c["force_z_N"]^2 > 3.3001 * 3.3001 { print "line " NR ": above the peak force"; exit 1 }' guarded.csv

# What was written is a hand, too: the same way through the mesh gives the same forces.
"$hapticd" render --mesh "$source_dir/testdata/meshes/bunny.obj" --size-mm 73 --hand a.csv --out again.csv --raw >/dev/null 2>remark.txt
[ ! -s remark.txt ] || { cat remark.txt; exit 1; }
awk -F, 'NR == FNR { if (FNR == 1) for (i = 1; i <= NF; i++) c[$i] = i; else { x[FNR] = $c["force_x_N"]; y[FNR] = $c["force_y_N"] } next }
         FNR > 1 && ($c["force_x_N"] - x[FNR])^2 + ($c["force_y_N"] - y[FNR])^2 > 1e-6 { print "line " FNR ": other force"; exit 1 }' a.csv again.csv
[ "$(wc -l <a.csv)" = "$(wc -l <again.csv)" ]
# Columns of older versions are read, with a remark.
sed '1s/hip_\([xyz]\)_m/hand_\1_m/g' a.csv >old.csv
"$hapticd" render --mesh "$source_dir/testdata/meshes/bunny.obj" --size-mm 73 --hand old.csv --out from_old.csv --raw >/dev/null 2>remark.txt
grep -q 'older version' remark.txt
cmp again.csv from_old.csv

# A hand beside the mesh is no error, and probably a mistake.
printf 't_s,x_m,y_m,z_m\n0,1,1,1\n0.1,1,1,1.1\n' >far.csv
"$hapticd" render --mesh "$source_dir/testdata/meshes/bunny.obj" --hand far.csv --out far_felt.csv >/dev/null 2>remark.txt
grep -q 'never touched the mesh: the hand is at x 1000 to 1000, y 1000 to 1000, z 1000 to 1100 mm; the mesh at x -' remark.txt

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
