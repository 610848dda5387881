#!/usr/bin/env python3
"""What many cells cost the dashboard and the pages that follow them, and how long a touch takes to the screen.

    hall.py PROBECELL LOAD [NUMBER_OF_CELLS...]

LOAD is the example `load` of the crate dashboard, which plays a recorded cell as so many. It has a network namespace of its own:

    cargo build --release -p probecell -p dashboard --example load --bin probecell
    target/venv/bin/python tests/benches/hall.py target/release/probecell target/release/examples/load 10 100 500

Processor time is what the processes have used (utime and stime), so that others on the machine matter little; memory is
resident (Pss for the browser, whose processes share much). A router has 100 cells at the most (CELLS_OF_A_ROUTER): what Zenoh
1.10 looks through with each announcement and question grows with what is announced at a router. Delays are from the stamp of a
touch, at its publication, to the frame of headless Chromium that shows it. The venv is the one of `.ci/run dashboard`.
"""

import contextlib
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import time
import urllib.request

from playwright.sync_api import sync_playwright

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "tests"))
import kit  # noqa: E402

RECORDING = ROOT / "bags" / "samples" / "punch_uncalibrated.mcap"
ADDRESS = "127.0.0.1:7480"
CELLS_OF_A_PROCESS = 50
CELLS_OF_A_ROUTER = int(os.environ.get("CELLS_OF_A_ROUTER", "100"))
SETTLED, WATCHED, TOUCHED = 5, float(os.environ.get("WATCHED_S", "20")), float(os.environ.get("TOUCHED_S", "60"))  # s
LONGEST = 300  # s
EVERY = os.environ.get("EVERY", "1")  # of the messages at 100 Hz
TICKS = os.sysconf("SC_CLK_TCK")

DELAYS = """() => { window.delays = []; window.last = 0; new MutationObserver(() => {
    const at = Number(document.querySelector('#part .newest')?.dataset.made);
    if (!at || at === window.last) return;
    const first = !window.last;
    window.last = at;
    if (!first) requestAnimationFrame(() => setTimeout(() => window.delays.push(Date.now() - at), 0));
}).observe(document.querySelector('.cards'), { childList: true, subtree: true }); }"""


def below(process):
    """A process and all that it has started."""
    found, left = [], [process]
    while left:
        one = left.pop()
        found.append(one)
        for tasks in pathlib.Path(f"/proc/{one}/task").glob("*/children"):
            with contextlib.suppress(OSError):
                left += map(int, tasks.read_text().split())
    return found


def processor_s(processes):
    total = 0
    for one in processes:
        with contextlib.suppress(OSError):
            fields = pathlib.Path(f"/proc/{one}/stat").read_text().rsplit(")", 1)[1].split()
            total += int(fields[11]) + int(fields[12])
    return total / TICKS


def kib(process, file, name):
    with contextlib.suppress(OSError):
        for line in pathlib.Path(f"/proc/{process}/{file}").read_text().splitlines():
            if line.startswith(name):
                return int(line.split()[1])
    return 0


def metric(name):
    with urllib.request.urlopen(f"http://{ADDRESS}/metrics") as answer:
        lines = answer.read().decode().splitlines()
    return sum(float(line.rsplit(" ", 1)[1]) for line in lines if line.startswith((f"{name} ", f"{name}{{")))


class Watched:
    """Processor time of groups of processes over a span."""

    def __init__(self, **groups):
        self.groups, self.begun = groups, time.monotonic()
        self.before = {name: processor_s(processes) for name, processes in groups.items()}

    def shares(self):
        span = time.monotonic() - self.begun
        return {name: (processor_s(processes) - self.before[name]) / span for name, processes in self.groups.items()}


@contextlib.contextmanager
def starting(folder):
    """What starts processes that end with it."""
    with contextlib.ExitStack() as ending:
        def start(*words, **how):
            one = subprocess.Popen([str(word) for word in words], cwd=folder, **how)
            ending.callback(one.wait)
            ending.callback(one.send_signal, signal.SIGTERM)
            return one

        yield start, ending


QUIET = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}


def endpoints(count):
    """Of the routers of so many cells."""
    return [f"tcp/127.0.0.1:{7500 + number}" for number in range(-(-count // CELLS_OF_A_ROUTER))]


def bus(start, probecell, count):
    return [start(probecell, "router", "--listen", endpoint, "--strangers", "write", **QUIET) for endpoint in endpoints(count)]


def cells(start, load, count):
    """Processes that play so many cells; they have joined the bus."""
    loads = []
    for first in range(0, count, CELLS_OF_A_PROCESS):
        router = endpoints(count)[first // CELLS_OF_A_ROUTER]
        words = (load, router, RECORDING, first, min(CELLS_OF_A_PROCESS, count - first), EVERY)
        loads.append(start(*words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True))
    for one in loads:
        assert one.stdout.readline() == "ready\n", "the load did not start"
    return loads


def ended(loads):
    """What they say at their end."""
    for one in loads:
        one.stdin.close()
    return sorted({one.stdout.readline().strip() for one in loads})


def generator(probecell, load, count, folder):
    """What the cells publish while nobody reads them: the limit of the load itself."""
    with starting(folder) as (start, _):
        bus(start, probecell, count)
        loads = cells(start, load, count)
        watched = Watched(cells=[one.pid for one in loads])
        kit.pause(WATCHED, "what is watched")
        share = watched.shares()["cells"]
        print(f"  the load alone, {count} cells: {100 * share:.1f} % of a processor", flush=True)
        for one in ended(loads):
            print(f"  load: {one}", flush=True)


def measure(probecell, load, count, chromium, folder):
    with starting(folder) as (start, ending):
        routers = bus(start, probecell, count)
        connect = [word for endpoint in endpoints(count) for word in ("--connect", endpoint)]
        dashboard = start(probecell, "dashboard", "--listen", ADDRESS, *connect, "--recordings", folder, **QUIET)
        begun = time.monotonic()
        loads = cells(start, load, count)
        kit.until("all cells", lambda: metric("probecell_dashboard_cells") == count, LONGEST)
        found = time.monotonic() - begun
        kit.pause(SETTLED, "what its start has cost is not counted")

        own = {"dashboard": [dashboard.pid], "routers": [one.pid for one in routers], "cells": [one.pid for one in loads]}
        watched, received = Watched(**own), metric("probecell_dashboard_messages_total")
        kit.pause(WATCHED, "what is watched")
        alone = watched.shares()
        rate = (metric("probecell_dashboard_messages_total") - received) / WATCHED

        browser = chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"] if os.getuid() == 0 else [])
        ending.callback(browser.close)
        hall = browser.new_page(viewport={"width": 1400, "height": 900})
        hall.goto(f"http://{ADDRESS}/")
        kit.until("all tiles", lambda: hall.locator(".tile").count() == count, LONGEST)
        kit.pause(SETTLED, "what its start has cost is not counted")
        watched = Watched(browser=browsers(), **own)
        kit.pause(WATCHED, "what is watched")
        followed = watched.shares()
        pages = memory(browsers())

        cell = browser.new_page(viewport={"width": 1400, "height": 900})
        cell.goto(f"http://{ADDRESS}/cell/cell_0")
        cell.evaluate(DELAYS)
        watched = Watched(browser=browsers(), **own)
        kit.pause(TOUCHED, "what is watched")
        looked = watched.shares()
        delays = sorted(cell.evaluate("window.delays"))
        at = lambda share: delays[min(len(delays) - 1, int(share * len(delays)))] if delays else float("nan")
        resident, missed = kib(dashboard.pid, "status", "VmRSS:") / 1024, metric("probecell_dashboard_missed_messages_total")

        told = ended(loads)
        percent = lambda share: f"{100 * share:.1f}"
        print(f"| {count} | {rate:.0f} | {percent(alone['dashboard'])} | {percent(followed['dashboard'])} | {percent(looked['dashboard'])} | {resident:.0f} | "
              f"{percent(followed['browser'])} | {pages:.0f} | {at(0.5):.0f} | {at(0.99):.0f} | {len(delays)} | {missed:.0f} | {percent(alone['routers'])} | {percent(alone['cells'])} |", flush=True)
        print(f"  all cells joined and found after {found:.0f} s")
        for one in told:
            print(f"  load: {one}", flush=True)


def browsers():
    """All processes of the browser."""
    return [one for one in below(os.getpid()) if b"chromium" in program(one)]


def program(process):
    with contextlib.suppress(OSError):
        return pathlib.Path(f"/proc/{process}/cmdline").read_bytes().split(b"\0")[0]
    return b""


def memory(processes):
    return sum(kib(one, "smaps_rollup", "Pss:") for one in processes) / 1024


def main(folder):
    probecell, load, *counts = sys.argv[1:]
    probecell, load = pathlib.Path(probecell).resolve(), pathlib.Path(load).resolve()
    print(f"load average {os.getloadavg()[0]:.0f}, {os.cpu_count()} processors")
    print("| cells | messages/s | dashboard, % of a processor: no page | the hall followed | and a cell | MB | browser % | MB | touch to screen ms: median | 99 % | touches | missed | routers % | cells % |")
    print("|" + "---|" * 14)
    with sync_playwright() as playwright:
        for count in counts or ["10", "100", "500"]:
            own = folder / count
            own.mkdir()
            generator(probecell, load, int(count), own)
            measure(probecell, load, int(count), playwright.chromium, own)
    print(f"load average {os.getloadavg()[0]:.0f}")


kit.main({"hall": main})
