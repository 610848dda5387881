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
    # The interpreter must see the queue of a move before it asks whether the queue is empty ("Queue is not empty after probing"):
    # without a realtime kernel one servo period is too short for that.
    sed -i 's/^CYCLE_TIME = 0.001$/CYCLE_TIME = 0.005/' "$scratch"/*.ini
    (cd "$scratch" && python3 gen.py)
fi
