#!/usr/bin/env python3
"""Geometrical tolerances of a made part against SciPy, and in what goes out.

    check.py PROBECELL

A casting is made on the simulated machine with tolerances of every kind that its features have. Each value is computed anew from the
recorded touches, by linear programs and minimisation of SciPy that share nothing with the program, and then looked for in report and
exports.
"""
import csv
import io
import pathlib
import shutil
import sys

import numpy
from scipy.optimize import least_squares, linprog
from scipy.spatial.transform import Rotation

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "interop" / "plans")]
import kit  # noqa: E402
from checker import Machine, Plan  # noqa: E402
from kit.recordings import messages  # noqa: E402

PROGRAM = pathlib.Path(sys.argv[1]).resolve()
SAME = 2e-9  # m
TOLERANCES = [  # name, feature, kind, µm, datums
    ("A_flat", "A", "flatness", 30.0, []),
    ("B_square", "B", "perpendicularity", 30.0, ["A"]),
    ("C_square", "C", "perpendicularity", 30.0, ["B"]),
    ("bore_square", "bore", "perpendicularity", 30.0, ["A"]),
    ("bore_parallel", "bore", "parallelism", 30.0, ["B"]),
    ("bore_place", "bore", "position", 60.0, ["A", "B", "C"]),
    ("bore_round", "bore", "roundness", 30.0, []),
    ("bore_cylindrical", "bore", "cylindricity", 30.0, []),
    ("D_parallel", "D", "parallelism", 30.0, ["B"]),
    ("D_upright", "D", "parallelism", 30.0, ["bore"]),
    ("D_profile", "D", "profile", 60.0, ["A", "B", "C"]),
    ("D_place", "D", "position", 60.0, ["A", "B", "C"]),
    ("A_wobble", "A", "total_run_out", 150.0, ["bore"]),
    ("bore_too_tight", "bore", "cylindricity", 0.5, []),
]
TERMS = {"total_run_out": "total run-out", "profile": "profile of a surface"}


def plane_zone(points, start, across=None):
    """Width of the closest two parallel planes that hold points: their normal turned freely, or about `across` only."""
    normal = start
    for _ in range(30):
        sides = [numpy.cross(across, normal)] if across is not None else numpy.linalg.svd(normal[None])[2][1:]
        sides = [one / numpy.linalg.norm(one) for one in sides]
        columns = numpy.column_stack([points @ one for one in sides] + [-numpy.ones(len(points))])
        height, count = points @ normal, len(points)
        rows = numpy.vstack([numpy.column_stack([columns, -numpy.ones(count)]), numpy.column_stack([-columns, -numpy.ones(count)])])
        cost = numpy.zeros(rows.shape[1])
        cost[-1] = 1
        scale = 1e3  # mm, for the tolerances of the solver
        right = numpy.concatenate([-height, height]) * scale
        solved = linprog(cost, scaled(rows, len(sides), scale), right, bounds=[(None, None)] * len(cost), method="highs")
        step = sum(one * amount for one, amount in zip(sides, solved.x))
        normal = normal + step
        normal /= numpy.linalg.norm(normal)
        if numpy.linalg.norm(step) < 1e-13:
            break
    return numpy.ptp(points @ normal)


def scaled(rows, tilts, scale):
    """Columns of the tilts in mm, the others (offset, half width) are mm already."""
    rows = rows.copy()
    rows[:, :tilts] *= scale
    return rows


def round_zone(points, axis, tilted):
    """Distance of the closest two coaxial cylinders (or, in one section, circles) that hold points."""
    one = numpy.linalg.svd(axis[None])[2][1:]
    centre, direction = points.mean(0), axis
    for _ in range(60):
        along = (points - centre) @ direction
        off = points - centre - numpy.outer(along, direction)
        radius = numpy.linalg.norm(off, axis=1)
        out = off / radius[:, None]
        columns = [-out @ side for side in one] + ([-(out @ side) * along for side in one] if tilted else []) + [-numpy.ones(len(points))]
        columns = numpy.column_stack(columns)
        count, scale = len(points), 1e3
        weights = numpy.array([1.0] * 2 + ([scale] * 2 if tilted else []) + [1.0])
        rows = columns * weights
        rows = numpy.vstack([numpy.column_stack([rows, -numpy.ones(count)]), numpy.column_stack([-rows, -numpy.ones(count)])])
        cost = numpy.zeros(rows.shape[1])
        cost[-1] = 1
        solved = linprog(cost, rows, numpy.concatenate([-radius, radius]) * scale, bounds=[(None, None)] * len(cost), method="highs")
        shift = sum(side * amount / scale for side, amount in zip(one, solved.x[:2]))
        tilt = sum(side * amount for side, amount in zip(one, solved.x[2:4])) if tilted else 0 * axis
        centre, direction = centre + shift, direction + tilt
        direction /= numpy.linalg.norm(direction)
        if numpy.linalg.norm(shift) < 1e-13 and numpy.linalg.norm(tilt) < 1e-13:
            break
    off = points - centre
    return numpy.ptp(numpy.linalg.norm(off - numpy.outer(off @ direction, direction), axis=1))


def least_squares_plane(points, facing):
    normal = numpy.linalg.svd(points - points.mean(0))[2][2]
    return points.mean(0), normal * numpy.sign(normal @ facing)


def least_squares_cylinder(points, axis):
    one = numpy.linalg.svd(axis[None])[2][1:]
    middle = points.mean(0)

    def at(x):
        direction = axis + x[2] * one[0] + x[3] * one[1]
        return middle + 1e-3 * (x[0] * one[0] + x[1] * one[1]), direction / numpy.linalg.norm(direction)

    def errors(x):
        centre, direction = at(x)
        off = points - centre
        return 1e3 * numpy.linalg.norm(off - numpy.outer(off @ direction, direction), axis=1) - x[4]

    return at(least_squares(errors, [0, 0, 0, 0, 10.0], xtol=1e-15, ftol=1e-15, gtol=1e-15).x)


def expected(kind, own, datum):
    points, feature = own
    normal = numpy.array([feature.axis.x, feature.axis.y, feature.axis.z])
    origin = numpy.array([feature.origin.x, feature.origin.y, feature.origin.z])
    plane = feature.kind == 0
    if kind == "flatness":
        return plane_zone(points, least_squares_plane(points, normal)[1])
    if kind == "cylindricity":
        return round_zone(points, least_squares_cylinder(points, normal)[1], True)
    if kind == "roundness":
        heights = numpy.round(points @ normal, 3)
        return max(round_zone(flat - numpy.outer(flat @ normal, normal), normal, False)
                   for flat in (points[heights == height] for height in numpy.unique(heights)))
    if kind in ("position", "profile") and plane:
        return 2 * abs((points - origin) @ normal - RADIUS).max()
    if kind == "position":
        centre, axis = least_squares_cylinder(points, normal)
        ends = [centre + axis * ((height - centre @ normal) / (axis @ normal)) for height in ((points @ normal).min(), (points @ normal).max())]
        return 2 * max(numpy.linalg.norm((end - origin) - normal * ((end - origin) @ normal)) for end in ends)
    other, datum_feature = datum
    facing = numpy.array([datum_feature.axis.x, datum_feature.axis.y, datum_feature.axis.z])
    fit = least_squares_plane if datum_feature.kind == 0 else least_squares_cylinder
    place, direction = fit(other, facing)
    if kind == "total_run_out":
        return numpy.ptp(points @ direction)
    if plane and kind == "parallelism" and datum_feature.kind == 0:
        return numpy.ptp(points @ direction)
    if plane:
        start = normal - direction * (normal @ direction)
        return plane_zone(points, start / numpy.linalg.norm(start), direction)
    axis = least_squares_cylinder(points, normal)[1]
    length = numpy.ptp(points @ axis)
    if kind == "perpendicularity":
        return length * numpy.linalg.norm(axis - direction * (axis @ direction))
    return length * abs(axis @ direction)


def main(folder):
    global RADIUS
    shutil.copy(ROOT / "launch-scripts" / "three_axis.urdf", folder)
    text = (ROOT / "launch-scripts" / "clamped_casting.toml").read_text()
    more = "touch_points_mm = [[-28.0, -22.0, 0.0], [28.0, -22.0, 0.0], [28.0, 22.0, 0.0], [-28.0, 22.0, 0.0], [-28.0, 0.0, 0.0], [-10.0, -22.0, 0.0], [28.0, 0.0, 0.0]]"
    text = text.replace("touch_points_mm = [[-28.0, -22.0, 0.0], [28.0, -22.0, 0.0], [28.0, 22.0, 0.0], [-28.0, 22.0, 0.0]]", more)
    assert more in text
    fourth = """[[part.features]]
id = "D"
kind = "plane"
origin_mm = [0.0, 30.0, 0.0]
axis = [0.0, 1.0, 0.0]
tolerance_um = [-500.0, 500.0]
touch_points_mm = [[-25.0, 30.0, -8.0], [25.0, 30.0, -8.0], [0.0, 30.0, -16.0], [-15.0, 30.0, -16.0], [20.0, 30.0, -14.0]]

"""
    text = text.replace('[[part.features]]\nid = "bore"', fourth + '[[part.features]]\nid = "bore"')
    text = text.replace("touch_sd_um = 0.5", "touch_sd_um = 2.0").replace("touch_standard_uncertainty_um = 1.0", "touch_standard_uncertainty_um = 2.0")
    for name, feature, kind, limit, datums in TOLERANCES[:-1]:
        text += f'\n[[analysis.tolerances]]\nid = "{name}"\nfeature = "{feature}"\nkind = "{kind}"\ntolerance_um = {limit}\ndatums = {datums}\npasses = ["bore"]\n'
    cell = folder / "casting.toml"
    cell.write_text(text)
    good = run(folder, cell)
    assert good[0] == 0 and "qualified" in good[1], good
    (bag,) = (folder / "recordings").glob("*")
    check_values(bag)
    check_outputs(folder, bag)
    shutil.rmtree(folder / "recordings")
    name, feature, kind, limit, datums = TOLERANCES[-1]
    cell.write_text(text + f'\n[[analysis.tolerances]]\nid = "{name}"\nfeature = "{feature}"\nkind = "{kind}"\ntolerance_um = {limit}\npasses = ["bore"]\n')
    code, output = run(folder, cell)
    assert code == 1 and name in output, (code, output)
    print(f"a bore that is no cylinder to {limit} µm does not pass: " + [line for line in output.splitlines() if line.startswith("part ")][-1])


def run(folder, cell):
    code, output, errors = kit.run(PROGRAM, "up", cell, "--once", "--speed", "max", folder=folder, seconds=300)
    return code, output + errors


def check_values(bag):
    global RADIUS
    found = messages(bag)
    plan = found["inspection_plan"][-1]
    RADIUS = plan.stylus.ball_radius
    results = {one.feature_id: one for one in found["feature_results"] if one.plan_id == plan.plan_id}
    events = {one.sequence: one for one in found["probe_events"]}
    machine = Machine(found["robot_description"][-1].data, Plan.of(plan))
    place = [one for one in found["part_alignment"] if one.plan_id == plan.plan_id][-1]
    turn = Rotation.from_rotvec([place.rotation.x, place.rotation.y, place.rotation.z])
    shift = numpy.array([place.shift.x, place.shift.y, place.shift.z])

    def touched(name):
        (feature,) = [one for one in plan.features if one.id == name]
        own = [events[number] for number in results[name].sequences]
        balls = numpy.array([machine.stylus(one.axis_names, numpy.array([one.axis_positions]))[0][0] for one in own])
        return turn.inv().apply(balls - shift), feature

    for name, feature, kind, _, datums in TOLERANCES[:-1]:
        result = results[name]
        value = expected(kind, touched(feature), touched(datums[0]) if datums else None)
        print(f"  {name:18} {result.size * 1e6:8.4f} µm, SciPy {value * 1e6:8.4f} µm, U {result.coverage_factor * result.standard_uncertainty * 1e6:6.2f} µm")
        assert abs(result.size - value) < SAME, (name, result.size, value)
        assert result.standard_uncertainty > 0 and list(result.aligned_to) == datums


def check_outputs(folder, bag):
    def out(*words):
        code, output, errors = kit.run(PROGRAM, *words, folder=folder)
        assert code == 0, errors
        return output

    results = {one.feature_id: one for one in messages(bag)["feature_results"]}
    rows = {row["feature"]: row for row in csv.DictReader(io.StringIO(out("export", bag, "--format", "csv"))) if row["plan"] == results["A_flat"].plan_id}
    qif, dfq = out("export", bag, "--format", "qif"), out("export", bag, "--format", "dfq")
    streams, page = out("export", bag, "--format", "mtconnect"), out("report", bag)
    for name, _, kind, limit, datums in TOLERANCES[:-1]:
        term = TERMS.get(kind, kind)
        row = rows[name]
        assert row["kind"] == term and row["status"] in ("PASS", "INDETERMINATE"), row
        assert abs(float(row["size_mm"]) - results[name].size * 1e3) < 1e-12 and abs(float(row["upper_um"]) - limit) < 1e-9, row
        assert f"{term} (ISO 1101)" in qif and term in dfq and term.upper().replace(" ", "_").replace("-", "_") in streams, name
        assert f"{name} " in page and term in page, name


if __name__ == "__main__":
    kit.main({"geometrical tolerances": main})
