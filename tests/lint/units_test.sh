#!/usr/bin/env bash
# The exposure of the systemd units, as systemd computes it, and what a haptics server must still be allowed.
set -euo pipefail
cd "$1"
command -v systemd-analyze >/dev/null || exit 77
bad=0
check() {  # UNIT MOST
  local unit=packaging/systemd/$1.service exposure
  exposure=$(systemd-analyze security --offline=true "$unit" 2>/dev/null | sed -nE 's/.*exposure level.*: ([0-9.]+).*/\1/p')
  [ -n "$exposure" ] || exit 77 # an older systemd
  awk -v e="$exposure" -v most="$2" 'BEGIN { exit !(e <= most) }' || { echo "$unit: exposure $exposure, at most $2"; bad=1; }
  for line in LimitRTPRIO=80 LimitMEMLOCK=infinity KillMode=mixed Restart=on-failure RuntimeDirectory=hapticd; do
    grep -qx "$line" "$unit" || { echo "$unit: $line is missing"; bad=1; }
  done
  ! grep -qE '^RestrictRealtime=(yes|true|1)|^SystemCallFilter=~.*(@resources|sched_setscheduler|mlock)' "$unit" ||
    { echo "$unit: the servo needs realtime scheduling and locked memory"; bad=1; }
}
check hapticd 2.0
check hapticd-loopback 1.5
exit "$bad"
