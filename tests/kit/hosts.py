"""Other computers and the cables between them: network namespaces joined by pairs of virtual interfaces."""

import os
import subprocess

from .processes import Process, until


class Host:
    """A network of its own for as long as the test runs, or that of the test. `inside`: what a command begins with that runs there."""

    def __init__(self, is_here=False):
        self.pid, self.inside = os.getpid(), ()
        if not is_here:
            own = os.readlink("/proc/self/ns/net")
            self.pid = Process("unshare", "-n", "-i", "cat", stdin=subprocess.PIPE).pid
            until("another host", lambda: os.readlink(f"/proc/{self.pid}/ns/net") != own)
            self.inside = ("nsenter", "-t", str(self.pid), "-n", "-i", "--")
            self.ip("link", "set", "lo", "up")

    def ip(self, *words):
        subprocess.run([*self.inside, "ip", *words], check=True)


class Cable:
    """Joins two hosts, of which it gives the addresses; each has a number of its own."""

    def __init__(self, one, other, number=1):
        self.one, self.name = one, f"cable_{number}"
        self.addresses = (f"10.77.{number}.1", f"10.77.{number}.2")
        one.ip("link", "add", self.name, "type", "veth", "peer", "name", self.name, "netns", str(other.pid))
        for host, address in zip((one, other), self.addresses):
            host.ip("address", "add", f"{address}/24", "dev", self.name)
            host.ip("link", "set", self.name, "up")

    def pull(self):
        self.one.ip("link", "set", self.name, "down")

    def plug(self):
        self.one.ip("link", "set", self.name, "up")
