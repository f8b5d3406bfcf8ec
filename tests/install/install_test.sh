#!/usr/bin/env bash
# Installs, moves the installed tree, builds programs against it outside of the source tree, and runs them.
#   install_test.sh CMAKE BUILD_DIR SOURCE_DIR COMPILER VERSION
set -euo pipefail
cmake=$1
build_dir=$2
source_dir=$3
compiler=$4
version=$5
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

"$cmake" --install "$build_dir" --prefix "$work/installed" >"$work/install.log" || { cat "$work/install.log"; exit 1; }
mv "$work/installed" "$work/moved"
prefix=$work/moved
if grep -rlE "$source_dir|Boost|boost" "$prefix/include" "$prefix"/lib*/cmake "$prefix"/lib*/pkgconfig; then
  echo "the files above name the source tree or a library that users do not need"
  exit 1
fi

"$cmake" -G Ninja -S "$source_dir/tests/install/user" -B "$work/user" -DCMAKE_PREFIX_PATH="$prefix" \
  -DCMAKE_CXX_COMPILER="$compiler" -DEXAMPLES="$source_dir/examples" >"$work/user.log" || { cat "$work/user.log"; exit 1; }
"$cmake" --build "$work/user" --parallel 2

# A component that does not exist is refused by its name; without components the package is found as with them.
mkdir "$work/asks"
for asked in "" "COMPONENTS rigid_bodies"; do
  printf '%s\n' 'cmake_minimum_required(VERSION 3.22)' 'project(asks LANGUAGES CXX)' "find_package(hapticd REQUIRED $asked)" \
    'get_target_property(type hapticd::vrpn TYPE)' >"$work/asks/CMakeLists.txt"
  found=yes
  "$cmake" -G Ninja -S "$work/asks" -B "$work/asks/build" -DCMAKE_PREFIX_PATH="$prefix" -DCMAKE_CXX_COMPILER="$compiler" \
    >"$work/asks.log" 2>&1 || found=no
  case "$found $asked" in
    "yes ") ;;
    "no COMPONENTS rigid_bodies")
      tr -s ' \n' ' ' <"$work/asks.log" | grep -qF "hapticd has no component 'rigid_bodies'; there are client, client_shared and vrpn" ||
        { cat "$work/asks.log"; exit 1; } ;;
    *) cat "$work/asks.log"; exit 1 ;;
  esac
done

# A project that adds the tree instead gets the same target; C++20 comes with it.
mkdir "$work/adds"
cp "$source_dir/tests/install/user/reads_force.cpp" "$work/adds"
cat >"$work/adds/CMakeLists.txt" <<'CMAKE'
cmake_minimum_required(VERSION 3.22)
project(adds LANGUAGES CXX)
add_subdirectory(${HAPTICD} hapticd EXCLUDE_FROM_ALL)
add_executable(reads_force reads_force.cpp)
target_link_libraries(reads_force PRIVATE hapticd::client)
CMAKE
"$cmake" -G Ninja -S "$work/adds" -B "$work/adds/build" -DCMAKE_CXX_COMPILER="$compiler" -DHAPTICD="$source_dir" -DHAPTICD_WEB=OFF >"$work/adds.log" ||
  { cat "$work/adds.log"; exit 1; }
"$cmake" --build "$work/adds/build" --target CMakeFiles/reads_force.dir/reads_force.cpp.o

export PKG_CONFIG_PATH=$(echo "$prefix"/lib*/pkgconfig)
[ "$(pkg-config --modversion hapticd)" = "$version" ]
[ "$(pkg-config --modversion hapticd-vrpn)" = "$version" ]
if compgen -G "$prefix/lib*/libvrpn*" || [ -e "$prefix/include/vrpn" ]; then
  echo "the files above would overwrite those of an installed VRPN"
  exit 1
fi
# shellcheck disable=SC2046
"$compiler" -std=c++20 "$source_dir/tests/install/user/reads_force.cpp" $(pkg-config --cflags --libs hapticd) -o "$work/by_pkg_config"
# shellcheck disable=SC2046
"$compiler" -std=c++11 "$source_dir/examples/paper_figure8.cpp" $(pkg-config --cflags --libs hapticd-vrpn) \
  -Wl,-rpath,"$(pkg-config --variable=libdir hapticd-vrpn)" -o "$work/figure8_by_pkg_config"

hapticd=$prefix/bin/hapticd
. "$source_dir/tests/apps/server.sh"
for program in "$work/user/reads_force" "$work/user/reads_force_shared" "$work/by_pkg_config"; do
  timeout 60 "$program" "Phantom@$address" | tee "$work/out"
  grep -q '^felt object 0$' "$work/out"
done
for program in "$work/user/figure8" "$work/figure8_by_pkg_config"; do
  timeout 60 "$program" "Phantom@$address" 2 | tee "$work/out"
  grep -qE '^[1-9][0-9]* force reports$' "$work/out"
done
