#!/usr/bin/env python3
"""Compares metrology's fits with SciPy on random point sets; exit status 1 beyond 1e-9 m.

usage: scipy_compare.py FIT_POINTS [--sets N] [--seed S] [--shapes SHAPE …] [--points LOW HIGH]

FIT_POINTS is the built example `fit_points`. Both sides minimise the sum of squared orthogonal distances; SciPy starts
from the shape the points were made from, we start from nothing. Compared are the shapes themselves, as positions (m)
on a reference grid: centre, radius, axis at both ends of the points, plane at their corners.
"""
import argparse
import json
import subprocess
import sys

import numpy as np
from scipy.linalg import svd
from scipy.optimize import least_squares

LIMIT = 1e-9
SHAPES = ["plane", "circle", "sphere", "cylinder", "cone"]


def rotation(rng):
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return q * np.linalg.det(q)


def make(shape, rng, sizes):
    """Points in m of a part-sized feature, and the true pose and size."""
    n = int(rng.integers(*sizes))
    frame, origin = rotation(rng), rng.uniform(-0.3, 0.3, 3)
    radius, length = rng.uniform(0.005, 0.1), rng.uniform(0.02, 0.2)
    # At least a third of a turn, at every angle.
    arc = rng.uniform(2 * np.pi / 3, 2 * np.pi)
    t = rng.uniform(0, 2 * np.pi) + arc * (np.arange(n) + rng.uniform(-0.3, 0.3, n)) / n
    z = rng.permutation(np.linspace(-0.5, 0.5, n)) * length
    half_angle = rng.uniform(0.05, 0.9)
    noise = 10 ** rng.uniform(-7, -4.5)
    if shape == "plane":
        local = np.c_[rng.uniform(-length, length, n), rng.uniform(-radius, radius, n), np.zeros(n)]
    elif shape == "circle":
        local = np.c_[radius * np.cos(t), radius * np.sin(t), np.zeros(n)]
    elif shape == "sphere":
        u = rng.uniform(0, 1, n)
        local = radius * np.c_[np.sqrt(1 - u * u) * np.cos(t), np.sqrt(1 - u * u) * np.sin(t), u]
    else:
        slope = np.tan(half_angle) if shape == "cone" else 0.0
        # The small end keeps a tenth of the radius.
        z = np.clip(z, -0.9 * radius / slope, None) if slope else z
        rho = radius + slope * z
        local = np.c_[rho * np.cos(t), rho * np.sin(t), z]
    local = local + rng.normal(scale=noise, size=(n, 3))
    return local @ frame.T + origin, frame, origin, radius, half_angle


def frame_of(axis):
    side = np.eye(3)[np.argmin(np.abs(axis))]
    e1 = np.cross(axis, side)
    e1 /= np.linalg.norm(e1)
    return np.c_[e1, np.cross(axis, e1), axis]


def descend(residual, start):
    result = least_squares(residual, start, jac="3-point", method="lm", xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=2000)
    return result.x


def axis_of(parameters, frame):
    axis = frame @ np.array([parameters[0], parameters[1], 1.0])
    return axis / np.linalg.norm(axis)


def solve(shape, points, frame, origin, radius, half_angle):
    """SciPy's shape: dictionary as the example prints it. Lengths are scaled to the size of the points."""
    centroid = points.mean(axis=0)
    centred = points - centroid
    if shape in ("plane", "circle"):
        _, _, v = svd(centred, full_matrices=False)
        if shape == "plane":
            return {"point": centroid, "normal": v[2]}
        normal = v[2]
        basis = frame_of(normal)
        q = centred @ basis
        c = (origin - centroid) @ basis
        scale = radius
        x = descend(lambda x: np.hypot(q[:, 0] / scale - x[0], q[:, 1] / scale - x[1]) - x[2], [c[0] / scale, c[1] / scale, 1.0])
        return {"center": centroid + basis @ np.array([x[0], x[1], 0]) * scale, "normal": normal, "radius": x[2] * scale}
    scale = np.sqrt((centred**2).sum(axis=1).mean())
    p = centred / scale
    if shape == "sphere":
        c = (origin - centroid) / scale
        x = descend(lambda x: np.linalg.norm(p - x[:3], axis=1) - x[3], [*c, radius / scale])
        return {"center": centroid + x[:3] * scale, "radius": x[3] * scale}
    q = p @ frame
    c = ((origin - centroid) / scale) @ frame

    def decompose(x):
        axis = np.array([x[2], x[3], 1.0]) / np.sqrt(1 + x[2] ** 2 + x[3] ** 2)
        arm = q - np.array([x[0], x[1], 0.0])
        along = arm @ axis
        return axis, along, np.sqrt(np.maximum((arm**2).sum(axis=1) - along**2, 0))

    if shape == "cylinder":
        x = descend(lambda x: decompose(x)[2] - x[4], [c[0], c[1], 0, 0, radius / scale])
        extra = {}
    else:
        r0 = radius / scale - c[2] * np.tan(half_angle)

        def residual(x):
            _, along, rho = decompose(x)
            return (rho - x[4]) * np.cos(x[5]) - along * np.sin(x[5])

        x = descend(residual, [c[0], c[1], 0, 0, r0, half_angle])
        extra = {"half_angle": x[5]}
    axis, _, _ = decompose(x)
    foot = np.array([x[0], x[1], 0.0])
    return {"point": centroid + frame @ foot * scale, "axis": frame @ axis, "radius": x[4] * scale, **extra}


def difference(shape, ours, theirs, points):
    """Largest distance in m between the two shapes over the extent of the points."""
    centroid = points.mean(axis=0)
    reach = np.linalg.norm(points - centroid, axis=1).max()
    vector = lambda d, key: np.asarray(d[key], dtype=float)
    if shape == "sphere":
        return max(np.abs(vector(ours, "center") - theirs["center"]).max(), abs(ours["radius"] - theirs["radius"]))
    key = {"plane": "normal", "circle": "normal"}.get(shape, "axis")
    a, b = vector(ours, key), np.array(theirs[key])
    sign = 1.0 if a @ b > 0 else -1.0
    tilt = np.linalg.norm(a - sign * b) * reach
    if shape == "plane":
        return max(tilt, abs((vector(ours, "point") - theirs["point"]) @ a))
    if shape == "circle":
        return max(tilt, np.abs(vector(ours, "center") - theirs["center"]).max(), abs(ours["radius"] - theirs["radius"]))
    # Axes meet where they pass the centroid.
    foot = lambda d, axis: np.array(d["point"]) + axis * ((centroid - np.array(d["point"])) @ axis)
    mine, other = foot(ours, a), foot(theirs, b)
    worst = max(tilt, np.abs(mine - other).max())
    slope_a, slope_b = np.tan(ours.get("half_angle", 0.0)), np.tan(theirs.get("half_angle", 0.0))
    radius_a = ours["radius"] + slope_a * ((mine - vector(ours, "point")) @ a)
    radius_b = theirs["radius"] + slope_b * ((other - theirs["point"]) @ b)
    return max(worst, abs(radius_a - radius_b), abs(slope_a - sign * slope_b) * reach)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("fit_points")
    parser.add_argument("--sets", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--shapes", nargs="+", choices=SHAPES, default=SHAPES)
    parser.add_argument("--points", nargs=2, type=int, default=[8, 60], help="points of a set, from LOW to below HIGH")
    arguments = parser.parse_args()
    failed = False
    for which, shape in enumerate(SHAPES):
        if shape not in arguments.shapes:
            continue
        rng = np.random.default_rng([arguments.seed, which])
        cases = [make(shape, rng, arguments.points) for _ in range(arguments.sets)]
        text = "".join(json.dumps({"shape": shape, "points": case[0].tolist()}) + "\n" for case in cases)
        answers = subprocess.run([arguments.fit_points], input=text, capture_output=True, text=True, check=True).stdout
        worst, beyond = 0.0, 0
        for index, (case, line) in enumerate(zip(cases, answers.splitlines(), strict=True)):
            answer = json.loads(line)
            if "error" in answer:
                gap = np.inf
            else:
                gap = difference(shape, answer["shape"], solve(shape, *case), case[0])
            if not gap <= LIMIT:
                beyond += 1
                if beyond <= 5:
                    print(f"{shape} set {index}: {gap:.3e} m {answer.get('error', '')}")
            worst = max(worst, gap)
        print(f"{shape:9} {len(cases)} sets, largest difference {worst:.2e} m, {beyond} beyond {LIMIT:.0e} m", flush=True)
        failed |= beyond > 0
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
