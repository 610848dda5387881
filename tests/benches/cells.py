#!/usr/bin/env python3
"""Simulated cells side by side on one machine: time until all are ready, memory, processor time.

    cells.py PROBECELL [NUMBER...]

Each number has a network namespace of its own. All its cells share the router that the first to start carries. Memory is the proportional share (Pss) of all processes.
"""

import os
import pathlib
import signal
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "tests"))
import kit  # noqa: E402

WATCHED = 10  # s for which processor time is counted
TICKS = os.sysconf("SC_CLK_TCK")


def memory_mib(processes):
    total = 0
    for one in processes:
        for line in pathlib.Path(f"/proc/{one}/smaps_rollup").read_text().splitlines():
            if line.startswith("Pss:"):
                total += int(line.split()[1])
    return total / 1024


def processor_s(processes):
    total = 0
    for one in processes:
        fields = pathlib.Path(f"/proc/{one}/stat").read_text().rsplit(")", 1)[1].split()
        total += int(fields[11]) + int(fields[12])
    return total / TICKS


def measure(folder, number):
    text = (ROOT / "launch-scripts" / "turn_mill.toml").read_text()
    cells = []
    for index in range(number):
        own = folder / f"cell_{index}"
        own.mkdir()
        (own / "cell.toml").write_text(text.replace('name = "turn_mill"', f'name = "cell_{index}"', 1))
        (own / "turn_mill.urdf").write_text((ROOT / "launch-scripts" / "turn_mill.urdf").read_text())
        cells.append(own)
    begun, ready, started = time.monotonic(), {}, []

    def all_are_ready():
        now = time.monotonic() - begun
        for index, process in enumerate(started):
            if process.has_said("is ready"):
                ready.setdefault(index, now)
        return len(ready) == number or any(one.code is not None for one in started)

    for own in cells:
        started.append(kit.Process(BINARY, "up", "cell.toml", folder=own, apart=True))
        # Two cells that start at the same instant may both begin a router; a user starts one after the other.
        kit.until("a router", lambda: any((folder / "state/probecell/bus").glob("*.socket")) or started[0].code is not None)
    kit.until("all cells", all_are_ready)
    processes = kit.processes() - {os.getpid()}
    before = processor_s(processes)
    kit.pause(WATCHED, "what is watched")
    load = (processor_s(processes) - before) / WATCHED
    last = f"{max(ready.values()):.1f}" if len(ready) == number else "-"
    print(f"{number} | {len(ready)} | {last} | {before:.1f} | {len(processes)} | {memory_mib(processes):.0f} | {load:.2f}", flush=True)
    if len(ready) < number:
        for own, process in zip(cells, started):
            print(own.name, process.errors[-300:], file=sys.stderr)
    for process in started:
        process.send(signal.SIGINT)
    for process in started:
        process.ended()


def main():
    print("cells | ready | last ready, s | processor time until then, s | processes | memory, MiB | processors busy")
    for number in map(int, sys.argv[2:] or ["1", "2", "5", "10"]):
        with kit.new_folder() as folder:
            kit.apart(measure, pathlib.Path(folder), number)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        raise SystemExit(__doc__)
    BINARY = str(pathlib.Path(sys.argv[1]).resolve())
    main()
