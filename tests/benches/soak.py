#!/usr/bin/env python3
"""A cell that makes part after part in real time, and what memory each of its processes takes meanwhile.

    soak.py PROBECELL SECONDS [FILE]

In a network namespace of its own. Every ten seconds a line of the file (soak.jsonl) gets
the memory of each process: Pss_Anon of smaps_rollup, what it has for itself, in KiB. At the end the growth of each process is printed: the
slope of a line through the second half of its samples (least squares), in KiB an hour, with the parts made and the messages recorded.
"""

import json
import pathlib
import re
import signal
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "tests"))
import kit  # noqa: E402

PERIOD = 10.0  # s
LONGEST = 300.0  # s, of a part


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


def main(folder):
    seconds, file = float(sys.argv[2]), pathlib.Path(sys.argv[3] if len(sys.argv) > 3 else "soak.jsonl")
    samples, verdicts, refused, parts = {}, [], [], 0
    for name in ("turn_mill.toml", "turn_mill.urdf"):
        (folder / name).write_text((ROOT / "launch-scripts" / name).read_text())
    with kit.Process(BINARY, "up", "turn_mill.toml", folder=folder, apart=True) as up, open(file, "w") as out:
        up.says("is ready")
        begun = last = time.monotonic()
        asked = None  # the deadline of the part that is made
        while time.monotonic() - begun < seconds:
            if asked is None:
                code, _, errors = kit.run(BINARY, "run", f"part_{parts}", "--cell", "turn_mill.toml", folder=folder)
                if code == 0:
                    asked = kit.Deadline(LONGEST)
                else:  # counted, and the part is asked for again in the next round
                    refused.append(errors.strip())
            kit.happened.wait(None, PERIOD / 10)
            ended = [line for line in up.lines if re.match(r"part \S+: ", line)]
            if len(ended) > parts:
                asked, parts = None, len(ended)
            if asked and asked.has_passed():
                raise kit.late("the end of a part", asked)
            if time.monotonic() - last >= PERIOD:
                last = time.monotonic()
                now = {name: memory(process) for name, process in processes(up).items()}
                for name, value in now.items():
                    samples.setdefault(name, []).append((last - begun, value))
                out.write(json.dumps({"s": round(last - begun), "parts": parts, **now}) + "\n")
                out.flush()
        up.end(signal.SIGINT)
        verdicts = [line.split(": ", 1)[1].split(",")[0].split(":")[0].strip() for line in up.lines if re.match(r"part \S+: ", line)]
    file.with_suffix(".errors").write_text(up.errors)
    topics, damages = {}, 0
    bags = sorted((folder / "recordings").iterdir())  # the recorder goes on in a new file after an hour
    for bag in bags:
        info = json.loads(kit.run(BINARY, "info", bag, "--json", folder=folder)[1])
        damages += len(info["damage"])
        for topic in info["topics"]:
            topics[topic["topic"]] = topics.get(topic["topic"], 0) + topic["messages"]
    most = max(topics, key=topics.get)
    print(f"{seconds:.0f} s, {parts} parts ({', '.join(f'{verdicts.count(one)} {one}' for one in sorted(set(verdicts)))}), status {up.code}")
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
    kit.main({"soak": main})
