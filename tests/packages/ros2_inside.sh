#!/usr/bin/env bash
# Builds and starts the ROS 2 packages in /ws of a Debian 12, as root. tests/packages/ros2.sh starts it.
set -euo pipefail
cd /ws
fail() {
  echo "$1" >&2
  exit 1
}

apt-get update --quiet=2
mapfile -t colcon < <(apt-cache search --names-only '^python3-colcon-' | cut -d ' ' -f 1)
apt-get install --quiet=2 --yes --no-install-recommends colcon "${colcon[@]}" ament-cmake g++ make python3-ament-index \
  python3-argcomplete python3-importlib-metadata python3-osrf-pycommon python3-packaging python3-pytest python3-yaml \
  rosidl-cmake rosidl-generator-c-cpp librosidl-typesupport-introspection-c-cpp-dev >/dev/null

echo "== colcon build"
colcon build --event-handlers summary+ status- console_cohesion- \
  --cmake-args -DBENCH_DRAGON_PROGRAM=/usr/bin/bench-dragon -DBUILD_TESTING=OFF >build.log 2>&1 ||
  { cat build.log; fail "colcon failed"; }
grep Summary: build.log
set +u
# shellcheck disable=SC1091
source install/setup.bash
set -u
export PYTHONPATH="/ws/standin:$PYTHONPATH"
[ -e install/bench_dragon_msgs/include/bench_dragon_msgs/bench_dragon_msgs/msg/stage.hpp ] || fail "no C++ Stage"

echo "== ros2 run"
[ "$(ros2 pkg executables bench_dragon | sort | xargs)" = "bench_dragon bench-dragon bench_dragon publisher" ] ||
  fail "other executables: $(ros2 pkg executables bench_dragon)"
# Prints the rate and the ROS 2 topics of a start.
started() { grep --only-matching -E '[0-9]+ frames per second, from|/[a-z_/]+/handles' | xargs; }
node=(--ros-args -r __ns:=/show -r __node:=gold -p rate:=30.0)
shown=$(ros2 run bench_dragon publisher --duration 1 "${node[@]}" 2>&1 | started)
[ "$shown" = "30 frames per second, from /show/gold/handles" ] || fail "ros2 run started \"$shown\""
for refused in "-r handles:=x" "-p colour:=red" "-r gold:__ns:=/x" "--enclave /x"; do
  # shellcheck disable=SC2086
  said=$(ros2 run bench_dragon publisher --duration 1 --ros-args $refused 2>&1 || true)
  [[ $said == *"--ros-args: $refused is not"* || $said == *"--ros-args: ${refused% *} is not"* ]] ||
    fail "\"$refused\" is not refused: $said"
done

echo "== ros2 launch"
launched() { timeout --signal=INT 300 ros2 launch "$@" >launch.log 2>&1 & }
# Waits until the publisher has begun, ends it as Ctrl-C does, and requires a clean end and these words.
ends_with() {
  local launch=$!
  for _ in $(seq 600); do
    grep -q 'ROS 2 topics' launch.log && break
    kill -0 "$launch" 2>/dev/null || break
    sleep 0.1
  done
  kill -INT "$launch" 2>/dev/null || true
  wait "$launch" || true
  grep -q 'process has finished cleanly' launch.log || { cat launch.log; fail "the launch did not end cleanly"; }
  [ "$(started <launch.log)" = "$1" ] || fail "the launch started \"$(started <launch.log)\""
}
launched bench_dragon show.launch.py scene:=school name:=launched rate:=25
ends_with "25 frames per second, from /launched/handles"
launched ros2_own.launch.py
ends_with "20 frames per second, from /outer/hall/gold/handles"
echo "PASS"
