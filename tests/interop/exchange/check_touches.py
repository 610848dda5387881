"""`probecell import touches`: tables of touches."""

import csv
import re

import touches
from check import answer, check, close, probecell
from kit.recordings import messages

TABLE = ["--columns", touches.COLUMNS, "--units", touches.UNITS]


@check
def a_table_of_500_touches_is_imported_and_its_shift_of_8_um_is_found(folder):
    """The three commands of the README."""
    table, bag = folder / "my.csv", folder / "my_session"
    written = touches.write(table)
    probecell("import", "touches", table, *TABLE, "--out", bag)
    found = answer("diagnose", bag)
    text, _ = probecell("report", bag)
    assert "fixture.shift" in text
    assert re.search(r"\bmy\W+500\W+0 of 0", text), text

    assert found["verdict"] == "explained" and found["samples"] == 500, found["verdict"]
    (effect,) = found["effects"]
    assert "fixture.shift" in effect["group"], effect
    assert not [name for name in effect["group"] if name.startswith(("axis.", "link."))], effect["group"]
    planted = sum(value**2 for value in touches.SHIFT_UM) ** 0.5
    largest = max(effect["parameters"], key=lambda one: abs(one["value"]))
    low, high = sorted(abs(bound) * 1e6 for bound in largest["ci95"])
    assert low <= planted <= high, largest
    assert abs(abs(largest["value"]) * 1e6 - planted) < 0.1
    # What is left is the noise that the table was written with.
    assert abs(effect["rms_after"] * 1e6 - touches.NOISE_UM) < 0.05, effect["rms_after"]

    # Every number of the table stands in the recording: d = n.(c - p) - r, read without any of our code.
    held = messages(bag)
    (plan,) = held["inspection_plan"]
    assert len(held["probe_events"]) == len(written)
    for row, event in zip(written, held["probe_events"]):
        point = plan.points[event.point_index]
        axes = dict(zip(event.axis_names, event.axis_positions))
        centre = (axes["X"], axes["Y"], axes["Z"])
        nominal = (point.position.x, point.position.y, point.position.z)
        normal = (point.normal.x, point.normal.y, point.normal.z)
        deviation = sum(n * (c - p) for n, c, p in zip(normal, centre, nominal)) - plan.stylus.ball_radius
        close(deviation, row[8] * 1e-6, 1e-15)
        for ours, theirs in zip(nominal, row[2:5]):
            close(ours, theirs * 1e-3, 1e-17)
        assert plan.features[point.feature].id == row[1]
        close(event.header.stamp.sec + event.header.stamp.nanosec * 1e-9, row[9], 1e-9)


@check
def features_of_a_table_are_evaluated_with_their_uncertainty(folder):
    table, features, bag = folder / "my.csv", folder / "features.csv", folder / "session"
    written = touches.write(table)
    features.write_text(touches.FEATURES)
    probecell("import", "touches", table, *TABLE, "--features", features, "--touch-uncertainty-um", 0.5, "--out", bag)
    sizes = {one["feature"]: one for one in answer("report", bag)["sizes"]}
    assert set(sizes) == {"left", "right", "front", "back", "top", "bore"}
    # A plane's deviation is the mean of its touches (least squares through all of them, at the origin of the plane).
    right = [row for row in written if row[1] == "right"]
    close(sizes["right"]["deviation"], sum(row[8] for row in right) / len(right) * 1e-6, 0.2e-6)
    assert sizes["right"]["conformity"] == "does_not_conform", sizes["right"]
    assert sizes["left"]["conformity"] == "conforms"
    close(sizes["bore"]["deviation"], 0.0, 0.5e-6)
    # u of the bore's diameter: 2 s / sqrt(n) for touches all around.
    bore = len([row for row in written if row[1] == "bore"])
    expected = 2 * 2 * 0.5e-6 / bore**0.5
    assert 0.9 < sizes["bore"]["expanded_uncertainty"] / expected < 1.1


@check
def a_table_without_times_names_no_instant_and_no_slip(folder):
    table, features = folder / "my.csv", folder / "features.csv"
    touches.write(table)
    features.write_text(touches.FEATURES)
    evaluated = ["--features", features, "--touch-uncertainty-um", 0.5]
    columns, units = (text.removesuffix(f",time={what}") for text, what in [(touches.COLUMNS, "Zeit"), (touches.UNITS, "s")])
    for name, words, is_timed in [
        ("timed", TABLE, True), ("untimed", ["--columns", columns, "--units", units], False),
    ]:
        bag = folder / name
        probecell("import", "touches", table, *words, *evaluated, "--out", bag)
        sizes = list(csv.DictReader(probecell("export", bag, "--format", "csv")[0].splitlines()))
        assert len(sizes) == 6 and all(bool(one["time"]) == is_timed for one in sizes), sizes
        assert bool(re.search(r"^ *ended ", probecell("report", bag)[0], re.MULTILINE)) == is_timed
        (effect,) = answer("diagnose", bag)["effects"]
        assert "fixture.shift" in effect["group"] and (is_timed or "process.slip" not in effect["group"]), effect["group"]


@check
def wrong_tables_are_refused_with_line_and_column(folder):
    table, bag = folder / "my.csv", folder / "session"
    rows = touches.write(table, 40)
    good = table.read_text()

    def refused(text, says, *more, columns=touches.COLUMNS, units=touches.UNITS):
        table.write_text(text)
        arguments = ["import", "touches", table, "--columns", columns, "--units", units, "--out", bag, *more]
        _, error = probecell(*arguments, status=2)
        assert says in error, (says, error)
        assert not bag.exists()

    lines = good.splitlines()
    cells = lines[7].split(",")
    spoiled = lambda index, text: "\n".join([*lines[:7], ",".join([*cells[:index], text, *cells[index + 1 :]]), *lines[8:]])
    column = lambda index: sum(len(cell) + 1 for cell in cells[:index]) + 1
    refused(spoiled(8, "NaN"), f"line 8, column {column(8)}: expected a finite number, found \"NaN\"")
    refused(spoiled(8, ""), f"line 8, column {column(8)}: expected a finite number, found nothing")
    refused(spoiled(5, "0.5"), f"line 8, column {column(5)}: expected i, j, k of unit length")
    refused("\n".join([*lines[:7], ",".join(cells[:4]), *lines[8:]]), "line 8, column ")
    refused(good, "the unit of length is not known", units="deviation=um,time=s")
    refused(good, 'there is no column "Abweichung"', columns=touches.COLUMNS.replace("Abw", "Abweichung"))
    refused(good, "mean nothing without their machine", columns=touches.COLUMNS.replace("deviation=", "axis.X="))
    refused(good.replace("Punkt", "Abw"), "two columns are named")
    refused("", "there is no column")
    # A decimal comma that cuts a number in two, a name that steers a terminal, and a length that is none.
    refused(spoiled(8, "-0,4"), "the row has 11 cells, and the header 10 columns: is the decimal sign a comma (--delimiter ';' --decimal-comma)")
    refused(spoiled(1, "right\x1b[2J"), f"line 8, column {column(1)}: expected the name of a feature")
    refused(spoiled(8, "1e300"), f"line 8, column {column(8)}: expected a length that a machine reaches")
    refused(spoiled(2, "-1e9"), f"line 8, column {column(2)}: expected a length that a machine reaches")

    # A unit that was not named for deviations is told.
    assert "deviation=um" in touches.UNITS
    units = ",".join(one for one in touches.UNITS.split(",") if one != "deviation=um")
    table.write_text(good)
    _, said = probecell("import", "touches", table, "--columns", touches.COLUMNS, "--units", units, "--out", folder / "mm")
    assert "note: deviations are read in mm, the unit of length (--units deviation=um for another)" in said, said
    # Other encodings are read, Latin-1 with a word.
    named = good.replace("right", "R\xfcckseite")
    for encoding, says in (("utf-16", ""), ("latin-1", "is not UTF-8: the file is read as Latin-1")):
        table.write_bytes(named.encode(encoding))
        _, said = probecell("import", "touches", table, *TABLE, "--out", folder / encoding)
        assert says in said, said
        assert "R\xfcckseite" in [one.id for one in messages(folder / encoding)["inspection_plan"][0].features]
    table.write_bytes(named.encode("utf-16-le"))
    _, error = probecell("import", "touches", table, *TABLE, "--out", bag, status=2)
    assert "UTF-16 without its mark" in error, error

    # Row by row only when asked to: every row that is left out is named, and the status says it.
    table.write_text(spoiled(8, "NaN"))
    _, error = probecell("import", "touches", table, *TABLE, "--skip-bad-rows", "--out", bag, status=3)
    assert error.count("refused: line 8") == 1, error
    info = answer("info", bag)
    counts = info["metadata"]["probecell_import"]
    assert (counts["rows_read"], counts["rows_refused"]) == ("39", "1"), counts
    assert len(messages(bag)["probe_events"]) == len(rows) - 1


@check
def a_semicolon_and_a_decimal_comma_read_the_same(folder):
    table, other = folder / "a.csv", folder / "b.csv"
    touches.write(table, 60)
    with open(table, encoding="utf-8") as plain, open(other, "w", encoding="utf-8") as german:
        for row in csv.reader(plain):
            german.write(";".join(cell.replace(".", ",") for cell in row) + "\n")
    probecell("import", "touches", table, *TABLE, "--name", "one", "--out", folder / "a")
    probecell("import", "touches", other, *TABLE, "--name", "one", "--delimiter", ";", "--decimal-comma", "--out", folder / "b")
    a, b = messages(folder / "a"), messages(folder / "b")
    assert [one.axis_positions for one in a["probe_events"]] == [one.axis_positions for one in b["probe_events"]]


@check
def touches_by_axis_positions_give_the_cells_own_sizes(folder):
    """The touches of a recorded sample by their axes alone, through a table: the same deviations as in the recording."""
    import pathlib

    root = pathlib.Path(__file__).resolve().parents[3]
    sample = root / "bags" / "samples" / "ball_check.mcap"
    held = messages(sample)
    events = held["probe_events"]
    names = list(events[0].axis_names)
    rotary = {"A", "B", "C", "S"}
    table = folder / "axes.csv"
    with open(table, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["P", *names, "F"])
        for event in events:
            writer.writerow([event.point_index, *event.axis_positions, event.feed])
    columns = ",".join(["point=P", "feed=F", *(f"axis.{name}={name}" for name in names)])
    assert rotary & set(names)
    bag = folder / "session"
    probecell("import", "touches", table, "--plan", sample, "--columns", columns, "--units", "length=m,angle=rad,feed=m/s",
              "--touch-uncertainty-um", 1, "--out", bag)
    recorded = [one.deviation for one in held["touch_deviations"]]
    again = [one.deviation for one in messages(bag)["touch_deviations"]]
    assert recorded == again and len(recorded) == len(events)
