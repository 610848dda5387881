"""The README's lines and the examples run as they stand."""

import re
import shutil
import subprocess
import sys

import numpy
import pytest
import touches
from conftest import ROOT, SAMPLES

PYTHON = ROOT / "neighbours" / "python"


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    """The files that the README names."""
    touches.write(tmp_path / "german.csv")
    names = dict(zip(touches.HEADER, ["No", "Feature", "X", "Y", "Z", "NX", "NY", "NZ", "Dev", "Time"]))
    lines = (tmp_path / "german.csv").read_text().splitlines()
    header = ",".join(names[name] for name in lines[0].split(","))
    (tmp_path / "my.csv").write_text("\n".join([header, *lines[1:]]) + "\n")
    (tmp_path / "recordings" / "turn_mill_1").mkdir(parents=True)
    shutil.copy(SAMPLES / "punch.mcap", tmp_path / "recordings" / "turn_mill_1" / "run_0.mcap")
    for day, sample in [("monday", "guideway"), ("tuesday", "guideway"), ("friday", "guideway_straight")]:
        shutil.copy(SAMPLES / f"{sample}.mcap", tmp_path / f"{day}.mcap")
    (tmp_path / "launch-scripts").symlink_to(ROOT / "launch-scripts")
    monkeypatch.chdir(tmp_path)


def test_every_line_of_the_readme_runs(workplace):
    import pandas

    names = {"points": numpy.column_stack([0.015 * numpy.cos(range(9)), 0.015 * numpy.sin(range(9)), numpy.arange(9) * 1e-3])}
    blocks = re.findall(r"```python\n(.*?)```", (PYTHON / "README.md").read_text(), re.DOTALL)
    assert len(blocks) == 4
    for block in blocks:
        if block.startswith(">>>"):
            expected = block.splitlines()[1].removeprefix("probecell.InputError: ")
            with pytest.raises(ValueError) as raised:
                exec(block.splitlines()[0].removeprefix(">>> "), names)
            assert str(raised.value) == expected
        else:
            exec(block, names)
    assert names["found"].verdict == "explained" and isinstance(names["bag"]["probe_events"].to_pandas(), pandas.DataFrame)
    assert (names["again"].name, len(names["order"])) and abs(names["ring"].size - 0.03) < 1e-9


def test_examples(tmp_path):
    def example(name, *arguments):
        words = [sys.executable, PYTHON / "examples" / name, *arguments]
        return subprocess.run(list(map(str, words)), check=True, capture_output=True, text=True, timeout=300).stdout

    said = example("compare_sessions.py", SAMPLES / "guideway.mcap", SAMPLES / "guideway_straight.mcap")
    assert re.search(r"^axis\.Z\.straightness a: .* -> not named m, changed$", said, re.MULTILINE)
    import polars

    bags = [SAMPLES / "guideway.mcap", SAMPLES / "ball_check.mcap"]
    example("touches_to_parquet.py", tmp_path / "out.parquet", *bags)
    table = polars.read_parquet(tmp_path / "out.parquet")
    assert set(table["session"]) == {bag.name for bag in bags} and table.height > 14
