#!/bin/bash
# The gap in time on LinuxCNC: time.sh PROBECELL. The ini limits X to an acceleration other than the cell file declares; the
# recording must show it with its size, adopt must declare it, and the next order must take what it promises.
# Takes a minute. Exit status 0: all hold; 1: one does not; 77: skipped, the simulated machine is not here.
set -euo pipefail
probecell=$(realpath "${1:?usage: time.sh PROBECELL}")
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../../.." && pwd)
"$here/install.sh"
scratch=$(mktemp -d)
cleanup() {
    "$here/stop.sh" "$scratch" || true
    rm -rf "$scratch"
}
trap cleanup EXIT INT TERM
"$here/prepare.sh" "$scratch"
cd "$scratch"
export XDG_CONFIG_HOME="$scratch/config" XDG_STATE_HOME="$scratch/state"

# The machine: X gathers speed with 120 mm/s² instead of 2000.
python3 - omm3.ini <<'P'
import re, sys
text = open(sys.argv[1]).read()
parts = re.split(r"(?m)^(?=\[)", text)
slow = [re.sub(r"(?m)^MAX_ACCELERATION *=.*$", "MAX_ACCELERATION = 120", part)
        if part.startswith(("[AXIS_X]", "[JOINT_0]")) else part for part in parts]
assert slow != parts, "no acceleration of X in the ini"
open(sys.argv[1], "w").write("".join(slow))
P
# The cell: eighty touches of the box, and 2000 mm/s² for every axis.
cp "$root/launch-scripts/three_axis.urdf" .
python3 - "$root/launch-scripts/linuxcnc_box.toml" "$scratch" >time.toml <<'P'
import re, sys
text, scratch = open(sys.argv[1]).read(), sys.argv[2]
text = text.replace("/home/linuxcnc/omm3", scratch)
text = text.replace("approach_mm = 0.5", "approach_mm = 2.0").replace("retract_mm = 0.5", "retract_mm = 2.0")
text = text.replace("feed_mm_per_min = 30.0", "feed_mm_per_min = 300.0")
def face(match):
    axis, sign = match.group(2), -1 if match.group(3) == "minus" else 1
    along = {"x": 12.0, "y": 22.0}[axis]
    points = []
    for k in range(20):
        u, z = along * (k % 5 - 2) / 2, -2.0 - 1.3 * (k // 5)
        points.append([25.0 * sign, round(u, 3), z] if axis == "x" else [round(u, 3), 15.0 * sign, z])
    return re.sub(r"touch_points_mm = .*", f"touch_points_mm = {points}", match.group(0))
text = re.sub(r'(id = "([xy])_(minus|plus)".*?touch_points_mm = [^\n]*)', face, text, flags=re.S)
print(text)
print("[motion.axes]")
for axis in "XYZ":
    print(f"{axis} = {{ acceleration_mm_per_s2 = 2000.0 }}")
P

"$here/start.sh" "$scratch"
for pair in artefact=4 hx=25 hy=15 hz=10 cx=0 cy=0 cz=0 ball-r=3.0; do halcmd setp "ommprobe.0.${pair%%=*}" "${pair#*=}"; done
measure() { # FILE: measures the box once and diagnoses the time of its moves
    local status=0
    python3 "$here/../../kit" limit 240 -- "$probecell" up time.toml --once >out.txt 2>&1 || status=$?
    grep -q "width_x" out.txt || { echo "FAILED: no measurement (status $status)"; cat out.txt; exit 1; }
    local bag; bag=$(ls -td recordings/*/ | head -1)
    "$probecell" diagnose "$bag" --channel time
    "$probecell" diagnose "$bag" --channel time --json >"$1"
    "$probecell" diagnose "$bag" --channel time --html "${1%.json}.html" >/dev/null
}
measure before.json
python3 - before.json <<'P' || { echo "FAILED: the cause"; exit 1; }
import json, sys
report = json.load(open(sys.argv[1]))
assert report["channel"] == "time" and report["gap"]["unit"] == "s", report["channel"]
first = report["effects"][0]
assert first["effect"] == "motion.X.acceleration" and not first["indistinguishable_from"], first
found, (least, most) = first["parameters"][0]["value"], first["parameters"][0]["ci95"]
print(f"  acceleration of X: found {found:.4f} m/s² ({least:.4f} to {most:.4f}), the ini says 0.1200 m/s²")
assert abs(found / 0.12 - 1) < 0.05 and most / least < 1.1, first
innocent = [one for one in report["effects"] if one["effect"].startswith(("motion.Y.", "motion.Z."))]
assert not innocent, innocent
P
# Of a group that these moves cannot tell apart any one serves: the first.
picks=$(python3 -c '
import json
for one in json.load(open("before.json"))["effects"]:
    if one["indistinguishable_from"]:
        print("--as", one["effect"])')
# shellcheck disable=SC2086
"$probecell" adopt before.json --cell time.toml $picks
grep -A2 "^\[motion" time.toml
measure after.json
python3 - before.json after.json <<'P' || { echo "FAILED: the promise"; exit 1; }
import json, sys
ratio = []
for name in sys.argv[1:]:
    durations = json.load(open(name))["durations"]
    ratio.append(durations["measured"] / durations["promised"])
    print(f"  {name}: promised {durations['promised']:.2f} s, measured {durations['measured']:.2f} s ({100 * (ratio[-1] - 1):+.1f} %)")
assert ratio[0] > 1.05 and abs(ratio[1] - 1) < 0.02, ratio
blamed = [one["effect"] for one in json.load(open("after.json"))["effects"] if not one["indistinguishable_from"]]
assert not any(name.startswith(("motion.X.", "motion.Y.", "motion.Z.")) for name in blamed), blamed
P
echo "the gap in time on LinuxCNC: good"
