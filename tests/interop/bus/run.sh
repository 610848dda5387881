#!/usr/bin/env bash
# Checks the bus against programs that are not ours, each inside a network namespace of its own:
#   zenoh    every byte of rmw_zenoh's wire format; eclipse-zenoh and zenoh-ros2-sdk both ways
#   dds      Cyclone DDS both ways
#   recording  the services of a running cell's recorder, called by zenoh-ros2-sdk
#   outage   two machines and a router between them, with one link down for 10 s
#   bench    what the bus costs over the bare zenoh crate and over bare RustDDS (not part of the checks)
# Without an argument: zenoh, dds, recording, outage. Needs root for the namespaces; installs its Python packages into a folder.
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../../.." && pwd)
scratch=${PROBECELL_BUS_SCRATCH:-${TMPDIR:-/tmp}/probecell-bus}
target=${CARGO_TARGET_DIR:-$root/target}

if [ "${1:-}" = bench ]; then
    isolated() { # loopback with multicast
        unshare --net bash -euo pipefail -c 'ip link set lo up multicast on; ip route add 224.0.0.0/4 dev lo; exec "$@"' isolated "$@"
    }
    bench=$(cd "$root" && cargo bench --workspace --bench bus --no-run --message-format=json 2>/dev/null |
        sed -n 's/.*"executable":"\([^"]*bus-[^"]*\)".*/\1/p' | tail -1)
    isolated "$bench"
    isolated "$bench" dds
    exit
fi

venv=$scratch/venv
mkdir -p "$scratch"
[ -x "$venv/bin/python" ] || python3 -m venv "$venv"
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check \
    'eclipse-zenoh==1.10.*' 'zenoh-ros2-sdk==0.1.*' 'cyclonedds==11.*' 'rosbags==0.11.*' 'xxhash>=3' 'mcap==1.*'
(cd "$root" && cargo build --quiet --release --workspace --example bus_peer)
peer=$target/release/examples/bus_peer

for check in "${@:-zenoh dds recording outage}"; do
    for name in $check; do
        echo "== $name"
        case $name in
        zenoh) "$venv/bin/python" "$here/zenoh_peers.py" --peer "$peer" --msgs "$root/msgs" ;;
        dds) "$venv/bin/python" "$here/dds_peers.py" --peer "$peer" --msgs "$root/msgs" ;;
        recording)
            (cd "$root" && cargo build --quiet --release --workspace --bin probecell)
            "$venv/bin/python" "$here/recording.py" --probecell "$target/release/probecell" \
                --msgs "$root/msgs" --cell "$root/launch-scripts/turn_mill.toml"
            ;;
        outage) "$venv/bin/python" "$here/outage.py" --peer "$peer" ;;
        *)
            echo "no check $name: zenoh, dds, recording, outage or bench" >&2
            exit 2
            ;;
        esac
    done
done
