#!/usr/bin/env bash
# The packages of one commit are the same bytes wherever they are built:
#   tests/packages/alike.sh FOLDER KIND...      # kinds of packaging/build, each made in two checkouts below FOLDER
# Needs what packaging/build needs.
set -euo pipefail
[ $# -ge 2 ] || { echo "usage: $0 FOLDER KIND..." >&2; exit 2; }
repository=$(cd "$(dirname "$0")/../.." && pwd)
mkdir -p "$1"
folder=$(realpath "$1")
shift

for checkout in "$folder/first" "$folder/second/elsewhere"; do
  [ -e "$checkout" ] || git clone --quiet "$repository" "$checkout"
  (cd "$checkout" && git fetch --quiet && git checkout --quiet "$(git -C "$repository" rev-parse HEAD)" &&
    packaging/build "$@" >/dev/null)
done
made=0
for file in "$folder"/first/target/packaging/*; do
  [ -f "$file" ] || continue
  made=$((made + 1))
  cmp "$file" "$folder/second/elsewhere/target/packaging/${file##*/}"
  if grep --quiet --fixed-strings --text "$folder" "$file"; then
    echo "${file##*/} names the folder of its checkout" >&2
    exit 1
  fi
done
[ "$made" -gt 0 ] || { echo "nothing was made" >&2; exit 1; }
echo "$made files are alike"
