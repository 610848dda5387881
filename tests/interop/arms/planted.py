"""Arms in motion with one planted cause each: the main cause is found, and nothing innocent is named.

    planted.py PROGRAM [SESSIONS [SEED [FOLDER]]]

SESSIONS of each cause; FOLDER keeps the recordings. The plant (plant.py) shares nothing with the program.
"""

import csv
import json
import pathlib
import subprocess
import sys
import tempfile
import time

import mcap_ros2.reader
import numpy as np

import plant
import robots

INNOCENT = 0.05  # of the gap, closed by what is not there
SAME = 0.5  # of the time over which a contact and what is said of it last together
INSTANT = 0.05  # s, within which a contact begins and ends: counted, like intervals
# Least shares: main cause found, no innocent beside it, nothing named where nothing is.
FOUND, CLEAN, QUIET = 0.9, 0.9, 0.9


def closes(effect):
    return effect["rms_before"] - effect["rms_after"]


def judged(draw, report):
    """What a report says of a session whose cause is known."""
    planted = plant.IDENTIFIERS[draw.cause]
    gap = report["gap"]["rms"]
    effects = report["effects"]
    main = max(effects, key=closes, default=None)
    if main is None or not planted:
        found = not planted and not effects
    else:
        group = {main["effect"], *main.get("group", []), *main["indistinguishable_from"]}
        found = bool(planted & group) and closes(main) > 0
    innocents = [
        effect["effect"]
        for effect in effects
        if closes(effect) > INNOCENT * gap and not planted & {effect["effect"], *effect.get("group", [])}
    ]
    held = []
    for effect in effects:
        if effect["effect"] in planted:
            for parameter in effect["parameters"]:
                if parameter["name"] in draw.truth:
                    low, high = parameter["ci95"]
                    held.append((parameter["name"], draw.truth[parameter["name"]], low, high))
    touches = [(one["key"], one["from"], one["to"]) for one in report["unexplained"]["where"] if one["dimension"] == "time"]
    if draw.contact:
        recording, begin, end = draw.contact
        found = len(touches) == 1 and recording in touches[0][0]
        if found:
            _, first, last = touches[0]
            found = min(last, end) - max(first, begin) > SAME * (max(last, end) - min(first, begin))
            held = [(f"instant {one}", one, seen - INSTANT, seen + INSTANT) for one, seen in ((begin, first), (end, last))]
    elif touches:
        innocents.append("contact")
    left = effects[-1]["rms_after"] if effects else gap
    return {
        "found": found,
        "innocents": innocents,
        "left": left,
        "floor": report["gap"]["noise_floor"],
        "verdict": report["verdict"],
        "named": [(one["effect"], round(one["rms_before"] / gap, 3), round(one["rms_after"] / gap, 3)) for one in effects],
        "held": held,
        "touches": touches,
    }


def diagnosed(program, folder, ending=".mcap"):
    begun = time.monotonic()
    command = [program, "diagnose", "--fit", str(folder / f"fit{ending}"), "--withhold", str(folder / f"held{ending}"), "--json"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)}: {done.stderr.strip()}")
    return json.loads(done.stdout), time.monotonic() - begun


def imported(program, folder, draw, source):
    """The report of the same motions, imported with the description as the package ships it, from a topic of commands or a table."""
    file, flange, _ = plant.ARMS[draw.arm]
    ending = f"_of_{source.rpartition('/')[2]}"
    for name in ("fit", "held"):
        recording = folder / f"{name}.mcap"
        command = ["--out", str(folder / f"{name}{ending}"), "--urdf", str(robots.folder() / file), "--mount", flange]
        if source == "table":
            recording = tabulated(recording)
            command += ["--units", "time=s,angle=rad,length=m"]
        else:
            command += ["--joint-states", "/cell/joint_states"]
            if draw.cause in plant.MOTION:
                command += ["--commands", source]
        done = subprocess.run([program, "import", "motion", str(recording), *command], capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(f"import motion {recording} {' '.join(command)}: {done.stderr.strip()}")
    return diagnosed(program, folder, ending)[0]


def tabulated(recording):
    """The same as a table whose columns are named like their roles; state and command of an instant in one row."""
    rows = {}
    for message in mcap_ros2.reader.read_ros2_messages(str(recording)):
        if message.channel.topic not in ("/cell/joint_states", "/cell/joint_commands"):
            continue
        state = message.ros_msg
        row = rows.setdefault(f"{state.header.stamp.sec}.{state.header.stamp.nanosec:09}", {})
        roles = ("command",) if message.channel.topic.endswith("commands") else ("position", "velocity", "effort")
        for role, values in zip(roles, (state.position, state.velocity, state.effort)):
            row |= {f"{role}.{joint}": repr(value) for joint, value in zip(state.name, values)}
    path = recording.with_suffix(".csv")
    with open(path, "w") as file:
        writer = csv.DictWriter(file, ["time", *next(iter(rows.values()))])
        writer.writeheader()
        writer.writerows({"time": time, **row} for time, row in rows.items())
    return path


def figures(report):
    return [report["verdict"], *((one["effect"], f"{one['rms_before']:.5e}", f"{one['rms_after']:.5e}") for one in report["effects"])]


def alike(one, other):
    """Equal but for the rounding of instants, which a table has in seconds."""
    (verdict, *first), (same, *second) = figures(one), figures(other)
    pairs = zip(first, second)
    near = all(a[0] == b[0] and np.allclose([float(x) for x in a[1:]], [float(x) for x in b[1:]], rtol=1e-3) for a, b in pairs)
    return verdict == same and len(first) == len(second) and near


def table(results):
    print(f"{'cause':10} {'drawn':>5} {'found':>5} {'innocent':>8} {'left/noise':>10} {'left/rest':>9} {'in 95 %':>13} {'s':>5}")
    for cause in (*plant.EFFORT, *plant.MOTION):
        own = [result for result in results if result["cause"] == cause]
        if not own:
            continue
        held = [low <= truth <= high for result in own for _, truth, low, high in result["held"]]
        print(
            f"{cause:10} {len(own):5} {sum(one['found'] for one in own):5} {sum(bool(one['innocents']) for one in own):8}"
            f" {np.median([one['left'] / max(one['floor'], 1e-12) for one in own]):10.2f}"
            f" {np.median([one['left'] / one['remainder'] for one in own]):9.2f}"
            f" {f'{sum(held)} of {len(held)}':>13} {np.median([one['seconds'] for one in own]):5.2f}",
            flush=True,
        )


def main(program, sessions=1, seed=0, keep=None, causes=None):
    results = []
    # A short run has short motions.
    seconds = (20, 40) if sessions > 1 else (10, 12)
    with tempfile.TemporaryDirectory() as work:
        for number in range(sessions):
            for place, cause in enumerate((*plant.EFFORT, *plant.MOTION)):
                if causes and cause not in causes:
                    continue
                folder = pathlib.Path(keep or work) / f"{cause}_{seed}_{number}"
                folder.mkdir(parents=True, exist_ok=True)
                draw = plant.session(cause, (seed, number, place), folder, seconds)
                report, taken = diagnosed(program, folder)
                if number == 0:
                    sources = ["/cell/joint_commands", "table"]
                    sources += [f"/controller/{name}" for name in plant.CONTROLLER if cause in plant.MOTION]
                    for source in sources:
                        again = imported(program, folder, draw, source)
                        same = alike(again, report) if source == "table" else figures(again) == figures(report)
                        assert same, f"{folder.name}: imported from {source}, it says {figures(again)} for {figures(report)}"
                result = judged(draw, report)
                result |= {"cause": cause, "seconds": taken, "remainder": draw.remainder}
                results.append(result)
                if not result["found"] or result["innocents"] or keep:
                    print(
                        f"{'ok ' if result['found'] and not result['innocents'] else 'BAD'} {folder.name}: {draw.arm},"
                        f" {len(draw.moved)} joints at {draw.rate:.0f} Hz, {draw.gap:.1f} times the remainder{draw.note};"
                        f" {result['verdict']}, {result['named']} {draw.contact or ''} {result['touches'] or ''}",
                        flush=True,
                    )
    table(results)
    caused = [one for one in results if plant.IDENTIFIERS[one["cause"]] or one["cause"] == "contact"]
    quiet = [one for one in results if one not in caused]
    found = np.mean([one["found"] for one in caused]) if caused else 1.0
    clean = np.mean([not one["innocents"] for one in caused]) if caused else 1.0
    still = np.mean([one["found"] for one in quiet]) if quiet else 1.0
    print(f"main cause {found:.1%}, without innocents {clean:.1%}, nothing named where nothing is {still:.1%}")
    assert found >= FOUND and clean >= CLEAN and still >= QUIET, "the diagnosis of arms in motion is worse than it was"


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:4]), *sys.argv[4:5], causes=sys.argv[5:] or None)
