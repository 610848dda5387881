#!/bin/bash
# Ends the LinuxCNC that start.sh has started: stop.sh SCRATCH. The remote shell is killed, as when a controller fails;
# LinuxCNC's own script then takes the rest down and frees the shared memory.
set -uo pipefail
here=$(cd "$(dirname "$0")" && pwd)
scratch=${1:?usage: stop.sh SCRATCH}
pid_file="$scratch/linuxcnc.pid"
[ -f "$pid_file" ] || exit 0
leader=$(cat "$pid_file")
shell=$(ps -o pid=,comm= --sid "$leader" 2>/dev/null | awk '$2 == "linuxcncrsh" { print $1 }')
# shellcheck disable=SC2086
[ -n "$shell" ] && kill -KILL $shell 2>/dev/null
python3 "$here/../../kit" until 60 -- bash -c "! kill -0 $leader" || exit 1
rm -f "$pid_file"
