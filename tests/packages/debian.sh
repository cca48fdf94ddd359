#!/usr/bin/env bash
# The packages on a clean Debian 12, which is installed into a folder: the .deb through lintian, installed, used, removed;
# the wheel in a fresh venv there, reading a publisher of the .deb. As root; needs debootstrap, a mirror, PyPI, and what
# packaging/build needs. The user unit is not started: that takes a systemd that has booted.
set -euo pipefail
[ $# = 1 ] && [ "$(id -u)" = 0 ] || { echo "usage, as root: $0 FOLDER" >&2; exit 2; }
# Mounts of its own, which are gone when it ends.
[ -n "${PACKAGES_MOUNTS:-}" ] || PACKAGES_MOUNTS=1 exec unshare --mount --propagation private "$0" "$@"
repository=$(cd "$(dirname "$0")/../.." && pwd)
folder=$(realpath -m "$1")

cd "$repository"
packaging/build
[ -e "$folder/etc/debian_version" ] || debootstrap --variant=minbase bookworm "$folder"
mount --bind "$folder" "$folder"
mount -t proc proc "$folder/proc"
mount --rbind /dev "$folder/dev"
# Authorities that this machine trusts, of a proxy perhaps.
mkdir -p "$folder/etc/ssl/certs" "$folder/tmp/packages"
cp -L /etc/ssl/certs/ca-certificates.crt "$folder/etc/ssl/certs/"
rm -rf "$folder"/tmp/packages/*
cp target/packaging/*.deb target/packaging/*.whl "$folder/tmp/packages/"
inside() {
  chroot "$folder" env -i HOME=/root TERM=dumb PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
    bash -euo pipefail -c "cd /tmp/packages; $1"
}

inside 'apt-get update --quiet=2
  apt-get install --quiet=2 --yes --no-install-recommends lintian python3-venv >/dev/null'
echo "== lintian"
inside 'lintian --fail-on error --tag-display-limit 0 *.deb'
echo "== installed, used, removed"
inside 'apt-get install --quiet=2 --yes --no-install-recommends ./*.deb >/dev/null
  cd / && bench-dragon --version && bench-dragon --scene /usr/share/bench-dragon/scenes/school.toml check >/dev/null
  bash -n /usr/share/bash-completion/completions/bench-dragon
  zcat /usr/share/man/man1/bench-dragon-run.1.gz | grep -q -- "\\\\-\\\\-realtime"
  python3 -m venv /tmp/packages/venv && /tmp/packages/venv/bin/pip install --quiet /tmp/packages/*.whl
  /tmp/packages/venv/bin/bench-dragon --version
  bench-dragon run --name packages --duration 60 >/dev/null 2>&1 & publisher=$!
  /tmp/packages/venv/bin/python -c "
import bench_dragon
with bench_dragon.subscribe(\"packages\", seconds=50) as feed:
    print(len(next(feed).handles), \"handles\")
"
  kill -INT $publisher && wait $publisher
  apt-get remove --quiet=2 --yes bench-dragon >/dev/null
  for left in /usr/bin/bench-dragon /usr/share/bench-dragon /usr/lib/systemd/user/bench-dragon@.service; do
    [ ! -e "$left" ] || { echo "$left is left" >&2; exit 1; }
  done'
echo "PASS"
