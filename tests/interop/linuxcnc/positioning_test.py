#!/usr/bin/env python3
"""Positioning tests (ISO 230-2) on the LinuxCNC that listens on TCP 5007: positioning_test.py NAME RUNS.

All axes run through the same targets together, each run up and down again, and stand at each while the instrument reads where the
simulated machine really is. The instrument has a noise of its own. The tables NAME_X.csv, NAME_Y.csv and NAME_Z.csv are what
`probecell import readings` reads.
"""

import pathlib
import random
import subprocess
import sys
import time

sys.path.append(str(pathlib.Path(__file__).resolve().parents[2]))
import kit  # noqa: E402
from shell import Shell  # noqa: E402

AXES = "XYZ"
TARGETS = [-200 + 20 * k for k in range(21)]  # mm
NOISE = 0.0005  # mm, standard deviation of the instrument


def true_positions(place):
    """Where the ball really is, mm, as soon as the axes stand where they were sent."""
    pins = [f"joint.{joint}.pos-cmd" for joint in range(len(AXES))] + [f"ommprobe.0.true-{axis.lower()}" for axis in AXES]

    def read():
        done = subprocess.run(["halcmd", "-f"], input="".join(f"getp {pin}\n" for pin in pins), capture_output=True, text=True, check=True)
        return [float(line) for line in done.stdout.split()]

    seen = [read()]

    def stand():
        seen.append(read())
        is_there = all(abs(at - place[axis]) < 1e-6 for at, axis in zip(seen[-1], AXES))
        return is_there and seen[-1] == seen[-2]

    kit.until("the axes stand", stand)
    return seen[-1][len(AXES) :]


def at_home():
    """Switches the machine on and homes it; how it goes somewhere and stands there."""
    shell = Shell()
    for request in ("estop off", "machine on", "mode manual"):
        shell.set(request)
    shell.set("home -1")
    kit.until("the joints are homed", lambda: shell.say("get joint_homed").count("YES") == len(AXES))
    shell.set("mode mdi")
    shell.set("set_wait done")

    def go(place):
        shell.set("mdi G1 F12000 " + " ".join(f"{axis}{at}" for axis, at in place.items()))

    return go


def main(name, runs):
    noise = random.Random(name)
    move = at_home()

    def go(target):
        place = dict.fromkeys(AXES, target)
        move(place)
        return true_positions(place)

    rows = {axis: ["axis,target,direction,repeat,deviation,time"] for axis in AXES}
    begun = time.monotonic()
    for run in range(runs):
        # A little beyond the last target, so that each is approached from its side.
        for direction, targets, beyond in (("+", TARGETS, TARGETS[0] - 5), ("-", TARGETS[::-1], TARGETS[-1] + 5)):
            go(beyond)
            for target in targets:
                for axis, true in zip(AXES, go(target)):
                    deviation = true - target + noise.gauss(0, NOISE)
                    rows[axis].append(f"{axis},{target},{direction},{run + 1},{deviation:.6f},{time.monotonic() - begun:.3f}")
    for axis in AXES:
        pathlib.Path(f"{name}_{axis}.csv").write_text("\n".join(rows[axis]) + "\n")
    print(f"{name}: {len(rows['X']) - 1} readings of each axis in {time.monotonic() - begun:.0f} s")


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
