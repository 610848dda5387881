#!/usr/bin/env python3
"""Signals of controllers beside the machine, from servers that others wrote: pymodbus, python-snap7 and pyads.

    check.py PROBECELL

The check has a network namespace of its own. What a server holds is set here, and what the cell publishes is read by eclipse-zenoh and
rosbags.
"""
import contextlib
import json
import os
import pathlib
import shutil
import signal
import statistics
import struct
import subprocess
import sys
import threading
import time

import zenoh

ROOT = pathlib.Path(__file__).resolve().parents[3]
PROGRAM = pathlib.Path(sys.argv[1]).resolve()
sys.path[:0] = [str(ROOT / "tests" / "interop" / "bus"), str(ROOT / "tests")]
import kit  # noqa: E402
from messages import Messages  # noqa: E402

MESSAGES = Messages(ROOT / "msgs")
TIMEOUT = 1.0  # s, of every signal here
LATE = 0.5  # s, by which an idle computer may be late beyond it; a loaded one as much more as its load explains
HELD_UP = 3.0  # s, for a single one of many; five signals that time out one after the other are later
PERIOD = 0.1

PORTS = {protocol: kit.free_port() for protocol in ("modbus", "s7", "ads")}
SOURCES = {
    "modbus": f"modbus://127.0.0.1:{PORTS['modbus']}/1",
    "s7": f"s7://127.0.0.1:{PORTS['s7']}/0/1",
    "ads": f"ads://127.0.0.1:{PORTS['ads']}/127.0.0.1.1.1:851",
}
ADDRESSES = {
    "modbus": ["discrete:5", "holding:7.2", "input:30", "holding:40", "holding:50:low_first"],
    "s7": ["DB1.DBX0.3", "M4.1", "DB1.DBW2", "DB1.DBD4", "DB1.DBD8"],
    "ads": ["MAIN.clamped", "MAIN.present", "MAIN.raw", "MAIN.exact", "MAIN.double"],
}
# Name at the peer, role, type, the rest of the section, and the value that follows from what the peer holds.
KINDS = [
    ("clamped", "clamping_closed", "bool", "", float),
    ("present", "part_present", "bool", "", float),
    ("raw", "temperature", "i16", "scale = 0.1\nmaximum = 60.0", lambda held: held * 0.1),
    ("exact", "temperature", "f32", "", lambda held: struct.unpack("<f", struct.pack("<f", held))[0]),
    ("swapped", "value", "f32", 'unit = "Pa"\nscale = 1e5\noffset = -100.0',
     lambda held: struct.unpack("<f", struct.pack("<f", held))[0] * 1e5 - 100.0),
]
UNITS = {"clamped": "1", "present": "1", "raw": "degC", "exact": "degC", "swapped": "Pa"}


def section(name, role, source, address, kind, more=""):
    return (
        f'\n[[signals]]\nname = "{name}"\nrole = "{role}"\nsource = "{source}"\naddress = "{address}"\ntype = "{kind}"\n'
        f"period_s = {PERIOD}\ntimeout_s = {TIMEOUT}\n{more}\n"
    )


def sections():
    for protocol, addresses in ADDRESSES.items():
        for (name, role, kind, more, _), address in zip(KINDS, addresses):
            kind = "f64" if address == "MAIN.double" else kind
            yield section(f"{protocol} {name}", role, SOURCES[protocol], address, kind, more)


class Peer:
    def __init__(self, protocol):
        self.protocol = protocol
        self.held = {"clamped": True, "present": True, "raw": 215, "exact": 21.5, "swapped": 1.25}
        self.begin()

    def begin(self):
        self.process = kit.Process(
            sys.executable, "-B", ROOT / "tests/interop/signals/peer.py", self.protocol, PORTS[self.protocol], stdin=subprocess.PIPE, apart=True,
        )
        self.answers()
        self.hold()

    def answers(self):
        line = self.process.line()
        assert line == "ready\n", (self.protocol, line, self.process.errors)

    def hold(self, **values):
        self.held |= values
        self.process.say(json.dumps(self.held))
        self.answers()

    def kill(self):
        self.process.kill()


class Reading:
    """A reading, from the message of ROS 2 that holds it."""

    def __init__(self, message):
        (status,) = message.status
        held = {pair.key: pair.value for pair in status.values}
        self.header, self.name, self.text, self.unit = message.header, status.name, status.message, held["unit"]
        self.valid = status.level == 0
        self.value = float(held["value"]) if self.valid else None
        assert ("value" in held) == self.valid and status.hardware_id in set(SOURCES.values()), status


class Heard:
    """Messages of the cell by topic, with the instant of their arrival, s."""

    TYPES = {
        "signals": "diagnostic_msgs/msg/DiagnosticArray", "machine_state": "probecell_msgs/msg/MachineState",
        "faults": "probecell_msgs/msg/Fault", "part_reports": "probecell_msgs/msg/PartReport",
    }

    def __init__(self, opened):
        self.changed = threading.RLock()
        self.messages = {name: [] for name in self.TYPES}
        self.subscriber = opened.declare_subscriber("0/turn_mill/**", self.take)

    def take(self, sample):
        parts = str(sample.key_expr).split("/")
        topic = parts[-3]
        if sample.attachment is None or topic not in self.TYPES or parts[-4] not in ("turn_mill", "machine_state"):
            return
        message = MESSAGES.decode(bytes(sample.payload), self.TYPES[topic])
        if topic == "signals":
            message = Reading(message)
        with self.changed:
            self.messages[topic].append((time.time(), message))
        kit.happened()

    def wait(self, topic, what, holds, begin=0):
        """The first message from that number on for which it holds."""
        def found():
            with self.changed:
                return next((one for one in self.messages[topic][begin:] if holds(one[1])), None)

        return kit.until(what, found)

    def count(self, topic):
        with self.changed:
            return len(self.messages[topic])


def stamp(message):
    return message.header.stamp.sec + message.header.stamp.nanosec * 1e-9


def asked(*words):
    return kit.run(PROGRAM, *words, folder=WORK)


def ordered(part):
    """A part; one that was stopped before holds the orders."""
    asked("orders", "resume", "--cell", "cell.toml")
    asked("run", part, "--cell", "cell.toml")


def cell_file(more, name="cell.toml"):
    text = (ROOT / "launch-scripts" / "turn_mill.toml").read_text(encoding="utf-8")
    shutil.copy(ROOT / "launch-scripts" / "turn_mill.urdf", WORK)
    (WORK / name).write_text(text + more, encoding="utf-8")
    return name


@contextlib.contextmanager
def cell(name):
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", '["tcp/127.0.0.1:7447"]')
    config.insert_json5("connect/timeout_ms", str(round(1000 * kit.patience(30))))
    config.insert_json5("scouting/multicast/enabled", "false")
    with kit.Process(PROGRAM, "up", name, "--no-dashboard", folder=WORK, apart=True) as up:
        up.says("is ready")
        with zenoh.open(config) as opened:
            heard = Heard(opened)
            heard.up = up
            yield heard
        up.end(signal.SIGINT)
    assert not readers(), "the program that reads the signals ends with the cell"


def readers():
    """Numbers of the processes that read the signals."""
    found = []
    for one in kit.processes():
        with contextlib.suppress(OSError):
            if pathlib.Path(f"/proc/{one}/comm").read_text(encoding="utf-8").strip() == "probecell-plc":
                found.append(one)
    return found


def values_arrive(heard, peers):
    """Each value equals what the peer holds, in its unit, stamped when it was read."""
    for held in ({}, {"raw": -123, "exact": -0.1, "swapped": 3.3}, {"raw": 321, "exact": 1e-3, "swapped": -7.75}):
        for protocol, peer in peers.items():
            before, begin, load = time.time(), heard.count("signals"), kit.Load()
            peer.hold(**held)
            for name, *_, value in KINDS:
                expected = value(peer.held[name]) if (protocol, name) != ("ads", "swapped") else peer.held[name] * 1e5 - 100.0
                arrived, reading = heard.wait(
                    "signals", f"{protocol} {name} = {expected}",
                    lambda one: one.name == f"{protocol} {name}" and one.valid and one.value == expected, begin,
                )
                assert reading.unit == UNITS[name], reading
                # What has not changed may have been read before.
                assert (name not in held or before <= stamp(reading)) and stamp(reading) <= arrived, reading
                assert arrived < stamp(reading) + load.allows(LATE), (arrived - stamp(reading), load.allows(LATE), reading)


def temperatures_are_of_the_machine(heard, peers):
    state = heard.wait("machine_state", "temperatures", lambda _: True, heard.count("machine_state"))[1]
    known = dict(zip(state.temperature_names, state.temperatures))
    for protocol, peer in peers.items():
        assert known[f"{protocol} raw"] == peer.held["raw"] * 0.1, (known, peer.held)
        assert f"{protocol} swapped" not in known
    assert "part" in known, "the machine's own temperatures"


def fault(heard, code, name, begin, holds=lambda _: True):
    def is_it(one):
        return one.code == code and f'"{name}"' in one.text and holds(one)

    return heard.wait("faults", f"{code} of {name}", is_it, begin)


def last_reading(heard, name):
    """When a signal was last read, s, and whether reading it has failed since."""
    with heard.changed:
        readings = [one for _, one in heard.messages["signals"] if one.name == name]
    return max(stamp(one) for one in readings if one.valid), not readings[-1].valid


def interlocks_refuse(heard, peers):
    """An open clamping and a part that is not there refuse, each by its own controller; while the part is made they stop it."""
    for number, (protocol, name, words) in enumerate([
        ("s7", "clamped", "the clamping is open"), ("modbus", "present", "no part is present"), ("ads", "clamped", "the clamping is open"),
    ]):
        begin, faults = heard.count("signals"), heard.count("faults")
        peers[protocol].hold(**{name: False})
        heard.wait("signals", "it is open", lambda one: one.name == f"{protocol} {name}" and one.valid and one.value == 0.0, begin)
        # Between parts that is no fault.
        assert not [one for _, one in heard.messages["faults"][faults:] if one.code == "interlock_open"]
        ordered(f"open{number}")
        report = heard.wait("part_reports", "the refusal", lambda one: one.part_id == f"open{number}")[1]
        assert report.verdict == 2 and words in report.text and f'"{protocol} {name}"' in report.text, report
        begin = heard.count("signals")
        peers[protocol].hold(**{name: True})
        heard.wait("signals", "it is closed", lambda one: one.name == f"{protocol} {name}" and one.valid and one.value == 1.0, begin)
    begin, first = heard.count("faults"), heard.count("machine_state")
    run = threading.Thread(target=ordered, args=("opened",))
    run.start()
    heard.wait("machine_state", "the machine works", lambda one: one.execution == 1, first)
    load = kit.Load()
    peers["s7"].hold(clamped=False)
    opened = time.time()
    arrived, raised = fault(heard, "interlock_open", "s7 clamped", begin)
    allowed = load.allows(PERIOD + LATE)
    assert raised.severity == 1 and arrived - opened < allowed, (arrived - opened, allowed, raised)
    report = heard.wait("part_reports", "its end", lambda one: one.part_id == "opened")[1]
    assert report.verdict == 2 and "the clamping is open" in report.text, report
    run.join()
    peers["s7"].hold(clamped=True)
    print(f"  {report.text}", flush=True)


def a_server_dies_and_returns(heard, peers):
    lates = []  # of each signal, beyond what the load explains
    for protocol, peer in peers.items():
        for how in ("killed", "silent", "killed"):
            begin, load = heard.count("faults"), kit.Load()
            if how == "killed":
                peer.kill()
            else:
                peer.process.send(signal.SIGSTOP)
            for name, role, *_ in KINDS:
                code = "interlock_lost" if role in ("clamping_closed", "part_present") else "signal_lost"
                known = f"{protocol} {name}"

                # A cell that a loaded computer held up for a second may have reported it before, and has read it again since.
                def stands(one, known=known):
                    read, has_failed = last_reading(heard, known)
                    return has_failed and stamp(one) > read

                last = fault(heard, code, known, begin, stands)[1]
                age = stamp(last) - last_reading(heard, known)[0]
                assert TIMEOUT < age < load.allows(TIMEOUT + HELD_UP), (known, how, age, load.allows(TIMEOUT + HELD_UP))
                lates.append(age - load.allows(TIMEOUT + LATE))
            heard.wait("machine_state", "an alarm", lambda one: any(f'"{protocol} clamped"' in text for text in one.alarms),
                       heard.count("machine_state"))
            begin = heard.count("part_reports")
            ordered(f"{protocol}_{how}")
            report = heard.wait("part_reports", "the refusal", lambda _: True, begin)[1]
            assert f'"{protocol} clamped" has not been read for 1 s' in report.text, report
            if how == "killed":
                peer.begin()
            else:
                peer.process.send(signal.SIGCONT)
            begin = heard.count("machine_state")
            heard.wait("machine_state", f"{protocol} heals", lambda one: not any(f'"{protocol} ' in text for text in one.alarms), begin)
        print(f"  {protocol}: {last.text}", flush=True)
    assert statistics.median(lates) < 0, sorted(lates)


def limits_are_watched(heard, peers):
    begin = heard.count("faults")
    peers["modbus"].hold(raw=601)
    raised = fault(heard, "signal_out_of_range", "modbus raw", begin)[1]
    assert raised.severity == 0 and raised.text == 'signal "modbus raw" is 60.1 degC, above 60 degC', raised
    peers["modbus"].hold(raw=200)


def a_reader_dies_and_returns(heard, _peers):
    """The process of the signals says why it ends, and both are started again."""
    (reader,) = readers()
    os.kill(reader, signal.SIGKILL)
    killed = time.time()
    for words in ("probecell-plc, which reads the signals, has ended (signal: 9", "signals ended (exit status: 1); restarting it"):
        kit.until(words, lambda words=words: words in heard.up.errors)
    for protocol in SOURCES:
        heard.wait("signals", f"{protocol} is read again", lambda one, name=f"{protocol} raw": one.name == name and one.valid and stamp(one) > killed)
    assert len(readers()) == 1 and readers() != [reader]


def without_its_program():
    """A cell with signals is refused where the program is missing that reads them, and the check of the installation says so."""
    alone = WORK / "alone" / "probecell"
    alone.parent.mkdir()
    shutil.copy(PROGRAM, alone)
    name = cell_file("".join(sections()), "alone.toml")
    words = "probecell-plc is neither in the folder of this program nor on PATH: `cargo build --release -p probecell_plc` in the folder neighbours builds it"
    nowhere = os.environ | {"PATH": "/usr/bin"}
    status, _, told = kit.run(alone, "up", name, "--once", folder=WORK, environment=nowhere)
    assert status == 2 and told == f"probecell: {name}: [[signals]]: {words}\n", (status, told)
    assert not (WORK / "recordings").exists(), "nothing has begun"
    status, told, _ = kit.run(alone, "doctor", name, folder=WORK, environment=nowhere)
    assert status == 2 and f"WRONG  [[signals]]: {words}\n" in told, (status, told)
    alone.unlink()


def wrong_addresses():
    """The check of the installation names signal, address and source; what cannot be an address is refused with the cell file."""
    for protocol, address, words in [
        ("modbus", "input:999", "Illegal data address"), ("s7", "DB9.DBD0", "not found"), ("s7", "DB1.DBD100", "address"),
        ("ads", "MAIN.nothing", "receiving reply"),
    ]:
        source = SOURCES[protocol]
        name = cell_file(section("astray", "temperature", source, address, "f32"), "astray.toml")
        status, told, _ = asked("doctor", name)
        (line,) = [line for line in told.splitlines() if line.startswith("WRONG") and source in line]
        assert status == 1 and address in line and words.lower() in line.lower(), line
        print(f"  {line}", flush=True)
    for source, address, kind, words in [
        (SOURCES["modbus"], "register 5", "f32", "is no address of Modbus"),
        (SOURCES["s7"], "DB1.DBX0.3", "f32", "its type is bool, not f32"),
        ("opc://127.0.0.1", "x", "f32", "there are modbus, s7, ads"),
    ]:
        name = cell_file(section("astray", "temperature", source, address, kind), "astray.toml")
        status, _, told = asked("up", name, "--once")
        assert status == 2 and "astray" in told and words in told and told.count("\n") == 1, told


def main(folder):
    global WORK
    WORK = folder
    peers = {protocol: Peer(protocol) for protocol in SOURCES}
    without_its_program()
    wrong_addresses()
    astray = section("astray", "value", SOURCES["s7"], "DB9.DBD0", "f32", 'unit = "V"')
    name = cell_file("".join(sections()) + astray)
    _, told, _ = asked("doctor", "cell.toml")
    for protocol in ("modbus", "ads"):
        (line,) = [line for line in told.splitlines() if SOURCES[protocol] in line]
        assert line.startswith("good") and f"{protocol} raw = 21.5 degC" in line, line
    with cell(name) as heard:
        values_arrive(heard, peers)
        temperatures_are_of_the_machine(heard, peers)
        # What is astray does not keep the others from being read.
        reading = heard.wait("signals", "what is astray", lambda one: one.name == "astray")[1]
        assert not reading.valid and f"DB9.DBD0 of {SOURCES['s7']}" in reading.text, reading
        interlocks_refuse(heard, peers)
        limits_are_watched(heard, peers)
        a_server_dies_and_returns(heard, peers)
        a_reader_dies_and_returns(heard, peers)
    (recording,) = (WORK / "recordings").iterdir()
    status, told, _ = asked("replay", recording)
    assert status == 0, told
    print(told.splitlines()[-1])


kit.main({"signals": main})
