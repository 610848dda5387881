#!/usr/bin/env python3
"""Bad input to the command line: every case ends soon, with the right status and one clear sentence, never a panic.

    bad_input.py PROBECELL [WORD]      WORD: only cases whose name contains it

Exit status asked of each case: 2 bad input, 3 finished with loss, 1 something else failed (a bus, a port), 0 good. With
status 1 and 2 standard output is empty and standard error holds one line, `probecell: ...`; with 0 and 3 it holds
warnings only. The bags are made here (tests/kit/session.py); a few cases use one of ../shared and are skipped without it. Keys and
sockets of each case are its own.
"""

import collections
import concurrent.futures
import contextlib
import copy
import json
import math
import os
import pathlib
import random
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
TRIAL = ROOT.parent / "shared" / "trials" / "dev" / "21_punch.mcap"
SOON = 60  # s
SLOW = 15  # s, worth a line
LONGEST_SENTENCE = 400  # characters
NOBODY = 65534

sys.path.append(str(ROOT / "tests"))
import kit  # noqa: E402
from kit.session import START, Session, header  # noqa: E402
from mcap.writer import CompressionType  # noqa: E402

CASES = []


def case(command, status, says=None, warns=None, **options):
    """Registers a case: the decorated function makes its input in a folder, and names what it made.

    `command` holds {} where the input goes. `says`: what the sentence must match; `warns`: what a warning must.
    """

    def register(make):
        statuses = status if isinstance(status, tuple) else (status,)
        name = command.replace("{}", make.__name__)
        CASES.append((name, make, command, statuses, says, warns, options))
        return make

    return register


class Skip(Exception):
    """The case needs something that is not here."""


# ---------------------------------------------------------------------------------------------------------- files

READERS = ("info {}", "diagnose {}", "plan {}", "replay {}", "recover {} saved", "play {}", "stream --bag {} probe_events")


def of_readers(status, says=None, commands=READERS):
    def register(make):
        for command in commands:
            case(command, status, says)(make)
        return make

    return register


@of_readers(2, "not an MCAP file|cut off at byte 0|no messages", ("diagnose {}", "plan {}", "replay {}", "play {}"))
@of_readers(3, None, ("info {}", "recover {} saved"))
def empty_file(folder):
    return touch(folder / "bag.mcap", b"")


@case("correct {} --tolerance-um 40", 2, "not an MCAP file")
@of_readers(2, "not an MCAP file|magic")
def text_file(folder):
    return touch(folder / "bag.mcap", b"X Y Z\n1 2 3\n" * 100)


@case("scenario run {}", 2, 'there is no scenario "C-slp": did you mean "C-slip"')
def scenario_of_no_name(_):
    return "C-slp"


@case("scenario run C-slip C-shaft --html {}", 2, "2 scenarios do not go into one page: --html needs a folder, not .*one.html")
def two_scenarios_in_one_page(folder):
    return folder / "one.html"


@case("correct {} --tolerance-um 40", 2, "0 features that are profiles")
def part_without_a_profile(folder):
    return Session().write(folder / "bag.mcap")


@of_readers(2, "not a|neither a file|cut off at byte 0|no messages", ("diagnose {}", "plan {}", "replay {}", "play {}"))
def device_null(_):
    return "/dev/null"


@of_readers(2, "not a|neither a file|cut off at byte 0", ("diagnose {}", "plan {}"))
def endless_device(_):
    return "/dev/zero"


@of_readers(2, "regular|pipe|not an MCAP|neither a file", ("info {}", "diagnose {}", "stream --bag {} probe_events"))
def pipe_without_writer(folder):
    os.mkfifo(folder / "bag.mcap")
    return folder / "bag.mcap"


@of_readers(2, "No such file|cannot")
def missing_file(folder):
    return folder / "bag.mcap"


@of_readers(2, "no .mcap file")
def folder_without_bag(folder):
    touch(folder / "bag" / "readme.txt", b"nothing here")
    return folder / "bag"


@of_readers(2, "ermission denied")
def unreadable_file(folder):
    path = Session().write(folder / "bag.mcap")
    path.chmod(0)
    return path


PRINTED = "AXES X Y Z\r\nTOUCH 1 0 1.5 -22. -5.\r\nTOUCH 2 1 {} -22. -5.\r\n"


def results(name, content, says, status=2, command="results {}", **options):
    """A file of a controller that is refused with line and column."""

    def make(folder):
        return touch(folder / "results.txt", content if isinstance(content, bytes) else content.encode())

    make.__name__ = f"results_{name}"
    case(command, status, says, **options)(make)


results("good", PRINTED.format(1.5), None, 0)
results("broken_number", PRINTED.format("1.5.2"), "line 3, column 11: expected a finite number")
results("infinite_number", PRINTED.format("inf"), "line 3, column 11: expected a finite number")
results("cut_off_in_a_line", PRINTED.format(1.5)[:-8], "line 3, column 17: expected a finite number")
results("other_format", PRINTED.format(1.5), "line 1, column 1: expected COMPONENT", command="results {} --format inspection")
results("empty", "", "line 1, column 1: expected a printed touch.*end of the file")
results("garbage", "\x00\x01hello\n", "line 1, column 1: expected a printed touch")
results("bytes_that_are_not_text", b"AXES X\nTOUCH 1 0 \xff\n", "line 2, column 11: expected text in UTF-8, found byte 0xff")
results("line_without_end", b"x" * 200_000, "line 1, column 65537")
results("surface_cut_off", "START\nG802 N1 DEVIATION .012\n", "line 2, column 1: expected END")
results("log_of_another_field", "TOUCH 1 0 $AA_MM[X]=1. R5=2\n", "line 1, column 24: expected \\$AA_MM")
results("program_that_did_not_end", "begin probecell 2 0\nnext 1 0\ntouch 1 0 1.5\n", None, 3, warns="the measuring program did not finish")
results("no_touch_for_a_plan", "R5=2\n", "no touch", command=f"results {{}} --plan {ROOT}/launch-scripts/linuxcnc_bore.toml")
results("point_that_is_not_there", "AXES X Y Z\nTOUCH 1 99 1. 2. 3.\n", "point 99, but the plan has 10", command=f"results {{}} --plan {ROOT}/launch-scripts/linuxcnc_bore.toml")
results("axis_that_is_not_there", "AXES X Y C\nTOUCH 1 0 1. 2. 3.\n", "no axis C", command=f"results {{}} --plan {ROOT}/launch-scripts/linuxcnc_bore.toml")


@case("statu {}", 2, "there is no command statu")
@case("results {}", 2, "not a regular file")
def results_of_a_device(_):
    return "/dev/zero"


@case("program {} --controller fanuc", 2, "give --clearance AXIS=MM")
@case("program {} --controller sinumerik --clearance Q=5", 2, "not a linear axis")
@case("program {} --controller linuxcnc --axis X", 2, "--clearance AXIS=MM|NAME=LETTER")
def program_of_a_bag_without_a_cell(folder):
    return Session().write(folder / "bag.mcap")


@case(f"program {ROOT}/launch-scripts/linuxcnc_bore.toml --controller fanuc --measured {{}}", 2, "line 1, column 1")
def program_after_a_broken_scan_of_garbage(folder):
    return touch(folder / "results.txt", b"no results\n")


@case(f"program {ROOT}/launch-scripts/linuxcnc_bore.toml --controller fanuc --measured {{}}", 2, "no point is left")
def program_after_a_whole_scan(folder):
    touches = "".join(f"TOUCH {point + 1} {point} 1. 2. 3.\n" for point in range(10))
    return touch(folder / "results.txt", b"AXES X Y Z\n" + touches.encode())


@case("program {} --controller fanuc --travel-feed-mm-per-min nan", 2, "finite number above 0")
@case("program {} --controller fanuc --axis X=Q", 2, "axis \"X\" needs a letter")
@case("program {} --controller fanuc --axis X=C", 2, "X, Y, Z are linear")
@case("program {} --controller sinumerik --clearance Z=9000", 2, "outside its travel")
@case("program {} --controller fanuc --points 3,77", 2, "point 77 is not among")
@case("program {} --controller sinumerik -o /nowhere/x.mpf", 2, "cannot be written")
def program_of_a_cell(_):
    return ROOT / "launch-scripts" / "linuxcnc_bore.toml"


@case("info {}", 2, "\\.mcap$")
def name_with_line_end(folder):
    return touch(folder / "two\nlines.mcap", b"no bag")


@case("info {}", 2)
def name_that_is_not_unicode(folder):
    path = os.fsencode(folder) + b"/\xff\xfe.mcap"
    pathlib.Path(os.fsdecode(path)).write_bytes(b"no bag")
    return os.fsdecode(path)


@case("info {}", 2)
def link_to_itself(folder):
    os.symlink(folder / "bag.mcap", folder / "bag.mcap")
    return folder / "bag.mcap"


@case("info {}", (0, 3))
@case("diagnose {}", 2)
def only_magic(folder):
    return touch(folder / "bag.mcap", b"\x89MCAP0\r\n")


@case("info {}", 3)
@case("diagnose {}", 2)
def magic_and_garbage(folder):
    return touch(folder / "bag.mcap", b"\x89MCAP0\r\n" + random.Random(1).randbytes(10_000))


@case("info {}", 3)
@case("diagnose {}", 2)
def record_of_endless_length(folder):
    return touch(folder / "bag.mcap", b"\x89MCAP0\r\n\x06" + b"\xff" * 8 + b"\0" * 64)


@case("info {}", 3)
@case("diagnose {}", 2)
def chunk_that_claims_exabytes(folder):
    body = bytes(16) + (1 << 60).to_bytes(8, "little") + bytes(4) + b"\4\0\0\0zstd" + (8).to_bytes(8, "little") + bytes(8)
    return touch(folder / "bag.mcap", b"\x89MCAP0\r\n\x06" + len(body).to_bytes(8, "little") + body)


@case("info {}", 2, "not an MCAP file.*text.mcap$")
@case("diagnose {}", 2, "not an MCAP file.*text.mcap$")
def folder_with_a_text_as_split(folder):
    (folder / "bag").mkdir()
    Session().write(folder / "bag" / "bag_0.mcap")
    touch(folder / "bag" / "text.mcap", b"no bag")
    return folder / "bag"


# What a recorder leaves behind that was killed between two splits.
@case("info {}", 3)
@case("diagnose {}", 0, warns="bag_1.mcap")
@case("recover {} saved", 3)
def folder_with_an_empty_split(folder):
    (folder / "bag").mkdir()
    Session().write(folder / "bag" / "bag_0.mcap")
    touch(folder / "bag" / "bag_1.mcap", b"")
    return folder / "bag"


@case("info {}", 3)
def metadata_names_a_missing_file(folder):
    Session().write(folder / "bag_0.mcap")
    touch(
        folder / "metadata.yaml",
        b"rosbag2_bagfile_information:\n  version: 9\n  relative_file_paths: [bag_0.mcap, bag_1.mcap]\n",
    )
    return folder


@case("info {}", (0, 3))
@case("diagnose {}", (0, 3))
def metadata_is_garbage(folder):
    Session().write(folder / "bag_0.mcap")
    touch(folder / "metadata.yaml", b"{[: !!binary \xff\xfe &a *b")
    return folder


# ------------------------------------------------------------------------------------------------- damage of a bag


def cut(path, share):
    """Leaves that share of the part that holds the messages."""
    data = path.read_bytes()
    # The file ends in the footer's summary_start, summary_offset_start and CRC, and the magic.
    summary_start = int.from_bytes(data[-28:-20], "little")
    path.write_bytes(data[: int(summary_start * share)])
    return path


def flip(path, share):
    """Turns one bit at that share of the part that holds the messages."""
    data = bytearray(path.read_bytes())
    data[int(int.from_bytes(data[-28:-20], "little") * share)] ^= 4
    path.write_bytes(data)
    return path


def plain(folder):
    """A bag whose messages are most of it."""
    return Session().write(folder / "bag.mcap", compression=CompressionType.NONE)


# The complete part suffices: a result and a warning; a diagnosis is good by contract, else the status is that of a loss.
@case("diagnose {} --json", 0, warns="cut off.*complete part")
@case("plan {}", 3, warns="cut off")
@case("replay {}", 3, warns="cut off")
@case("info {}", 3)
@case("recover {} saved", 3)
def cut_late(folder):
    return cut(plain(folder), 0.97)


@case("diagnose {}", 2, "touches are needed|touches; at least")
def cut_early(folder):
    return cut(plain(folder), 0.4)


# No message is lost, but the file says so only to who reads it all.
@case("diagnose {} --json", 0, warns="cut off|index|summary")
@case("recover {} saved", (0, 3))
def cut_in_the_summary(folder):
    return cut(plain(folder), 1.2)


@case("diagnose {} --json", 0, warns="cut off|index|summary")
@case("recover {} saved", (0, 3))
def cut_by_one_byte(folder):
    path = Session().write(folder / "bag.mcap")
    path.write_bytes(path.read_bytes()[:-1])
    return path


@case("diagnose {}", 2, "truncated|ends|cut|damage|offset")
@case("replay {}", 2)
@case("plan {}", 2)
@case("play {}", 2)
def cut_before_the_first_message(folder):
    path = Session().write(folder / "bag.mcap")
    path.write_bytes(path.read_bytes()[:200])
    return path


@case("diagnose {} --json", 0, warns="damaged.*complete part")
@case("recover {} saved", 3)
@case("info {} --verify", 3)
def bit_flipped_in_a_chunk(folder):
    return flip(plain(folder), 0.5)


def flips(number):
    def many_bits_flipped(folder):
        path = Session().write(folder / "bag.mcap")
        data, chance = bytearray(path.read_bytes()), random.Random(number)
        for _ in range(number):
            data[chance.randrange(8, len(data))] ^= 1 << chance.randrange(8)
        path.write_bytes(data)
        return path

    many_bits_flipped.__name__ += f"_{number}"
    return many_bits_flipped


for flipped in (3, 10, 30, 100, 300, 1000):
    for reader in ("info {} --verify", "diagnose {} --json", "replay {}", "recover {} saved", "plan {}"):
        warned = "warning" if reader.startswith("diagnose") else None
        case(reader, (0, 2, 3), warns=warned)(flips(flipped))


@case("diagnose {} --json", 0, warns="cut off.*complete part")
@case("recover {} saved", 3)
def trial_bag_cut(folder):
    return cut(trial(folder), 0.8)


@case("recover {} {}", 2, "exist")
def recover_onto_a_file(folder):
    return Session().write(folder / "bag.mcap")


@case("recover {} /proc/saved", 2)
def recover_where_nothing_can_be_written(folder):
    return Session().write(folder / "bag.mcap")


# ------------------------------------------------------------------------------------------ what the messages say

NUMBERS = {"not_a_number": math.nan, "infinite": math.inf}


def broken(command, status, says=None, warns=None, name=None):
    """A case whose decorated function changes a good session; what it returns goes to `Session.write`."""

    def register(change):
        def make(folder):
            session = Session()
            written = change(session)
            return session.write(folder / "bag.mcap", **(written or {}))

        make.__name__ = name or change.__name__
        return case(command, status, says, warns)(make) and change

    return register


def set_at(content, path, value):
    *way, last = path
    for step in way:
        content = content[step]
    content[last] = value


@case("diagnose {} --json", 0)
@case("plan {} --json", 0)
@case("replay {} --json", 0)
@case("info {} --json --verify", 0)
@case("recover {} saved", 0)
def good_session(folder):
    return Session().write(folder / "bag.mcap")


@broken("diagnose {} --json", 0)
def plan_and_model_published_again(session):
    session.add("inspection_plan", session.plan).add("robot_description", session.of("robot_description")[0])


@broken("diagnose {} --json", 0)
def drive_session(session):
    session.drive()


# A type of the contract under another name, on each topic.
for wrong in ("robot_description", "joint_states", "machine_state", "inspection_plan", "probe_events"):

    @broken("diagnose {}", 2, f"{wrong} carries diagnostic_msgs/msg/KeyValue", name=f"other_type_on_{wrong}")
    @broken("replay {}", 2, f"{wrong} carries", name=f"other_type_on_{wrong}")
    @broken("plan {}", 2, f"{wrong} carries", name=f"other_type_on_{wrong}")
    def other_type(session, wrong=wrong):
        session.types[wrong] = "diagnostic_msgs/KeyValue"
        session.messages = [
            (topic, {"key": "a", "value": "b"} if topic == wrong else content, at)
            for topic, content, at in session.messages
        ]

    @broken("diagnose {}", 2, f"{wrong} cannot be decoded", name=f"bytes_of_nothing_on_{wrong}")
    def other_bytes(_, wrong=wrong):
        return {"raw": {wrong: b"\0\1\0\0\xff\xff\xff\xff\xff"}}

    @broken("diagnose {}", 2, "decode|CDR", name=f"no_bytes_on_{wrong}")
    def no_bytes(_, wrong=wrong):
        return {"raw": {wrong: b""}}


NUMBERS_AT = {
    "inspection_plan": [
        ("part_pose", "position", "x"),
        ("part_pose", "orientation", "w"),
        ("stylus", "ball_radius"),
        ("stylus", "ball_center", "z"),
        ("points", 3, "position", "y"),
        ("points", 3, "normal", "y"),
        ("points", 3, "feed"),
        ("points", 3, "approach_distance"),
        ("points", 3, "cut_length"),
        ("features", 1, "origin", "x"),
        ("features", 1, "axis", "x"),
        ("features", 1, "radius"),
    ],
    "probe_events": [("axis_positions", 1), ("tip", "x"), ("approach", "z"), ("feed",)],
    "joint_states": [("position", 1)],
    "machine_state": [("temperatures", 0), ("spindle_speed",)],
}
for topic_of, places in NUMBERS_AT.items():
    for place in places:
        for word, value in NUMBERS.items():

            @broken("diagnose {}", 2, "not finite", name=f"{word}_in_{topic_of}_{'_'.join(map(str, place))}")
            def not_finite(session, topic_of=topic_of, place=place, value=value):
                contents = session.of(topic_of)
                set_at(contents[len(contents) // 2], place, value)


for field in ("approach_distance", "retract_distance"):

    @broken("plan {}", 2, "not finite", name=f"not_a_number_in_{field}")
    def distance(session, field=field):
        session.plan["points"][3][field] = math.nan


@broken("diagnose {}", 2, "not finite")
def not_a_number_in_reference(session):
    session.reference(deviation=[0.0, math.nan])


@broken("diagnose {}", 2, "reference")
def reference_of_unequal_lists(session):
    session.reference(point_index=[0, 1, 2])


@broken("diagnose {}", 2, "reference|point 999")
def reference_of_a_point_that_is_not_there(session):
    session.reference(point_index=[0, 999])


@broken("diagnose {}", 2, "uncertainty")
def reference_of_negative_uncertainty(session):
    session.reference(standard_uncertainty=-1e-6)


@broken("diagnose {}", 2, "reference|plan")
def reference_of_another_plan(session):
    session.reference(plan_id="plan-2")


@broken("diagnose {}", 2, "no inspection plan")
@broken("plan {}", 2, "no inspection plan")
@broken("replay {}", 2, "no inspection plan|neither")
def no_plan(session):
    session.without("inspection_plan")


@broken("diagnose {}", 2, "no inspection plan|touches")
def no_plan_and_no_events(session):
    session.without("inspection_plan", "probe_events")


@broken("diagnose {}", 2, "no machine model")
@broken("replay {}", 2, "no machine model")
@broken("plan {}", 2, "no machine model")
def no_robot_description(session):
    session.without("robot_description")


@broken("diagnose {}", 2, "touch|probe event|too few")
@broken("plan {}", 2, "touch|event")
@broken("replay {}", 2, "touch|event")
def no_events(session):
    session.without("probe_events")


@broken("diagnose {}", 2, "no cell")
@broken("stream --bag {} probe_events", 2, "no inspection plan")
def no_topic_of_a_cell(session):
    session.without("robot_description", "probe_events", "joint_states", "inspection_plan")


@broken("diagnose {}", 2, "no cell")
@broken("play {}", 2, "no messages")
@broken("replay {}", 2)
@broken("info {}", 0)
def no_messages(session):
    session.messages = []


LIMIT = '<limit lower="-1" upper="1" velocity="1" effort="1"/>'


def arm(folder, joints, limit=LIMIT, name="arm.urdf"):
    """A robot description of so many joints that turn."""
    links = "".join(f'<link name="l{number}"/>' for number in range(joints + 1))
    joints = "".join(
        f'<joint name="j{number}" type="revolute"><parent link="l{number}"/><child link="l{number + 1}"/>'
        f'<origin xyz="0 0 0.1"/><axis xyz="0 {number % 2} {1 - number % 2}"/>{limit}</joint>'
        for number in range(joints)
    )
    (folder / name).write_text(f'<robot name="arm">{links}{joints}</robot>')
    return folder / name


@case("new robot --urdf {} --out made", 2, "the arm has 5 joints that move")
@case("new robot --urdf {} --mount hand --out made", 2, "no link `hand`")
@case("new robot --urdf {} --hold j9=0 --out made", 2, "--hold j9: not a joint")
@case("new robot --urdf {} --hold j1 --out made", 2, "JOINT=DEGREES")
@case("new robot --urdf {} --stem 0,0,0 --out made", 2, "not all 0")
@case("new robot --urdf {} --stylus-mm nan --out made", 2, "0.1 to 2000 mm")
def arm_of_five_joints(folder):
    return arm(folder, 5)


@case("new robot --urdf {} --out .", 2, "--out has no name")
@case("new robot --urdf {} --out taken", 2, "taken exists: name another folder")
@case("new robot --urdf {} --out my-robot", 2, "my-robot.* names the cell")
@case("new robot --urdf {} --mount l6 --hold j2=99 --out made", 2, "--hold j2=99: its travel is -57.296")
def arm_of_six_joints(folder):
    (folder / "taken").mkdir()
    return arm(folder, 6)


@case("new robot --urdf {} --out made", 2, "j0.* has velocity 0")
def arm_without_speed(folder):
    return arm(folder, 6, LIMIT.replace('velocity="1"', 'velocity="0"'))


@case("new robot --urdf {} --out made", 2, "xacro")
def arm_in_xacro(folder):
    path = arm(folder, 6)
    text = path.read_text().replace('"0 0 0.1"', '"0 0 ${height}"')
    head = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="arm"><xacro:property name="height" value="0.1"/>'
    path.write_text(text.replace('<robot name="arm">', head))
    return path


@case("new robot --urdf {} --stem 0,0,1 --out made", 2, "no place was found")
def arm_that_hardly_moves(folder):
    return arm(folder, 6, LIMIT.replace('"1" velocity', '"-0.99" velocity'))


@broken("replay {}", 2, "different inspection plans")
@broken("plan {}", 0)
@broken("diagnose {} --plan plan-3", 2, "plan-3")
def two_plans(session):
    second = copy.deepcopy(session.plan)
    second["plan_id"] = "plan-2"
    session.add("inspection_plan", second)


@broken("diagnose {}", 2, "different inspection plans")
def two_plans_of_one_name(session):
    second = copy.deepcopy(session.plan)
    second["points"][0]["position"]["x"] += 1e-3
    session.add("inspection_plan", second)


@broken("diagnose {}", 2, "different machine models")
def two_machine_models(session):
    model = session.of("robot_description")[0]["data"]
    session.add("robot_description", {"data": model.replace("three_axis", "another")})


@case("diagnose {}", 2, "several cells")
@case("stream --bag {} probe_events", 2, "several cells")
def two_cells(folder):
    (folder / "bag").mkdir()
    Session().write(folder / "bag" / "bag_0.mcap")
    Session("/other").write(folder / "bag" / "bag_1.mcap")
    return folder / "bag"


@case("diagnose {}", 2, "2 recordings, name one of them .*one.mcap.*two.mcap")
@case("stream --bag {} probe_events", 2, "2 recordings, name one of them")
def folder_of_two_recordings(folder):
    (folder / "bag").mkdir()
    Session().write(folder / "bag" / "one.mcap")
    Session("/other").write(folder / "bag" / "two.mcap")
    return folder / "bag"


def number_events(session, numbers):
    for event, number in zip(session.events, numbers, strict=False):
        event["sequence"] = number


@broken("diagnose {}", 0, warns="missing before event 31")
@broken("replay {}", 2, "missing before event 31")
@broken("plan {}", 2, "missing before event 31")
def one_event_missing(session):
    session.messages = [
        message for message in session.messages if message[0] != "probe_events" or message[1]["sequence"] != 30
    ]


@broken("diagnose {}", 0, warns="missing before event 5")
def events_from_five_on(session):
    number_events(session, range(5, 1000))


@broken("diagnose {}", 2, "missing before event 18446744073709551615")
def event_of_the_largest_number(session):
    session.events[-1]["sequence"] = 2**64 - 1


@broken("diagnose {}", 2, "event 12 is in the bag twice")
def one_event_twice(session):
    session.events[13]["sequence"] = 12


@broken("diagnose {}", 2, "event 0 is recorded after event 1|after")
def events_reordered(session):
    number_events(session, [1, 0])


@broken("diagnose {}", 2, "plan-9")
def event_of_another_plan(session):
    session.events[7]["plan_id"] = "plan-9"


@broken("diagnose {}", 2, "point 4000000000")
@broken("replay {}", 2, "point 4000000000")
@broken("plan {}", 2, "point 4000000000")
def event_at_a_point_that_is_not_there(session):
    session.events[7]["point_index"] = 4_000_000_000


@broken("diagnose {}", 2, "feature")
def point_of_a_feature_that_is_not_there(session):
    session.plan["points"][3]["feature"] = 77


@broken("diagnose {}", 2, "operation")
def point_of_an_operation_that_is_not_there(session):
    session.plan["machined_on_this_machine"] = True
    operation = {"id": "o", "tool_number": 1, "tool_radius": 5e-3, "feed": 1e-2, "finish": True, "rotary_positions": []}
    session.plan["operations"] = [operation]
    for number, point in enumerate(session.plan["points"]):
        point.update(operation=0, cut_length=0.01 * number, tool_height=1e-3 * (number % 7), overhang=1e-3 * (number % 5))
    session.plan["points"][3]["operation"] = 77


@broken("diagnose {}", (0, 2))
@broken("replay {}", (0, 2))
def feature_of_no_kind(session):
    session.plan["features"][0]["kind"] = 200


@broken("diagnose {}", (0, 2))
def event_of_no_outcome(session):
    session.events[7]["outcome"] = 9


@broken("diagnose {}", 2, "axis names|axis_names")
def fewer_positions_than_axes(session):
    session.events[7]["axis_positions"] = [0.0]


@broken("diagnose {}", 2, '"?Q')
@broken("replay {}", 2, '"?Q')
@broken("plan {}", 2, '"?Q')
def axis_that_the_machine_lacks(session):
    for event in session.events:
        event["axis_names"] = ["X", "Y", "Q"]


@broken("diagnose {}", 2, "Z")
@broken("replay {}", 2, "Z")
@broken("plan {}", 2, "Z")
def axis_that_the_events_lack(session):
    for event in session.events:
        event["axis_names"], event["axis_positions"] = ["X", "Y"], event["axis_positions"][:2]


@broken("diagnose {}", 2, "X")
def axis_named_twice(session):
    for event in session.events:
        event["axis_names"] = ["X", "X", "Z"]


@broken("diagnose {}", 2, "rotary|C")
@broken("plan {}", 2, "rotary|C")
def rotary_axis_that_the_machine_lacks(session):
    session.plan["rotary_names"] = ["C"]
    for point in session.plan["points"]:
        point["rotary_positions"] = [0.0]


@broken("diagnose {}", (0, 2))
@broken("plan {}", 2, "rotary")
def rotary_positions_without_names(session):
    session.plan["points"][0]["rotary_positions"] = [1.0]


@broken("diagnose {}", 2, "normal")
@broken("replay {}", 2, "normal")
@broken("plan {}", 2, "normal")
def normal_of_no_length(session):
    session.plan["points"][3]["normal"] = {"x": 0.0, "y": 0.0, "z": 0.0}


@broken("diagnose {}", 2, "orientation|quaternion|pose")
@broken("replay {}", 2, "orientation|quaternion|pose")
@broken("plan {}", 2, "orientation|quaternion|pose")
def part_pose_of_no_orientation(session):
    session.plan["part_pose"]["orientation"]["w"] = 0.0


@broken("diagnose {}", 2, "radius")
@broken("plan {}", 2, "radius")
def ball_of_negative_radius(session):
    session.plan["stylus"]["ball_radius"] = -3e-3


@broken("diagnose {}", 2, "mm|metres|far|off|m ")
def events_in_millimetres(session):
    for event in session.events:
        event["axis_positions"] = [1e3 * value for value in event["axis_positions"]]


@broken("diagnose {}", 2, "mm|metres|far|off|m ")
def plan_in_millimetres(session):
    for point in session.plan["points"]:
        point["position"] = {axis: 1e3 * value for axis, value in point["position"].items()}


@broken("diagnose {}", 2, "mm|metres|far|off|m ")
def stylus_in_millimetres(session):
    session.plan["stylus"]["ball_radius"] *= 1e3
    session.plan["stylus"]["ball_center"] = {"x": 0.0, "y": 0.0, "z": -100.0}


@broken("diagnose {}", 2, "1e|far|large|off|m ")
@broken("plan {}", 2, "reach|touched|far|large")
@broken("replay {}", (0, 2))
def plan_at_the_end_of_numbers(session):
    for point in session.plan["points"]:
        point["position"]["x"] = 1e300


@broken("diagnose {} --json", (0, 2))
def stamps_that_run_backwards(session):
    for index, event in enumerate(session.events):
        event["header"] = header(START - index * 10**9)


@broken("diagnose {} --json", (0, 2))
def stamps_with_four_billion_nanoseconds(session):
    for event in session.events:
        event["header"]["stamp"]["nanosec"] = 4_294_967_295


@broken("diagnose {} --json", (0, 2))
def stamps_of_nothing(session):
    for topic in ("probe_events", "joint_states", "machine_state", "inspection_plan"):
        for content in session.of(topic):
            content["header"] = header(0)


@broken("diagnose {}", 2, "temperature")
def more_temperatures_than_names(session):
    session.of("machine_state")[0]["temperatures"] = [20.0, 21.0]


@broken("diagnose {}", 2, "joint_states")
def more_joints_than_positions(session):
    session.of("joint_states")[0]["name"] = ["X"]


@broken("diagnose {}", 2, "touch|few|event")
def a_single_event(session):
    keep = session.events[0]
    session.without("probe_events").add("probe_events", keep)


@broken("diagnose {} --json", (0, 2))
def every_touch_at_one_point(session):
    for event in session.events:
        event.update({key: session.events[0][key] for key in ("point_index", "axis_positions", "tip", "approach")})


@broken("diagnose {}", 2, "touch|outcome|event|few")
def nothing_touched(session):
    for event in session.events:
        event["outcome"] = 1


MODELS = {
    "no_text": ("", "URDF|robot"),
    "no_xml": ("X Y Z", "URDF"),
    "unclosed": ("<robot name='r'><link name='foundation'>", "URDF"),
    "no_probe_mount": (None, "probe_mount"),
    "deep": ("<robot>" + "<a>" * 100_000, "100001 elements nested"),
}
for word, (model_text, about) in MODELS.items():

    @broken("diagnose {}", 2, about, name=f"robot_description_{word}")
    @broken("replay {}", 2, about, name=f"robot_description_{word}")
    @broken("plan {}", 2, about, name=f"robot_description_{word}")
    def model(session, model_text=model_text):
        description = session.of("robot_description")[0]
        replaced = description["data"].replace("probe_mount", "spindle")
        description["data"] = replaced if model_text is None else model_text


@broken("diagnose {}", 2, "effort")
def drive_without_effort(session):
    session.drive()
    for content in session.of("joint_states"):
        content["effort"] = []


@broken("diagnose {}", 2, "effort.*not finite|not finite")
def drive_with_effort_that_is_no_number(session):
    session.drive(effort=math.nan)


@broken("diagnose {}", 2, "Q")
def drive_of_an_axis_that_the_machine_lacks(session):
    session.drive()
    for topic in ("joint_states", "joint_commands"):
        for content in session.of(topic):
            content["name"] = ["Q"]


@case("diagnose {} --without link.nonsense", 2, "link.nonsense")
@case("play {} --rate 0", 2, "rate")
@case("play {} --rate nan", 2, "rate")
@case("play {} --start-s nan", 2, "start")
@case("play {} --start-s -1", 2)
@case("play {} --namespace //", 2, "namespace|name")
@case("play {} --router nonsense", 2, "nonsense")
@case("plan {} --jason", 2)
@case("stream --bag {}", 2, "TOPIC")
@case("stream --bag {} probe_event", 2, "^probecell: probe_event is not a topic of a cell")
@case("stream --bag {} --cell {} probe_events", 2, "cannot be used with")
def wrong_option(folder):
    return Session().write(folder / "bag.mcap")


# ------------------------------------------------------------------------------------------------------ cell files

OF_CELL = ("plan {}", "up {} --once --no-record", "node cycle --cell {}", "record --cell {}", "stream --cell {} verdicts")


def cell(folder, change=lambda text: text, urdf=lambda text: text):
    """The turn-mill's cell file and robot description, changed."""
    text = (ROOT / "launch-scripts" / "turn_mill.toml").read_text()
    changed = change(text)
    if isinstance(changed, str):
        # Never the port at which the cell of another case runs.
        changed = changed.replace("tcp/127.0.0.1:7447", f"tcp/127.0.0.1:{kit.free_port()}")
    description = (ROOT / "launch-scripts" / "turn_mill.urdf").read_text()
    if urdf is not None:
        touch(folder / "turn_mill.urdf", urdf(description).encode())
    return touch(folder / "cell.toml", changed if isinstance(changed, bytes) else changed.encode())


def replaced(old, new):
    def change(text):
        assert old in text, f"the turn-mill has no {old!r} any more"
        return text.replace(old, new, 1)

    return change


def signal_of(source, address, kind, more=""):
    """A clamping that a controller beside the machine holds there."""
    section = f'\n[[signals]]\nname = "chuck"\nrole = "clamping_closed"\nsource = "{source}"\naddress = "{address}"\ntype = "{kind}"\n{more}\n'
    return lambda text: text + section


CELLS = {
    "empty": (lambda _: "", "missing field|\\[cell\\]"),
    "no_toml": (lambda _: "<cell/>", "line 1"),
    "no_text": (lambda _: b"\xff\xfe\x00", "UTF-8|utf-8|text"),
    "cut": (lambda text: text[: text.index("ball_radius_mm")], "line"),
    "unknown_key": (replaced("clearance_mm", "clearence_mm"), 'did you mean "clearance_mm"'),
    "text_for_a_number": (replaced("approach_mm = 1.0", 'approach_mm = "1.0"'), "line"),
    "not_a_number": (replaced("approach_mm = 1.0", "approach_mm = nan"), "approach"),
    "infinite": (replaced("radius_mm = 11.75", "radius_mm = inf"), "radius|D2"),
    "infinite_position": (replaced("position_mm = [0.0, 0.0, 30.0]", "position_mm = [0.0, inf, 30.0]"), "position_mm"),
    "angle_that_is_no_number": (replaced("[0.0, 72.0,", "[nan, 72.0,"), "touch_angles_deg"),
    "tool_radius_that_is_no_number": (replaced("tool_radius_mm = 0.4", "tool_radius_mm = nan"), "tool_radius_mm"),
    "negative_radius": (replaced("ball_radius_mm = 3.0", "ball_radius_mm = -3.0"), "radius"),
    "axis_that_the_machine_lacks": (replaced('indexing_axis = "C"', 'indexing_axis = "Q"'), "Q"),
    "clearance_axis_that_it_lacks": (replaced('clearance_axis = "X"', 'clearance_axis = "Q"'), "Q"),
    "feature_of_no_kind": (replaced('kind = "cylinder"', 'kind = "torus"'), "torus"),
    "feature_twice": (replaced('id = "D1"', 'id = "D2"'), "D2"),
    "normal_of_no_length": (replaced("\naxis = [0.0, 0.0, 1.0]", "\naxis = [0.0, 0.0, 0.0]"), "axis|D2"),
    "width_of_no_plane": (replaced('planes = ["flat_1", "flat_4"]', 'planes = ["flat_1", "flat_9"]'), "flat_9"),
    "operation_that_is_not_there": (replaced('operation = "finish_turn"', 'operation = "polish"'), "polish"),
    "tolerance_upside_down": (replaced("[-10.0, 10.0]", "[10.0, -10.0]"), "tolerance"),
    "effect_that_is_none": (lambda text: text + "\n[[model.effects]]\neffect = \"axis.X.scal\"\nparameters = []\n", "axis.X.scale"),
    "angle_of_many_turns": (replaced("retract_mm = 1.0", "retract_mm = 1.0\nindexing_offsets_deg = [1000000.0]"), "10 turns"),
    "touches_without_end": (replaced("[5.0, 17.0]", str([0.001 * i for i in range(20_000)])), "100022 touches .*more than 3000"),
    "name_that_drives_a_terminal": (replaced('id = "hexagonal_punch"', 'id = "\\u001b[2J"'), "unprintable character"),
    "password_in_plain_text": (lambda text: text + '\n[bus.zenoh.transport.auth.usrpwd]\nuser = "cell"\npassword = "hunter2"\n', "line .*usrpwd.password contains a password"),
    "access_that_hides_the_cell": (lambda text: text + '\n[bus.router_zenoh.access_control]\nenabled = true\ndefault_permission = "deny"\nrules = [{ id = "all", permission = "allow", flows = ["ingress", "egress"], messages = ["put"], key_exprs = ["**"] }]\nsubjects = [{ id = "everybody" }]\npolicies = [{ rules = ["all"], subjects = ["everybody"] }]\n', "@ros2_lv"),
    "risk_that_is_none": (replaced("max_corrections = 5", "max_corrections = 5\ndecision_rule = { guard_band = { consumers_risk = 0.7 } }"), "consumers_risk = 0.7"),
    "no_name": (replaced('name = "turn_mill"', 'name = ""'), "name"),
    "name_that_is_no_namespace": (replaced('name = "turn_mill"', 'name = "a b/#*"'), "name"),
    "driver_that_is_none": (replaced('source = "simulator"', 'source = "fanuc"'), "fanuc"),
    "linuxcnc_without_section": (replaced('source = "simulator"', 'source = "linuxcnc"'), "linuxcnc"),
    "transport_that_is_none": (replaced('transport = "zenoh"', 'transport = "mqtt"'), "mqtt"),
    "flush_of_no_time": (replaced("flush_interval_s = 0.5", "flush_interval_s = 0.0"), "flush_interval"),
    "flush_that_is_no_number": (replaced("flush_interval_s = 0.5", "flush_interval_s = nan"), "flush_interval"),
    "flush_of_ages": (replaced("flush_interval_s = 0.5", "flush_interval_s = 1e300"), "flush_interval"),
    "flush_and_kept_for_no_time": (replaced("flush_interval_s = 0.5", "flush_interval_s = 0.5\nkeep_days = 0.0"), "keep_days = 0.0"),
    "flush_and_kept_of_no_size": (replaced("flush_interval_s = 0.5", "flush_interval_s = 0.5\nkeep_gib = nan"), "keep_gib"),
    "endpoint_that_is_none": (replaced("tcp/127.0.0.1:7447", "nonsense"), "nonsense"),
    "port_that_is_none": (replaced("tcp/127.0.0.1:7447", "tcp/127.0.0.1:99999"), "99999"),
    "signal_of_no_protocol": (signal_of("opc://127.0.0.1", "x", "bool"), '"chuck".*opc.* is no protocol of a controller; there are modbus, s7, ads'),
    "signal_of_no_source": (signal_of("s7://127.0.0.1", "DB1.DBX0.3", "bool"), '"chuck".*must be of the form "s7://'),
    "signal_of_no_address": (signal_of("modbus://127.0.0.1/1", "coil:70000", "bool"), '"chuck".*is no address of Modbus'),
    "signal_of_another_type": (signal_of("s7://127.0.0.1/0/1", "DB1.DBD4", "bool"), '"chuck".*is no bit: its type is not bool'),
    "signal_of_no_symbol": (signal_of("ads://127.0.0.1/127.0.0.1.1.1:851", "MAIN clamped", "bool"), '"chuck".*is no name of a symbol'),
    "signal_of_no_period": (signal_of("s7://127.0.0.1/0/1", "M4.1", "bool", "period_s = 0.0"), "period_s = 0 must lie between"),
    "description_that_is_not_there": (replaced('"turn_mill.urdf"', '"other.urdf"'), "other.urdf"),
    "description_that_is_a_folder": (replaced('"turn_mill.urdf"', '"."'), "not a regular file"),
}
for word, (change, about) in CELLS.items():
    for command in OF_CELL:
        if command.startswith("plan") and word.startswith(("endpoint", "port", "flush", "linuxcnc")):
            continue

        def broken_cell(folder, change=change):
            return cell(folder, change)

        broken_cell.__name__ = f"cell_{word}"
        case(command, 2, about)(broken_cell)

URDFS = {
    "no_text": (lambda _: "", "turn_mill.urdf.*URDF|URDF"),
    "cut": (lambda text: text[: len(text) // 2], "URDF"),
    "no_workpiece": (lambda text: text.replace("workpiece", "table"), "workpiece"),
    "loop": (replaced('<parent link="foundation"/><child link="Z_link"/>', '<parent link="probe_mount"/><child link="Z_link"/>'), "loop|foundation"),
    "planar_joint": (replaced('type="prismatic"', 'type="planar"'), "planar"),
    "axis_of_no_length": (replaced('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>'), "axis"),
    "nested_without_end": (replaced('<link name="workpiece">', "<link>" * 100_000 + '<link name="workpiece">'), "more than 100"),
    "links_without_end": (replaced('<link name="workpiece">', "".join(f'<link name="l{i}"/><joint name="j{i}" type="fixed"><parent link="{f"l{i - 1}" if i else "foundation"}"/><child link="l{i}"/></joint>' for i in range(200_000)) + '<link name="workpiece">'), "larger than 16 MiB|more than 2000"),
    "not_a_number": (replaced('xyz="0 0 0.2"', 'xyz="0 0 nan"'), "origin"),
}
for word, (change, about) in URDFS.items():
    for command in OF_CELL[:3]:

        def broken_description(folder, change=change):
            return cell(folder, urdf=change)

        broken_description.__name__ = f"urdf_{word}"
        case(command, 2, about)(broken_description)


REPORT = {
    "schema": "probecell/gap-report/1", "bag": "somewhere", "samples": 48, "verdict": "explained",
    "gap": {"rms": 1e-5, "noise_floor": 1e-6, "ratio": 10.0}, "where": [],
    "effects": [
        {"effect": "probe.ball_radius", "probability": 0.99,
         "parameters": [{"name": "dr", "value": 1e-5, "unit": "m", "ci95": [9e-6, 1.1e-5]}], "rms_before": 1e-5,
         "rms_after": 1e-6, "ci95_after": [8e-7, 1.2e-6], "held_out": True, "indistinguishable_from": []}
    ],
    "unexplained": {"rms": 0.0, "where": []}, "rejected": [], "next_measurement": [], "warnings": [],
}
REPORTS = {
    "empty": (b"", "not a single gap report"),
    "no_json": (b"<report/>", "not a single gap report"),
    "no_text": (b"\xff\xfe\x00", "UTF-8"),
    "cut": (json.dumps(REPORT).encode()[:200], "not a single gap report"),
    "twice": (json.dumps(REPORT).encode() * 2, "not a single gap report"),
    "schema": ({"schema": "probecell/gap-report/9"}, "gap-report/9"),
    "unexplained": ({"verdict": "unexplained"}, "does not explain its gap"),
    "without_a_gap": ({"verdict": "no_gap", "effects": []}, "has no gap"),
    "nameless_machine": ({}, "does not say of which machine"),
    "other_machine": ({"machine": {"name": "mill", "fingerprint": "00"}}, "of machine .mill."),
    "no_number": ({"effects": [REPORT["effects"][0] | {"rms_before": None}]}, "not a single gap report"),
    "of_drives": ({"gap": REPORT["gap"] | {"unit": "N"}}, "one of drives"),
}
for word, (content, about) in REPORTS.items():

    def broken_report(folder, content=content):
        cell(folder)
        text = content if isinstance(content, bytes) else json.dumps(REPORT | content).encode()
        return touch(folder / "report.json", text)

    broken_report.__name__ = f"report_{word}"
    case("adopt {} --cell cell.toml", 2, about)(broken_report)


@case("adopt report.json --cell {}", 2, "cannot read the report")
@case("adopt --cell {}", 2)
@case("adopt --remove probe.ball_radius --cell {}", 2, "is not declared")
def nothing_to_adopt(folder):
    return cell(folder)


@case("plan {}", 2, "cannot read the cell file")
@case("adopt --list --cell {}", 2, "cannot read the cell file")
@case("up {}", 2, "cannot read the cell file")
@case("node cycle --cell {}", 2, "cannot read the cell file")
@case("record --cell {}", 2, "cannot read the cell file")
@case("run part --cell {}", 2, "cannot read the cell file")
@case("approve c --operator o --cell {}", 2, "cannot read the cell file")
def missing_cell(folder):
    return folder / "cell.toml"


@case("node nonsense --cell {}", 2, "nonsense")
@case("node linuxcnc --cell {}", 2, "linuxcnc")
def node_that_is_not_there(folder):
    return cell(folder)


@case("doctor {}", 2, quiet=True)
@case("doctor {} --json", 2, quiet=True)
def doctor_of_a_broken_cell(folder):
    return cell(folder, CELLS["unknown_key"][0])


@case("doctor {}", 1, quiet=True)
def doctor_of_a_router_elsewhere(folder):
    return cell(folder, replaced("tcp/127.0.0.1:7447", "tcp/192.0.2.1:7447"))


@case("doctor {}", 1, quiet=True)
def doctor_of_a_setting_that_zenoh_lacks(folder):
    return cell(folder, replaced("[path_planning]", "[bus.router_zenoh]\nacces_control = {}\n\n[path_planning]"))


@case("doctor {}", 2, quiet=True)
@case("plan {}", 2, "domain_id")
def domain_that_ros_lacks(folder):
    return cell(folder, replaced("[bus]", "[bus]\ndomain_id = 9999"))


@case("plan {}", 2, "tool 9")
def tool_that_the_machine_lacks(folder):
    return cell(folder, replaced('{ id = "D1", tolerance_mm = 0.010, tool_number = 2 }', '{ id = "D1", tolerance_mm = 0.010, tool_number = 9 }'))


# ----------------------------------------------------------------------------------------------------------- ports


@contextlib.contextmanager
def garbage_server(_environment):
    """A server that answers everything with bytes of no protocol."""
    listener = socket.create_server(("127.0.0.1", 0))
    ended = threading.Event()

    def answer(connection):
        with connection, contextlib.suppress(OSError):
            connection.settimeout(0.5)
            while not ended.is_set():
                connection.sendall(b"220 mail.example ESMTP ready\r\n" * 8)
                with contextlib.suppress(TimeoutError):
                    if not connection.recv(4096):
                        return

    def serve():
        with contextlib.suppress(OSError):
            while True:
                threading.Thread(target=answer, args=(listener.accept()[0],), daemon=True).start()

    threading.Thread(target=serve, daemon=True).start()
    try:
        yield listener.getsockname()[1]
    finally:
        ended.set()
        listener.close()


@contextlib.contextmanager
def silent_server(_environment):
    """A server that accepts and says nothing."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        yield listener.getsockname()[1]


@contextlib.contextmanager
def nobody(_environment):
    """A port at which nobody listens."""
    yield kit.free_port()


for server in (garbage_server, silent_server):
    for command in ("up {} --once --no-record", "node cycle --cell {}", "record --cell {}", "run part --cell {}"):

        def at_port(folder, port):
            return cell(folder, replaced("127.0.0.1:7447", f"127.0.0.1:{port}"))

        at_port.__name__ = f"router_is_a_{server.__name__}"
        case(command, 1, "127.0.0.1", server=server)(at_port)

    @case("play {} --router tcp/127.0.0.1:{port}", 1, "127.0.0.1", server=server)
    def play_to_a_server_of_something_else(folder, _):
        return Session().write(folder / "bag.mcap")

    @case("doctor {}", 1, server=server, quiet=True)
    def doctor_at_a_server_of_something_else(folder, port):
        return cell(folder, replaced("127.0.0.1:7447", f"127.0.0.1:{port}"))


@case("node cycle --cell {}", 1, "127.0.0.1", server=nobody)
@case("run part --cell {}", 1, "127.0.0.1", server=nobody)
@case("approve c --operator o --cell {}", 1, "127.0.0.1", server=nobody)
@case("record --cell {}", 1, "127.0.0.1", server=nobody)
def nobody_routes(folder, port):
    return cell(folder, replaced("127.0.0.1:7447", f"127.0.0.1:{port}"))


@case("play {} --router tcp/127.0.0.1:{port}", 1, "127.0.0.1", server=nobody)
def play_to_nobody(folder, _):
    return Session().write(folder / "bag.mcap")


@contextlib.contextmanager
def router(environment):
    """Our own router, as another cell has it."""
    port = kit.free_port()
    with kit.Process(BINARY, "router", "--listen", f"tcp/127.0.0.1:{port}", environment=environment) as process:
        process.says("listens on")
        yield port


@case("up {} --no-record", 0, warns="this cell uses it", server=router, interrupt="is ready")
@case("doctor {}", 0, server=router)
def a_router_is_there_already(folder, port):
    return cell(folder, replaced("127.0.0.1:7447", f"127.0.0.1:{port}"))


@case("play {} --router tcp/127.0.0.1:{port} --rate 1e-300", 2, "must lie between", server=router)
@case("play {} --router tcp/127.0.0.1:{port} --start-s 1e300", 2, "after the end", server=router)
@case("play {} --router tcp/127.0.0.1:{port} --start-s nan", 2, "start", server=router)
@case("play {} --router tcp/127.0.0.1:{port} --namespace //", 2, "name", server=router)
@case("play {} --router tcp/127.0.0.1:{port} --wait-for /nothing", 2, "/nothing", server=router)
def playing(folder, _):
    return Session().write(folder / "bag.mcap")


@case("play {} --router tcp/127.0.0.1:{port} --rate 1000", 3, warns="cut off", server=router)
def playing_a_cut_bag(folder, _):
    return cut(plain(folder), 0.9)


for word in ("nan", "-1.0", "0.0", "1e300"):

    def recording(folder, port, word=word):
        settings = f"flush_interval_s = {word}\nsplit_duration_s = {word}"
        return cell(folder, lambda text: replaced("flush_interval_s = 0.5", settings)(text).replace(":7447", f":{port}"))

    recording.__name__ = f"recording_with_times_of_{word}"
    case("record --cell {} --folder saved", 2, "flush_interval", server=router)(recording)


@case("router --listen tcp/127.0.0.1:{port}", 1, "127.0.0.1", server=router)
def a_second_router_at_one_port(_, __):
    return ""


@case("run part --cell {}", 1, server=router)
@case("approve c --operator o --cell {}", 1, server=router)
def a_router_without_a_cell(folder, port):
    return cell(folder, replaced("127.0.0.1:7447", f"127.0.0.1:{port}"))


# ------------------------------------------------------------------------------------------------------ the runner


def touch(path, content):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    return path


def trial(folder):
    if not TRIAL.exists():
        raise Skip("no trial bags here")
    shutil.copyfile(TRIAL, folder / "bag.mcap")
    return folder / "bag.mcap"


def execute(words, folder, environment, as_nobody, interrupt=None):
    """Status, output, errors; a process that hangs is ended with its children, and has no status.

    `interrupt`: what a command prints that runs until it is told to end, and is told so then.
    """
    options = {"user": NOBODY, "group": NOBODY} if as_nobody else {}
    process = kit.Process(
        # An input of a megabyte is no reason to take more than 8 GiB of addresses.
        "sh", "-c", 'ulimit -v 8388608; exec "$@"', "sh", BINARY, *words, folder=folder, apart=True, start_new_session=True,
        environment=environment | {"RUST_LOG": "warn,zenoh=error,rustdds=error"}, **options,
    )
    try:
        if interrupt is not None:
            kit.until(interrupt, lambda: process.has_said(interrupt) or process.code is not None, SOON)
            if process.code is None:
                process.send(signal.SIGINT)
        return process.ended(SOON)
    except kit.Late:
        os.killpg(process.pid, signal.SIGKILL)
        return None, process.output, process.errors


def complaints(words, result, statuses, says, warns, quiet=False, **_):
    """What is not as it should be."""
    status, output, errors = result
    lines = [line for line in errors.splitlines() if line.strip()]
    usage = status == 2 and errors.startswith("error: ") and "--help" in errors
    if status is None:
        yield "hangs"
    elif status not in statuses:
        yield f"status {status}, expected {' or '.join(map(str, statuses))}"
    if re.search(r"\.rs:\d+", errors):
        yield "a place in the source"
    if re.search(r"panicked|RUST_BACKTRACE|stack backtrace|core dumped", errors):
        yield "panicked"
    if status in (1, 2) and not usage and not quiet:
        sentences = [line for line in lines if line.startswith("probecell: ")]
        if len(sentences) != 1:
            yield f"{len(sentences)} sentences"
        others = [line for line in lines if line not in sentences and not line.startswith("warning: ")]
        if others:
            yield f"{len(others)} more lines on standard error"
        if says and sentences and not re.search(says, sentences[0]):
            yield f"the sentence does not match /{says}/"
        if sentences and len(sentences[0]) > LONGEST_SENTENCE:
            yield f"the sentence has {len(sentences[0])} characters"
        if output:
            yield "something on standard output"
    if status in (0, 3):
        if warns and not any(re.search(warns, line) for line in lines):
            yield f"no warning matches /{warns}/"
        if not warns and lines and status == 0:
            yield "something on standard error"
        if "--json" in words:
            yield from not_json(output)


def not_json(output):
    def constant(word):
        raise ValueError(f"{word} is no JSON")

    try:
        report = json.loads(output, parse_constant=constant)
    except ValueError as error:
        yield f"no JSON: {error}"
        return
    gap = report.get("gap") if isinstance(report, dict) else None
    if gap is not None and not all(isinstance(gap[key], float | int) for key in ("rms", "noise_floor", "ratio")):
        yield f"the gap is {gap}"
    numbers = [effect.get(key) for effect in (report.get("effects", []) if gap else []) for key in ("rms_before", "rms_after")]
    if None in numbers:
        yield "an effect without a number"


def run(entry):
    """Complaints about one case, and what was run."""
    name, make, command, statuses, says, warns, options = entry
    server = options.get("server")
    with kit.new_folder() as text, kit.new_folder() as own, contextlib.ExitStack() as stack:
        folder = pathlib.Path(text)
        environment = os.environ | {"XDG_CONFIG_HOME": f"{own}/config", "XDG_STATE_HOME": f"{own}/state"}
        port = stack.enter_context(server(environment)) if server else None
        made = str(make(folder, port) if server else make(folder))
        words = [word.replace("{port}", str(port)).replace("{}", made) for word in command.split()]
        as_nobody = make is unreadable_file and os.geteuid() == 0
        if as_nobody:
            folder.chmod(0o777)
            if subprocess.run(["test", "-x", BINARY], user=NOBODY, check=False).returncode:
                raise Skip("the user nobody cannot run the binary")
        result = execute(words, folder, environment, as_nobody, options.get("interrupt"))
        return list(complaints(words, result, statuses, says, warns, **options)), words, result


def attempt(entry):
    """What is to be told of a case: nothing if it passes, the reason if it is skipped."""
    begun = time.monotonic()
    try:
        found, words, (status, output, errors) = run(entry)
    except Skip as reason:
        return "skipped", [f"skipped  {entry[0]}: {reason}"]
    seconds = time.monotonic() - begun
    if not found:
        return "passed", [f"slow     {entry[0]}: {seconds:.0f} s"] if seconds > SLOW else []
    told = [f"FAILED   {entry[0]}: {'; '.join(found)}", f"         {' '.join(words)!r} -> {status} in {seconds:.0f} s"]
    for label, text in (("stdout", output), ("stderr", errors)):
        told += [f"         {label}: {line[:300]}" for line in text.splitlines()[:4]]
    return "failed", told


def main(_):
    wanted = sys.argv[2] if len(sys.argv) > 2 else ""
    begun, count = time.monotonic(), collections.Counter()
    chosen = [entry for entry in CASES if wanted in entry[0]]
    # Most cases of a running cell wait for time-outs of the network.
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        for outcome, told in pool.map(attempt, chosen):
            count[outcome] += 1
            for line in told:
                print(line, flush=True)
    seconds = time.monotonic() - begun
    print(f"{len(chosen)} cases, {count['failed']} failed, {count['skipped']} skipped, {seconds:.0f} s")
    assert not count["failed"]


if __name__ == "__main__":
    if len(sys.argv) < 2:
        raise SystemExit(__doc__)
    BINARY = str(pathlib.Path(sys.argv[1]).resolve())
    kit.main({"bad input": main})
