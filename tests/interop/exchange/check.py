#!/usr/bin/env python3
"""What probecell takes from other systems and gives to them, checked by readers and writers that share no code with it.

    check.py PROBECELL [WORD]      WORD: only checks whose name contains it

Files are written by plain Python and read back by lxml, aqdefreader, jsonschema and mcap. The published schemas are looked for
in ../shared/data/schemas; checks that need one say so where it is not there.
"""

import json
import math
import pathlib
import sys

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[2]
SCHEMAS = ROOT.parent / "shared" / "data" / "schemas"
sys.path[:0] = [str(HERE), str(ROOT / "tests")]
import kit  # noqa: E402

PROGRAM = pathlib.Path(sys.argv[1]).resolve()
CHECKS = []


def check(function):
    CHECKS.append(function)
    return function


def probecell(*arguments, status=0):
    """Runs the program; gives standard output and standard error."""
    code, output, errors = kit.run(PROGRAM, *arguments, seconds=300)
    assert code == status, (arguments, code, errors)
    return output, errors


def answer(*arguments):
    """The JSON that a command prints."""
    return json.loads(probecell(*arguments, "--json")[0])


def main():
    import modules  # noqa: F401  registers the checks

    wanted = sys.argv[2] if len(sys.argv) > 2 else ""
    chosen = [one for one in CHECKS if wanted in one.__name__]
    assert chosen, "no check has such a name"
    for one in chosen:
        with kit.new_folder() as folder:
            said = one(pathlib.Path(folder))
        print(f"{'skipped' if said else 'good':8}{one.__name__.replace('_', ' ')}{': ' + said if said else ''}", flush=True)
    print(f"{len(chosen)} checks")


def close(a, b, tolerance=0.0):
    """Equal to the bit, or within a tolerance that the format's digits give."""
    assert math.isclose(a, b, rel_tol=0, abs_tol=tolerance) or a == b, (a, b)


if __name__ == "__main__":
    sys.modules["check"] = sys.modules["__main__"]
    raise SystemExit(not kit.guarded(main))
