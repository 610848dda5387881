"""`probecell import contacts`: recordings that the writer of `rosbags` made, of poses or joint states and a contact signal."""

import csv
import math
import random

from check import ROOT, answer, check, close, probecell
from kit.recordings import messages

RATE = 0.004  # s between two poses
FEED = 5e-3  # m/s
RADIUS = 2e-3  # m
SHIFT = (8e-6, -3e-6, 0.0)  # m
BEGIN = 1_790_000_000.0  # s since 1970, at which doubles are still good to 0.24 us


def points():
    """Nominal points and normals on five faces of a block, m."""
    chance = random.Random(16)
    faces = [((0, None, None), (-1, 0, 0)), ((0.12, None, None), (1, 0, 0)), ((None, 0, None), (0, -1, 0)),
             ((None, 0.08, None), (0, 1, 0)), ((None, None, 0.04), (0, 0, 1))]
    size = (0.12, 0.08, 0.04)
    made = []
    for _ in range(8):
        for place, normal in faces:
            at = tuple(round(chance.uniform(0.1, 0.9) * whole, 4) if one is None else one for one, whole in zip(place, size))
            made.append((at, normal))
    return made


def write_bag(path, streams):
    """A recording: streams are topic, type, and messages as (instant of publication in s, fields)."""
    from rosbags.rosbag2 import Writer, StoragePlugin
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)

    def made(kind, value):
        return store.types[kind](**value) if isinstance(value, dict) else value

    def stamp(at):
        nanos = round(at * 1e9)
        return made("builtin_interfaces/msg/Time", {"sec": nanos // 10**9, "nanosec": nanos % 10**9})

    def header(at, frame):
        return made("std_msgs/msg/Header", {"stamp": stamp(at), "frame_id": frame})

    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        everything = []
        for topic, kind, samples in streams:
            connection = writer.add_connection(topic, kind, typestore=store)
            everything += [(at, connection, kind, value) for at, value in samples]
        for at, connection, kind, value in sorted(everything, key=lambda one: one[0]):
            if kind == "std_msgs/msg/Bool":
                message = made(kind, {"data": value})
            elif kind == "geometry_msgs/msg/PoseStamped":
                position = made("geometry_msgs/msg/Point", dict(zip("xyz", value)))
                turn = made("geometry_msgs/msg/Quaternion", {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0})
                message = made(kind, {"header": header(at, "part"), "pose": made("geometry_msgs/msg/Pose", {"position": position, "orientation": turn})})
            else:
                import numpy

                names, positions = value
                empty = numpy.array([])
                message = made(kind, {"header": header(at, ""), "name": names, "position": numpy.array(positions), "velocity": empty, "effort": empty})
            writer.write(connection, round(at * 1e9), store.serialize_cdr(message, kind))


def motion(touched, error=lambda number: 0.0, phase=0.0, stops=False):
    """The ball over time as it touches one point after the other: samples (instant, place) and the instants of contact. With `stops` it
    stands where it touches from the contact on; `phase` is that of the samples, s."""
    now, samples, contacts = BEGIN, [], []
    for number, (at, normal) in enumerate(touched):
        gap = RADIUS + sum(n * s for n, s in zip(normal, SHIFT)) + error(number)
        distance = lambda t: max(1e-3 - FEED * t, 0.0 if stops else -1.0)  # of the ball's centre from where it touches
        contact = 1e-3 / FEED
        for tick in range(int((contact + 0.02) / RATE) + 2):
            t = tick * RATE + phase
            samples.append((now + t, tuple(a + n * (gap + distance(t)) for a, n in zip(at, normal))))
        contacts.append(now + contact)
        now += contact + 0.5
    return samples, contacts


def levels(contacts, delay=0.0):
    """The contact signal: its changes."""
    return [(BEGIN - 0.1, False), *((at + delay + after, level) for at in contacts for after, level in ((0.0, True), (0.03, False)))]


def plan_of(folder, touched):
    """The points as a DMIS program, which a session without touches is made of."""
    lines = ["DMISMN/'block',05.2", "UNITS/MM,ANGDEC"]
    for number, (at, normal) in enumerate(touched):
        numbers = ",".join(repr(value * 1e3) for value in at) + "," + ",".join(map(str, normal))
        lines.append(f"F(P{number})=FEAT/POINT,CART,{numbers}")
    file = folder / "block.dmi"
    file.write_text("\n".join([*lines, "ENDFIL", ""]))
    probecell("import", "plan", file, "--format", "dmis", "--out", folder / "plan")
    return folder / "plan"


@check
def poses_and_a_contact_signal_of_a_foreign_recording_are_touches(folder):
    chance = random.Random(7)
    touched = points()
    noise = [chance.gauss(0, 0.3e-6) for _ in touched]
    samples, contacts = motion(touched, lambda number: noise[number])
    bag, plan = folder / "bag", plan_of(folder, touched)
    delay = 0.7e-3
    write_bag(bag, [("/tcp", "geometry_msgs/msg/PoseStamped", samples), ("/probe", "std_msgs/msg/Bool", levels(contacts, delay))])
    arguments = ["import", "contacts", bag, "--pose", "/tcp", "--contact", "/probe", "--plan", plan, "--ball-radius-mm", RADIUS * 1e3]
    probecell(*arguments, "--delay-ms", delay * 1e3, "--out", folder / "session")
    held = messages(folder / "session")
    (own,) = held["inspection_plan"]
    events = held["probe_events"]
    assert len(events) == len(touched)
    for number, event in enumerate(events):
        # The ball stood where the motion was at the instant; the doubles of an instant are good to 0.24 us, times the feed 1.2 nm.
        assert event.point_index == number
        at, normal = touched[number]
        deviation = sum(n * (c - p) for n, c, p in zip(normal, (event.tip.x, event.tip.y, event.tip.z), at)) - own.stylus.ball_radius
        close(deviation, sum(n * s for n, s in zip(normal, SHIFT)) + noise[number], 3e-9)
        close(event.feed, FEED, 1e-6)
    found = answer("diagnose", folder / "session")
    assert found["verdict"] == "explained", found["verdict"]
    (effect,) = found["effects"]
    assert "fixture.shift" in effect["group"], effect["group"]
    # A delay that is not stated is a deviation of feed times delay at every touch; U grows by what is uncertain of it.
    _, noted = probecell(*arguments, "--out", folder / "late")
    assert "1 ms of delay is 5.0 um" in noted, noted
    late = messages(folder / "late")["probe_events"]
    for one, other in zip(events, late):
        moved = math.dist((one.tip.x, one.tip.y, one.tip.z), (other.tip.x, other.tip.y, other.tip.z))
        close(moved, FEED * delay, 3e-9)
    widths = []
    for uncertain in (0, 1):
        out = folder / f"u{uncertain}"
        probecell(*arguments, "--delay-ms", delay * 1e3, "--touch-uncertainty-um", 1, "--time-uncertainty-ms", uncertain, "--out", out)
        widths.append(max(one.standard_uncertainty for one in messages(out)["touch_deviations"]))
    close(widths[0], 1e-6, 1e-9)
    close(widths[1], math.hypot(1e-6, 1e-3 * FEED), 1e-8)


@check
def joint_states_and_a_contact_signal_give_the_touches_of_the_cell(folder):
    """The touches of a recorded sample, played as joint states that pass through each latched position at a contact."""
    sample = ROOT / "bags" / "samples" / "ball_check.mcap"
    held = messages(sample)
    names = list(held["probe_events"][0].axis_names)
    joints = ["joint_" + name.lower() for name in names]
    samples, contacts, now = [], [], BEGIN
    for event in held["probe_events"]:
        for tick in range(-3, 4):
            # Towards the position and on, along the first axis; the contact lies between two samples.
            offset = [FEED * RATE * (tick - 0.25) if index == 0 else 0.0 for index in range(len(names))]
            samples.append((now + RATE * tick, (joints, [a + b for a, b in zip(event.axis_positions, offset)])))
        contacts.append(now + 0.25 * RATE)
        now += 1.0
    # From the middle on the joints stand in another order, and a gripper publishes on the topic.
    half = len(samples) // 2
    samples[half:] = [(at, (own[::-1], positions[::-1])) for at, (own, positions) in samples[half:]]
    samples += [(at + RATE / 3, (["gripper"], [0.02])) for at, _ in samples[::5]]
    bag = folder / "bag"
    write_bag(bag, [("/joint_states", "sensor_msgs/msg/JointState", samples), ("/probe", "std_msgs/msg/Bool", levels(contacts))])
    arguments = ["import", "contacts", bag, "--joint-states", "/joint_states", "--contact", "/probe", "--plan", sample]
    _, error = probecell(*arguments, "--out", folder / "never", status=2)
    assert "has no joint" in error and "joint_x" in error, error
    named = ",".join(f"{name}={joint}" for name, joint in zip(names, joints))
    _, noted = probecell(*arguments, "--joints", named, "--touch-uncertainty-um", 1, "--out", folder / "session")
    assert "have no joint of the machine and are passed over (gripper)" in noted, noted
    again = messages(folder / "session")
    assert [one.point_index for one in again["probe_events"]] == [one.point_index for one in held["probe_events"]]
    for one, other in zip(held["touch_deviations"], again["touch_deviations"]):
        close(one.deviation, other.deviation, 3e-9)


@check
def recordings_that_mislead_are_read_right_or_refused(folder):
    """An arm that stops at the contact, a signal that bounces, a second publisher of the positions."""
    touched = points()[:10]
    plan = plan_of(folder, touched)
    right, contacts = motion(touched, phase=0.3 * RATE)
    stops, _ = motion(touched, phase=0.3 * RATE, stops=True)
    bounces = [(at + after, level) for at in contacts for after, level in ((0.001, False), (0.0019, True), (0.004, False), (0.0047, True))]
    bouncing = sorted(levels(contacts) + bounces)
    doubled = sorted(right + [(at + RATE / 2, place) for (_, place), (at, _) in zip(right, right[13:]) if round(at / RATE) % 8 == 0])

    def imported(name, samples, signal, status=0):
        write_bag(folder / name, [("/tcp", "geometry_msgs/msg/PoseStamped", samples), ("/probe", "std_msgs/msg/Bool", signal)])
        arguments = ["--pose", "/tcp", "--contact", "/probe", "--plan", plan, "--ball-radius-mm", RADIUS * 1e3, "--touch-uncertainty-um", 1]
        _, said = probecell("import", "contacts", folder / name, *arguments, "--out", folder / f"{name}_session", status=status)
        return said, [] if status else [one.deviation for one in messages(folder / f"{name}_session")["touch_deviations"]]

    _, wanted = imported("right", right, levels(contacts))
    for name, samples, signal, says in [("stops", stops, levels(contacts), ""), ("bounces", right, bouncing, "within 4.7 ms at 10 of 10 contacts")]:
        said, found = imported(name, samples, signal)
        assert says in said and len(found) == len(wanted), said
        for one, other in zip(found, wanted):
            close(one, other, 0.1e-6)
    said, _ = imported("doubled", doubled, levels(contacts), status=2)
    assert "two nodes publish them" in said and said.count("\n") == 1, said


@check
def a_contact_that_belongs_to_no_point_is_named_and_not_lost(folder):
    touched = points()[:10]
    samples, contacts = motion(touched)
    bag, plan = folder / "bag", plan_of(folder, touched[:9])
    write_bag(bag, [("/tcp", "geometry_msgs/msg/PoseStamped", samples), ("/probe", "std_msgs/msg/Bool", levels(contacts))])
    arguments = ["import", "contacts", bag, "--pose", "/tcp", "--contact", "/probe", "--plan", plan, "--ball-radius-mm", RADIUS * 1e3]
    _, error = probecell(*arguments, "--out", folder / "session", status=2)
    assert "contact 10 at" in error and "nearest point of the plan" in error, error
    assert not (folder / "session").exists()
    _, error = probecell(*arguments, "--skip-strays", "--out", folder / "session", status=3)
    assert error.count("refused: contact 10") == 1, error
    assert len(messages(folder / "session")["probe_events"]) == 9
    for wrong, says in (["--contact", "/tcp"], "geometry_msgs/msg/PoseStamped"), (["--contact", "/nothing"], "/nothing"):
        _, error = probecell("import", "contacts", bag, "--pose", "/tcp", "--plan", plan, *wrong, "--out", folder / "never", status=2)
        assert says in error and error.count("\n") == 1, error
