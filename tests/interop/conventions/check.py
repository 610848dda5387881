#!/usr/bin/env python3
"""What a ROS 2 user expects beside the topics: services that answer, bags that anybody may record, bags that convert.

    check.py PROBECELL [services|outside|convert|domain|log|parameters|run|plan|launch]...

Each check has a network namespace of its own. The client and the recorder are eclipse-zenoh, rosbags
and mcap; nothing of ours but the message files.
"""

import ast
import collections
import contextlib
import json
import os
import pathlib
import queue
import shlex
import shutil
import signal
import struct
import sys
import time
import tomllib

import zenoh
from mcap.writer import CompressionType, Writer

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path[:0] = [str(ROOT / "tests" / "interop" / "bus"), str(ROOT / "tests")]
import kit  # noqa: E402
from kit import until  # noqa: E402
from kit.session import definition  # noqa: E402
from messages import Messages  # noqa: E402

MESSAGES = Messages(ROOT / "msgs")


def asked(*words, folder, **more):
    return kit.run(BINARY, *words, folder=folder, environment=os.environ | more)


def running(*words, folder, **more):
    return kit.Process(BINARY, *words, folder=folder, environment=os.environ | more, apart=True)


@contextlib.contextmanager
def cell_that_is_ready(*words, folder, **more):
    """A cell, and what it has said that it is ready."""
    with running("up", *words, folder=folder, **more) as up:
        line = up.line()
        assert "is ready" in line, (line, up.errors)
        yield up, line


def own_cell(folder, bus="", planning=""):
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


@contextlib.contextmanager
def session():
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", '["tcp/127.0.0.1:7447"]')
    config.insert_json5("connect/timeout_ms", str(round(1000 * kit.patience(30))))
    config.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(config) as opened:
        yield opened


def tokens(opened, domain=0):
    return {str(reply.ok.key_expr) for reply in opened.liveliness().get(f"@ros2_lv/{domain}/**") if reply.ok}


def announced(opened, what, whole, domain=0):
    """The parts of all announcements once they are what is waited for: a question may catch the graph half told."""
    def found():
        told = [one.split("/") for one in tokens(opened, domain)]
        return whole(told) and told

    return until(what, found)


def channel(opened, kind, name, cell="turn_mill"):
    """Key of a topic or service of the cell, as its announcement names type and hash."""
    is_it = lambda one: (one[5], one[7], one[9:10]) == (kind, f"%{cell}", [f"%{cell}%{name.replace('/', '%')}"])
    told = announced(opened, f"{kind} {name}", lambda told: any(map(is_it, told)))
    (token,) = [one for one in told if is_it(one)]
    return "/".join([f"0/{cell}", name, *token[10:12]])


def replies(opened, key, payload, seconds=60.0):
    """What rmw_zenoh_cpp does: it hears replies, and no error."""
    got = opened.get(
        key, payload=payload, attachment=struct.pack("<qqB", 1, 1, 16) + bytes(16),
        target=zenoh.QueryTarget.ALL_COMPLETE, consolidation=zenoh.ConsolidationMode.NONE, timeout=kit.patience(seconds),
    )
    return [bytes(reply.ok.payload) for reply in got if reply.ok]


def call(opened, service, request, response, cell="turn_mill", **fields):
    payload = MESSAGES.encode(default(request, fields), request)
    answers = replies(opened, channel(opened, "SS", service, cell), payload)
    assert len(answers) == 1, f"{service}: {len(answers)} replies"
    return MESSAGES.decode(answers[0], response)


def default(name, fields):
    """A message with these fields; the others are those of an arbitrary message, which the service must stand too."""
    message = MESSAGES.random(name, 3)
    for key, value in fields.items():
        setattr(message, key, value)
    return message


def services_of_stopped_nodes(folder):
    """Each node that would answer is stopped: the launcher answers for it, in the type of the service."""
    # This session is a stranger.
    cell = own_cell(folder, 'strangers_call = ["plan", "run", "stop", "approve_correction"]')
    with cell_that_is_ready(cell, folder=folder) as (up, _), session() as opened:
        stopped = [kit.child(up.pid, "node", name) for name in ("cycle", "compensation", "path_planning", "machine_state")]
        with kit.paused(*stopped):
            for service, name, fields in [
                ("plan", "Plan", {"plan_id": "", "points": []}), ("run", "Run", {"part_id": "punch", "plan_id": ""}),
                ("stop", "Stop", {"operator_name": "Ada"}), ("approve_correction", "ApproveCorrection", {"approve": True}),
            ]:
                begun = time.monotonic()
                kind = f"probecell_msgs/srv/{name}"
                answer = call(opened, service, f"{kind}_Request", f"{kind}_Response", **fields)
                assert not answer.accepted and answer.text, (service, answer)
                print(f"  {service}: {answer.text} ({time.monotonic() - begun:.1f} s)", flush=True)


def counts(bag, folder):
    """Messages of each topic of a recording."""
    code, output, errors = asked("info", bag, "--json", folder=folder)
    assert code == 0, errors
    return {one["topic"]: one["messages"] for one in json.loads(output)["topics"]}


class Recorder:
    """Records every topic of a cell as rosbag2 does, from outside: no attachments, no tables of ours."""

    def __init__(self, opened, namespace):
        self.samples, self.taken = queue.Queue(), collections.Counter()
        self.subscriber = opened.declare_subscriber(f"0/{namespace}/**", self.take)

    def take(self, sample):
        key = str(sample.key_expr)
        if sample.attachment is not None and key.split("/")[-1].startswith("RIHS01_"):
            self.samples.put((key, bytes(sample.attachment), bytes(sample.payload), time.time_ns()))
            self.taken["/" + "/".join(key.split("/")[1:-2])] += 1
            kit.happened()

    def has(self, wanted):
        """At least so many messages of each topic that has been heard at all, and the report of the part."""
        heard = dict(self.taken)
        return any(one.endswith("/part_reports") for one in heard) and all(count >= wanted.get(topic, 0) for topic, count in heard.items())

    def write(self, path):
        with open(path, "wb") as stream:
            writer = Writer(stream, chunk_size=1 << 20, compression=CompressionType.ZSTD)
            writer.start(profile="ros2", library="outside")
            schemas, channels = {}, {}
            while not self.samples.empty():
                key, attachment, payload, received = self.samples.get()
                *name, kind, digest = key.split("/")
                topic, ros = "/" + "/".join(name[1:]), kind.replace("::msg::dds_::", "/")[:-1]
                if ros not in schemas:
                    schemas[ros] = writer.register_schema(ros.replace("/", "/msg/"), "ros2msg", definition(ros).encode())
                if topic not in channels:
                    channels[topic] = writer.register_channel(topic, "cdr", schemas[ros], {"topic_type_hash": digest})
                number, source, _ = struct.unpack_from("<qqB", attachment)
                writer.add_message(channels[topic], received, payload, source, number)
            writer.finish()
        return sorted(channels)


def a_bag_from_outside(folder):
    cell = own_cell(folder)
    with running("router", folder=folder) as router:
        assert "listens on" in router.line()
        with session() as opened:
            recorder = Recorder(opened, "turn_mill")
            code, output, errors = asked("up", cell, "--once", folder=folder)
            assert code == 0, (output, errors)
            (own,) = (folder / "recordings").glob("*")
            # Its last messages may still be on their way here.
            until("what the cell's own recorder has", lambda: recorder.has(counts(own, folder)))
            topics = recorder.write(folder / "outside.mcap")
    assert "/turn_mill/cell_description" in topics, topics
    code, output, errors = asked("replay", folder / "outside.mcap", folder=folder)
    assert code == 0 and "all outputs of all nodes are equal" in output, (code, output, errors)
    reports = []
    for bag in (own, folder / "outside.mcap"):
        code, output, errors = asked("diagnose", bag, "--json", folder=folder)
        assert code == 0, (code, output, errors)
        reports.append(json.loads(output) | {"bag": ""})
    assert reports[0] == reports[1], reports
    return own


def bags_convert(folder):
    """A recording of ours, by rosbags' converter without options; what it lists is what is there."""
    cell = own_cell(folder)
    code, output, errors = asked("up", cell, "--once", folder=folder)
    assert code == 0, (output, errors)
    (own,) = (folder / "recordings").glob("*")
    code, output, errors = kit.run(pathlib.Path(sys.executable).parent / "rosbags-convert", "--src", own, "--dst", folder / "converted")
    assert code == 0, (output, errors)
    from rosbags.highlevel import AnyReader

    listed = []
    for bag in (own, folder / "converted"):
        with AnyReader([bag]) as reader:
            listed.append({topic: one.msgcount for topic, one in reader.topics.items()})
        with AnyReader([bag]) as reader:
            # The health of the cell, as rosbags' own definition reads it.
            wanted = [one for one in reader.connections if one.topic == "/diagnostics"]
            health = [MESSAGES.decode(bytes(raw), "diagnostic_msgs/msg/DiagnosticArray") for _, _, raw in reader.messages(connections=wanted)]
            assert len(health) > 3, health
            named = {status.name for array in health for status in array.status}
            assert {"/turn_mill/compensation", "/turn_mill/recorder", "/turn_mill/machine"} <= named, named
            assert any(status.name == "/turn_mill/compensation" and status.message == "running" for status in health[-1].status)
    assert listed[0] == listed[1] and listed[0], listed
    code, output, errors = asked("replay", own, folder=folder)
    assert code == 0 and "all outputs of all nodes are equal" in output, (code, output, errors)
    assert "ros_distro: \"unknown\"" in (own / "metadata.yaml").read_text() or os.environ.get("ROS_DISTRO")


def domain_of_the_environment(folder):
    cell = own_cell(folder)
    code, _, errors = asked("status", "--cell", cell, folder=folder, ROS_DOMAIN_ID="many")
    assert code == 2 and "ROS_DOMAIN_ID" in errors, (code, errors)
    with cell_that_is_ready(cell, folder=folder, ROS_DOMAIN_ID="7"):
        with session() as opened:
            announced(opened, "the cell in domain 7", lambda told: any("turn_mill" in one[7] for one in told), 7)
            assert not tokens(opened, 0)
        code, output, errors = asked("status", "--cell", cell, folder=folder, ROS_DOMAIN_ID="7")
        assert code == 0, (output, errors)


def log_of_the_nodes(folder):
    """Each node publishes on /rosout as rcl does; who comes late gets what was logged, as a latched subscription of rmw_zenoh does."""
    cell = own_cell(folder)
    with cell_that_is_ready(cell, folder=folder) as (up, _), session() as opened:
        of_log = lambda told: [one for one in told if (one[5], one[9:10]) == ("MP", ["%rosout"])]
        nodes = lambda told: {one[8] for one in told if one[5] == "NN"}
        publishers = of_log(announced(opened, "a log of each node", lambda told: {one[8] for one in of_log(told)} == nodes(told) and len(nodes(told)) > 9))
        # As rcl announces it (traces of real nodes): transient local, depth 1000, lifespan 10 s.
        assert {one[12] for one in publishers} == {":1:,1000:,:10,0:,,"}, publishers
        kind, digest = publishers[0][10:12]
        killed = time.time()
        os.kill(kit.child(up.pid, "node", "gap"), signal.SIGKILL)

        def said():
            late = opened.get(f"0/rosout/{kind}/{digest}/@adv/pub/**?_anyke", target=zenoh.QueryTarget.ALL)
            logs = [MESSAGES.decode(bytes(reply.ok.payload), "rcl_interfaces/msg/Log") for reply in late if reply.ok]
            return [log for log in logs if log.msg.startswith("gap ended")]

        (log,) = until("a log that gap has ended", said)
        assert (log.level, log.name) == (30, "turn_mill.operator"), log
        assert int(killed) <= log.stamp.sec <= time.time(), log
        print(f"  {log.name}: {log.msg}", flush=True)


def settings(node):
    """Settings below a section of the cell file, as the parameters of its process name them."""
    found = {}

    def flatten(path, value):
        if isinstance(value, dict):
            for key, below in value.items():
                flatten([*path, key], below)
        elif isinstance(value, list) and any(isinstance(one, (dict, list)) for one in value):
            for index, below in enumerate(value):
                flatten([*path, str(index)], below)
        else:
            found[".".join(path)] = value

    flatten([], tomllib.loads((ROOT / "launch-scripts" / "turn_mill.toml").read_text())[node])
    return found


def value_of(parameter):
    fields = ["", "bool_value", "integer_value", "double_value", "string_value", "byte_array_value", "bool_array_value",
              "integer_array_value", "double_array_value", "string_array_value"]
    value = getattr(parameter, fields[parameter.type])
    return list(value) if parameter.type > 4 else value


PARAMETER_SERVICES = {
    "describe_parameters", "get_parameters", "get_parameter_types", "list_parameters", "set_parameters", "set_parameters_atomically",
    "get_type_description",
}


def parameter_call(opened, node, service, kind, **fields):
    package = "type_description_interfaces" if kind == "GetTypeDescription" else "rcl_interfaces"
    name = f"{package}/srv/{kind}"
    return call(opened, f"{node}/{service}", f"{name}_Request", f"{name}_Response", **fields)


def one_parameter(name, number):
    parameter = MESSAGES.random("rcl_interfaces/msg/Parameter", 1)
    parameter.name, parameter.value.type, parameter.value.integer_value = name, 2, number
    return parameter


def parameters_of_the_processes(folder):
    """What `ros2 param list, get, describe, set` and `ros2 topic echo /parameter_events` see."""
    cell = own_cell(folder)
    with cell_that_is_ready(cell, folder=folder) as (up, _), session() as opened:
        # The command `up` and the page that reads the cell are no processes of it.
        of_cell = lambda told, kind: [one for one in told if (one[5], one[7]) == (kind, "%turn_mill")]
        wanted = lambda told: {(one[8], service) for one in of_cell(told, "NN") for service in PARAMETER_SERVICES}
        served = lambda told: {(one[8], one[9].split("%")[-1]) for one in of_cell(told, "SS")}
        some = {"path_planning", "compensation", "cycle", "operator", "recorder", "simulator"}
        told = announced(opened, "the services of each process", lambda told: some <= {node for node, _ in wanted(told)} and wanted(told) <= served(told))
        nodes = {node for node, _ in wanted(told)}
        for node in ("path_planning", "compensation", "analysis", "recorder"):
            wanted = settings(node)
            listed = parameter_call(opened, node, "list_parameters", "ListParameters", prefixes=[], depth=0).result
            assert sorted(listed.names) == sorted([*wanted, "use_sim_time"]), listed
            names = list(wanted)
            values = parameter_call(opened, node, "get_parameters", "GetParameters", names=names).values
            assert {name: value_of(one) for name, one in zip(names, values, strict=True)} == wanted
            described = parameter_call(opened, node, "describe_parameters", "DescribeParameters", names=names).descriptors
            assert all(one.read_only for one in described) and [one.name for one in described] == names
            types = parameter_call(opened, node, "get_parameter_types", "GetParameterTypes", names=names).types
            assert list(types) == [one.type for one in values]
        print(f"  {len(nodes)} processes tell their parameters, for example {names[0]} = {value_of(values[0])}", flush=True)
        assert not parameter_call(opened, "cycle", "get_parameters", "GetParameters", names=["nothing"]).values
        kind, digest = "sensor_msgs/msg/JointState", MESSAGES.hash("sensor_msgs/msg/JointState")
        told = parameter_call(opened, "cycle", "get_type_description", "GetTypeDescription", type_name=kind, type_hash=digest, include_type_sources=True)
        fields = [one.name for one in told.type_description.type_description.fields]
        assert told.successful and fields == ["header", "name", "position", "velocity", "effort"], told
        assert [one.type_name for one in told.type_sources] == [kind, "std_msgs/msg/Header", "builtin_interfaces/msg/Time"]
        # A stranger reads them and sets none: the router takes no such request.
        request = MESSAGES.random("rcl_interfaces/srv/SetParameters_Request", 1)
        request.parameters = [one_parameter("max_corrections", 50)]
        setting = MESSAGES.encode(request, "rcl_interfaces/srv/SetParameters_Request")
        assert replies(opened, channel(opened, "SS", "compensation/set_parameters"), setting, 2.0) == []
        key = "0/parameter_events/*/*/@adv/pub/**?_anyke"

        def all_events():
            told = opened.get(key, target=zenoh.QueryTarget.ALL, consolidation=zenoh.ConsolidationMode.NONE)
            events = [MESSAGES.decode(bytes(one.ok.payload), "rcl_interfaces/msg/ParameterEvent") for one in told if one.ok]
            return {one.node for one in events} == {f"/turn_mill/{node}" for node in nodes} and events

        events = until("the events of each process", all_events)
        assert all(one.new_parameters[0].name == "use_sim_time" and not one.new_parameters[0].value.bool_value for one in events)
    cell = own_cell(folder, 'strangers = "write"')
    with cell_that_is_ready(cell, folder=folder) as (up, _), session() as opened:
        (answer,) = replies(opened, channel(opened, "SS", "compensation/set_parameters"), setting)
        (result,) = MESSAGES.decode(answer, "rcl_interfaces/srv/SetParameters_Response").results
        assert not result.successful and "read-only" in result.reason, result
        print(f"  set_parameters: {result.reason}", flush=True)


class ActionClient:
    """A client of an action of the cell by the rules of rmw_zenoh."""

    def __init__(self, opened, action, kind):
        self.opened, self.action, self.kind = opened, f"{action}/_action", f"probecell_msgs/action/{kind}"
        self.feedback, self.statuses = queue.Queue(), {}
        self.subscriptions = [
            opened.declare_subscriber(channel(opened, "MP", f"{self.action}/feedback"), self.take_feedback),
            opened.declare_subscriber(channel(opened, "MP", f"{self.action}/status"), self.take_status),
        ]

    def take_feedback(self, sample):
        self.feedback.put(MESSAGES.decode(bytes(sample.payload), f"{self.kind}_FeedbackMessage"))
        kit.happened()

    def take_status(self, sample):
        for one in MESSAGES.decode(bytes(sample.payload), "action_msgs/msg/GoalStatusArray").status_list:
            seen = self.statuses.setdefault(bytes(one.goal_info.goal_id.uuid), [])
            if not seen or seen[-1] != one.status:
                seen.append(one.status)
        kit.happened()

    def ask(self, part, request_name, response_name, edit, seconds=60.0):
        message = MESSAGES.random(request_name, 1)
        edit(message)
        got = replies(self.opened, channel(self.opened, "SS", f"{self.action}/{part}"), MESSAGES.encode(message, request_name), seconds)
        return [MESSAGES.decode(one, response_name) for one in got]

    def send(self, number, fill):
        def edit(request):
            request.goal_id.uuid[:] = number
            fill(request.goal)

        return self.ask("send_goal", f"{self.kind}_SendGoal_Request", f"{self.kind}_SendGoal_Response", edit)

    def result(self, number):
        def edit(request):
            request.goal_id.uuid[:] = number

        (answer,) = self.ask("get_result", f"{self.kind}_GetResult_Request", f"{self.kind}_GetResult_Response", edit, 300.0)
        return answer

    def cancel(self, number):
        def edit(request):
            request.goal_info.goal_id.uuid[:] = number
            request.goal_info.stamp.sec = request.goal_info.stamp.nanosec = 0

        (answer,) = self.ask("cancel_goal", "action_msgs/srv/CancelGoal_Request", "action_msgs/srv/CancelGoal_Response", edit)
        return answer.return_code, [bytes(one.goal_id.uuid)[0] for one in answer.goals_canceling]

    def passes_through(self, number, statuses):
        """The last status may come after the result."""
        seen = until("a status", lambda: self.statuses.get(bytes([number] * 16)))
        until(f"status {statuses[-1]}", lambda: seen[-1] == statuses[-1])
        assert seen == statuses, seen

    def fed(self, number, is_last):
        """Feedback on a goal until one that is the last."""
        told = []
        while not told or not is_last(told[-1]):
            until("feedback", lambda: not self.feedback.empty())
            message = self.feedback.get()
            assert bytes(message.goal_id.uuid) == bytes([number] * 16), message
            told.append(message.feedback)
        return told

    def left(self):
        """Feedback that has arrived."""
        told = []
        while not self.feedback.empty():
            told.append(self.feedback.get().feedback)
        return told

    def latched_statuses(self):
        late = self.opened.get(
            f"{channel(self.opened, 'MP', f'{self.action}/status')}/@adv/pub/**?_anyke", target=zenoh.QueryTarget.ALL
        )
        (late,) = [MESSAGES.decode(bytes(one.ok.payload), "action_msgs/msg/GoalStatusArray") for one in late if one.ok]
        return [one.status for one in late.status_list]


def the_part(name):
    def fill(goal):
        goal.part_id, goal.plan_id, goal.operator_name, goal.shown, goal.signature = name, "", "", "", goal.signature[:0]
        goal.expires.sec = goal.expires.nanosec = goal.signed_at.sec = goal.signed_at.nanosec = 0

    return fill


def run_as_an_action(folder):
    """What `ros2 action send_goal --feedback` does, and Ctrl-C in it."""
    cell = own_cell(folder, 'strangers_call = ["run"]')
    with cell_that_is_ready(cell, folder=folder), session() as opened:
        client = ActionClient(opened, "run", "RunPart")
        assert (client.result(9).status, client.cancel(9)) == (0, (2, [])), "an unknown goal"
        asked_at = int(time.time())
        (answer,) = client.send(1, the_part("first"))
        assert answer.accepted and asked_at <= answer.stamp.sec <= time.time(), answer
        (second,) = client.send(2, the_part("second"))
        assert not second.accepted and second.stamp.sec == 0, "two parts at once"
        (again,) = client.send(1, the_part("again"))
        assert not again.accepted, "an identifier twice"
        assert client.result(2).status == 0, "a refused goal"
        ended = client.result(1)
        report = ended.result.report
        assert (ended.status, report.part_id, report.verdict, report.run_id) == (4, "first", 0, "first"), ended
        told = set()

        def fed():
            """Feedback may come after the result."""
            told.update(feedback.status.stage for feedback in client.left())
            return {1, 2} <= told  # cutting, measuring

        until("feedback on the part", fed)
        client.passes_through(1, [1, 2, 4])
        assert client.cancel(1) == (3, []), "a goal that has ended"
        print(f"  first: {ended.result.text or 'qualified'}, after {report.passes} passes", flush=True)
        (answer,) = client.send(3, the_part("third"))
        assert answer.accepted
        client.fed(3, lambda feedback: feedback.status.stage == 1)
        begun = time.monotonic()
        assert client.cancel(3) == (0, [3])
        stopped = time.monotonic() - begun
        ended = client.result(3)
        assert (ended.status, ended.result.report.part_id, ended.result.report.verdict) == (5, "third", 2), ended
        client.passes_through(3, [1, 2, 3, 5])
        print(f"  third: canceled, the machine stands after {stopped:.1f} s: {ended.result.text}", flush=True)
        assert client.latched_statuses()[-1] == 5
    cell = own_cell(folder)
    with cell_that_is_ready(cell, folder=folder), session() as opened:
        client = ActionClient(opened, "run", "RunPart")
        assert client.send(4, the_part("stranger")) == [] and not client.statuses, "a stranger's goal"


def the_plan(plan_id="", points=False):
    def fill(goal):
        goal.plan_id = plan_id
        if not points:
            goal.points = []

    return fill


TRANSITS, SEARCHING, DONE, GIVEN_UP = range(4)


def plan_as_an_action(folder):
    """What `ros2 action send_goal --feedback` does with `plan`, and Ctrl-C in it."""
    cell = own_cell(folder, 'strangers_call = ["plan"]')
    code, output, errors = asked("plan", cell, "--json", folder=folder)
    assert code == 0, errors
    known = json.loads(output)  # by the command, in a process of its own
    with cell_that_is_ready(cell, folder=folder) as (up, _), session() as opened:
        client = ActionClient(opened, "plan", "PlanMeasurement")
        asked_at = int(time.time())
        (answer,) = client.send(1, the_plan())
        assert answer.accepted and asked_at <= answer.stamp.sec <= time.time(), answer
        ended = client.result(1)
        result = ended.result
        assert (ended.status, result.plan_id, result.touches) == (4, "preview", len(known["order"])), ended
        for key in ("air_time", "given_air_time", "air_length", "given_air_length"):
            assert getattr(result, key) == known[key] > 0, (key, result, known[key])
        told = [feedback.progress for feedback in client.fed(1, lambda feedback: feedback.progress.phase == DONE)]
        assert {one.plan_id for one in told} == {"preview"} and [one.phase for one in told] == sorted(one.phase for one in told), told
        assert {TRANSITS, SEARCHING, DONE} == {one.phase for one in told}, told
        assert all(one.air_time >= result.air_time * (1 - 1e-12) for one in told if one.phase == SEARCHING), told
        client.passes_through(1, [1, 2, 4])
        assert client.cancel(1) == (3, []), "a goal that has ended"
        print(f"  {result.text}; told in {len(told)} steps", flush=True)
        # Points without a name: what the planner refuses is aborted, with the reason.
        (answer,) = client.send(2, the_plan(points=True))
        assert answer.accepted
        ended = client.result(2)
        assert ended.status == 6 and ended.result.text and not ended.result.touches, ended
        print(f"  refused: {ended.result.text}", flush=True)
        client.passes_through(2, [1, 2, 6])
    # A search that takes for ever.
    cell = own_cell(folder, 'strangers_call = ["plan"]', "kicks = 1_000_000_000_000")
    with cell_that_is_ready(cell, folder=folder) as (up, _), session() as opened:
        client = ActionClient(opened, "plan", "PlanMeasurement")
        for number in (3, 5):  # the second finds the planner free
            (answer,) = client.send(number, the_plan())
            assert answer.accepted
            client.fed(number, lambda feedback: feedback.progress.phase == SEARCHING and feedback.progress.share > 0)
            (second,) = client.send(4, the_plan())
            assert not second.accepted, "two goals at once"
            begun = time.monotonic()
            assert client.cancel(number) == (0, [number])
            stopped = time.monotonic() - begun
            ended = client.result(number)
            assert (ended.status, ended.result.touches) == (5, 0) and "cancelled" in ended.result.text, ended
            client.passes_through(number, [1, 2, 3, 5])
            client.left()
        print(f"  canceled within {stopped:.2f} s: {ended.result.text}", flush=True)
        assert client.latched_statuses()[-1] == 5


def launch_file():
    """The arguments of the launch file and its function that makes a command of them, without ROS 2's package `launch`."""
    path = ROOT / "launch-scripts" / "cell.launch.py"
    tree = ast.parse(path.read_text())
    wanted = [
        one for one in tree.body
        if isinstance(one, ast.FunctionDef) and one.name == "command" or isinstance(one, ast.Assign) and one.targets[0].id == "ARGUMENTS"
    ]
    assert len(wanted) == 2, wanted
    known = {"pathlib": pathlib, "shlex": shlex, "__file__": str(path)}
    exec(compile(ast.Module(wanted, []), str(path), "exec"), known)
    return known["command"], {name: default for name, (default, _) in known["ARGUMENTS"].items()}


def arguments_of_a_launch(folder):
    """What the launch file starts: a second cell of the same file, with another name, settings and outside names."""
    command, defaults = launch_file()
    assert command(**defaults) == ["probecell", "up", str(ROOT / "launch-scripts" / "turn_mill.toml")], command(**defaults)
    cell = own_cell(folder)
    words = command(**defaults | {
        "cell": str(cell), "name": "cell_2", "dashboard": "false", "remap": "/tf:=/hall/tf /diagnostics:=/hall/health",
        "settings": "path_planning:clearance_mm:=-15.0 'compensation:max_corrections:=7'",
    })
    name = words[words.index("--ros-args"):][-2:]
    assert words[0] == "probecell" and name == ["-r", "__ns:=/cell_2"], words
    assert words[1] == "up"
    with cell_that_is_ready(*words[2:], folder=folder) as (up, line), session() as opened:
        assert "cell_2 is ready" in line and " ".join(["--ros-args", *name]) in line, line
        outside = lambda told: {one[9] for one in told if one[5] == "MP" and not one[9].startswith("%cell_2%")}
        names = {"%hall%tf", "%hall%health", "%tf_static", "%rosout", "%parameter_events"}
        told = announced(opened, "what the cell says outside of its namespace", lambda told: outside(told) >= names)
        assert outside(told) == names, outside(told)
        assert {one[7] for one in told if one[5] == "NN"} >= {"%cell_2"} and not any("%turn_mill" in one[7] for one in told), told
        for node, setting, value in [("path_planning", "clearance_mm", -15.0), ("compensation", "max_corrections", 7)]:
            kind = "rcl_interfaces/srv/GetParameters"
            answer = call(opened, f"{node}/get_parameters", f"{kind}_Request", f"{kind}_Response", cell="cell_2", names=[setting])
            assert [value_of(one) for one in answer.values] == [value], (node, answer)
        code, output, errors = asked("run", "punch", "--cell", cell, "--ros-args", *name, folder=folder)
        assert code == 0, (output, errors)
        print(f"  {up.says('punch: ')}", flush=True)
    (own,) = (folder / "recordings").glob("cell_2_*")
    code, output, errors = asked("replay", own, folder=folder)
    assert code == 0 and "all outputs of all nodes are equal" in output, (code, output, errors)
    code, output, errors = asked("info", own, "--json", folder=folder)
    recorded = {one["topic"] for one in json.loads(output)["topics"]}
    assert "/hall/health" in recorded and "/cell_2/joint_states" in recorded, recorded
    code, _, errors = asked("diagnose", own, "--ros-args", *name, folder=folder)
    assert code == 2 and "--ros-args: not accepted by this command" in errors, errors
    code, _, errors = asked("up", cell, "--ros-args", "-r", "joint_states:=js", folder=folder)
    assert code == 2 and errors.startswith("probecell: --ros-args -r joint_states:=js: names that are remapped are absolute"), errors
    try:
        import launch
    except ImportError:
        launch = None
    if launch is None or not hasattr(launch, "LaunchService"):
        print("  skipped: the description itself, for which ROS 2's package launch is needed", flush=True)
        return
    os.environ["PATH"] = f"{pathlib.Path(BINARY).parent}:{os.environ['PATH']}"
    source = launch.launch_description_sources.PythonLaunchDescriptionSource(str(ROOT / "launch-scripts" / "cell.launch.py"))
    included = launch.actions.IncludeLaunchDescription(source, launch_arguments={"cell": str(cell), "once": "true"}.items())
    service = launch.LaunchService(noninteractive=True)
    service.include_launch_description(launch.LaunchDescription([included]))
    assert service.run() == 0


def main():
    checks = {
        "services": services_of_stopped_nodes, "outside": a_bag_from_outside, "convert": bags_convert,
        "domain": domain_of_the_environment, "log": log_of_the_nodes,
        "parameters": parameters_of_the_processes, "run": run_as_an_action, "plan": plan_as_an_action,
        "launch": arguments_of_a_launch,
    }
    kit.main(checks, sys.argv[2:])


if __name__ == "__main__":
    BINARY = str(pathlib.Path(sys.argv[1]).resolve())
    main()
