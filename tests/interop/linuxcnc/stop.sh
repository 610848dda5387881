#!/bin/bash
# Ends the LinuxCNC that start.sh has started: stop.sh SCRATCH. The remote shell is killed, as when a controller fails;
# LinuxCNC's own script then takes the rest down and frees the shared memory.
set -uo pipefail
scratch=${1:?usage: stop.sh SCRATCH}
pid_file="$scratch/linuxcnc.pid"
[ -f "$pid_file" ] || exit 0
leader=$(cat "$pid_file")
shell=$(ps -o pid=,comm= --sid "$leader" 2>/dev/null | awk '$2 == "linuxcncrsh" { print $1 }')
# shellcheck disable=SC2086
[ -n "$shell" ] && kill -KILL $shell 2>/dev/null
for _ in $(seq 300); do
    if ! kill -0 "$leader" 2>/dev/null; then
        rm -f "$pid_file"
        exit 0
    fi
    sleep 0.1
done
echo "LinuxCNC did not end within 30 s" >&2
exit 1
