"""Where a cell has its router and its recorder: in its own launcher, beside it, or on another host whose link is cut."""

import kit

KINDS = ("alone", "alone", "alone", "beside", "apart", "far")


class Place:
    """`alone`: the launcher carries the router. `beside`: a process of its own does. `apart`: the router is on another host.
    `far`: so is the recorder."""

    def __init__(self, kind, folder, binary, environment):
        self.kind, self.folder, self.binary, self.environment = kind, folder, binary, environment
        self.router = self.recorder = None
        self.endpoint, self.host = "tcp/127.0.0.1:7447", kit.Host(is_here=True)
        if self.is_apart:
            here, self.host = self.host, kit.Host()
            self.cable = kit.Cable(here, self.host)
            self.endpoint = f"tcp/{self.cable.addresses[1]}:7447"

    @property
    def is_apart(self):
        return self.kind in ("apart", "far")

    def cell_file(self, text):
        """The cell at this router."""
        assert text.count("tcp/127.0.0.1:7447") == 1
        return text.replace("tcp/127.0.0.1:7447", self.endpoint)

    def start(self, *words):
        """A process on the other host, or beside the cell."""
        return kit.Process(*self.host.inside, self.binary, *words, folder=self.folder, environment=self.environment, apart=True)

    def start_router(self):
        if self.kind == "alone":
            return
        # On another host every process of the cell is a stranger.
        to = ["--strangers", "write"] if self.is_apart else []
        self.router = self.start("router", "--listen", self.endpoint, *to)
        self.router.says("listens on")

    def start_recorder(self):
        """Beside the router; the cell runs on while it hears nothing from there."""
        (self.folder / "recordings").mkdir(exist_ok=True)
        self.recorder = self.start("record", "--cell", "cell.toml", "--folder", "recordings/far")

    def cut(self):
        self.cable.pull()

    def join(self):
        self.cable.plug()

    def end_recorder(self):
        if self.recorder:
            self.recorder.end()

    def close(self):
        for process in (self.recorder, self.router):
            if process:
                process.kill()
