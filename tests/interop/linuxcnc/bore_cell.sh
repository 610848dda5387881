#!/bin/bash
# Makes SCRATCH the folder of a cell that cuts and measures a bore on the simulated machine: bore_cell.sh SCRATCH. Beside what
# prepare.sh puts there: the program that "cuts", the tools, bore.toml and box.toml with the robot description.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../../.." && pwd)
scratch=${1:?usage: bore_cell.sh SCRATCH}
"$here/prepare.sh" "$scratch"
cd "$scratch"

# The "cut": the program tells the simulated machine the radius that its tool leaves, 20 µm of material and the wear
# offset of tool 2 included, through an analog output of the controller.
cat >finish_bore.ngc <<'N'
%
G21 G90 G40 G49
T2 M6
M68 E0 Q[24.980 + [#5410 - 10.0] / 2]
G4 P0.2
M2
%
N
echo 'net cut-radius motion.analog-out-00 => ommprobe.0.radius' >>omm3.hal
printf 'T1   P1   D+6.000000 Z+0.000000 ;probe\nT2   P2   D+10.000000 Z+0.000000 ;endmill\n' >omm3.tbl

for name in bore box; do
    sed "s#/home/linuxcnc/omm3#$scratch#g" "$root/launch-scripts/linuxcnc_$name.toml" >"$name.toml"
done
cp "$root/launch-scripts/three_axis.urdf" .
