#!/bin/bash
# Starts LinuxCNC headless: start.sh SCRATCH [INI]. SCRATCH is made by prepare.sh when it is empty.
# Prints "ready" and comes back when the remote shell listens on TCP 5007; stop.sh SCRATCH ends it.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
scratch=${1:?usage: start.sh SCRATCH [INI]}
ini=${2:-omm3.ini}
port=5007
"$here/prepare.sh" "$scratch"
scratch=$(cd "$scratch" && pwd)

listens() { (exec 3<>"/dev/tcp/127.0.0.1/$port") 2>/dev/null; }

if listens; then
    echo "something listens on port $port already" >&2
    exit 1
fi
unset DISPLAY
if [ "$(id -u)" = 0 ]; then
    # The realtime host refuses to run as root without another user to fall back to.
    export RTAPI_UID=${RTAPI_UID:-65534}
    RTAPI_FIFO_PATH=$(mktemp -u)
    export RTAPI_FIFO_PATH
fi
cd "$scratch"
setsid linuxcnc -r "$scratch/$ini" >"$scratch/linuxcnc.out" 2>&1 </dev/null &
echo $! >"$scratch/linuxcnc.pid"
python3 "$here/../../kit" until 60 -- bash -c "(exec 3<>/dev/tcp/127.0.0.1/$port) || ! kill -0 $!" || true
if listens; then
    echo ready
    exit 0
fi
echo "LinuxCNC did not start:" >&2
tail -n 20 "$scratch/linuxcnc.out" >&2
exit 1
