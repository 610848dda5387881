#!/usr/bin/env bash
# run.sh PROBECELL: see check.py, for which the mcap library of Python is needed.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../../.." && pwd)
exec "$root/target/venv/bin/python" -B "$here/check.py" "$1"
