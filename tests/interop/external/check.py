#!/usr/bin/env python3
"""A driver that is not ours makes parts: end to end, with approval, STOP, and a restart; then its faults are found.

    check.py PROBECELL [part|secured|conformance|zenoh|dds|cyclone|FAULT...]

Runs in a network namespace of its own (the router's port is taken). The driver is templates/driver.py, over eclipse-zenoh.
"""

import contextlib
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time

import faulty

ROOT = pathlib.Path(__file__).resolve().parents[3]
HERE = pathlib.Path(__file__).resolve().parent
PATIENCE = 120  # s


def until(what, ready):
    deadline = time.monotonic() + PATIENCE
    while not (found := ready()):
        assert time.monotonic() < deadline, f"{what}: not within {PATIENCE} s"
        time.sleep(0.05)
    return found


class Process:
    """A process whose lines are kept."""

    def __init__(self, *words, folder):
        self.process = subprocess.Popen(
            [str(word) for word in words], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL, text=True, env=with_keys(folder),
        )
        self.lines, self.seen = [], 0
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self):
        for line in self.process.stdout:
            self.lines.append(line.rstrip("\n"))

    def says(self, text):
        """The next line that holds a text."""

        def found():
            while self.seen < len(self.lines):
                self.seen += 1
                if re.search(text, self.lines[self.seen - 1]):
                    return self.lines[self.seen - 1]
            assert self.process.poll() is None or self.reader.is_alive(), "\n".join(self.lines)
            return None

        try:
            return until(text, found)
        except AssertionError as error:
            raise AssertionError(f"{error}\n" + "\n".join(self.lines)) from None

    def end(self, how=signal.SIGTERM):
        if self.process.poll() is None:
            self.process.send_signal(how)
        code = self.process.wait(PATIENCE)
        self.reader.join(PATIENCE)
        return code


@contextlib.contextmanager
def running(*words, folder):
    process = Process(*words, folder=folder)
    try:
        yield process
    finally:
        process.end()


def driver(folder, *more):
    return running(sys.executable, ROOT / "templates" / "driver.py", *more, folder=folder)


def driver_of_the_guide(folder):
    """The template with definitions and wire format taken from the guide, by the guide's own lines: a folder without ours."""
    guide = (ROOT / "docs" / "driver-guide.md").read_text()
    (folder / "driver-guide.md").write_text(guide)
    split, module = re.findall(r"```python\n(.*?)```\n", guide, flags=re.DOTALL)
    subprocess.run([sys.executable, "-c", split], cwd=folder, check=True)
    (folder / "rmw_zenoh.py").write_text(module)
    shutil.copy(ROOT / "templates" / "driver.py", folder)
    return running(sys.executable, folder / "driver.py", "--messages", folder / "messages", folder=folder)


def with_keys(folder):
    """Keys of operators and of the cell go into the folder of the check, as does the private socket of its router: an account of its own."""
    return os.environ | {"XDG_CONFIG_HOME": str(folder / "config"), "XDG_STATE_HOME": str(folder / "state")}


def asked(*words, folder):
    told = subprocess.run([BINARY, *map(str, words)], cwd=folder, capture_output=True, text=True, timeout=PATIENCE, env=with_keys(folder))
    return told.returncode, told.stdout, told.stderr


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
    code, output, errors = asked("run", part, "--cell", cell, folder=folder)
    assert code == 0, (output, errors)


def a_part_with_approval(up, cell, folder, part):
    request(cell, folder, part)
    line = up.says(r"probecell approve \S+")
    correction = re.search(r"probecell approve (\S+)", line).group(1)
    code, output, errors = asked("approve", correction, "--operator", "ada", "--cell", cell, folder=folder)
    assert code == 0, (output, errors)
    up.says(f"part {part}: qualified")


def parts_end_to_end(folder):
    cell = own_cell(folder)
    with running(BINARY, "up", cell, folder=folder) as up:
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
        with running(*words, folder=folder):
            up.says("speaks another version: controller_replies is probecell_msgs/msg/ControllerReply RIHS01_")
        with driver_of_the_guide(folder):
            up.says("the external driver is there again")
            until("an idle machine", lambda: status(cell, folder)["machine"] == "idle")
            a_part_with_approval(up, cell, folder, "fourth")
            code = up.end(signal.SIGINT)
            assert code == 0, (code, up.lines)
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
    with running(BINARY, "up", cell, folder=folder) as up:
        up.says("waits for its external driver")
        # A stranger does not get in, whoever comes first.
        with driver(folder), driver(folder, "--config", config):
            # Its samples arrive, and the machine is idle.
            for line in ("the external driver is there", "external is ready"):
                until(line, lambda: any(line in one for one in up.lines))
        assert not any("2 drivers" in line for line in up.lines), up.lines


def conformance(folder, *words, cell=None, cut=("--cut", "bore")):
    """Status and lines of the conformance command beside a driver."""
    with running(sys.executable, *words, folder=folder) as process:
        command = [BINARY, "conformance", "--cell", cell or own_cell(folder), *cut]
        told = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=2 * PATIENCE, env=with_keys(folder)
        )
        assert process.process.poll() is None, process.lines
    assert not told.stderr or "attachment" in told.stderr, told.stderr
    return told.returncode, told.stdout.splitlines()


def the_template_conforms(folder):
    code, lines = conformance(folder, ROOT / "templates" / "driver.py")
    assert code == 0 and not any(line.startswith("WRONG") for line in lines), (code, lines)


def a_template_conforms(folder, name):
    """The one in Rust over Zenoh and over DDS, and the one in Python over Cyclone DDS."""
    program = [pathlib.Path(BINARY).parent / "examples" / "driver_template"]
    transport = "zenoh" if name == "zenoh" else "dds"
    cell = own_cell(folder)
    cell.write_text(cell.read_text() + f'\n[bus]\ntransport = "{transport}"\n')
    command = [BINARY, "conformance", "--cell", cell, "--cut", "bore", "--wait", "30"]
    if transport == "dds":
        words = [sys.executable, HERE / "cyclone.py"] if name == "cyclone" else [*program, "dds"]
        with running(*words, folder=folder):
            told = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=2 * PATIENCE, env=with_keys(folder)
        )
    else:
        # It joins a router that is there.
        with running(BINARY, "router", "--strangers", "write", folder=folder) as router:
            router.says("listens on")
            with running(*program, folder=folder):
                told = subprocess.run(
                    command, cwd=folder, capture_output=True, text=True, timeout=2 * PATIENCE, env=with_keys(folder)
                )
            assert router.process.poll() is None, router.lines
    assert told.returncode == 0 and "WRONG" not in told.stdout, (told.stdout, told.stderr)


def a_fault_is_named(folder, fault):
    # Six touches are enough for any of them.
    cell = own_cell(folder)
    text = cell.read_text().replace(", [0.0, -25.0, 0.0]]", "]")
    text = text.replace("[0.0, 72.0, 144.0, 216.0, 288.0]", "[0.0, 120.0, 240.0]").replace("[-5.0, -10.0]", "[-5.0]")
    cell.write_text(text)
    code, lines = conformance(folder, HERE / "faulty.py", "--fault", fault, cell=cell, cut=())
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
    wanted = sys.argv[2:] or ["part", "secured", "conformance", "zenoh", "dds", "cyclone", *faulty.LINES]
    for name in wanted:
        checks = {"part": [parts_end_to_end], "conformance": [nobody_is_there, the_template_conforms]}
        checks["secured"] = [a_secured_cell_knows_its_driver]
        checks |= {one: [lambda folder: a_template_conforms(folder, name)] for one in ("zenoh", "dds", "cyclone")}
        for check in checks.get(name, [lambda folder: a_fault_is_named(folder, name)]):
            with tempfile.TemporaryDirectory() as folder:
                check(pathlib.Path(folder))
        print(f"{name}: good", flush=True)


if __name__ == "__main__":
    BINARY = str(pathlib.Path(sys.argv[1]).resolve())
    main()
