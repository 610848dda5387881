#!/bin/bash
# Ends the LinuxCNC that start.sh has started: stop.sh SCRATCH. Kills, since it stands for a controller that fails.
set -uo pipefail
scratch=${1:?usage: stop.sh SCRATCH}
pid_file="$scratch/linuxcnc.pid"
[ -f "$pid_file" ] || exit 0
group=$(cat "$pid_file")
# The start script leads a session of its own; some parts leave its process group, none leaves the session.
members() { ps -o pid= --sid "$group" 2>/dev/null; }
# shellcheck disable=SC2046
kill -KILL $(members) 2>/dev/null
for _ in $(seq 100); do
    [ -z "$(members)" ] && break
    sleep 0.1
done
# Shared memory of the killed parts; without this the next start finds a machine that is half there.
if [ "$(id -u)" = 0 ]; then export RTAPI_UID=${RTAPI_UID:-65534}; fi
timeout 20 halrun -U >/dev/null 2>&1
timeout 20 linuxcnc_cleanup >/dev/null 2>&1
rm -f "$pid_file" /tmp/linuxcnc.lock
exit 0
