#!/bin/sh
# Other programs open what the recorder writes: PyPI rosbags (the folder, by metadata.yaml) and mcap-ros2-support (the
# files). Makes its own virtual environment. Usage: bags/tests/peers.sh [PYTHON]
set -eu
cd "$(dirname "$0")/../.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${1:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet rosbags mcap mcap-ros2-support
cargo run --quiet --release -p bags --example sample_recording -- "$work/sample"
"$work/venv/bin/python" bags/tests/peers.py "$work/sample"
