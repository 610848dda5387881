#!/usr/bin/env python3
"""A cell that makes part after part in real time, and what memory each of its processes takes meanwhile.

    soak.py PROBECELL SECONDS [FILE]

In a network namespace of its own: unshare -n bash -c 'ip link set lo up; soak.py …'. Every ten seconds a line of the file (soak.jsonl) gets
the memory of each process: Pss_Anon of smaps_rollup, what it has for itself, in KiB. At the end the growth of each process is printed: the
slope of a line through the second half of its samples (least squares), in KiB an hour, with the parts made and the messages recorded.
"""

import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
PERIOD = 10.0  # s
PATIENCE = 300.0  # s for a part


def memory(process):
    """KiB that a process has for itself."""
    text = pathlib.Path(f"/proc/{process}/smaps_rollup").read_text()
    return int(re.search(r"^Pss_Anon:\s+(\d+) kB", text, re.M)[1])


def processes(up):
    """Names and numbers of the launcher and its children."""
    found = {"launcher": up.pid}
    for child in pathlib.Path(f"/proc/{up.pid}/task/{up.pid}/children").read_text().split():
        words = pathlib.Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0")
        name = words[2] if words[1] == b"node" else words[1]
        found[name.decode()] = int(child)
    return found


def slope(samples):
    """KiB an hour, of a line through (s, KiB)."""
    mean = [sum(values) / len(samples) for values in zip(*samples)]
    spread = sum((at - mean[0]) ** 2 for at, _ in samples)
    return 3600 * sum((at - mean[0]) * (value - mean[1]) for at, value in samples) / spread if spread else 0.0


def main():
    seconds, file = float(sys.argv[2]), sys.argv[3] if len(sys.argv) > 3 else "soak.jsonl"
    samples, parts = {}, 0
    with tempfile.TemporaryDirectory(prefix="soak_") as scratch, open(file, "w") as out:
        folder = pathlib.Path(scratch)
        for name in ("turn_mill.toml", "turn_mill.urdf"):
            (folder / name).write_text((ROOT / "launch-scripts" / name).read_text())
        environment = os.environ | {"XDG_CONFIG_HOME": str(folder / "config"), "XDG_STATE_HOME": str(folder / "state")}
        up = subprocess.Popen(
            [BINARY, "up", "turn_mill.toml"], cwd=folder, env=environment, text=True, stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, stderr=open(f"{file}.errors", "w"),
        )
        ended = threading.Semaphore(0)
        verdicts = []

        def read():
            for line in up.stdout:
                if re.match(r"part \S+: ", line):
                    verdicts.append(line.split(": ", 1)[1].split(",")[0].split(":")[0].strip())
                    ended.release()
                elif "is ready" in line:
                    ended.release()

        threading.Thread(target=read, daemon=True).start()
        assert ended.acquire(timeout=60), "the cell did not get ready"
        begun = last = time.monotonic()
        asked, refused = False, []
        while time.monotonic() - begun < seconds:
            if not asked:
                told = subprocess.run(
                    [BINARY, "run", f"part_{parts}", "--cell", "turn_mill.toml"], cwd=folder, env=environment, capture_output=True, text=True,
                )
                if told.returncode == 0:
                    asked, since = True, time.monotonic()
                else:  # counted, and the part is asked for again in the next round
                    refused.append(told.stderr.strip())
            if ended.acquire(timeout=PERIOD / 10):
                asked, parts = False, parts + 1
            assert not asked or time.monotonic() - since < PATIENCE, "a part does not end"
            if time.monotonic() - last >= PERIOD:
                last = time.monotonic()
                now = {name: memory(process) for name, process in processes(up).items()}
                for name, value in now.items():
                    samples.setdefault(name, []).append((last - begun, value))
                out.write(json.dumps({"s": round(last - begun), "parts": parts, **now}) + "\n")
                out.flush()
        up.send_signal(2)
        up.wait(60)
        topics, damages = {}, 0
        bags = sorted((folder / "recordings").iterdir())  # the recorder goes on in a new file after an hour
        for bag in bags:
            info = json.loads(subprocess.run([BINARY, "info", bag, "--json"], cwd=folder, check=True, capture_output=True, text=True).stdout)
            damages += len(info["damage"])
            for topic in info["topics"]:
                topics[topic["topic"]] = topics.get(topic["topic"], 0) + topic["messages"]
    most = max(topics, key=topics.get)
    print(f"{seconds:.0f} s, {parts} parts ({', '.join(f'{verdicts.count(one)} {one}' for one in sorted(set(verdicts)))}), status {up.returncode}")
    print(f"{len(refused)} requests refused", *sorted(set(refused)), sep="; ")
    print(f"{sum(topics.values())} messages recorded in {len(bags)} files, most on {most}: {topics[most]}; {damages} damages")
    for name, own in samples.items():
        values = [value for _, value in own]
        half = own[len(own) // 2:]
        print(f"{name:>16}: first {values[0]:6} KiB, largest {max(values):6}, last {values[-1]:6}; second half {slope(half):+8.0f} KiB/h")


if __name__ == "__main__":
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    BINARY = str(pathlib.Path(sys.argv[1]).resolve())
    main()
