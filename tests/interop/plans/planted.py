"""The checker itself: on a small part a sound order passes, and each mistake planted in it is found, alone.

A block of 60 x 60 x 40 mm with a bore and a boss, a ball on a post, and a machine of three axes with a stylus along Z.
"""

import copy
import sys

import numpy

import checker

URDF = """<robot name="xyz"><link name="foundation"/><link name="workpiece"/><link name="a"/><link name="b"/>
<link name="probe_mount"/>
<joint name="fixed" type="fixed"><parent link="foundation"/><child link="workpiece"/></joint>
<joint name="X" type="prismatic"><parent link="foundation"/><child link="a"/><origin xyz="0 0 0.1"/><axis xyz="1 0 0"/>
<limit lower="-0.2" upper="0.2" effort="0" velocity="0.5"/></joint>
<joint name="Y" type="prismatic"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
<limit lower="-0.2" upper="0.2" effort="0" velocity="0.5"/></joint>
<joint name="Z" type="prismatic"><parent link="b"/><child link="probe_mount"/><axis xyz="0 0 1"/>
<limit lower="-0.2" upper="0.2" effort="0" velocity="0.2"/></joint></robot>"""

RADIUS, STYLUS, OVERTRAVEL, REACH = 2e-3, 0.1, 1e-3, 4e-3
TOP, BORE, BOSS, SIDE, BALL = range(5)


def xyz(v):
    return dict(zip("xyz", map(float, v)))


def part(boss_foot=False):
    def feature(name, kind, origin, axis):
        return {"id": name, "kind": kind, "origin": xyz(origin), "axis": xyz(axis)}

    points = []

    def touch(feature, position, normal):
        points.append(
            {
                "feature": feature,
                "position": xyz(position),
                "normal": xyz(normal),
                "rotary_positions": [],
                "approach_distance": REACH,
                "retract_distance": REACH,
                "feed": 0.005,
            }
        )

    for x, y in ((-0.028, -0.028), (0.028, -0.028), (0.028, 0.028), (-0.028, 0.028)):
        touch(TOP, (x, y, 0.04), (0, 0, 1))
    for round_one, centre, side, heights in ((BORE, -0.015, -1, (0.03, 0.036)), (BOSS, 0.015, 1, (0.044, 0.05))):
        for height in heights:
            for angle in numpy.arange(4) * numpy.pi / 2:
                out = numpy.array([numpy.cos(angle), numpy.sin(angle), 0])
                touch(round_one, numpy.array([centre, 0, height]) + 0.008 * out, side * out)
    for y, z in ((-0.025, 0.01), (0.025, 0.01), (0.025, 0.035), (-0.025, 0.035)):
        touch(SIDE, (-0.03, y, z), (-1, 0, 0))
    for normal in ((0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)):
        touch(BALL, numpy.array([0.06, 0, 0.06]) + 0.01 * numpy.array(normal), normal)
    if boss_foot:
        touch(TOP, (0.019, 0, 0.04), (0, 0, 1))
    return {
        "features": [
            feature("top", checker.PLANE, (0, 0, 0.04), (0, 0, 1)),
            feature("bore", checker.BORE, (-0.015, 0, 0.04), (0, 0, 1)),
            feature("boss", checker.CYLINDER, (0.015, 0, 0.04), (0, 0, 1)),
            feature("side", checker.PLANE, (-0.03, 0, 0.02), (-1, 0, 0)),
            feature("ball", checker.SPHERE, (0.06, 0, 0.06), (0, 0, 1)),
        ],
        "points": points,
        "rotary_names": [],
        "part_pose": {"position": xyz((0.01, 0.02, 0.0)), "orientation": {"w": 1.0, **xyz((0, 0, 0))}},
        "stylus": {"ball_center": xyz((0, 0, -STYLUS)), "ball_radius": RADIUS},
    }


def targets(ball):
    """Axis positions of a ball centre in the part frame."""
    return [float(ball[0] + 0.01), float(ball[1] + 0.02), float(ball[2] + STYLUS - 0.1)]


def sound(boss_foot=False):
    """Every point from 80 mm above, in the order given; `boss_foot`: the last is one of the top where the boss stands."""
    plan, moves = part(boss_foot), []
    for index, point in enumerate(plan["points"]):
        position, normal = (numpy.array([point[key][letter] for letter in "xyz"]) for key in ("position", "normal"))
        stations = [position + height * normal for height in (RADIUS + REACH, RADIUS - OVERTRAVEL, RADIUS + REACH)]
        over = numpy.array([stations[0][0], stations[0][1], 0.08])
        for kind, ball in zip((checker.CLEARANCE, checker.APPROACH, checker.TOUCH, checker.RETRACT, checker.CLEARANCE), [over, *stations, over]):
            moves.append({"kind": kind, "point_index": index, "axis_positions": targets(ball), "feed": 0.0})
    return plan, {"axis_names": ["X", "Y", "Z"], "order": list(range(len(plan["points"]))), "moves": moves}


def complaints(change=lambda order: None, stages=None, given=None, boss_foot=False):
    raw, order = sound(boss_foot)
    order = copy.deepcopy(order)
    change(order)
    plan = checker.Plan.of(raw)
    plan.stages = stages or plan.stages
    return checker.complaints(plan, checker.Machine(URDF, plan), order, given)


def moves_of(order, point):
    """Place of the first move of a point."""
    return next(place for place, one in enumerate(order["moves"]) if one["point_index"] == point)


def straight(b):
    """Leaves out the way over clearance to a point from the one before it."""

    def change(order):
        first = moves_of(order, b)
        del order["moves"][first - 1 : first + 1]

    return change


def through(point, *balls):
    """Goes by these places after a point's retract instead of up."""

    def change(order):
        place = moves_of(order, point) + 4
        extra = [{"kind": checker.CLEARANCE, "point_index": point, "axis_positions": targets(ball), "feed": 0.0} for ball in balls]
        order["moves"][place : place + 1] = extra

    return change


def double(order):
    place = moves_of(order, 5)
    order["moves"][place:place] = copy.deepcopy(order["moves"][place : place + 5])
    order["order"].insert(5, 5)


def left_out(order):
    place = moves_of(order, 5)
    del order["moves"][place : place + 5]
    order["order"].remove(5)


def beyond(order):
    order["moves"][0]["axis_positions"][2] = 0.2001


def beside(order):
    for one in order["moves"][1:4]:
        one["axis_positions"][0] += 50e-6


def swapped(order):
    order["moves"] = order["moves"][5:10] + order["moves"][:5] + order["moves"][10:]
    order["order"][:2] = [1, 0]


CLEAR = 80e-3
# What is planted, the change of the sound order, and what each complaint then says (None: nothing is wrong).
CASES = [
    ("a sound order", lambda order: None, None),
    ("from touch to touch within the bore", straight(5), None),
    ("up in the middle of the bore", through(4, (-0.015, 0, 0.036), (-0.015, 0, CLEAR)), None),
    ("through the wall of the bore", through(4, (-0.015, 0, 0.033), (-0.015, 0.04, 0.033), (-0.015, 0.04, CLEAR)), "enters bore"),
    ("through the boss", through(14, (0.033, 0, 0.048), (0.033, 0, CLEAR)), "enters boss"),
    (
        "the stem grazes the boss, the ball passes under what is proved of it",
        through(3, (-0.028, 0.028, 0.046), (0.015, 0.0091, 0.0422), (0.015, 0.04, 0.0422), (0.015, 0.04, CLEAR)),
        "stem enters boss",
    ),
    ("the ball passes the boss at 0.1 mm", through(12, (0.03, 0.0101, 0.047), (0, 0.0101, 0.047), (0, 0.03, CLEAR)), None),
    ("the ball grazes the boss by 0.1 mm", through(12, (0.03, 0.0099, 0.047), (0, 0.0099, 0.047), (0, 0.03, CLEAR)), "ball enters boss"),
    ("down through the top", through(0, (-0.02, -0.02, CLEAR), (-0.02, -0.02, 0.035), (-0.02, -0.02, CLEAR)), "enters top"),
    ("through the side", through(20, (0, -0.025, 0.02), (-0.045, -0.025, 0.02), (-0.045, -0.025, CLEAR)), "enters side"),
    ("through the ball on its post", through(25, (0.08, 0, 0.062), (0.04, 0, 0.062), (0.04, 0, CLEAR)), "enters ball"),
    ("a point twice", double, "touched 2 times"),
    ("a point left out", left_out, "touched 0 times"),
    ("an axis beyond its travel", beyond, "outside"),
    ("a touch 50 µm beside its point", beside, "beside its normal"),
]


def main():
    failed = 0

    def judge(what, found, wanted):
        nonlocal failed
        good = not found if wanted is None else bool(found) and all(wanted in one for one in found)
        failed += not good
        print(f"{'good' if good else 'BAD '} {what}: {'; '.join(found) or 'nothing found'}")

    for what, change, wanted in CASES:
        judge(what, complaints(change), wanted)
    stages = [1] + [0] * 28
    judge("a datum after what needs it", complaints(stages=stages), "datum")
    judge("a datum first", complaints(swapped, stages=[1, 0] + [1] * 27), None)
    # What a plan demands is not laid to the order, but only for that touch.
    judge("a touch demanded where the boss stands", complaints(boss_foot=True), None)
    judge("through the boss beside such a touch", complaints(through(14, (0.033, 0, 0.048), (0.033, 0, CLEAR)), boss_foot=True), "point 14")
    judge("longer than the order to beat", complaints(given=numpy.zeros((2, 3))), "longer")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
