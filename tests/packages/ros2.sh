#!/usr/bin/env bash
# The ROS 2 packages on a clean Debian 12, which is installed into a folder. Colcon builds `msgs` (C and C++) and
# `bench_dragon` from the archive of packaging/build with Debian's ament and rosidl. `ros2 run` and `ros2 launch` start
# the publisher. As root; needs debootstrap, a mirror and what packaging/build needs. SOURCES has git repositories of
# github.com/ros2 that Debian does not have:
# - rosidl_defaults, rcl_interfaces and common_interfaces,
# - launch, launch_ros and ros2cli.
#
# rclpy, which a plain node of a launch file does not use, is a stand-in: no DDS of ROS 2 runs here.
set -euo pipefail
[ $# = 2 ] && [ "$(id -u)" = 0 ] || { echo "usage, as root: $0 FOLDER SOURCES" >&2; exit 2; }
repository=$(cd "$(dirname "$0")/../.." && pwd)
folder=$(realpath -m "$1")
sources=$(realpath "$2")

cd "$repository"
packaging/build ros2
cargo build --quiet --release --locked --bin bench-dragon
[ -e "$folder/etc/debian_version" ] || debootstrap --variant=minbase bookworm "$folder"
rm -rf "$folder/ws"
mkdir -p "$folder/ws/src/ros" "$folder/ws/standin"
tar -xf target/packaging/bench-dragon-ros2-*.tar.gz -C "$folder/ws/src"
install target/release/bench-dragon "$folder/usr/bin/bench-dragon"
cp tests/packages/ros2_standin.py "$folder/ws/standin/sitecustomize.py"
cp tests/packages/ros2_inside.sh tests/packages/ros2_own.launch.py "$folder/ws"
while read -r name branch packages; do
  # shellcheck disable=SC2086
  git -C "$sources/$name" archive "$branch" $packages | tar -x -C "$folder/ws/src/ros"
done <<'END'
rosidl_defaults humble rosidl_default_generators rosidl_default_runtime
rcl_interfaces humble builtin_interfaces
common_interfaces humble std_msgs
launch jazzy launch launch_xml launch_yaml
launch_ros jazzy launch_ros ros2launch
ros2cli jazzy ros2cli ros2pkg ros2run
END
# Mounts of its own, which are gone when it ends.
exec unshare --mount --propagation private bash -euo pipefail -c '
  mount --bind "$1" "$1"
  mount -t proc proc "$1/proc"
  mount --rbind /dev "$1/dev"
  exec chroot "$1" env -i HOME=/root TERM=dumb DEBIAN_FRONTEND=noninteractive \
    PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin bash /ws/ros2_inside.sh' inside "$folder"
