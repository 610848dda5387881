"""`probecell import plan`, `reference`, `readings` and `results --out`: files that plain Python wrote, or that others published."""

import csv
import math
import random

from check import ROOT, SCHEMAS, answer, check, close, probecell
from kit.recordings import messages

SAMPLES = SCHEMAS / "qif3" / "samples"
SPACE = {"q": "http://qifstandards.org/xsd/qif3"}


def vector(of):
    return (of.x, of.y, of.z)


def sample_points(path):
    """Points with normals of a QIF document, read by lxml: name to (place, normal) in mm."""
    from lxml import etree

    tree = etree.parse(str(path))
    by_id = {one.get("id"): one for one in tree.iter() if isinstance(one.tag, str) and one.get("id")}
    found = {}
    for item in tree.xpath("//q:FeatureItems/*", namespaces=SPACE):
        nominal = by_id[item.xpath("q:FeatureNominalId", namespaces=SPACE)[0].text]
        if "Point" in nominal.tag:
            place, normal = (nominal.xpath(f"q:{name}", namespaces=SPACE)[0].text for name in ("Location", "Normal"))
            name = item.xpath("q:FeatureName", namespaces=SPACE)[0].text
            found[name] = tuple(tuple(map(float, text.split())) for text in (place, normal))
    return found


@check
def the_published_qif_samples_are_read_as_plans(folder):
    if not SAMPLES.is_dir():
        return "the published samples are not there"
    counts = {"simplePlan": (6, 3), "QIF_Results_Sample": (6, 3), "SheetMetal_QIF_Results_sample_1": (21, 17)}
    for name, (features, points) in counts.items():
        path = SAMPLES / f"{name}.QIF"
        probecell("import", "plan", path, "--format", "qif", "--out", folder / name)
        (plan,) = messages(folder / name)["inspection_plan"]
        assert (len(plan.features), len(plan.points)) == (features, points), (name, len(plan.features), len(plan.points))
        expected = sample_points(path)
        assert len(expected) == points
        for point in plan.points:
            place, normal = expected[plan.features[point.feature].id]
            length = math.hypot(*normal)
            for ours, theirs in zip(vector(point.position), place):
                close(ours, theirs * 1e-3, 1e-15)
            for ours, theirs in zip(vector(point.normal), normal):
                close(ours, theirs / length, 1e-15)
    (plan,) = messages(folder / "simplePlan")["inspection_plan"]
    limits = {one.id: (one.lower_tolerance * 1e3, one.upper_tolerance * 1e3) for one in plan.features}
    for name, (low, high) in {"TRIM1": (-2, 2), "SURF2": (-0.5, 1), "HOLE1": (-0.4, 0.4), "HOLE2": (-0.4, 0.4)}.items():
        close(limits[name][0], low, 1e-12)
        close(limits[name][1], high, 1e-12)
    holes = {one.id: one for one in plan.features if one.id.startswith("HOLE")}
    assert all(one.kind == 2 and abs(one.radius - 5e-3) < 1e-15 for one in holes.values())
    # The fourth sample has a verdict on a part and no feature at all.
    _, error = probecell("import", "plan", SAMPLES / "mitutoyo_results_serialized_pass_fail_sample.QIF", "--format", "qif",
                         "--out", folder / "none", status=2)
    assert "no feature" in error


@check
def the_published_qif_results_become_a_reference(folder):
    from lxml import etree

    if not SAMPLES.is_dir():
        return "the published samples are not there"
    path = SAMPLES / "QIF_Results_Sample.QIF"
    probecell("import", "plan", path, "--format", "qif", "--out", folder / "plan")
    probecell("import", "reference", path, "--format", "qif", "--to", folder / "plan", "--instrument", "Umess",
              "--uncertainty-um", 2, "--out", folder / "both")
    held = messages(folder / "both")
    (plan,), (reference,) = held["inspection_plan"], held["reference"]
    tree = etree.parse(str(path))
    by_id = {one.get("id"): one for one in tree.iter() if isinstance(one.tag, str) and one.get("id")}
    nominal = sample_points(path)
    measured = {}
    for one in tree.xpath("//q:MeasuredFeatures/*[q:Location and not(q:Diameter)]", namespaces=SPACE):
        item = by_id[one.xpath("q:FeatureItemId", namespaces=SPACE)[0].text]
        name = item.xpath("q:FeatureName", namespaces=SPACE)[0].text
        measured[name] = tuple(map(float, one.xpath("q:Location", namespaces=SPACE)[0].text.split()))
    assert len(reference.point_index) == len(measured) == 3
    assert (reference.instrument, reference.standard_uncertainty) == ("Umess", 2e-6)
    for index, deviation in zip(reference.point_index, reference.deviation):
        name = plan.features[plan.points[index].feature].id
        place, normal = nominal[name]
        length = math.hypot(*normal)
        expected = sum(n / length * (m - p) for n, m, p in zip(normal, measured[name], place)) * 1e-3
        close(deviation, expected, 1e-14)


@check
def a_reference_in_a_table_is_compared_with_the_readings(folder):
    table = folder / "part.csv"
    chance = random.Random(3)
    points = [(x, y) for x in (5, 35, 65, 95) for y in (5, 35, 65)]
    with open(table, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["x", "y", "z", "dev"])
        writer.writerows([x, y, 40, 4 + chance.gauss(0, 0.2)] for x, y in points)
    (folder / "features.csv").write_text("id,kind,x,y,z,i,j,k,lower,upper\nsurface,plane,0,0,40,0,0,1,-10,10\n")
    units = ["--units", "length=mm,deviation=um"]
    # The normal has no column of its own: constants are columns too.
    rows = table.read_text().replace("dev", "dev,i,j,k")
    table.write_text("\n".join(line if number == 0 else f"{line},0,0,1" for number, line in enumerate(rows.splitlines())))
    probecell("import", "touches", table, "--columns", "nominal_x=x,nominal_y=y,nominal_z=z,i=i,j=j,k=k,deviation=dev",
              *units, "--features", folder / "features.csv", "--touch-uncertainty-um", 0.3, "--common-uncertainty-um", 0.5,
              "--out", folder / "session")
    for name, offset, contradicts in (("agrees", 4.3, False), ("differs", 0.0, True)):
        cmm = folder / f"{name}.csv"
        cmm.write_text("P,D\n" + "".join(f"{number},{offset}\n" for number in range(len(points))))
        bag = folder / name
        probecell("import", "reference", cmm, "--format", "csv", "--columns", "point=P,deviation=D", "--units", "deviation=um",
                  "--to", folder / "session", "--instrument", "CMM", "--uncertainty-um", 0.4, "--out", bag)
        (size,) = answer("report", bag)["sizes"]
        assert size["contradicted"] == contradicts, size
        u_own, u_cmm = size["expanded_uncertainty"], size["reference"]["expanded_uncertainty"]
        score = abs(size["deviation"] - size["reference"]["deviation"]) / math.hypot(u_own, u_cmm)
        close(size["reference"]["normalised_error"], score, 1e-9)
        assert (score > 1) == contradicts
    bad = folder / "bad.csv"
    bad.write_text("P,D\n3,1\n12,1\n")
    _, error = probecell("import", "reference", bad, "--format", "csv", "--columns", "point=P,deviation=D", "--units",
                         "deviation=um", "--to", folder / "session", "--instrument", "CMM", "--uncertainty-um", 1, "--out",
                         folder / "never", status=2)
    assert "line 3" in error and "there is no point 12" in error and not (folder / "never").exists()


DMIS = """DMISMN/'bracket',05.0
UNITS/MM,ANGDEC  $$ lengths are mm
T(BORE_T)=TOL/DIAM,-0.02,0.03
T(SKIN_T)=TOL/PROFP,-0.1,0.1
F(BORE)=FEAT/CYLNDR,INNER,CART,10.5,20,0, $
        0,0,1,12.5,30
F(TOP)=FEAT/PLANE,CART,0,0,25,0,0,1
F(P1)=FEAT/POINT,CART,1,2,25,0,0,1
F(P2)=FEAT/POINT,CART,4,2,25,0,0,1
MEAS/PLANE,F(TOP),3
  PTMEAS/CART,5,5,25,0,0,1
  PTMEAS/CART,45,5,25,0,0,1
  PTMEAS/CART,25,45,25,0,0,1
ENDMES
OUTPUT/FA(BORE),TA(BORE_T)
EVAL/FA(P1),T(SKIN_T)
ENDFIL
"""
DMIS_OUTPUT = """UNITS/INCH,ANGDEC
F(P1)=FEAT/POINT,CART,{0},{1},{2},0,0,1
FA(P1)=FEAT/POINT,CART,{0},{1},{3},0,0,1
TA(SKIN_T)=TOL/PROFP,0.0004,INTOL
"""


@check
def dmis_programs_and_output_are_read(folder):
    program, output = folder / "bracket.dmi", folder / "bracket.dmo"
    program.write_text(DMIS)
    probecell("import", "plan", program, "--format", "dmis", "--out", folder / "plan")
    (plan,) = messages(folder / "plan")["inspection_plan"]
    features = {one.id: one for one in plan.features}
    assert list(features) == ["BORE", "TOP", "P1", "P2"]
    bore = features["BORE"]
    close(bore.radius, 6.25e-3, 1e-17)
    assert bore.kind == 2 and vector(bore.axis) == (0, 0, 1)
    close(bore.lower_tolerance, -2e-5, 1e-17)
    close(bore.upper_tolerance, 3e-5, 1e-17)
    close(features["P1"].upper_tolerance, 1e-4, 1e-17)
    assert math.isinf(features["P2"].upper_tolerance)
    of = [plan.features[point.feature].id for point in plan.points]
    assert of == ["TOP", "TOP", "TOP", "P1", "P2"], of
    # The output is in inches, with as many digits as it takes.
    output.write_text(DMIS_OUTPUT.format(*(repr(value / 25.4) for value in (1, 2, 25, 25.0102))))
    probecell("import", "reference", output, "--format", "dmis", "--to", folder / "plan", "--instrument", "CMM",
              "--uncertainty-um", 1, "--out", folder / "both")
    (reference,) = messages(folder / "both")["reference"]
    assert list(reference.point_index) == [3]
    close(reference.deviation[0], 10.2e-6, 1e-12)
    program.write_text(DMIS.replace("20,0, $", "20,zero, $"))
    _, error = probecell("import", "plan", program, "--format", "dmis", "--out", folder / "never", status=2)
    assert "line 5" in error and "3 finite numbers" in error, error


@check
def a_positioning_test_by_iso_230_2_shows_its_lost_motion(folder):
    """Targets every 10 mm, five runs up and down, 8 um lost: written by target, as instruments do, not by time."""
    chance = random.Random(230)
    table = folder / "x.csv"
    rows = []
    for target in range(0, 301, 10):
        for run in range(1, 6):
            for direction in "+-":
                error = (-4 if direction == "+" else 4) + chance.gauss(0, 0.3)
                rows.append(["X", target, direction, run, error])
    with open(table, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["axis", "target", "direction", "repeat", "deviation"])
        writer.writerows(rows)
    probecell("import", "readings", table, "--test", "positioning", "--units", "length=mm,deviation=um", "--out", folder / "x")
    found = answer("diagnose", folder / "x")
    named = [one["effect"] for one in found["effects"]]
    assert named == ["axis.X.backlash"], named
    size = max(abs(one["value"]) for one in found["effects"][0]["parameters"] if one["unit"] == "m")
    assert min(abs(size * 1e6 - 8), abs(size * 1e6 - 4)) < 0.3, found["effects"][0]["parameters"]
    # Nothing of the table is lost: each deviation stands behind the place where the reflector was seen.
    held = messages(folder / "x")
    (plan,) = held["inspection_plan"]
    seen = sorted(
        (round(event.axis_positions[0] * 1e3, 6), plan.points[event.point_index].position.x - event.axis_positions[0])
        for event in held["probe_events"]
    )
    wanted = sorted((row[1], row[4] * 1e-6) for row in rows)
    assert len(seen) == len(wanted)
    for (place, error), (target, written) in zip(seen, wanted):
        close(place, target)
        close(error, written, 1e-15)


@check
def a_circular_test_shows_a_scale_that_differs(folder):
    """A ball bar of 150 mm on a machine whose X travels 40 um too much in a metre; both directions."""
    chance = random.Random(4)
    table = folder / "bar.csv"
    with open(table, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["angle", "direction", "deviation"])
        for direction, angles in (("ccw", range(0, 361, 3)), ("cw", range(360, -1, -3))):
            for angle in angles:
                error = 40e-6 * 150e3 * math.cos(math.radians(angle)) ** 2 + chance.gauss(0, 0.1)
                writer.writerow([angle, direction, error])
    arguments = ["--test", "circular", "--plane", "X", "Y", "--radius-mm", 150, "--at", "X=0,Y=0", "--units",
                 "length=mm,angle=deg,deviation=um"]
    probecell("import", "readings", table, *arguments, "--out", folder / "bar")
    found = answer("diagnose", folder / "bar")
    (effect,) = found["effects"]
    assert "axis.X.scale" in effect["group"], found["effects"]
    assert effect["rms_after"] < 0.12e-6
    text = table.read_text().splitlines()
    text[5], text[6] = text[6], text[5]
    table.write_text("\n".join(text))
    _, error = probecell("import", "readings", table, *arguments, "--out", folder / "never", status=2)
    assert "line 7" in error and "continues ccw" in error, error


@check
def what_a_controller_printed_becomes_a_session(folder):
    """The touches of a sample as a FANUC program prints them (DPRNT, mm and degrees): the same sizes, with U and limits."""
    sample = ROOT / "bags" / "samples" / "punch.mcap"
    held = messages(sample)
    plan = held["inspection_plan"][-1]
    events = [event for event in held["probe_events"] if event.plan_id == plan.plan_id]
    names = list(events[0].axis_names)
    scale = [180 / math.pi if name in "ABC" else 1e3 for name in names]
    printed = folder / "printed.txt"
    lines = ["AXES " + " ".join(names)]
    for number, event in enumerate(events):
        values = " ".join(repr(value * factor) for value, factor in zip(event.axis_positions, scale))
        lines.append(f"TOUCH {number + 1} {event.point_index} {values}")
    printed.write_text("\r".join(lines) + "\r")
    cell = ROOT / "launch-scripts" / "turn_mill.toml"
    probecell("results", printed, "--plan", cell, "--out", folder / "session")
    sizes = {one["feature"]: one for one in answer("report", folder / "session")["sizes"]}
    recorded = {one.feature_id: one for one in held["feature_results"] if one.plan_id == plan.plan_id}
    assert set(sizes) == set(recorded) and len(sizes) > 8
    for name, one in recorded.items():
        close(sizes[name]["deviation"], one.size_deviation, 1e-12)
        close(sizes[name]["expanded_uncertainty"], one.coverage_factor * one.standard_uncertainty, 1e-12)
    features = {one.id: one for one in plan.features}
    for name in features:
        close(sizes[name]["limits"][1], features[name].upper_tolerance)
        assert sizes[name]["conformity"] == ("conforms", "does_not_conform", "indeterminate")[recorded[name].decision]
    assert answer("diagnose", folder / "session")["samples"] == len(events)
    text, _ = probecell("results", printed, "--plan", cell)
    assert " U " in text and "conforms" in text, text
