"""The topics as Foxglove and Lichtblick read them: their client in Node beside a cell, compared with the recording of the cell."""

import atexit
import hashlib
import http.client
import json
import pathlib
import subprocess
import sys
import threading

from kit import ADDRESS, ROOT, until
from mcap.reader import make_reader

MODULES = ROOT / "target" / "npm" / "node_modules"
# Reliable topics of which every message counts.
TOPICS = ("touch_deviations", "feature_results", "verdicts", "corrections", "gap_report", "part_reports", "inspection_plan", "touch_markers")


class Viewer:
    """Follows a dashboard for as long as it is open."""

    def __init__(self, cell):
        self.cell, self.lines = cell, []
        topics = [f"/{cell}/{topic}" for topic in TOPICS]
        script = pathlib.Path(__file__).with_name("viewer.mjs")
        self.process = subprocess.Popen(["node", script, MODULES, f"ws://{ADDRESS}/viewer", *topics], stdout=subprocess.PIPE, stderr=sys.stderr, text=True)
        self.reader = threading.Thread(target=self.read, daemon=True)
        self.reader.start()
        atexit.register(self.process.kill)

    def read(self):
        for line in self.process.stdout:
            self.lines.append(json.loads(line))

    def told(self, key):
        return [line[key] for line in self.lines if key in line]

    def waits_for(self, what, topic):
        until(f"{topic} {what}", lambda: topic in self.told(what))

    def end(self):
        if self.process.poll() is None:
            self.process.terminate()
        self.reader.join(timeout=60)
        (seen,) = self.told("end")
        return seen


def compared(viewer, seen, folder):
    """Every message of the topics in the recording of the cell came to the viewer, byte for byte, and nothing else."""
    assert seen["serverInfo"]["name"] == "probecell" and seen["serverInfo"]["capabilities"] == [], seen["serverInfo"]
    assert not seen["errors"] and not seen["undecoded"], seen
    said = [status["message"] for status in seen["statuses"]]
    assert "this dashboard only reads: advertise is not served" in said, said
    assert not [text for text in said if "lost" in text or "skipped" in text], said
    recorded = {}
    for file in sorted(folder.rglob("*.mcap")):
        with open(file, "rb") as stream:
            for _, channel, message in make_reader(stream).iter_messages():
                recorded.setdefault(channel.topic, []).append(hashlib.sha256(message.data).hexdigest())
    came = {}
    for line in viewer.lines:
        if "topic" in line:
            came.setdefault(line["topic"], []).append(line["hash"])
    topics = [f"/{viewer.cell}/{topic}" for topic in TOPICS]
    for topic in topics:
        assert came.get(topic, []) == recorded.get(topic, []), (topic, len(came.get(topic, [])), len(recorded.get(topic, [])))
    kinds = [topic for topic in recorded if topic.startswith(f"/{viewer.cell}/")]
    offered = viewer.told("offered")
    assert all(topic in offered for topic in kinds), sorted(set(kinds) - set(offered))
    total = sum(seen["counts"].values())
    print(f"viewer: {len(offered)} topics offered, {total} messages decoded by @foxglove/ws-protocol, {sum(map(len, came.values()))} of {len(topics)} topics as in the recording")


def refused():
    """A page from elsewhere does not get in, nor anybody without the protocol."""
    handshake = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13", "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ=="}
    spoken = {"Sec-WebSocket-Protocol": "foxglove.websocket.v1"}
    for what, code, headers in (
        ("a page from elsewhere", 403, handshake | spoken | {"Origin": "https://evil.example"}),
        ("a name of somebody else's", 421, handshake | spoken | {"Host": "evil.example:7480"}),
        ("another protocol", 400, handshake | {"Sec-WebSocket-Protocol": "chat"}),
        ("no upgrade", 426, {}),
    ):
        connection = http.client.HTTPConnection(ADDRESS, timeout=60)
        connection.request("GET", "/viewer", headers=headers)
        status = connection.getresponse().status
        assert status == code, (what, status)
        connection.close()
    print("viewer: pages from elsewhere, other names and other protocols are refused")
