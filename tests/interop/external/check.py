#!/usr/bin/env python3
"""A driver that is not ours makes parts: end to end, with approval, STOP, and a restart; then its faults are found.

    check.py PROBECELL [over_zenoh|over_dds|part|secured|nobody|conformance|zenoh|dds|cyclone|FAULT...]

`over_dds` stands for dds and cyclone, beside which nothing else should run; `over_zenoh` for all others. Each check has a network namespace of
its own. The driver is templates/driver.py, over eclipse-zenoh.
"""

import json
import pathlib
import re
import shutil
import signal
import subprocess
import sys

import faulty

ROOT = pathlib.Path(__file__).resolve().parents[3]
HERE = pathlib.Path(__file__).resolve().parent
sys.path.append(str(ROOT / "tests"))
import kit  # noqa: E402
from kit import Process, until  # noqa: E402


def driver(folder, *more):
    return Process(sys.executable, ROOT / "templates" / "driver.py", *more, folder=folder)


def driver_of_the_guide(folder):
    """The template with definitions and wire format taken from the guide, by the guide's own lines: a folder without ours."""
    guide = ROOT / "docs" / "driver"
    for page in guide.glob("*.md"):
        shutil.copy(page, folder)
    code = re.compile(r"```python\n(.*?)```\n", flags=re.DOTALL)
    (definitions,) = code.findall((guide / "order-and-plan.md").read_text())
    (module,) = code.findall((guide / "zenoh.md").read_text())
    subprocess.run([sys.executable, "-c", definitions], cwd=folder, check=True)
    (folder / "rmw_zenoh.py").write_text(module)
    shutil.copy(ROOT / "templates" / "driver.py", folder)
    return Process(sys.executable, folder / "driver.py", "--messages", folder / "messages", folder=folder)


def asked(*words, folder):
    return kit.run(BINARY, *words, folder=folder)


def own_cell(folder):
    for name in ("external.toml", "three_axis.urdf"):
        shutil.copy(ROOT / "launch-scripts" / name, folder)
    return folder / "external.toml"


def status(cell, folder):
    code, output, errors = asked("status", "--json", "--cell", cell, folder=folder)
    assert output, (code, errors)
    return json.loads(output)


def stage(cell, folder):
    return (status(cell, folder)["part"] or {}).get("stage")


def request(cell, folder, part):
    asked("orders", "resume", "--cell", cell, folder=folder)  # a part that was stopped before holds them
    code, output, errors = asked("run", part, "--cell", cell, folder=folder)
    assert code == 0, (output, errors)


def a_part_with_approval(up, cell, folder, part):
    request(cell, folder, part)
    line = up.says(r"probecell approve \S+")
    correction = re.search(r"probecell approve (\S+)", line).group(1)
    code, output, errors = asked("approve", correction, "--operator", "ada", "--cell", cell, folder=folder)
    assert code == 0, (output, errors)
    line = up.says(f"part {part}: ")
    assert f"part {part}: qualified" in line, up.output


def parts_end_to_end(folder):
    cell = own_cell(folder)
    with Process(BINARY, "up", cell, folder=folder) as up:
        code, output, errors = asked("key", "new", "ada", "--cell", cell, folder=folder)
        assert code == 0, (output, errors)
        up.says("waits for its external driver to publish /external/controller_status")
        # Its nodes are there a moment later.
        until("a request that is taken", lambda: asked("run", "early", "--cell", cell, folder=folder)[0] == 0)
        up.says("part early: stopped after 0 machining passes: .*no sample of the controller")
        with driver(folder) as first:
            up.says("the external driver is there$")
            until("an idle machine", lambda: status(cell, folder)["machine"] == "idle")
            a_part_with_approval(up, cell, folder, "first")
            # STOP in mid-measurement.
            request(cell, folder, "second")
            until("a measurement", lambda: stage(cell, folder) == "measuring")
            code, output, errors = asked("stop", "--operator", "Ada", "--cell", cell, folder=folder)
            assert code == 0 and "stands" in output, (code, output, errors)
            up.says("part second: stopped")
            until("an idle machine", lambda: status(cell, folder)["machine"] == "idle")
            # The driver is killed in mid-cut, and started again.
            request(cell, folder, "third")
            until("a cut", lambda: stage(cell, folder) == "cutting")
            first.end(signal.SIGKILL)
            up.says("the external driver has left the bus")
            up.says("part third: stopped")
            told = {one["name"]: (one["running"], one["starts"]) for one in status(cell, folder)["processes"]}
            assert told["external"] == (False, 1), told
        # One of another version is named, and nothing is made with it.
        words = (sys.executable, HERE / "faulty.py", "--fault", "other_version")
        with Process(*words, folder=folder):
            up.says("speaks another version: controller_replies is probecell_msgs/msg/ControllerReply RIHS01_")
        with driver_of_the_guide(folder):
            up.says("the external driver is there again")
            until("an idle machine", lambda: status(cell, folder)["machine"] == "idle")
            a_part_with_approval(up, cell, folder, "fourth")
            code = up.end(signal.SIGINT)
            assert code == 0, (code, up.output)
    (bag,) = (folder / "recordings").glob("*")
    code, output, errors = asked("replay", bag, folder=folder)
    assert code == 0, (output, errors)
    code, output, errors = asked("report", bag, "--json", folder=folder)
    assert code == 0, (output, errors)


def a_secured_cell_knows_its_driver(folder):
    cell = own_cell(folder)
    code, output, errors = asked("secure", cell, folder=folder)
    assert code == 0, (output, errors)
    (config,) = re.findall(r"ZENOH_SESSION_CONFIG_URI=(.*driver\.json5)", output)
    with Process(BINARY, "up", cell, folder=folder) as up:
        up.says("waits for its external driver")
        # A stranger does not get in, whoever comes first.
        with driver(folder), driver(folder, "--config", config):
            # Its samples arrive, and the machine is idle.
            for line in ("the external driver is there", "external is ready"):
                until(line, lambda: any(line in one for one in up.lines))
        assert not any("2 drivers" in line for line in up.lines), up.lines


def conformance(folder, *words, cell=None, more=(), warns="attachment"):
    """Status and lines of the conformance command beside a driver."""
    with Process(*words, folder=folder) as process:
        code, output, errors = kit.run(BINARY, "conformance", "--cell", cell or own_cell(folder), *more, folder=folder, seconds=240)
        assert process.code is None, process.output
    assert not errors or warns in errors, errors
    return code, output.splitlines()


CUT = ("--cut", "bore")


def the_template_conforms(folder):
    code, lines = conformance(folder, sys.executable, ROOT / "templates" / "driver.py", more=CUT)
    assert code == 0 and not any(line.startswith("WRONG") for line in lines), (code, lines)


def a_template_conforms(folder, name):
    """The one in Rust over Zenoh and over DDS, and the one in Python over Cyclone DDS."""
    program = pathlib.Path(BINARY).parent / "examples" / "driver_template"
    cell = own_cell(folder)
    cell.write_text(cell.read_text() + f'\n[bus]\ntransport = "{"zenoh" if name == "zenoh" else "dds"}"\n')
    more = (*CUT, "--wait", round(kit.patience(30)))
    if name == "zenoh":
        # It joins a router that is there.
        with Process(BINARY, "router", "--strangers", "write", folder=folder) as router:
            router.says("listens on")
            code, lines = conformance(folder, program, cell=cell, more=more, warns="decides by itself who may write")
            assert router.code is None, router.output
    else:
        code, lines = conformance(folder, *([sys.executable, HERE / "cyclone.py"] if name == "cyclone" else [program, "dds"]), cell=cell, more=more)
    assert code == 0 and not any("WRONG" in line for line in lines), (code, lines)


def a_fault_is_named(folder, fault):
    # Six touches are enough for any of them.
    cell = own_cell(folder)
    text = cell.read_text().replace(", [0.0, -25.0, 0.0]]", "]")
    text = text.replace("[0.0, 72.0, 144.0, 216.0, 288.0]", "[0.0, 120.0, 240.0]").replace("[-5.0, -10.0]", "[-5.0]")
    cell.write_text(text)
    code, lines = conformance(folder, sys.executable, HERE / "faulty.py", "--fault", fault, cell=cell)
    wrong = [line for line in lines if line.startswith("WRONG")]
    named = [line for line in wrong if all(word in line for word in faulty.LINES[fault])]
    assert code == 1 and named, (fault, code, lines)
    print(f"  {fault}: {named[0]}", flush=True)


def nobody_is_there(folder):
    code, output, errors = asked("conformance", "--cell", own_cell(folder), "--wait", "1", folder=folder)
    assert code == 1 and "WRONG  topics: controller_status: expected a publisher" in output, (code, output, errors)
    code, output, errors = asked("conformance", "--cell", own_cell(folder), "--cut", "no", folder=folder)
    assert code == 2 and 'operation' in errors, (code, output, errors)


def main():
    checks = {"part": parts_end_to_end, "secured": a_secured_cell_knows_its_driver, "nobody": nobody_is_there, "conformance": the_template_conforms}
    checks |= {one: lambda folder, name=one: a_template_conforms(folder, name) for one in ("zenoh", "dds", "cyclone")}
    checks |= {one: lambda folder, fault=one: a_fault_is_named(folder, fault) for one in faulty.LINES}
    over_dds = ["dds", "cyclone"]
    groups = {"over_dds": over_dds, "over_zenoh": [one for one in checks if one not in over_dds]}
    kit.main(checks, [one for word in sys.argv[2:] for one in groups.get(word, [word])])


if __name__ == "__main__":
    BINARY = str(pathlib.Path(sys.argv[1]).resolve())
    main()
