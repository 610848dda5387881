#!/usr/bin/env bash
# A lake of the sample recordings, read and asked by others and by us: run.sh PROBECELL-FLEET PYTHON [PROBECELL]
set -euo pipefail
cd "$(dirname "$0")/../../.."
program=$(realpath "$1") python=$2 probecell=${3:+$(realpath "$3")}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$program" lake add bags/samples/punch.mcap bags/samples/guideway.mcap --lake "$work/lake" | grep -q '^2 added, 0 known already, 0 not added$'
"$program" lake add bags/samples --lake "$work/lake" | grep -q '^3 added, 2 known already, 0 not added$'
"$program" lake event --machine turn_mill --time 2026-03-01T07:30:00Z --kind service "new probe" --lake "$work/lake"
"$python" tests/interop/fleet/readers.py "$work/lake" bags/samples
"$python" tests/interop/fleet/ask.py "$program" "$work/lake" ${probecell:+"$probecell"}
"$python" tests/interop/fleet/s3.py "$program" "$work/lake" bags/samples
[ -z "$probecell" ] || "$python" tests/interop/fleet/months.py "$program" "$probecell" "$work/lake"
"$program" lake compact --lake "$work/lake"
"$python" tests/interop/fleet/readers.py "$work/lake" bags/samples
"$python" tests/interop/fleet/ask.py "$program" "$work/lake"
# What is wrong is one sentence and status 2.
status=0; "$program" trends --lake "$work/nothing" 2>"$work/refused" || status=$?
[ "$status" = 2 ] && [ "$(wc -l <"$work/refused")" = 1 ] && grep -q 'there is no lake in' "$work/refused"
echo "not a bag" >"$work/broken.mcap"
status=0; "$program" lake add "$work/broken.mcap" bags/samples --lake "$work/lake" 2>"$work/refused" >"$work/added" || status=$?
[ "$status" = 3 ] && grep -q 'broken.mcap' "$work/refused" && grep -q '^0 added, 5 known already, 1 not added$' "$work/added"
echo "the lake is read and asked alike by DuckDB, PyArrow, Polars and probecell-fleet, in a folder and behind S3"
