#!/usr/bin/env bash
# The Debian package on a computer without Rust: built, linted, installed in a fresh Debian, run by its units, upgraded, removed.
#
#     check.sh PROBECELL [systemd|runner]
#
# PROBECELL is the program to be packed. The second word takes one way of starting the units; without it systemd is taken where it comes up as
# process 1 of a namespace here, else the runner (check.py). As root. XTASK is the command for xtask, CHECK_TMP where the trees are put.
# A tree of the same Debian as this computer is made once by debootstrap, from the mirror that apt uses here, and kept in the
# cache of the user. What is tried runs in namespaces of its own, with a network that has lo alone. Exit status 77: skipped, with the reason.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
program=$(realpath "${1:?usage: check.sh PROBECELL [systemd|runner]}")
way=${2:-}
cd "$here/../.."
read -ra xtask <<<"${XTASK:-cargo run -q --release -p xtask --}"

skipped() { echo "skipped: $*"; exit 77; }

[ "$(id -u)" = 0 ] || skipped "the package, which is installed in a tree of its own: that takes root"
for tool in debootstrap dpkg-deb dpkg-shlibdeps dpkg-scanpackages strip unshare nsenter ip python3; do
  command -v "$tool" >/dev/null || { echo "$tool is not there: apt-get install debootstrap dpkg-dev binutils util-linux iproute2 python3" >&2; exit 1; }
done

work=$(mktemp -d "${CHECK_TMP:-${TMPDIR:-/tmp}}/probecell-package.XXXXXX")
trap 'rm -rf --one-file-system "$work"' EXIT

# -- the tree ------------------------------------------------------------------------------------------------------------------------
suite=$(. /etc/os-release && echo "${VERSION_CODENAME:-}")
cache=${XDG_CACHE_HOME:-$HOME/.cache}/probecell
tree=$cache/debian-$suite.tar # one file, so that others than root can keep it
mkdir -p "$cache"
exec 9>"$tree.lock"
flock 9
if [ ! -f "$tree" ]; then
  mirror=$(apt-get indextargets --format '$(REPO_URI) $(RELEASE) $(CODENAME) $(COMPONENT)' 'Created-By: Packages' |
    awk -v suite="$suite" '$4 == "main" && ($2 == suite || $3 == suite) { print $1; exit }')
  [ -n "$mirror" ] || skipped "a Debian tree: apt names no mirror of $suite"
  begun=$SECONDS
  if ! debootstrap --variant=minbase --include=systemd,systemd-sysv "$suite" "$work/tree" "$mirror" >"$work/debootstrap.log" 2>&1; then
    tail -n 5 "$work/debootstrap.log"
    # What it says when a mirror does not answer; any other failure is one.
    grep -qE 'Failed getting release file|Invalid Release file' "$work/debootstrap.log" || exit 1
    skipped "a Debian tree: the mirror of apt is not reached"
  fi
  rm -rf "$work"/tree/var/cache/apt/archives/*.deb "$work"/tree/var/lib/apt/lists/*
  tar -C "$work/tree" --numeric-owner -cf "$tree.new" .
  mv "$tree.new" "$tree"
  rm -rf --one-file-system "$work/tree"
  echo "made    $tree by debootstrap in $((SECONDS - begun)) s"
fi
flock -u 9

# -- the packages --------------------------------------------------------------------------------------------------------------------
refused() { # WORDS...: xtask deb refuses them in one sentence, with status 2
  local status=0
  "${xtask[@]}" deb "$@" >"$work/out" 2>"$work/err" || status=$?
  if [ "$status" != 2 ] || [ "$(wc -l <"$work/err")" != 1 ] || [ -s "$work/out" ]; then
    echo "xtask deb $*: status $status: $(cat "$work/out" "$work/err")"; exit 1
  fi
  echo "good    refused: $(sed 's/^error: //' "$work/err")"
}
refused --binary "$work/none"
refused --binary /bin/true
refused --binary "$program" --version "1.0 beta"
refused --binary "$program" --version
refused --colour
SOURCE_DATE_EPOCH=yesterday refused --binary "$program"

# A second after 2001, so that no clock of the build can be taken for it.
export SOURCE_DATE_EPOCH=1000000000
export DPKG_DEB_COMPRESSOR_LEVEL=1 # a fifth of the time
package() { "${xtask[@]}" deb --binary "$program" "$@"; }
old=$(package --version 0.1.0 --out "$work/old")
new=$(package --version 0.1.1~test --out "$work/new")
again=$(umask 077; package --version 0.1.0 --out "$work/again")
cmp "$old" "$again"
echo "good    built twice, byte for byte: $(basename "$old"), $(stat -c %s "$old") bytes"
rm -r "$work/again"
if command -v lintian >/dev/null; then
  lintian --allow-root --fail-on error,warning --tag-display-limit 0 "$old"
  echo "good    lintian: no error, no warning"
else
  echo "skipped: lintian, which is not there (apt-get install lintian)"
fi

# -- the tree with the package -------------------------------------------------------------------------------------------------------
python3 -B "$here/check.py" "$tree" "$work" "$old" "$new" ${way:+"$way"}
