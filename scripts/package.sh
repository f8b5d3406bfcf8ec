#!/usr/bin/env bash
# Packages of a finished release build: .deb files, a relocatable tar.gz, and a container image where podman runs. The same
# commit gives the same bytes.
#   scripts/package.sh              builds what is missing in build/release, and packages it into build/package
#   scripts/package.sh --quick      and checks: lintian, exposure of the service, installed, used, upgraded and purged over this
#                                   root. The last line is 'package: N passed, N failed, N skipped'
#   scripts/package.sh --check      the same, and packages again: the same bytes
#   scripts/package.sh --clean      the same, and in a minimal Debian 12, which it downloads
#   scripts/package.sh --long       the same, and compiles a second time and compares the packages
set -euo pipefail
cd "$(dirname "$0")/.."
source=$PWD
check=""
long=""
roots=(overlay)
for argument in "$@"; do
  case "$argument" in
    --quick) check=quick ;;
    --check) check=yes ;;
    --clean) check=yes; roots=(overlay clean) ;;
    --long) check=yes; roots=(overlay clean); long=yes ;;
    *) sed -n '2,9s/^# *//p' "$0"; exit 2 ;;
  esac
done

for tool in dh dpkg-buildpackage lintian systemd-analyze; do
  command -v "$tool" >/dev/null || { scripts/install_packages.sh package; break; }
done

version=$(sed -nE 's/^project\(hapticd VERSION ([0-9.]+).*/\1/p' CMakeLists.txt)
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct 2>/dev/null || stat -c %Y CHANGELOG.md)
export SOURCE_DATE_EPOCH LC_ALL=C.UTF-8 TZ=UTC
umask 022
targets=(hapticd hapticd-bench hapticd_client_archive hapticd_client_shared hapticd_vrpn)

# stage BUILD DIR: the installed files of a build below DIR/usr, and those of the system.
stage() {
  local build=$1 root=$2
  rm -rf "$root"
  HAPTICD_NO_DEBUG_FILES=1 DESTDIR=$root cmake --install "$build" --prefix /usr >"$root.log" 2>&1 || { cat "$root.log"; return 1; }
  strip --strip-debug --enable-deterministic-archives "$root"/usr/lib/libhapticd_client.a
  local system=$root/usr/share/hapticd/system
  install -Dm644 "$system/hapticd.toml" "$root/etc/hapticd/hapticd.toml"
  install -Dm644 "$system/limits.conf" "$root/etc/security/limits.d/hapticd.conf"
  install -Dm644 "$system/70-hapticd.rules" "$root/lib/udev/rules.d/70-hapticd.rules"
  install -Dm644 "$system/hapticd-loopback.service" "$root/lib/systemd/system/hapticd-loopback.service"
  install -Dm644 "$system/polkit.rules" "$root/usr/share/polkit-1/rules.d/50-hapticd.rules"
  local doc=$root/usr/share/doc/hapticd-doc
  mkdir -p "$doc"
  cp -r docs/. examples "$doc/"
  cp CHANGELOG.md "$doc/releases.md"
  # Links to what has another place there, or is in the sources only.
  sed -i 's#](docs/#](#g' "$doc/releases.md"
  sed -i -E 's#\]\(\.\./CHANGELOG\.md#](releases.md#g; s#\]\(\.\./examples#](examples#g; s#\[([^]]*)\]\(\.\./[^)]*\)#\1#g' "$doc"/*.md
  sed -i 's#](../docs/#](../#g' "$doc/examples/README.md"
  sed -i -E 's#\[([^]]*)\]\(\.\./\.\./[^)]*\)#\1#g' "$doc"/decisions/*.md
}

# package BUILD OUT: all packages of a build into OUT.
package() {
  local build=$1 out=$2 work
  rm -rf "$out"
  mkdir -p "$out"
  work=$out/work
  stage "$build" "$out/stage"
  tar -C "$out/stage/usr" --sort=name --mtime="@$SOURCE_DATE_EPOCH" --owner=0 --group=0 --numeric-owner \
    --transform "s,^\.,hapticd-$version-linux-$(uname -m)," -cf - . | gzip -n9 >"$out/hapticd-$version-linux-$(uname -m).tar.gz"
  # The Debian packages have these files in their places.
  rm -rf "$out/stage/usr/share/hapticd/system" "$out/stage/usr/share/doc/hapticd"

  mkdir -p "$work/hapticd"
  cp -r packaging/debian "$work/hapticd/debian"
  local debian=$work/hapticd/debian
  if [ -d python/hapticd ]; then
    sed -e "/^@PYTHON@$/{r packaging/debian/python.in
d}" "$debian/control.in" >"$debian/control"
    mkdir -p "$out/stage/usr/lib/python3/dist-packages"
    cp -r python/hapticd "$out/stage/usr/lib/python3/dist-packages/"
    find "$out/stage/usr/lib/python3" -name __pycache__ -prune -exec rm -rf {} +
    echo usr/lib/python3/dist-packages >"$debian/python3-hapticd.install"
  else
    sed 's/^@PYTHON@$//' "$debian/control.in" >"$debian/control"
  fi
  if [ -e "$out/stage/usr/bin/hapticd-ros2" ]; then
    sed -i -e "/^@ROS2@$/{r packaging/debian/ros2.in
d}" "$debian/control"
  else
    sed -i 's/^@ROS2@$//' "$debian/control"
    rm "$debian"/hapticd-ros2.*
  fi
  sed -e 's/^$/./; s/^/ /' LICENSE >"$work/license"
  sed -e "/^@LICENSE@$/{r $work/license
d}" "$debian/copyright.in" >"$debian/copyright"
  printf 'hapticd (%s) unstable; urgency=medium\n\n  * See CHANGELOG.md of this version.\n\n -- hapticd developers <developers@hapticd.invalid>  %s\n' \
    "$version" "$(date -R -d "@$SOURCE_DATE_EPOCH")" >"$debian/changelog"
  cp packaging/systemd/hapticd.service "$debian/hapticd.service"
  cp packaging/sysusers/hapticd.conf "$debian/hapticd.sysusers"
  mkdir -p "$debian/source"
  echo '3.0 (native)' >"$debian/source/format"
  (cd "$work/hapticd" && STAGE=$out/stage VERSION=$version DEB_BUILD_OPTIONS="nocheck parallel=2" \
    dpkg-buildpackage --build=binary --no-sign --no-check-builddeps) >"$out/build.log" 2>&1 || { tail -30 "$out/build.log"; return 1; }
  mv "$work"/*.deb "$out/"
  rm -rf "$work" "$out/stage"
}

build=$source/build/release
[ -e "$build/build.ninja" ] || { scripts/install_packages.sh build viewer; scripts/configure_programs.sh >/dev/null; }
# Only where Cyclone DDS was found.
[ ! -d "$build/apps/ros2/CMakeFiles/hapticd-ros2.dir" ] || targets+=(hapticd-ros2)
cmake --build "$build" --target "${targets[@]}" >build/package.log 2>&1 || { tail -30 build/package.log; exit 1; }
out=$source/build/package
package "$build" "$out"
(cd "$out" && ls -l ./*.deb ./*.tar.gz | awk '{print $5, $9}')
if command -v podman >/dev/null && podman info >/dev/null 2>&1; then
  podman build -q -t "hapticd:$version" -f packaging/Containerfile "$out" && echo "container: hapticd:$version"
else
  echo "container: not built, podman does not run here; packaging/Containerfile builds it from the packages"
fi
[ -n "$check" ] || exit 0

passed=0
failed=0
skipped=0
result() { # result STATUS NAME
  case "$1" in
    0) passed=$((passed + 1)); echo "  passed   $2" ;;
    77) skipped=$((skipped + 1)); echo "  skipped  $2" ;;
    *) failed=$((failed + 1)); echo "  FAILED   $2" ;;
  esac
}

status=0
lintian --allow-root --tag-display-limit 0 --fail-on error,warning --suppress-tags bogus-mail-host,initial-upload-closes-no-bugs \
  "$out"/*.deb >"$out/lintian.log" 2>&1 || status=$?
[ "$status" = 0 ] || cat "$out/lintian.log"
result "$status" "lintian: no error, no warning"

if [ "$check" != quick ]; then
  package "$build" "$out/again"
  status=0
  for file in "$out"/*.deb "$out"/*.tar.gz; do
    cmp "$file" "$out/again/$(basename "$file")" || status=1
  done
  result "$status" "packaged twice: the same bytes"
  rm -rf "$out/again"
fi

if [ -n "$long" ]; then
  # In a place of its own, with the same path inside: copies of the sources below build/.
  status=0
  scripts/configure_programs.sh -B "$source/build/release2" >/dev/null
  CCACHE_DISABLE=1 cmake --build "$source/build/release2" --target "${targets[@]}" >build/package2.log 2>&1 || status=1
  [ "$status" != 0 ] || package "$source/build/release2" "$out/second"
  for file in "$out"/*.deb "$out"/*.tar.gz; do
    cmp "$file" "$out/second/$(basename "$file")" || status=1
  done
  result "$status" "compiled twice: the same bytes"
fi

status=0
if command -v systemd-analyze >/dev/null; then
  exposure=$(systemd-analyze security --offline=true packaging/systemd/hapticd.service 2>&1 | sed -nE 's/.*exposure level.*: ([0-9.]+).*/\1/p')
  awk -v e="$exposure" 'BEGIN { exit !(e != "" && e <= 2.0) }' || status=1
  result "$status" "service: exposure $exposure, at most 2.0"
else
  result 77 "service: systemd-analyze is missing"
fi

for root in "${roots[@]}"; do
  status=0
  tests/install/packages_test.sh "$out" "$version" "$root" >"$out/install_$root.log" 2>&1 || status=$?
  [ "$status" = 0 ] || tail -40 "$out/install_$root.log"
  result "$status" "installed, used, upgraded, removed and purged: $root root"
done

echo "package: $passed passed, $failed failed, $skipped skipped"
[ "$failed" = 0 ] || exit 1
[ "$skipped" = 0 ] || exit 77
