#!/usr/bin/env python3
"""The robot cell through a ROS 2 side that is not ours (robot.py): parts, verdicts, corrections, and what the diagnosis finds.

    check.py PROBECELL [part|zero|time]...

Each check has a network namespace of its own. What was planted in the robot is compared with what the cell says.
"""
import json
import math
import pathlib
import re
import shutil
import sys

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path.append(str(ROOT / "tests"))
import kit  # noqa: E402
from kit.recordings import decoded  # noqa: E402

LONGEST = 400  # s; a part of a robot takes its time
ROBOT = pathlib.Path(__file__).resolve().parent / "robot.py"
PROGRAM = """
[ros2.program]
node = "/robot_program"
stop = "/robot_program/stop"
run_parameter = "run_id"
operations = [{ id = "bore", service = "/robot_program/bore" }]
tools = [{ number = 1, parameter = "tool_1_wear" }]
work_offsets = [
    { axis = "X", parameter = "work_offset_x" },
    { axis = "Y", parameter = "work_offset_y" },
    { axis = "Z", parameter = "work_offset_z" },
]
"""


def cell_of(folder, name, contact, change=lambda text: text):
    """A shipped cell of the simulated robot, with the robot on ROS 2 instead, and shorter ways."""
    text = (ROOT / "launch-scripts" / f"{name}.toml").read_text()
    for old, new in [('source = "simulator"', 'source = "ros2"'), ("approach_mm = 3.0", "approach_mm = 1.5"),
                     ("retract_mm = 3.0", "retract_mm = 1.5"), ("feed_mm_per_min = 300.0", "feed_mm_per_min = 600.0")]:
        assert old in text, old
        text = text.replace(old, new)
    ros2 = f'\n[ros2]\naction = "/arm_controller/follow_joint_trajectory"\ncontact = {{ topic = "/contact", {contact} }}\n'
    text = change(text) + ros2 + (PROGRAM if name == "robot_cell" else "")
    shutil.copy(ROOT / "launch-scripts" / "robot_arm.urdf", folder)
    (folder / f"{name}.toml").write_text(text)
    return folder / f"{name}.toml"


def robot(folder, cell, *more):
    return kit.Process(sys.executable, "-B", ROBOT, cell, *more, folder=folder)


def asked(*words, folder):
    return kit.run(BINARY, *words, folder=folder, seconds=LONGEST)


def made(folder, cell, *more):
    """One part by `up --once`: exit status, output and recording."""
    before = set((folder / "recordings").glob("*"))
    with robot(folder, cell, *more) as peer:
        code, output, errors = asked("up", cell, "--once", folder=folder)
        assert peer.code is None, peer.output
    (bag,) = set((folder / "recordings").glob("*")) - before
    return code, output + errors, bag


def a_part_is_made_and_corrected(folder):
    """Work frame and wear are corrected by what was planted, and the bore is within its limits."""
    cell = cell_of(folder, "robot_cell", 'positions = "interpolated", time_standard_uncertainty_ms = 0.2')
    code, output, bag = made(folder, cell, "--jitter", "0.0002")
    assert code == 0 and "part casting: qualified" in output, output
    # robot.py clamps the part off by this, its tilt of some 60 µrad moves the faces by a few µm more.
    for axis, planted in (("X", 410.0), ("Y", -280.0), ("Z", 195.0)):
        (wrote,) = re.findall(rf"work_offset/{axis}: applied: .*now reads ([+-][0-9.]+) µm", output)
        assert abs(float(wrote) - planted) < 20.0, (axis, wrote)
    # The tool is 60 µm too small in radius.
    (wrote,) = re.findall(r"/T1/\d+: applied: .*now reads ([+-][0-9.]+) µm", output)
    assert abs(float(wrote) - 120.0) < 15.0, wrote
    code, replayed, errors = asked("replay", bag, folder=folder)
    assert code == 0, (replayed, errors)


def sizes(bag):
    """Standard uncertainty of each size, and deviations of the touches, m."""
    uncertain, deviations = {}, []
    for channel, _, message in decoded(bag):
        if channel.topic.endswith("/feature_results"):
            uncertain[message.feature_id] = message.standard_uncertainty
        elif channel.topic.endswith("/touch_deviations"):
            deviations.append(message.deviation)
    return uncertain, deviations


def u_grows_with_the_error_of_the_contacts_time(folder):
    """Instants that scatter by 0.2 ms, by 5 ms, and positions that the robot latches: U of each size says so."""
    feed, touch, found = 10e-3, 5e-6, {}
    for jitter, contact, more in [
        (0.0002, 'positions = "interpolated", time_standard_uncertainty_ms = 0.2', []),
        (0.005, 'positions = "interpolated", delay_ms = 20.0, time_standard_uncertainty_ms = 5.0', ["--delay", "0.02"]),
        (0.0, 'positions = "latched", latched_joint_states = "/contact_joint_states"', ["--latched", "--delay", "0.03"]),
    ]:
        only = lambda text: re.sub(r'(?ms)^\[\[part.features\]\]\nid = "ball_[23].*?(?=^\[)', "", re.sub(r'(?m)^    \{ id = "ball_[23].*\n', "", text))
        cell = cell_of(folder, "robot_check", contact, only)
        code, output, bag = made(folder, cell, "--true", "--jitter", str(jitter), *more)
        uncertain, deviations = sizes(bag)
        u = math.hypot(touch, feed * jitter)
        # The deviations scatter as stated: 25 touches, and their mean is that of the ball.
        mean = sum(deviations) / len(deviations)
        scatter = math.sqrt(sum((one - mean) ** 2 for one in deviations) / (len(deviations) - 1))
        print(f"  jitter {jitter * 1e3:g} ms: touches {u * 1e6:.1f} µm stated, {scatter * 1e6:.1f} µm found; u of ball_1_up {uncertain['ball_1_up'] * 1e6:.1f} µm")
        assert len(deviations) == 25 and 0.5 * u < scatter < 1.6 * u, (u, scatter)
        assert abs(mean) < 3 * u / 5 + 2e-6, mean
        found[jitter] = uncertain
    for name, uncertain in found[0.0].items():
        # Without a time nothing is added; with 5 ms at 10 mm/s the 5 µm of a touch become 50 µm.
        assert uncertain < found[0.0002][name] < found[0.005][name] / 4, (name, found)


def a_planted_zero_is_found(folder):
    """200 µrad in the zero of A2, which the robot knows and nobody else."""
    cell = cell_of(folder, "robot_check", 'positions = "interpolated", time_standard_uncertainty_ms = 0.2')
    code, output, bag = made(folder, cell, "--zero", "A2=200e-6", "--true", "--jitter", "0.0002")
    assert code == 0, output
    code, output, errors = asked("diagnose", bag, "--json", folder=folder)
    assert code == 0, (output, errors)
    report = json.loads(output)
    effects = {one["effect"]: one for one in report["effects"]}
    print({name: one["parameters"] for name, one in effects.items()}, report["verdict"])
    found = effects["link.EC0A2"]
    (parameter,) = [one for one in found["parameters"] if one["name"] == "e"]
    low, high = parameter["ci95"]
    assert low <= 200e-6 <= high and high - low < 100e-6, parameter
    assert found["probability"] > 0.9, found


if __name__ == "__main__":
    BINARY = pathlib.Path(sys.argv[1]).resolve()
    kit.main({"part": a_part_is_made_and_corrected, "zero": a_planted_zero_is_found, "time": u_grows_with_the_error_of_the_contacts_time}, sys.argv[2:])
    print("robot on ROS 2: all good")
