#!/usr/bin/env bash
# The dashboard in a browser, against simulated cells: run.sh PROBECELL PYTHON FOLDER_FOR_PICTURES SCRIPT...
#
# Each script has a network namespace of its own: whatever a page asked for elsewhere could not be answered, and the ports are free.
set -euo pipefail
probecell=$(realpath "$1") python=$(realpath -s "$2") pictures=$(realpath -m "$3")
here=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$pictures"
for script in "${@:4}"; do
  "$python" -B "$here/$script.py" "$probecell" "$pictures"
done
