#!/usr/bin/env python3
"""Compares common methods of variable selection with our diagnosis, on the same sessions and the same columns.

    target/venv/bin/python tests/competing_methods/compare.py [--each N] [--train N] [--dev FOLDER] [--signatures PROGRAM]

Sealed sessions come from `probecell blind`'s plant, by way of the example `signatures`; `--dev` adds labelled bags
(a folder with truth.json). Every method gets the columns that we use, scaled to their plausible sizes, and the same
groups. "raw": the answer of the library as it is. "tuned": an effect counts only if its part of the fit exceeds a multiple
of the residual, the multiple chosen on the training sessions (which are not scored). An answer is correct if the named
effects are the hidden ones, or are indistinguishable from them (canonical correlation of the columns above 0.97).
Needs NumPy, scikit-learn and pysindy.
"""

import argparse
import itertools
import json
import pathlib
import subprocess
import tempfile
import time
import warnings

import numpy as np
from pysindy.optimizers import SSR, STLSQ
from sklearn.linear_model import ARDRegression, LassoCV, OrthogonalMatchingPursuitCV

warnings.filterwarnings("ignore")
CONTENTS = ("clean", "known1", "known2", "known3", "strange", "mixed")
ALIKE = 0.97
SHARES = (0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0)
ROOT = pathlib.Path(__file__).resolve().parents[2]


class Problem:
    """One session: scaled columns, their groups (a variant at a shape) and effects."""

    def __init__(self, folder, truth=None):
        read = json.loads((folder / "problem.json").read_text())
        matrix = np.load(folder / "matrix.npy")
        self.y = np.array(read["y"])
        self.truth = read["truth"] if truth is None else truth
        self.report, self.ms = read["report"], read["ms"]
        keep, groups = [], {}
        scale = np.sqrt((matrix**2).mean(0)) * [c["plausible"] for c in read["columns"]]
        for i, column in enumerate(read["columns"]):
            if scale[i] > 1e-9:
                groups.setdefault((column["effect"], column["variant"], column["shape"]), []).append(len(keep))
                keep.append(i)
        self.x = matrix[:, keep] / np.sqrt((matrix[:, keep] ** 2).mean(0))
        self.size = np.sqrt((self.y**2).mean())
        self.groups = list(groups.items())
        self.effect = np.empty(len(keep), dtype=object)
        for (effect, _, _), columns in self.groups:
            self.effect[columns] = effect

    def span(self, effect):
        """Orthonormal bases of an effect, one for each group."""
        bases = []
        for (name, _, _), columns in self.groups:
            if name == effect:
                u, s, _ = np.linalg.svd(self.x[:, columns], full_matrices=False)
                bases.append(u[:, s > 1e-6 * s[0]])
        return bases

    def alike(self, one, other):
        """True if this session cannot distinguish two effects."""
        if one == other:
            return True
        return any(
            np.linalg.svd(a.T @ b, compute_uv=False)[0] > ALIKE for a in self.span(one) for b in self.span(other)
        )

    def strengths(self, coefficients):
        """Root mean square of each effect's part over that of the residual."""
        residuals = self.y / self.size - self.x @ coefficients
        noise = max(np.sqrt((residuals**2).mean()), 1e-9)
        strengths = {}
        for effect in sorted(set(self.effect[np.abs(coefficients) > 1e-9])):
            part = np.where(self.effect == effect, coefficients, 0.0)
            strengths[effect] = np.sqrt(((self.x @ part) ** 2).mean()) / noise
        return strengths


def least_squares(problem, columns):
    coefficients = np.zeros(problem.x.shape[1])
    if columns:
        coefficients[columns] = np.linalg.lstsq(problem.x[:, columns], problem.y / problem.size, rcond=1e-9)[0]
    return coefficients


def bic(problem, columns):
    left = problem.y / problem.size - problem.x @ least_squares(problem, columns)
    n = len(left)
    return n * np.log(max((left**2).mean(), 1e-18)) + len(columns) * np.log(n)


def lasso(problem):
    return LassoCV(cv=5, alphas=40, max_iter=3000).fit(problem.x, problem.y / problem.size).coef_


def omp(problem):
    most = min(20, problem.x.shape[1])
    return OrthogonalMatchingPursuitCV(cv=5, max_iter=most).fit(problem.x, problem.y / problem.size).coef_


def ard(problem):
    return ARDRegression(max_iter=60).fit(problem.x, problem.y / problem.size).coef_


def stlsq(problem):
    fit = STLSQ(threshold=0.1, alpha=0.05).fit(problem.x, (problem.y / problem.size)[:, None])
    return fit.coef_[0]


def ssr(problem):
    """Stepwise sparse regression from a screened start; the step of least BIC."""
    first = np.argsort(-np.abs(problem.x.T @ problem.y))[: len(problem.y) // 3]
    part = problem.x[:, first]
    fit = SSR(alpha=0.05, max_iter=len(first)).fit(part, (problem.y / problem.size)[:, None])
    best = min(fit.history_, key=lambda c: bic(problem, list(first[np.abs(np.ravel(c)) > 1e-12])))
    return least_squares(problem, list(first[np.abs(np.ravel(best)) > 1e-12]))


def forward(problem, most=8):
    """Groups in the order in which they lower the sum of squares, while BIC falls."""
    chosen, taken, known = [], set(), bic(problem, [])
    left, basis = problem.y / problem.size, np.zeros((len(problem.y), 0))
    while len(taken) < most:
        gains = []
        for (effect, _, _), columns in problem.groups:
            block = problem.x[:, columns]
            block = block - basis @ (basis.T @ block)
            q, r = np.linalg.qr(block)
            q = q[:, np.abs(np.diag(r)) > 1e-6]
            gains.append(-1.0 if effect in taken else float(((q.T @ left) ** 2).sum()))
        place = int(np.argmax(gains))
        (effect, _, _), columns = problem.groups[place]
        value = bic(problem, chosen + columns)
        if gains[place] <= 0 or value >= known:
            break
        known, chosen = value, chosen + columns
        taken.add(effect)
        basis, _ = np.linalg.qr(problem.x[:, chosen])
        left = problem.y / problem.size - basis @ (basis.T @ (problem.y / problem.size))
    return chosen


def stepwise(problem):
    return least_squares(problem, forward(problem))


def exhaustive(problem):
    """Least BIC over all sets of up to three of the 16 groups that alone explain most, one for each effect."""
    best = {}
    for (effect, _, _), columns in problem.groups:
        value = bic(problem, columns)
        if effect not in best or value < best[effect][0]:
            best[effect] = (value, columns)
    few = sorted(best.values(), key=lambda pair: pair[0])[:16]
    sets = itertools.chain.from_iterable(itertools.combinations(few, size) for size in range(4))
    chosen = min(sets, key=lambda s: bic(problem, sum((c for _, c in s), [])))
    return least_squares(problem, sum((columns for _, columns in chosen), []))


METHODS = {
    "LassoCV": lasso,
    "OMP-CV": omp,
    "ARD": ard,
    "SINDy STLSQ": stlsq,
    "SINDy SSR (BIC)": ssr,
    "stepwise BIC": stepwise,
    "exhaustive <= 3 BIC": exhaustive,
}


def judge(problem, named):
    """(exact cause, false effect) of a list of effects."""
    hidden = [effect for effect in problem.truth if not effect.startswith("x.")]
    fits = any(
        all(problem.alike(a, b) for a, b in zip(named, order)) for order in itertools.permutations(hidden)
    ) if len(named) == len(hidden) else False
    blamed = any(not any(problem.alike(effect, h) for h in hidden) for effect in named)
    return fits, blamed


def row(name, problems, answers, flags, ms):
    """One row of the table: shares over the kinds of session."""
    known = [i for i, p in enumerate(problems) if p.truth and not any(e.startswith("x.") for e in p.truth)]
    clean = [i for i, p in enumerate(problems) if not p.truth]
    strange = [i for i, p in enumerate(problems) if any(e.startswith("x.") for e in p.truth)]
    judged = [judge(problem, answer) for problem, answer in zip(problems, answers)]
    share = lambda indices, value: f"{sum(value(i) for i in indices)}/{len(indices)}" if indices else "-"
    return (
        f"| {name} | {share(known, lambda i: judged[i][0])} | {share(clean, lambda i: bool(answers[i]))} "
        f"| {share(known, lambda i: judged[i][1])} | {share(strange, lambda i: judged[i][1])} "
        f"| {share(strange, lambda i: flags[i]) if flags else 'never'} | {np.median(ms):.0f} |"
    )


def problems(arguments, first, count, folder):
    for content in CONTENTS:
        for trial in range(first, first + count):
            session = folder / f"{content}-{trial}"
            seed = str(arguments.seed * 100_000 + trial)
            subprocess.run([arguments.signatures, "--blind", seed, content, session], check=True)
            yield Problem(session)


def development(arguments, folder):
    if arguments.dev is None:
        return
    truths = json.loads((arguments.dev / "truth.json").read_text())
    for name, truth in truths.items():
        session = folder / name
        subprocess.run([arguments.signatures, arguments.dev / name, session], check=True)
        yield Problem(session, [effect["effect"] for effect in truth["effects"]])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--each", type=int, default=8, help="scored sessions of each content")
    parser.add_argument("--train", type=int, default=5, help="training sessions of each content")
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--dev", type=pathlib.Path)
    parser.add_argument("--signatures", default=ROOT / "target/release/examples/signatures")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        training = list(problems(arguments, 0, arguments.train, folder))
        blind = list(problems(arguments, 1000, arguments.each, folder))
        sets = {"sealed sessions": blind, "development sessions": list(development(arguments, folder))}
    head = "| method | exact cause | clean: something named | false effect named | unknown cause: false effect named | flagged | ms |"
    solved, took = {}, {}
    for name, method in METHODS.items():
        for problem in itertools.chain(training, *sets.values()):
            begun = time.perf_counter()
            solved[name, problem] = problem.strengths(method(problem))
            took[name, problem] = 1e3 * (time.perf_counter() - begun)
    answer = lambda name, problem, share: [e for e, s in solved[name, problem].items() if s > share]
    for title, scored in sets.items():
        if not scored:
            continue
        print(f"\n{title}: {len(scored)}\n\n{head}\n|---|---|---|---|---|---|---|")
        for name in METHODS:
            right = lambda share: sum(judge(p, answer(name, p, share))[0] for p in training)
            best = max(SHARES, key=right)
            ms = [took[name, problem] for problem in scored]
            for text, share in (("raw", 0.0), (f"tuned, {best}", best)):
                answers = [answer(name, problem, share) for problem in scored]
                print(row(f"{name} ({text})", scored, answers, None, ms))
        ours = [
            [e["effect"] for e in p.report["effects"] if e["effect"] != "data.outliers" or "data.outliers" in p.truth]
            for p in scored
        ]
        flags = [p.report["verdict"] in ("unexplained", "partly_explained") for p in scored]
        print(row("**probecell, untuned**", scored, ours, flags, [problem.ms for problem in scored]))


if __name__ == "__main__":
    main()
