#!/usr/bin/env bash
# The user unit bench-dragon@.service under a systemd that has booted, as root: ready, watched, restarted, stopped.
# tests/packages/debian.sh starts it.
set -euo pipefail
user() {
  runuser -u dancer -- env XDG_RUNTIME_DIR="/run/user/$(id -u dancer)" HOME=/home/dancer "$@"
}
unit() { user systemctl --user "$@"; }
property() { unit show --value --property "$2" "bench-dragon@$1"; }
# Waits two minutes at most for a property of an instance.
wait_for() {
  for _ in $(seq 1200); do
    [ "$(property "$1" "$2")" = "$3" ] && return
    sleep 0.1
  done
  fail "$1: $2 is $(property "$1" "$2"), not $3"
}
fail() {
  echo "$1"
  user journalctl --user --no-pager --lines 50 || true
  unit --no-pager status 'bench-dragon@*' || true
  exit 1
}

loginctl enable-linger dancer
for _ in $(seq 1200); do
  unit list-units >/dev/null 2>&1 && break
  sleep 0.1
done
settings=/home/dancer/.config
# Six seconds without a sign of life in place of thirty.
user mkdir -p "$settings/systemd/user/bench-dragon@.service.d" "$settings/bench-dragon" /home/dancer/scenes
printf '[Service]\nWatchdogSec=6\n' | user tee "$settings/systemd/user/bench-dragon@.service.d/watchdog.conf" >/dev/null
# One frame in ten seconds, and a scene with a mistake.
echo 'OPTIONS=--rate 0.1' | user tee "$settings/bench-dragon/wide.env" >/dev/null
echo 'SCENES=/home/dancer/scenes' | user tee "$settings/bench-dragon/mistaken.env" >/dev/null
echo 'benches = "many"' | user tee /home/dancer/scenes/mistaken.toml >/dev/null
unit daemon-reload

# The start returns with the first frame.
unit start bench-dragon@school bench-dragon@wide
slow=$(date +%s)
wait_for school ActiveState active
user bench-dragon --name school control pause
[ "$(user bench-dragon --name school --json watch | head -n 1 | cut -c 1)" = "{" ] || fail "watch prints no frame"
echo "ready: $(property school SubState), $(property school WatchdogUSec) of watchdog"

hung=$(property school MainPID)
kill -STOP "$hung"
wait_for school NRestarts 1
wait_for school SubState running
[ "$(property school MainPID)" != "$hung" ] || fail "the same process after a restart"
user bench-dragon --name school control resume
echo "restarted: a publisher that hung, process $hung"

if unit start bench-dragon@mistaken; then fail "a scene with a mistake was started"; fi
wait_for mistaken ActiveState failed
[ "$(property mistaken ExecMainStatus) $(property mistaken NRestarts)" = "2 0" ] || fail "a mistake was tried again"
echo "refused: a scene with a mistake, once"

# Five times the watchdog's time; a frame was due each ten seconds.
while [ $(($(date +%s) - slow)) -lt 30 ]; do sleep 1; done
[ "$(property wide ActiveState) $(property wide NRestarts)" = "active 0" ] || fail "a slow scene is dead"
echo "alive: one frame in ten seconds, for $(($(date +%s) - slow)) s"

unit stop bench-dragon@school bench-dragon@wide
for scene in school wide; do
  [ "$(property "$scene" ActiveState) $(property "$scene" ExecMainStatus)" = "inactive 0" ] || fail "$scene did not stop"
done
# The file that iceoryx2 keeps for later nodes stays.
left=$(find /dev/shm -type f ! -name '*.global_mgmt')
[ -z "$left" ] || fail "left in shared memory: $left"
echo "stopped"
