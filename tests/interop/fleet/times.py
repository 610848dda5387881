"""Times of questions, by `probecell-fleet sql` and by DuckDB on the same Parquet; the fastest of five runs, start of the process and of
the connection included. No test: figures are of this computer.

usage: times.py PROBECELL-FLEET LAKE
"""

import pathlib
import subprocess
import sys
import time

import duckdb

QUESTIONS = {
    "sessions by machine and month": 'SELECT machine, "month", count(*) FROM sessions GROUP BY machine, "month"',
    "touches": "SELECT machine, count(*), avg(tip_x) FROM touches GROUP BY machine",
    "effects": "SELECT machine_type, effect, parameter, count(*), avg(value), stddev_samp(value) FROM effects GROUP BY machine_type, effect, parameter",
    "causes": "SELECT * FROM causes",
}
TREND = "SELECT machine, effect, parameter, trend(\"time\", value, standard_uncertainty) FROM effects WHERE effect LIKE 'axis%' GROUP BY machine, effect, parameter"


def fastest(work):
    times = []
    for _ in range(5):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def ask(program, lake):
    """Prints the times of all questions."""
    views = subprocess.run([program, "views"], capture_output=True, check=True, text=True).stdout

    def by_duckdb(question):
        database = duckdb.connect()
        for name in ("sessions", "touches", "features", "effects", "promises", "corrections"):
            if list(pathlib.Path(lake, name).glob("*/*.parquet")):
                database.execute(f"CREATE VIEW {name} AS SELECT * FROM read_parquet('{lake}/{name}/*/*.parquet', hive_partitioning = true)")
        if question.endswith("FROM causes"):
            [view] = [text for text in views.split(";") if "VIEW causes" in text]
            database.execute(view)
        return database.sql(question).to_arrow_table()

    def by_us(question):
        return subprocess.run([program, "sql", question, "--lake", lake, "--csv"], stdout=subprocess.DEVNULL, check=True)

    for name, question in QUESTIONS.items():
        ours = fastest(lambda: by_us(question))
        theirs = fastest(lambda: by_duckdb(question))
        print(f"{name}: {ours:.2f} s, DuckDB {theirs:.2f} s")
    print(f"trend of every axis effect: {fastest(lambda: by_us(TREND)):.2f} s")


if __name__ == "__main__":
    ask(*sys.argv[1:])
