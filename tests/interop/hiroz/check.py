#!/usr/bin/env python3
"""A running cell for a client of hiroz, a ROS 2 library on Zenoh that shares nothing with ours: src/main.rs beside this file.

    check.py PROBECELL HIROZ_PEER [cell|search]...

Graph, types, touches, services, parameters and both actions, against what the cell says of itself and what it has recorded. Each check
has a network namespace of its own.
"""

import json
import pathlib
import shutil
import subprocess
import sys
import tomllib

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path.append(str(ROOT / "tests"))
import kit  # noqa: E402
from kit import until  # noqa: E402
from kit.recordings import decoded, raw  # noqa: E402

SPACE = "/turn_mill"
CUTTING, MEASURING = 1, 2
SUCCEEDED, CANCELED = 4, 5
QUALIFIED, STOPPED = 0, 2
# hiroz 0.2.1 knows neither `byte` nor strings with a bound in descriptions: `field_type_description_to_type` of its `dynamic::type_description`.
UNREAD = {
    "rcl_interfaces/srv/GetParameters", "rcl_interfaces/srv/SetParameters", "rcl_interfaces/srv/SetParametersAtomically",
    "type_description_interfaces/srv/GetTypeDescription",
}
ACTIONS, SERVED, PUBLISHED = ("run", "plan"), ("send_goal", "get_result", "cancel_goal"), ("feedback", "status")
OF_OPERATORS = {"plan", "run", "stop", "approve_correction", "manage_orders", "status", "start_recording", "stop_recording"}
OF_A_NODE = {
    "describe_parameters", "get_parameters", "get_parameter_types", "list_parameters", "set_parameters", "set_parameters_atomically",
    "get_type_description",
}


def own_cell(folder, bus, planning=""):
    """The default cell, with more lines of its sections `bus` and `path_planning`."""
    for name in ("turn_mill.toml", "turn_mill.urdf"):
        shutil.copy(ROOT / "launch-scripts" / name, folder)
    cell = folder / "turn_mill.toml"
    text = cell.read_text()
    for section, lines in (("[bus]\n", bus), ("[path_planning]\n", planning)):
        assert text.count(section) == 1, section
        text = text.replace(section, f"{section}{lines}\n")
    cell.write_text(text)
    return cell


class Peer(kit.Process):
    """The client: answers come in the order of the questions, touches among them."""

    def __init__(self):
        super().__init__(PEER, SPACE, kit.patience(60), apart=True, stdin=subprocess.PIPE)
        self.taken, self.touches, self.answers = 0, [], []

    def take(self):
        for line in self.lines[self.taken:]:
            self.taken += 1
            said = json.loads(line)
            assert "undecodable" not in said, said
            if "touch" in said:
                self.touches.append(said["touch"])
            else:
                self.answers.append(said)

    def heard(self):
        ended = self.is_silent()
        self.take()
        assert self.answers or not ended, (self.code, self.errors)
        return self.answers

    def answered(self, *words, seconds=kit.PATIENCE):
        self.say(" ".join(words))
        until(f"the answer to {' '.join(words)}", self.heard, seconds)
        return self.answers.pop(0)

    def ask(self, *words, **how):
        said = self.answered(*words, **how)
        assert "answer" in said, (words, said, self.errors)
        return said["answer"]


def running(cell, folder):
    up = kit.Process(BINARY, "up", cell, folder=folder, apart=True)
    line = up.line()
    assert "is ready" in line, (line, up.errors)
    return up


def the_graph(peer):
    """Nodes are the processes that the service `status` names, and the launcher; each has its services. The dashboard is a process that
    announces nothing. A question may catch the graph half told."""
    until("the service status", lambda: f"{SPACE}/status" in peer.ask("graph")["services"])
    named = set(peer.ask("status")["processes"])
    assert "dashboard" in named, named
    processes = named - {"dashboard"} | {"operator"}
    names = OF_OPERATORS | {f"{node}/{name}" for node in processes for name in OF_A_NODE}
    names |= {f"{one}/_action/{part}" for one in ACTIONS for part in SERVED}
    services, topics = {f"{SPACE}/{name}" for name in names}, {f"{SPACE}/{one}/_action/{part}" for one in ACTIONS for part in PUBLISHED}

    def told():
        graph = peer.ask("graph")
        nodes = {name for name in graph["nodes"] if name.startswith(f"{SPACE}/")}
        return nodes == {f"{SPACE}/{name}" for name in processes} and services <= set(graph["services"]) and topics <= set(graph["topics"]) and graph

    graph = until("the whole graph", told)
    assert set(graph["actions"]) == {f"{SPACE}/{one}" for one in ACTIONS}, graph["actions"]
    assert graph["services"][f"{SPACE}/status"] == "probecell_msgs::srv::dds_::Status_", graph["services"]
    print(f"  {len(processes)} nodes, {len(graph['topics'])} topics, {len(graph['services'])} services", flush=True)


def the_types(peer):
    """The type of each topic and service is described, and hiroz computes from that the hash which is announced."""
    told = peer.ask("types", seconds=300)
    unread = {one["type"] for one in told.values() if one["error"]}
    assert unread == UNREAD, [one for one in told.values() if one["error"]]
    types = {name: one for name, one in told.items() if one["type"] not in UNREAD}
    wrong = {name: one for name, one in types.items() if one["announced"] != one["computed"]}
    assert not wrong, wrong
    count = len({one["type"] for one in types.values()})
    print(f"  {count} types of {len(types)} topics and services have the hashes that hiroz computes; it does not read {len(unread)}", flush=True)
    return types


def the_parameters(peer, cell):
    for node in ("path_planning", "compensation", "recorder"):
        told = peer.ask("parameters", node)
        section = tomllib.loads(cell.read_text())[node]
        wanted = {key: value for key, value in section.items() if not isinstance(value, (dict, list))}
        assert wanted and wanted.items() <= told["values"].items() and told["values"]["use_sim_time"] is False, (wanted, told)
        assert sum(told["read_only"]) >= len(wanted), told
    # A stranger sets none: the router takes no such request, and hiroz gives up after its ten seconds.
    refused = peer.answered("set", "compensation", "max_corrections", "50")
    assert "before any response" in refused.get("error", ""), refused
    print(f"  {len(told['values'])} parameters of {node}; set by a stranger: {refused['error']}", flush=True)


def the_actions(peer):
    made = peer.ask("run", "first", seconds=300)
    report = made["result"]["report"]
    assert (made["status"], made["canceled"], report["part_id"], report["verdict"]) == (SUCCEEDED, None, "first", QUALIFIED), made
    assert {CUTTING, MEASURING} <= {one["status"]["stage"] for one in made["feedback"]}, made
    planned = peer.ask("plan")
    assert (planned["status"], planned["result"]["plan_id"]) == (SUCCEEDED, "preview") and planned["result"]["touches"] > 0, planned
    assert {one["progress"]["plan_id"] for one in planned["feedback"]} == {"preview"}, planned
    stopped = peer.ask("cancel", "run", "second")
    report = stopped["result"]["report"]
    assert (stopped["status"], report["part_id"], report["verdict"]) == (CANCELED, "second", STOPPED), stopped
    assert stopped["canceled"] == {"return_code": 0, "is_this_goal": [True]}, stopped
    print(f"  first: {made['result']['text']}; plan: {planned['result']['touches']} touches; second: canceled", flush=True)


def plain(value):
    """A message as the mcap library decodes it, as JSON has it."""
    if hasattr(value, "__slots__"):
        return {name: plain(getattr(value, name)) for name in value.__slots__}
    return [plain(one) for one in value] if isinstance(value, (list, tuple)) else value


def a_cell(folder):
    """What a stranger may do who may call `run` and `plan`."""
    cell = own_cell(folder, 'strangers_call = ["run", "plan"]')
    with running(cell, folder), Peer() as peer:
        the_graph(peer)
        types = the_types(peer)
        peer.ask("touches")
        the_parameters(peer, cell)
        the_actions(peer)
        code, output, errors = kit.run(BINARY, "recording", "stop", "--cell", cell, folder=folder)
        assert code == 0, (output, errors)
        (bag,) = (folder / "recordings").glob("*")
        recorded = [plain(touch) for _, _, touch in decoded(bag, topics=[f"{SPACE}/probe_events"])]

        def all_heard():
            peer.take()
            return len(peer.touches) >= len(recorded)

        until("each recorded touch", all_heard)
        assert recorded and peer.touches == recorded, (len(recorded), len(peer.touches))
        print(f"  {len(recorded)} touches received and decoded as recorded", flush=True)
    hashes = {one.topic: one.metadata["topic_type_hash"] for one, _ in raw(bag) if one.topic.startswith(f"{SPACE}/")}
    told = {topic: types.get(topic, {}).get("computed") for topic in hashes}
    assert told == hashes, (told, hashes)
    print(f"  {len(hashes)} recorded topics have the same", flush=True)


def a_search(folder):
    """A search that takes for ever is cancelled; a client that may write still sets no parameter."""
    cell = own_cell(folder, 'strangers = "write"', "kicks = 1_000_000_000_000")
    with running(cell, folder), Peer() as peer:
        the_graph(peer)
        told = peer.ask("cancel", "plan")
        assert (told["status"], told["result"]["touches"]) == (CANCELED, 0) and "cancelled" in told["result"]["text"], told
        assert told["canceled"] == {"return_code": 0, "is_this_goal": [True]}, told
        (refused,) = peer.ask("set", "compensation", "max_corrections", "50")
        assert not refused["successful"] and "read-only" in refused["reason"], refused
        print(f"  {told['result']['text']}; set: {refused['reason']}", flush=True)


if __name__ == "__main__":
    BINARY, PEER = (str(pathlib.Path(one).resolve()) for one in sys.argv[1:3])
    kit.main({"cell": a_cell, "search": a_search}, sys.argv[3:])
