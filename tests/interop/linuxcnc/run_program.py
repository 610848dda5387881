#!/usr/bin/env python3
"""Runs a program on the LinuxCNC that listens on TCP 5007, as its operator would: run_program.py PROGRAM LOG.

The machine must be switched on and homed. Exit status 0 when the program has written the last line of its log and the interpreter is idle: one
that is idle before may be between two lines.
"""

import pathlib
import sys

sys.path.append(str(pathlib.Path(__file__).resolve().parents[2]))
import kit  # noqa: E402
from shell import Shell  # noqa: E402


def main():
    path, log = (pathlib.Path(one).resolve() for one in sys.argv[1:])
    shell = Shell()
    for request in ("mode auto", f"open {path}", "run"):
        shell.set(request)

    def ended():
        lines = log.read_text().splitlines() if log.exists() else []
        return lines and lines[-1].startswith("end ") and "IDLE" in shell.say("get program_status").upper()

    try:
        kit.until("the last line of the log", ended)
    finally:
        print(f"{shell.say('get program_status')}; the last error: {shell.say('get error')}")


main()
