#!/usr/bin/env python3
"""Seeded faults on the real processes of a cell, for as long as one likes; then what was recorded is judged.

    faults.py PROBECELL [SECONDS [SEED]]

Needs root, in network and mount namespaces of its own: unshare -mn bash -c 'ip link set lo up; faults.py …'. Each session starts
a cell, asks for parts, and meanwhile kills processes (SIGKILL; each node, driver, recorder, router, launcher), pauses them (SIGSTOP),
sets the wall clock both ways (libfaketime), cuts the link to the host of the router or of the recorder (veth), loads the processors, or
gives the recording a disk that is small, slow (a throttled block device) or takes writes and refuses them when they are synced.
It ends by Ctrl-C, or by SIGKILL of the launcher or the recorder, in some sessions while a part is made. A failure names its seed.
"""

import collections
import json
import os
import pathlib
import random
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time

from disks import Disk
from judge import Judge
from places import KINDS, Place

ROOT = pathlib.Path(__file__).resolve().parents[2]
PATIENCE = 90  # s for a part to end in a report, whatever happened to it
NODES = ("machine_state", "probe_events", "path_planning", "analysis", "compensation", "cycle", "gap", "visualization", "simulator")
DISKS = ("sound",) * 6 + ("small", "slow", "slow", "refusing")
ENDS = ("ctrl-c", "ctrl-c", "ctrl-c", "launcher", "recorder")


class Session:
    """One start of a cell, the faults given to it, and what it said."""

    def __init__(self, seed, folder):
        self.random, self.folder, self.faults = random.Random(seed), folder, []
        self.environment = os.environ | {"XDG_CONFIG_HOME": str(folder / "config"), "XDG_STATE_HOME": str(folder / "state")}
        self.place = Place(self.random.choice(KINDS), folder, BINARY, self.environment)
        # A recorder on another host has no launcher that starts it again.
        self.disk = Disk("sound" if self.place.kind == "far" else self.random.choice(DISKS), folder / "recordings", self.random)
        text = (ROOT / "launch-scripts" / "turn_mill.toml").read_text()
        (folder / "cell.toml").write_text(self.place.cell_file(text.replace("seed = 1\n", f"seed = {seed % 1000 + 1}\n")))
        (folder / "turn_mill.urdf").write_text((ROOT / "launch-scripts" / "turn_mill.urdf").read_text())
        library = next(pathlib.Path("/usr/lib").glob("*/faketime/libfaketime.so.1"))
        self.clock = folder / "clock"
        self.clock.write_text("+0\n")
        self.faked = {
            "LD_PRELOAD": str(library), "FAKETIME_TIMESTAMP_FILE": str(self.clock), "FAKETIME_NO_CACHE": "1",
            "FAKETIME_DONT_FAKE_MONOTONIC": "1", "DONT_FAKE_MONOTONIC": "1",
        }
        self.up, self.lines = None, []
        busy = self.random.choice((0, 0, 0, 0, 1, 2))
        self.load = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(busy)]

    def start(self):
        self.place.start_router()
        if self.place.kind == "far":
            self.place.start_recorder()
        unrecorded = ["--no-record"] if self.place.kind == "far" else []
        self.up = subprocess.Popen(
            [BINARY, "up", "cell.toml", "--no-dashboard", *unrecorded], cwd=self.folder, env=self.environment | self.faked, text=True,
            stdout=subprocess.PIPE, stderr=open(self.folder / "errors.txt", "w"), stdin=subprocess.DEVNULL,
        )
        self.reader = threading.Thread(target=lambda: self.lines.extend(self.up.stdout), daemon=True)
        self.reader.start()
        if not self.wait(lambda: self.says("is ready")) and self.disk.is_sound:
            raise AssertionError("the cell did not get ready")

    def wait(self, ready, seconds=PATIENCE):
        """Until it is, the cell has ended, or the time is over."""
        deadline = time.monotonic() + seconds
        while not ready() and self.up.poll() is None and time.monotonic() < deadline:
            time.sleep(0.05)
        return ready()

    def says(self, pattern):
        return any(re.search(pattern, line) for line in list(self.lines))

    def process(self, name):
        if self.up.poll() is not None:
            return None
        for child in pathlib.Path(f"/proc/{self.up.pid}/task/{self.up.pid}/children").read_text().split():
            try:
                words = pathlib.Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0")
            except OSError:
                continue
            if words[1:3] == [b"node", name.encode()] or (name == "recorder" and words[1:2] == [b"record"]):
                return int(child)
        return None

    def fault(self):
        """One fault, drawn by the seed."""
        kinds = ["kill", "kill", "kill", "pause", "pause", "clock"]
        kinds += ["cut"] * 4 * self.place.is_apart + ["kill router"] * (self.place.kind == "beside")
        kind = self.random.choice(kinds)
        name = self.random.choice(NODES + ("recorder",) * (self.place.kind != "far"))
        held = self.random.uniform(0.1, 4.0)
        if kind == "clock":
            step = self.random.choice((-3600, -5, 5, 3600))
            self.faults.append(f"clock {step:+d} s")
            self.clock.write_text(f"{step:+d}\n")
        elif kind == "cut":
            held = self.random.choice((held / 4, held, 3 * held))
            self.faults.append(f"cut link {held:.1f} s")
            self.place.cut()
            self.wait(lambda: False, held)
            self.place.join()
        elif kind == "kill router":
            if self.place.router.poll() is None:
                self.faults.append(kind)
                self.place.router.kill()
        elif (process := self.process(name)) is None:
            pass  # it is being restarted
        elif kind == "kill":
            self.faults.append(f"kill {name}")
            self.signal(process, signal.SIGKILL)
        else:
            self.faults.append(f"pause {name} {held:.1f} s")
            self.signal(process, signal.SIGSTOP)
            self.wait(lambda: False, held)
            self.signal(process, signal.SIGCONT)

    @staticmethod
    def signal(process, number):
        try:
            os.kill(process, number)
        except ProcessLookupError:
            pass  # it has ended by itself

    def make(self, parts=3):
        """Makes parts under faults; gives those that were accepted, those that were said to have ended, and whether the cell was left
        with its last part under way."""
        accepted, reported = [], []
        leave = self.random.random() < 0.25
        for number in range(parts):
            name = f"part_{number}"
            told = subprocess.run(
                [BINARY, "run", name, "--cell", "cell.toml"], cwd=self.folder, env=self.environment, capture_output=True, timeout=PATIENCE,
            )
            if told.returncode != 0:
                self.wait(lambda: False, 1.0)
                continue
            accepted.append(name)
            ended = lambda: self.says(rf"^part {name}: ")
            for _ in range(self.random.randint(0, 3)):
                if self.wait(ended, self.random.uniform(0.5, 12.0)):
                    break
                self.fault()
            if leave and number + 1 == parts:
                self.wait(ended, self.random.uniform(0.5, 12.0))
                return accepted, reported, not ended()
            if self.wait(ended):
                reported.append(name)
            elif self.up.poll() is None:
                raise AssertionError(f"{name} did not end in a report within {PATIENCE} s")
            else:
                self.reader.join(PATIENCE)
                assert ended(), f"the cell has ended, and {name} has no report"
                reported.append(name)
        return accepted, reported, False

    def end(self):
        """Ends the cell in one of the ways; true where all of it ended in order."""
        how = self.random.choice(ENDS)
        running = self.up.poll() is None
        # Without its recorder it does.
        excused = not self.disk.is_sound or "kill recorder" in self.faults
        assert running or excused, ("the cell has ended by itself", self.up.returncode)
        if running:
            self.faults.append(f"end by {how}")
            if how == "recorder" and (process := self.process("recorder")):
                self.signal(process, signal.SIGKILL)
                # The launcher starts another one.
                self.wait(lambda: False, self.random.uniform(0.0, 3.0))
                how = "ctrl-c"
                self.faults.append("end by ctrl-c")
            self.up.send_signal(signal.SIGKILL if how == "launcher" else signal.SIGINT)
        self.up.wait(PATIENCE)
        self.reader.join(PATIENCE)
        # What is late is fetched for ten seconds.
        if self.place.kind == "far":
            time.sleep(11)
        self.place.end_recorder(PATIENCE)
        self.disk.heal()
        return running and how == "ctrl-c"

    def undisturbed_recording(self):
        """Nothing was done to the recorder, its disk and its links."""
        own = any(word in one for one in self.faults for word in ("recorder", "cut", "router", "launcher"))
        return not own and self.disk.kind == "sound"

    def kinds(self):
        """What was done, for the figures."""
        own = [" ".join(one.split()[:2]) if not one.startswith("clock") else one for one in self.faults]
        return [*own, f"disk {self.disk.kind}", f"router {self.place.kind}", *["load"] * bool(self.load)]

    def close(self):
        for process in self.load:
            process.kill()
            process.wait()
        if self.up and self.up.poll() is None:
            self.up.kill()
            self.up.wait(PATIENCE)
        self.place.close()
        self.disk.close()


def one(seed, scratch, figures, kinds):
    """A session of a seed; what did not hold, in a text."""
    session = Session(seed, scratch)
    try:
        session.start()
        accepted, reported, left = session.make()
        orderly = session.end() and session.undisturbed_recording()
        figures["parts accepted"] += len(accepted)
        figures["parts that ended in a report on the terminal"] += len(reported)
        figures["parts left under way"] += left
        Judge(BINARY, session, figures).all(accepted, orderly)
        return None
    except (AssertionError, subprocess.TimeoutExpired) as failure:
        said = "".join(session.lines[-5:]) + (session.folder / "errors.txt").read_text()[-1500:]
        return f"{failure!r}\n  {session.kinds()}\n  faults: {session.faults}\n{said}"
    finally:
        session.close()
        kinds.update(session.kinds())
        figures["sessions"] += 1


def main():
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 60.0
    first = int(sys.argv[3]) if len(sys.argv) > 3 else 1
    begun, seed, figures, kinds = time.monotonic(), first, collections.Counter(), collections.Counter()
    failures = []
    while time.monotonic() - begun < seconds:
        with tempfile.TemporaryDirectory(prefix="faults_") as scratch:
            failure = one(seed, pathlib.Path(scratch), figures, kinds)
        if failure:
            failures.append(seed)
        print(f"seed {seed}: {failure or 'good'}", flush=True)
        seed += 1
    print(json.dumps({"seconds": round(time.monotonic() - begun), "seeds": [first, seed - 1], **figures}, indent=1))
    print(json.dumps({"faults": dict(sorted(kinds.items()))}))
    if failures:
        raise SystemExit(f"seeds that failed: {failures}")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        raise SystemExit(__doc__)
    BINARY = str(pathlib.Path(sys.argv[1]).resolve())
    main()
