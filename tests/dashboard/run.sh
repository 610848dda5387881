#!/usr/bin/env bash
# The dashboard in a browser, against simulated cells: run.sh PROBECELL PYTHON [FOLDER FOR PICTURES]
#
# Runs in a network namespace of its own: whatever a page asked for elsewhere could not be answered, and the ports are free.
set -euo pipefail
probecell=$(realpath "$1") python=$(realpath -s "$2") pictures=$(realpath -m "${3:-target/dashboard}")
here=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$pictures"
exec unshare -n bash -ec 'ip link set lo up; exec "$@"' _ "$python" "$here/browser.py" "$probecell" "$pictures"
