#!/usr/bin/env bash
# Runs one example against a server with the simulated hand, and reads what it prints. The hand may need a while
# to find the surface on a slow machine: an example that felt nothing is run again, a few times.
#   example_test.sh HAPTICD PATH_OF_EXAMPLE SOURCE_DIR [SCENE]
set -euo pipefail
hapticd=$1
example=$2
source_dir=$3
scene=${4:-}
name=$(basename "$example")
. "$source_dir/tests/apps/server.sh"
device="Phantom@$address"

# The force in lines such as "touching  force  0.000  0.812  0.000 N", at least so many newtons of it.
felt() { awk -v least="$1" '/^touching/ { if ($3^2 + $4^2 + $5^2 >= least^2) ok = 1 } END { exit !ok }' "$work/out"; }
# The last number before a unit in the line with this text is at least so much.
at_least() { awk -v text="$1" -v least="$2" 'index($0, text) { for (i = NF; i > 0; --i) if ($i ~ /^[0-9.]+$/) { if ($i >= least) ok = 1; break } } END { exit !ok }' "$work/out"; }

check() {
  case "$name" in
    example_touch_sphere)
      "$example" "$device" 4 >"$work/out"
      felt 0.1 ;;
    example_upload_mesh)
      "$example" "$source_dir/testdata/meshes/bunny.obj" "$device" >"$work/out"
      printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 1\nf -4/1 -1/2/3 2\n' >"$work/relative.obj"
      "$example" "$work/relative.obj" "$device" >"$work/relative"
      grep -q '^2 triangles sent' "$work/relative" && ! grep -q 'no area' "$work/relative" &&
        grep -q '100 %' "$work/out" && grep -q '^3674 triangles sent' "$work/out" ;;
    example_follow_contact_point)
      "$example" "$device" 4 >"$work/out"
      grep -q '^contact$' "$work/out" && grep -qE '^surface .* -10\.00 .* mm   device .* mm$' "$work/out" ;;
    example_vibration_effects)
      "$example" "$device" 0.5 >"$work/out"
      at_least 'a push upwards' 0.5 && at_least 'a pull to the middle' 0.1 && at_least 'a vibration of 100 Hz' 0.2 ;;
    example_moving_object)
      "$example" "$device" 4 >"$work/out"
      grep -qE '^plate .* mm  touching  force -?[0-9.]+ N$' "$work/out" ;;
    example_several_clients)
      "$example" "$device" 4 >"$work/out"
      grep -q 'the builder has left' "$work/out" && [ "$(grep -cE '^force reports: [1-9][0-9]* and [1-9]' "$work/out")" = 2 ] ;;
    example_paper_figure8)
      "$example" "$device" 4 >"$work/out"
      grep -q '^object 0 is touched' "$work/out" && grep -qE '^[1-9][0-9]* force reports' "$work/out" ;;
    example_log_to_csv)
      "$(dirname "$example")/example_upload_mesh" "$source_dir/testdata/meshes/bunny.obj" "$device" >/dev/null
      "$example" "$device" 4 >"$work/out"
      awk -F, 'NR == 1 { if ($0 != "time_s,report,values") bad = 1; next }
               $2 == "pose" { poses += NF == 10 }
               $2 == "force" { forces += NF == 5 }
               $1 !~ /^[0-9]+\.[0-9][0-9][0-9][0-9][0-9][0-9]$/ { bad = 1 }
               END { exit bad || !poses || !forces }' "$work/out" ;;
    example_client_dynamics)
      # The hand touches what another client left: that does not push the box.
      "$hapticd" touch "$source_dir/testdata/meshes/bunny.obj" --server "$device" --seconds 1 >/dev/null
      "$example" "$device" 6 >"$work/out"
      head -1 "$work/out" | grep -qE '^box at +-?0\.0[0-9] +-?0\.0[0-9] +-?0\.0[0-9] mm$' || return 1
      at_least 'the box moved' 5 && grep -qE '^touched in [1-9][0-9]+ ticks, at most [0-9.]+ N' "$work/out" ;;
    example_mujoco)
      "$example" --help 2>"$work/help" && return 1
      grep -q '^usage: mujoco SCENE.xml' "$work/help" || return 1
      # A hand that rests: one place at time 0.
      sed -Ez 's/(name="path" data="[^ ]+ [^ ]+ [^ ]+ [^ "]+)[^"]*/\1/' "$source_dir/examples/mujoco/$scene.xml" >"$work/rests.xml"
      "$example" "$work/rests.xml" "$device" 0.2 | grep -q '^touched in [0-9]* of [1-9]' || return 1
      "$example" "$source_dir/examples/mujoco/$scene.xml" "$device" 5 "$work/picture.svg" >"$work/out"
      # The peg is in its hole: its middle is 16 mm above its end.
      { [ "$scene" != peg_in_hole ] || grep -q 'down to -[0-9]' "$work/out"; } &&
        at_least 'at most' 0.2 && grep -qE '^touched in [1-9][0-9]+ of' "$work/out" && [ "$(grep -c '<path' "$work/picture.svg")" -gt 500 ] ;;
    *) echo "no test for $name"; exit 1 ;;
  esac
}

for attempt in 1 2 3 4 5; do
  check && ok=1 || ok=0
  echo "== $name, attempt $attempt"
  tail -12 "$work/out"
  if [ "$ok" = 1 ]; then
    kill -TERM "$server"
    wait "$server"
    exit 0
  fi
done
cat "$work/log"
exit 1
