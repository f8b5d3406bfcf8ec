#!/usr/bin/env bash
# hapticd render along a trajectory, and its forces beside those of a file: figures that were computed by hand
# (testdata/trajectories/README.md), other units and columns, and errors that name file, line and value.
set -euo pipefail
hapticd=$1
data=$2/testdata/trajectories
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

"$data/make.sh"
for file in in probe proxy; do cmp "$file.traj" "$data/$file.traj"; done

feel() { "$hapticd" render --mesh "$data/plane.obj" --raw --force --out felt.csv "$@"; }
expect() { grep -qF -- "$1" "$2" || { echo "'$1' is missing in:"; cat "$2"; exit 1; }; }
refused() { # TEXT OPTION...
  local text=$1
  shift
  if feel "$@" >out.txt 2>error.txt; then echo "accepted: $*"; exit 1; fi
  expect "$text" error.txt
}

# The ideal renderer: nothing differs but rounding.
feel --hand in.traj --compare proxy.traj >ideal.txt 2>error.txt
[ ! -s error.txt ] || { cat error.txt; exit 1; }
expect 'compared    201 of 201 samples of proxy.traj, 0.000 s to 0.500 s' ideal.txt
expect 'both 155, only rendered 0, only in the file 0, neither 46' ideal.txt
awk '/^force / { if ($4 > 1e-6) bad = 1; seen++ } /^direction / { if ($4 > 1e-4) bad = 1; seen++ }
     /^proxy / { if ($4 > 1e-4) bad = 1; seen++ } END { exit bad || seen != 3 }' ideal.txt || { cat ideal.txt; exit 1; }
[ "$(wc -l <felt.csv)" = 502 ]  # 1 kHz, whatever the rate of the file

# The measured one has friction, which the renderer is not given.
feel --hand in.traj --compare probe.traj >friction.txt
expect 'force       RMS error 0.4152 N (60 % of the RMS force, 0.6921 N), mean 0.3403 N, at most 0.57 N (at 0.200 s)' friction.txt
expect 'magnitude   RMS error 0.1384 N' friction.txt
expect 'direction   RMS angle 36.87 deg, mean 36.87 deg, over 155 samples' friction.txt
expect 'both 155, only rendered 0, only in the file 0, neither 46' friction.txt
expect 'proxy       RMS distance 0.2 mm from' friction.txt

# With that friction nothing differs.
feel --hand in.traj --compare probe.traj --static-friction 0.75 --dynamic-friction 0.75 >fitted.txt
awk '/^force / { if ($4 > 1e-6) bad = 1; seen++ } END { exit bad || seen != 1 }' fitted.txt || { cat fitted.txt; exit 1; }

# Half the stiffness: half the force is missing, in the same direction.
feel --hand in.traj --compare proxy.traj --stiffness 250 >soft.txt
expect '(50 % of the RMS force' soft.txt

# What is compared is the force on the hand: the guard, which --raw leaves out, takes a part of it.
feel --hand in.traj --compare proxy.traj --stiffness 1000 >raw.txt
expect 'at most 0.76 N' raw.txt
"$hapticd" render --mesh "$data/plane.obj" --force --out felt.csv --hand in.traj --compare proxy.traj --stiffness 1000 >guarded.txt
awk '/^force / { sub(/.*at most /, ""); seen += $0 + 0 > 0 && $0 + 0 < 0.7 } END { exit seen != 1 }' guarded.txt || { cat guarded.txt; exit 1; }

# The same data in other columns, units and signs, with hand and reference on a clock of their own.
awk '!/^#/ { print $1 * 1000 ";" (-$5) ";" (-$6) ";" (-$7) ";0;" $2 / 1000 ";" $3 / 1000 ";" $4 / 1000 }' OFMT=%.9g CONVFMT=%.9g probe.traj >other.TRAJ
awk '!/^#/ { print $1 * 1000 ";0;0;0;0;" $2 / 1000 ";" $3 / 1000 ";" $4 / 1000 }' OFMT=%.9g CONVFMT=%.9g in.traj >other_in.traj
other() { feel --hand other_in.traj --compare other.TRAJ --traj-columns t,fx,fy,fz,-,x,y,z --traj-unit m --traj-time-unit ms "$@"; }
other --traj-force surface 2>error.txt | sed 's/other.TRAJ/probe.traj/' >same.txt
[ ! -s error.txt ] || { cat error.txt; exit 1; }
diff <(grep -vE '^(mesh|step|peak)' friction.txt) <(grep -vE '^(mesh|step|peak)' same.txt)
other >turned.txt 2>error.txt
expect 'add --traj-force surface' error.txt

# The measured probe does not enter the surface: rendered along it, nothing is felt, and the hint says so.
feel --hand probe.traj --compare probe.traj >raw.txt 2>error.txt
expect 'both 0, only rendered 0, only in the file' raw.txt

# In a wrong unit it is elsewhere; what is refused with a trajectory is no remedy.
feel --hand in.traj --traj-unit m >far.txt 2>error.txt
expect 'the hand never touched the mesh' error.txt
expect '--traj-unit' error.txt
! grep -- --size-mm error.txt || exit 1

# A CSV hand has the clock of the file only if it was written so.
awk -F'[ ]' 'BEGIN { print "t_s,x_m,y_m,z_m" } !/^#/ { print $1 "," $2 / 1000 "," $3 / 1000 "," $4 / 1000 }' OFMT=%.9g CONVFMT=%.9g in.traj >in.csv
feel --hand in.csv --compare probe.traj >csv.txt
expect 'compared    201 of 201 samples of probe.traj, 12.000 s to 12.500 s' csv.txt
measures() { grep -E '^(force|magnitude|direction|contact|proxy) ' "$1" | sed 's/ (at .*//'; }
diff <(measures friction.txt) <(measures csv.txt)
awk -F, 'NR > 1 { $1 -= 12 } 1' OFS=, OFMT=%.9g CONVFMT=%.9g in.csv >shifted.csv
refused 'both need the same clock' --hand shifted.csv --compare proxy.traj
# Clocks so far apart that nanoseconds between them do not fit into 64 bits.
printf '%s\n' '-8999999990.2 0 0 0 0 0 0' '-8999999990.1 0 0 0 0 0 0' >early.traj
printf '%s\n' '8999999990.1 0 0 0 0 0 0' '8999999990.2 0 0 0 0 0 0' >late.traj
refused 'late.traj begins 17999999980.3 s after the hand: both need the same clock' --hand early.traj --compare late.traj
refused 'early.traj begins 17999999980.3 s before the hand: both need the same clock' --hand late.traj --compare early.traj

awk 'NR == 5 { $3 = "zero" } 1' in.traj >bad.traj
refused "bad.traj:5: column 3 'zero' is not a finite number" --hand bad.traj
refused "bad.traj:5: column 3 'zero' is not a finite number" --hand in.traj --compare bad.traj
awk 'NR == 9 { $1 = 11 } 1' in.traj >back.traj
refused 'back.traj:9: time 11 s is before' --hand back.traj
cut -d' ' -f1-4 in.traj >still.traj
refused 'still.traj has no forces' --hand in.traj --compare still.traj
refused 'missing.traj' --hand in.traj --compare missing.traj
refused "'z' is missing" --hand in.traj --traj-columns t,x,y
refused '--size-mm' --hand in.traj --size-mm 40
refused '--traj-unit needs a .traj file at' --hand in.csv --traj-unit m
refused '--compare needs a .traj file' --hand in.traj --compare in.csv
