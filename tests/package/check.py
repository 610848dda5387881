#!/usr/bin/env python3
"""The package in a fresh Debian: installed, run, upgraded, removed (check.sh builds the packages and the tree).

    check.py TREE FOLDER OLD.deb NEW.deb [systemd|runner]

TREE is an archive (tar), unpacked below FOLDER for each way. `systemd`: it is process 1 of it, and the units are started with systemctl. `runner`: it is not, and
this program reads the installed unit and executes what it says: ExecStartPre, ExecStart, User, WorkingDirectory, UMask, StateDirectory,
EnvironmentFile, NoNewPrivileges, KillMode=mixed; nothing of the sandbox besides. Without a word systemd is taken if it comes up.
"""

import contextlib
import hashlib
import pathlib
import re
import signal
import subprocess
import sys

from ways import KEPT, Runner, Systemd  # and where to find `kit`
from kit import until

CELL = "/etc/probecell/turn_mill.toml"
RECORDINGS = f"{KEPT}/recordings"
CELL_UNIT, DASHBOARD, ROUTER = "probecell-cell@turn_mill", "probecell-dashboard", "probecell-router"
# Points of 10, 0 is confined; `systemd-analyze security` calls up to 2 "ok". What is left is the network.
MOST_EXPOSED = 2.0


def good(text):
    print(f"good    {text}", flush=True)


def sums(debian, *folders):
    """Check sums of all files below folders, with their rights and owner."""
    found = {}
    for folder in folders:
        for path in sorted(debian.path(folder).rglob("*")):
            if path.is_file() and not path.is_symlink():
                status = path.stat()
                found[str(path)] = (hashlib.sha256(path.read_bytes()).hexdigest(), oct(status.st_mode), status.st_uid)
    return found


def recordings(debian):
    return sorted(path.name for path in debian.path(RECORDINGS).iterdir())


def probecell(debian, *words):
    return debian.run("probecell", *words, user="probecell")


def check_installed(debian):
    owner = debian.run("stat", "--format=%U:%G %a", KEPT, RECORDINGS).split("\n")
    assert owner[:2] == ["probecell:probecell 750"] * 2, owner
    assert not debian.path("/etc/systemd/system/multi-user.target.wants/probecell-dashboard.service").exists()
    units = sorted(debian.path("/usr/lib/systemd/system").glob("probecell-*.service"))
    # Of a template one that is there.
    names = [f"/usr/lib/systemd/system/{path.name}".replace("@.", "@turn_mill.") for path in units]
    text = debian.run("systemd-analyze", "verify", "--man=no", *names)
    assert "probecell" not in text, text
    for name in names:
        text = debian.run("systemd-analyze", "security", "--offline=true", "--no-pager", name)
        (level,) = re.findall(r"Overall exposure level for \S+: ([\d.]+)", text)
        assert float(level) <= MOST_EXPOSED, text
        good(f"{pathlib.Path(name).name}: taken by systemd-analyze, exposure {level} of 10")
    for page in ("probecell.1.gz", "probecell-up.1.gz", "probecell-dashboard.1.gz", "probecell-router.1.gz"):
        assert ".TH" in debian.run("zcat", f"/usr/share/man/man1/{page}")
    debian.run("bash", "-n", "/usr/share/bash-completion/completions/probecell")
    for file in ("zsh/vendor-completions/_probecell", "fish/vendor_completions.d/probecell.fish", "doc/probecell/copyright",
                 "doc/probecell/changelog.Debian.gz"):
        assert debian.path(f"/usr/share/{file}").stat().st_size > 0
    listed = set(debian.path("/var/lib/dpkg/info/probecell.conffiles").read_text().split())
    assert listed == {CELL, CELL.replace(".toml", ".urdf"), "/etc/default/probecell-dashboard", "/etc/default/probecell-router"}, listed
    good("installed: nothing runs, the folder of recordings and keys is closed to others, man pages and completions are there")


def check_first_parts(way):
    """A part with corrections that the policy approves, and one in whose middle the unit is stopped."""
    debian = way.debian
    cell = way.started(CELL_UNIT)
    cell.says("turn_mill is ready")
    way.started(DASHBOARD).says("dashboard: http://127.0.0.1:7480/")
    way.started(ROUTER).says("listens on tcp/127.0.0.1:7448")
    status = debian.run("cat", f"/proc/{inner(debian, way.process(CELL_UNIT))}/status")
    assert re.search(r"^NoNewPrivs:\t1$", status, re.MULTILINE) and re.search(r"^CapEff:\t0+$", status, re.MULTILINE), status
    who = debian.run("stat", "--format=%U", f"/proc/{inner(debian, way.process(CELL_UNIT))}").strip()
    assert who == "probecell", who
    refused, text = debian.ask("probecell", "run", "punch", "--cell", CELL, user="nobody")
    assert refused != 0 and "accepted" not in text, text
    good(f"another user is refused: {text.strip().splitlines()[-1]}")

    probecell(debian, "run", "punch", "--cell", CELL)
    cell.says("approved by policy")
    report = cell.says("^part punch: ")
    assert report.startswith("part punch: qualified"), report
    good(report)
    hall = debian.get("http://127.0.0.1:7480/")
    page = debian.get("http://127.0.0.1:7480/cell/turn_mill")
    assert "turn_mill" in hall and "D1" in page
    good("the dashboard shows the cell and the sizes of its part on loopback")

    probecell(debian, "run", "second", "--cell", CELL)
    until("the second part", lambda: "part: second" in probecell(debian, "status", "--cell", CELL))
    result = way.stop(CELL_UNIT)
    assert result == "success", result
    report = cell.says("^part second: ")
    assert report.startswith("part second: stopped"), report
    folder = cell.says(f"^recorded in {RECORDINGS}/").removeprefix("recorded in ")
    good(f"stopped in the middle of a part: {report}")
    assert recordings(debian) == [pathlib.Path(folder).name]
    check_recording(debian, folder, ["punch", "second"])
    # Status 1: a cell needs attention.
    text = debian.ask("probecell", "watch", "--once", "--connect", "tcp/127.0.0.1:7448", user="probecell")[1]
    assert "turn_mill" in text and "kept" in text, text
    good("the router keeps the last state of the cell that is gone")
    return folder


def inner(debian, process):
    """The number of a process in the tree, of one that was named by either side."""
    path = pathlib.Path(f"/proc/{process}/status")
    if path.exists():
        numbers = re.search(r"^NSpid:\s+(.*)$", path.read_text(), re.MULTILINE)[1].split()
        if len(numbers) > 1:
            return int(numbers[-1])
    return process


def check_recording(debian, folder, parts):
    text = probecell(debian, "info", folder, "--verify")
    assert "nothing was changed since" in text and "damage" not in text, text
    replayed = probecell(debian, "replay", folder)
    report = probecell(debian, "report", folder)
    assert all(part in report for part in parts), report
    good(f"{pathlib.Path(folder).name}: sealed and whole; {replayed.strip().splitlines()[-1]}")


def check_wrong_cell(way):
    """A wrong cell file takes neither the dashboard nor the computer's time."""
    debian = way.debian
    debian.path("/etc/probecell/broken.toml").write_text('[cell]\nname = "broken"\n')
    text = way.fails("probecell-cell@broken")
    (sentence,) = set(re.findall(r"^probecell: (/etc/probecell/broken.toml.*)$", text, re.MULTILINE))
    good(f"a wrong cell file fails once: {sentence}")
    way.stop(DASHBOARD)
    dashboard = way.started(DASHBOARD)
    dashboard.says("/etc/probecell/broken.toml is left out")
    dashboard.says("dashboard: http://127.0.0.1:7480/")
    assert "turn_mill" in debian.get("http://127.0.0.1:7480/sessions")
    good("the dashboard leaves it out and serves the others")


def edit(debian, path, before, after):
    file = debian.path(path)
    text = file.read_text()
    assert text.count(before) == 1, f"{path}: {before!r}"
    file.write_text(text.replace(before, after))


def check_upgrade(way, new, first):
    """What a cell has, and what was edited, is there and valid after the upgrade, and what ran runs."""
    debian = way.debian
    edit(debian, CELL, "automatic_approval = true", "automatic_approval = false")
    edit(debian, "/etc/default/probecell-dashboard", 'PROBECELL_DASHBOARD=""', 'PROBECELL_DASHBOARD="--listen 127.0.0.1:7490"')
    probecell(debian, "key", "new", "ada", "--cell", CELL)
    cell = way.started(CELL_UNIT)
    cell.says("turn_mill is ready")
    (running,) = set(recordings(debian)) - {pathlib.Path(first).name}
    kept = sums(debian, f"{KEPT}/.config", first, "/etc/probecell")
    keys = probecell(debian, "key", "list", "--cell", CELL)
    # A part was stopped before. This one waits for an approval until the upgrade ends it.
    probecell(debian, "orders", "resume", "--cell", CELL)
    probecell(debian, "run", "interrupted", "--cell", CELL)
    cell.says("waits for approval")
    before = {unit: way.process(unit) for unit in (CELL_UNIT, ROUTER, DASHBOARD)}

    debian.offer(new)
    text = debian.run("apt-get", "-q", "-y", "upgrade")
    version = debian.run("dpkg-query", "--show", "--showformat=${Version}", "probecell")
    assert version == "0.1.1~test-1", text
    for unit, process in before.items():
        way.after_upgrade(unit, process)
    report = cell.says("^part interrupted: ")
    assert report.startswith("part interrupted: stopped"), report
    cell.says(rf"^recorded in {RECORDINGS}/{running}$")
    cell = way.followers[CELL_UNIT]
    cell.says("turn_mill is ready")
    program = debian.run("readlink", f"/proc/{inner(debian, way.process(CELL_UNIT))}/exe").strip()
    assert program == "/usr/bin/probecell", program
    good(f"apt upgrade: 0.1.0-1 to 0.1.1~test-1; the three units run, of the new program; {report}")

    assert sums(debian, f"{KEPT}/.config", first, "/etc/probecell") == kept
    assert probecell(debian, "key", "list", "--cell", CELL) == keys
    check_recording(debian, first, ["punch", "second"])
    check_recording(debian, f"{RECORDINGS}/{running}", ["interrupted"])
    way.followers[DASHBOARD].says("dashboard: http://127.0.0.1:7490/")
    assert "turn_mill" in debian.get("http://127.0.0.1:7490/")
    good("keys, recordings and edited files are as they were")

    probecell(debian, "orders", "resume", "--cell", CELL)
    probecell(debian, "run", "third", "--cell", CELL)
    approved = 0
    while found := re.search(r"approve (\S+)", report := cell.says("waits for approval: |^part third: ")):
        probecell(debian, "approve", found[1], "--operator", "ada", "--cell", CELL)
        approved += 1
    assert report.startswith("part third: qualified") and approved > 0, report
    good(f"{report}; {approved} corrections signed with a key from before the upgrade")


def check_changed_conffile(way, new, folder):
    """The next package has another cell: the edited one stays, that of the package lies beside it."""
    debian = way.debian
    unpacked = folder / "next"
    subprocess.run(["dpkg-deb", "--raw-extract", new, unpacked], check=True)
    control, cell = unpacked / "DEBIAN/control", unpacked / CELL.lstrip("/")
    control.write_text(control.read_text().replace("0.1.1~test-1", "0.1.2~test-1"))
    cell.write_text(cell.read_text().replace("max_corrections = 5", "max_corrections = 4"))
    package = folder / "probecell_0.1.2~test-1_amd64.deb"
    subprocess.run(["dpkg-deb", "-Zgzip", "--root-owner-group", "--build", unpacked, package], check=True, stdout=subprocess.DEVNULL)
    mine, process = debian.path(CELL).read_text(), way.process(CELL_UNIT)
    debian.offer(package)
    debian.run("apt-get", "-q", "-y", "-o", "Dpkg::Options::=--force-confold", "upgrade")
    way.after_upgrade(CELL_UNIT, process)
    way.followers[CELL_UNIT].says("turn_mill is ready")
    assert debian.path(CELL).read_text() == mine
    assert "max_corrections = 4" in debian.path(f"{CELL}.dpkg-dist").read_text()
    good("a package with another cell file: the edited one stays, the other lies beside it as .dpkg-dist")


def check_removed(way):
    debian = way.debian
    cell = way.followers[CELL_UNIT]
    open_one = recordings(debian)[-1] # closed by the end of the unit
    if way.name == "runner":
        for unit in (CELL_UNIT, DASHBOARD, ROUTER):
            way.stop(unit)
    kept = {path: one for path, one in sums(debian, f"{KEPT}/.config", RECORDINGS).items() if open_one not in path}
    debian.run("apt-get", "-q", "-y", "remove", "probecell")
    cell.says(rf"^recorded in {RECORDINGS}/{open_one}$")
    assert not any(way.is_active(unit) for unit in (CELL_UNIT, DASHBOARD, ROUTER))
    assert not debian.path("/usr/bin/probecell").exists() and debian.path(CELL).exists()
    now = sums(debian, f"{KEPT}/.config", RECORDINGS)
    assert {path: now.get(path) for path in kept} == kept
    good("apt remove: nothing runs, settings, recordings and keys stay")

    text = debian.run("apt-get", "-q", "-y", "purge", "probecell")
    (said,) = re.findall(r"^probecell: (.*)$", text, re.MULTILINE)
    assert not debian.path("/etc/probecell").exists() and not debian.path("/etc/default/probecell-router").exists()
    assert not list(debian.path("/etc/systemd/system").rglob("probecell*"))
    assert sums(debian, f"{KEPT}/.config", RECORDINGS) == now
    good(f"apt purge: /etc/probecell is gone; {said}")


def check(way, old, new, folder):
    debian = way.debian
    debian.offer(old)
    text = debian.run("apt-get", "-q", "-y", "install", "probecell")
    assert "nothing runs yet" in text, text
    check_installed(debian)
    first = check_first_parts(way)
    check_wrong_cell(way)
    check_upgrade(way, new, first)
    check_changed_conffile(way, new, folder)
    check_removed(way)


def main():
    tree, folder, old, new = map(pathlib.Path, sys.argv[1:5])
    wanted = sys.argv[5] if len(sys.argv) > 5 else None
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("ended by SIGTERM"))
    assert wanted in (None, "systemd", "runner"), f"{wanted!r}: systemd or runner"
    way = Systemd.that_comes_up(tree, folder / "systemd") if wanted != "runner" else None
    assert way or wanted != "systemd", "systemd does not come up as process 1 of a namespace here"
    if way:
        print("way: the units run under systemd, process 1 of namespaces of its own", flush=True)
    else:
        way = Runner(tree, folder / "runner")
        print("way: no systemd; a runner does what the installed units say of command, user, folders and end, and not their sandbox", flush=True)
    try:
        check(way, old, new, folder)
    except BaseException:
        with contextlib.suppress(Exception):
            if way.name == "systemd":
                print(way.debian.ask("journalctl", "--no-pager", "--lines=60", "--unit=probecell-*")[1])
        way.debian.end()
        raise
    way.end()


if __name__ == "__main__":
    main()
