"""What the machine gives: deadlines that are stated for an idle one, and stretched by what is measured.

When a test starts, a fixed amount of work is timed against an idle machine, and every deadline is longer by that ratio. A deadline that passes is
extended once, as far as the load since then explains: by the time for which the processes of the test were ready to run and did not run
(/proc/PID/task/TID/schedstat), and for which tasks waited for disks (/proc/pressure/io). What does not wait for a processor, as a process that
is deadlocked, gets little of it.
"""

import contextlib
import functools
import os
import pathlib
import subprocess
import sys
import time

PROC = pathlib.Path("/proc")
IDLE = 0.20  # s that `slowness` times on two idle cores (2026-11-27), on which the deadlines of the tests were written
MOST = 6.0  # times; what is later on a machine that is slower than that is late
NOTHING = 0.02  # share of a span; processes that wanted less of a processor were not held up by its load
WAYS = 4  # processes that what is promised passes through: a peer, a node, the bus, the test
MARK = "TEST_PROCESS"  # in the environment of every process of a test, also of those whose parent has ended


def slowness():
    """How many times as long a fixed amount of work takes as on an idle machine, at least 1: computing, and starting processes."""
    begun, number = time.monotonic(), 1
    for _ in range(6):
        for _ in range(300_000):
            number = (number * 1_103_515_245 + 12_345) & 0xFFFF_FFFF
        subprocess.run([sys.executable, "-S", "-E", "-c", "pass"], check=True)
    return min(MOST, max(1.0, (time.monotonic() - begun) / IDLE))


@functools.cache
def at_start():
    """The slowness when this test started; measured once."""
    return slowness()


def patience(seconds):
    """Seconds of an idle machine as seconds of this one, for libraries that take no more than a number."""
    return seconds * at_start()


def processes():
    """Numbers of the processes of this test: those that it has started, and theirs."""
    mark = f"{MARK}={os.environ.get(MARK)}".encode()
    found, parents = {os.getpid()}, {}
    for entry in PROC.iterdir():
        if not entry.name.isdigit():
            continue
        with contextlib.suppress(OSError):
            parents[int(entry.name)] = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
            if mark in (entry / "environ").read_bytes().split(b"\0"):
                found.add(int(entry.name))
    while more := {one for one, parent in parents.items() if parent in found} - found:
        found |= more
    return found


def threads(process):
    """Seconds for which each thread of a process has run, and has waited for a processor."""
    found = {}
    with contextlib.suppress(OSError):
        for thread in (PROC / str(process) / "task").iterdir():
            with contextlib.suppress(OSError):
                ran, waited, _ = (thread / "schedstat").read_text().split()
                found[int(thread.name)] = (int(ran) / 1e9, int(waited) / 1e9)
    return found


def stalled():
    """Seconds for which any task of the machine has waited for a disk; 0 where the kernel does not count."""
    with contextlib.suppress(OSError):
        return int((PROC / "pressure" / "io").read_text().split("total=")[1].split()[0]) / 1e6
    return 0.0


class Load:
    """What others have cost the processes of this test since it was made."""

    def __init__(self):
        self.begun, self.stalled = time.monotonic(), stalled()
        self.before = self.now()

    @staticmethod
    def now():
        return {(process, thread): times for process in processes() for thread, times in threads(process).items()}

    def since(self):
        """Seconds for which each thread, by its process and number, has run and has waited since."""
        difference = lambda one, times: tuple(now - before for now, before in zip(times, self.before.get(one, (0.0, 0.0))))
        return {one: difference(one, times) for one, times in self.now().items()}

    def held_up(self, of=None):
        """For how long the thread has waited for a processor that has waited longest, of all processes or of these, s."""
        return max((waited for (process, _), (_, waited) in self.since().items() if of is None or process in of), default=0.0)

    def stretch(self):
        """How many times as long everything took as with a processor for whatever was ready to run; at least 1."""
        ran, waited = map(sum, zip(*self.since().values()))
        if ran + waited < NOTHING * (time.monotonic() - self.begun):
            return 1.0
        return min(MOST, (ran + waited) / max(ran, 1e-6))

    def disks(self):
        """How many times as long everything took that had to wait whenever any task of the machine waited for a disk; at least 1."""
        elapsed = max(time.monotonic() - self.begun, 1e-3)
        return 1.0 / max(1.0 / MOST, 1.0 - (stalled() - self.stalled) / elapsed)

    def stretched(self, seconds):
        """What computes for so many seconds on an idle machine may have taken so long."""
        return seconds * min(MOST, self.stretch() * self.disks())

    def allows(self, seconds):
        """What has to happen within so many seconds, most of which nobody computes, may have taken so long: no process on its way was held up
        longer than the thread that was held up longest."""
        return min(self.stretched(seconds), (seconds + WAYS * self.held_up()) * self.disks())


class Deadline:
    """So many seconds of an idle machine from now on."""

    def __init__(self, seconds):
        factor = at_start()
        self.seconds, self.load = seconds, Load()
        self.end, self.is_last = self.load.begun + seconds * factor, False

    def left(self):
        """Seconds; 0 when it is over, for the first or the last time."""
        return max(0.0, self.end - time.monotonic())

    def has_passed(self):
        """Whether it has, for good. When it passes for the first time the load is measured."""
        if self.left() > 0:
            return False
        if not self.is_last:
            self.is_last = True
            self.end = self.load.begun + max(self.load.stretched(self.seconds), self.seconds * slowness())
            if (left := self.left()) > 0:
                print(f"(a deadline of {self.seconds:g} s is extended by {left:.0f} s: {self})", file=sys.stderr, flush=True)
        return self.left() == 0

    def __str__(self):
        """Where it stands, for a message."""
        return (
            f"{time.monotonic() - self.load.begun:.1f} s have gone by; the machine was {at_start():.1f} times as slow as an idle one when the test "
            f"started; its processes took {self.load.stretch():.1f} times as long as they ran, and {self.load.disks():.1f} times as long by waits for disks"
        )
