"""Calibrated robot descriptions read back by Pinocchio: calibrated.py PROGRAM.

Arms of several makers get zeros and link errors that are known. `probecell cure` writes them as a robot description, of a UR arm also as
its kinematics, and as offsets of robot_calibration. Each is read by a reader that is not ours, and the place of the flange is
compared at 1,000 poses with the nominal arm whose joints err right after their origins (the interface contract). With the opposite sign
it fails.
"""

import json
import pathlib
import re
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as tree

import numpy as np
import pinocchio
import yaml

import plant
import robots

POSES = 1000
LETTERS = "XYZABC"
CLOSE = 1e-9  # m, of what is written with all digits
NAMES = {"ur5": "shoulder_pan_joint shoulder_lift_joint elbow_joint wrist_1_joint wrist_2_joint wrist_3_joint".split()}


def axes(text):
    """Of each joint that moves the direction of its axis in its own frame."""
    found = {}
    for joint in tree.fromstring(text).findall("joint"):
        element = joint.find("axis")
        found[joint.get("name")] = np.array([float(word) for word in element.get("xyz").split()] if element is not None else [1.0, 0.0, 0.0])
    return found


def report(path, errors, along):
    """A gap report that names these errors of joints (m, rad); a turn about its own axis is the zero of a joint."""

    def effect(joint, letter, value):
        zero = along[joint] @ (np.arange(3) == "ABC".find(letter))
        half = 0.01 * abs(value)
        parameter = {"name": "e", "value": value, "unit": "m" if letter in "XYZ" else "rad", "ci95": [value - half, value + half]}
        name = f"link.E{letter}0{joint}"
        zero = {"joint": joint, "value": value * zero, "ci95": sorted(one * zero for one in parameter["ci95"])} if abs(zero) == 1 else None
        return {"effect": name, "joint_zero": zero, "probability": 1.0, "parameters": [parameter], "rms_before": 3e-4, "rms_after": 2e-5,
                "ci95_after": [2e-5, 2e-5], "held_out": True, "indistinguishable_from": [], "group": [name]}

    path.write_text(json.dumps({
        "schema": "probecell/gap-report/1", "bag": path.stem, "samples": 200, "verdict": "explained", "level": "cause",
        "gap": {"rms": 1e-3, "noise_floor": 2e-5, "ratio": 50.0}, "where": [], "unexplained": {"rms": 0.0, "where": []}, "rejected": [],
        "next_measurement": [], "warnings": [], "effects": [effect(*one) for one in errors],
    }))  # fmt: skip


def twists(errors):
    found = {}
    for joint, letter, value in errors:
        found.setdefault(joint, np.zeros(6))[LETTERS.index(letter)] += value
    return found


def displaced(twist):
    return pinocchio.SE3(pinocchio.exp3(twist[3:]), twist[:3])


class Arm:
    """Pinocchio's model of a description, and the place of its flange."""

    def __init__(self, text, flange):
        self.model = pinocchio.buildModelFromXML(robots.apart(text))
        names = [frame.name for frame in self.model.frames]
        # robots.apart renames a link that is named like its joint.
        self.flange = names.index(flange if f"{flange} link" not in names else f"{flange} link")

    def places(self, positions):
        data = self.model.createData()
        found = []
        for one in positions:
            pinocchio.framesForwardKinematics(self.model, data, one)
            found.append(data.oMf[self.flange].translation.copy())
        return np.array(found)

    def erring(self, errors):
        """The same arm whose joints err right after their origins."""
        for joint, twist in twists(errors).items():
            index = self.model.getJointId(joint)
            self.model.jointPlacements[index] = self.model.jointPlacements[index] * displaced(twist)
        return self

    def positions(self, seed):
        random = np.random.default_rng(seed)
        angles = random.uniform(-3, 3, (POSES, self.model.nv))
        return [pinocchio.integrate(self.model, pinocchio.neutral(self.model), one) for one in angles]


def cure(program, folder, name, file, *words):
    done = subprocess.run([program, "cure", folder / f"{name}.json", "--urdf", file, *words], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def same_bytes(old, new, joints):
    """Nothing but the origins of these joints and one comment differs."""
    comment = re.search(r"<!-- probecell cure.*?-->\n", new, re.S)
    assert comment and comment.group(0).count("sha256") == 1, new[:500]
    new = new.replace(comment.group(0), "", 1)
    for joint in joints:
        def without(text):
            # Of a transmission a joint has no type.
            start = next(one.end() for one in re.finditer(rf'<joint\b[^>]*\bname="{joint}"[^>]*>', text) if "type=" in one.group(0))
            end = text.index("</joint>", start)
            return text[:start] + re.sub(r"<origin[^>]*/>", "", text[start:end], count=1) + text[end:]
        old, new = without(old), without(new)
    assert old == new, "other bytes differ"


def drawn(random, joints, along):
    """Errors of four joints: a zero alone, a zero beside another error, and twice two others."""
    errors = []
    for place, joint in enumerate(random.choice(joints, 4, replace=False)):
        own = "ABC"[int(np.argmax(np.abs(along[str(joint)])))]
        others = random.choice([letter for letter in LETTERS if letter != own], 2, replace=False)
        for letter in ((own,), (own, others[0]), others, others)[place]:
            size = random.uniform(2e-4, 2e-3) * random.choice([-1, 1])
            errors.append((str(joint), str(letter), float(size)))
    return errors


def judged(what, right, wrong, nominal):
    print(f"  {what}: {1e6 * nominal:.1f} µm before, {1e9 * right:.3f} nm after, {1e6 * wrong:.1f} µm with the opposite sign")
    assert right < CLOSE, what
    assert 1.8 < wrong / nominal < 2.2, what


def farthest(one, other):
    return float(np.sqrt(np.mean(np.sum((one - other) ** 2, axis=1))))


def ur_kinematics(text, flange, yaml_text):
    """The arm of ur_description: the origin of each joint is that of the file."""
    arm = Arm(text, flange)
    frames = yaml.safe_load(yaml_text)["kinematics"]
    for joint, frame in zip(NAMES["ur5"], ["shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3"]):
        at = frames[frame]
        turn = pinocchio.rpy.rpyToMatrix(at["roll"], at["pitch"], at["yaw"])
        index = arm.model.getJointId(joint)
        # Pinocchio folds fixed joints into the placement of the next; of the joints of this arm none precedes but the first.
        before = arm.model.jointPlacements[index] * origin_of(text, joint).inverse()
        arm.model.jointPlacements[index] = before * pinocchio.SE3(turn, np.array([at["x"], at["y"], at["z"]]))
    return arm


def origin_of(text, joint):
    element = next(one for one in tree.fromstring(text).findall("joint") if one.get("name") == joint).find("origin")
    def words(name):
        return np.array([float(word) for word in (element.get(name) or "0 0 0").split()])
    return pinocchio.SE3(pinocchio.rpy.rpyToMatrix(words("rpy")), words("xyz"))


def robot_calibration(text, flange, offsets):
    """Chain3dModel::getChainFK of robot_calibration over the tree of the description, without Pinocchio's kinematics."""
    joints = {one.find("child").get("link"): one for one in tree.fromstring(text).findall("joint")}
    way, link = [], flange
    while link in joints:
        way.insert(0, joints[link])
        link = joints[link].find("parent").get("link")

    def turned(axis, angle):
        return pinocchio.exp3(np.array(axis) * angle)

    def place(positions):
        rotation, at = np.eye(3), np.zeros(3)
        for joint in way:
            name, to_tip = joint.get("name"), origin(joint)
            axis = [float(word) for word in joint.find("axis").get("xyz").split()] if joint.find("axis") is not None else [1, 0, 0]
            angle = positions.get(name, 0.0) + offsets.get(name, 0.0)
            moved = turned(axis, angle) if joint.get("type") in ("revolute", "continuous") else np.eye(3)
            shift = np.array([offsets.get(f"{name}_{one}", 0.0) for one in "xyz"])
            turn = pinocchio.exp3(np.array([offsets.get(f"{name}_{one}", 0.0) for one in "abc"]))
            at = at + rotation @ (to_tip.translation + to_tip.rotation @ shift)
            rotation = rotation @ to_tip.rotation @ turn @ moved
        return at

    def origin(joint):
        return origin_of(text, joint.get("name")) if joint.find("origin") is not None else pinocchio.SE3.Identity()

    return place


def main(program):
    random = np.random.default_rng(43)
    with tempfile.TemporaryDirectory() as work:
        folder = pathlib.Path(work)
        for name in plant.ARMS:
            path, flange, held = plant.ARMS[name]
            file = robots.folder() / path
            text = file.read_text()
            nominal = Arm(text, flange)
            joints = [joint for joint in robots.joints(text)[0] if joint not in held]
            along = axes(text)
            errors = drawn(random, joints, along)
            report(folder / f"{name}.json", errors, along)
            report(folder / f"{name}_wrong.json", [(joint, letter, -value) for joint, letter, value in errors], along)
            positions = nominal.positions(1)
            truth = Arm(text, flange).erring(errors).places(positions)
            gap = farthest(nominal.places(positions), truth)

            def read(which):
                return cure(program, folder, which, file, "--as", "urdf")

            right, wrong = read(name), read(f"{name}_wrong")
            same_bytes(text, right, twists(errors))
            judged(f"{name} urdf", *(farthest(Arm(one, flange).places(positions), truth) for one in (right, wrong)), gap)

            right, wrong = (
                yaml.safe_load(cure(program, folder, which, file, "--as", "robot-calibration")) for which in (name, f"{name}_wrong")
            )
            named = [nominal.model.names[index] for index in range(1, nominal.model.njoints)]
            angles = np.random.default_rng(1).uniform(-3, 3, (POSES, len(named)))
            found = [np.array([robot_calibration(text, flange, offsets)(dict(zip(named, one))) for one in angles])
                     for offsets in (right, wrong)]
            judged(f"{name} robot-calibration", *(farthest(one, truth) for one in found), gap)
            if name in NAMES:
                right, wrong = (ur_kinematics(text, flange, cure(program, folder, which, file, "--as", "ur-kinematics"))
                                for which in (name, f"{name}_wrong"))
                judged(f"{name} ur-kinematics", *(farthest(one.places(positions), truth) for one in (right, wrong)), gap)
    print("calibrated robots: good")


if __name__ == "__main__":
    main(str(pathlib.Path(sys.argv[1]).resolve()))
