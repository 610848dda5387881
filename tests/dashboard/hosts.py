#!/usr/bin/env python3
"""Three live cells on two hosts in a browser: one beside the dashboard, two behind the router of another host, of which one is
on LinuxCNC where it is there.

    hosts.py PROBECELL FOLDER

The hosts are network namespaces, joined by a cable (veth); this process is on the first. Figures are printed, not judged, except for
what the dashboard promises in seconds, as far as the load of the machine leaves it: a killed cell is stale within 3 s.
"""

import contextlib
import os
import re
import shutil
import subprocess
import time

from pages import ADDRESS, ENDS, ROOT, Browser, Line, axe, cell_file, metric, started, wait
from playwright.sync_api import sync_playwright

import kit
from kit import until

ROUTER_HERE = "tcp/127.0.0.1:7447"
LINUXCNC = ROOT / "tests" / "interop" / "linuxcnc"
CUT = 30  # s
STALE = 3  # s, docs/dashboard.md

# Between a touch, by its stamp, and its being on the page, ms.
DELAYS = """() => { window.delays = []; new MutationObserver(() => {
    const at = Number(document.querySelector('#part .newest')?.dataset.made);
    if (at && at !== window.last) { window.last = at; window.delays.push(Date.now() - at); }
}).observe(document.querySelector('.cards'), { childList: true, subtree: true }); }"""


class LinuxCnc:
    """A controller on that host, with a cell that cuts and measures a bore; none where the simulated machine is not there."""

    def __init__(self, host, folder, router, ending):
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
        self.cell.write_text(f'[bus]\nrouter_endpoint = "{router}"\n\n{text}')

    def run(self, script):
        subprocess.run([*self.host.inside, LINUXCNC / script, self.scratch], check=True)


def tile(cell):
    return f"(document.querySelector('#tile-{cell}')?.innerText ?? '')"


def appear(hall, folder, there, host, router_there, ending):
    """Three cells start and are on the page that was open before; gives their names and processes."""
    linuxcnc = LinuxCnc(host, there, router_there, ending)
    a = cell_file(folder, "mill_a")
    b = cell_file(there, "mill_b", router=(ROUTER_HERE, router_there))
    c = linuxcnc.cell if linuxcnc.there else cell_file(there, "mill_c", router=(ROUTER_HERE, router_there))
    c_name = "linuxcnc_bore" if linuxcnc.there else "mill_c"
    dashboard = started("dashboard", "--connect", ROUTER_HERE, "--connect", router_there, folder=folder)
    dashboard.says(f"dashboard: http://{ADDRESS}/")
    hall.goto(f"http://{ADDRESS}/")
    hall.evaluate("window.sameDocument = true")
    wait(hall, "document.getElementById('bus').innerText.includes('No router answers')")
    told = axe(hall)
    assert not told, told
    cells = {"mill_a": started("up", a, "--no-dashboard", folder=folder)}
    hall.wait_for_selector("#tile-mill_a")
    assert hall.locator(".tile").count() == 1
    cells["mill_b"] = started("up", b, "--no-dashboard", folder=there, inside=host.inside)
    hall.wait_for_selector("#tile-mill_b")
    cells[c_name] = started("up", c, "--no-dashboard", folder=there, inside=host.inside)
    hall.wait_for_selector(f"#tile-{c_name}")
    assert hall.evaluate("window.sameDocument") and hall.locator(".tile").count() == 3
    for one in cells.values():
        one.says("is ready")
    print(f"hall: {', '.join(cells)} appeared by themselves, the last two behind the router of another host")
    return {"mill_a": a, "mill_b": b, c_name: c}, cells


def parts(browser, hall, files, folder, there, host, line):
    """A part on each at once; touches come to the pages, verdicts to the tiles; a page is cut off for half a minute."""
    far = [name for name in files if name != "mill_a"]
    names = {"mill_a": "punch_a", "mill_b": "punch_b", far[-1]: "bore_c"}
    with browser.page() as near, browser.page("800", "dark") as one, browser.page("390") as other:
        pages = {"mill_a": near, far[0]: one, far[1]: other}
        for name, page in pages.items():
            page.goto(f"{line.address if name == 'mill_a' else f'http://{ADDRESS}'}/cell/{name}")
            page.evaluate(DELAYS)
        asked = [started("run", names[name], "--cell", file, folder=folder if name == "mill_a" else there, inside=() if name == "mill_a" else host.inside) for name, file in files.items()]
        ended = lambda name: wait(hall, f"/{names[name]}, ({ENDS})/.test({tile(name)})")
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
        asked.append(started("run", names["mill_a"], "--cell", files["mill_a"], folder=folder))
        until("touches of the next part", lambda: told_at() > before)
        wait(near, "document.querySelector('main').innerText.includes('next_a')")
        line.cut()
        after = told_at()
        wait(near, "document.getElementById('link').classList.contains('cut')")
        begun = time.monotonic()
        told = axe(near)
        assert not told, told
        until("touches during the cut", lambda: told_at() > after)
        kit.pause(max(0.0, begun + CUT - time.monotonic()), "the cut")
        least = told_at() - after
        line.mend()
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


def lost(browser, hall, cells, cable):
    """A cell that is killed, and a host that is cut off, are stale within the promised time."""
    last = list(cells)[-1]
    cells[last].kill()
    begun, load = time.monotonic(), kit.Load()
    wait(hall, f"{tile(last)}.includes('silent')")
    killed = time.monotonic() - begun
    assert killed <= load.allows(STALE), (killed, load.allows(STALE))
    wait(hall, f"{tile('mill_b')} && !{tile('mill_b')}.includes('silent')")
    cable.pull()
    begun, load = time.monotonic(), kit.Load()
    wait(hall, f"{tile('mill_b')}.includes('silent')")
    cut = time.monotonic() - begun
    assert cut <= load.allows(STALE), (cut, load.allows(STALE))
    told = axe(hall)
    assert not told, told
    cable.plug()
    wait(hall, f"{tile('mill_b')} && !{tile('mill_b')}.includes('silent')")
    print(f"hall: a killed cell is stale after {killed:.1f} s, one whose host is cut off after {cut:.1f} s, and that one came back by itself; "
          f"{STALE} s are promised, of which the load makes {load.allows(STALE):.1f} s")


def main(folder):
    with contextlib.ExitStack() as ending, sync_playwright() as playwright:
        there = folder / "there"
        there.mkdir()
        host, line = kit.Host(), Line()
        cable = kit.Cable(kit.Host(is_here=True), host)
        chromium = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"] if os.getuid() == 0 else [])
        browser = Browser(chromium)
        with browser.page() as hall:
            files, cells = appear(hall, folder, there, host, f"tcp/{cable.addresses[1]}:7447", ending)
            parts(browser, hall, files, folder, there, host, line)
            browser.audit("/", "hall_hosts")
            lost(browser, hall, cells, cable)
            for one in cells.values():
                one.end()
        own = rf"({re.escape(f'http://{ADDRESS}')}|{re.escape(line.address)})/"
        foreign = {url for url in browser.requests if not re.match(own, url)}
        assert not foreign, foreign
        assert not browser.errors, browser.errors
        chromium.close()


kit.main({"hosts": main})
