"""Answers of `probecell-fleet sql` and `worker` against DuckDB, Polars and PyArrow on the same Parquet.

usage: ask.py PROBECELL-FLEET LAKE [PROBECELL]
"""

import csv
import datetime
import decimal
import io
import json
import math
import pathlib
import subprocess
import sys

import duckdb
import polars
import pyarrow as pa
import pyarrow.ipc as ipc

TABLES = ["sessions", "touches", "features", "verdicts", "corrections", "effects", "promises", "signals", "faults", "events"]
VIEWS = ["capability", "causes", "promised_and_achieved", "corrections_that_did_not_help"]


def ran(*arguments, data=None):
    return subprocess.run(arguments, input=data, stdout=subprocess.PIPE, check=True).stdout


def plain(value):
    """A value as both sides have it: instants in UTC."""
    if isinstance(value, str) and value.endswith("Z") and value[4:5] == "-":
        return datetime.datetime.fromisoformat(value)
    if isinstance(value, datetime.datetime):
        return value.astimezone(datetime.timezone.utc)
    number = isinstance(value, (int, float, decimal.Decimal)) and not isinstance(value, bool)
    return float(value) if number else value


def near(a, b):
    if isinstance(a, float) and isinstance(b, float):
        return math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-15)
    return a == b


def sorted_rows(rows):
    rows = [{name: plain(value) for name, value in row.items()} for row in rows]
    text = lambda row: [f"{value:.6e}" if isinstance(value, float) else str(value) for value in row.values()]
    return sorted(rows, key=text)


def main(program, lake, probecell=None):
    ask = lambda statement: json.loads(ran(program, "sql", statement, "--lake", lake, "--json"))
    database = duckdb.connect()
    database.execute("SET TimeZone = 'UTC'")
    for name in TABLES:
        files = list(pathlib.Path(lake, name).glob("*/*.parquet"))
        if files:
            source = f"read_parquet('{lake}/{name}/*/*.parquet', hive_partitioning = true, hive_types = {{'month': VARCHAR}})"
            database.execute(f"CREATE VIEW {name} AS SELECT * FROM {source}")
            [(count,)] = database.execute(f"SELECT count(*) FROM {name}").fetchall()
            assert ask(f"SELECT count(*) AS n FROM {name}") == [{"n": count}], name
        else:
            assert ask(f"SELECT count(*) AS n FROM {name}") == [{"n": 0}], name
            columns = [(row["column_name"], row["data_type"]) for row in ask(f"DESCRIBE {name}")]
            kinds = {"Float64": "DOUBLE", "Boolean": "BOOLEAN", "Int64": "BIGINT", "Utf8": "VARCHAR"}
            kind = lambda text: kinds.get(text, "TIMESTAMPTZ" if text.startswith("Timestamp") else "VARCHAR[]")
            database.execute(f"CREATE TABLE {name} (" + ", ".join(f'"{n}" {kind(k)}' for n, k in columns) + ")")

    # The views, by the text that the program prints, in DuckDB.
    database.execute(ran(program, "views").decode())
    rows = {}
    for view in VIEWS:
        ours = sorted_rows(ask(f"SELECT * FROM {view}"))
        theirs = sorted_rows(database.sql(f"SELECT * FROM {view}").to_arrow_table().to_pylist())
        assert len(ours) == len(theirs), (view, len(ours), len(theirs))
        for a, b in zip(ours, theirs):
            assert a.keys() == b.keys() and all(near(a[name], b[name]) for name in a), (view, a, b)
        rows[view] = len(ours)
    assert rows["capability"] and rows["causes"], rows

    # The mean of each feature, by Polars; all of it as CSV.
    frame = polars.scan_parquet(f"{lake}/features/*/*.parquet")
    theirs = frame.group_by("machine", "feature_id").agg(polars.len(), polars.col("size_deviation").mean()).collect()
    statement = "SELECT machine, feature_id, count(*) AS n, avg(size_deviation) AS m FROM features GROUP BY machine, feature_id"
    ours = list(csv.DictReader(io.StringIO(ran(program, "sql", statement, "--lake", lake, "--csv").decode())))
    told = {(row["machine"], row["feature_id"]): (int(row["n"]), float(row["m"]) if row["m"] else None) for row in ours}
    assert len(told) == theirs.height
    for machine, feature, count, mean in theirs.iter_rows():
        n, m = told[machine, feature]
        assert n == count and (m is mean is None or near(m, mean)), (machine, feature)

    # The worker, fed by PyArrow in batches of one and two rows; answers are those of the function, each session once.
    names = database.sql("SELECT bag, uri FROM sessions ORDER BY bag").to_arrow_table()
    stream = io.BytesIO()
    with ipc.new_stream(stream, names.schema) as writer:
        for batch in names.to_batches(max_chunksize=2):
            writer.write_batch(batch)
    answers = ipc.open_stream(ran(program, "worker", data=stream.getvalue())).read_all()
    assert answers.column("bag").to_pylist() == names.column("bag").to_pylist()
    by_sql = {row["bag"]: row["d"] for row in ask("SELECT bag, diagnose(uri) AS d FROM sessions")}
    for bag, diagnosis in zip(answers.column("bag").to_pylist(), answers.column("diagnosis").to_pylist()):
        assert diagnosis == by_sql[bag], bag
    assert len(by_sql) == names.num_rows

    # New diagnoses of all sessions are those of the function.
    anew = lambda statement: json.loads(ran(program, "diagnose", "--lake", lake, "--sql", statement, "--json"))
    assert {row["bag"]: row["d"] for row in anew("SELECT bag, diagnosis AS d FROM diagnoses")} == by_sql
    differ = anew("SELECT d.bag FROM diagnoses d JOIN sessions s ON d.bag = s.bag WHERE (d.verdict IS DISTINCT FROM s.verdict) OR d.uri <> s.uri")
    assert differ == [], differ

    # The joint fit is that of the command, where that is built.
    joint = ask("SELECT array_agg(uri ORDER BY uri) AS uris, joint_fit(uri) AS j FROM sessions GROUP BY machine HAVING count(*) > 1")
    assert joint
    if probecell:
        for row in joint:
            told = subprocess.run([probecell, "diagnose", "--json", *row["uris"]], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
            if row["j"]["refusal"]:
                assert told.returncode == 2, row
                continue
            report = json.loads(told.stdout)
            assert row["j"]["rms"] == report["gap"]["rms"] and row["j"]["verdict"] == report["verdict"]
            assert [one["effect"] for one in row["j"]["effects"]] == [one["effect"] for one in report["effects"]]

    # What is wrong is one sentence and status 2.
    for statement, words in [
        ("SELECT * FROM nothing", "table 'nothing' not found; there are sessions, "),
        ("SELECT verdikt FROM sessions", "verdikt"),
        ("SELEC 1", "found: SELEC"),
        ("DROP VIEW causes", "not supported"),
        ("SELECT 1; SELECT 2", "single SQL statement"),
    ]:
        told = subprocess.run([program, "sql", statement, "--lake", lake], capture_output=True, text=True)
        assert told.returncode == 2 and told.stdout == "", (statement, told)
        assert words in told.stderr and told.stderr.count("\n") == 1, told.stderr
    for options, words in [(["--where", "verdikt = 1"], "verdikt"), (["--recordings", "hall"], "no URL")]:
        told = subprocess.run([program, "diagnose", *options, "--lake", lake], capture_output=True, text=True)
        assert told.returncode == 2 and words in told.stderr and told.stderr.count("\n") == 1, told
    told = subprocess.run([program, "worker"], input=b"no stream", capture_output=True)
    assert told.returncode == 2 and b"no stream of Arrow IPC" in told.stderr, told
    table = pa.table({"name": ["a.mcap"]})
    stream = io.BytesIO()
    with ipc.new_stream(stream, table.schema) as writer:
        writer.write_table(table)
    told = subprocess.run([program, "worker"], input=stream.getvalue(), capture_output=True)
    assert told.returncode == 2 and b"no column uri; it has name" in told.stderr, told
    print(rows)


main(*sys.argv[1:])
