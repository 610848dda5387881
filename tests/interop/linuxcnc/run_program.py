#!/usr/bin/env python3
"""Runs a program on the LinuxCNC that listens on TCP 5007, as its operator would: run_program.py PROGRAM LOG.

The machine must be switched on and homed. Exit status 0 when the program has written the last line of its log and the interpreter is idle: one
that is idle before may be between two lines.
"""

import pathlib
import socket
import sys

sys.path.append(str(pathlib.Path(__file__).resolve().parents[2]))
import kit  # noqa: E402


class Shell:
    """The remote shell: one request, its lines of answer."""

    def __init__(self):
        self.socket = socket.create_connection(("127.0.0.1", 5007), timeout=kit.patience(30))
        self.file = self.socket.makefile("r", newline="\n")

    def say(self, request):
        self.socket.sendall(request.encode() + b"\r\n")
        while True:
            answer = self.file.readline()
            if not answer:
                raise SystemExit("the remote shell is gone")
            if answer.strip():
                return answer.strip()


def main():
    path, log = (pathlib.Path(one).resolve() for one in sys.argv[1:])
    shell = Shell()
    shell.say("hello EMC run_program 1.0")
    shell.socket.sendall(b"set echo off\r\nset verbose on\r\n")
    while "VERBOSE ACK" not in (answer := shell.file.readline()):
        if not answer:
            raise SystemExit("the remote shell is gone")
    for request in ("enable EMCTOO", "mode auto", f"open {path}", "run"):
        answer = shell.say(f"set {request}")
        if not answer.endswith("ACK"):
            raise SystemExit(f"{request}: {answer}")

    def ended():
        lines = log.read_text().splitlines() if log.exists() else []
        return lines and lines[-1].startswith("end ") and "IDLE" in shell.say("get program_status").upper()

    try:
        kit.until("the last line of the log", ended)
    finally:
        print(f"{shell.say('get program_status')}; the last error: {shell.say('get error')}")


main()
