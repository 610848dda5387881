#!/bin/sh
# Other programs open what the recorder writes: PyPI rosbags (the folder, by metadata.yaml) and mcap-ros2-support (the
# files), and convert every sample and a fresh recording of each simulated cell. Usage: bags/tests/peers.sh PYTHON MAKE_PART
set -eu
cd "$(dirname "$0")/../.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cargo build --quiet --release --workspace --example sample_recording
"${CARGO_TARGET_DIR:-target}/release/examples/sample_recording" "$work/sample"
"$1" bags/tests/peers.py "$work/sample"
"$1" -B bags/tests/convert.py "$2" bags/samples/*.mcap
