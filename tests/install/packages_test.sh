#!/usr/bin/env bash
# Installs the packages in a root of their own, uses them as an ordinary user, upgrades them over an edited configuration,
# removes and purges them, and looks for what is left.
#   packages_test.sh FOLDER VERSION overlay    over this machine's root, which stays as it is; needs no network
#   packages_test.sh FOLDER VERSION clean      in a minimal Debian 12 made by mmdebstrap, which downloads it and what we depend on
# Needs root; without it, or without mmdebstrap, it prints the reason and returns 77 (skipped).
set -euo pipefail
packages=$(realpath "$1")
without=""  # a package that this root cannot take
version=$2
kind=${3:-overlay}
skip() { echo "skipped: $1"; exit 77; }
[ "$(id -u)" = 0 ] || skip "not root"

# All mounts are in a namespace and vanish with it; nothing of the machine is mounted below the root in a way that the root could
# write to, and nothing is deleted recursively.
if [ "${HAPTICD_PACKAGES_WORK:-}" = "" ]; then
  unshare -m true 2>/dev/null || skip "no mount namespace here"
  work=$(mktemp -d)
  status=0
  HAPTICD_PACKAGES_WORK=$work unshare -m --propagation private "$0" "$packages" "$version" "$kind" || status=$?
  rmdir "$work"
  exit "$status"
fi
work=$HAPTICD_PACKAGES_WORK
mount -t tmpfs tmpfs "$work"
root=$work/root
written=$root  # where the root's own files are, and nobody else's
mkdir -p "$root" "$work/upper" "$work/work"
if [ "$kind" = overlay ]; then
  ! dpkg-query -W hapticd >/dev/null 2>&1 || skip "hapticd is installed on this machine"
  mount -t overlay overlay -o "lowerdir=/,upperdir=$work/upper,workdir=$work/work" "$root" 2>/dev/null || skip "no overlay file system"
  written=$work/upper
  install="dpkg -i"
  dpkg-query -W python3-numpy >/dev/null 2>&1 || without=python3-hapticd  # it would miss its dependency
else
  command -v mmdebstrap >/dev/null || skip "mmdebstrap is missing"
  mmdebstrap --variant=apt --quiet bookworm "$root" || skip "mmdebstrap reaches no mirror"
  cp /etc/resolv.conf "$root/etc/resolv.conf"
  install="apt-get install -y -q --no-install-recommends"
fi
mount -t proc proc "$root/proc"
mount -t tmpfs -o mode=755 tmpfs "$root/dev"
for node in null:3 zero:5 full:7 random:8 urandom:9; do mknod -m 666 "$root/dev/${node%:*}" c 1 "${node#*:}"; done
ln -s /proc/self/fd "$root/dev/fd"
mkdir -m 1777 "$root/dev/shm"
printf '#!/bin/sh\nexit 101\n' >"$root/usr/sbin/policy-rc.d"  # starts no service
chmod 755 "$root/usr/sbin/policy-rc.d"
mkdir -p "$root/packages" "$root/home/someone"
chmod 777 "$root/home/someone"
cp "$packages"/*.deb "$root/packages/"
[ -z "$without" ] || rm -f "$root/packages/$without"_*.deb
in_root() { env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive HOME=/root chroot "$root" "$@"; }
as_user() { in_root setpriv --reuid=65534 --regid=65534 --clear-groups env HOME=/home/someone "$@"; }
fail() { echo "FAILED: $1"; exit 1; }

# What was written in this root, but for caches and logs. Below an overlay the machine goes on: a build beside this test makes files
# of the same name. A character device stands for a file that was removed.
list() {
  local place places=()
  for place in proc run dev packages tmp var/cache var/log var/lib/apt var/lib/dpkg var/lib/systemd home; do places+=(-path "$written/$place" -o); done
  find "$written" -xdev \( "${places[@]}" -false \) -prune -o -path "$written/*hapticd*" ! -type c -print | sed "s|^$written||" | sort
}
list >"$work/before"

echo "-- install"
[ "$kind" = overlay ] || in_root apt-get update -q
in_root sh -c "$install /packages/*.deb"
in_root hapticd --version | grep -q "^hapticd $version "
in_root getent passwd hapticd
in_root getent group hapticd
in_root grep -q '@hapticd - rtprio 80' /etc/security/limits.d/hapticd.conf
for file in /lib/systemd/system/hapticd.service /lib/systemd/system/hapticd-loopback.service /usr/share/polkit-1/rules.d/50-hapticd.rules /lib/udev/rules.d/70-hapticd.rules /usr/share/man/man1/hapticd-serve.1.gz \
  /usr/share/bash-completion/completions/hapticd /usr/share/applications/hapticd.desktop /usr/share/hapticd/grafana/hapticd.json \
  /usr/share/doc/hapticd/copyright /usr/share/doc/hapticd-doc/configuration.md; do
  [ -e "$root$file" ] || fail "$file is not installed"
done
python3 - "$root/usr/share/doc/hapticd-doc" <<'PYTHON' || fail "links of the documentation lead nowhere"
import pathlib, re, sys
lost = [(page.name, link) for page in pathlib.Path(sys.argv[1]).rglob("*.md")
        for link in re.findall(r"\]\(([^)\s#]+)(?:#[^)\s]*)?\)", page.read_text())
        if not re.match("[a-z]+:", link) and not (page.parent / link).exists()]
print(*lost, sep="\n")
sys.exit(bool(lost))
PYTHON
grep -q 'stop hapticd.service' "$root/var/lib/dpkg/info/hapticd.prerm" || fail "a removal leaves the service running"
! in_root test -e /etc/systemd/system/multi-user.target.wants/hapticd.service || fail "the service is enabled without consent"
! in_root test -e /etc/systemd/system/multi-user.target.wants/hapticd-loopback.service || fail "the loopback service is enabled without consent"

echo "-- use, as a user without rights"
as_user hapticd serve --config /etc/hapticd/hapticd.toml --check-config | grep -q 'name'
in_root sed 's/^driver = "simulated"/driver = "openhaptics"/' /etc/hapticd/hapticd.toml >"$root/packages/arm.toml"
as_user hapticd serve --config /packages/arm.toml --check-config >"$root/packages/arm.effective"
grep -qx 'driver = "openhaptics"' "$root/packages/arm.effective" || fail "the driver in the installed configuration was not changed"
grep -qx 'isolate = true' "$root/packages/arm.effective" || fail "the installed configuration switches off the isolation of openhaptics"
as_user hapticd self-test --seconds 0.3
as_user hapticd serve --listen 127.0.0.1:0 --http off --seconds 0.2
if in_root sh -c 'command -v g++ && command -v pkg-config' >/dev/null; then
  printf '#include "hapticd/client.h"\nint main() { try { hapticd::Client c("P@tcp://127.0.0.1:1"); } catch (const hapticd::Error&) { return 0; } return 1; }\n' >"$root/packages/user.cpp"
  in_root sh -c 'cd /packages && g++ -std=c++20 user.cpp $(pkg-config --cflags hapticd) -lhapticd -o user && ./user'
fi
if ls "$root"/packages/python3-hapticd_*.deb >/dev/null 2>&1; then
  in_root sh -c 'cd / && /usr/bin/python3 -c "import hapticd; print(hapticd.__name__)"'
fi

echo "-- upgrade over an edited configuration"
echo '# mine' >>"$root/etc/hapticd/hapticd.toml"
mkdir "$root/packages/next"
for package in "$root"/packages/*.deb; do
  name=$(basename "${package%%_*}")
  in_root dpkg-deb -R "/packages/$(basename "$package")" "/packages/next/$name"
  sed -i -E "s/^Version: .*/Version: $version+next/; s/\(= $version\)/(= $version+next)/g" "$root/packages/next/$name/DEBIAN/control"
  in_root dpkg-deb -Znone -b "/packages/next/$name" "/packages/next/$name.deb" >/dev/null
done
in_root sh -c "$install /packages/next/*.deb"
[ "$(in_root dpkg-query -W -f='${Version}' hapticd)" = "$version+next" ] || fail "not upgraded"
grep -q '# mine' "$root/etc/hapticd/hapticd.toml" || fail "the upgrade lost the operator's configuration"

echo "-- remove and purge"
mkdir -p "$root/var/lib/hapticd"
touch "$root/var/lib/hapticd/black_box.csv"
names=$(in_root dpkg-query -W -f='${Package}\n' '*hapticd*' | grep -E '^(python3-|lib)?hapticd' | tr '\n' ' ')
# shellcheck disable=SC2086
in_root dpkg --remove $names
[ -e "$root/etc/hapticd/hapticd.toml" ] || fail "a removal took the configuration"
# shellcheck disable=SC2086
in_root dpkg --purge $names
list >"$work/after"
comm -13 "$work/before" "$work/after" | tee "$work/left"
[ ! -s "$work/left" ] || fail "the files above are left"
echo "-- all good"
