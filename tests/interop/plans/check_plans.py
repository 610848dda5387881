"""Checks the product's plans for recorded sessions and for cells with the walker of checker.py.

    check_plans.py PROBECELL BAG_OR_CELL...

Each plan is made by `probecell plan --json`. The part of a bag is read from the bag itself; its order to beat is that in
which it was measured, from touch to touch in straight moves: no way past the part can be quicker. The touches of the
recording go through the same walker: approach and retract along the normal, in the attitude recorded, must be clear too.
Whether the recorded ways between touches would be clear is only told: the programs that made the trial sessions go straight
from touch to touch and know of no collision. Needs numpy and mcap-ros2-support.
"""

import dataclasses
import json
import pathlib
import sys
import tomllib

import numpy

import checker

sys.path.append(str(pathlib.Path(__file__).resolve().parents[2]))
import kit  # noqa: E402
from kit.recordings import decoded  # noqa: E402


def recorded(path):
    """Plan, URDF and touches (the first of each point) of a bag."""
    plan, urdf, touches = None, None, {}
    for channel, _, message in decoded(path):
        topic = channel.topic.rsplit("/", 1)[-1]
        if topic == "inspection_plan":
            plan = plan or checker.Plan.of(message)
        elif topic == "robot_description":
            urdf = urdf or message.data
        elif topic == "probe_events":
            touches.setdefault(message.point_index, dict(zip(message.axis_names, message.axis_positions)))
    return plan, urdf, touches


def of_cell(path, order):
    """Plan and URDF of a cell file; which features are a datum is the file's word."""
    cell = tomllib.loads(path.read_text())
    plan = checker.Plan.of(order["plan"])
    datum = {one["id"] for one in cell["part"]["features"] if one.get("datum")}
    if datum:
        plan.stages = [0 if plan.names[feature] in datum else 1 for feature in plan.feature]
    return plan, (path.parent / cell["cell"]["robot_description"]).read_text()


def recorded_touches(plan, machine, names, positions, points):
    """What approach and retract of recorded touches hit: the ball goes along the normal, in the attitude at the contact."""
    balls, mounts = machine.stylus(names, positions)
    moves = []
    for index, point in enumerate(points):
        off = plan.normal[point] @ (balls[index] - plan.position[point]) - plan.radius
        for height in (plan.approach[point], plan.retract[point]):
            moves.append(checker.Move(checker.TOUCH, point, numpy.array([index, height]), numpy.array([index, max(off, 0.0)])))

    def stylus(places):
        index = places[:, 0].round().astype(int)
        normal = plan.normal[numpy.array(points)[index]]
        ball = plan.position[numpy.array(points)[index]] + normal * (plan.radius + places[:, 1:])
        return ball, ball + mounts[index] - balls[index]

    return checker.walked(plan, checker.patches(plan), moves, stylus)


def check(probecell, path):
    code, output, errors = kit.run(probecell, "plan", path, "--json", seconds=300)
    if code != 0:
        return [f"no plan: {errors.strip()}"], ""
    order = json.loads(output)
    names, given, told = order["axis_names"], None, ""
    if path.suffix == ".toml":
        plan, urdf = of_cell(path, order)
        machine = checker.Machine(urdf, plan)
        found = []
    else:
        plan, urdf, touches = recorded(path)
        machine = checker.Machine(urdf, plan)
        points = list(touches)
        given = numpy.array([[touches[point][name] for name in names] for point in points])
        found = []
        stood = {points[move // 2]: hit for move, hit in recorded_touches(plan, machine, names, given, points).items()}
        inside = {point for point, _ in checker.impossible(plan, machine, order)}
        for point, (feature, what, depth) in stood.items():
            if point not in inside:
                found.append(f"as recorded: the {what} enters {plan.names[feature]} by {1e3 * depth:.3f} mm at point {point}")
        ways = [checker.Move(checker.CLEARANCE, 0, a, b) for a, b in zip(given, given[1:])]
        # With a ball and stem of a tenth of a millimetre: what they meet is not a graze.
        thin = dataclasses.replace(plan, radius=1e-4)
        through = checker.walked(thin, checker.patches(plan), ways, lambda q: machine.stylus(names, q))
        told = f"; of {len(ways)} ways from touch to touch as recorded {len(through)} lead through the part"
        if inside:
            told += f"; {len(inside)} points lie where another feature is, {len(stood)} of them in its very wall"
    found += checker.complaints(plan, machine, order, given)
    return found, f"{len(order['order'])} touches, {order['air_time']:.1f} s between them against {order['given_air_time']:.1f} s{told}"


def main(probecell, paths):
    bad = 0
    for path in map(pathlib.Path, paths):
        found, told = check(probecell, path)
        print(f"{path.name}: {told}", flush=True)
        for complaint in found[:10]:
            print(f"  {complaint}")
        if len(found) > 10:
            print(f"  and {len(found) - 10} more")
        bad += bool(found)
    print(f"{len(paths)} plans, {bad} with something wrong")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2:]))
