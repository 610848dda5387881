#!/bin/sh
# Installs LinuxCNC from the distribution and compiles the simulated machine, each only when it is missing.
# Exit status 77: the simulated machine's source is absent, so there is nothing to check against.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
shared="$here/../../../../shared/linuxcnc"
if [ ! -f "$shared/ommprobe.comp" ]; then
    echo "skipped: the simulated machine (../shared/linuxcnc/ommprobe.comp) is not here" >&2
    exit 77
fi
if ! command -v linuxcnc >/dev/null || ! command -v halcompile >/dev/null; then
    export DEBIAN_FRONTEND=noninteractive
    packages="linuxcnc-uspace linuxcnc-uspace-dev"
    # The package lists may be old, so a failure is tried once more with new ones.
    # shellcheck disable=SC2086
    apt-get install -y --no-install-recommends $packages >/dev/null ||
        { apt-get update >/dev/null && apt-get install -y --no-install-recommends $packages >/dev/null; }
fi
modules=$(dirname "$(find /usr/lib/linuxcnc/modules -name motmod.so | head -n 1)")
if [ ! -f "$modules/ommprobe.so" ] || [ "$shared/ommprobe.comp" -nt "$modules/ommprobe.so" ]; then
    # The component is under the GPL: it is compiled from a copy and never becomes part of this project.
    build=$(mktemp -d)
    trap 'rm -rf "$build"' EXIT
    cp "$shared/ommprobe.comp" "$build"
    (cd "$build" && chmod u+w ommprobe.comp && halcompile --install ommprobe.comp >/dev/null)
fi
