#!/usr/bin/env python3
"""Recordings through the converters of other projects, without options: rosbags (to a ROS 1 bag) and Rerun.

    convert.py MAKE_PART FILE.mcap...

Converts every recording given and, where MAKE_PART (the example `make_part` of `tests`) is not `-`, a fresh one of each simulated cell
in launch-scripts. Every topic must come through: by rosbags with each of its messages, as the reader of `mcap` counts them.
"""

import pathlib
import subprocess
import sys
import tempfile

from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

ROOT = pathlib.Path(__file__).resolve().parents[2]
TOOLS = pathlib.Path(sys.executable).parent
NOT_MADE = {  # cells of launch-scripts whose machine is not simulated
    "external", "linuxcnc_bore", "linuxcnc_box",
}


def counted(recording):
    with open(recording, "rb") as file:
        summary = make_reader(file).get_summary()
    counts = summary.statistics.channel_message_counts
    return {channel.topic: counts.get(number, 0) for number, channel in summary.channels.items()}


def run(*words):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True)
    assert done.returncode == 0, f"{words}: {done.stdout}\n{done.stderr}"
    return done.stdout


def check(recording, folder):
    wanted, converted, rerun = counted(recording), folder / "converted.bag", folder / "converted.rrd"
    run(TOOLS / "rosbags-convert", "--src", recording, "--dst", converted)
    with AnyReader([converted]) as reader:
        found = {topic: about.msgcount for topic, about in reader.topics.items()}
    assert found == {topic: count for topic, count in wanted.items() if count}, (recording, found, wanted)
    run(TOOLS / "rerun", "mcap", "convert", recording, "-o", rerun)
    printed = run(TOOLS / "rerun", "rrd", "print", rerun)
    lost = [topic for topic, count in wanted.items() if count and topic not in printed]
    assert not lost, (recording, lost)
    converted.unlink()
    rerun.unlink()
    print(f"{recording.name}: {len(found)} topics, {sum(found.values())} messages by rosbags; all topics by rerun", flush=True)


def main():
    make_part, *recordings = sys.argv[1:]
    assert recordings, "no recording is given"
    with tempfile.TemporaryDirectory() as work:
        folder = pathlib.Path(work)
        for recording in recordings:
            check(pathlib.Path(recording), folder)
        if make_part == "-":
            return
        for cell in sorted((ROOT / "launch-scripts").glob("*.toml")):
            if cell.stem not in NOT_MADE:
                made = folder / f"{cell.stem}.mcap"
                run(make_part, cell, "part_1", made)
                check(made, folder)
                made.unlink()


main()
