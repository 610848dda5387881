#!/usr/bin/env python3
"""`probecell demo` as a whole: what it says it found is what stands in the simulator's settings, and its output is that of the tutorial.

    demo.py PROBECELL

In a network namespace of its own. Needs nothing but Python.
"""

import pathlib
import re
import sys
import tempfile
import tomllib

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "tests"))
import kit  # noqa: E402

SECONDS = 60  # of an idle machine; twice what the page says
WIDEST = 100
FOUND = re.compile(r"(\w+) = (-?[\d.]+) ± ([\d.]+) µ(?:m|rad)")
PAGE = ROOT / "docs" / "tutorials" / "demo.md"


def hidden(settings):
    """Effect and parameters (µm, µrad) that the simulator of a cell file was given, by the rules of docs/effects.md."""
    probe, machine = settings["probe"], settings.get("machine", {})
    if probe.get("calibrated"):  # what is left is half the error of the gauge's diameter
        return "probe.ball_radius", {"dr": probe["gauge_error_um"] / 2}
    if any(probe["center_error_um"]):
        return "probe.stylus_offset", dict(zip(("dx", "dy"), probe["center_error_um"]))
    (error,) = machine["errors"]
    return f"link.{error['name']}", {"e": error.get("value_urad", error.get("value_um"))}


def shapes(text):
    """The lines of a story, each whole, without their numbers and with one word for singular and plural."""
    whole = re.sub(r"\n {21}", " ", text)
    return [re.sub(r"[\d.-]+", "#", line).replace("touches", "touch").strip() for line in whole.splitlines()]


def check(program):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        code, output, errors = kit.run(program, "demo", folder=folder, seconds=SECONDS)
        print(output, errors)
        lines = output.splitlines()
        assert code == 0, code
        assert re.fullmatch(r"dashboard: http://127\.0\.0\.1:\d+/", lines[0]), lines[0]
        assert max(map(len, lines)) <= WIDEST, max(lines, key=len)
        assert output.count("the promise is kept") == 3
        table = output[output.index("read only now"):]
        for file in sorted((folder / "demo").glob("*.toml")):
            effect, parameters = hidden(tomllib.loads(file.read_text())["simulator"])
            (line,) = re.findall(rf"^  {file.stem} .*\n +found +{re.escape(effect)} (.*)$", table, re.MULTILINE)
            found = {name: (float(value), float(half)) for name, value, half in FOUND.findall(line)}
            assert found.keys() == parameters.keys(), line
            for name, (value, half) in found.items():  # a 95 % interval is two standard deviations: four of them
                assert abs(value - parameters[name]) <= 2 * half + 0.1, (effect, name, value, half, parameters)
            assert len(list((folder / "demo" / "recordings").glob(f"{file.stem}_*"))) == 2
        (shown,) = re.findall(r"^```text\n(.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL)
        missing = set(shapes(shown)) - set(shapes(output))
        assert not missing, f"{PAGE.name} shows what is not printed: {missing}"


if __name__ == "__main__":
    check(pathlib.Path(sys.argv[1]).resolve())
