#!/usr/bin/env python3
"""Touches of a box by the LinuxCNC that listens on TCP 5007, from above and from both sides: probe_test.py TABLE.

Tool 1 is the probe, with the length and diameter of the tool table; the simulated machine has a longer one with a larger ball. The table
holds the deviation of each touch, mm, by the contract: normal times (where the control sees the centre of the ball less the nominal point)
less the radius that it was told.
"""

import pathlib
import subprocess
import sys

sys.path.append(str(pathlib.Path(__file__).resolve().parents[2]))
import kit  # noqa: E402
from shell import Shell  # noqa: E402

TOLD = 50.0  # mm, length of the probe in the first tool table: the box stands so far below the nose
HALF = (25.0, 15.0, 10.0)  # mm, half sizes of the box; its top is at -TOLD in the coordinates of the tool
LONGER, LARGER = 0.040, 0.015  # mm, of the machine's own probe
FEED = 30  # mm/min: the trip is latched with a quantum of feed times a millisecond, 0.5 µm


def main(path):
    shell = Shell()
    shell.set("mode mdi")
    shell.set("set_wait done")

    def mdi(line):
        shell.set(f"mdi {line}")

    def told(number):
        """A parameter of the interpreter."""
        mdi(f"(DEBUG,number is %.5f #{number})")
        seen = [""]

        def is_told():
            seen.append(shell.say("get operator_display"))
            return "number is" in seen[-1]

        kit.until(f"the control says #{number}", is_told)
        return float(seen[-1].rsplit(" ", 1)[-1])

    mdi("T1 M6")
    mdi("G43")
    mdi("G0 X0 Y0 Z20")
    pins = dict(zip(("hx", "hy", "hz"), HALF)) | {"cx": 0, "cy": 0, "cz": -HALF[2], "tip-len": LONGER, "ball-r": 3 + LARGER, "artefact": 4}
    # The nose stands TOLD above the ball: the simulated machine counts its ball from there.
    for pin, value in pins.items():
        subprocess.run(["halcmd", "setp", f"ommprobe.0.{pin}", str(value)], check=True)
    top = -TOLD
    radius = told(5410) / 2
    rows = ["face,deviation"]
    mdi(f"G1 F6000 Z{top + 4}")
    mdi(f"G38.2 Z{top + 1} F{FEED}")
    rows.append(f"top,{told(5063) - top - radius:.5f}")
    mdi("G0 Z20")
    for name, side in (("right", 1), ("left", -1)):
        away, within = side * (HALF[0] + 4), side * (HALF[0] + 1)
        mdi(f"G0 X{away}")
        mdi(f"G0 Z{top - 4}")
        mdi(f"G38.2 X{within} F{FEED}")
        rows.append(f"{name},{side * told(5061) - HALF[0] - radius:.5f}")
        mdi(f"G0 X{away}")
        mdi("G0 Z20")
    pathlib.Path(path).write_text("\n".join(rows) + "\n")
    print(f"{path}: {', '.join(rows[1:])}")


if __name__ == "__main__":
    main(sys.argv[1])
