#!/usr/bin/env python3
"""Seeded faults on the real processes of a cell, for as long as one likes; then what was recorded is judged.

    faults.py PROBECELL [SECONDS [SEED]]

Needs root, in a mount namespace of its own: unshare -m faults.py …; each session has a network of its own. It starts a cell, asks for parts, and meanwhile kills processes (SIGKILL; each node, driver, recorder, router, launcher), pauses them (SIGSTOP),
sets the wall clock both ways (libfaketime), cuts the link to the host of the router or of the recorder (veth), loads the processors, or
gives the recording a disk that is small, slow (a throttled block device) or takes writes and refuses them when they are synced.
It ends by Ctrl-C, or by SIGKILL of the launcher or the recorder, in some sessions while a part is made. A failure names its seed.
"""

import collections
import json
import os
import pathlib
import random
import signal
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "tests"))
import kit  # noqa: E402
from judge import Judge  # noqa: E402
from places import KINDS, Place  # noqa: E402

NODES = ("machine_state", "probe_events", "path_planning", "analysis", "compensation", "cycle", "gap", "visualization", "simulator")
DISKS = ("sound",) * 6 + ("small", "slow", "slow", "refusing")
ENDS = ("ctrl-c", "ctrl-c", "ctrl-c", "launcher", "recorder")


class Session:
    """One start of a cell, the faults given to it, and what it said."""

    def __init__(self, seed, folder):
        self.random, self.folder, self.faults = random.Random(seed), folder, []
        self.environment = dict(os.environ)
        self.place = Place(self.random.choice(KINDS), folder, BINARY, self.environment)
        # A recorder on another host has no launcher that starts it again.
        self.disk = kit.Disk("sound" if self.place.kind == "far" else self.random.choice(DISKS), folder / "recordings", self.random)
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
        self.up = None
        busy = self.random.choice((0, 0, 0, 0, 1, 2))
        self.load = [kit.Process(sys.executable, "-c", "while True: pass") for _ in range(busy)]

    def start(self):
        self.place.start_router()
        if self.place.kind == "far":
            self.place.start_recorder()
        unrecorded = ["--no-record"] if self.place.kind == "far" else []
        self.up = kit.Process(
            BINARY, "up", "cell.toml", "--no-dashboard", *unrecorded, folder=self.folder, environment=self.environment | self.faked, apart=True,
        )
        if not self.wait(lambda: self.up.has_said("is ready")) and self.disk.is_sound:
            raise AssertionError("the cell did not get ready")

    def runs(self):
        return self.up.code is None

    def wait(self, ready):
        """Until it is, or the cell has ended."""
        kit.until("what a cell promises", lambda: ready() or self.up.is_silent())
        return ready()

    def lasts(self, seconds, ready=lambda: False):
        """A span that the seed gives, and no longer than until it is ready or the cell has ended."""
        end = time.monotonic() + seconds
        while not ready() and self.runs() and time.monotonic() < end:
            kit.happened.wait(None, min(0.05, max(0.0, end - time.monotonic())))
        return ready()

    def process(self, name):
        try:
            return kit.child(self.up.pid, *(["record"] if name == "recorder" else ["node", name])) if self.runs() else None
        except (AssertionError, OSError):
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
            self.lasts(held)
            self.place.join()
        elif kind == "kill router":
            if self.place.router.code is None:
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
            self.lasts(held)
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
            code, _, _ = kit.run(BINARY, "run", name, "--cell", "cell.toml", folder=self.folder, environment=self.environment)
            if code != 0:
                self.lasts(1.0)
                continue
            accepted.append(name)
            self.release()
            ended = lambda: self.up.has_said(rf"^part {name}: ")
            for _ in range(self.random.randint(0, 3)):
                if self.lasts(self.random.uniform(0.5, 12.0), ended):
                    break
                self.fault()
            if leave and number + 1 == parts:
                self.lasts(self.random.uniform(0.5, 12.0), ended)
                return accepted, reported, not ended()
            assert self.wait(lambda: ended() or self.release()), f"the cell has ended, and {name} has no report"
            reported.append(name)
        return accepted, reported, False

    def release(self):
        """What an operator does after a fault, which holds the orders; no part is begun twice by it."""
        kit.run(BINARY, "orders", "resume", "--cell", "cell.toml", folder=self.folder, environment=self.environment)

    def end(self):
        """Ends the cell in one of the ways; true where all of it ended in order."""
        how = self.random.choice(ENDS)
        running = self.runs()
        # Without its recorder it does.
        excused = not self.disk.is_sound or "kill recorder" in self.faults
        assert running or excused, ("the cell has ended by itself", self.up.code)
        if running:
            self.faults.append(f"end by {how}")
            if how == "recorder" and (process := self.process("recorder")):
                self.signal(process, signal.SIGKILL)
                # The launcher starts another one.
                self.lasts(self.random.uniform(0.0, 3.0))
                how = "ctrl-c"
                self.faults.append("end by ctrl-c")
            self.up.send(signal.SIGKILL if how == "launcher" else signal.SIGINT)
        self.up.ended()
        if self.place.kind == "far":
            kit.pause(kit.patience(11), "what is late is fetched for ten seconds, and may be lost after them")
        self.place.end_recorder()
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
        if self.up:
            self.up.kill()
        self.place.close()
        self.disk.close()


def one(folder, seed):
    """A session of a seed; what did not hold, and the figures, are left in a file."""
    figures, kinds, failure = collections.Counter(), collections.Counter(), None
    session = Session(seed, folder)
    try:
        session.start()
        accepted, reported, left = session.make()
        orderly = session.end() and session.undisturbed_recording()
        figures["parts accepted"] += len(accepted)
        figures["parts that ended in a report on the terminal"] += len(reported)
        figures["parts left under way"] += left
        Judge(BINARY, session, figures).all(accepted, orderly)
    except AssertionError as error:
        kit.state()
        said = "".join(session.up.told[-5:] + session.up.complained[-20:]) if session.up else ""
        failure = f"{error!r}\n  {session.kinds()}\n  faults: {session.faults}\n{said}"
    finally:
        session.close()
        kinds.update(session.kinds())
        figures["sessions"] += 1
        (folder / RESULT).write_text(json.dumps({"failure": failure, "figures": figures, "kinds": kinds}))


RESULT = "result.json"


def main():
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 60.0
    first = int(sys.argv[3]) if len(sys.argv) > 3 else 1
    begun, seed, figures, kinds = time.monotonic(), first, collections.Counter(), collections.Counter()
    failures = []
    while time.monotonic() - begun < seconds:
        with kit.new_folder() as folder:
            folder = pathlib.Path(folder)
            holds = kit.apart(one, folder, seed)
            told = json.loads((folder / RESULT).read_text())
        figures.update(told["figures"])
        kinds.update(told["kinds"])
        if told["failure"] or not holds:
            failures.append(seed)
        print(f"seed {seed}: {told['failure'] or ('good' if holds else 'FAILED')}", flush=True)
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
