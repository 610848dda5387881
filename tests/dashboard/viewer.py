"""The topics as Foxglove and Lichtblick read them: their client in Node beside a cell, compared with the recording of the cell."""

import hashlib
import http.client
import json
import pathlib

from pages import ADDRESS, ROOT, kit

from kit.recordings import raw

MODULES = ROOT / "target" / "npm" / "node_modules"
# Reliable topics of which every message counts.
TOPICS = ("touch_deviations", "feature_results", "verdicts", "corrections", "gap_report", "part_reports", "inspection_plan", "touch_markers")


class Viewer:
    """Follows a dashboard for as long as it is open."""

    def __init__(self, cell):
        self.cell, self.load = cell, kit.Load()
        topics = [f"/{cell}/{topic}" for topic in TOPICS]
        script = pathlib.Path(__file__).with_name("viewer.mjs")
        self.process = kit.Process("node", script, MODULES, f"ws://{ADDRESS}/viewer", *topics, apart=True)

    @property
    def lines(self):
        return [json.loads(line) for line in self.process.lines]

    def told(self, key):
        return [line[key] for line in self.lines if key in line]

    def waits_for(self, what, topic):
        kit.until(f"{topic} {what}", lambda: topic in self.told(what))

    def end(self):
        self.process.end()
        (seen,) = self.told("end")
        return seen


HELD_UP = 0.2  # share of the time; what carries messages to the viewer and had no processor for so much of it may lose some of streams, and tells so


def compared(viewer, seen, folder, held_up):
    """Every message of the topics in the recording of the cell came to the viewer, byte for byte, and nothing else. `held_up`: the share of the
    time for which what carries the messages to it had to wait for a processor."""
    assert seen["serverInfo"]["name"] == "probecell" and seen["serverInfo"]["capabilities"] == [], seen["serverInfo"]
    assert not seen["errors"] and not seen["undecoded"], seen
    said = [status["message"] for status in seen["statuses"]]
    assert "this dashboard only reads: advertise is not served" in said, said
    lost = [text for text in said if "lost" in text or "skipped" in text]
    assert not lost or held_up > HELD_UP, (held_up, lost)
    assert not [text for text in lost if any(f"/{viewer.cell}/{topic} " in text for topic in TOPICS)], lost
    recorded = {}
    for channel, message in raw(folder):
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
    print(f"viewer: {len(offered)} topics offered, {total} messages decoded by @foxglove/ws-protocol, {sum(map(len, came.values()))} of {len(topics)} topics as in the recording; "
          f"{len(lost)} losses of streams told, carriers held up for {100 * held_up:.0f} % of the time")


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
        connection = http.client.HTTPConnection(ADDRESS, timeout=kit.patience(60))
        connection.request("GET", "/viewer", headers=headers)
        status = connection.getresponse().status
        assert status == code, (what, status)
        connection.close()
    print("viewer: pages from elsewhere, other names and other protocols are refused")
