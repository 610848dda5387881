#!/usr/bin/env python3
"""Fifty strangers that come and go while a cell stands ready: memory and open files of each of its processes.

    visitors.py PROBECELL [MINUTES [KIND...]]

Each stranger stays some seconds and comes again as another: a Zenoh session that reads every topic and asks what it may not, a browser that follows
the hall or the cell, a Foxglove viewer, a connection that says nothing, half a request. Every minute each process of the cell is read in /proc. It
fails where the median of the last quarter of the run is above that of the second quarter by more than a megabyte and 3 %, or holds more files.

The router (in `up`) may keep 6 KB of each Zenoh session besides: Zenoh 1.10.2 keeps the face of a session that has ended for as long as another
session subscribes to the key that it was sent samples of.
"""

import base64
import collections
import json
import pathlib
import random
import socket
import statistics
import sys
import threading
import time

import zenoh

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "tests"))
import kit  # noqa: E402

STRANGERS = 50
STAY = (2.0, 20.0)  # s
ROUTER = ("127.0.0.1", 7447)
MOST = (1 << 20, 0.03)  # bytes, and share, by which a process may have grown
KEPT = 6_000  # bytes that Zenoh's router may keep of a session


def zenoh_session(stay, _page):
    config = zenoh.Config()
    for key, value in (("mode", "client"), ("connect/endpoints", ["tcp/127.0.0.1:7447"]), ("scouting/multicast/enabled", False)):
        config.insert_json5(key, json.dumps(value))
    with zenoh.open(config) as session:
        session.declare_subscriber("0/**", lambda _: None)
        session.liveliness().declare_subscriber("@ros2_lv/**", lambda _: None)
        session.put("0/turn_mill/run_requests/x/y", b"forged")
        list(session.get("0/turn_mill/get_parameters/x/y", timeout=1.0))
        stay()


def connection(to, words, stay):
    """Says these words, and reads what comes until it leaves."""
    with socket.create_connection(to, timeout=1.0) as one:
        one.sendall(words)
        leaves = stay.ends()
        while time.monotonic() < leaves:
            try:
                if not one.recv(1 << 16):
                    return
            except TimeoutError:
                pass


def request(path, port, more=""):
    return f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n{more}\r\n".encode()


def viewer(port):
    key = base64.b64encode(random.randbytes(16)).decode()
    upgrade = f"Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {key}\r\n"
    return request("/viewer", port, upgrade + "Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n")


KINDS = {
    "zenoh": zenoh_session,
    "hall": lambda stay, page: connection(page, request("/events/hall", page[1]), stay),
    "cell": lambda stay, page: connection(page, request("/events/cell/turn_mill", page[1]), stay),
    "page": lambda stay, page: connection(page, request("/cell/turn_mill", page[1], "Connection: close\r\n"), stay),
    "viewer": lambda stay, page: connection(page, viewer(page[1]), stay),
    "silent": lambda stay, page: connection(ROUTER, b"", stay),
    "half": lambda stay, page: connection(page, b"GET / HTTP/1.1\r\nHost: 127", stay),
}


class Stay:
    """How long a stranger stays: drawn when it comes, and no longer than the run."""

    def __init__(self, draw, end):
        self.seconds, self.end = draw.uniform(*STAY), end

    def ends(self):
        return min(self.end, time.monotonic() + self.seconds)

    def __call__(self):
        kit.pause(max(0.0, self.ends() - time.monotonic()), "a stranger stays")


def stranger(number, end, page, visits):
    draw = random.Random(number)
    while time.monotonic() < end:
        kind = draw.choice(WANTED)
        try:
            KINDS[kind](Stay(draw, end), page)
            visits[kind] += 1
        except (OSError, zenoh.ZError) as error:
            visits[f"{kind} refused: {type(error).__name__}"] += 1
            kit.pause(1.0, "one that was refused comes again later")


def names(up):
    """Each process of the cell, by its number."""
    found = {up.pid: "up"}
    children = pathlib.Path(f"/proc/{up.pid}/task/{up.pid}/children").read_text().split()
    for one in children:
        words = pathlib.Path(f"/proc/{one}/cmdline").read_bytes().decode().split("\0")
        found[int(one)] = words[2] if words[1] == "node" else words[1]
    return found


def read(process):
    """Bytes of memory of its own, and open files."""
    lines = pathlib.Path(f"/proc/{process}/status").read_text().splitlines()
    values = dict(line.split(":", 1) for line in lines)
    return 1024 * int(values["RssAnon"].split()[0]), len(list(pathlib.Path(f"/proc/{process}/fd").iterdir()))


def check(folder, minutes):
    name = "turn_mill.toml"
    for one in (name, "turn_mill.urdf"):
        (folder / one).write_text((ROOT / "launch-scripts" / one).read_text())
    visits, seen = collections.Counter(), collections.defaultdict(list)
    with kit.Process(BINARY, "up", name, folder=folder, apart=True) as up:
        up.says("is ready")
        kit.until("the dashboard", lambda: "dashboard: http://127.0.0.1:" in up.errors)
        port = int(up.errors.split("dashboard: http://127.0.0.1:")[1].split("/")[0])
        processes, end = names(up), time.monotonic() + 60.0 * minutes
        strangers = [threading.Thread(target=stranger, args=(one, end, ("127.0.0.1", port), visits)) for one in range(STRANGERS)]
        for one in strangers:
            one.start()
        while time.monotonic() < end:
            kit.pause(min(60.0, max(0.0, end - time.monotonic())), "the strangers come and go")
            assert names(up) == processes, ("another process", names(up), processes)
            for process in processes:
                seen[process].append(read(process))
            if len(seen[up.pid]) % 10 == 0:
                print(len(seen[up.pid]), "min", {processes[one]: seen[one][-1] for one in seen}, dict(visits), flush=True)
        for one in strangers:
            one.join()
    grown = []
    print(f"{'process':16} {'second quarter':>18} {'last quarter':>18} {'files':>11}   MB: median (least, most)")
    for process, values in seen.items():
        quarter = max(1, len(values) // 4)
        before, after = values[quarter : 2 * quarter], values[-quarter:]
        memory = [[one[0] for one in part] for part in (before, after)]
        files = [max(one[1] for one in part) for part in (before, after)]
        told = [f"{statistics.median(part) / 1e6:.2f} ({min(part) / 1e6:.1f}, {max(part) / 1e6:.1f})" for part in memory]
        print(f"{processes[process]:16} {told[0]:>18} {told[1]:>18} {files[0]:5} {files[1]:5}")
        kept = KEPT * visits["zenoh"] / 2 if processes[process] == "up" else 0  # of half of the run
        bound = statistics.median(memory[0]) * (1.0 + MOST[1]) + MOST[0] + kept
        if statistics.median(memory[1]) > bound or files[1] > files[0] + STRANGERS // 10:
            grown.append(processes[process])
    print("visits:", sum(visits.values()), dict(visits))
    assert all(visits[kind] for kind in WANTED), visits
    assert not grown, f"grew: {grown}"


if __name__ == "__main__":
    if len(sys.argv) < 2:
        raise SystemExit(__doc__)
    BINARY = str(pathlib.Path(sys.argv[1]).resolve())
    length = float(sys.argv[2]) if len(sys.argv) > 2 else 120.0
    WANTED = sys.argv[3:] or list(KINDS)
    if not set(WANTED) <= set(KINDS):
        raise SystemExit(f"a KIND is one of {', '.join(KINDS)}")
    with kit.new_folder() as folder:
        if not kit.apart(check, pathlib.Path(folder), length):
            raise SystemExit("FAILED")
