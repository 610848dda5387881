#!/usr/bin/env python3
"""Seeded faults on the real processes of a cell, for as long as one likes; then what was recorded is judged.

    faults.py PROBECELL [SECONDS [SEED]]

Needs root, in network and mount namespaces of its own: unshare -mn bash -c 'ip link set lo up; faults.py …'. Each session starts
a cell, asks for parts, and meanwhile kills processes (SIGKILL), pauses them (SIGSTOP), sets the wall clock both ways (libfaketime), or
gives the recording a disk that fills up. It ends by Ctrl-C, or by SIGKILL of the launcher or the recorder. A failure names its seed.
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

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

ROOT = pathlib.Path(__file__).resolve().parents[2]
PATIENCE = 90  # s for a part to end in a report, whatever happened to it
NODES = ("machine_state", "probe_events", "path_planning", "analysis", "compensation", "cycle", "gap", "visualization", "simulator")
APPLIED = 0
SIGNED_BY = (1, 2)  # policy, operator


class Session:
    """One start of a cell, the faults given to it, and what it said."""

    def __init__(self, seed, folder):
        self.random, self.folder, self.faults = random.Random(seed), folder, []
        text = (ROOT / "launch-scripts" / "turn_mill.toml").read_text()
        (folder / "cell.toml").write_text(text.replace("seed = 1\n", f"seed = {seed % 1000 + 1}\n"))
        (folder / "turn_mill.urdf").write_text((ROOT / "launch-scripts" / "turn_mill.urdf").read_text())
        self.small_disk = self.random.random() < 0.15
        if self.small_disk:
            (folder / "recordings").mkdir()
            size = f"size={self.random.randint(600, 2500)}k"
            subprocess.run(["mount", "-t", "tmpfs", "-o", size, "tmpfs", folder / "recordings"], check=True)
        library = next(pathlib.Path("/usr/lib").glob("*/faketime/libfaketime.so.1"))
        self.clock = folder / "clock"
        self.clock.write_text("+0\n")
        self.environment = os.environ | {"XDG_CONFIG_HOME": str(folder / "config"), "XDG_STATE_HOME": str(folder / "state")}
        faked = {
            "LD_PRELOAD": str(library), "FAKETIME_TIMESTAMP_FILE": str(self.clock), "FAKETIME_NO_CACHE": "1",
            "FAKETIME_DONT_FAKE_MONOTONIC": "1", "DONT_FAKE_MONOTONIC": "1",
        }
        self.up = subprocess.Popen(
            [BINARY, "up", "cell.toml"], cwd=folder, env=self.environment | faked, text=True,
            stdout=subprocess.PIPE, stderr=open(folder / "errors.txt", "w"), stdin=subprocess.DEVNULL,
        )
        self.lines = []
        self.reader = threading.Thread(target=lambda: self.lines.extend(self.up.stdout), daemon=True)
        self.reader.start()

    def wait(self, ready, seconds=PATIENCE):
        """Until it is, the cell has ended, or the time is over."""
        deadline = time.monotonic() + seconds
        while not ready() and self.up.poll() is None and time.monotonic() < deadline:
            time.sleep(0.05)
        return ready()

    def says(self, pattern):
        return any(re.search(pattern, line) for line in list(self.lines))

    def process(self, name):
        for child in pathlib.Path(f"/proc/{self.up.pid}/task/{self.up.pid}/children").read_text().split():
            try:
                words = pathlib.Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0")
            except OSError:
                continue
            if name.encode() in (words[2:3] or [b""])[0:1] or (name == "recorder" and words[1:2] == [b"record"]):
                return int(child)
        return None

    def fault(self):
        """One fault, drawn by the seed."""
        kind = self.random.choice(("kill", "kill", "pause", "pause", "clock"))
        name = self.random.choice(NODES)
        if kind == "clock":
            step = self.random.choice((-3600, -5, 5, 3600))
            self.faults.append(f"clock {step:+d} s")
            self.clock.write_text(f"{step:+d}\n")
            return
        process = self.process(name)
        if process is None:
            return  # it is being restarted
        if kind == "kill":
            self.faults.append(f"kill {name}")
            self.signal(process, signal.SIGKILL)
            return
        held = self.random.uniform(0.1, 4.0)
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

    def run(self, parts=2):
        """Makes parts under faults; gives names of the parts that were accepted and that were said to have ended."""
        accepted, reported = [], []
        if not self.wait(lambda: self.says("is ready")) and not self.small_disk:
            raise AssertionError("the cell did not get ready")
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
            if self.wait(ended):
                reported.append(name)
            elif self.up.poll() is None:
                raise AssertionError(f"{name} did not end in a report within {PATIENCE} s")
        return accepted, reported

    def end(self):
        """Ends the cell in one of the ways; true where all of it ended in order."""
        how = self.random.choice(("ctrl-c", "ctrl-c", "ctrl-c", "launcher", "recorder"))
        running = self.up.poll() is None
        if running:
            self.faults.append(f"end by {how}")
            if how == "recorder" and (process := self.process("recorder")):
                self.signal(process, signal.SIGKILL)
            else:
                self.up.send_signal(signal.SIGKILL if how == "launcher" else signal.SIGINT)
        self.up.wait(PATIENCE)
        self.reader.join(PATIENCE)
        return running and how == "ctrl-c"

    def close(self):
        if self.up.poll() is None:
            self.up.kill()
            self.up.wait(PATIENCE)
        if self.small_disk:
            subprocess.run(["umount", "-l", self.folder / "recordings"], check=True)


def messages(bag, *topics):
    """Messages of topics of the cell, decoded by a library that is not ours."""
    found = collections.defaultdict(list)
    wanted = [f"/turn_mill/{topic}" for topic in topics]
    for file in sorted(bag.glob("*.mcap")):
        with open(file, "rb") as stream:
            reader = make_reader(stream, decoder_factories=[DecoderFactory()])
            for _, channel, _, message in reader.iter_decoded_messages(wanted):
                found[channel.topic.removeprefix("/turn_mill/")].append(message)
    return found


def stamp(message):
    return message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec


def judge(session, bag, accepted, orderly, figures):
    """What must hold of a recording, whatever was done to the cell."""
    # What a killed recorder leaves has no index; readers of others need one.
    unindexed, whole = not orderly, bag
    if unindexed:
        whole = session.folder / f"saved_{bag.name}"
        told = subprocess.run([BINARY, "recover", bag, whole], cwd=session.folder, capture_output=True, text=True)
        assert told.returncode in (0, 3), ("recover", told.returncode, told.stdout, told.stderr)
        figures["recordings cut off and recovered"] += 1
    told = subprocess.run([BINARY, "replay", bag], cwd=session.folder, env=session.environment, capture_output=True, text=True)
    assert told.returncode in (0, 3) and "DIFFERENT" not in told.stdout, ("replay", told.returncode, told.stdout[-2000:], told.stderr)
    figures["replays equal" if told.returncode == 0 else "replays incomplete, and said so"] += 1
    read = messages(
        whole, "probe_triggers", "probe_events", "corrections", "correction_acknowledgements", "part_reports",
    )
    triggers = {(stamp(one), one.plan_id, one.point_index): one for one in read["probe_triggers"]}
    events = [(stamp(one), one.plan_id, one.point_index) for one in read["probe_events"]]
    figures["triggers"] += len(triggers)
    figures["events"] += len(events)
    assert len(events) == len(set(events)), "an event twice"
    assert len(triggers) == len(read["probe_triggers"]), "a trigger twice"
    assert set(events) <= set(triggers) or unindexed, "an event without its trigger"
    lost = set(triggers) - set(events)
    figures["triggers without event"] += len(lost)
    blamed = any("probe_events" in one or one.startswith("end") for one in session.faults)
    assert not lost or blamed or unindexed, ("events lost", len(lost))
    approved = collections.defaultdict(list)
    for one in read["corrections"]:
        if one.approval in SIGNED_BY:
            approved[one.correction_id].append(one)
    reports = {one.part_id: stamp(one) for one in read["part_reports"]}
    applied = [one for one in read["correction_acknowledgements"] if one.outcome == APPLIED]
    names = [one.correction_id for one in applied]
    assert len(names) == len(set(names)), ("a correction twice", names)
    figures["corrections written"] += len(applied)
    for one in applied:
        source = approved[one.correction_id]
        assert source and all(len(bytes(other.signature)) == 64 for other in source), ("unsigned", one.correction_id)
        assert all(other.lower_bound <= one.value_after <= other.upper_bound for other in source), ("out of bounds", one.correction_id)
        part = one.correction_id.split("/")[0].split("#")[0]
        assert part in accepted, ("without a part", one.correction_id)
        assert part not in reports or stamp(one) <= reports[part], ("late", one.correction_id)
    figures["reports"] += len(read["part_reports"])
    if orderly and not session.small_disk:
        missing = [name for name in accepted if name not in reports]
        assert not missing, ("no report recorded", missing)
        verified = subprocess.run([BINARY, "info", "--verify", bag], cwd=session.folder, env=session.environment, capture_output=True, text=True)
        assert verified.returncode == 0, verified.stdout[-500:]
        figures["seals verified"] += 1


def main():
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 60.0
    first = int(sys.argv[3]) if len(sys.argv) > 3 else 1
    begun, seed, figures, kinds = time.monotonic(), first, collections.Counter(), collections.Counter()
    failures = []
    while time.monotonic() - begun < seconds:
        with tempfile.TemporaryDirectory(prefix="faults_") as scratch:
            session = Session(seed, pathlib.Path(scratch))
            try:
                accepted, reported = session.run()
                orderly = session.end() and not session.small_disk
                figures["parts accepted"] += len(accepted)
                figures["parts that ended in a report on the terminal"] += len(reported)
                for bag in (session.folder / "recordings").glob("*"):
                    judge(session, bag, accepted, orderly, figures)
            except AssertionError as failure:
                failures.append(seed)
                print(f"seed {seed}: {failure}\n  faults: {session.faults}", flush=True)
                print("".join(session.lines[-5:]) + (session.folder / "errors.txt").read_text()[-1500:], flush=True)
            finally:
                session.close()
            kinds.update(" ".join(one.split()[:2]) if not one.startswith("clock") else "clock" for one in session.faults)
            kinds["small disk"] += session.small_disk
            figures["sessions"] += 1
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
