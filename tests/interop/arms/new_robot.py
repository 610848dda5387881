"""Arms as their makers ship them: a cell from the robot description, a part on the simulated arm, and its joint zero by name.

    new_robot.py PROBECELL [ARM...]

Each simulated arm hides an error of 300 µrad about an axis of the frame of its second joint: its zero, with the sign of its axis there.
Inside a network namespace.
"""

import json
import pathlib
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as tree

import robots

HIDDEN = 300e-6  # rad
# Options of each arm: links that carry a tool, and the sense where the description does not tell it.
ARMS = {
    "ur3_robot": [],
    "ur5_robot": [],
    "ur10_robot": [],
    "kinova": [],
    "z1": ["--mount", "link06", "--stem", "1,0,0"],
    "b1-z1": ["--mount", "link06", "--stem", "1,0,0"],
    "anymal-kinova": ["--mount", "j2s6s200_link_6"],
    "panda": ["--mount", "panda_link8"],
    "xarm7": [],
    "ur5_joint_limited_robot": [],
}


def planted(cell, description):
    """Name of the joint whose zero errs, and by how much in its own sense, rad."""
    name = json.loads(cell.split("errors = [{ name = ")[1].split(",")[0])
    [joint] = [one for one in tree.fromstring(description).findall("joint") if one.get("name") == name[3:]]
    axis = joint.find("axis").get("xyz").split()
    return name[3:], HIDDEN * float(axis["ABC".index(name[1])])


def check(program, arm):
    path = next(file for file in robots.files() if file.stem == arm)
    begun = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / arm.replace("-", "_")
        run = lambda *words: subprocess.run(words, cwd=folder, capture_output=True, text=True)  # noqa: E731
        made = run(program, "new", "robot", "--urdf", path, "--out", out, *ARMS[arm])
        assert made.returncode == 0, made.stderr
        cell = out / f"{out.name}.toml"
        planned = time.monotonic() - begun
        part = run(program, "up", cell, "--once", "--no-dashboard", "--speed", "max")
        assert part.returncode == 0, part.stdout + part.stderr
        [recording] = pathlib.Path(folder, "recordings").iterdir()
        report = json.loads(run(program, "diagnose", "--json", recording).stdout)
        joint, expected = planted(cell.read_text(), path.read_text())
        named = [effect for effect in report["effects"] if effect.get("joint_zero")]
        assert len(named) == len(report["effects"]) == 1, report["effects"]
        zero = named[0]["joint_zero"]
        low, high = zero["ci95"]
        half = (high - low) / 2
        assert zero["joint"] == joint, zero
        assert abs(zero["value"] - expected) < 2 * half, (zero, expected)
        group = named[0]["group"]
        print(
            f"{arm:16} zero of {joint}: {zero['value'] * 1e6:.1f} ± {half * 1e6:.1f} µrad of {expected * 1e6:.0f}"
            f"{', or ' + ', '.join(group[1:]) if len(group) > 1 else ''}; cell in {planned:.1f} s, all in {time.monotonic() - begun:.0f} s",
            flush=True,
        )


def main(program, *arms):
    for arm in arms or ARMS:
        check(pathlib.Path(program).resolve(), arm)
    print(f"{len(arms or ARMS)} arms: good")


if __name__ == "__main__":
    main(*sys.argv[1:])
