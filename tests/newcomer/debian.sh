#!/usr/bin/env bash
# A newcomer on a fresh Debian 12. The script installs Debian into a folder and clones this repository there as an
# ordinary user. It runs the first commands of README.md and a subscriber in Python. Then it runs tests/run from an
# empty target folder, and times it. To be run by hand, as root. The Rust toolchain and the downloads of cargo are this
# machine's; all else comes from Debian and PyPI.
set -euo pipefail
[ $# = 1 ] && [ "$(id -u)" = 0 ] || { echo "usage, as root: $0 FOLDER" >&2; exit 2; }
command -v rustc >/dev/null || { echo "rustc is not in the PATH here: sudo env PATH=\"\$PATH\" $0 $1" >&2; exit 2; }
# Mounts of its own, which are gone when it ends.
[ -n "${NEWCOMER_MOUNTS:-}" ] || NEWCOMER_MOUNTS=1 exec unshare --mount --propagation private "$0" "$@"
repository=$(cd "$(dirname "$0")/../.." && pwd)
folder=$(realpath -m "$1")

[ -e "$folder/etc/debian_version" ] || debootstrap --variant=minbase bookworm "$folder"
mkdir -p "$folder/opt/rust"
# Its root is a mount, as everywhere: tests make mounts of their own.
mount --bind "$folder" "$folder"
mount -t proc proc "$folder/proc"
mount --rbind /dev "$folder/dev"
mount --bind -o ro "$(cd "$repository" && rustc --print sysroot)" "$folder/opt/rust"

inside() { # USER COMMAND
  chroot --userspec="$1" "$folder" env -i HOME="$(chroot "$folder" sh -c "echo ~$1")" TERM=dumb \
    PATH=/opt/rust/bin:/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin \
    CARGO_HOME=/home/newcomer/.cargo bash -euo pipefail -c "cd /home/newcomer; $2"
}

# A clone and a build take git and a C compiler, the subscriber Python; what the tests need tests/run installs.
chroot "$folder" apt-get update --quiet=2
chroot "$folder" apt-get install --quiet=2 --yes --no-install-recommends \
  git ca-certificates gcc libc6-dev python3 python3-venv
# Authorities that this machine trusts, of a proxy perhaps.
cp -L /etc/ssl/certs/ca-certificates.crt "$folder/etc/ssl/certs/"
chroot "$folder" id newcomer >/dev/null 2>&1 || chroot "$folder" useradd --create-home newcomer
rm -rf "$folder/home/newcomer/"{bench-dragon,origin.git}
git clone --quiet --bare "$repository" "$folder/home/newcomer/origin.git"
cache="${CARGO_HOME:-$HOME/.cargo}/registry"
mkdir -p "$folder/home/newcomer/.cargo/registry"
for part in cache index; do
  [ ! -d "$cache/$part" ] || cp -a "$cache/$part" "$folder/home/newcomer/.cargo/registry/"
done
chroot "$folder" chown -R newcomer: /home/newcomer

inside newcomer 'git clone --quiet origin.git bench-dragon'
inside newcomer 'cd bench-dragon && cargo run --release -- run --duration 2'
inside newcomer 'cd bench-dragon && cargo install --quiet --path . --locked && cd / && ~/.cargo/bin/bench-dragon check'
inside newcomer 'cd bench-dragon && python3 -m venv .venv && source .venv/bin/activate
  pip install --quiet iceoryx2==0.10.0 numpy
  ~/.cargo/bin/bench-dragon run --duration 60 >/dev/null & publisher=$!
  python3 examples/python/subscribe.py --seconds 5 >../heads.txt && grep "224 handles" ../heads.txt
  kill -INT $publisher && wait $publisher'
# Some tests make networks, which takes root, whom git does not let into the folder of another user.
inside root 'git config --global --replace-all safe.directory /home/newcomer/bench-dragon && cd bench-dragon
  rm -rf target && time tests/run'
