#!/usr/bin/env bash
# The tests of the Python packages: run.sh ENVIRONMENT SOURCE_DIR install|NAME. `install` builds the wheels twice, which
# must give the same bytes, and installs them in a virtual environment of Debian's Python without a network; NAME runs
# test_NAME.py of a package there. When Debian's packages are missing, it prints the reason and returns 77 (skipped).
set -euo pipefail
environment=$1
source_dir=$2
name=$3
python=${HAPTICD_PYTHON:-/usr/bin/python3}

[ -x "$python" ] || { echo "skipped: $python is missing; install the section python of packages.txt"; exit 77; }
missing=$("$python" - numpy pytest setuptools wheel venv nbclient ipykernel mypy <<'END'
import importlib.util, sys
print(*(name for name in sys.argv[1:] if importlib.util.find_spec(name) is None))
END
)
[ -z "$missing" ] || { echo "skipped: $python has no $missing; install the section python of packages.txt"; exit 77; }
unset PYTHONPATH PYTHONHOME VIRTUAL_ENV
export PYTHONDONTWRITEBYTECODE=1

if [ "$name" = install ]; then
  rm -rf "$environment"
  mkdir -p "$environment"
  # With Debian's pip instead of one of its own, which saves seconds.
  "$python" -m venv --system-site-packages --without-pip "$environment/venv"
  for wheels in wheels again; do "$source_dir/scripts/wheel.sh" "$environment/$wheels" "$environment/venv/bin/python"; done
  for wheel in "$environment"/wheels/*; do
    [[ $wheel == *-py3-none-any.whl ]] || { echo "$wheel is not pure"; exit 1; }
    cmp "$wheel" "$environment/again/$(basename "$wheel")" || { echo "two builds of $wheel differ"; exit 1; }
  done
  "$environment/venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-index --no-deps "$environment"/wheels/*.whl
  cd / && "$environment/venv/bin/python" -c 'import hapticd; print(hapticd.__file__)'
  exit 0
fi
if [ "$name" = igtlink_peer ] && [ -z "${HAPTICD_IGTLINK_PEER:-}" ]; then
  echo "skipped: the library of OpenIGTLink is missing; install libopenigtlink-dev of packages.txt and configure again"
  exit 77
fi
if [ "$name" = ros2 ] && [ -z "${HAPTICD_ROS2_PEER:-}" ]; then
  echo "skipped: Cyclone DDS or Fast DDS is missing; install cyclonedds-dev, cyclonedds-tools and libfastrtps-dev of packages.txt and configure again"
  exit 77
fi
test=$(find "$source_dir/python" -name "test_$name.py" -print -quit)
[ -n "$test" ] || { echo "no test_$name.py"; exit 1; }
cd /
exec "$environment/venv/bin/python" -m pytest -q -p no:cacheprovider --rootdir "$(dirname "$test")" "$test"
