"""Processes of a test whose output is kept, waits for what happens, and the state of all of them when a test fails."""

import collections
import contextlib
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time

from . import load

PATIENCE = 120.0  # s of an idle machine, for what takes seconds there, or a part
LEAST, SHORT = 0.01, 0.05  # s between two looks at what does not tell by itself that it has changed
AT_ONCE = 0.5  # s; what comes by then needs no deadline, which costs some milliseconds
TOLD = 8  # last lines of a process that are shown


class Late(AssertionError):
    """Something has not happened within its deadline."""


class Happenings:
    """Counts what a thread of the test has heard: lines, ends of processes, messages. Whoever waits looks again at once."""

    def __init__(self):
        self.changed, self.count = threading.Condition(), 0

    def __call__(self, *_):
        with self.changed:
            self.count += 1
            self.changed.notify_all()

    def wait(self, seen, seconds):
        """Until the count is another one than that; of none, for the whole time."""
        with self.changed:
            self.changed.wait_for(lambda: seen is not None and self.count != seen, seconds)


happened = Happenings()


def until(what, ready, seconds=PATIENCE):
    """Waits until `ready` gives something true, and gives that. It is asked again at once when something has happened, else every few
    hundredths of a second, and never more than half of the time."""
    first, deadline = time.monotonic(), None
    while True:
        seen, begun = happened.count, time.monotonic()
        if found := ready():
            return found
        if deadline is None and begun - first >= AT_ONCE:
            deadline = load.Deadline(seconds)
        if deadline and deadline.has_passed():
            raise late(what, deadline)
        # What takes a while to ask for, as a command, is itself a happening.
        took = time.monotonic() - begun
        happened.wait(None, LEAST)
        happened.wait(seen if took < SHORT else None, max(took, SHORT))


def late(what, deadline):
    """The error for what has not happened in time; the state of the processes is shown before anything ends them."""
    state()
    return Late(f"{what}: not within {deadline.seconds:g} s of an idle machine: {deadline}")


def pause(seconds, _why):
    """The only sleep: a span of time that is itself what is done to a cell, or over which something is counted."""
    time.sleep(seconds)


PORTS = iter(range(20_000 + os.getpid() % 10_000, 32_000))  # below those that the system gives to clients


def free_port():
    """A port of this network at which nobody listens, and which no other caller gets."""
    for port in PORTS:
        with contextlib.suppress(OSError), socket.create_server(("127.0.0.1", port)):
            return port
    raise AssertionError("no port is free")


class Process:
    """A process whose lines are kept as they come, standard error among those of standard output unless `apart`. As a context it is ended with
    SIGTERM."""

    known = []

    def __init__(self, *words, folder=None, environment=None, apart=False, stdin=subprocess.DEVNULL, **how):
        self.process = subprocess.Popen(
            [str(word) for word in words], cwd=folder, env=environment, stdin=stdin, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE if apart else subprocess.STDOUT, text=True, errors="replace", bufsize=1, **how,
        )
        self.pid, self.name = self.process.pid, " ".join(map(str, words))
        self.told, self.complained, self.read, self.seen = [], [], 0, 0
        streams = [(self.process.stdout, self.told)] + [(self.process.stderr, self.complained)] * apart
        self.readers = [threading.Thread(target=self._read, args=one, daemon=True) for one in streams]
        for one in [*self.readers, threading.Thread(target=self._wait, daemon=True)]:
            one.start()
        self.known.append(self)

    def _read(self, stream, lines):
        for line in stream:
            lines.append(line)
            happened()
        happened()

    def _wait(self):
        self.process.wait()
        happened()

    @property
    def code(self):
        """Its exit status; none while it runs."""
        return self.process.poll()

    @property
    def lines(self):
        return [line.rstrip("\n") for line in self.told]

    @property
    def output(self):
        return "".join(self.told)

    @property
    def errors(self):
        return "".join(self.complained)

    def __str__(self):
        return f"{self.name} ({'runs' if self.code is None else f'status {self.code}'})"

    def is_silent(self):
        """It will say nothing more."""
        return self.code is not None and not any(one.is_alive() for one in self.readers)

    def line(self, seconds=PATIENCE):
        """The next line; nothing at its end."""
        until(f"a line of {self}", lambda: len(self.told) > self.read or self.is_silent(), seconds)
        if len(self.told) == self.read:
            return ""
        self.read += 1
        return self.told[self.read - 1]

    def says(self, pattern, seconds=PATIENCE):
        """The next line that matches, after those that this has given."""

        def found():
            ended = self.is_silent()
            while self.seen < len(self.told):
                self.seen += 1
                if re.search(pattern, self.lines[self.seen - 1]):
                    return self.lines[self.seen - 1]
            if ended:
                state()
                raise AssertionError(f"{self} has ended without {pattern!r}:\n{self.output}{self.errors}")
            return None

        return until(f"{pattern!r} of {self}", found, seconds)

    def has_said(self, pattern):
        return any(re.search(pattern, line) for line in self.lines)

    def say(self, text):
        """A line on its standard input."""
        self.process.stdin.write(f"{text}\n")
        self.process.stdin.flush()

    def ended(self, seconds=PATIENCE):
        """Status, output and errors of a process that ends by itself, or has been told to."""
        until(f"the end of {self}", lambda: self.code is not None, seconds)
        until(f"the last lines of {self}", self.is_silent, seconds)
        return self.code, self.output, self.errors

    def send(self, signal_number):
        self.process.send_signal(signal_number)

    def kill(self):
        self.process.kill()
        self.process.wait()

    def end(self, how=signal.SIGTERM, seconds=PATIENCE):
        """Tells it to end where it still runs, and gives its status."""
        if self.code is not None:
            return self.code
        self.send(how)
        return self.ended(seconds)[0]

    def __enter__(self):
        return self

    def __exit__(self, kind, *_):
        if kind is not None:
            state()
        try:
            self.end()
        except Late:
            self.kill()
            if kind is None:
                raise


def run(*words, seconds=PATIENCE, **how):
    """Status, output and errors of a command."""
    process = Process(*words, apart=True, **how)
    try:
        return process.ended(seconds)
    finally:
        if process.code is None:
            process.kill()
        Process.known.remove(process)


def child(launcher, *words):
    """Number of the process that a launcher has started with these words first: `node`, `gap`."""
    wanted = [word.encode() for word in words]
    children = pathlib.Path(f"/proc/{launcher}/task/{launcher}/children").read_text().split()
    for one in children:
        with contextlib.suppress(OSError):
            if pathlib.Path(f"/proc/{one}/cmdline").read_bytes().split(b"\0")[1 : 1 + len(wanted)] == wanted:
                return int(one)
    raise AssertionError(f"{launcher} has no process {words} among {children}")


@contextlib.contextmanager
def paused(*processes):
    """Stopped by SIGSTOP meanwhile."""
    for one in processes:
        os.kill(one, signal.SIGSTOP)
    try:
        yield
    finally:
        for one in processes:
            os.kill(one, signal.SIGCONT)


# What is shown when a test fails.


def outputs(process):
    """Files to which a process writes its output and errors."""
    found = set()
    for number in (1, 2):
        with contextlib.suppress(OSError):
            found.add(os.readlink(f"/proc/{process}/fd/{number}"))
    return {path for path in found if os.path.isfile(path)}


def last_lines(process):
    """Of the files to which a process writes, those of the test itself left out."""
    lines = []
    for path in sorted(outputs(process) - outputs(os.getpid())):
        with contextlib.suppress(OSError):
            lines += pathlib.Path(path).read_text(errors="replace").splitlines()[-TOLD:]
    return lines


def described(process):
    """One line of a process: number, parent, state, where its threads wait, what it has got of the processors, its command."""
    folder = pathlib.Path(f"/proc/{process}")
    name, fields = (folder / "stat").read_text().split("(", 1)[1].rsplit(")", 1)
    fields = fields.split()
    times = load.threads(process).values()
    places = collections.Counter()
    for thread in (folder / "task").iterdir():
        with contextlib.suppress(OSError):
            places[(thread / "wchan").read_text() or "-"] += 1
    waits = ", ".join(f"{count} {place}" for place, count in places.most_common(4))
    command = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace").strip() or name
    ran, waited = (sum(one[kind] for one in times) for kind in (0, 1))
    return f"{process:>7} of {fields[1]:>7} {fields[0]}  {fields[17]:>3} threads ({waits}), ran {ran:.2f} s, waited {waited:.2f} s: {command[:160]}"


is_shown = False


def state():
    """Shows every process of the test, those that have ended too, and the machine: once for each failure."""
    global is_shown
    if is_shown:
        return
    is_shown = True
    out = [f"--- state of the test {' '.join(sys.argv)[:200]}"]
    by_number = {one.pid: one for one in Process.known}
    for process in sorted(load.processes()):
        with contextlib.suppress(OSError):
            out.append(described(process))
            one = by_number.get(process)
            last = [*one.lines[-TOLD:], *one.errors.splitlines()[-TOLD:]] if one else last_lines(process)
            out += [f"        | {line[:300]}" for line in last]
    for one in Process.known:
        if one.code is not None:
            out.append(f"{one.pid:>7} has ended: {one}"[:200])
            out += [f"        | {line[:300]}" for line in [*one.lines[-TOLD:], *one.errors.splitlines()[-TOLD:]]]
    for kind in ("cpu", "io", "memory"):
        with contextlib.suppress(OSError):
            out.append(f"{kind}: {pathlib.Path(f'/proc/pressure/{kind}').read_text().splitlines()[0]}")
    out.append(f"load {' '.join(map('{:.1f}'.format, os.getloadavg()))} on {os.cpu_count()} processors; "
               f"{shutil.disk_usage('.').free >> 20} MiB of disk left; a fixed amount of work takes {load.slowness():.1f} times as long as on an idle machine")
    print("\n".join(out) + "\n---", file=sys.stderr, flush=True)


def show_again():
    """The next failure is another one."""
    global is_shown
    is_shown = False
