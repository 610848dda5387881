#!/usr/bin/env python3
"""Times metrology's fits and SciPy's on the same kind of points in one run; exit status 1 where SciPy is ahead.

    python3 crates/metrology/benches/scipy_fits.py

SciPy is installed into target/scipy-venv; the bench `fits` is built and run.
SciPy has the easier task: it starts from the true shape, has the analytic Jacobian, and stops at its default
tolerance; ours starts from the points alone, searches all axis directions and stops at the rounding. The plane is
a singular value decomposition. Times are the fastest of three; ours those the bench prints.
"""
import os
import pathlib
import subprocess
import sys
import time
import venv

ROOT = pathlib.Path(__file__).resolve().parents[3]
TARGET = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")).resolve()


def within_venv():
    """Starts this script again with the interpreter that has SciPy."""
    folder = TARGET / "scipy-venv"
    python = folder / "bin/python"
    if pathlib.Path(sys.prefix) == folder:
        return
    if not python.exists():
        venv.create(folder, with_pip=True)
        subprocess.run([python, "-m", "pip", "install", "-q", "scipy"], check=True)
    os.execv(python, [str(python), *sys.argv])


within_venv()

import numpy as np  # noqa: E402
from scipy.linalg import svd  # noqa: E402
from scipy.optimize import least_squares  # noqa: E402


def points(shape, n, rng):
    angle, z = rng.uniform(0, 4.7, n), rng.uniform(-0.025, 0.025, n)
    e, f = rng.normal(scale=3e-6, size=(2, n))
    c, s = np.cos(angle), np.sin(angle)
    if shape == "plane":
        return np.c_[0.02 * c, z, e]
    if shape == "circle":
        return np.c_[(0.02 + e) * c, (0.02 + e) * s, f]
    if shape == "sphere":
        d = np.c_[c, s, 20 * z]
        return d / np.linalg.norm(d, axis=1)[:, None] * (0.02 + e)[:, None]
    rho = 0.02 + e + (0.3 * z if shape == "cone" else 0)
    return np.c_[rho * c, rho * s, z]


def round_problem(shape, p):
    """Residuals, Jacobian and start in units of 20 mm."""
    q = p / 0.02
    one = np.ones(len(q))
    if shape in ("circle", "sphere"):
        d = 2 if shape == "circle" else 3
        q = q[:, :d]

        def residual(x):
            return np.sqrt(((q - x[:d]) ** 2).sum(axis=1)) - x[d]

        def jacobian(x):
            arm = q - x[:d]
            return np.c_[-arm / np.sqrt((arm**2).sum(axis=1))[:, None], -one]

        return residual, jacobian, np.r_[np.zeros(d), 1.0] + 1e-3

    def parts(x):
        # Axis through (x0, x1, 0) along (x2, x3, 1): exact to first order in the tilts, as the fit needs them.
        u, v = q[:, 0] - x[0] - x[2] * q[:, 2], q[:, 1] - x[1] - x[3] * q[:, 2]
        return u, v, np.sqrt(u * u + v * v)

    def residual(x):
        _, _, rho = parts(x)
        r = rho - x[4]
        return r * np.cos(x[5]) - q[:, 2] * np.sin(x[5]) if shape == "cone" else r

    def jacobian(x):
        u, v, rho = parts(x)
        c, s = (np.cos(x[5]), np.sin(x[5])) if shape == "cone" else (1.0, 0.0)
        a, b = -c * u / rho, -c * v / rho
        columns = [a, b, a * q[:, 2], b * q[:, 2], -c * one]
        if shape == "cone":
            columns.append(-(rho - x[4]) * s - q[:, 2] * c)
        return np.stack(columns, axis=1)

    start = [1e-3, 1e-3, 1e-3, 1e-3, 1.001] + ([np.arctan(0.3)] if shape == "cone" else [])
    return residual, jacobian, np.array(start)


def run(shape, p):
    begin = time.perf_counter()
    if shape == "plane":
        svd(p - p.mean(axis=0), full_matrices=False, overwrite_a=True, check_finite=False)
    else:
        if shape == "circle":
            _, _, v = svd(p - p.mean(axis=0), full_matrices=False, check_finite=False)
        residual, jacobian, start = round_problem(shape, p)
        least_squares(residual, start, jac=jacobian, method="lm")
    return time.perf_counter() - begin


def main():
    command = "cargo bench -q -p metrology --bench fits".split()
    ours = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True).stdout
    rng = np.random.default_rng(1)
    behind = 0
    print("load averages %.1f, %.1f, %.1f" % os.getloadavg())
    print(f"{'shape':9} {'points':>8} {'ours, s':>10} {'SciPy, s':>10} {'times':>6}")
    for line in ours.splitlines():
        shape, n, seconds = line.split()
        n, seconds = int(n), float(seconds)
        p = points(shape, n, rng)
        theirs = min(run(shape, p) for _ in range(3))
        behind += not seconds < theirs
        print(f"{shape:9} {n:8d} {seconds:10.6f} {theirs:10.6f} {theirs / seconds:6.1f}", flush=True)
    return 1 if behind else 0


if __name__ == "__main__":
    sys.exit(main())
