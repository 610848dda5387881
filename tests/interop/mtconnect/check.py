#!/usr/bin/env python3
"""A running cell as an MTConnect agent: every document against the published schema, every figure against the recording.

    check.py PROBECELL

A part is made while a reader follows the agent's stream. The check has a network namespace of its own.
"""
import http.client
import pathlib
import re
import shutil
import sys
import threading

from lxml import etree

ROOT = pathlib.Path(__file__).resolve().parents[3]
SCHEMAS = ROOT.parent / "shared" / "data" / "schemas" / "mtconnect"
PROGRAM = pathlib.Path(sys.argv[1]).resolve()
sys.path.append(str(ROOT / "tests"))
import kit  # noqa: E402
from kit.recordings import messages  # noqa: E402

READY = re.compile(r"http://127\.0\.0\.1:(\d+)/")


def validator(kind):
    """The published schema of a kind of document. libxml2 knows XSD 1.0: a wildcard's word of 1.1 is replaced by the equal one."""
    file = SCHEMAS / f"MTConnect{kind}_2.7.xsd"
    if not file.exists():
        return None
    text = file.read_text(encoding="utf-8").replace("notNamespace='##targetNamespace'", "namespace='##other'")
    return etree.XMLSchema(etree.fromstring(text.encode(), base_url=str(file)))


VALIDATORS = {kind: validator(kind) for kind in ("Devices", "Streams", "Error")}


def document(text, kind):
    tree = etree.fromstring(text).getroottree()
    assert etree.QName(tree.getroot()).localname == f"MTConnect{kind}", text
    if VALIDATORS[kind]:
        VALIDATORS[kind].assertValid(tree)
    return tree


def named(tree, name):
    return tree.xpath(f"//*[local-name()='{name}']")


class Agent:
    def __init__(self, port):
        self.port = port

    def get(self, path, kind, status=200):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=kit.patience(60))
        connection.request("GET", path)
        answer = connection.getresponse()
        text = answer.read()
        assert answer.status == status, (path, answer.status, text)
        assert answer.headers["Content-Type"] == "application/xml"
        return document(text, kind)

    def follow(self, path):
        """Documents of a stream (multipart/x-mixed-replace) as they come."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=kit.patience(60))
        connection.request("GET", path)
        answer = connection.getresponse()
        boundary = re.search(r"boundary=(\S+)", answer.headers["Content-Type"]).group(1).encode()
        while True:
            assert answer.readline().strip() == b"--" + boundary
            length = None
            while line := answer.readline().strip():
                name, value = line.split(b":", 1)
                length = int(value) if name.lower() == b"content-length" else length
            text = answer.read(length)
            assert answer.readline() == b"\r\n"
            yield document(text, "Streams")


def sequences(tree):
    return [int(one) for one in tree.xpath("//@sequence")]


def table(entry):
    return {cell.get("key"): cell.text for cell in entry}


def observations(tree):
    """(sequence, item, text or the table) of every observation."""
    found = []
    for one in tree.xpath("//*[@sequence]"):
        entries = {entry.get("key"): table(entry) for entry in one}
        found.append((int(one.get("sequence")), one.get("dataItemId"), entries or one.text))
    return sorted(found, key=lambda one: one[0])


def close(text, metres):
    assert abs(float(text) - metres * 1e3) <= abs(metres * 1e3) * 4e-16 + 1e-300, (text, metres)


def errors_are_documents(agent, last):
    for path, word in (
        ("/sample?from=99999999", "OutOfRange"),
        (f"/current?at={last + 1000}", "QueryError"),
        ("/sample?count=0", "OutOfRange"),
        ("/sample?count=many", "InvalidParameterValue"),
        ("/current?path=//Path", "Unsupported"),
        ("/assets", "Unsupported"),
        ("/sample?interval=100&heartbeat=0", "InvalidParameterValue"),
        ("/current?interval=0", "InvalidParameterValue"),
        ("/other/probe", "NoDevice"),
        ("/a/b/c/d", "Unsupported"),
    ):
        tree = agent.get(path, "Error", 404)
        assert named(tree, word), (path, etree.tostring(tree))


def main(work):
    (work / "launch-scripts").mkdir()
    for name in ("turn_mill.toml", "turn_mill.urdf"):
        shutil.copy(ROOT / "launch-scripts" / name, work / "launch-scripts")
    seen, done = [], threading.Event()
    with kit.Process(PROGRAM, "mtconnect", "--listen", "127.0.0.1:0", folder=work) as served:
        port = int(READY.search(served.line()).group(1))
        agent = Agent(port)
        # Before there is a cell: it is not available, and nothing is made up.
        devices = agent.get("/probe", "Devices")
        items = {one.get("id") for one in named(devices, "DataItem")}
        empty = observations(agent.get("/current", "Streams"))
        assert {item for _, item, _ in empty} == items and all(text == "UNAVAILABLE" for _, _, text in empty), empty

        def follow():
            for tree in agent.follow("/sample?from=1&interval=100&heartbeat=2000&count=1000"):
                seen.extend(observations(tree))
                kit.happened()
                if done.is_set():
                    return

        reader = threading.Thread(target=follow, daemon=True)
        reader.start()
        code, _, errors = kit.run(PROGRAM, "up", "--once", "--no-dashboard", folder=work)
        assert code == 0, errors
        # The cell has left the bus: the agent says so.
        gone = next(tree for tree in agent.follow("/current?interval=200") if named(tree, "Availability")[0].text == "UNAVAILABLE")
        assert named(gone, "Execution")[0].text == "UNAVAILABLE"
        whole = observations(agent.get("/sample?from=1&count=10000", "Streams"))
        assert [one[0] for one in whole] == list(range(1, len(whole) + 1))
        kit.until("the reader of the stream", lambda: len(seen) >= len(whole))
        done.set()
        kit.until("the end of the reader", lambda: not reader.is_alive())
        assert seen == whole, (len(seen), len(whole))
        assert {item for _, item, _ in whole} <= items
        by_device = agent.get("/turn_mill/current", "Streams")
        assert sequences(by_device) == sequences(agent.get("/current", "Streams"))
        # What was current at an observation is what a reader that had followed so far would hold.
        middle = whole[len(whole) // 2][0]
        held = {item: what for number, item, what in whole if number <= middle}
        assert {item: what for _, item, what in observations(agent.get(f"/current?at={middle}", "Streams"))} == held
        executions = [text for _, item, text in whole if item == "execution"]
        assert "ACTIVE" in executions and "READY" in executions, executions
        (recording,) = (work / "recordings").iterdir()
        check_figures(whole, messages(recording))
        errors_are_documents(agent, len(whole))
        third_party(port, devices)
        assert served.end() == 0
    print(f"{len(whole)} observations, {sum(1 for one in whole if one[1] == 'feature_measurements')} tables of sizes: ok"
          + ("" if VALIDATORS["Streams"] else " (not validated: the official schema is not there)"))


def check_figures(whole, held):
    sizes = {}
    for _, item, what in whole:
        if item == "feature_measurements" and isinstance(what, dict):
            for feature, cells in what.items():
                sizes[(cells["MEASUREMENT_ID"], feature)] = cells
    last = {(result.plan_id, result.feature_id): result for result in held["feature_results"]}
    assert set(sizes) == set(last) and last, set(sizes) ^ set(last)
    for key, result in last.items():
        close(sizes[key]["MEASUREMENT_VALUE"], result.size)
        close(sizes[key]["UNCERTAINTY"], result.standard_uncertainty)
    judged = {cells["CHARACTERISTIC_STATUS"] for cells in sizes.values()}
    assert "PASS" in judged, judged
    offsets = [what for _, item, what in whole if item == "tool_offsets" and isinstance(what, dict)][-1]
    final = held["tool_offsets"][-1]
    assert len(offsets) == len(final.tool_numbers)
    for tool, wear in zip(final.tool_numbers, final.wear):
        close(offsets[str(tool)]["LENGTH"], wear)


def third_party(port, devices):
    """Types and representations as the classes name them that others generated from MTConnect's SysML model."""
    from pymtconnect import DataItem, EventEnum

    types = {one.value for one in EventEnum}
    for item in named(devices, "DataItem"):
        read = DataItem.from_dict({**item.attrib})
        assert read.id == item.get("id") and str(item.get("type")) in types, (item.attrib, len(types))


kit.main({"mtconnect": main})
