#!/usr/bin/env python3
"""A cell on one host, its recorder on another, a router between. The link to the recorder is cut for ten seconds while the part is measured.

    check.py PROBECELL

No probe event may be missing from the bag; what is lost of the unbounded streams (axis samples) must be reported by number. Needs root.
"""

import json
import pathlib
import shutil
import sys

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path.append(str(ROOT / "tests"))
import kit  # noqa: E402
from kit.recordings import raw  # noqa: E402

CUT = 10  # s
WHOLE = (
    "probe_events", "probe_triggers", "inspection_plan", "feature_results", "verdicts", "corrections", "pass_decisions", "part_reports",
    "machine_state/steps",
)
TOUCHES = 96  # of three measurements of 32


def on_disk(folder):
    """Messages of each topic that is recorded, so far."""
    _, output, _ = kit.run(PROGRAM, "info", folder / "bag", "--json", folder=folder)
    return {one["topic"].removeprefix("/turn_mill/"): one["messages"] for one in json.loads(output)["topics"]} if output else {}


def is_whole(folder):
    """The report of the part is recorded, and no number is missing of the topics of which none may be."""
    if not on_disk(folder).get("part_reports"):
        return False
    with kit.new_folder() as place:
        copy = pathlib.Path(place) / "bag"
        kit.run(PROGRAM, "recover", folder / "bag", copy, folder=folder)
        numbers = {topic: set() for topic in WHOLE}
        for channel, message in raw(copy):
            if (topic := channel.topic.removeprefix("/turn_mill/")) in numbers:
                numbers[topic].add(message.sequence)
    return all(own and len(own) == max(own) - min(own) + 1 for own in numbers.values()) and len(numbers["probe_events"]) == TOUCHES


def main(folder):
    cell_host, router_host, recorder_host = kit.Host(), kit.Host(), kit.Host()
    near, far = kit.Cable(router_host, cell_host, 1), kit.Cable(router_host, recorder_host, 2)
    shutil.copy(ROOT / "launch-scripts" / "turn_mill.urdf", folder)
    text = (ROOT / "launch-scripts" / "turn_mill.toml").read_text()
    assert "tcp/127.0.0.1:7447" in text
    endpoints = {name: f"tcp/{cable.addresses[0]}:7447" for name, cable in (("cell", near), ("recorder", far))}
    for name, endpoint in endpoints.items():
        (folder / f"{name}.toml").write_text(text.replace("tcp/127.0.0.1:7447", endpoint))

    def started(host, *words):
        return kit.Process(*host.inside, PROGRAM, *words, folder=folder)

    listens = [word for endpoint in endpoints.values() for word in ("--listen", endpoint)]
    with started(router_host, "router", "--strangers", "write", *listens) as router:
        router.says("listens on")
        with started(recorder_host, "record", "--cell", "recorder.toml", "--folder", folder / "bag") as recorder:
            kit.until("a recording", (folder / "bag" / "bag_0.mcap").exists)
            with started(cell_host, "up", "cell.toml", "--once", "--no-record") as cell:
                kit.until("a touch", lambda: on_disk(folder).get("probe_events"))
                far.pull()
                kit.pause(CUT, "the outage")
                far.plug()
                code, output, _ = cell.ended()
                assert code == 0, output
            # What was missed is fetched.
            kit.until("a whole recording", lambda: recorder.code is not None or is_whole(folder))
            status = recorder.end()
    code, output, errors = kit.run(PROGRAM, "info", folder / "bag", "--json", folder=folder)
    topics = {one["topic"]: one for one in json.loads(output)["topics"]}
    missing = lambda one: one["losses"]["queue"] + one["losses"]["bus"] - one["losses"]["recovered"]
    for name in WHOLE:
        one = topics[f"/turn_mill/{name}"]
        print(f"{name}: {one['messages']} recorded, {missing(one)} missing")
        assert missing(one) == 0, (name, recorder.output)
    assert topics["/turn_mill/probe_events"]["messages"] == TOUCHES
    lost = sum(map(missing, topics.values()))
    print(f"{lost} messages of other topics reported lost")
    assert lost > 0, "a cut of ten seconds costs axis samples: not to report them would be a lie"
    assert status == 3, "a recording with loss ends with status 3"
    assert recorder.has_said("from number"), recorder.output


PROGRAM = pathlib.Path(sys.argv[1]).resolve()
kit.main({"two hosts": main})
