#!/usr/bin/env bash
# Installs the packages of packages.txt that are missing, of the named sections only, and prints how long that took.
#   scripts/install_packages.sh SECTION...
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -gt 0 ] || { sed -n '2,3s/^# *//p' "$0"; exit 2; }
sections=$(sed -n 's/^\[\(.*\)\]$/\1/p' packages.txt)
for wanted in "$@"; do
  grep -qxF -- "$wanted" <<<"$sections" || { echo "packages.txt has no section '$wanted', but" $sections >&2; exit 2; }
done
missing=()
section=""
while read -r package instead; do
  case "$package" in
    "" | \#*) continue ;;
    \[*\]) section=${package//[\[\]]/}; continue ;;
  esac
  [[ " $* " == *" $section "* ]] || continue
  if [ -n "$instead" ] && command -v "$instead" >/dev/null; then continue; fi
  dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'install ok installed' || missing+=("$package")
done <packages.txt
[ "${#missing[@]}" = 0 ] && exit 0
sudo=""
if [ "$(id -u)" != 0 ]; then
  command -v sudo >/dev/null || { echo "these packages are missing and need root to install: ${missing[*]}" >&2; exit 1; }
  sudo=sudo
fi
echo "installing: ${missing[*]}"
SECONDS=0
$sudo apt-get update -q
DEBIAN_FRONTEND=noninteractive $sudo apt-get install -y -q --no-install-recommends "${missing[@]}"
echo "downloads and installation took $SECONDS s"
