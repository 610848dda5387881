"""`probecell export`: what went out, read by lxml, aqdefreader and csv, against the recording as the mcap library reads it."""

import contextlib
import csv
import io
import math
import pathlib

import touches
from check import ROOT, SCHEMAS, check, close, probecell
from kit.recordings import messages

SAMPLES = ROOT / "bags" / "samples"
DIAMETERS = {1, 2, 3}  # CYLINDER, BORE, SPHERE
VERDICTS = {0: "PASS", 1: "REWORK", 2: "FAIL", 3: "FAIL", 4: "FAIL", 5: "SYSERROR", 6: "INDETERMINATE", 7: "SYSERROR"}
DECISIONS = {0: "PASS", 1: "FAIL", 2: "INDETERMINATE", 3: "SYSERROR"}


def sessions(folder):
    """Recordings to export: parts that a cell has made and judged, and imported touches with limits that U straddles."""
    table, features, bag = folder / "part.csv", folder / "features.csv", folder / "imported"
    touches.write(table)
    features.write_text(touches.FEATURES.replace("right,plane,120,0,0,1,0,0,,-5,5", "right,plane,120,0,0,1,0,0,,-8,8"))
    probecell("import", "touches", table, "--columns", touches.COLUMNS, "--units", touches.UNITS, "--features", features,
              "--touch-uncertainty-um", 0.5, "--common-uncertainty-um", 1, "--out", bag)
    yield bag
    for name in ("punch", "punch_uncalibrated"):
        copy = folder / name
        copy.mkdir()
        (copy / f"{name}.mcap").symlink_to(SAMPLES / f"{name}.mcap")
        yield copy


def expected(bag):
    """Sizes of a recording: (plan, feature) to result and status, from the messages alone."""
    held = messages(bag)
    measured = {touch.plan_id for touch in held.get("touch_deviations", [])}
    plans = {plan.plan_id: plan for plan in held["inspection_plan"] if plan.plan_id in measured}
    verdicts = {(one.plan_id, one.feature_id): one for one in held.get("verdicts", [])}
    references = {(one.plan_id, one.feature_id): one for one in held.get("reference_results", []) if one.decision != 3}
    sizes = {}
    for result in held["feature_results"]:
        if result.plan_id not in plans:
            continue
        key = (result.plan_id, result.feature_id)
        verdict = verdicts.get(key)
        limits = None
        for feature in plans[result.plan_id].features:
            if feature.id == result.feature_id and math.isfinite(feature.lower_tolerance + feature.upper_tolerance):
                limits = (feature.lower_tolerance, feature.upper_tolerance)
        if verdict:
            limits, status = (-verdict.tolerance, verdict.tolerance), VERDICTS[verdict.verdict]
        else:
            status = DECISIONS[result.decision] if limits else "NOT_ANALYZED"
        if contradicted(result, references.get(key), verdict):
            status = "SYSERROR"
        sizes[key] = (result, limits, status)
    return held, plans, sizes


def contradicted(result, reference, verdict):
    """E_n above 1 (ISO 13528:2015, 9.7), or proved out of tolerance by the reference although it was qualified."""
    if reference is None or result.decision == 3:
        return False
    own, other = (one.coverage_factor * one.standard_uncertainty for one in (result, reference))
    accepted = verdict is not None and verdict.verdict == 0
    outside = accepted and abs(reference.size_deviation) > verdict.tolerance + other
    return abs(result.size_deviation - reference.size_deviation) / math.hypot(own, other) > 1 or outside


def schema(path):
    """A published schema. libxml2 knows XSD 1.0: where MTConnect's wildcard has a word of 1.1, the equal one of 1.0 is taken."""
    from lxml import etree

    text = path.read_text(encoding="utf-8").replace("notNamespace='##targetNamespace'", "namespace='##other'")
    return etree.XMLSchema(etree.fromstring(text.encode(), base_url=str(path)))


def same(text, metres, scale=1e3):
    """A number of a document against metres of the recording: one rounding to the other unit."""
    close(float(text), metres * scale, abs(metres * scale) * 4e-16)


@check
def qif_results_are_valid_and_every_figure_is_the_recordings(folder):
    from lxml import etree

    space = {"q": "http://qifstandards.org/xsd/qif3"}
    seen = set()
    for bag in sessions(folder):
        file = folder / "out.qif"
        probecell("export", bag, "--format", "qif", "--out", file)
        tree = etree.parse(str(file))
        if SCHEMAS.is_dir():
            schema(SCHEMAS / "qif3" / "QIFApplications" / "QIFDocument.xsd").assertValid(tree)
        held, plans, sizes = expected(bag)

        def texts(of, path):
            return [node.text for node in of.xpath(path, namespaces=space)]

        by_id = {node.get("id"): node for node in tree.iter() if isinstance(node.tag, str) and node.get("id")}
        assert len(by_id) == int(tree.getroot().get("idMax"))
        found = {}
        for results in tree.xpath("//q:MeasurementResults", namespaces=space):
            component = by_id[texts(results, "q:ActualComponentIds/q:Id")[0]]
            plan = texts(component, "q:SerialNumber")[0]
            for one in results.xpath(".//q:CharacteristicMeasurements/*", namespaces=space):
                item = by_id[texts(one, "q:CharacteristicItemId")[0]]
                nominal = by_id[texts(item, "q:CharacteristicNominalId")[0]]
                definition = by_id[texts(nominal, "q:CharacteristicDefinitionId")[0]]
                found[(plan, texts(item, "q:Name")[0])] = (one, nominal, definition)
            # Touches: as many, at nominal plus deviation along the normal.
            own = [touch for touch in held["touch_deviations"] if touch.plan_id == plan]
            deviations = texts(results, ".//q:MeasuredPointSet/q:Deviations")[0].split()
            assert len(deviations) == len(own)
            for text, touch in zip(deviations, own):
                same(text, touch.deviation)
        assert set(found) == set(sizes), set(found) ^ set(sizes)
        for key, (result, limits, status) in sizes.items():
            one, nominal, definition = found[key]
            assert texts(one, "q:Status/q:CharacteristicStatusEnum") == [status], (key, status)
            seen.add(status)
            value = one.xpath("q:Value", namespaces=space)[0]
            same(value.text, result.size)
            same(value.get("combinedUncertainty"), result.standard_uncertainty)
            assert float(one.xpath("q:Attributes/*/@value", namespaces=space)[0]) == result.coverage_factor
            same(texts(nominal, "q:TargetValue")[0], result.nominal_size)
            if limits:
                same(texts(definition, "q:Tolerance/q:MinValue")[0], limits[0])
                same(texts(definition, "q:Tolerance/q:MaxValue")[0], limits[1])
            diameter = one.tag.endswith("}DiameterCharacteristicMeasurement")
            assert diameter == (result.kind in DIAMETERS and result.feature_id in {f.id for f in plans[key[0]].features})
    assert {"PASS", "INDETERMINATE", "REWORK"} <= seen, seen
    return None if SCHEMAS.is_dir() else "not validated: the published schema is not there"


@check
def a_dfq_file_is_read_back_by_aqdefreader(folder):
    import aqdefreader

    for bag in sessions(folder):
        file = folder / "out.dfq"
        probecell("export", bag, "--format", "dfq", "--out", file)
        with contextlib.redirect_stdout(io.StringIO()):
            read = aqdefreader.read_dfq_file(str(file))
        _, plans, sizes = expected(bag)
        assert read.part_count() == 1
        count = 0
        for characteristic in read.get_part(0).get_characteristics():
            name = str(characteristic.get_data("K2002")).split(" (")[0]
            nominal = float(characteristic.get_data("K2101"))
            for value in characteristic.get_measurements():
                plan = value.batch_no.removeprefix("#")
                result, limits, _ = sizes[(plan, name)]
                same(value.value, result.size)
                same(nominal, result.nominal_size)
                assert value.attribute == 0
                if limits:
                    close(float(characteristic.get_data("K2110")), (result.nominal_size + limits[0]) * 1e3, 1e-11)
                    close(float(characteristic.get_data("K2111")), (result.nominal_size + limits[1]) * 1e3, 1e-11)
                assert value.datetime.timestamp() is not None
                count += 1
        assert count == len(sizes), (count, len(sizes))


@check
def csv_tables_hold_every_figure_and_touches_come_back(folder):
    for number, bag in enumerate(sessions(folder)):
        held, plans, sizes = expected(bag)
        text, _ = probecell("export", bag, "--format", "csv")
        rows = list(csv.DictReader(io.StringIO(text, newline="")))
        assert len(rows) == len(sizes)
        for row in rows:
            result, limits, status = sizes[(row["plan"], row["feature"])]
            same(row["size_mm"], result.size)
            same(row["deviation_um"], result.size_deviation, 1e6)
            same(row["standard_uncertainty_um"], result.standard_uncertainty, 1e6)
            assert float(row["coverage_factor"]) == result.coverage_factor
            assert row["status"] == status
            if limits:
                same(row["lower_um"], limits[0], 1e6)
        text, _ = probecell("export", bag, "--format", "csv-touches")
        table = folder / f"touches{number}.csv"
        rows = list(csv.DictReader(io.StringIO(text, newline="")))
        assert len(rows) == len(held["touch_deviations"])
        for row, touch in zip(rows, held["touch_deviations"]):
            same(row["deviation_um"], touch.deviation, 1e6)
        last = rows[-1]["plan"]
        with open(table, "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, rows[0].keys())
            writer.writeheader()
            writer.writerows(row for row in rows if row["plan"] == last)
        columns = ",".join([*(f"nominal_{a}=nominal_{a}_mm" for a in "xyz"), "i=i,j=j,k=k", "deviation=deviation_um", "feature=feature", "time=time"])
        again = folder / f"again{number}"
        probecell("import", "touches", table, "--columns", columns, "--units", "length=mm,deviation=um,time=rfc3339", "--touch-uncertainty-um", 1, "--out", again)
        own = sorted((t.header.stamp.sec, t.header.stamp.nanosec, t.deviation) for t in held["touch_deviations"] if t.plan_id == last)
        back = [t.deviation for t in messages(again)["touch_deviations"]]
        assert len(own) == len(back)
        for (_, _, one), other in zip(own, back):
            close(one, other, 1e-15)


@check
def mtconnect_documents_are_valid_and_every_figure_is_the_recordings(folder):
    from lxml import etree

    for bag in sessions(folder):
        _, plans, sizes = expected(bag)
        trees = {}
        for kind, format in (("Devices", "mtconnect-devices"), ("Streams", "mtconnect")):
            text, _ = probecell("export", bag, "--format", format)
            trees[kind] = etree.fromstring(text.encode()).getroottree()
            if SCHEMAS.is_dir():
                schema(SCHEMAS / "mtconnect" / f"MTConnect{kind}_2.7.xsd").assertValid(trees[kind])
        items = {one.get("id") for one in trees["Devices"].xpath("//*[local-name()='DataItem']")}
        used = set(trees["Streams"].xpath("//@dataItemId"))
        assert used <= items, used - items
        found = {}
        for entry in trees["Streams"].xpath("//*[local-name()='FeatureMeasurementTable']/*[local-name()='Entry']"):
            cells = {cell.get("key"): cell.text for cell in entry}
            found[(cells["MEASUREMENT_ID"], entry.get("key"))] = cells
        assert len(found) == len(sizes)
        for (plan, feature), (result, limits, status) in sizes.items():
            cells = found[(plan, feature)]
            same(cells["MEASUREMENT_VALUE"], result.size)
            same(cells["UNCERTAINTY"], result.standard_uncertainty)
            assert cells["UNCERTAINTY_TYPE"] == "COMBINED"
            assert cells["CHARACTERISTIC_STATUS"] == status.replace("SYSERROR", "SYSTEM_ERROR")
        held = messages(bag).get("tool_offsets")
        if held:
            wear = {entry.get("key"): float(entry[0].text) for entry in trees["Streams"].xpath("//*[local-name()='ToolOffsetsTable']/*")}
            assert len(wear) == len(held[-1].tool_numbers)
            for tool, value in zip(held[-1].tool_numbers, held[-1].wear):
                same(wear[str(tool)], value)
    return None if SCHEMAS.is_dir() else "not validated: the official schema is not there"


def dmis(text):
    """Statements of a DMIS file by label, comments, and what each OUTPUT names: a reader after ISO 22093, 5.1 (lines, `$`, `$$`)."""
    assert all(len(line) <= 80 and line.isascii() for line in text.split("\r\n")), max(text.split("\r\n"), key=len)
    statements, comments, outputs, joined = {}, [], [], ""
    for line in text.split("\r\n"):
        if line.startswith("$$"):
            comments.append(line[2:].strip())
            continue
        joined += line.removesuffix("$")
        if line.endswith("$") or not joined:
            continue
        label, is_labelled, rest = joined.partition("=")
        if is_labelled and label.endswith(")"):
            major, _, words = rest.partition("/")
            assert label not in statements, label
            statements[label] = (major, words.split(","))
        elif joined.startswith("OUTPUT/"):
            outputs.append(joined.removeprefix("OUTPUT/").split(","))
        joined = ""
    assert text.startswith("DMISMN/") and "\r\nUNITS/MM,ANGDEC\r\n" in text and text.endswith("ENDFIL\r\n")
    return statements, comments, outputs


@check
def dmis_output_holds_every_figure_and_is_read_back(folder):
    seen = set()
    for number, bag in enumerate(sessions(folder)):
        file = folder / f"out{number}.dmo"
        probecell("export", bag, "--format", "dmis", "--out", file)
        text = file.read_bytes().decode("ascii")
        statements, comments, outputs = dmis(text)
        held, plans, sizes = expected(bag)
        order = list(plans)
        behind = lambda plan: f"_{order.index(plan) + 1}" if len(order) > 1 else ""
        for (plan, name), (result, limits, status) in sizes.items():
            features = {one.id: one for one in plans[plan].features}
            suffix = behind(plan)
            seen.add(status)
            assert any(comment.startswith(f"{name}: {status}, U = ") for comment in comments), (name, status)
            if limits:
                tolerance, actual = statements[f"T({name}_T{suffix})"], statements[f"TA({name}_T{suffix})"]
                assert tolerance[0] == actual[0] == "TOL" and tolerance[1][0] == actual[1][0]
                diameter = name in features and result.kind in DIAMETERS
                low, high = tolerance[1][1:3] if diameter else tolerance[1][3:5]
                assert diameter == (tolerance[1][0] == "DIAM")
                same(low, limits[0])
                same(high, limits[1])
                same(actual[1][1], result.size_deviation)
                assert actual[1][2] == ("INTOL" if status == "PASS" else "OUTOL"), (name, status, actual)
            if name in features:
                for letters, at, diameter in (("F", features[name].origin, 2 * features[name].radius), ("FA", result.origin, result.size)):
                    major, words = statements[f"{letters}({name}{suffix})"]
                    place = words.index("CART") + 1
                    for word, value in zip(words[place : place + 3], (at.x, at.y, at.z)):
                        same(word, value)
                    if words[0] in ("CYLNDR", "SPHERE"):
                        close(float(words[-1]), diameter * 1e3, 1e-12)
                assert not limits or [f"FA({name}{suffix})", f"TA({name}_T{suffix})"] in outputs
        # Every touch, by its point: the deviation is what both places differ by along the normal.
        points = {label: words for label, (major, words) in statements.items() if words[0] == "POINT"}
        assert len(points) == 2 * len(held["touch_deviations"])
        for touch in held["touch_deviations"]:
            suffix = behind(touch.plan_id)
            labels = [label for label in (f"P{touch.point_index}{suffix}{again}" for again in ("", *(f".{k}" for k in range(2, 9)))) if f"FA({label})" in points]
            found = []
            for label in labels:
                nominal, actual = (list(map(float, points[f"{letters}({label})"][2:])) for letters in ("F", "FA"))
                found.append(sum((b - a) * n for a, b, n in zip(nominal[:3], actual[:3], actual[3:])))
            assert any(abs(one - touch.deviation * 1e3) < 1e-10 for one in found), (touch.point_index, found, touch.deviation)
        # Read back as a reference of the same session: the same deviations again.
        if len(order) == 1:
            probecell("import", "reference", file, "--format", "dmis", "--to", bag, "--instrument", "cell", "--uncertainty-um", 1,
                      "--out", folder / f"both{number}")
            (reference,) = messages(folder / f"both{number}")["reference"]
            own = sorted((t.point_index, t.deviation) for t in held["touch_deviations"] if t.plan_id == order[0])
            back = sorted(zip(reference.point_index, reference.deviation))
            assert len(own) == len(back)
            for (point, one), (other_point, other) in zip(own, back):
                assert point == other_point
                close(one, other, 1e-13)
    assert {"PASS", "INDETERMINATE", "REWORK"} <= seen, seen
