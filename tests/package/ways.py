"""A Debian in namespaces of its own, and two ways of starting the units of a package in it."""

import contextlib
import os
import pathlib
import re
import shlex
import shutil
import signal
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
import kit  # noqa: E402
from kit import until  # noqa: E402

KEPT = "/var/lib/probecell"


class Debian:
    """The tree, with a process 1 in namespaces of its own."""

    def __init__(self, tree, folder, init):
        self.root = folder
        folder.mkdir()
        subprocess.run(["tar", "-C", folder, "-xpf", tree, "--numeric-owner"], check=True)
        archive = folder / "srv/packages"
        archive.mkdir()
        for sources in [*folder.glob("etc/apt/sources.list.d/*"), folder / "etc/apt/sources.list"]:
            sources.unlink(missing_ok=True)
        (folder / "etc/apt/sources.list").write_text("deb [trusted=yes] file:/srv/packages ./\n")
        # It ends with this program, however that ends.
        self.outer = kit.Process("setpriv", "--pdeathsig=KILL", "unshare", "--mount", "--propagation", "private", "bash", HERE / "boot.sh", folder, *init)
        try:
            self.outer.says("^inside$")
            self.init = self.child(self.child(self.outer.pid))
        except BaseException:
            self.outer.kill()
            self.outer.ended()
            raise

    def child(self, process):
        """Its only child."""
        path = pathlib.Path(f"/proc/{process}/task/{process}/children")
        # Read once for the last time after it has ended.
        found = until("the child of a process", lambda: not path.exists() or path.read_text().split())
        assert found is not True and len(found) == 1, f"{process} has no child: {self.outer.lines[-5:]}"
        return int(found[0])

    def words(self, *words, user=None):
        """The command as somebody in the tree; as `sudo -u USER` would do it, where the user has a home."""
        name = user or "root"
        home = KEPT if user == "probecell" else f"/{name}"
        clean = ["env", "-i", f"HOME={home}", f"USER={name}", "PATH=/usr/sbin:/usr/bin:/sbin:/bin", "LC_ALL=C.UTF-8", "DEBIAN_FRONTEND=noninteractive"]
        become = ["setpriv", f"--reuid={user}", f"--regid={user}" if user == "probecell" else "--regid=nogroup", "--init-groups"] if user else []
        enter = ["nsenter", f"--target={self.init}", "--mount", "--pid", "--net", "--uts", "--ipc", "--cgroup", "--root", "--wd=/"]
        return [*enter, *clean, *become, *map(str, words)]

    def ask(self, *words, user=None):
        """Status, and what is printed."""
        status, output, errors = kit.run(*self.words(*words, user=user))
        return status, output + errors

    def run(self, *words, user=None):
        status, text = self.ask(*words, user=user)
        assert status == 0, f"{shlex.join(map(str, words))}: status {status}:\n{text}"
        return text

    def path(self, path):
        return self.root / path.lstrip("/")

    def offer(self, package):
        """Puts a package on the list of the archive that apt has."""
        archive = self.path("/srv/packages")
        shutil.copy(package, archive)
        with open(archive / "Packages", "w") as listed:
            subprocess.run(["dpkg-scanpackages", "--multiversion", "."], cwd=archive, stdout=listed, stderr=subprocess.DEVNULL, check=True)
        self.run("apt-get", "-q", "update")

    def get(self, url):
        """A page that something in the tree serves on its loopback."""
        program = "import sys, urllib.request; print(urllib.request.urlopen(sys.argv[1], timeout=60).read().decode())"
        status, page, errors = kit.run("nsenter", f"--target={self.init}", "--net", sys.executable, "-c", program, url)
        assert status == 0, f"{url}: {errors}"
        return page

    def end(self):
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.init, signal.SIGKILL)
        self.outer.ended()


class Systemd:
    """Units, started by systemd."""

    name = "systemd"

    def __init__(self, tree, folder):
        self.debian = Debian(tree, folder, ["/lib/systemd/systemd"])
        self.followers = {}

    @classmethod
    def that_comes_up(cls, tree, folder):
        """Waits until systemd has started what it starts; none where it does not, and why."""
        try:
            way = cls(tree, folder)
        except AssertionError as error:
            print(f"systemd is no process 1 here: {error}", flush=True)
            return None
        said = ""

        def settled():
            nonlocal said
            ended = way.debian.outer.code is not None
            said = "gone" if ended else way.debian.ask("systemctl", "is-system-running")[1].strip()
            return ended or said in ("running", "degraded", "maintenance")

        try:
            until("systemd", settled)
        except kit.Late as error:
            print(error)
        print(f"systemd is {said!r}", flush=True)
        if said in ("running", "degraded"):
            return way
        print("\n".join(way.debian.outer.lines[-5:]), flush=True)
        way.debian.end()
        return None

    def started(self, unit):
        """Enabled and started; gives what it says from here on, also after it was restarted."""
        now = self.debian.run("journalctl", "--quiet", "--lines=0", "--show-cursor").rpartition("cursor: ")[2].strip()
        self.debian.run("systemctl", "enable", "--quiet", "--now", unit)
        words = ["journalctl", "--follow", "--lines=all", "--output=cat", f"--unit={unit}", f"--after-cursor={now}"]
        self.followers[unit] = kit.Process(*self.debian.words(*words))
        return self.followers[unit]

    def stop(self, unit):
        """Stops it; gives its result."""
        self.debian.run("systemctl", "stop", unit)
        return self.show(unit, "Result")

    def show(self, unit, name):
        return self.debian.run("systemctl", "show", "--property", name, "--value", unit).strip()

    def process(self, unit):
        return int(self.show(unit, "MainPID"))

    def is_active(self, unit):
        return self.show(unit, "ActiveState") == "active"

    def after_upgrade(self, unit, before):
        """The maintainer script has restarted it."""
        assert self.is_active(unit) and self.process(unit) != before, f"{unit} was not restarted"

    def fails(self, unit):
        """Starts a unit that ends with status 2, and is not started again."""
        self.debian.run("systemctl", "start", unit)
        until(f"{unit} has failed", lambda: self.show(unit, "ActiveState") == "failed")
        assert self.show(unit, "ExecMainStatus") == "2" and self.show(unit, "NRestarts") == "0"
        journal = ["journalctl", "--output=cat", f"--unit={unit}"]
        return until("what it said", lambda: re.search("(?s).*INVALIDARGUMENT.*", self.debian.run(*journal)))[0]

    def end(self):
        """The package is removed, and with it what ran."""
        for follower in self.followers.values():
            follower.kill()
        self.debian.end()


class Runner:
    """Units, of which this program does what it knows, and refuses to go past what it does not understand of a command line."""

    name = "runner"

    def __init__(self, tree, folder):
        self.debian = Debian(tree, folder, ["/usr/bin/tail", "-f", "/dev/null"])
        self.followers = {}

    def settings(self, unit):
        """Values of a unit with its drop-ins, in order; an empty one takes away those before."""
        name, _, instance = unit.partition("@")
        folder = self.debian.path("/usr/lib/systemd/system")
        files = [folder / (f"{name}@.service" if instance else f"{name}.service")]
        files += sorted((folder / f"{name.partition('-')[0]}-.service.d").glob("*.conf"))
        found = {}
        for line in "\n".join(file.read_text() for file in files).splitlines():
            if "=" in line and not line.startswith("#"):
                key, _, value = line.partition("=")
                value = value.replace("%i", instance)
                found[key] = found.get(key, []) + [value] if value else []
        return found

    def started(self, unit):
        """Gives what it says."""
        settings = self.settings(unit)
        assert settings["KillMode"] == ["mixed"] if "@" in unit else True
        (user,), (folder,), (mask,) = settings["User"], settings["WorkingDirectory"], settings["UMask"]
        for name in " ".join(settings.get("StateDirectory", [])).split():
            self.debian.run("install", "-d", "-o", user, "-g", user, "-m", settings["StateDirectoryMode"][0], f"/var/lib/{name}")
        variables = {}
        for file in settings.get("EnvironmentFile", []):
            for line in self.debian.path(file.lstrip("-")).read_text().splitlines():
                if line and not line.startswith("#"):
                    variables.update([shlex.split(line)[0].split("=", 1)])
        assert settings["NoNewPrivileges"] == ["yes"]
        wrapped = ["setpriv", "--no-new-privs", "sh", "-c", f'cd {folder} && umask {mask} && exec "$@"', "unit"]
        wrapped = ["env", *(f"{key}={value}" for key, value in variables.items()), *wrapped]
        for command in settings.get("ExecStartPre", []):
            status, text = self.debian.ask(*wrapped, *command.lstrip("-").split(), user=user)
            assert status == 0 or command.startswith("-"), text
        words = settings["ExecStart"][0].split()
        words = [part for word in words for part in (shlex.split(variables[word[1:]]) if word.startswith("$") else [word])]
        self.followers[unit] = kit.Process(*self.debian.words(*wrapped, *words, user=user), start_new_session=True)
        return self.followers[unit]

    def stop(self, unit):
        # nsenter has made the process inside its child, and hands its status on.
        os.kill(self.process(unit), signal.SIGTERM)
        return "success" if self.followers[unit].ended()[0] == 0 else "exit-code"

    def process(self, unit):
        return self.debian.child(self.followers[unit].pid)

    def is_active(self, unit):
        return unit in self.followers and self.followers[unit].code is None

    def after_upgrade(self, unit, before):
        """Nothing restarts it here but this."""
        self.stop(unit)
        self.started(unit)

    def fails(self, unit):
        status, text, _ = self.started(unit).ended()
        assert status == 2
        return text

    def end(self):
        for unit in [unit for unit in self.followers if self.is_active(unit)]:
            self.stop(unit)
        self.debian.end()
