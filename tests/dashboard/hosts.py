#!/usr/bin/env python3
"""Three live cells on two hosts in a browser: one beside the dashboard, two behind the router of another host, of which one is
on LinuxCNC where it is there.

    hosts.py PROBECELL FOLDER

The hosts are network namespaces, joined by a cable (veth); this process is on the first. Figures are printed, not judged, except for
what the dashboard promises in seconds: a killed cell is stale within 3 s.
"""

import atexit
import contextlib
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import time

from kit import ADDRESS, ROOT, Browser, Cable, Process, axe, cell_file, metric, until, wait
from playwright.sync_api import sync_playwright

HERE, THERE = "10.78.0.1", "10.78.0.2"
ROUTER_HERE, ROUTER_THERE = "tcp/127.0.0.1:7447", f"tcp/{THERE}:7447"
LINUXCNC = ROOT / "tests" / "interop" / "linuxcnc"
CUT = 30  # s
STALE = 3  # s, docs/dashboard.md

# Between a touch, by its stamp, and its being on the page, ms.
DELAYS = """() => { window.delays = []; new MutationObserver(() => {
    const at = Number(document.querySelector('#part .newest')?.dataset.made);
    if (at && at !== window.last) { window.last = at; window.delays.push(Date.now() - at); }
}).observe(document.querySelector('.cards'), { childList: true, subtree: true }); }"""


class Host:
    """Another computer: a network of its own, with one cable to this one."""

    def __init__(self):
        self.holder = subprocess.Popen(["unshare", "-n", "-i", "cat"], stdin=subprocess.PIPE)
        atexit.register(self.holder.kill)
        pid = self.holder.pid
        self.inside = ["nsenter", "-t", str(pid), "-n", "-i", "--"]
        own = os.readlink("/proc/self/ns/net")
        until("a second host", lambda: os.readlink(f"/proc/{pid}/ns/net") != own)
        ip = lambda *words, there=False: subprocess.run([*(self.inside if there else []), "ip", *words], check=True)
        ip("link", "add", "cable", "type", "veth", "peer", "name", "cable", "netns", str(pid))
        for address, there in ((HERE, False), (THERE, True)):
            ip("link", "set", "lo", "up", there=there)
            ip("address", "add", f"{address}/24", "dev", "cable", there=there)
            ip("link", "set", "cable", "up", there=there)
        self.ip = ip

    def plug(self, state):
        """`up` or `down`."""
        self.ip("link", "set", "cable", state)


class LinuxCnc:
    """A controller on that host, with a cell that cuts and measures a bore; none where the simulated machine is not there."""

    def __init__(self, host, folder, ending):
        self.host, self.scratch = host, folder / "linuxcnc"
        status = subprocess.run([LINUXCNC / "install.sh"]).returncode
        self.there = status != 77
        if not self.there:
            return
        assert status == 0
        self.run("bore_cell.sh")
        ending.callback(self.run, "stop.sh")
        self.run("start.sh")
        for pin, value in (("motion.analog-out-00", 24.98), ("ommprobe.0.artefact", 2), ("ommprobe.0.ball-r", 2.995)):
            # The first is already driven where a program has set it.
            subprocess.run([*host.inside, "halcmd", "setp", pin, str(value)], check=pin.startswith("ommprobe"))
        self.cell = self.scratch / "bore.toml"
        text = self.cell.read_text()
        assert "[bus]" not in text
        self.cell.write_text(f'[bus]\nrouter_endpoint = "{ROUTER_THERE}"\n\n{text}')

    def run(self, script):
        subprocess.run([*self.host.inside, LINUXCNC / script, self.scratch], check=True)


def tile(cell):
    return f"(document.querySelector('#tile-{cell}')?.innerText ?? '')"


def appear(hall, folder, there, host, ending):
    """Three cells start and are on the page that was open before; gives their names and processes."""
    linuxcnc = LinuxCnc(host, there, ending)
    a = cell_file(folder, "mill_a")
    b = cell_file(there, "mill_b", router=("tcp/127.0.0.1:7447", ROUTER_THERE))
    c = linuxcnc.cell if linuxcnc.there else cell_file(there, "mill_c", router=("tcp/127.0.0.1:7447", ROUTER_THERE))
    c_name = "linuxcnc_bore" if linuxcnc.there else "mill_c"
    dashboard = Process("dashboard", "--connect", ROUTER_HERE, "--connect", ROUTER_THERE, folder=folder)
    dashboard.says(f"dashboard: http://{ADDRESS}/")
    hall.goto(f"http://{ADDRESS}/")
    hall.evaluate("window.sameDocument = true")
    wait(hall, "document.getElementById('bus').innerText.includes('No router answers')")
    told = axe(hall)
    assert not told, told
    cells = {"mill_a": Process("up", a, "--no-dashboard", folder=folder)}
    hall.wait_for_selector("#tile-mill_a")
    assert hall.locator(".tile").count() == 1
    cells["mill_b"] = Process("up", b, "--no-dashboard", folder=there, host=host)
    hall.wait_for_selector("#tile-mill_b")
    cells[c_name] = Process("up", c, "--no-dashboard", folder=there, host=host)
    hall.wait_for_selector(f"#tile-{c_name}")
    assert hall.evaluate("window.sameDocument") and hall.locator(".tile").count() == 3
    for one in cells.values():
        one.says("is ready")
    print(f"hall: {', '.join(cells)} appeared by themselves, the last two behind the router of another host")
    return {"mill_a": a, "mill_b": b, c_name: c}, cells


def parts(browser, hall, files, folder, there, host, cable):
    """A part on each at once; touches come to the pages, verdicts to the tiles; a page is cut off for half a minute."""
    far = [name for name in files if name != "mill_a"]
    names = {"mill_a": "punch_a", "mill_b": "punch_b", far[-1]: "bore_c"}
    with browser.page() as near, browser.page("800", "dark") as one, browser.page("390") as other:
        pages = {"mill_a": near, far[0]: one, far[1]: other}
        for name, page in pages.items():
            page.goto(f"{cable.address if name == 'mill_a' else f'http://{ADDRESS}'}/cell/{name}")
            page.evaluate(DELAYS)
        asked = [Process("run", names[name], "--cell", file, folder=folder if name == "mill_a" else there, host=None if name == "mill_a" else host) for name, file in files.items()]
        ended = lambda name: wait(hall, f"/{names[name]}, (qualified|measured only|stopped|scrap)/.test({tile(name)})")
        for name, page in pages.items():
            wait(hall, f"{tile(name)}.includes('{names[name]}')")
            wait(page, "document.querySelectorAll('#part g.touch').length >= 5")
            told = axe(page)
            assert not told, told
        for name in files:
            wait(hall, f"!!document.querySelector('#tile-{name} .verdict')")
        print("hall: a verdict changed each tile")

        for name, page in pages.items():
            delays = sorted(page.evaluate("window.delays"))
            print(f"{name}: {len(delays)} touches came to the page, ms from the touch: median {delays[len(delays) // 2]}, most {delays[-1]}")

        # What happened during the cut is told by number and kind. The part before may have ended: the next one is just begun. A page that
        # says its name has seen all touches of the part before it; how many of its own, this process cannot know.
        ended("mill_a")
        names["mill_a"] = "next_a"
        told_at = lambda: metric("cell_touches_total", "mill_a")
        before = told_at()
        asked.append(Process("run", names["mill_a"], "--cell", files["mill_a"], folder=folder))
        until("touches of the next part", lambda: told_at() > before)
        wait(near, "document.querySelector('main').innerText.includes('next_a')")
        cable.cut()
        begun = time.monotonic()
        after = told_at()
        wait(near, "document.getElementById('link').classList.contains('cut')")
        told = axe(near)
        assert not told, told
        until(f"{CUT} s without a connection", lambda: time.monotonic() - begun >= CUT)
        until("touches during the cut", lambda: told_at() > after)
        least = told_at() - after
        cable.mend()
        near.wait_for_selector("#notice:not([hidden])")
        most = told_at() - before
        notice = near.inner_text("#notice").replace("\n", " ")
        seconds, touches = int(re.search(r"cut for (\d+) s", notice).group(1)), int(re.search(r"(\d+) touch", notice).group(1))
        assert seconds >= CUT and least <= touches <= most, (notice, least, most)
        told = axe(near)
        assert not told, told
        wait(near, "document.getElementById('link').textContent === 'Live'")
        print("cell: after a cut:", notice)

        for name in files:
            ended(name)
        for one in asked:
            one.end()


def lost(browser, hall, cells, host):
    """A cell that is killed, and a host that is cut off, are stale within the promised time."""
    last = list(cells)[-1]
    cells[last].process.kill()
    begun = time.monotonic()
    wait(hall, f"{tile(last)}.includes('silent')")
    killed = time.monotonic() - begun
    assert killed <= STALE, killed
    wait(hall, f"{tile('mill_b')} && !{tile('mill_b')}.includes('silent')")
    host.plug("down")
    begun = time.monotonic()
    wait(hall, f"{tile('mill_b')}.includes('silent')")
    cut = time.monotonic() - begun
    assert cut <= STALE, cut
    told = axe(hall)
    assert not told, told
    host.plug("up")
    wait(hall, f"{tile('mill_b')} && !{tile('mill_b')}.includes('silent')")
    print(f"hall: a killed cell is stale after {killed:.1f} s, one whose host is cut off after {cut:.1f} s, and that one came back by itself")


def main():
    with tempfile.TemporaryDirectory() as work, contextlib.ExitStack() as ending, sync_playwright() as playwright:
        folder = pathlib.Path(work)
        there = folder / "there"
        there.mkdir()
        host, cable = Host(), Cable()
        chromium = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"] if os.getuid() == 0 else [])
        browser = Browser(chromium)
        with browser.page() as hall:
            files, cells = appear(hall, folder, there, host, ending)
            parts(browser, hall, files, folder, there, host, cable)
            browser.audit("/", "hall_hosts")
            lost(browser, hall, cells, host)
            for one in cells.values():
                one.end()
        own = rf"({re.escape(f'http://{ADDRESS}')}|{re.escape(cable.address)})/"
        foreign = {url for url in browser.requests if not re.match(own, url)}
        assert not foreign, foreign
        assert not browser.errors, browser.errors
        chromium.close()


main()
