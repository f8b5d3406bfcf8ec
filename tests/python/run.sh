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
  "$python" -m venv --system-site-packages "$environment/venv"
  # Copies, because setuptools writes beside the sources.
  for package in python/hapticd python/lerobot_teleoperator_hapticd/lerobot_teleoperator_hapticd; do
    name=$(basename "$package")
    folder=$source_dir/$(dirname "$package")
    mkdir -p "$environment/$name"
    cp "$folder/pyproject.toml" "$folder/README.md" "$environment/$name"
    cp -r "$source_dir/$package" "$environment/$name"
    "$environment/venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-index --no-build-isolation \
      --no-deps "$environment/$name"
  done
  cd / && "$environment/venv/bin/python" -c 'import hapticd; print(hapticd.__file__)'
  exit 0
fi
test=$(find "$source_dir/python" -name "test_$name.py" -print -quit)
[ -n "$test" ] || { echo "no test_$name.py"; exit 1; }
cd /
exec "$environment/venv/bin/python" -m pytest -q -p no:cacheprovider --rootdir "$(dirname "$test")" "$test"
