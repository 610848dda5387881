"""The services of a running cell's recorder, called by zenoh-ros2-sdk: a recording ends, another begins, both are whole."""

import argparse
import collections
import json
import logging
import pathlib
import shutil

import zenoh
from zenoh_ros2_sdk import ROS2ServiceClient, ZenohSession

from messages import Messages
from peer import check, kit

from kit.recordings import raw


def wait_for_services(session, names):
    """Until the cell has announced that it serves them."""
    missing = set(names)

    def announced(sample):
        if sample.kind == zenoh.SampleKind.PUT:
            missing.difference_update([name for name in missing if f"%{name}/" in str(sample.key_expr)])
        kit.happened()

    subscriber = session.liveliness().declare_subscriber("@ros2_lv/0/*/*/*/SS/**", announced, history=True)
    kit.until(f"services {names}", lambda: not missing)
    subscriber.undeclare()


def call(root, name, kind, **fields):
    request, response = (root / f"srv/{kind}.srv").read_text().split("---\n")
    client = ROS2ServiceClient(
        service_name=f"/turn_mill/{name}", srv_type=f"probecell_msgs/srv/{kind}", request_definition=request,
        response_definition=response, timeout=kit.patience(30), domain_id=0, namespace="/other",
    )
    answer = client.call(**fields)
    client.close()
    assert answer is not None, f"{name} did not answer"
    return answer


def holds(probecell, folder, topic):
    """Whether the unfinished recordings below a folder hold a message of this topic on disk."""
    for recording in folder.glob("*"):
        _, output, _ = kit.run(probecell, "info", recording, "--json")
        if output and any(one["topic"] == topic and one["messages"] for one in json.loads(output)["topics"]):
            return True
    return False


def messages_in(folder):
    """Messages of each topic in a recording that is closed, and its metadata beside it."""
    assert (folder / "metadata.yaml").exists(), f"{folder} has no metadata.yaml"
    return collections.Counter(channel.topic for channel, _ in raw(folder))


def main(scratch):
    parser = argparse.ArgumentParser()
    parser.add_argument("--probecell", required=True)
    parser.add_argument("--msgs", required=True, help="the interface package")
    parser.add_argument("--cell", required=True, help="a cell file of the simulated turn-mill")
    options = parser.parse_args()
    logging.getLogger("zenoh_ros2_sdk").setLevel(logging.ERROR)
    root = pathlib.Path(options.msgs).resolve()
    source, probecell = pathlib.Path(options.cell).resolve(), pathlib.Path(options.probecell).resolve()
    # The peer is a stranger: the cell file opens to it the two services that it calls.
    cell = scratch / source.name
    text = source.read_text()
    assert text.count("\n[bus]\n") == 1
    cell.write_text(text.replace("\n[bus]\n", '\n[bus]\nstrangers_call = ["start_recording", "stop_recording"]\n'))
    shutil.copy(source.with_name("turn_mill.urdf"), scratch)
    with kit.Process(probecell, "up", cell, folder=scratch) as up:
        up.says("is ready")
        session = ZenohSession.get_instance("127.0.0.1", 7447)
        try:
            session.store = Messages(root).store
            session._registered_types.update({name: name for name in session.store.types if "/srv/" not in name})
            wait_for_services(session.session, ["start_recording", "stop_recording"])
            description = "/turn_mill/robot_description"
            kit.until("a recording", lambda: holds(probecell, scratch / "recordings", description))
            first = call(root, "stop_recording", "StopRecording")
            check("stopped", (first.accepted, first.messages > 0), (True, True))
            count = messages_in(scratch / first.uri)
            check("messages told", sum(count.values()), first.messages)
            check("stopped twice", call(root, "stop_recording", "StopRecording").accepted, False)
            check("outside", call(root, "start_recording", "StartRecording", uri="../outside").accepted, False)
            again = call(root, "start_recording", "StartRecording", uri="again")
            check("started", (again.accepted, again.uri), (True, "recordings/again"))
            check("started twice", call(root, "start_recording", "StartRecording", uri="more").accepted, False)
            second = call(root, "stop_recording", "StopRecording")
            count = messages_in(scratch / second.uri)
            # What was published once, before this recording began, is in it all the same.
            check("latched", count.get(description), 1)
        finally:
            # Threads of an open session keep the process from ending.
            session.close()


if __name__ == "__main__":
    kit.main({"recording on demand": main})
