#!/bin/bash
# Checks the LinuxCNC driver against a LinuxCNC that runs headless in a scratch folder. Takes three
# minutes after the build, and one more where LinuxCNC has to be installed.
# Exit status 0: all checks hold; 1: one failed; 77: skipped.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../../.." && pwd)
"$here/install.sh"
cargo build --release --manifest-path "$root/Cargo.toml" --workspace --example linuxcnc_check
target=${CARGO_TARGET_DIR:-$root/target}
scratch=$(mktemp -d)
cleanup() {
    "$here/stop.sh" "$scratch"
    rm -rf "$scratch"
}
trap cleanup EXIT INT TERM
"$here/prepare.sh" "$scratch"
python3 "$here/../../kit" limit 600 -- "$target/release/examples/linuxcnc_check" "$scratch" "$here/start.sh" "$here/stop.sh"
