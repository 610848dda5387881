"""What the tests share. PROBECELL names the command, whose answers are compared with those of the package."""

import os
import pathlib
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tests" / "interop" / "exchange"))
SAMPLES = ROOT / "bags" / "samples"
CELLS = ROOT / "launch-scripts"
PROGRAM = pathlib.Path(os.environ["PROBECELL"]).resolve()


def command(*arguments, cwd=None, status=0):
    """What the command prints."""
    done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, timeout=300, cwd=cwd)
    assert done.returncode == status, (arguments, done.returncode, done.stderr)
    return done.stdout if status == 0 else done.stderr.removeprefix("probecell: ").rstrip("\n")


@pytest.fixture(scope="session")
def my_csv(tmp_path_factory):
    """500 touches of a block that is displaced by 8 um, and the rows as they were written."""
    import touches

    path = tmp_path_factory.mktemp("csv") / "my.csv"
    return path, touches.write(path)
