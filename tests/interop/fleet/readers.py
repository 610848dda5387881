"""Counts and sums of every table by three readers that are not ours, and counts of messages by the readable twins.

usage: readers.py LAKE SAMPLES
"""

import json
import math
import pathlib
import sys

import duckdb
import polars
import pyarrow.compute as pc
import pyarrow.dataset as ds
import pyarrow.parquet as pq

TABLES = ["sessions", "touches", "features", "verdicts", "corrections", "effects", "signals", "events"]


def by_pyarrow(folder):
    table = ds.dataset(folder, format="parquet", partitioning="hive").to_table()
    sums = {
        field.name: pc.sum(table[field.name]).as_py() or 0.0
        for field in table.schema
        if str(field.type) == "double"
    }
    return table.num_rows, sums, set(table["month"].to_pylist()), table.schema


def by_duckdb(folder, columns):
    source = f"read_parquet('{folder}/*/*.parquet', hive_partitioning = true)"
    sums = ", ".join(f'coalesce(sum("{name}"), 0)' for name in columns) or "0"
    row = duckdb.sql(f"SELECT count(*), {sums} FROM {source}").fetchall()[0]
    months = duckdb.sql(f"SELECT DISTINCT CAST(month AS VARCHAR) FROM {source}").fetchall()
    return row[0], dict(zip(columns, row[1:])), {month for (month,) in months}


def by_polars(folder, columns):
    frame = polars.scan_parquet(f"{folder}/*/*.parquet", hive_partitioning=True)
    row = frame.select(polars.len(), *[polars.col(name).sum() for name in columns]).collect().row(0)
    return row[0], dict(zip(columns, row[1:]))


def near(a, b):
    return math.isclose(a, b, rel_tol=1e-12, abs_tol=1e-15)


def main(lake, samples):
    lake = pathlib.Path(lake)
    counts = {}
    for name in TABLES:
        folder = lake / name
        rows, sums, months, schema = by_pyarrow(folder)
        other_rows, other_sums, other_months = by_duckdb(folder, list(sums))
        third_rows, third_sums = by_polars(folder, list(sums))
        assert rows == other_rows == third_rows > 0, (name, rows, other_rows, third_rows)
        for column, value in sums.items():
            assert near(value, other_sums[column]) and near(value, third_sums[column]), (name, column)
        assert {str(month)[:7] for month in months} == {month[:7] for month in other_months}, (months, other_months)
        counts[name] = rows
        files = sorted(folder.glob("*/*.parquet"))
        schema = pq.read_schema(files[0])
        for field in schema:
            assert field.metadata[b"description"], (name, field.name)
        if name == "touches":
            assert schema.field("deviation").metadata[b"unit"] == b"m"
    told = [json.loads(path.open().readline())["messages"] for path in pathlib.Path(samples).glob("*.jsonl")]
    assert counts["sessions"] == len(told)
    assert counts["touches"] == sum(one.get("probe_events", 0) for one in told)
    verdicts = duckdb.sql(f"SELECT bag, verdict FROM read_parquet('{lake}/sessions/*/*.parquet')").fetchall()
    assert all(verdict in ("no_gap", "explained", "partly_explained", "unexplained") for _, verdict in verdicts), verdicts
    print(counts)


main(*sys.argv[1:])
