#!/usr/bin/env python3
"""What the command line does beside a running cell: processes that are killed, recordings that are played, access control.

    live.py PROBECELL [CHECK...]

Each check has a network namespace of its own. The witness on the bus is eclipse-zenoh; nothing of ours reads for it.
"""

import collections
import contextlib
import itertools
import json
import os
import pathlib
import random
import re
import shutil
import signal
import socket
import struct
import sys
import time
import urllib.error
import urllib.request

import zenoh
from mcap.reader import make_reader

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "tests"))
import kit  # noqa: E402
from kit import until  # noqa: E402
from kit.recordings import decoded, raw  # noqa: E402

CELL = ROOT / "launch-scripts" / "turn_mill.toml"
LONG = 60.0  # s, of a cut in which something happens
STRING = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"  # std_msgs/msg/String, of every distribution
REFUSED = 2.0  # s, after which a question without an answer is taken for refused
NOBODY = (65534, 65534)  # user and group without rights
ASKING = {"run_requests", "operation_requests", "controller_commands", "plan_requests", "approvals", "stop_requests", "order_requests"}
FORBIDDEN = """
[bus.router_zenoh.access_control]
enabled = true
default_permission = "allow"
rules = [{ id = "no_parts", permission = "deny", flows = ["ingress", "egress"], messages = ["put"],
           key_exprs = ["0/turn_mill/run_requests/**"] }]
subjects = [{ id = "everybody" }]
policies = [{ rules = ["no_parts"], subjects = ["everybody"] }]
"""


def started(*words, folder, **how):
    return kit.Process(BINARY, *words, folder=folder, apart=True, **how)


def asked(*words, folder):
    return kit.run(BINARY, *words, folder=folder)


def kept(name):
    """A folder of the user of a check: `config` with the keys, `state` with the private sockets."""
    return pathlib.Path(os.environ[f"XDG_{name.upper()}_HOME"])


def recorded(folder):
    """Messages on disk of each topic of the one recording in a folder, finished or not."""
    for recording in (folder / "recordings").glob("*"):
        _, output, _ = asked("info", recording, "--json", folder=folder)
        if output:
            return {topic["topic"].removeprefix("/turn_mill/"): topic["messages"] for topic in json.loads(output)["topics"]}
    return {}


def own_cell(folder, edit=lambda text: text, cut_s=2.0):
    """The turn-mill in a folder of its own, with a first cut of so many seconds."""
    text = CELL.read_text()
    assert "duration_s = 2.0" in text
    (folder / "cell.toml").write_text(edit(text.replace("duration_s = 2.0", f"duration_s = {cut_s}", 1)))
    (folder / "turn_mill.urdf").write_text((CELL.parent / "turn_mill.urdf").read_text())
    return folder / "cell.toml"


def status(cell, folder):
    code, output, errors = asked("status", "--json", "--cell", cell, folder=folder)
    assert output, (code, errors)
    return json.loads(output)


@contextlib.contextmanager
def cell_that_is_ready(cell, folder, more=(), **how):
    with started("up", cell, *more, folder=folder, **how) as up:
        line = up.line()
        assert "is ready" in line, (line, up.errors)
        yield up


def dashboard_of(up):
    """Address of the dashboard that a cell has started, and what gives a page of it."""
    until("the dashboard", lambda: re.search(r"dashboard: http://\S+/", up.errors))
    (address,) = re.findall(r"dashboard: (http://\S+)/", up.errors)

    def page(path, **more):
        with urllib.request.urlopen(urllib.request.Request(address + path, **more), timeout=kit.patience(60)) as answer:
            return answer.read().decode()

    return address, page


def part_is_asked_for(cell, folder):
    # Two requests: a part that was stopped before holds the orders.
    asked("orders", "resume", "--cell", cell, folder=folder)
    code, output, errors = asked("run", "punch", "--cell", cell, folder=folder)
    assert code == 0, (output, errors)


def part_is_good(up):
    line = up.says("part punch: ")
    assert "qualified" in line, (line, up.errors)


def cutting(cell, folder):
    part_is_asked_for(cell, folder)
    until("a cut", lambda: (status(cell, folder)["part"] or {}).get("stage") == "cutting")


@contextlib.contextmanager
def client(**more):
    """A session of eclipse-zenoh at the router of the cell."""
    config = zenoh.Config()
    settings = {
        "mode": "client", "connect/endpoints": ["tcp/127.0.0.1:7447"], "connect/timeout_ms": round(1000 * kit.patience(30)),
        "scouting/multicast/enabled": False,
    }
    for key, value in (settings | more).items():
        config.insert_json5(key, json.dumps(value))
    with zenoh.open(config) as session:
        yield session


@contextlib.contextmanager
def samples_of_the_driver(name="turn_mill"):
    """Stamps, s, of the driver's last sample that says that a program runs, and of its last one: by its own clock, whenever they arrive."""
    seen = {"running": 0.0, "any": 0.0}

    def text(data, at):
        at = (at + 3) & ~3
        (length,) = struct.unpack_from("<I", data, at)
        return at + 4 + length

    def hear(sample):
        data = bytes(sample.payload)[4:]
        seconds, nanoseconds = struct.unpack_from("<iI", data)
        after = text(data, text(data, 8))  # stamp, frame, session
        seen["any"] = seconds + nanoseconds * 1e-9
        if data[after + 1] == 1:  # mode, execution
            seen["running"] = seen["any"]
        kit.happened()

    with client() as session:
        session.declare_subscriber(f"0/{name}/controller_status/**", hear)
        yield seen


def every_process_of_a_cell_is_confined(folder):
    """By what the kernel says of each; what it then refuses is tried in crates/confinement/tests/kernel.rs."""
    cell = own_cell(folder)
    with cell_that_is_ready(cell, folder) as up:
        children = pathlib.Path(f"/proc/{up.pid}/task/{up.pid}/children").read_text().split()
        assert len(children) > 10, children
        for process in [up.pid, *children]:
            # Of every thread: those of the bus begin after the first.
            for thread in pathlib.Path(f"/proc/{process}/task").iterdir():
                try:
                    told = dict(line.split(":", 1) for line in (thread / "status").read_text().splitlines())
                except (FileNotFoundError, ProcessLookupError):
                    continue  # it has ended since
                assert (told["Seccomp"].strip(), told["NoNewPrivs"].strip()) == ("2", "1"), (process, told["Name"], told["Seccomp"])
    (bag,) = (folder / "recordings").glob("*")
    table = json.loads(asked("info", bag, "--json", folder=folder)[1])["metadata"]["probecell"]
    assert "seccomp" in table["confinement"], table
    faults = recorded(folder).get("launcher/faults", 0)
    assert faults == (0 if "Landlock" in table["confinement"] else 1), (table, faults)


def a_machine_stops_when_its_gate_is_paused(folder):
    cell = own_cell(folder, cut_s=LONG)
    with cell_that_is_ready(cell, folder) as up, samples_of_the_driver() as seen:
        cutting(cell, folder)
        until("samples", lambda: seen["running"] > 0)
        with kit.paused(kit.child(up.pid, "node", "machine_state")):
            begun, load = time.time(), kit.Load()
            until("a machine that stands", lambda: seen["any"] - max(seen["running"], begun) > 1)
            # A driver that does not look after its gate would cut to the end.
            stopped, allowed = seen["running"] - begun, load.allows(4.0)
            assert stopped < min(allowed, LONG / 2), (stopped, allowed)


def an_operator_stops_a_part_and_ctrl_c_the_cell(folder):
    cell = own_cell(folder, cut_s=LONG)
    with cell_that_is_ready(cell, folder) as up:
        cutting(cell, folder)
        code, output, errors = asked("recording", "stop", "--cell", cell, folder=folder)
        assert code == 1 and "is being made" in output, (code, output, errors)
        code, output, errors = asked("stop", "--operator", "Ada", "--cell", cell, folder=folder)
        assert code == 0 and "stands" in output, (code, output, errors)
        until("no part", lambda: status(cell, folder)["part"] is None)
        # The only cell that runs is meant from any folder, and says how its last part ended.
        code, output, errors = asked("status", folder="/")
        assert code == 0 and "machine: idle" in output, (code, output, errors)
        assert "part: none; the last, punch: stopped" in output, output
        cutting(cell, folder)
        up.send(signal.SIGINT)
        code, output, errors = up.ended()
    assert code == 0 and output.count("part punch: stopped") == 2, (code, output)
    (bag,) = (folder / "recordings").glob("*")
    assert recorded(folder)["part_reports"] == 2 and recorded(folder)["stop_requests"] == 2, recorded(folder)
    code, output, errors = asked("replay", bag, folder=folder)
    assert code == 0, (output, errors)


def corrections_are_approved_by_signature_and_a_withdrawn_key_is_refused(folder):
    def edit(text):
        return text.replace("automatic_approval = true", "automatic_approval = false")

    cell = own_cell(folder, edit)
    for name in ("ada", "grace"):
        code, output, errors = asked("key", "new", name, "--cell", cell, folder=folder)
        assert code == 0, (output, errors)
    secret = kept("config") / "probecell" / "operators" / "ada.key"
    assert secret.stat().st_mode & 0o777 == 0o600
    with cell_that_is_ready(cell, folder) as up:
        part_is_asked_for(cell, folder)
        waiting = []
        while len(waiting) < 2:
            line = up.line()
            assert line, "the cell has ended"
            waiting += re.findall(r"probecell approve (\S+) --operator", line)
        awaited = lambda text: all(f"waits for approval: probecell approve {one} --operator NAME --cell {cell}" in text for one in waiting)
        until("a status that names what waits", lambda: awaited(asked("status", "--cell", cell, folder=folder)[1]))
        assert sorted(status(cell, folder)["part"]["waiting_for_approval"]) == sorted(waiting)
        approve = lambda name, one: asked("approve", one, "--operator", name, "--cell", cell, folder=folder)
        code, output, errors = approve("nobody", waiting[0])
        assert code == 2 and "probecell key new nobody --cell CELL.toml" in errors, (code, output, errors)
        assert asked("key", "revoke", "grace", "--cell", cell, folder=folder)[0] == 0
        # The launcher tells the cell of it.
        until("a second list of operators", lambda: recorded(folder).get("operator_keys", 0) == 2)
        code, output, errors = approve("grace", waiting[0])
        assert code == 1 and "the key of grace was withdrawn" in output, (code, output, errors)
        # A key that is made while the cell runs.
        assert asked("key", "new", "lise", "--cell", cell, folder=folder)[0] == 0
        until("a third list of operators", lambda: recorded(folder).get("operator_keys", 0) == 3)
        for name, one in zip(("ada", "lise"), waiting):
            code, output, errors = approve(name, one)
            assert code == 0 and one in output and "accepted" in output, (code, output, errors)
        until("corrections that are written", lambda: recorded(folder).get("correction_acknowledgements", 0) >= 2)
        secret.chmod(0o644)
        code, output, errors = approve("ada", waiting[0])
        assert code in (1, 2), (code, output, errors)
    (bag,) = (folder / "recordings").glob("*")
    private = [one.read_text().strip() for one in kept("config").glob("probecell/**/*.key")]
    assert len(private) >= 4, private
    content = b"".join(one.read_bytes() for one in bag.iterdir())
    for key in private:
        assert key.encode() not in content and bytes.fromhex(key) not in content
    code, output, errors = asked("replay", bag, folder=folder)
    assert code == 0, (output, errors)


def a_paused_cycle_starts_nothing_late(folder):
    cell = own_cell(folder, cut_s=LONG)
    with cell_that_is_ready(cell, folder) as up:
        with kit.paused(kit.child(up.pid, "node", "cycle")):
            code, output, errors = asked("run", "punch", "--cell", cell, folder=folder)
            assert code == 1 and "no node answered" in output + errors, (code, output, errors)
        until("an answer of cycle", lambda: recorded(folder).get("order_replies", 0) == 1)
        assert status(cell, folder)["part"] is None
        assert recorded(folder).get("operation_requests", 0) == 0
        cutting(cell, folder)


def the_same_cell_is_not_started_twice_and_another_outlives_its_router(folder):
    first, second = folder / "first", folder / "second"
    for one in (first, second):
        one.mkdir()
    cell = own_cell(first)
    other = own_cell(second, lambda text: text.replace('name = "turn_mill"', 'name = "other"', 1))
    with cell_that_is_ready(cell, first) as up:
        code, output, errors = asked("up", cell, folder=first)
        assert code == 2 and "runs on this bus already" in errors, (code, output, errors)
        assert len(list((first / "recordings").glob("*"))) == 1
        with cell_that_is_ready(other, second) as survivor:
            code, output, errors = asked("stop", folder="/")
            assert code == 2 and f"other (--cell {other.resolve()}), turn_mill (--cell {cell.resolve()})" in errors, (code, errors)
            up.kill()
            until("a router", lambda: asked("status", "--cell", other, folder=second)[0] == 0)
            # The one that is left is meant, and told.
            code, output, errors = asked("status", folder="/")
            assert "machine: " in output and errors.startswith(f"cell other, {other.resolve()}"), (code, output, errors)
            # The gate hears the machine through the new router.
            heard = lambda: recorded(second).get("/other/joint_states", 0)
            before = heard()
            until("two seconds of samples", lambda: heard() > before + 200)
            os.kill(kit.child(survivor.pid, "node", "probe_events"), signal.SIGKILL)
            told = lambda: {one["name"]: (one["running"], one["starts"]) for one in status(other, second)["processes"]}
            until("a second process", lambda: told()["probe_events"] == (True, 2))
            # While no process was the router, the gate may have heard no sample for a second: that holds the orders.
            part_is_asked_for(other, second)
            until("a touch", lambda: recorded(second).get("/other/probe_events", 0) > 0)


def a_wall_clock_set_back_is_a_recorded_fault(folder):
    library = next(iter(pathlib.Path("/usr/lib").glob("*/faketime/libfaketime.so.1")), None)
    assert library, "libfaketime is not installed"
    cell, clock = own_cell(folder), folder / "clock"
    clock.write_text("+0\n")
    environment = os.environ | {
        "LD_PRELOAD": str(library), "FAKETIME_TIMESTAMP_FILE": str(clock), "FAKETIME_NO_CACHE": "1",
        "FAKETIME_DONT_FAKE_MONOTONIC": "1", "DONT_FAKE_MONOTONIC": "1",
    }
    with cell_that_is_ready(cell, folder, environment=environment) as up:
        part_is_asked_for(cell, folder)
        until("a touch", lambda: recorded(folder).get("probe_events", 0) > 0)
        clock.write_text("-3600\n")
        until("a fault", lambda: recorded(folder).get("launcher/faults", 0) >= 1)
        part_is_good(up)
        assert any(re.search(r"clock_set: .* \(\d+ (s|min) ago\)$", fault) for fault in status(cell, folder)["faults"])


def killed_while_a_part_is_made(folder, name):
    with started("up", CELL, "--once", folder=folder) as up:
        until("a touch", lambda: recorded(folder).get("probe_events", 0) > 0)
        os.kill(kit.child(up.pid, "node", name), signal.SIGKILL)
        return up.ended()


def the_part_of_a_killed_cycle_is_reported(folder):
    status, output, errors = killed_while_a_part_is_made(folder, "cycle")
    assert status == 1 and "cycle was restarted while the part was made" in output, (status, output, errors)
    assert recorded(folder)["part_reports"] == 1


def a_killed_gate_stops_the_part(folder):
    status, output, errors = killed_while_a_part_is_made(folder, "machine_state")
    assert status == 1 and "stopped" in output and "machine_state ended" in output, (status, output, errors)
    (bag,) = (folder / "recordings").glob("*")
    _, output, _ = asked("replay", bag, "--json", folder=folder)
    topics = json.loads(output)["replay"]["topics"]
    assert sum(topic["different"] for topic in topics) == 0, output


def a_killed_launcher_leaves_nothing_that_holds_commands_up(folder):
    """Its socket is there, nobody answers on it: commands say so, and the cell is started again."""
    cell = own_cell(folder, cut_s=LONG)
    for _ in range(2):
        with cell_that_is_ready(cell, folder) as up:
            cutting(cell, folder)
            children = pathlib.Path(f"/proc/{up.pid}/task/{up.pid}/children").read_text().split()
            up.kill()
            until("the end of its processes", lambda: not any(pathlib.Path(f"/proc/{child}").exists() for child in children))
        assert list(kept("state").glob("probecell/bus/*.socket"))
        begun = time.monotonic()
        code, output, errors = asked("status", "--cell", cell, folder=folder)
        print(f"    a command without a cell ends after {time.monotonic() - begun:.1f} s", flush=True)
        assert code == 1 and "no router answers" in errors, (code, output, errors)


def a_disk_that_fails_stops_the_part_and_the_cell(folder):
    """Every sync of the recorder fails with EIO while a part is cut: the failure is told, and what was synced before is there."""
    cell = own_cell(folder, cut_s=LONG)
    with cell_that_is_ready(cell, folder) as up:
        cutting(cell, folder)
        recorder = kit.child(up.pid, "record")
        before = recorded(folder)
        syncs = "trace=fsync,fdatasync"
        kit.run("strace", "-f", "-qq", "-o", "/dev/null", "-e", syncs, "-e", "inject=fsync,fdatasync:error=EIO", "-p", recorder)
        code, output, errors = up.ended()
    assert code == 1 and "part punch: stopped" in output, (code, output, errors)
    assert "Input/output error" in errors and "must not run unrecorded" in errors, errors
    after = recorded(folder)
    assert after["order_requests"] == 2 and all(after[topic] >= count for topic, count in before.items()), (before, after)


def a_recording_that_is_taken_away_stops_the_part_and_is_kept(folder):
    """Removed, replaced or moved while a part is cut: the cell says so within seconds, ends, and what was recorded can be read."""
    changes = {
        "removed": lambda bag, away: shutil.rmtree(bag),
        "replaced": lambda bag, away: shutil.copy(CELL, away) and os.replace(away, next(bag.glob("*.mcap"))),
        "moved": lambda bag, away: bag.rename(away),
    }
    for what, change in changes.items():
        place = folder / what
        place.mkdir()
        cell = own_cell(place, cut_s=LONG)
        with cell_that_is_ready(cell, place) as up:
            cutting(cell, place)
            until("a second of samples", lambda: recorded(place).get("controller_status", 0) > 10)
            (bag,) = (place / "recordings").glob("*")
            change(bag, place / "away")
            code, output, errors = up.ended()
        assert code == 1 and "part punch: stopped" in output, (what, code, output, errors)
        assert f"the recording was {'moved' if what == 'moved' else 'removed'} while it was written" in errors, (what, errors)
        assert "must not run unrecorded" in errors, (what, errors)
        kept = place / "away" if what == "moved" else bag.with_name(f"{bag.name}_kept")
        code, output, errors = asked("info", kept, "--json", folder=place)
        topics = {topic["topic"]: topic["messages"] for topic in json.loads(output)["topics"]}
        assert topics["/turn_mill/order_requests"] == 2 and topics["/turn_mill/controller_status"] > 10, (what, topics, errors)


def a_disk_that_goes_while_a_part_is_cut_stops_the_part(folder):
    """Unplugged, mounted read-only after an error, unmounted, its quota used: the cell says so and ends, and what was synced is on the disk."""
    changes = {
        "unplugged": (kit.Disk.unplug, "Input/output error"), "erring": (kit.Disk.err, "Read-only file system"),
        "unmounted": (kit.Disk.unmount, "the recording was moved"), "quota": (kit.Disk.limit, "Disk quota exceeded"),
    }
    kit.own_mounts()
    for what, (change, said) in changes.items():
        place = folder / what
        place.mkdir()
        with contextlib.closing(kit.Disk("quota" if what == "quota" else "loop", place / "recordings")) as disk:
            cell = own_cell(place, cut_s=LONG)
            with cell_that_is_ready(cell, place) as up:
                cutting(cell, place)
                until("both requests", lambda: recorded(place).get("order_requests") == 2)
                before = recorded(place)
                # What follows is written once that has been synced.
                until("more", lambda: recorded(place)["controller_status"] > before["controller_status"])
                change(disk)
                code, output, errors = up.ended()
            assert code == 1 and "part punch: stopped" in output, (what, code, output, errors)
            assert said in errors and "must not run unrecorded" in errors, (what, errors)
            disk.mount_again()
            after = recorded(place)
        assert all(after[topic] >= count for topic, count in before.items()), (what, before, after)


def a_folder_that_may_not_be_written_any_more_stops_the_part(folder):
    """As a user without rights: his folder is closed while a part is cut, to him or for writing. What was recorded is on the disk."""
    places, program = {}, shutil.copy(BINARY, folder / "probecell")
    for what in (0o500, 0o000):
        places[what] = folder / f"{what:o}"
        places[what].mkdir()
        own_cell(places[what], cut_s=LONG)
    for path in (folder, *folder.rglob("*")):
        os.chown(path, *NOBODY)
    os.setgroups([])
    os.setgid(NOBODY[1])
    os.setuid(NOBODY[0])
    globals()["BINARY"] = str(program)
    for what, place in places.items():
        cell = place / "cell.toml"
        with cell_that_is_ready(cell, place) as up:
            cutting(cell, place)
            (bag,) = (place / "recordings").glob("*")
            until("both requests", lambda: recorded(place).get("order_requests") == 2)
            before, begun = recorded(place), time.monotonic()
            bag.chmod(what)
            code, output, errors = up.ended()
        assert time.monotonic() - begun < kit.patience(LONG / 2), "it went on until the cut had ended"
        assert code == 1 and "part punch: stopped" in output, (what, code, output, errors)
        assert "Permission denied" in errors and "must not run unrecorded" in errors, (what, errors)
        bag.chmod(0o700)
        after = recorded(place)
        assert all(after[topic] >= count for topic, count in before.items()), (what, before, after)


def a_disk_that_does_not_answer_holds_orders_up_and_loses_nothing(folder):
    kit.own_mounts()
    with contextlib.closing(kit.Disk("loop", folder / "recordings")) as disk:
        cell = own_cell(folder)
        of_recording = lambda: status(cell, folder)["recording"]["state"]
        with cell_that_is_ready(cell, folder) as up:
            disk.hang(True)
            try:
                until("a word of the disk", lambda: of_recording() == "the disk does not answer")
                part_is_asked_for(cell, folder)
                line = up.says("part punch: ")
                assert "stopped" in line and "the disk of the recording does not answer" in line, line
            finally:
                disk.hang(False)
            until("a recording", lambda: of_recording() == "recording")
            part_is_asked_for(cell, folder)
            until("a touch", lambda: recorded(folder).get("probe_events", 0) > 0)
            up.send(signal.SIGINT)
            code, output, errors = up.ended()
        assert re.search("does not answer for 2.5 s.*answers again", errors, re.DOTALL), (code, output, errors)
        (bag,) = (folder / "recordings").glob("turn_mill*")
        code, output, errors = asked("info", "--verify", bag, folder=folder)
        assert code == 0 and "MISSING" not in output, (output, errors)


def a_dashboard_that_dies_is_started_again(folder):
    cell = own_cell(folder)
    with cell_that_is_ready(cell, folder) as up:
        os.kill(kit.child(up.pid, "dashboard"), signal.SIGKILL)
        until("its end", lambda: "dashboard ended" in up.errors)

        def served():
            (pages,) = [one for one in status(cell, folder)["processes"] if one["name"] == "dashboard"]
            return pages["running"] and pages["starts"] == 2

        until("the dashboard again", served)
        address = re.findall(r"dashboard: (http://\S+)", up.errors)[-1]

        def page():
            try:
                with urllib.request.urlopen(address, timeout=kit.patience(30)) as answer:
                    return "turn_mill" in answer.read().decode()
            except OSError:
                return False

        until("its page", page)
        part_is_asked_for(cell, folder)
        part_is_good(up)


def a_part_on_simulated_time_is_the_same_part(folder):
    said, span = {}, {}
    for speed in ("real", "max"):
        own = folder / speed
        own.mkdir()
        words = () if speed == "real" else ("--speed", speed)
        code, output, errors = asked("up", CELL.parent / "ball_check.toml", "--once", "--no-dashboard", *words, folder=own)
        assert code == 0, (speed, output, errors)
        said[speed] = [line for line in output.splitlines() if not line.startswith("recorded in ")]
        (bag,) = (own / "recordings").glob("*")
        span[speed] = json.loads(asked("info", bag, "--json", folder=own)[1])["duration_ns"]
        code, output, errors = asked("replay", bag, folder=own)
        assert code == 0, (speed, output, errors)
    assert said["real"] == said["max"], said
    # Nobody waits for a simulated machine, but on its own clock it takes its time; planning takes none there.
    assert 0.5 * span["real"] < span["max"] < 1.5 * span["real"], span


def a_cell_on_simulated_time_is_supervised(folder):
    cell = own_cell(folder, cut_s=LONG)
    with cell_that_is_ready(cell, folder, more=("--speed", "20")) as up, client() as session:
        clocks = []

        def hear(sample):
            clocks.append(struct.unpack_from("<iI", sample.payload.to_bytes(), 4))
            kit.happened()

        session.declare_subscriber("0/clock/**", hear)
        cutting(cell, folder)
        until("a minute of its clock", lambda: clocks and clocks[-1][0] - clocks[0][0] > LONG)
        assert clocks == sorted(clocks), "the clock went back"
        part_is_good(up)
        cutting(cell, folder)
        os.kill(kit.child(up.pid, "node", "cycle"), signal.SIGKILL)
        up.says("cycle was restarted while the part was made")
        # Its operation is nobody's any more, and comes to its end.
        until("a machine that is idle", lambda: "machine: idle" in asked("status", "--cell", cell, folder=folder)[1])
        cutting(cell, folder)
        code, output, errors = asked("stop", "--operator", "Ada", "--cell", cell, folder=folder)
        assert code == 0 and "stands" in output, (code, output, errors)
    code, output, errors = asked("up", CELL.parent / "external.toml", "--speed", "max", folder=folder)
    assert code == 2 and "the time of the real world" in errors, (code, output, errors)


@contextlib.contextmanager
def router(folder):
    with started("router", folder=folder) as process:
        assert "listens on" in process.line()
        yield


@contextlib.contextmanager
def witness():
    """Keys on which anything is heard."""
    keys = set()

    def hear(sample):
        keys.add(str(sample.key_expr))
        kit.happened()

    with client() as session:
        session.declare_subscriber("0/**", hear)
        yield keys


def what_asks_is_not_played(folder, bag):
    counts = json.loads(asked("info", bag, "--json", folder=folder)[1])["topics"]
    there = {one["topic"].removeprefix("/turn_mill/") for one in counts if one["messages"]}
    assert there & ASKING >= {"run_requests", "operation_requests", "controller_commands"}, there
    silent = there & (ASKING | {"kept_orders", "launcher/faults", "operator_keys", "cell_description"})
    with router(folder), witness() as keys:
        # `/diagnostics` is moved below the namespace as well.
        heard = lambda: {key.removeprefix("0/replay").rsplit("/", 2)[0].removeprefix("/turn_mill/") for key in list(keys) if "/@adv/" not in key}
        with started("play", bag, "--rate", "20", folder=folder) as play:
            status, output, errors = play.ended()
        assert status == 0, (output, errors)
        until("every topic that is played", lambda: there - heard() == silent)
        played = heard()
        assert "/diagnostics" in played and not played & ASKING, played


def playing_ends_when_told(folder, bag):
    with router(folder), witness() as keys:
        with started("play", bag, "--rate", "1e6", "--loop", folder=folder) as play:
            until("what is played", lambda: keys)
            assert play.end() == 0


def a_running_cell_keeps_its_names_and_records_on_demand(folder, bag):
    with started("up", CELL, folder=folder) as up:
        assert "turn_mill is ready" in up.line()
        status, output, errors = asked("play", bag, "--namespace", "/", folder=folder)
        assert status == 2 and "is published already" in errors and not output, (status, output, errors)
        until("a recording", lambda: recorded(folder).get("machine_state", 0) > 0)
        for words, status, says in (
            (["stop"], 0, "recorded "), (["stop"], 1, "nothing"), (["start", "again"], 0, "recordings/again"), (["start"], 1, "again"),
        ):
            found, output, errors = asked("recording", *words, "--cell", CELL, folder=folder)
            assert found == status and says in output, (words, found, output, errors)


def access_control_binds_processes_of_one_machine(folder):
    text = CELL.read_text() + FORBIDDEN
    (folder / "cell.toml").write_text(text)
    (folder / "turn_mill.urdf").write_text((CELL.parent / "turn_mill.urdf").read_text())
    status, output, errors = asked("up", folder / "cell.toml", "--once", folder=folder)
    assert status == 1 and "no node answered" in errors and not recorded(folder).get("probe_events"), (status, output, errors)
    assert "is silent about" in errors and "@adv" in errors, errors


def policy():
    """The example of docs/access-policy.md, word for word."""
    (example,) = re.findall(r"```toml\n(.*?)```", (ROOT / "docs" / "access-policy.md").read_text(), re.DOTALL)
    return example


def visitor(user=None, password=None):
    """A session of another program."""
    if not user:
        return client()
    return client(**{"transport/auth/usrpwd/user": user, "transport/auth/usrpwd/password": password})


def nobody_gets_in():
    """A session without a password is not opened; one with it is, at the first attempt."""
    try:
        with client(**{"connect/timeout_ms": round(1000 * kit.patience(REFUSED))}):
            raise AssertionError("a session without a password was opened")
    except zenoh.ZError:
        pass


def is_refused(session, key, **request):
    """A question gets no answer; who may ask has been answered by then."""
    return not any(reply.ok for reply in session.get(key, timeout=kit.patience(REFUSED), **request))


def the_documented_policy_lets_the_cell_work_and_nobody_else_command_it(folder):
    (folder / "cell.toml").write_text(CELL.read_text() + policy())
    (folder / "turn_mill.urdf").write_text((CELL.parent / "turn_mill.urdf").read_text())
    (folder / "users.txt").write_text("cell:secret of the cell\nscreen:secret of the screen\n")
    os.environ["PROBECELL_BUS_PASSWORD"] = "secret of the cell"
    try:
        with started("up", folder / "cell.toml", folder=folder) as up:
            assert "turn_mill is ready" in up.line()
            nobody_gets_in()
            heard, requests = set(), "0/turn_mill/run_requests/probecell_msgs::msg::dds_::OperatorRequest_/x"
            with visitor("screen", "secret of the screen") as screen, visitor("cell", "secret of the cell") as cell:
                screen.declare_subscriber("0/turn_mill/**", lambda sample: heard.add(str(sample.key_expr)))
                inside = set()
                cell.declare_subscriber("0/turn_mill/run_requests/**", lambda sample: inside.add(bytes(sample.payload)))
                until("what the screen may see", lambda: any("/machine_state/" in key for key in heard))
                # What the screen puts is dropped at the router; what the cell's user puts after it is heard.
                screen.put(requests, b"by the screen")
                cell.put(requests, b"by the cell")
                until("what the cell may say", lambda: b"by the cell" in inside)
                screen.put(requests, b"by the screen")
                cell.put(requests, b"the last")
                until("what the cell may say", lambda: b"the last" in inside)
                assert b"by the screen" not in inside, inside
                # A service is a query: answered to the cell's user, never seen by the service when the screen asks.
                who, key = [], "0/turn_mill/asked/by"
                cell.declare_queryable(key, lambda query: (who.append(str(query.parameters)), query.reply(key, b"yes")))
                until("an answer", lambda: any(reply.ok for reply in cell.get(key + "?who=cell")))
                assert is_refused(screen, key + "?who=screen")
                assert who and "who=screen" not in who, who
    finally:
        del os.environ["PROBECELL_BUS_PASSWORD"]
    (bag,) = (folder / "recordings").glob("*")
    assert recorded(folder).get("machine_state", 0) > 0
    told = asked("info", bag, "--json", folder=folder)[1]
    assert "PROBECELL_BUS_PASSWORD" in told and "secret of" not in told
    assert not any(b"secret of" in file.read_bytes() for file in bag.iterdir())


def own_session():
    """A session of another program of the same user, by the private socket."""
    (path,) = kept("state").glob("probecell/bus/*.socket")
    return client(**{"connect/endpoints": [f"unixsock-stream/{path}"]})


def a_stranger_reads_and_commands_nothing(folder):
    """Out of the box: a stranger tries every topic, service and announcement of the cell that runs."""
    forged = b"forged by a stranger"
    attachment = struct.pack("<qqB", 1, 1, 16) + bytes(16)
    cell = own_cell(folder)
    with cell_that_is_ready(cell, folder) as up, visitor() as stranger, own_session() as own:
        read, inside = set(), set()
        stranger.declare_subscriber("0/turn_mill/**", lambda sample: read.add(str(sample.key_expr).split("/")[2]))
        own.declare_subscriber("0/**", lambda sample: inside.add((str(sample.key_expr), bytes(sample.payload))))
        announced = []
        own.liveliness().declare_subscriber("@ros2_lv/**", lambda sample: announced.append(str(sample.key_expr)))

        def seen():
            """Topics and services that are announced. A question may catch the graph half told."""
            tokens = [str(reply.ok.key_expr).split("/") for reply in stranger.liveliness().get("@ros2_lv/0/**") if reply.ok]
            topics = {(one[9], one[10], one[11]) for one in tokens if one[5] in ("MP", "MS")}
            services = {(one[9], one[10], one[11]) for one in tokens if one[5] == "SS"}
            of_the_cell = [name for name, _, _ in services if name.count("%") == 2]
            whole = len(topics) > 50 and len(of_the_cell) == 8 and {"machine_state", "operator", "recorder"} <= {one[8] for one in tokens}
            return whole and (topics, services)

        topics, services = until("the whole graph", seen)
        part_is_asked_for(cell, folder)
        until("a touch", lambda: "probe_events" in read)
        for name, kind, digest in topics:
            key = "0" + name.replace("%", "/") + f"/{kind}/{digest}"
            stranger.put(key, forged, attachment=attachment)
            stranger.delete(key, attachment=attachment)
            stranger.liveliness().declare_token(f"@ros2_lv/0/forged/0/1/MP/%/%turn_mill/machine_state/{name}/{kind}/{digest}/:,:,:,:,,")
        # All are asked before any answer is awaited: what is refused is silent for the whole time.
        request = {"payload": bytes([0, 1, 0, 0, 0]), "attachment": attachment, "timeout": kit.patience(REFUSED)}
        questions = [(name, stranger.get("0" + name.replace("%", "/") + f"/{kind}/{digest}", **request)) for name, kind, digest in services]
        answered = {name for name, replies in questions if any(reply.ok for reply in replies)}
        # Parameters and types of every process may be read.
        reading = ("get_parameters", "get_parameter_types", "list_parameters", "describe_parameters", "get_type_description")
        assert {name for name in answered if not name.endswith(reading)} == {"%turn_mill%status"}, answered
        part_is_good(up)
        wanted = {"machine_state", "corrections", "part_reports", "probe_events", "verdicts", "joint_states"}
        until("what a stranger may see", lambda: read >= wanted)
        # What was said before the end of the part has arrived by now.
        told = list(inside)
        assert not any(payload == forged for _, payload in told) and len(told) > 100
        assert not any("/forged/" in key for key in list(announced)), announced
        assert not status(cell, folder)["faults"]
    (bag,) = (folder / "recordings").glob("*")
    messages = 0
    for _, message in raw(bag):
        messages += 1
        assert forged not in message.data
    assert messages > 1000, messages
    code, output, errors = asked("replay", bag, folder=folder)
    assert code == 0, (output, errors)


def another_user_reads_and_commands_nothing(folder):
    """As a user without rights: the socket cannot be opened, commands are refused, and a cell of its own is told why."""
    nobody = {"user": NOBODY[0], "group": NOBODY[1], "extra_groups": []}
    theirs = folder / "theirs"
    theirs.mkdir()
    os.chown(theirs, *NOBODY)
    cell = own_cell(folder)
    other = own_cell(theirs, lambda text: text.replace('name = "turn_mill"', 'name = "other"', 1))
    # Everybody may enter the folders above that of the socket.
    for path in (folder, kept("state"), kept("state") / "probecell"):
        path.mkdir(exist_ok=True)
        path.chmod(0o755)
    state = theirs / "state"
    state.mkdir()
    os.chown(state, *NOBODY)
    environment = {"HOME": str(theirs), "XDG_STATE_HOME": str(state), "PATH": os.environ["PATH"]}
    # The program itself may lie where only its builder can read.
    program = shutil.copy(BINARY, theirs / "probecell")
    # A socket that everybody may open: it is not for something else that they are refused.
    control = theirs / "control.socket"
    listening = socket.socket(socket.AF_UNIX)
    listening.bind(str(control))
    control.chmod(0o777)
    listening.listen()

    def refused_as_nobody(path):
        child = os.fork()
        if child == 0:
            code = 2
            try:
                os.setgroups([])
                os.setgid(NOBODY[1])
                os.setuid(NOBODY[0])
                socket.socket(socket.AF_UNIX).connect(str(path))
                code = 0
            except PermissionError:
                code = 1
            finally:
                os._exit(code)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        assert code in (0, 1), code
        return code == 1

    def as_nobody(*words):
        return kit.run(*words, folder=theirs, environment=environment, **nobody)

    with cell_that_is_ready(cell, folder) as up:
        (path,) = kept("state").glob("probecell/bus/*.socket")
        assert path.parent.stat().st_mode & 0o777 == 0o700
        assert refused_as_nobody(path) and not refused_as_nobody(control), path
        code, output, errors = as_nobody(program, "status", "--cell", cell)
        assert code == 0 and "turn_mill" in output, (code, output, errors)
        for words in (["run", "theirs"], ["stop"], ["recording", "stop"]):
            code, output, errors = as_nobody(program, *words, "--cell", cell)
            assert code == 1 and "lets this one read only" in output + errors, (words, code, output, errors)
        code, output, errors = as_nobody(program, "up", other)
        assert code == 2 and "lets this one read only" in errors, (code, output, errors)
        assert status(cell, folder)["part"] is None and recorded(folder).get("run_requests", 0) == 0, recorded(folder)
        assert recorded(folder).get("stop_requests", 0) == 0


def a_secured_cell_works_and_nobody_else_speaks(folder):
    cell = own_cell(folder, lambda text: text.replace('name = "turn_mill"', 'name = "secured"', 1))
    code, output, errors = asked("secure", cell, "--out", folder / "sessions", folder=folder)
    assert code == 0, (output, errors)

    def session_of(user):
        return zenoh.Config.from_file(str(folder / "sessions" / f"{user}.json5"))

    with cell_that_is_ready(cell, folder) as up:
        nobody_gets_in()
        heard = set()
        with zenoh.open(session_of("screen")) as screen, zenoh.open(session_of("ros")) as ros:
            screen.declare_subscriber("0/secured/**", lambda sample: heard.add(str(sample.key_expr).split("/")[2]))
            services = "0/secured/status/**"
            # A request without fields, numbered as rmw_zenoh numbers it.
            request = {"payload": bytes([0, 1, 0, 0, 0]), "attachment": struct.pack("<qqB", 1, 1, 16) + bytes(16)}
            until("an answer to ros", lambda: any(reply.ok for reply in ros.get(services, **request)))
            assert is_refused(screen, services, **request)
            part_is_asked_for(cell, folder)
            part_is_good(up)
            until("what the screen may see", lambda: heard >= {"machine_state", "corrections", "part_reports", "probe_events"})
        code, output, errors = asked("stop", "--cell", cell, folder=folder)
        assert code == 0, (output, errors)
        code, output, errors = asked("recording", "stop", "--cell", cell, folder=folder)
        assert code == 0, (output, errors)
    (bag,) = (folder / "recordings").glob("*")
    code, output, errors = asked("replay", bag, folder=folder)
    # The cell went on for a moment when its recording had been stopped.
    assert code in (0, 3) and "DIFFERENT" not in output, (output, errors)
    code, output, errors = asked("info", bag, "--verify", folder=folder)
    assert code == 0 and "nothing was changed since" in output, (code, output, errors)
    passwords = [line.split(":")[1] for line in (kept("config") / "probecell/cells/secured/bus/users.txt").read_text().split()]
    content = b"".join(one.read_bytes() for one in bag.iterdir())
    assert len(passwords) > 10 and not any(word.encode() in content for word in passwords)
    (changed,) = bag.glob("*.mcap")
    content = bytearray(changed.read_bytes())
    content[len(content) // 2] ^= 1
    changed.write_bytes(content)
    code, output, errors = asked("info", bag, "--verify", folder=folder)
    assert code == 1 and "was changed between byte" in output, (code, output, errors)


def an_operator_stops_a_part_while_strangers_take_what_they_can(folder):
    """Connections that say nothing to the router and to the dashboard, and every offer of an act: the operator of an open and of a secured
    cell asks for its state and stops it all the same, and a page is offered a stop."""
    for kind in ("open", "secured"):
        place = folder / kind
        place.mkdir()
        cell = own_cell(place, lambda text: text.replace('name = "turn_mill"', f'name = "{kind}"', 1), cut_s=LONG)
        if kind == "secured":
            code, output, errors = asked("secure", cell, "--out", place / "sessions", folder=place)
            assert code == 0, (output, errors)
        with cell_that_is_ready(cell, place) as up, contextlib.ExitStack() as held:
            address, fetched = dashboard_of(up)
            port = address.rsplit(":", 1)[1]

            def page(path, about=None):
                headers = {"content-type": "application/json", "origin": address}
                if about is not None:
                    headers["x-act-token"] = json.loads(page("/act/token"))["token"]
                    about = json.dumps({"cell": kind, "subject": "", **about}).encode()
                return fetched(path, data=about, headers=headers)

            cutting(cell, place)

            def strangers(to, count, words=b""):
                for _ in range(count):
                    one = held.enter_context(socket.create_connection(("127.0.0.1", int(to)), timeout=kit.patience(60)))
                    one.sendall(words)

            strangers(port, 400, b"GET / HTTP/1.1\r\nHost: 127")
            until("its own cell on the page", lambda: f"/cell/{kind}" in page("/"))
            refused = 0
            while not refused:
                try:
                    page("/act/offer", {"act": "make", "subject": "punch"})
                except urllib.error.HTTPError as error:
                    refused = error.code
            assert "stop" in json.loads(page("/act/offer", {"act": "stop"}))["kind"]
            strangers(7447, 300)
            if kind == "open":
                with visitor() as stranger:
                    asks = {"attachment": struct.pack("<qqB", 1, 1, 16) + bytes(16)}
                    asked_for = lambda size: {"payload": cdr([("s",)], [["x" * size]]), **asks}
                    service = "0/open/machine_state/get_parameters/**"
                    assert not is_refused(stranger, service, **asked_for(250_000))
                    assert is_refused(stranger, service, **asked_for(270_000))
            assert status(cell, place)["part"]["stage"] == "cutting"
            code, output, errors = asked("run", "punch", "--cell", cell, folder=place)
            assert code == 0 and "order 2: punch, 1 part" in output, (kind, code, output, errors)
            code, output, errors = asked("stop", "--cell", cell, folder=place)
            assert code == 0 and "the machine stands" in output, (kind, code, output, errors)
            up.says("part punch: stopped")


def a_cell_that_has_gone_is_kept_for_late_dashboards(folder):
    """By `router --keep`: asked by eclipse-zenoh, as any storage of Zenoh is, and by the program; then a storage of others."""
    cell = own_cell(folder)
    wanted = {"machine_state", "part_status", "part_reports", "verdicts", "pass_decisions", "gap_report", "recording_status"}
    states = "0/**/probecell_msgs::msg::dds_::$*/*"

    @contextlib.contextmanager
    def keeper(*words):
        with started("router", *words, folder=folder) as process:
            assert "listens on" in process.line()
            yield

    def shown():
        """The line of the only cell for whoever comes late."""
        output = asked("watch", "--once", folder=folder)[1]
        (line,) = [line for line in output.splitlines() if " turn_mill " in line] or [output]
        return line

    def shown_as_kept():
        line = shown()
        return "not live" in line and "punch, qualified" in line and "ago, kept" in line, line

    def answers(session, what=states):
        return {str(reply.ok.key_expr): reply.ok for reply in session.get(what) if reply.ok}

    with keeper("--keep", folder / "kept"):
        with cell_that_is_ready(cell, folder) as up, visitor() as stranger:
            part_is_asked_for(cell, folder)
            part_is_good(up)
            until("what is kept", lambda: {key.split("/")[2] for key in answers(stranger)} == wanted)
            line = shown()
            assert "idle" in line and "kept" not in line, line
            up.kill()
            publishers = "@ros2_lv/0/*/*/*/MP/**"
            until("the end of the cell", lambda: not any(reply.ok for reply in stranger.liveliness().get(publishers)))
            assert shown_as_kept()[0], shown_as_kept()
            code, output, errors = asked("status", "--cell", cell, folder=folder)
            assert code == 1 and "not live" in output and "punch, qualified" in output, (code, output, errors)
            with started("dashboard", "--listen", "127.0.0.1:0", folder=folder) as dashboard:
                address = dashboard.line().split()[-1]

                def page(path):
                    with urllib.request.urlopen(address + path, timeout=kit.patience(60)) as answer:
                        return answer.read().decode()

                until("the tile", lambda: "not live" in page("") and "qualified" in page(""))
                assert "ago, kept" in page("cell/turn_mill") and 'probecell_cell_stale{cell="turn_mill"} 1' in page("metrics")
            kept = answers(stranger)
            # Nothing that asks, approves or commands, at whatever key; and nothing that a subscription of a node would take.
            assert {key.split("/")[2] for key in kept} == wanted and not wanted & (ASKING | {"corrections"}), kept.keys()
            assert all(one.timestamp and one.attachment is None for one in kept.values())
            assert not any(answers(stranger, f"{key}/@adv/**") for key in kept)
    files = [path for path in (folder / "kept").rglob("*") if path.is_file()]
    assert {str(path.relative_to(folder / "kept")): path.read_bytes() for path in files} == {
        key: bytes(one.payload) for key, one in kept.items()
    }
    with keeper("--keep", folder / "kept"):
        assert shown_as_kept()[0], shown_as_kept()
        with cell_that_is_ready(cell, folder):
            until("a live cell in its place", lambda: "idle" in shown())
            line = shown()
            assert "qualified" not in line and "kept" not in line, line
    # zenohd with a storage manager, or whatever else serves samples at their keys.
    with keeper("--strangers", "write"), visitor() as storage:

        def answer(query):
            for key, one in kept.items():
                if query.key_expr.intersects(zenoh.KeyExpr(key)):
                    query.reply(key, one.payload, timestamp=one.timestamp)

        storage.declare_queryable("0/**", answer)
        assert shown_as_kept()[0], shown_as_kept()


def cdr(kind, value):
    """A value in little-endian CDR: "s" a text, "?" a truth, a list of kinds a record, [kind] in a tuple a sequence of it."""
    out = bytearray(b"\0\1\0\0")

    def count(number):
        out.extend(bytes(-len(out) % 4) + struct.pack("<I", number))

    def write(kind, value):
        if kind == "?":
            out.append(value)
        elif kind == "s":
            count(len(value.encode()) + 1)
            out.extend(value.encode() + b"\0")
        elif isinstance(kind, tuple):
            count(len(value))
            for one in value:
                write(kind[0], one)
        else:
            for part, one in zip(kind, value, strict=True):
                write(part, one)

    write(kind, value)
    return bytes(out)


TYPE = ["s", ()]  # of a type whose fields are not described: its name and no field


def a_cell_of_another_version_is_read_by_the_names_of_its_fields(folder):
    """What an earlier version of the program recorded, published as it did beside a cell of this one. A topic whose definition its node does
    not give is named."""
    topic, version = "/ball_check/plan_progress", "0.0.9 (4060b226)"
    with open(ROOT / "bags" / "tests" / "earlier.mcap", "rb") as file:
        messages = [(schema, channel, message.data) for schema, channel, message in make_reader(file).iter_messages(topics=[topic])]
    schema, channel, _ = messages[0]
    hash_then = channel.metadata["topic_type_hash"]
    texts = re.split("={80}\nMSG: ", schema.data.decode())
    named = [(schema.name, texts[0])]
    for name, _, text in (one.partition("\n") for one in texts[1:]):
        named.append(("/msg/".join(name.split("/")), text))
    known = ["?", "s", [["s", (TYPE,)], (["s", (TYPE,)],)], (["s", "s", "s"],), (["s", "s"],)]

    def describe(query):
        if query.payload is None:
            return  # it is not asked as a service is
        is_known = hash_then.encode() in bytes(query.payload)
        sources = [(name, "msg", text) for name, text in named] if is_known else []
        answer = (is_known, "" if is_known else "not known here", (("", []), []), sources, [])
        query.reply(query.key_expr, cdr(known, answer), attachment=bytes(query.attachment))

    cell = own_cell(folder)
    with cell_that_is_ready(cell, folder) as up, own_session() as other:
        _, page = dashboard_of(up)
        held = [other.declare_queryable("0/ball_check/path_planning/get_type_description/**", describe, complete=True)]

        def publishes(number, name, kind, digest):
            node = f"@ros2_lv/0/{other.info.zid()}/0/{number}/MP/%/%ball_check/path_planning"
            type_name = f"{kind.split('/')[0]}::msg::dds_::{kind.split('/')[-1]}_"
            held.append(other.liveliness().declare_token(f"{node}/%ball_check%{name}/{type_name}/{digest}/::,10:,:,:,,"))
            return f"0/ball_check/{name}/{type_name}/{digest}"

        said = publishes(1, "cell_description", "std_msgs/String", STRING)
        progress = publishes(2, "plan_progress", "probecell_msgs/PlanProgress", hash_then)
        publishes(3, "machine_state", "probecell_msgs/MachineState", "RIHS01_" + 64 * "0")
        text = cdr(["s"], [f"# public key of the cell: 00\n# program: probecell {version}\n"])
        numbers = itertools.count(1)

        def is_shown():
            for key, data in [(said, text), (progress, messages[3][2])]:
                other.put(key, data, attachment=struct.pack("<qqB", next(numbers), time.time_ns(), 16) + 16 * b"\7")
            shown = page("/cell/ball_check")
            return all(text in shown for text in (version, "air_length is new, given_air_length is new", "of 14 touches"))

        until("the other version on its page", is_shown)
        shown = page("/cell/ball_check")
        assert "<code>machine_state</code>: not read: " in shown and "not known here" in shown, shown
        hall = page("/")
        assert version in hall and hall.count("small class=\"version\"") == 1, hall


def the_dashboard_of_a_cell_reads_the_others_once_it_is_looked_at(folder):
    """From its own cell it then takes nothing a second time, though publishers hold what they said for whoever begins to read."""
    first, second = folder / "first", folder / "second"
    for one in (first, second):
        one.mkdir()
    cell = own_cell(first)
    other = own_cell(second, lambda text: text.replace('name = "turn_mill"', 'name = "other"', 1))

    def parts(name):
        """How many parts of a cell have ended, one of which the metrics tell."""
        counts = [line for line in page("/metrics").splitlines() if line.startswith(f'probecell_cell_parts_total{{cell="{name}"')]
        return sum(int(line.split()[-1]) for line in counts)

    with cell_that_is_ready(cell, first) as up, cell_that_is_ready(other, second) as beside:
        part_is_asked_for(cell, first)
        part_is_asked_for(other, second)
        for process in (up, beside):
            process.says("part punch: ")
        _, page = dashboard_of(beside)
        assert "/cell/other" in page("/")  # the first that anybody asks for
        until("the other cell", lambda: "/cell/turn_mill" in page("/"))
        until("the part of the other cell", lambda: parts("turn_mill") == 1)
        assert parts("other") == 1, page("/metrics")


def quick(text):
    """Its part is one diameter, cut in one pass of half a second."""
    text = re.sub(r'\[\[part\.features\]\]\nid = "(?!D1)(?:.+\n)+\n', "", text)
    text = re.sub(r"widths = \[\n(?:.+\n)*?\]\n", "", text)
    text = re.sub(r'    \{ id = "(?!D1)\w+", tolerance_mm.+\n', "", text)
    text = re.sub(r'    \{ name = "rough".+\n', "", text).replace('["finish_turn", "finish_mill"] }', '["finish_turn"] }')
    return re.sub(r"duration_s = [\d.]+", "duration_s = 0.5", text)


def ten_orders_are_each_made_once_whatever_is_killed(folder):
    """Seeded instants at which a process or the whole cell is killed. The operator releases the orders, cancels an interrupted one whose good
    part was reported, and has the others made again; without that no part is begun twice."""
    cell, chance = own_cell(folder, quick), random.Random(41)
    parts, again = [f"p{number}" for number in range(10)], []
    up = started("up", cell, folder=folder)
    up.says("is ready")

    def orders(*words):
        code, output, errors = asked("orders", *words, "--json", "--cell", cell, folder=folder)
        return json.loads(output) if output else until("orders", lambda: asked("orders", folder=folder)[0] == 0) and {}

    def told(topic):
        """Messages of all recordings so far; what was cut off is recovered."""
        bags = sorted((folder / "recordings").glob("*"))
        with kit.new_folder() as whole:
            for number, bag in enumerate(bags):
                asked("recover", bag, f"{whole}/{number}", folder=folder)
            return [one for bag in sorted(pathlib.Path(whole).iterdir()) for *_, one in decoded(bag, [f"/turn_mill/{topic}"])]

    def attended():
        """The orders that are left, once the operator has seen to them."""
        known = orders()
        for order in known.get("orders", []):
            if order["state"] == "interrupted":
                good = any(one.part_id == order["part_id"] and one.verdict == 0 for one in told("part_reports"))
                changed = orders("cancel" if good else "resume", str(order["order_id"]))
                is_done = changed and not any(one["order_id"] == order["order_id"] and one["state"] == "interrupted" for one in changed["orders"])
                again.extend([order["part_id"]] * (is_done and not good))
        if known.get("held"):
            orders("resume")
        return known.get("orders")

    for part in parts:
        code, output, errors = asked("run", part, "--cell", cell, folder=folder)
        assert code == 0 and f": {part}, 1 part" in output, (output, errors)
    killed = collections.Counter()
    while killed.total() < 8 and attended() != []:
        kit.pause(chance.uniform(0.0, 12.0), "the seeded instant of a kill")
        victim = chance.choice(("launcher", "launcher", "cycle", "cycle", "machine_state", "analysis"))
        killed[victim] += 1
        if victim == "launcher":
            children = pathlib.Path(f"/proc/{up.pid}/task/{up.pid}/children").read_text().split()
            up.kill()
            until("the end of its processes", lambda: not any(pathlib.Path(f"/proc/{child}").exists() for child in children))
            up = started("up", cell, folder=folder)
            up.says("is ready")
        else:
            os.kill(kit.child(up.pid, "node", victim), signal.SIGKILL)
            until("orders that are held", lambda: orders().get("held") or orders().get("orders") == [])
    until("the end of the orders", lambda: attended() == [])
    up.end(signal.SIGINT)
    good = collections.Counter(one.part_id for one in told("part_reports") if one.verdict == 0)
    assert good == dict.fromkeys(parts, 1), good
    begun = {one.run_id for one in told("operation_requests") if one.kind == 0}
    counted = collections.Counter(run.split("#")[0] for run in begun)
    assert counted <= collections.Counter(parts + again), (counted, again)
    for bag in (folder / "recordings").glob("*"):
        code, output, errors = asked("replay", bag, folder=folder)
        assert code in (0, 3) and "DIFFERENT" not in output, (output, errors)
    print(f"    killed: {dict(killed)}; made again by the operator: {again}", flush=True)


CHECKS = (
    ten_orders_are_each_made_once_whatever_is_killed,
    the_part_of_a_killed_cycle_is_reported, a_killed_gate_stops_the_part, access_control_binds_processes_of_one_machine,
    the_documented_policy_lets_the_cell_work_and_nobody_else_command_it,
    every_process_of_a_cell_is_confined, a_machine_stops_when_its_gate_is_paused, an_operator_stops_a_part_and_ctrl_c_the_cell,
    a_paused_cycle_starts_nothing_late, the_same_cell_is_not_started_twice_and_another_outlives_its_router,
    a_wall_clock_set_back_is_a_recorded_fault, a_disk_that_fails_stops_the_part_and_the_cell,
    a_recording_that_is_taken_away_stops_the_part_and_is_kept, a_disk_that_goes_while_a_part_is_cut_stops_the_part,
    a_folder_that_may_not_be_written_any_more_stops_the_part, a_disk_that_does_not_answer_holds_orders_up_and_loses_nothing,
    a_dashboard_that_dies_is_started_again,
    a_killed_launcher_leaves_nothing_that_holds_commands_up, a_part_on_simulated_time_is_the_same_part,
    a_cell_on_simulated_time_is_supervised,
    corrections_are_approved_by_signature_and_a_withdrawn_key_is_refused,
    a_secured_cell_works_and_nobody_else_speaks, an_operator_stops_a_part_while_strangers_take_what_they_can, a_stranger_reads_and_commands_nothing,
    another_user_reads_and_commands_nothing, a_cell_that_has_gone_is_kept_for_late_dashboards,
    the_dashboard_of_a_cell_reads_the_others_once_it_is_looked_at, a_cell_of_another_version_is_read_by_the_names_of_its_fields,
)
AFTER = (what_asks_is_not_played, playing_ends_when_told, a_running_cell_keeps_its_names_and_records_on_demand)  # on the recording of one of them


def main():
    def carried_out(check, *arguments):
        if not kit.apart(check, *arguments):
            raise SystemExit(f"FAILED: {check.__name__}")
        print(f"ok  {check.__name__.replace('_', ' ')}", flush=True)

    wanted = lambda check: not WANTED or check.__name__ in WANTED
    with kit.new_folder() as first:
        for check in CHECKS:
            with kit.new_folder() as folder:
                own = first if check is a_killed_gate_stops_the_part else folder
                if wanted(check) or check is a_killed_gate_stops_the_part and any(map(wanted, AFTER)):
                    carried_out(check, pathlib.Path(own))
        for check in filter(wanted, AFTER):
            (bag,) = (pathlib.Path(first) / "recordings").glob("*")
            with kit.new_folder() as folder:
                carried_out(check, pathlib.Path(folder), bag)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        raise SystemExit(__doc__)
    BINARY, WANTED = str(pathlib.Path(sys.argv[1]).resolve()), sys.argv[2:]
    main()
