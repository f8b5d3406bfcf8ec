#!/usr/bin/env bash
# For a build from source: what the Debian package sets up for real devices. Creates the group hapticd, its limits (realtime
# scheduling, locked memory) and the rules for devices, and adds the user who called sudo.
#   sudo scripts/setup_group.sh
set -euo pipefail
cd "$(dirname "$0")/.."
[ "$(id -u)" = 0 ] || { echo "run it by sudo" >&2; exit 1; }
getent group hapticd >/dev/null || groupadd --system hapticd
install -Dm644 packaging/limits/hapticd.conf /etc/security/limits.d/hapticd.conf
install -Dm644 packaging/udev/70-hapticd.rules /etc/udev/rules.d/70-hapticd.rules
if command -v udevadm >/dev/null; then udevadm control --reload || true; fi
if [ -n "${SUDO_USER:-}" ]; then
  usermod -aG hapticd "$SUDO_USER"
  echo "$SUDO_USER is in the group hapticd; log in again"
else
  echo "add users by: usermod -aG hapticd USER"
fi
