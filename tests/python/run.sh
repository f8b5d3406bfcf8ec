#!/usr/bin/env bash
# The tests of the Python packages: run.sh ENVIRONMENT SOURCE_DIR install|NAME. `install` makes a virtual environment of
# Debian's Python and installs the packages there without a network; NAME runs test_NAME.py of a package with it. When
# Debian's packages are missing, it prints the reason and returns 77 (skipped).
set -euo pipefail
environment=$1
source_dir=$2
name=$3
python=${HAPTICD_PYTHON:-/usr/bin/python3}

[ -x "$python" ] || { echo "skipped: $python is missing; install the section python of packages.txt"; exit 77; }
for module in numpy pytest setuptools wheel venv nbclient ipykernel mypy; do
  "$python" -c "import $module" 2>/dev/null || { echo "skipped: $python has no $module; install the section python of packages.txt"; exit 77; }
done
unset PYTHONPATH PYTHONHOME VIRTUAL_ENV
export PYTHONDONTWRITEBYTECODE=1

if [ "$name" = install ]; then
  rm -rf "$environment"
  mkdir -p "$environment"
  "$python" -m venv --system-site-packages "$environment/venv"
  # Copies, because setuptools writes beside the sources.
  for package in python python/lerobot_teleoperator_hapticd; do
    copy="$environment/$(basename "$package")"
    mkdir -p "$copy"
    (cd "$source_dir/$package" && find . -path ./lerobot_teleoperator_hapticd -prune -o -type f -print0 |
      grep -zvE '^\./(build|tests)/|\.egg-info/|__pycache__' | xargs -0 cp --parents -t "$copy")
    "$environment/venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-index --no-build-isolation \
      --no-deps "$copy"
  done
  cd / && "$environment/venv/bin/python" -c 'import hapticd; print(hapticd.__file__)'
  exit 0
fi
test=$(ls "$source_dir"/python/tests/"test_$name.py" "$source_dir"/python/*/tests/"test_$name.py" 2>/dev/null | head -1)
[ -n "$test" ] || { echo "no test_$name.py"; exit 1; }
cd /
exec "$environment/venv/bin/python" -m pytest -q -p no:cacheprovider --rootdir "$(dirname "$test")" "$test"
