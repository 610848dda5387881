"""Deadlines of shell scripts.

    python3 tests/kit limit SECONDS -- COMMAND...    runs a command; one that takes longer is ended with status 124, after its state was shown
    python3 tests/kit until SECONDS -- COMMAND...    runs a command until it succeeds

Seconds are those of an idle machine. Where XDG_STATE_HOME is not set, the command has keys and sockets of its own.
"""

import os
import pathlib
import signal
import subprocess
import sys

sys.path[0] = str(pathlib.Path(__file__).resolve().parents[1])
import kit  # noqa: E402


def limit(seconds, command):
    process = subprocess.Popen(command)
    deadline = kit.Deadline(seconds)
    while True:
        try:
            code = process.wait(deadline.left())
            return code if code >= 0 else 128 - code
        except subprocess.TimeoutExpired:
            if deadline.has_passed():
                break
    kit.state()
    process.send_signal(signal.SIGTERM)
    try:
        process.wait(kit.patience(10))
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    print(f"{' '.join(command)}: not within {seconds:g} s of an idle machine: {deadline}", file=sys.stderr)
    return 124


def until(seconds, command):
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    try:
        kit.until(" ".join(command), lambda: subprocess.run(command, **quiet).returncode == 0, seconds)
        return 0
    except kit.Late as error:
        print(error, file=sys.stderr)
        return 1


def main():
    if len(sys.argv) < 5 or sys.argv[1] not in ("limit", "until") or sys.argv[3] != "--":
        raise SystemExit(__doc__)
    seconds, command = float(sys.argv[2]), sys.argv[4:]
    with kit.new_folder() as folder:
        keep = dict(os.environ)
        kit.own_places(folder)
        if "XDG_STATE_HOME" in keep:
            os.environ.update({name: keep[name] for name in ("XDG_CONFIG_HOME", "XDG_STATE_HOME") if name in keep})
        raise SystemExit((limit if sys.argv[1] == "limit" else until)(seconds, command))


main()
