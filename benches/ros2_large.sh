#!/usr/bin/env bash
# The largest team that arrives complete over ROS 2. Every message is compared with the shared memory, for growing teams.
#
#     cargo build --release && tests/run (for .venv), then benches/ros2_large.sh
set -euo pipefail
cd "$(dirname "$0")/.."
scene=$(mktemp --suffix .toml)
trap 'rm -f "$scene"' EXIT
for case in "5000 60" "10000 10" "20000 10" "50000 5" "100000 2" "300000 1"; do
  read -r benches rate <<<"$case"
  # Room for the whole team outside the head: a spiral of T turns is pi * pitch * T^2 long.
  turn=$(.venv/bin/python -c "import math; print(math.ceil(math.sqrt($benches * 1.65 / (math.pi * 0.55)) + 18))")
  cat >"$scene" <<SCENE
[team]
benches = $benches
head_length = 3.41
body_length = 2.20
width = 0.30
hole_inset = 0.275
[path]
kind = "spiral"
pitch = 0.55
start_turn = $turn
[motion]
head_speed = 1.0
[publish]
rate = $rate.0
[publish.ros2]
topics = ["handles"]
SCENE
  name="large_$$_$benches"
  target/release/bench-dragon run --scene "$scene" --name "$name" --duration 16 --quiet >/dev/null &
  sleep 3
  echo "$benches benches at $rate Hz:" \
    "$(.venv/bin/python tests/python/ros2_content.py --name "$name" --seconds 9 --topic handles)"
  wait
done
