#!/usr/bin/env python3
"""Compares the search with fast-tsp, OR-tools and elkai (LKH) on the same tours, in the same run.

    python3 crates/planning/benches/compare.py [--seconds 1] [--seeds 3] [--instances eil51 pr1002 … plate200 clusters2000 …]

The solvers are installed into target/compare-venv. `--instances plate50 plate200 plate1000 plate5000` prints the rows by
number of points alone. Each runs in its own process, one thread; the time is CPU time of
that process. Instances are of TSPLIB, where the gap is to the published optimum, or random plates of so many points or clusters,
where it is to the shortest tour any solver found; "-" where a solver found none. What the peers spend on a search of
0.01 s is not counted, which is to their advantage: of ours, everything but reading the costs counts. Ours is the median over the seeds.
elkai has no time limit: its own time stands beside it. LKH is for academic use: a yardstick, nothing else.
"""

import argparse
import math
import multiprocessing
import os
import pathlib
import random
import re
import subprocess
import sys
import tempfile
import time
import venv

ROOT = pathlib.Path(__file__).resolve().parents[3]
TARGET = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")).resolve()
LIBRARY = ROOT.parent / "shared/data/tsplib"
PLATES = "plate50 plate200 plate1000 plate5000"
DEFAULT = f"{PLATES} d198 a280 lin318 pcb442 d657 pr1002 u1060 pcb1173 d1291 fl1577 pr2392 fnl4461 rl5915".split()
LARGEST_FOR_ELKAI = 1200
HARDLY = 0.01


def plate(points):
    """A TSPLIB file of points spread evenly at random over a square, the same ones every time."""
    draw = random.Random(points)
    rows = [f"{i + 1} {draw.randrange(30000)} {draw.randrange(30000)}" for i in range(points)]
    return "NODE_COORD_SECTION\n" + "\n".join(rows) + "\nEOF\n"


def clusters(points):
    """The same for clusters of 80 points on average, normally spread by a sixtieth of the side about random centres."""
    draw = random.Random(points)
    centres = [(draw.randrange(30000), draw.randrange(30000)) for _ in range(max(4, points // 80))]
    rows = []
    while len(rows) < points:
        x, y = (int(draw.gauss(middle, 500)) for middle in draw.choice(centres))
        if 0 <= x < 30000 and 0 <= y < 30000:
            rows.append(f"{len(rows) + 1} {x} {y}")
    return "NODE_COORD_SECTION\n" + "\n".join(rows) + "\nEOF\n"


def source(name):
    number = re.fullmatch(r"(plate|clusters)(\d+)", name)
    if number:
        return {"plate": plate, "clusters": clusters}[number.group(1)](int(number.group(2)))
    return (LIBRARY / "tsp" / f"{name}.tsp").read_text()


def distances(name):
    text = source(name)
    section = text.split("NODE_COORD_SECTION")[1].split("EOF")[0]
    points = [tuple(map(float, line.split()[1:])) for line in section.strip().splitlines()]
    up = "CEIL_2D" in text
    whole = math.ceil if up else lambda d: int(d + 0.5)
    return [[whole(math.dist(a, b)) for b in points] for a in points]


def optimum(name):
    """The published optimum; none of random points."""
    if name.startswith(("plate", "clusters")):
        return None
    match = re.search(rf"^{name} : (\d+)", (LIBRARY / "solutions_stsp.txt").read_text(), re.MULTILINE)
    return int(match.group(1))


def length(matrix, tour):
    assert sorted(tour) == list(range(len(matrix)))
    return sum(matrix[a][b] for a, b in zip(tour, tour[1:] + tour[:1]))


def fast_tsp(matrix, seconds):
    import fast_tsp as solver
    import numpy

    # It reads arrays without turning lists of Python over.
    return solver.find_tour(numpy.array(matrix, dtype=numpy.uint16), seconds, max_threads=1)


def ortools(matrix, seconds):
    from ortools.constraint_solver import pywrapcp, routing_enums_pb2

    manager = pywrapcp.RoutingIndexManager(len(matrix), 1, 0)
    routing = pywrapcp.RoutingModel(manager)
    routing.SetArcCostEvaluatorOfAllVehicles(routing.RegisterTransitMatrix(matrix))
    parameters = pywrapcp.DefaultRoutingSearchParameters()
    parameters.first_solution_strategy = routing_enums_pb2.FirstSolutionStrategy.PATH_CHEAPEST_ARC
    parameters.local_search_metaheuristic = routing_enums_pb2.LocalSearchMetaheuristic.GUIDED_LOCAL_SEARCH
    parameters.time_limit.FromMilliseconds(int(1000 * seconds))
    solution = routing.SolveWithParameters(parameters)
    if solution is None:
        return None
    tour, index = [], routing.Start(0)
    while not routing.IsEnd(index):
        tour.append(manager.IndexToNode(index))
        index = solution.Value(routing.NextVar(index))
    return tour


def elkai(matrix, _seconds):
    import elkai as solver

    return solver.DistanceMatrix(matrix).solve_tsp(runs=1)[:-1]


def shuffled(matrix):
    """The matrix with its points in another order, the same one every time: some files of TSPLIB list their points in the
    order of the best tour (pr2392), which a solver that starts from the given order would profit from."""
    labels = list(range(len(matrix)))
    random.Random(len(labels)).shuffle(labels)
    return [[matrix[a][b] for b in labels] for a in labels]


def measure(solver, name, seconds, answer):
    matrix = shuffled(distances(name))
    globals()[solver]([row[:8] for row in matrix[:8]], 1.0)  # imports and first calls are not timed
    begun = time.process_time()
    tour = globals()[solver](matrix, seconds)
    spent = time.process_time() - begun
    answer.send((length(matrix, tour), spent) if tour else None)


def apart(solver, name, seconds):
    """Length and CPU time of a solver in a process of its own; nothing where it found no tour in time."""
    context = multiprocessing.get_context("spawn")
    answer, theirs = context.Pipe(duplex=False)
    process = context.Process(target=measure, args=(solver, name, seconds, theirs))
    process.start()
    theirs.close()
    try:
        found = answer.recv()
    except EOFError:
        found = None
    process.join()
    return found


def own(name, seconds, seeds):
    """Median length over the seeds, and the CPU time of that search."""
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / f"{name}.tsp"
        path.write_text(source(name))
        command = "cargo bench -q -p planning --bench tsplib -- lengths".split() + [str(seconds), str(seeds), str(path)]
        text = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    runs = sorted(tuple(map(float, line.split())) for line in text.splitlines())
    return runs[len(runs) // 2]


def solve(solver, name, seconds, seeds):
    if solver == "own":
        return own(name, seconds, seeds)
    if solver == "elkai" and int(re.search(r"\d+$", name).group()) > LARGEST_FOR_ELKAI:
        return None
    if solver == "elkai":
        return apart(solver, name, seconds)
    # What they spend on hardly any search, mostly to take over the lists of Python, is theirs on top.
    hardly = apart(solver, name, HARDLY)
    free = hardly[1] if hardly else 0.0
    limit = seconds
    for _ in range(4):
        answer = apart(solver, name, limit)
        if not answer or answer[1] - free >= 0.9 * seconds:
            break
        # Their limit is time on the wall; on a busy machine they got less CPU time than the others.
        limit *= min(seconds / max(answer[1] - free, 0.1 * seconds), 4.0)
    return answer and (answer[0], max(answer[1] - free, 0.0))


def within_venv():
    """Starts this script again with the interpreter that has the solvers."""
    folder = TARGET / "compare-venv"
    python = folder / "bin/python"
    if pathlib.Path(sys.prefix) == folder:
        return
    if not python.exists():
        venv.create(folder, with_pip=True)
        subprocess.run([python, "-m", "pip", "install", "-q", "fast-tsp", "numpy", "ortools", "elkai"], check=True)
    os.execv(python, [str(python), *sys.argv])


def main():
    within_venv()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=1.0)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--instances", nargs="*", default=DEFAULT, help="names of TSPLIB, plateN or clustersN of N points")
    arguments = parser.parse_args()
    solvers = ["own", "fast_tsp", "ortools", "elkai"]
    print("load averages %.1f, %.1f, %.1f" % os.getloadavg())
    print(f"{'gap % (CPU s)':<14}" + "".join(f"{solver:>18}" for solver in solvers))
    gaps = {solver: [] for solver in solvers}
    for name in arguments.instances:
        answers = [solve(solver, name, arguments.seconds, arguments.seeds) for solver in solvers]
        best = optimum(name) or min(answer[0] for answer in answers if answer)
        row = f"{name:<14}"
        for solver, answer in zip(solvers, answers):
            if answer:
                gap = 100 * (answer[0] / best - 1)
                gaps[solver].append(gap)
            row += f"{gap:>9.3f} ({answer[1]:>5.2f}) " if answer else f"{'-':>18}"
        print(row, flush=True)
    print(f"{'mean':<14}" + "".join(f"{sum(g) / max(len(g), 1):>9.3f}         " for g in gaps.values()))


if __name__ == "__main__":
    main()
