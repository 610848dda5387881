"""Inverse kinematics of the arm against another implementation: ur_analytic_ik (PyPI, MIT; closed form of the UR family).

    arm_postures.py PROGRAM

PROGRAM prints lines of {"flange": 4x4 matrix, "postures": [[6 angles]]} for random places of the flange of the arm of
launch-scripts/robot_arm.urdf, in the base of the arm. Both implementations must find the same postures, no more and no less,
but for full turns and what the travels of the cell exclude; the other's forward kinematics must bring each back.
"""

import json
import subprocess
import sys

import numpy
from ur_analytic_ik import ur10e

LIMITS = numpy.radians([180, 0, 160, 360, 360, 360])
LOWER = numpy.radians([-180, -180, -160, -360, -360, -360])


def wrapped(angles):
    return (numpy.asarray(angles) + numpy.pi) % (2 * numpy.pi) - numpy.pi


def within(angles):
    """Some full turn of each joint is within the travels."""
    turned = wrapped(angles) + 2 * numpy.pi * numpy.arange(-1, 2)[:, None]
    return ((turned >= LOWER - 1e-9) & (turned <= LIMITS + 1e-9)).any(axis=0).all()


def main(program):
    lines = subprocess.run([program], capture_output=True, text=True, check=True).stdout.splitlines()
    places, postures, bad = 0, 0, []
    for line in lines:
        told = json.loads(line)
        flange = numpy.array(told["flange"])
        own = [numpy.array(one) for one in told["postures"]]
        other = [numpy.array(one).ravel() for one in ur10e.inverse_kinematics(flange)]
        other = [one for one in other if within(one)]
        for one in own:
            off = abs(numpy.array(ur10e.forward_kinematics(*one)) - flange).max()
            if off > 1e-8:
                bad.append(f"{one} is {off:.1e} off by the other's forward kinematics")
        for these, those, whose in ((own, other, "ours"), (other, own, "the other's")):
            for one in these:
                if not any(abs(wrapped(one - two)).max() < 1e-5 for two in those):
                    bad.append(f"only {whose}: {one} at {flange.tolist()}")
        places += 1
        postures += len(own)
    print(f"{places} places, {postures} postures, {len(bad)} differences")
    for one in bad[:10]:
        print(" ", one)
    return 1 if bad or not places else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
