#!/usr/bin/env python3
"""A running cell as an edge node of Sparkplug B: births, data and deaths over Debian's mosquitto, read by paho-mqtt and the payloads
of pysparkplug. Each figure equals the recording's.

    check.py PROBECELL

A part is made while a host listens. The check has a network namespace of its own.
"""
import pathlib
import shutil
import signal
import sys
import threading
import time

import paho.mqtt.client as mqtt
from pysparkplug._protobuf import Payload

ROOT = pathlib.Path(__file__).resolve().parents[3]
PROGRAM = pathlib.Path(sys.argv[1]).resolve()
sys.path.append(str(ROOT / "tests"))
import kit  # noqa: E402
from kit.recordings import messages  # noqa: E402

PORT = kit.free_port()
HELD = {8: "long_value", 10: "double_value", 11: "boolean_value", 12: "string_value"}
STATUS = {0: "PASS", 1: "REWORK", 5: "SYSERROR", 6: "INDETERMINATE", 7: "SYSERROR"}  # by the verdict of a size; else FAIL


class Host:
    """Every message of the group, in order."""

    def __init__(self):
        self.changed, self.heard = threading.Lock(), []
        self.client = mqtt.Client(client_id="host")
        self.client.on_connect = self.connected
        self.connections = 0
        self.client.on_message = self.take
        self.client.connect("127.0.0.1", PORT)
        self.client.loop_start()

    def connected(self, client, *_):
        client.subscribe("spBv1.0/shop/#", 1)
        with self.changed:
            self.connections += 1
        kit.happened()

    def take(self, _client, _data, message):
        assert not message.retain
        with self.changed:
            self.heard.append((message.topic, Payload.FromString(message.payload)))
        kit.happened()

    def wait(self, kind, begin=0):
        """Number and payload of the first message of that type from that number on."""
        def found():
            places = range(begin, len(self.heard))
            return next(((one, self.heard[one][1]) for one in places if self.heard[one][0].split("/")[2] == kind), None)

        return kit.until(kind, found)

    def rebirth(self):
        payload = Payload()
        metric = payload.metrics.add()
        metric.name, metric.datatype, metric.boolean_value = "Node Control/Rebirth", 11, True
        self.client.publish("spBv1.0/shop/NCMD/turn_mill", payload.SerializeToString(), 0)


def value(metric):
    if metric.is_null:
        return None
    held = HELD[metric.datatype]
    assert metric.WhichOneof("value") == held, metric
    return getattr(metric, held)


def values(payload):
    return {metric.name: value(metric) for metric in payload.metrics}


def units(payload):
    return {one.name: dict(zip(one.properties.keys, one.properties.values)) for one in payload.metrics}


def edge():
    process = kit.Process(
        PROGRAM, "sparkplug", "--broker", f"127.0.0.1:{PORT}", "--group", "shop", "--cell", "launch-scripts/turn_mill.toml", folder=WORK, apart=True,
    )
    assert process.line().startswith("Sparkplug edge node turn_mill of group shop"), process.errors
    return process


def broker():
    process = kit.Process("/usr/sbin/mosquitto", "-c", "mosquitto.conf", folder=WORK)
    process.says("running")
    return process


def rules_hold(heard):
    """Of the standard: numbers without a gap from each birth of the node, and data only of metrics that the device was born with."""
    kinds = {"NBIRTH": "", "NDEATH": "", "DBIRTH": "/machine", "DDATA": "/machine", "DDEATH": "/machine"}
    last, born = None, set()
    for topic, payload in heard:
        space, group, kind, node = topic.split("/")[:4]
        assert topic == f"spBv1.0/shop/{kind}/turn_mill{kinds[kind]}" and (space, group, node) == ("spBv1.0", "shop", "turn_mill")
        if kind == "NDEATH":
            assert list(values(payload)) == ["bdSeq"] and not payload.HasField("seq")
            last, born = None, set()
            continue
        assert payload.seq == (0 if kind == "NBIRTH" else (last + 1) % 256), (topic, payload.seq, last)
        assert abs(payload.timestamp / 1e3 - time.time()) < 1000
        last = payload.seq
        names = [metric.name for metric in payload.metrics]
        assert len(names) == len(set(names))
        if kind == "DBIRTH":
            born = set(names)
        elif kind == "DDATA":
            assert names and set(names) <= born, set(names) - born
        elif kind == "DDEATH":
            assert born and not names
            born = set()


def figures_equal(heard, found):
    """What was told last of each metric is what the recording holds last, and nothing was told that it does not hold."""
    last, units_ = {}, {}
    for topic, payload in heard:
        if topic.split("/")[2] in ("DBIRTH", "DDATA"):
            last.update(values(payload))
            units_.update(units(payload))
    results = {}
    for one in found["feature_results"]:
        if results and next(iter(results.values())).plan_id != one.plan_id:
            results = {}
        results[one.feature_id] = one
    verdicts = {(one.plan_id, one.feature_id): one for one in found["verdicts"]}
    for name, result in results.items():
        told = {key.removeprefix(f"size/{name}/"): one for key, one in last.items() if key.startswith(f"size/{name}/")}
        assert told["plan"] == result.plan_id
        assert told["value"] == result.size and told["deviation"] == result.size_deviation
        assert told["expanded uncertainty"] == result.coverage_factor * result.standard_uncertainty > 0
        assert told["coverage factor"] == result.coverage_factor
        verdict = verdicts.get((result.plan_id, name))
        if verdict:
            assert told["upper limit"] == verdict.tolerance and told["status"] == STATUS.get(verdict.verdict, "FAIL"), (told, verdict)
        assert units_[f"size/{name}/value"]["engUnit"].string_value == "m"
    assert sum(one.startswith("size/") and one.endswith("/value") for one in last) >= len(results) >= 5
    every = {(one.feature_id, one.size) for one in found["feature_results"]}
    told = [(one.name.split("/")[1], one.double_value) for _, payload in heard for one in payload.metrics
            if one.name.startswith("size/") and one.name.endswith("/value")]
    assert told and set(told) <= every
    stamps = {one.header.stamp.sec * 1000 + one.header.stamp.nanosec // 1_000_000 for one in found["feature_results"] + found["verdicts"]}
    assert {one.timestamp for _, payload in heard for one in payload.metrics if one.name.startswith("size/")} <= stamps
    (report,) = found["part_reports"]
    assert (last["part/last/verdict"], last["part/last/run"], last["part/last/passes"]) == ("QUALIFIED", report.run_id, report.passes)
    gap = found["gap_report"][-1]
    assert (last["gap/rms"], last["gap/noise floor"], last["gap/plan"]) == (gap.rms, gap.noise_floor, gap.plan_id)
    assert last["gap/verdict"] == ("NO_GAP", "EXPLAINED", "PARTLY_EXPLAINED", "UNEXPLAINED")[gap.verdict]
    top = gap.effects[0] if gap.effects else None
    assert last["gap/cause"] == (top.effect if top else "") and last["gap/cause/probability"] == (top.probability if top else None)
    state = found["machine_state"][-1]
    temperatures = {(name, one) for state in found["machine_state"] for name, one in zip(state.temperature_names, state.temperatures)}
    told = {(one.name.rsplit("/", 1)[1], one.double_value) for _, payload in heard for one in payload.metrics
            if one.name.startswith("machine/temperature/")}
    assert told and told <= temperatures and state.temperature_names
    print(f"  {len(results)} sizes, {len(told)} temperatures, gap {last['gap/verdict']} {last['gap/cause']}", flush=True)


def main(folder):
    global WORK
    WORK = folder
    (WORK / "launch-scripts").mkdir()
    for name in ("turn_mill.toml", "turn_mill.urdf"):
        shutil.copy(ROOT / "launch-scripts" / name, WORK / "launch-scripts")
    (WORK / "mosquitto.conf").write_text(f"listener {PORT} 127.0.0.1\nallow_anonymous true\n", encoding="utf-8")
    mosquitto = broker()
    host = Host()
    process = edge()
    # Without a cell there is a node, and no device.
    birth, payload = host.wait("NBIRTH")
    assert (birth, values(payload)["bdSeq"], values(payload)["Node Control/Rebirth"]) == (0, 0, False)
    code, _, errors = kit.run(PROGRAM, "up", "--once", "--no-dashboard", folder=WORK)
    assert code == 0, errors
    death, _ = host.wait("DDEATH")
    heard = host.heard[: death + 1]
    assert {topic.split("/")[2] for topic, _ in heard} == {"NBIRTH", "DBIRTH", "DDATA", "DDEATH"}
    rules_hold(heard)
    (recording,) = (WORK / "recordings").iterdir()
    figures_equal(heard, messages(recording))
    # A host asks for births; the device is not there to be born.
    host.rebirth()
    birth, payload = host.wait("NBIRTH", death)
    assert values(payload)["bdSeq"] == 0
    # The broker speaks for a process that was killed.
    process.kill()
    gone, payload = host.wait("NDEATH", birth)
    assert values(payload) == {"bdSeq": 0}
    process = edge()
    begin, payload = host.wait("NBIRTH", gone)
    assert values(payload)["bdSeq"] == 0
    # A broker that goes and returns meets the next connection.
    mosquitto.end()
    connections = host.connections
    mosquitto = broker()
    kit.until("the host at the broker", lambda: host.connections > connections)
    # Whichever of the two connects first, the host is told.
    host.rebirth()
    begin, payload = host.wait("NBIRTH", begin + 1)
    assert values(payload)["bdSeq"] >= 1
    number = values(payload)["bdSeq"]
    assert process.end(signal.SIGINT) == 0
    gone, payload = host.wait("NDEATH", begin)
    assert values(payload) == {"bdSeq": number}
    for arguments, words in [
        (["--broker", "nowhere"], "expected HOST:PORT"), (["--group", "a/b"], "must not contain"), (["--user", "u"], "--password-file"),
    ]:
        code, _, errors = kit.run(PROGRAM, "sparkplug", "--cell", "launch-scripts/turn_mill.toml", *arguments, folder=WORK)
        assert code == 2 and words in errors, (code, errors)


kit.main({"sparkplug": main})
