#!/usr/bin/env bash
# Builds the wheels of the Python packages without a network: the same bytes from the same sources.
#   scripts/wheel.sh OUT_DIR [PYTHON]
# Needs the section python of packages.txt. The time stamps in the wheels are $SOURCE_DATE_EPOCH, or that of the last commit.
set -euo pipefail
source_dir=$(cd "$(dirname "$0")/.." && pwd)
[[ $# -ge 1 && $1 != -* ]] || { sed -n '2,4s/^# *//p' "$0"; exit 2; }
mkdir -p "$1"
out=$(cd "$1" && pwd)
python=${2:-/usr/bin/python3}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git -C "$source_dir" log -1 --format=%ct 2>/dev/null || true)}
export SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-315532800} PYTHONDONTWRITEBYTECODE=1 # a zip starts with 1980
umask 022
# Copies, because setuptools writes beside the sources; files of the package only.
for package in python/hapticd python/lerobot_teleoperator_hapticd/lerobot_teleoperator_hapticd; do
  name=$(basename "$package")
  folder=$source_dir/$(dirname "$package")
  mkdir -p "$work/$name/$name"
  cp "$folder/pyproject.toml" "$folder/README.md" "$work/$name"
  cp "$source_dir/$package"/*.py "$work/$name/$name"
  [ ! -e "$source_dir/$package/py.typed" ] || cp "$source_dir/$package/py.typed" "$work/$name/$name"
  find "$work/$name" -type f -exec chmod 644 {} +
  (cd "$work" && "$python" -m pip wheel --quiet --disable-pip-version-check --no-index --no-build-isolation --no-deps \
    --wheel-dir "$out" "./$name")
done
