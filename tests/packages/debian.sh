#!/usr/bin/env bash
# The packages on a clean Debian 12, which is installed into a folder. The .deb passes lintian and is installed, used and
# removed. The wheel in a fresh venv there reads a publisher of the .deb. The user unit runs under systemd, which boots
# from that folder. As root; needs debootstrap, systemd-container, a mirror, PyPI, and what packaging/build needs.
set -euo pipefail
[ $# = 1 ] && [ "$(id -u)" = 0 ] || { echo "usage, as root: $0 FOLDER" >&2; exit 2; }
# Mounts of its own, which are gone when it ends.
[ -n "${PACKAGES_MOUNTS:-}" ] || PACKAGES_MOUNTS=1 exec unshare --mount --propagation private "$0" "$@"
repository=$(cd "$(dirname "$0")/../.." && pwd)
folder=$(realpath -m "$1")

cd "$repository"
packaging/build wheel deb
[ -e "$folder/etc/debian_version" ] || debootstrap --variant=minbase bookworm "$folder"
rm -rf "$folder/opt/packages"
mkdir -p "$folder/opt/packages"
# Authorities that this machine trusts, of a proxy perhaps.
cp -L /etc/ssl/certs/ca-certificates.crt "$folder/opt/packages/authorities.crt"
cp target/packaging/*.{deb,whl} tests/packages/unit.{sh,service} "$folder/opt/packages/"
# Runs a command in the folder, with mounts that end with it.
inside() {
  unshare --mount --propagation private bash -euo pipefail -c '
    mount --bind "$1" "$1"
    mount -t proc proc "$1/proc"
    mount --rbind /dev "$1/dev"
    chroot "$1" env -i HOME=/root TERM=dumb PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
      DEBIAN_FRONTEND=noninteractive bash -euo pipefail -c "cd /opt/packages; $2"' inside "$folder" "$1"
}

inside 'apt-get update --quiet=2
  apt-get install --quiet=2 --yes --no-install-recommends lintian python3-venv systemd-sysv dbus-user-session \
    libpam-systemd >/dev/null'
echo "== lintian"
inside 'lintian --fail-on error --tag-display-limit 0 *.deb'
echo "== installed, used"
inside 'apt-get install --quiet=2 --yes --no-install-recommends ./*.deb >/dev/null
  bench-dragon --version && bench-dragon --scene /usr/share/bench-dragon/scenes/school.toml check >/dev/null
  bash -n /usr/share/bash-completion/completions/bench-dragon
  zcat /usr/share/man/man1/bench-dragon-run.1.gz | grep -q -- "\\\\-\\\\-realtime"
  python3 -m venv /opt/packages/venv && /opt/packages/venv/bin/pip install --quiet --cert authorities.crt *.whl
  /opt/packages/venv/bin/bench-dragon --version
  bench-dragon run --name packages --duration 60 >/dev/null 2>&1 & publisher=$!
  /opt/packages/venv/bin/python -c "
import bench_dragon
with bench_dragon.subscribe(\"packages\", seconds=50) as feed:
    print(len(next(feed).handles), \"handles\")
"
  kill -INT $publisher && wait $publisher'
echo "== the user unit under systemd"
inside 'id -u dancer >/dev/null 2>&1 || useradd --create-home dancer
  install -m 644 unit.service /etc/systemd/system/packages-unit.service
  ln -sf ../packages-unit.service /etc/systemd/system/multi-user.target.wants/packages-unit.service
  rm -f unit.log'
booted=0
timeout --kill-after=10 600 systemd-nspawn --quiet --directory="$folder" --register=no --keep-unit --boot \
  </dev/null >"$folder/opt/packages/boot.log" 2>&1 || booted=$?
cat "$folder/opt/packages/unit.log" || tail -n 50 "$folder/opt/packages/boot.log"
[ "$booted" = 0 ] || { echo "the unit failed: exit code $booted" >&2; exit 1; }
echo "== removed"
inside 'apt-get remove --quiet=2 --yes bench-dragon >/dev/null
  for left in /usr/bin/bench-dragon /usr/share/bench-dragon /usr/lib/systemd/user/bench-dragon@.service; do
    [ ! -e "$left" ] || { echo "$left is left" >&2; exit 1; }
  done'
echo "PASS"
