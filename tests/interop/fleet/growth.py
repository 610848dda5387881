"""What a lake costs as it grows: adding recordings beside copying them, questions beside DuckDB on the same Parquet, and all diagnoses made
anew, on all processors and on one, in one process and by one and two executors of a cluster that have one processor each. No test: figures are of this
computer.

usage: growth.py PROBECELL-FLEET FOLDER [SESSIONS…]

FOLDER holds the recordings of a year (`cargo run --release --example year -- FOLDER`), of which SESSIONS (1000 5000 20000) are taken. Runs as root in a network namespace of its own (`unshare -n`). `taskset` is of util-linux.
"""

import contextlib
import json
import os
import pathlib
import resource
import shutil
import subprocess
import sys
import tempfile
import time

import cluster
from times import ask

COMPARED = 20000  # sessions up to which one processor and executors are tried as well
PLACES = [(f"{there}:{cluster.EXECUTOR}", str(processor)) for processor, there in enumerate(cluster.THERE)]


def timed(work):
    """What it gives, seconds on the clock, seconds of the processor time of its processes."""
    used = lambda: sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
    begun, before = time.perf_counter(), used()
    done = work()
    return done, time.perf_counter() - begun, used() - before


def ran(*command):
    return subprocess.run([str(word) for word in command], check=True, capture_output=True).stdout


def size(folder):
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def taken(bags, sessions, folder):
    """Hard links of recordings evenly over the year and the machines, which their names begin with."""
    machines = {}
    for recording in sorted(bags.iterdir()):
        machines.setdefault(recording.name.rsplit("_", 1)[0], []).append(recording)
    for recordings in machines.values():
        number = sessions // len(machines)
        for recording in recordings[:: len(recordings) // number][:number]:
            shutil.copytree(recording, folder / recording.name, copy_function=os.link)


def copied(folder, to):
    shutil.copytree(folder, to)
    os.sync()


def peak(command):
    """Largest resident memory of a process, MiB."""
    process = subprocess.Popen([str(word) for word in command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    assert status == 0, command
    return usage.ru_maxrss / 1024


def grown(program, bags, sessions, work, members):
    folder, lake = work / "bags", work / "lake"
    taken(bags, sessions, folder)
    files = len(list(folder.rglob("*.mcap")))
    print(f"\n{files} sessions, {size(folder) / 1e6:.0f} MB", flush=True)
    ran("sh", "-c", 'find "$0" -name "*.mcap" -exec cat {} + >/dev/null', folder)  # so that each reads from memory
    _, seconds, _ = timed(lambda: copied(folder, work / "copy"))
    shutil.rmtree(work / "copy")
    print(f"copying: {seconds:.1f} s, {files / seconds:.0f} recordings/s", flush=True)
    told, seconds, processor = timed(lambda: ran(program, "lake", "add", folder, "--lake", lake))
    print(f"adding: {seconds:.1f} s, {files / seconds:.0f} recordings/s, {processor:.1f} s of processor time; lake {size(lake) / 1e6:.1f} MB", flush=True)
    _, seconds, _ = timed(lambda: ran(program, "lake", "add", folder, "--lake", lake))
    print(f"adding again: {seconds:.1f} s", flush=True)
    _, seconds, _ = timed(lambda: ran(program, "lake", "compact", "--lake", lake))
    print(f"compaction: {seconds:.1f} s", flush=True)
    ask(program, lake)
    _, seconds, processor = timed(lambda: ran(program, "trends", "--lake", lake))
    print(f"trends: {seconds:.1f} s, {processor:.1f} s of processor time, {peak([program, 'trends', '--lake', lake]):.0f} MiB", flush=True)
    question = [program, "diagnose", "--lake", lake, "--json", "--sql", cluster.ROWS]
    both, two, processor = timed(lambda: ran(*question))
    assert len(json.loads(both)) == files
    print(f"all diagnoses in one process: {two:.1f} s, {processor:.1f} s of processor time; {peak(question):.0f} MiB", flush=True)
    if files > COMPARED:
        return
    alone, one, _ = timed(lambda: ran("taskset", "-c", "0", *question))
    assert alone == both
    print(f"the same on one processor: {one:.1f} s, ratio {one / two:.2f}", flush=True)
    seconds = []
    for number in (1, 2):
        told, clock, _ = timed(lambda: members(number, question))
        assert told == alone
        seconds.append(clock)
    print(f"all diagnoses by executors of one processor: {seconds[0]:.1f} s by one, {seconds[1]:.1f} s by two, ratio {seconds[0] / seconds[1]:.2f}", flush=True)


def main(program, folder, *numbers):
    bags = pathlib.Path(folder, "bags")
    with contextlib.ExitStack() as ending:
        work = pathlib.Path(ending.enter_context(tempfile.TemporaryDirectory(dir=folder)))
        hosts = [cluster.Host(ending), cluster.Host(ending)]
        cluster.cables(hosts)
        authority = cluster.Authority(work / "certificates")
        own = authority.options("client", [])
        place = f"{cluster.HERE[0]}:{cluster.SCHEDULER}"

        def members(number, question):
            """The answer of a cluster of so many executors, each on a processor of its own."""
            with contextlib.ExitStack() as ended:
                options = authority.options("scheduler", [*cluster.HERE, "127.0.0.1"])
                scheduler = cluster.Process(ended, program, "scheduler", "--listen", f"0.0.0.0:{cluster.SCHEDULER}", *options)
                scheduler.until("^scheduler on ")
                for index, (listen, processor) in enumerate(PLACES[:number]):
                    options = authority.options(f"executor{index}", [cluster.THERE[index]])
                    at = ["--scheduler", f"{cluster.HERE[index]}:{cluster.SCHEDULER}", "--listen", listen]
                    cluster.Process(ended, *hosts[index].inside, "taskset", "-c", processor, program, "executor", *at, *options)
                    scheduler.until(r"^executor (\S+) has joined")
                return ran(*question, "--cluster", place, *own)

        for sessions in map(int, numbers or ("1000", "5000", "20000")):
            grown(program, bags, sessions, pathlib.Path(ending.enter_context(tempfile.TemporaryDirectory(dir=folder))), members)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    main(*sys.argv[1:])
