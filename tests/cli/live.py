#!/usr/bin/env python3
"""What the command line does beside a running cell: processes that are killed, recordings that are played, access control.

    live.py PROBECELL

Runs in a network namespace of its own (the router's port is taken). The witness on the bus is eclipse-zenoh; nothing of
ours reads for it.
"""

import contextlib
import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time

import zenoh

ROOT = pathlib.Path(__file__).resolve().parents[2]
CELL = ROOT / "launch-scripts" / "turn_mill.toml"
PATIENCE = 60  # s
ASKING = {"run_requests", "operation_requests", "controller_commands", "plan_requests", "approvals"}
FORBIDDEN = """
[bus.router_zenoh.access_control]
enabled = true
default_permission = "allow"
rules = [{ id = "no_parts", permission = "deny", flows = ["ingress", "egress"], messages = ["put"],
           key_exprs = ["0/turn_mill/run_requests/**"] }]
subjects = [{ id = "everybody" }]
policies = [{ rules = ["no_parts"], subjects = ["everybody"] }]
"""


def until(what, ready):
    deadline = time.monotonic() + PATIENCE
    while not ready():
        assert time.monotonic() < deadline, f"{what}: not within {PATIENCE} s"
        time.sleep(0.05)


@contextlib.contextmanager
def started(*words, folder, errors=subprocess.PIPE):
    process = subprocess.Popen(
        [BINARY, *map(str, words)], cwd=folder, stdout=subprocess.PIPE, stderr=errors, stdin=subprocess.DEVNULL, text=True
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
            process.communicate(timeout=PATIENCE)


def ended(process):
    """Status, output and errors of a process that has to end by itself."""
    output, errors = process.communicate(timeout=PATIENCE)
    return process.returncode, output, errors


def recorded(folder):
    """Messages on disk of each topic of the one recording in a folder, finished or not."""
    for recording in (folder / "recordings").glob("*"):
        told = subprocess.run([BINARY, "info", recording, "--json"], capture_output=True, text=True)
        if told.stdout:
            return {topic["topic"].removeprefix("/turn_mill/"): topic["messages"] for topic in json.loads(told.stdout)["topics"]}
    return {}


def kill_node(launcher, name):
    children = pathlib.Path(f"/proc/{launcher.pid}/task/{launcher.pid}/children").read_text().split()
    for child in children:
        if pathlib.Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0")[1:3] == [b"node", name.encode()]:
            subprocess.run(["kill", "-KILL", child], check=True)
            return
    raise AssertionError(f"no process of {name} among {children}")


def killed_while_a_part_is_made(folder, name):
    with started("up", CELL, "--once", folder=folder) as up:
        until("a touch", lambda: recorded(folder).get("probe_events", 0) > 0)
        kill_node(up, name)
        return ended(up)


def a_killed_cycle_ends_the_cell(folder):
    status, output, errors = killed_while_a_part_is_made(folder, "cycle")
    assert status == 1 and "cycle ended while the part was made" in errors, (status, output, errors)


def a_killed_gate_stops_the_part(folder):
    status, output, errors = killed_while_a_part_is_made(folder, "machine_state")
    assert status == 1 and "stopped" in output and "machine_state ended" in output, (status, output, errors)
    (bag,) = (folder / "recordings").glob("*")
    replay = subprocess.run([BINARY, "replay", bag, "--json"], capture_output=True, text=True)
    topics = json.loads(replay.stdout)["replay"]["topics"]
    assert sum(topic["different"] for topic in topics) == 0, replay.stdout


@contextlib.contextmanager
def router(folder):
    with started("router", folder=folder) as process:
        assert "listens on" in process.stdout.readline()
        yield


@contextlib.contextmanager
def witness():
    """Keys on which anything is heard."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", '["tcp/127.0.0.1:7447"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    keys, first = set(), threading.Event()

    def hear(sample):
        keys.add(str(sample.key_expr))
        first.set()

    with zenoh.open(config) as session:
        session.declare_subscriber("0/**", hear)
        yield keys, first


def what_asks_is_not_played(folder, bag):
    with router(folder), witness() as (keys, first):
        with started("play", bag, "--rate", "20", folder=folder) as play:
            status, output, errors = ended(play)
        assert status == 0, (output, errors)
        assert first.is_set()
        played = {key.removeprefix("0/replay/turn_mill/").rsplit("/", 2)[0] for key in keys if "/@adv/" not in key}
        there = {topic for topic, count in recorded(folder).items() if count}
        assert there & ASKING >= {"run_requests", "operation_requests", "controller_commands"}, there
        assert not played & ASKING, played & ASKING
        assert there - ASKING - played == {"launcher/faults"} & there, there - ASKING - played


def playing_ends_when_told(folder, bag):
    with router(folder), witness() as (_, first):
        with started("play", bag, "--rate", "1e6", "--loop", folder=folder) as play:
            assert first.wait(PATIENCE)
            play.send_signal(signal.SIGTERM)
            assert ended(play)[0] == 0


def a_running_cell_keeps_its_names_and_records_on_demand(folder, bag):
    with tempfile.TemporaryDirectory() as other, started("up", CELL, folder=other, errors=subprocess.DEVNULL) as up:
        assert "turn_mill is ready" in up.stdout.readline()
        with started("play", bag, "--namespace", "/", folder=folder) as play:
            status, output, errors = ended(play)
        assert status == 2 and "is published already" in errors and not output, (status, output, errors)
        until("a recording", lambda: recorded(pathlib.Path(other)).get("machine_state", 0) > 0)
        for words, status, says in (
            (["stop"], 0, "recorded "), (["stop"], 1, "nothing"), (["start", "again"], 0, "recordings/again"), (["start"], 1, "again"),
        ):
            with started("recording", *words, "--cell", CELL, folder=folder) as asked:
                found, output, errors = ended(asked)
            assert found == status and says in output, (words, found, output, errors)


def access_control_binds_processes_of_one_machine(folder):
    text = CELL.read_text() + FORBIDDEN
    (folder / "cell.toml").write_text(text)
    (folder / "turn_mill.urdf").write_text((CELL.parent / "turn_mill.urdf").read_text())
    with started("up", folder / "cell.toml", "--once", folder=folder) as up:
        status, output, errors = ended(up)
    assert status == 1 and "no node answered" in errors and not recorded(folder).get("probe_events"), (status, output, errors)
    assert "is silent about" in errors and "@adv" in errors, errors


def policy():
    """The example of docs/access-control.md, word for word."""
    (example,) = re.findall(r"```toml\n(.*?)```", (ROOT / "docs" / "access-control.md").read_text(), re.DOTALL)
    return example


@contextlib.contextmanager
def visitor(user=None, password=None):
    """A session of another program."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", '["tcp/127.0.0.1:7447"]')
    config.insert_json5("connect/timeout_ms", "2000")
    config.insert_json5("scouting/multicast/enabled", "false")
    if user:
        config.insert_json5("transport/auth/usrpwd/user", json.dumps(user))
        config.insert_json5("transport/auth/usrpwd/password", json.dumps(password))
    with zenoh.open(config) as session:
        yield session


def the_documented_policy_lets_the_cell_work_and_nobody_else_command_it(folder):
    (folder / "cell.toml").write_text(CELL.read_text() + policy())
    (folder / "turn_mill.urdf").write_text((CELL.parent / "turn_mill.urdf").read_text())
    (folder / "users.txt").write_text("cell:secret of the cell\nscreen:secret of the screen\n")
    os.environ["PROBECELL_BUS_PASSWORD"] = "secret of the cell"
    try:
        with started("up", folder / "cell.toml", folder=folder, errors=subprocess.DEVNULL) as up:
            assert "turn_mill is ready" in up.stdout.readline()
            try:
                with visitor():
                    raise AssertionError("a session without a password was opened")
            except zenoh.ZError:
                pass
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
                asked, key = [], "0/turn_mill/asked/by"
                cell.declare_queryable(key, lambda query: (asked.append(str(query.parameters)), query.reply(key, b"yes")))
                until("an answer", lambda: any(reply.ok for reply in cell.get(key + "?who=cell")))
                assert not any(reply.ok for reply in screen.get(key + "?who=screen", timeout=2.0))
                assert asked and "who=screen" not in asked, asked
    finally:
        del os.environ["PROBECELL_BUS_PASSWORD"]
    (bag,) = (folder / "recordings").glob("*")
    assert recorded(folder).get("machine_state", 0) > 0
    told = subprocess.run([BINARY, "info", bag, "--json"], capture_output=True, text=True).stdout
    assert "PROBECELL_BUS_PASSWORD" in told and "secret of" not in told
    assert not any(b"secret of" in file.read_bytes() for file in bag.iterdir())


def main():
    with tempfile.TemporaryDirectory(prefix="probecell_live_") as scratch:
        folders = {}
        for check in (
            a_killed_cycle_ends_the_cell, a_killed_gate_stops_the_part, access_control_binds_processes_of_one_machine,
            the_documented_policy_lets_the_cell_work_and_nobody_else_command_it,
        ):
            folders[check] = pathlib.Path(scratch) / check.__name__
            folders[check].mkdir()
            check(folders[check])
            print(f"ok  {check.__name__.replace('_', ' ')}", flush=True)
        folder = folders[a_killed_gate_stops_the_part]
        (bag,) = (folder / "recordings").glob("*")
        for check in (what_asks_is_not_played, playing_ends_when_told, a_running_cell_keeps_its_names_and_records_on_demand):
            check(folder, bag)
            print(f"ok  {check.__name__.replace('_', ' ')}", flush=True)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    BINARY = str(pathlib.Path(sys.argv[1]).resolve())
    main()
