#!/usr/bin/env python3
"""Compares machine's chain with Pinocchio (PyPI `pin`): the same numbers, and poses per second, in one run.

    python3 crates/machine/benches/pin_kinematics.py

Pinocchio is installed into target/pin-venv; the bench `kinematics` is built and run.
Tasks: `forward` is the ball in the part, `links` adds its derivatives by all six components of the location error of
every axis (Pinocchio: computeFrameKinematicRegressor of the frames that the branches end in). Pinocchio is called from
Python once per pose and task step, which costs it some tenths of a microsecond per call; the time of a call
that looks up a name is taken, and ratios are given with it taken off as well. Exit status 1 where Pinocchio is ahead
even so, or where the numbers differ by more than 1e-12.
"""
import os
import pathlib
import subprocess
import sys
import time
import venv

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[2]
TARGET = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")).resolve()


def within_venv():
    """Starts this script again with the interpreter that has Pinocchio."""
    folder = TARGET / "pin-venv"
    python = folder / "bin/python"
    if pathlib.Path(sys.prefix) == folder:
        return
    if not python.exists():
        venv.create(folder, with_pip=True)
        subprocess.run([python, "-m", "pip", "install", "-q", "pin"], check=True)
    os.execv(python, [str(python), *sys.argv])


within_venv()

import numpy as np  # noqa: E402
import pinocchio as pin  # noqa: E402

BENCH = "cargo bench -q -p machine --bench kinematics --".split()
URDF = {"wcbxfzyst": HERE / "../../../launch-scripts/wcbxfzyst.urdf", "arm": HERE / "arm.urdf"}
BALL = np.array([0.001, 0.002, -0.15])
POSES, RUNS = 20_000, 5
SIDES = (("workpiece", -1.0), ("probe_mount", 1.0))


def position(pose, axis):
    return 0.3 * np.sin(0.37 * pose + 1.7 * axis)


def axes_of(path):
    """Names of the moving axes in the order of the chain: part branch first, from the foundation outwards."""
    import xml.etree.ElementTree as tree

    by_child = {j.find("child").get("link"): j for j in tree.parse(path).getroot().iter("joint")}
    names = []
    for end in ("workpiece", "probe_mount"):
        branch, link = [], end
        while link in by_child:
            joint = by_child[link]
            branch.append(joint)
            link = joint.find("parent").get("link")
        names += [j.get("name") for j in reversed(branch) if j.get("type") != "fixed"]
    return names


class Machine:
    def __init__(self, name):
        self.axes = axes_of(URDF[name])
        # Pinocchio refuses a continuous joint without a limit element's positions; as revolute it is the same chain.
        text = URDF[name].read_text().replace('type="continuous"', 'type="revolute"')
        text = text.replace('<limit effort="0"', '<limit lower="-9" upper="9" effort="0"')
        self.model = pin.buildModelFromXML(text)
        self.data = self.model.createData()
        self.frames = [self.model.getFrameId(link) for link, _ in SIDES]
        self.order = [self.model.joints[self.model.getJointId(axis)].idx_q for axis in self.axes]
        self.joints = [self.model.getJointId(axis) for axis in self.axes]

    def configuration(self, pose):
        q = np.zeros(self.model.nq)
        for axis, place in enumerate(self.order):
            q[place] = position(pose, axis)
        return q

    def forward(self, q):
        pin.framesForwardKinematics(self.model, self.data, q)

    def links(self, q):
        pin.framesForwardKinematics(self.model, self.data, q)
        for frame in self.frames:
            pin.computeFrameKinematicRegressor(self.model, self.data, frame, pin.LOCAL_WORLD_ALIGNED)

    def numbers(self, q):
        """Ball in the part and its derivatives by the location errors of each axis, as the bench prints them."""
        pin.framesForwardKinematics(self.model, self.data, q)
        part, mount = (self.data.oMf[frame] for frame in self.frames)
        ball = mount.act(BALL)
        values = list(part.actInv(ball))
        regressors = [
            pin.computeFrameKinematicRegressor(self.model, self.data, frame, pin.LOCAL_WORLD_ALIGNED)
            for frame in self.frames
        ]
        turn = part.rotation.T
        for axis, joint in enumerate(self.joints):
            # As ours, the regressor's displacement acts behind the joint's placement, before its motion.
            columns = np.zeros((3, 6))
            for regressor, (_, sign), frame in zip(regressors, SIDES, (part, mount)):
                block = regressor[:, 6 * (joint - 1) : 6 * joint]
                columns += sign * (block[:3] + np.cross(block[3:].T, ball - frame.translation).T)
            values += list((turn @ columns).T.ravel())
        return np.array(values)


def per_second(task, configurations):
    best = np.inf
    for _ in range(RUNS):
        begin = time.perf_counter()
        for q in configurations:
            task(q)
        best = min(best, time.perf_counter() - begin)
    return len(configurations) / best


def own(*arguments):
    """Lines that our bench prints."""
    command = [*BENCH, *arguments]
    return subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True).stdout.splitlines()


def main():
    machines = {name: Machine(name) for name in URDF}
    worst, counts = 0.0, dict.fromkeys(URDF, 0)
    for line in own("check"):
        name, *values = line.split()
        theirs = machines[name].numbers(machines[name].configuration(counts[name]))
        counts[name] += 1
        worst = max(worst, np.abs(np.array(values, float) - theirs).max())
    print("load averages %.1f, %.1f, %.1f" % os.getloadavg())
    print(f"largest difference of positions (m) and derivatives: {worst:.1e} over {sum(counts.values())} poses")

    rates = {}
    for line in own():
        name, task, rate = line.split()
        rates[name, task] = float(rate)
    behind = worst > 1e-12 or min(counts.values()) == 0
    print(f"{'machine':10} {'task':8} {'ours, 1/s':>11} {'pin, 1/s':>11} {'times':>6} {'less calls':>11}")
    for (name, task), ours in rates.items():
        machine = machines[name]
        configurations = [machine.configuration(pose) for pose in range(POSES)]
        theirs = per_second(getattr(machine, task), configurations)
        # A call that only looks up a name, as often as the task calls the module.
        call = 1 / per_second(lambda q: machine.model.existFrame("probe_mount"), configurations)
        calls = 1 if task == "forward" else 1 + len(SIDES)
        without = 1 / max(1 / theirs - calls * call, 1e-9)
        behind |= not ours > without
        print(f"{name:10} {task:8} {ours:11.0f} {theirs:11.0f} {ours / theirs:6.1f} {ours / without:11.1f}")
    return 1 if behind else 0


if __name__ == "__main__":
    sys.exit(main())
