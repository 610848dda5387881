#!/usr/bin/env python3
"""What a ROS 2 user expects beside the topics: services that answer, bags that anybody may record, bags that convert.

    check.py PROBECELL [services|outside|convert|domain|log]...

Runs in a network namespace of its own (the router's port is taken). The client and the recorder are eclipse-zenoh, rosbags
and mcap; nothing of ours but the message files.
"""

import contextlib
import json
import os
import pathlib
import queue
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time

import zenoh
from mcap.writer import CompressionType, Writer

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path[:0] = [str(ROOT / "tests" / "interop" / "bus"), str(ROOT / "tests" / "cli")]
from messages import Messages  # noqa: E402
from session import definition  # noqa: E402

PATIENCE = 120  # s
MESSAGES = Messages(ROOT / "msgs")


def until(what, ready):
    deadline = time.monotonic() + PATIENCE
    while not (found := ready()):
        assert time.monotonic() < deadline, f"{what}: not within {PATIENCE} s"
        time.sleep(0.05)
    return found


def environment(folder, **more):
    return os.environ | {"XDG_CONFIG_HOME": str(folder / "config")} | more


def asked(*words, folder, **more):
    told = subprocess.run(
        [BINARY, *map(str, words)], cwd=folder, capture_output=True, text=True, timeout=2 * PATIENCE,
        env=environment(folder, **more),
    )
    return told.returncode, told.stdout, told.stderr


@contextlib.contextmanager
def running(*words, folder, **more):
    process = subprocess.Popen(
        [BINARY, *map(str, words)], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        env=environment(folder, **more),
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
        process.communicate(timeout=PATIENCE)


def own_cell(folder):
    for name in ("turn_mill.toml", "turn_mill.urdf"):
        shutil.copy(ROOT / "launch-scripts" / name, folder)
    return folder / "turn_mill.toml"


@contextlib.contextmanager
def session():
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", '["tcp/127.0.0.1:7447"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(config) as opened:
        yield opened


def process_of(launcher, name):
    children = pathlib.Path(f"/proc/{launcher.pid}/task/{launcher.pid}/children").read_text().split()
    for child in children:
        if pathlib.Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0")[1:3] == [b"node", name.encode()]:
            return int(child)
    raise AssertionError(f"no process of {name} among {children}")


def tokens(opened, domain=0):
    return {str(reply.ok.key_expr) for reply in opened.liveliness().get(f"@ros2_lv/{domain}/**") if reply.ok}


def call(opened, service, request, response, **fields):
    """What rmw_zenoh_cpp does: it hears replies, and no error."""
    (token,) = [one for one in tokens(opened) if "/SS/%/%turn_mill/" in one and f"/%turn_mill%{service}/" in one]
    kind, digest = token.split("/")[10:12]
    payload = MESSAGES.encode(default(request, fields), request)
    replies = opened.get(
        f"0/turn_mill/{service}/{kind}/{digest}", payload=payload, attachment=struct.pack("<qqB", 1, 1, 16) + bytes(16),
        target=zenoh.QueryTarget.ALL_COMPLETE, consolidation=zenoh.ConsolidationMode.NONE, timeout=60.0,
    )
    answers = [MESSAGES.decode(bytes(reply.ok.payload), response) for reply in replies if reply.ok]
    assert len(answers) == 1, f"{service}: {len(answers)} replies"
    return answers[0]


def default(name, fields):
    """A message with these fields; the others are those of an arbitrary message, which the service must stand too."""
    message = MESSAGES.random(name, 3)
    for key, value in fields.items():
        setattr(message, key, value)
    return message


def services_of_stopped_nodes(folder):
    """Each node that would answer is stopped: the launcher answers for it, in the type of the service."""
    cell = own_cell(folder)
    # This session is a stranger.
    opened = '[bus]\nstrangers_call = ["plan", "run", "stop", "approve_correction"]\n'
    cell.write_text(cell.read_text().replace("[bus]\n", opened, 1))
    with running("up", cell, folder=folder) as up, contextlib.ExitStack() as stack:
        line = up.stdout.readline()
        assert "is ready" in line, line
        opened = stack.enter_context(session())
        stopped = [process_of(up, name) for name in ("cycle", "compensation", "path_planning", "machine_state")]
        for process in stopped:
            os.kill(process, signal.SIGSTOP)
        try:
            for service, name, fields in [
                ("plan", "Plan", {"plan_id": "", "points": []}), ("run", "Run", {"part_id": "punch", "plan_id": ""}),
                ("stop", "Stop", {"operator_name": "Ada"}), ("approve_correction", "ApproveCorrection", {"approve": True}),
            ]:
                begun = time.monotonic()
                kind = f"probecell_msgs/srv/{name}"
                answer = call(opened, service, f"{kind}_Request", f"{kind}_Response", **fields)
                assert not answer.accepted and answer.text, (service, answer)
                print(f"  {service}: {answer.text} ({time.monotonic() - begun:.1f} s)", flush=True)
        finally:
            for process in stopped:
                os.kill(process, signal.SIGCONT)


class Recorder:
    """Records every topic of a cell as rosbag2 does, from outside: no attachments, no tables of ours."""

    def __init__(self, opened, namespace):
        self.samples = queue.Queue()
        self.namespace = namespace
        self.subscriber = opened.declare_subscriber(f"0/{namespace}/**", self.take)

    def take(self, sample):
        if sample.attachment is not None and str(sample.key_expr).split("/")[-1].startswith("RIHS01_"):
            self.samples.put((str(sample.key_expr), bytes(sample.attachment), bytes(sample.payload), time.time_ns()))

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
    with running("router", folder=folder), contextlib.ExitStack() as stack:
        until("a router", lambda: subprocess.run(["bash", "-c", "echo > /dev/tcp/127.0.0.1/7447"], stderr=subprocess.DEVNULL).returncode == 0)
        recorder = Recorder(stack.enter_context(session()), "turn_mill")
        code, output, errors = asked("up", cell, "--once", folder=folder)
        assert code == 0, (output, errors)
        topics = recorder.write(folder / "outside.mcap")
    assert "/turn_mill/cell_description" in topics, topics
    code, output, errors = asked("replay", folder / "outside.mcap", folder=folder)
    assert code == 0 and "all outputs of all nodes are equal" in output, (code, output, errors)
    (own,) = (folder / "recordings").glob("*")
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
    told = subprocess.run(
        [pathlib.Path(sys.executable).parent / "rosbags-convert", "--src", own, "--dst", folder / "converted"],
        capture_output=True, text=True,
    )
    assert told.returncode == 0, (told.stdout, told.stderr)
    from rosbags.highlevel import AnyReader

    counts = []
    for bag in (own, folder / "converted"):
        with AnyReader([bag]) as reader:
            counts.append({topic: one.msgcount for topic, one in reader.topics.items()})
    assert counts[0] == counts[1] and counts[0], counts
    assert "ros_distro: \"unknown\"" in (own / "metadata.yaml").read_text() or os.environ.get("ROS_DISTRO")


def domain_of_the_environment(folder):
    cell = own_cell(folder)
    code, _, errors = asked("status", "--cell", cell, folder=folder, ROS_DOMAIN_ID="many")
    assert code == 2 and "ROS_DOMAIN_ID" in errors, (code, errors)
    with running("up", cell, folder=folder, ROS_DOMAIN_ID="7") as up:
        assert "is ready" in up.stdout.readline()
        with session() as opened:
            assert any("/turn_mill" in one or "%turn_mill" in one for one in tokens(opened, 7))
            assert not tokens(opened, 0)
        code, output, errors = asked("status", "--cell", cell, folder=folder, ROS_DOMAIN_ID="7")
        assert code == 0, (output, errors)


def log_of_the_nodes(folder):
    """Each node publishes on /rosout as rcl does; who comes late gets what was logged, as a latched subscription of rmw_zenoh does."""
    cell = own_cell(folder)
    with running("up", cell, folder=folder) as up, contextlib.ExitStack() as stack:
        assert "is ready" in up.stdout.readline()
        opened = stack.enter_context(session())
        publishers = [one.split("/") for one in tokens(opened) if "/MP/" in one and "/%rosout/" in one]
        assert {one[8] for one in publishers} == {one.split("/")[8] for one in tokens(opened) if "/NN/" in one}, publishers
        assert len(publishers) > 9
        assert {one[12].split(":")[1] for one in publishers} == {"1"}, publishers  # transient local
        kind, digest = publishers[0][10:12]
        os.kill(process_of(up, "gap"), signal.SIGKILL)

        def said():
            late = opened.get(f"0/rosout/{kind}/{digest}/@adv/pub/**?_anyke", target=zenoh.QueryTarget.ALL)
            logs = [MESSAGES.decode(bytes(reply.ok.payload), "rcl_interfaces/msg/Log") for reply in late if reply.ok]
            return [log for log in logs if log.msg.startswith("gap ended")]

        (log,) = until("a log that gap has ended", said)
        assert (log.level, log.name) == (30, "turn_mill.operator"), log
        assert abs(time.time() - log.stamp.sec) < PATIENCE, log
        print(f"  {log.name}: {log.msg}", flush=True)


def main():
    checks = {
        "services": services_of_stopped_nodes, "outside": a_bag_from_outside, "convert": bags_convert,
        "domain": domain_of_the_environment, "log": log_of_the_nodes,
    }
    for name in sys.argv[2:] or checks:
        with tempfile.TemporaryDirectory() as folder:
            checks[name](pathlib.Path(folder))
        print(f"{name}: good", flush=True)


if __name__ == "__main__":
    BINARY = str(pathlib.Path(sys.argv[1]).resolve())
    main()
