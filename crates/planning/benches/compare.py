#!/usr/bin/env python3
"""Compares the search with fast-tsp, OR-tools and elkai (LKH) on the same TSPLIB instances, in the same run.

Each solver runs in its own process, one thread; the time is CPU time of that process, the gap is to the published
optimum. elkai has no time limit: its own time stands beside it. LKH is for academic use: a yardstick, nothing else.

    python -m venv venv && venv/bin/pip install fast-tsp ortools elkai
    venv/bin/python crates/planning/benches/compare.py [--seconds 1] [--instances eil51 pr1002 …]
"""

import argparse
import math
import multiprocessing
import pathlib
import re
import subprocess
import time

ROOT = pathlib.Path(__file__).resolve().parents[3]
LIBRARY = ROOT.parent / "shared/data/tsplib"
DEFAULT = "eil51 berlin52 d198 a280 lin318 pcb442 d657 pr1002 u1060 pcb1173 d1291 fl1577 pr2392".split()
LARGEST_FOR_ELKAI = 1200


def distances(name):
    text = (LIBRARY / "tsp" / f"{name}.tsp").read_text()
    section = text.split("NODE_COORD_SECTION")[1].split("EOF")[0]
    points = [tuple(map(float, line.split()[1:])) for line in section.strip().splitlines()]
    up = "CEIL_2D" in text
    whole = math.ceil if up else lambda d: int(d + 0.5)
    return [[whole(math.dist(a, b)) for b in points] for a in points]


def optimum(name):
    match = re.search(rf"^{name} : (\d+)", (LIBRARY / "solutions_stsp.txt").read_text(), re.MULTILINE)
    return int(match.group(1))


def length(matrix, tour):
    assert sorted(tour) == list(range(len(matrix)))
    return sum(matrix[a][b] for a, b in zip(tour, tour[1:] + tour[:1]))


def fast_tsp(matrix, seconds):
    import fast_tsp as solver

    return solver.find_tour(matrix, seconds, max_threads=1)


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
    tour, index = [], routing.Start(0)
    while not routing.IsEnd(index):
        tour.append(manager.IndexToNode(index))
        index = solution.Value(routing.NextVar(index))
    return tour


def elkai(matrix, _seconds):
    import elkai as solver

    return solver.DistanceMatrix(matrix).solve_tsp(runs=1)[:-1]


def measure(solver, name, seconds, answer):
    matrix = distances(name)
    globals()[solver]([row[:8] for row in matrix[:8]], 1.0)  # imports and first calls are not timed
    begun = time.process_time()
    tour = globals()[solver](matrix, seconds)
    answer.send((length(matrix, tour), time.process_time() - begun))


def apart(solver, name, seconds):
    context = multiprocessing.get_context("spawn")
    answer, theirs = context.Pipe(duplex=False)
    process = context.Process(target=measure, args=(solver, name, seconds, theirs))
    process.start()
    theirs.close()
    try:
        found, spent = answer.recv()
    except EOFError:
        raise SystemExit(f"{solver} found no tour of {name} within {seconds} s") from None
    process.join()
    return 100 * (found / optimum(name) - 1), spent


def own(name, seconds):
    command = ["cargo", "bench", "-q", "-p", "planning", "--bench", "tsplib", "--", "tsp", str(seconds), "1", name]
    text = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    fields = next(line for line in text.splitlines() if line.startswith(name)).split()
    return float(fields[2]), float(fields[5])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=1.0)
    parser.add_argument("--instances", nargs="*", default=DEFAULT)
    arguments = parser.parse_args()
    solvers = ["own", "fast_tsp", "ortools", "elkai"]
    print(f"{'gap % (CPU s)':<14}" + "".join(f"{solver:>18}" for solver in solvers))
    gaps = {solver: [] for solver in solvers}
    for name in arguments.instances:
        row = f"{name:<14}"
        for solver in solvers:
            if solver == "elkai" and int(re.search(r"\d+$", name).group()) > LARGEST_FOR_ELKAI:
                row += f"{'-':>18}"
                continue
            gap, spent = own(name, arguments.seconds) if solver == "own" else apart(solver, name, arguments.seconds)
            if solver in ("fast_tsp", "ortools") and spent < 0.8 * arguments.seconds:
                # Their limit is time on the wall; on a busy machine they got less CPU time than the others.
                gap, spent = apart(solver, name, arguments.seconds**2 / spent)
            gaps[solver].append(gap)
            row += f"{gap:>9.3f} ({spent:>5.2f}) "
        print(row, flush=True)
    print(f"{'mean':<14}" + "".join(f"{sum(g) / max(len(g), 1):>9.3f}         " for g in gaps.values()))


if __name__ == "__main__":
    main()
