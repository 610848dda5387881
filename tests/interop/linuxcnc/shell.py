"""LinuxCNC's remote shell on TCP 5007: one request, its lines of answer."""

import pathlib
import socket
import sys

sys.path.append(str(pathlib.Path(__file__).resolve().parents[2]))
import kit  # noqa: E402


class Shell:
    def __init__(self):
        self.socket = socket.create_connection(("127.0.0.1", 5007), timeout=kit.patience(30))
        self.file = self.socket.makefile("r", newline="\n")
        self.say("hello EMC probecell 1.0")
        self.socket.sendall(b"set echo off\r\nset verbose on\r\n")
        while "VERBOSE ACK" not in (answer := self.file.readline()):
            if not answer:
                raise SystemExit("the remote shell is gone")
        self.set("enable EMCTOO")

    def say(self, request):
        """The first line of the answer."""
        self.socket.sendall(request.encode() + b"\r\n")
        while True:
            answer = self.file.readline()
            if not answer:
                raise SystemExit("the remote shell is gone")
            if answer.strip():
                return answer.strip()

    def set(self, request):
        """A request that must be acknowledged."""
        answer = self.say(f"set {request}")
        if not answer.endswith("ACK"):
            raise SystemExit(f"{request}: {answer}; {self.say('get error')}; {self.say('get operator_display')}")
