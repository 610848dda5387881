#!/usr/bin/env bash
# Checks msgs/ against implementations that are not ours:
#   1. colcon and rosidl build it as the ROS 2 interface package that it also is, and the generated C and C++ code compiles;
#   2. rosbags (Python) agrees with the Rust crate on every type hash, schema and byte.
# Runs on Debian 12 or newer, as root or with sudo. Installs what it lacks; may be repeated.
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../../.." && pwd)
scratch=${PROBECELL_INTERFACES_SCRATCH:-${TMPDIR:-/tmp}/probecell-interfaces}
mkdir -p "$scratch"

# Debian's rosidl belongs to Debian's Python, whatever else comes first in the path.
export PATH=/usr/bin:$PATH

packages=(
    cmake g++ ament-cmake rosidl-cmake rosidl-generator-c-cpp librosidl-runtime-c-cpp-dev
    librosidl-typesupport-interface-dev librosidl-typesupport-introspection-c-cpp-dev python3-rosidl python3-venv
    colcon python3-colcon-cmake python3-colcon-ros python3-colcon-package-information python3-colcon-recursive-crawl
    python3-colcon-bash python3-colcon-output
)
if ! dpkg-query --show --showformat='${db:Status-Status}\n' "${packages[@]}" 2>/dev/null |
    awk '$0 == "installed" { n++ } END { exit n != '"${#packages[@]}"' }'; then
    as_root=()
    [ "$(id -u)" = 0 ] || as_root=(sudo)
    "${as_root[@]}" apt-get update -qq
    DEBIAN_FRONTEND=noninteractive "${as_root[@]}" apt-get install -y -qq --no-install-recommends "${packages[@]}"
fi

echo "== colcon build"
"$here/colcon_build.sh" "$root" "$scratch/colcon"

echo "== rosbags"
venv=$scratch/venv
[ -x "$venv/bin/python" ] || python3 -m venv "$venv"
"$venv/bin/python" -m pip install --quiet --disable-pip-version-check 'rosbags==0.11.*' 'mcap==1.*' zstandard lz4
(cd "$root" && cargo build --quiet --release --workspace --example dump_types)
"$venv/bin/python" "$here/compare.py" --msgs "$root/msgs" --bags "$root/../shared/trials/dev" \
    --dump "${CARGO_TARGET_DIR:-$root/target}/release/examples/dump_types"
