#!/usr/bin/env python3
"""An R-test on the LinuxCNC that listens on TCP 5007: r_test.py TABLE.

The axes go to the places of a grid, in an order of no direction, and an instrument with a noise of its own reads where the simulated machine
really is. The table is what `probecell import readings --test r-test` reads.
"""

import itertools
import pathlib
import random
import sys

from positioning_test import AXES, NOISE, at_home, true_positions

GRID = (-60, 5, 70)  # mm


def main(path):
    noise = random.Random(path)
    places = list(itertools.product(GRID, repeat=3))
    noise.shuffle(places)
    go = at_home()
    rows = ["axis.X,axis.Y,axis.Z,dx,dy,dz"]
    for place in places:
        named = dict(zip(AXES, place))
        go(named)
        errors = [true - at + noise.gauss(0, NOISE) for true, at in zip(true_positions(named), place)]
        rows.append(",".join([f"{at}" for at in place] + [f"{error:.6f}" for error in errors]))
    pathlib.Path(path).write_text("\n".join(rows) + "\n")
    print(f"{path}: {len(places)} places")


if __name__ == "__main__":
    main(sys.argv[1])
