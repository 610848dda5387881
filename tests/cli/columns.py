#!/usr/bin/env python3
"""What the command line prints on a terminal fits 100 columns and says the same as into a pipe.

    columns.py PROBECELL

Reads the sample recordings on a pseudo-terminal. Needs nothing but Python.
"""

import os
import pathlib
import pty
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
WIDEST = 100
SAMPLES = ROOT / "bags" / "samples"
COMMANDS = ("diagnose", "report", "info")


def on_terminal(words):
    """What a command prints on a terminal."""
    ours, theirs = pty.openpty()
    process = subprocess.Popen(words, stdin=theirs, stdout=theirs, stderr=subprocess.DEVNULL, close_fds=True)
    os.close(theirs)
    text = b""
    while True:
        try:
            some = os.read(ours, 65536)
        except OSError:  # of Linux, once the other side is closed
            break
        if not some:
            break
        text += some
    os.close(ours)
    return process.wait(), text.decode().replace("\r\n", "\n")


def check(program):
    folded = 0
    for sample in sorted(SAMPLES.glob("*.mcap")):
        for command in COMMANDS:
            words = [program, command, sample]
            piped = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=False)
            status, shown = on_terminal(words)
            text = piped.stdout.decode()
            assert status == piped.returncode, (command, sample.name, status)
            assert re.sub(r"\x1b\[\d+m", "", shown).split() == text.split(), (command, sample.name)
            for line in shown.splitlines():
                # Neither a word nor a command that somebody may copy is broken.
                assert len(line) <= WIDEST or len(line.split()) <= 2 or ": probecell " in line, (command, sample.name, line)
            folded += shown.count("\n") - text.count("\n")
    assert folded > 0, "nothing was too long: this shows nothing"
    print(f"{len(COMMANDS)} commands on {len(list(SAMPLES.glob('*.mcap')))} samples: {folded} lines folded, no word changed")


if __name__ == "__main__":
    check(pathlib.Path(sys.argv[1]).resolve())
