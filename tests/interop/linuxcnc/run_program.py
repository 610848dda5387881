#!/usr/bin/env python3
"""Runs a program on the LinuxCNC that listens on TCP 5007, as its operator would: run_program.py PROGRAM.

The machine must be switched on and homed. Exit status 0 when the program has come to its end.
"""

import pathlib
import socket
import sys
import time

# Polls in a row, 50 ms apart, that show an idle interpreter at the end of a program. After a single one the log of a program once, in some
# twenty runs, lacked its last three touches; why was not found.
ENDED = 10


class Shell:
    """The remote shell: one request, its lines of answer."""

    def __init__(self):
        self.socket = socket.create_connection(("127.0.0.1", 5007), timeout=5)
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
    path = pathlib.Path(sys.argv[1]).resolve()
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
    deadline = time.monotonic() + 120
    running, idle = False, 0
    while time.monotonic() < deadline:
        status = shell.say("get program_status").upper()
        running = running or "RUNNING" in status
        idle = idle + 1 if "IDLE" in status else 0
        if running and idle == ENDED:
            print(f"the interpreter is idle; its last error: {shell.say('get error')}")
            return
        time.sleep(0.05)
    raise SystemExit("the program does not come to its end")


main()
