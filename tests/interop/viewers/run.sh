#!/usr/bin/env bash
# What viewers get of a recording: frames by another implementation of URDF, and layouts.
# usage: run.sh PYTHON
set -euo pipefail
cd "$(dirname "$0")/../../.."
python=$1
"$python" tests/interop/viewers/frames.py bags/samples/*.mcap
"$python" tests/interop/viewers/layouts.py launch-scripts/viewers bags/samples/punch.mcap
