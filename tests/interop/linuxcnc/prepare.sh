#!/bin/bash
# Makes SCRATCH a copy of the simulated machine's configurations: prepare.sh SCRATCH. LinuxCNC writes beside its INI.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
shared="$here/../../../../shared/linuxcnc"
scratch=${1:?usage: prepare.sh SCRATCH}
mkdir -p "$scratch"
if [ ! -f "$scratch/gen.py" ]; then
    cp -r "$shared/." "$scratch"
    chmod -R u+w "$scratch"
    (cd "$scratch" && python3 gen.py)
fi
