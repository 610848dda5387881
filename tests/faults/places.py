"""Where a cell has its router and its recorder: in its own launcher, beside it, or on another host whose link is cut."""

import os
import subprocess

HERE, THERE = "10.88.0.1", "10.88.0.2"
KINDS = ("alone", "alone", "alone", "beside", "apart", "far")


def ip(*words):
    subprocess.run(["ip", *words], check=True)


class Place:
    """`alone`: the launcher carries the router. `beside`: a process of its own does. `apart`: the router is on another host.
    `far`: so is the recorder."""

    def __init__(self, kind, folder, binary, environment):
        self.kind, self.folder, self.binary, self.environment = kind, folder, binary, environment
        self.router = self.recorder = None
        self.host = f"faults-{os.getpid()}"
        self.endpoint = "tcp/127.0.0.1:7447"
        if self.is_apart:
            ip("netns", "add", self.host)
            ip("-n", self.host, "link", "set", "lo", "up")
            ip("link", "add", "here", "type", "veth", "peer", "name", "there", "netns", self.host)
            ip("address", "add", f"{HERE}/24", "dev", "here")
            ip("link", "set", "here", "up")
            ip("-n", self.host, "address", "add", f"{THERE}/24", "dev", "there")
            self.join()
            self.endpoint = f"tcp/{THERE}:7447"

    @property
    def is_apart(self):
        return self.kind in ("apart", "far")

    def cell_file(self, text):
        """The cell at this router."""
        assert text.count("tcp/127.0.0.1:7447") == 1
        return text.replace("tcp/127.0.0.1:7447", self.endpoint)

    def start(self, *words):
        """A process on the other host, or beside the cell."""
        inside = ["ip", "netns", "exec", self.host] if self.is_apart else []
        return subprocess.Popen(
            [*inside, self.binary, *words], cwd=self.folder, env=self.environment, text=True, stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, stderr=open(self.folder / "errors_elsewhere.txt", "a"),
        )

    def start_router(self):
        if self.kind == "alone":
            return
        # On another host every process of the cell is a stranger.
        to = ["--strangers", "write"] if self.is_apart else []
        self.router = self.start("router", "--listen", self.endpoint, *to)
        line = self.router.stdout.readline()
        assert "listens on" in line, (line, (self.folder / "errors_elsewhere.txt").read_text())

    def start_recorder(self):
        """Beside the router; the cell runs on while it hears nothing from there."""
        (self.folder / "recordings").mkdir(exist_ok=True)
        self.recorder = self.start("record", "--cell", "cell.toml", "--folder", "recordings/far")

    def cut(self):
        ip("-n", self.host, "link", "set", "there", "down")

    def join(self):
        ip("-n", self.host, "link", "set", "there", "up")

    def end_recorder(self, seconds):
        if self.recorder:
            self.recorder.terminate()
            self.recorder.wait(seconds)

    def close(self):
        for process in (self.recorder, self.router):
            if process:
                if process.poll() is None:
                    process.kill()
                process.wait()
        if self.is_apart:
            ip("netns", "del", self.host)
