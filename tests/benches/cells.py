#!/usr/bin/env python3
"""Simulated cells side by side on one machine: time until all are ready, memory, processor time.

    cells.py PROBECELL [NUMBER...]

Run it in a network namespace of its own: unshare -n bash -c 'ip link set lo up; cells.py target/release/probecell 1 2 5 10'.
All cells share the router that the first to start carries. Memory is the proportional share (Pss) of all processes.
"""

import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
LONGEST = 120  # s until all are ready
WATCHED = 10  # s for which processor time is counted
TICKS = os.sysconf("SC_CLK_TCK")


def below(process):
    """A process and all that it has started."""
    found, left = [], [process]
    while left:
        one = left.pop()
        found.append(one)
        try:
            left += map(int, pathlib.Path(f"/proc/{one}/task/{one}/children").read_text().split())
        except OSError:
            pass
    return found


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


def measure(number, folder):
    text = (ROOT / "launch-scripts" / "turn_mill.toml").read_text()
    cells = []
    for index in range(number):
        own = folder / f"cell_{index}"
        own.mkdir()
        (own / "cell.toml").write_text(text.replace('name = "turn_mill"', f'name = "cell_{index}"', 1))
        (own / "turn_mill.urdf").write_text((ROOT / "launch-scripts" / "turn_mill.urdf").read_text())
        cells.append(own)
    environment = os.environ | {"XDG_CONFIG_HOME": str(folder / "config"), "XDG_STATE_HOME": str(folder / "state")}
    begun, ready, started = time.monotonic(), {}, []

    def await_ready(index, process):
        for line in process.stdout:
            if "is ready" in line:
                ready[index] = time.monotonic() - begun

    try:
        for index, own in enumerate(cells):
            errors = open(own / "errors.txt", "w")
            process = subprocess.Popen(
                [BINARY, "up", "cell.toml"], cwd=own, env=environment, text=True, stdout=subprocess.PIPE, stderr=errors,
            )
            threading.Thread(target=await_ready, args=(index, process), daemon=True).start()
            started.append(process)
            # Two cells that start at the same instant may both begin a router; a user starts one after the other.
            while index == 0 and not any((folder / "state/probecell/bus").glob("*.socket")) and process.poll() is None:
                time.sleep(0.01)
        while len(ready) < number and time.monotonic() - begun < LONGEST and all(one.poll() is None for one in started):
            time.sleep(0.02)
        processes = [one for process in started for one in below(process.pid)]
        before = processor_s(processes)
        time.sleep(WATCHED)
        load = (processor_s(processes) - before) / WATCHED
        last = f"{max(ready.values()):.1f}" if len(ready) == number else "-"
        print(f"{number} | {len(ready)} | {last} | {before:.1f} | {len(processes)} | {memory_mib(processes):.0f} | {load:.2f}", flush=True)
        if len(ready) < number:
            for own in cells:
                print(own.name, (own / "errors.txt").read_text()[-300:], file=sys.stderr)
    finally:
        for process in started:
            process.send_signal(signal.SIGINT)
        for process in started:
            process.wait(60)


def main():
    print("cells | ready | last ready, s | processor time until then, s | processes | memory, MiB | processors busy")
    for number in map(int, sys.argv[2:] or ["1", "2", "5", "10"]):
        with tempfile.TemporaryDirectory(prefix="cells_") as folder:
            measure(number, pathlib.Path(folder))


if __name__ == "__main__":
    if len(sys.argv) < 2:
        raise SystemExit(__doc__)
    BINARY = str(pathlib.Path(sys.argv[1]).resolve())
    main()
