#!/usr/bin/env bash
# What viewers get of a recording: frames by another implementation of URDF, layouts, and the conversion by Rerun.
# usage: run.sh PYTHON
set -euo pipefail
cd "$(dirname "$0")/../../.."
python=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$python" tests/interop/viewers/frames.py bags/samples/*.mcap
"$python" tests/interop/viewers/layouts.py launch-scripts/viewers bags/samples/punch.mcap
for bag in bags/samples/*.mcap; do
  "$(dirname "$python")/rerun" mcap convert "$bag" -o "$work/out.rrd" 2>"$work/log" || { cat "$work/log"; exit 1; }
  [ -s "$work/out.rrd" ]
  "$(dirname "$python")/rerun" rrd print "$work/out.rrd" >"$work/printed" 2>"$work/log"
  for topic in tf touch_markers joint_states probe_events gap_report; do
    grep -q "$topic" "$work/printed" || { echo "$bag: $topic did not come through rerun mcap convert"; exit 1; }
  done
done
echo "every sample converts with rerun mcap convert"
