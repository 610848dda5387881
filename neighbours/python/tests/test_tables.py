"""Tables: what was recorded, read by programs that share no code with this one; tables of touches in every shape."""

import json
import subprocess
import sys

import pandas
import probecell
import pytest
import touches
from conftest import SAMPLES, command

SAMPLE = SAMPLES / "punch.mcap"


def plain(value):
    """A decoded message as dictionaries and lists, instants as ns."""
    if hasattr(value, "__slots__"):
        names = [name for name in value.__slots__ if not name.startswith("_")]
        if names == ["sec", "nanosec"]:
            return value.sec * 10**9 + value.nanosec
        return {name: plain(getattr(value, name)) for name in names}
    if isinstance(value, (list, tuple)):
        return [plain(one) for one in value]
    if isinstance(value, bytes):
        return list(value)
    return value


def flat(record, before=""):
    for name, value in record.items():
        if isinstance(value, dict):
            yield from flat(value, f"{before}{name}.")
        else:
            yield before + name, value


def test_every_topic_is_read_as_mcap_ros2_reads_it():
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    held = {}
    with open(SAMPLE, "rb") as stream:
        for _, channel, message, decoded in make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            held.setdefault(channel.topic, []).append((message.log_time, message.publish_time, plain(decoded)))
    bag = probecell.Bag(SAMPLE)
    told = dict(zip(bag.topics["topic"], bag.topics["messages"]))
    assert {topic for topic, count in told.items() if count} == set(held)
    compared = 0
    for topic, messages in held.items():
        columns = bag[topic].to_dict()
        assert columns.pop("log_time") == [one[0] for one in messages], topic
        assert columns.pop("publish_time") == [one[1] for one in messages], topic
        for name, values in columns.items():
            expected = [dict(flat(one[2]))[name] for one in messages]
            # As texts, so that NaN equals NaN and 0.0 differs from -0.0.
            assert repr(values) == repr(expected), (topic, name)
            compared += len(values)
        assert set(columns) == {name for name, _ in flat(messages[0][2])}, topic
    assert compared > 10_000


def test_a_recording_of_foreign_types_is_read(tmp_path):
    from mcap_ros2.writer import Writer

    definition = "uint8 GOOD=0 # a constant\nuint8 BAD = 1\nInner[<=5] list\nInner one\nfloat32[3] three\nuint8[] bytes\n"
    definition += "bool flag\nstring<=9 text \"x\"\n" + "=" * 80
    definition += "\nMSG: foreign_msgs/Inner\nint16 a\nuint64 b\nbuiltin_interfaces/Duration d\nchar[2] c\n"
    inner = lambda a: {"a": a, "b": 2**63 + a, "d": {"sec": abs(a), "nanosec": 5}, "c": [1, 2]}
    with open(tmp_path / "foreign.mcap", "wb") as stream:
        writer = Writer(stream)
        schema = writer.register_msgdef("foreign_msgs/msg/Outer", definition)
        for count in range(3):
            message = {"list": [inner(-n) for n in range(count)], "one": inner(7), "three": [0.5, 1.5, count],
                       "bytes": list(range(count)), "flag": count == 1, "text": "ä" * count}
            writer.write_message("/x/outer", schema, message, log_time=count, publish_time=count)
        writer.finish()
    table = probecell.Bag(tmp_path / "foreign.mcap")["outer"]
    assert table["three"] == [[0.5, 1.5, 0.0], [0.5, 1.5, 1.0], [0.5, 1.5, 2.0]]
    assert table["bytes"] == [[], [0], [0, 1]] and table["flag"] == [False, True, False] and table["text"] == ["", "ä", "ää"]
    assert table["one.d"] == [7 * 10**9 + 5] * 3 and table["one.b"] == [2**63 + 7] * 3
    assert [[one["a"] for one in row] for row in table["list"]] == [[], [0], [0, -1]]
    assert table.to_polars()["list"].to_list()[2][1]["c"] == [1, 2]


@pytest.mark.parametrize(
    "definition, says",
    [
        ("Whole again\n", "the type foreign_msgs/Whole contains itself"),
        ("Other one\n", "the type foreign_msgs/Other is not defined"),
        ("wstring text\n", "foreign_msgs/Whole has a wstring, which is not read"),
        ("uint8[0] none\n", "'uint8[0]' in foreign_msgs/Whole is no array"),
        ("float64 x\nfloat64 y\n", "message 0 of /x/whole is no foreign_msgs/msg/Whole: y: "),
    ],
)
def test_a_definition_that_cannot_be_read_is_named(definition, says, tmp_path):
    from mcap.writer import Writer

    with open(tmp_path / "foreign.mcap", "wb") as stream:
        writer = Writer(stream)
        writer.start("ros2", "a test")
        schema = writer.register_schema("foreign_msgs/msg/Whole", "ros2msg", definition.encode())
        channel = writer.register_channel("/x/whole", "cdr", schema)
        writer.add_message(channel, 1, bytes([0, 1, 0, 0, *[0] * 8]), 1)
        writer.finish()
    with pytest.raises(probecell.InputError) as raised:
        probecell.Bag(tmp_path / "foreign.mcap")["whole"]
    assert says.replace("'", '"') in str(raised.value), str(raised.value)


def test_arrow_reaches_polars_pyarrow_and_pandas_alike():
    polars, pyarrow = pytest.importorskip("polars"), pytest.importorskip("pyarrow")
    table = probecell.Bag(SAMPLE)["probe_events"]
    ours = table.to_dict()
    theirs, frame, arrow = table.to_polars(), table.to_pandas(), pyarrow.table(table)
    assert theirs.columns == list(frame.columns) == arrow.column_names == table.column_names
    assert theirs["axis_positions"].to_list() == arrow["axis_positions"].to_pylist() == ours["axis_positions"]
    assert frame["axis_positions"].tolist() == ours["axis_positions"]
    assert str(frame["header.stamp"].dtype) == "datetime64[ns, UTC]"
    assert [one.value for one in frame["header.stamp"]] == ours["header.stamp"] == theirs["header.stamp"].dt.epoch("ns").to_list()
    assert isinstance(theirs, polars.DataFrame) and len(frame) == len(table) == arrow.num_rows


def test_nothing_but_the_interpreter_is_needed():
    """The package itself imports no other; pandas works without pyarrow."""
    code = f"""
import sys
for name in ("numpy", "pandas", "polars", "pyarrow"):
    sys.modules[name] = None
import probecell
found = probecell.diagnose({str(SAMPLE)!r})
assert found.effects.to_dict() and probecell.Bag({str(SAMPLE)!r})["probe_events"].to_dict()
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=300)
    code = f"""
import sys
sys.modules["pyarrow"] = None
import pandas, probecell
session = probecell.read_session({str(SAMPLE)!r})
frame = session.touches().to_pandas()
frame = frame[["nominal_x", "nominal_y", "nominal_z", "i", "j", "k", "deviation", "feature", "time"]]
again = probecell.import_touches(frame, units="length=m,time=rfc3339", name="again")
assert again.touches()["deviation"], len(again)
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=300)


# pandas before 3 reads some numbers one unit in the last place off unless it is told not to, which pandas 3 deprecates.
EXACT = {} if int(pandas.__version__.split(".")[0]) >= 3 else {"float_precision": "round_trip"}
ROLES = touches.COLUMNS
UNITS = touches.UNITS


@pytest.fixture(scope="module")
def expected(my_csv, tmp_path_factory):
    """What the three commands of the README find."""
    path, _ = my_csv
    bag = tmp_path_factory.mktemp("command") / "my"
    command("import", "touches", path, "--columns", ROLES, "--units", UNITS, "--out", bag)
    command("report", bag)
    return command("diagnose", bag, "--json"), command("diagnose", bag)


def frames(path):
    import polars
    import pyarrow.csv

    yield "pandas", pandas.read_csv(path, **EXACT)
    yield "polars", polars.read_csv(path)
    yield "pyarrow", pyarrow.csv.read_csv(path)
    yield "columns", {name: column.tolist() for name, column in pandas.read_csv(path, **EXACT).items()}
    yield "categories", pandas.read_csv(path, dtype={"Merkmal": "category"}, **EXACT)
    yield "path", str(path)
    yield "pathlib", path


def test_500_touches_of_every_frame_are_diagnosed_as_by_the_command(my_csv, expected):
    path, _ = my_csv
    roles = dict(one.split("=") for one in ROLES.split(","))
    units = dict(one.split("=") for one in UNITS.split(","))
    for kind, frame in frames(path):
        found = probecell.diagnose(frame, columns=roles, units=units, name="my")
        assert found.json() + "\n" == expected[0], kind
        assert str(found) + "\n" == expected[1], kind
        assert found.verdict == "explained" and found.samples == 500
    (row,) = [i for i, name in enumerate(found.effects["parameter"]) if abs(found.effects["value"][i]) > 1e-6]
    low, high = sorted(abs(found.effects[side][row]) for side in ("low", "high"))
    assert low <= 8e-6 <= high
    assert "fixture.shift" in found.effects["group"][row].split()


def test_the_notebook_gives_the_same_answer(my_csv, expected, tmp_path):
    import shutil

    import nbformat
    from conftest import ROOT
    from nbclient import NotebookClient

    path, _ = my_csv
    shutil.copy(path, tmp_path / "my.csv")
    notebook = nbformat.read(ROOT / "neighbours" / "python" / "examples" / "my_csv.ipynb", as_version=4)
    lines = [line for cell in notebook.cells if cell.cell_type == "code" for line in cell.source.splitlines() if line.strip()]
    assert len(lines) == 5, lines
    for cell in notebook.cells:
        cell.source = cell.source.replace('"my.csv")', f'"my.csv", **{EXACT})')
    notebook.cells.append(nbformat.v4.new_code_cell("open('answer.json', 'w').write(found.json() + '\\n')"))
    NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}).execute()
    assert (tmp_path / "answer.json").read_text() == expected[0]
    shown = [output for cell in notebook.cells for output in cell.get("outputs", []) if "data" in output]
    (page,) = [output["data"]["text/html"] for output in shown if "text/html" in output["data"]]
    assert page.startswith("<iframe") and "fixture.shift" in page


def test_residuals_are_the_deviations_of_the_table(my_csv):

    path, rows = my_csv
    session = probecell.import_touches(pandas.read_csv(path), columns=ROLES, units=UNITS)
    table = session.touches()
    for ours, row in zip(table["deviation"], rows, strict=True):
        assert abs(ours - row[8] * 1e-6) < 1e-15
    residuals = session.diagnose().residuals
    assert len(residuals) == 500 and set(residuals["feature"]) == {"left", "right", "front", "back", "top", "bore"}
    assert all(abs(a - b) < 1e-12 for a, b in zip(residuals["before"], table["deviation"], strict=True))
    after = [one for one in residuals["after"] if one is not None]
    rms = (sum(one**2 for one in after) / len(after)) ** 0.5
    assert abs(rms - touches.NOISE_UM * 1e-6) < 0.05e-6


def test_features_of_a_table_are_evaluated_as_by_the_command(my_csv, tmp_path):
    import io


    path, _ = my_csv
    (tmp_path / "features.csv").write_text(touches.FEATURES)
    session = probecell.import_touches(
        pandas.read_csv(path, **EXACT),
        columns=ROLES, units=UNITS, features=pandas.read_csv(io.StringIO(touches.FEATURES)),
    )
    with pytest.raises(probecell.InputError, match="uncertainty of a touch is not known"):
        session.features()
    sizes = session.features(touch_uncertainty=0.5e-6).to_dict()
    arguments = ["--columns", ROLES, "--units", UNITS, "--features", tmp_path / "features.csv", "--touch-uncertainty-um", 0.5]
    command("import", "touches", path, *arguments, "--out", tmp_path / "bag")
    told = {one["feature"]: one for one in json.loads(command("report", tmp_path / "bag", "--json"))["sizes"]}
    assert set(sizes["feature"]) == set(told)
    for row, name in enumerate(sizes["feature"]):
        for key in ("size", "nominal", "deviation", "expanded_uncertainty", "coverage_factor", "conformity"):
            assert sizes[key][row] == told[name][key], (name, key)
        assert [sizes["lower"][row], sizes["upper"][row]] == told[name]["limits"]


def test_axis_positions_with_the_machine_of_a_recording_give_its_deviations():
    bag = probecell.Bag(SAMPLES / "ball_check.mcap")
    events = bag["probe_events"].to_dict()
    names = events["axis_names"][0]
    table = {"point": events["point_index"], "feed": events["feed"]}
    for index, name in enumerate(names):
        table[f"axis.{name}"] = [positions[index] for positions in events["axis_positions"]]
    session = probecell.import_touches(table, plan=SAMPLES / "ball_check.mcap", units="length=m,angle=rad,feed=m/s")
    recorded = bag["touch_deviations"]["deviation"]
    assert session.touches()["deviation"] == recorded == bag.session().touches()["deviation"]


def test_wrong_tables_are_refused_by_row_and_column(my_csv, tmp_path):

    path, _ = my_csv
    good = pandas.read_csv(path)

    def refused(says, table, **more):
        arguments = {"columns": ROLES, "units": UNITS} | more
        with pytest.raises(probecell.InputError) as raised:
            probecell.import_touches(table, **arguments)
        assert says in str(raised.value), str(raised.value)

    spoiled = good.astype({"Abw": object})
    spoiled.loc[6, "Abw"] = "x"
    refused('row 6, column "Abw": expected a finite number, found "x"', spoiled)
    missing = good.copy()
    missing.loc[6, "Abw"] = float("nan")
    refused('row 6, column "Abw": expected a finite number, found nothing', missing)
    short = good.copy()
    short.loc[3, "NX"] = 0.5
    refused('row 3, column "NX": expected i, j, k of unit length', short)
    refused("the unit of length is not known", good, units="deviation=um,time=s")
    refused('there is no column "Abweichung"', good, columns=ROLES.replace("Abw", "Abweichung"))
    refused("no column has a role", good, columns=None)
    refused("there is no role", good, columns={"w": "Abw"})
    refused("of different lengths", {"a": [1, 2], "b": [1]})
    refused("is no table", 5)
    refused("mean nothing without their machine", good, columns=ROLES.replace("deviation=", "axis.X="))
    refused("give one of cell, plan and urdf", good, cell="a.toml", plan="b")
    # Of a file: the sentence of the command, with line and column.
    lines = path.read_text().splitlines()
    cells = lines[7].split(",")
    text = "\n".join([*lines[:7], ",".join([*cells[:8], "NaN", *cells[9:]]), *lines[8:]])
    (tmp_path / "bad.csv").write_text(text)
    arguments = ["import", "touches", tmp_path / "bad.csv", "--columns", ROLES, "--units", UNITS, "--out", tmp_path / "bag"]
    with pytest.raises(probecell.InputError) as raised:
        probecell.import_touches(tmp_path / "bad.csv", columns=ROLES, units=UNITS)
    assert str(raised.value) == command(*arguments, status=2)
    # Row by row only when asked to.
    session = probecell.import_touches(spoiled, columns=ROLES, units=UNITS, skip_bad_rows=True)
    assert len(session) == 499
    assert [note for note in session.notes if note.startswith("refused: row 6")]


def test_sessions_are_diagnosed_in_threads(my_csv):
    from concurrent.futures import ThreadPoolExecutor

    path, _ = my_csv
    session = probecell.import_touches(path, columns=ROLES, units=UNITS, name="my")
    with ThreadPoolExecutor(4) as pool:
        answers = {one.json() for one in pool.map(lambda _: session.diagnose(), range(8))}
    assert len(answers) == 1
