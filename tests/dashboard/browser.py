#!/usr/bin/env python3
"""What a person sees of cells and recordings in a browser: Chromium, driven by Playwright, with axe-core.

    browser.py PROBECELL FOLDER

Cells are simulated and real in everything else; nothing waits but for a condition. Figures are printed, not judged. What is
told of recordings is compared with the readable twins beside the samples.
"""

import contextlib
import json
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import urllib.error
import urllib.request

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import sync_playwright

ROOT = pathlib.Path(__file__).resolve().parents[2]
BINARY, PICTURES = sys.argv[1], pathlib.Path(sys.argv[2])
SAMPLES = ROOT / "bags" / "samples"
ADDRESS = "127.0.0.1:7480"
PATIENCE = 120  # s
WIDTHS = {"1400": (1400, 900), "800": (800, 1100), "390": (390, 844)}


def until(what, ready):
    deadline = time.monotonic() + PATIENCE
    while not (found := ready()):
        assert time.monotonic() < deadline, f"{what}: not within {PATIENCE} s"
        time.sleep(0.05)
    return found


def wait(page, condition, argument=None):
    """Until the page fulfils it. Playwright's own way needs eval in the page, which its policy forbids."""
    return until(condition, lambda: page.evaluate(condition, argument))


class Process:
    """A probecell process whose lines are kept."""

    def __init__(self, *words, folder):
        self.lines = []
        self.process = subprocess.Popen(
            [BINARY, *map(str, words)], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, text=True
        )
        self.reader = threading.Thread(target=self.read, daemon=True)
        self.reader.start()

    def read(self):
        for line in self.process.stdout:
            self.lines.append(line.rstrip())

    def says(self, words):
        return until(f"{words!r} in {self.process.args[1:]}", lambda: [line for line in self.lines if words in line])

    def end(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
            self.process.wait(timeout=PATIENCE)


class Cable:
    """A TCP connection to the dashboard that can be cut: the browser's way to it."""

    def __init__(self):
        self.whole, self.open = True, []
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.address = "http://127.0.0.1:%d" % self.listener.getsockname()[1]
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            client, _ = self.listener.accept()
            if not self.whole:
                client.close()
                continue
            host, port = ADDRESS.split(":")
            server = socket.create_connection((host, int(port)))
            self.open += [client, server]
            for one, other in ((client, server), (server, client)):
                threading.Thread(target=self.carry, args=(one, other), daemon=True).start()

    @staticmethod
    def carry(one, other):
        with contextlib.suppress(OSError):
            while block := one.recv(65536):
                other.sendall(block)
        for end in (one, other):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def cut(self):
        self.whole = False
        for end in self.open:
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
        self.open.clear()

    def mend(self):
        self.whole = True


def fetch(path, method="GET"):
    request = urllib.request.Request(f"http://{ADDRESS}{path}", method=method)
    try:
        with urllib.request.urlopen(request) as answer:
            return answer.status, answer.headers, answer.read()
    except urllib.error.HTTPError as error:
        return error.code, error.headers, error.read()


def metric(name, cell):
    text = fetch("/metrics")[2].decode()
    found = re.search(rf'^probecell_{name}{{cell="{cell}"}} (\S+)$', text, re.M)
    return float(found.group(1)) if found else None


def cell_file(folder, name, **changes):
    """A simulated turn-mill of this name, which plans quickly."""
    text = (ROOT / "launch-scripts" / "turn_mill.toml").read_text()
    assert 'name = "turn_mill"' in text and "[path_planning]\n" in text
    text = text.replace('name = "turn_mill"', f'name = "{name}"').replace("[path_planning]\n", "[path_planning]\nkicks = 50\n")
    for old, new in changes.items():
        assert changes[old][0] in text, old
        text = text.replace(*new)
    shutil.copy(ROOT / "launch-scripts" / "turn_mill.urdf", folder)
    path = folder / f"{name}.toml"
    path.write_text(text)
    return path


def twin(sample, topic):
    lines = map(json.loads, (SAMPLES / f"{sample}.jsonl").read_text().splitlines())
    return [(line["at_s"], line["message"]) for line in lines if line.get("topic") == topic]


class Browser:
    """Pages in a scheme of colours and a width; every request is noted."""

    def __init__(self, chromium):
        self.chromium, self.requests, self.errors, self.audited = chromium, [], [], 0

    @contextlib.contextmanager
    def page(self, width="1400", scheme="light", scripts=True, touch=False):
        size = WIDTHS[width]
        context = self.chromium.new_context(
            viewport={"width": size[0], "height": size[1]}, color_scheme=scheme, java_script_enabled=scripts, has_touch=touch, bypass_csp=False
        )
        context.set_default_timeout(PATIENCE * 1000)
        page = context.new_page()
        page.on("request", lambda request: self.requests.append(request.url))
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.on("console", lambda message: self.errors.append(message.text) if "Content Security Policy" in message.text else None)
        try:
            yield page
        finally:
            context.close()

    def audit(self, path, name):
        """No violation of axe-core in both schemes; no scrolling sideways at any width; pictures of all."""
        for scheme in ("light", "dark"):
            for width in WIDTHS:
                with self.page(width, scheme) as page:
                    page.goto(f"http://{ADDRESS}{path}")
                    page.wait_for_selector("main")
                    if page.evaluate("!!document.body.dataset.stream"):
                        wait(page, "document.getElementById('link').textContent === 'Live'")
                    wide = page.evaluate("[document.documentElement.scrollWidth, document.documentElement.clientWidth]")
                    assert wide[0] <= wide[1], f"{path} scrolls sideways at {width} px: {wide}"
                    page.screenshot(path=PICTURES / f"{name}_{width}_{scheme}.png", full_page=True)
                    if width != "800":
                        # The page's own policy forbids foreign scripts: axe runs in the world of the test.
                        told = axe(page)
                        assert not told, f"{path} {width} {scheme}: {json.dumps(told, indent=1)[:4000]}"
                        self.audited += 1


def axe(page):
    results = Axe().run(page).response
    return [
        {"id": one["id"], "help": one["help"], "nodes": [(node["html"][:200], node.get("failureSummary", "")[:300]) for node in one["nodes"][:4]]}
        for one in results["violations"]
    ]


def live_cells(browser, folder, cable):
    a, b = cell_file(folder, "mill_a"), cell_file(folder, "mill_b")
    with browser.page() as hall:
        first = Process("up", a, "--dashboard", folder=folder)
        first.says(f"dashboard: http://{ADDRESS}/")
        hall.goto(f"http://{ADDRESS}/")
        hall.evaluate("window.sameDocument = true")
        hall.wait_for_selector("#tile-mill_a")
        print("hall: the cell that runs is there")
        second = Process("up", b, "--dashboard", folder=folder)
        assert "is in use" in second.says(f"{ADDRESS} is in use")[0]
        hall.wait_for_selector("#tile-mill_b")
        assert hall.evaluate("window.sameDocument"), "the page was loaded again"
        print("hall: a second cell appeared by itself; its own dashboard found the port taken, and it runs")
        for one in (first, second):
            one.says("is ready")

        with browser.page() as cell:
            cell.goto(f"{cable.address}/cell/mill_a")
            cell.evaluate("""() => { window.delays = []; new MutationObserver(() => {
                const at = Number(document.querySelector('#part .newest')?.dataset.at);
                if (at && at !== window.last) { window.last = at; window.delays.push(Date.now() - at); }
            }).observe(document.querySelector('.cards'), { childList: true, subtree: true }); }""")
            asked = Process("run", "punch_1", "--cell", a, folder=folder)
            wait(hall, "document.querySelector('#tile-mill_a').innerText.includes('punch_1')")
            wait(cell, "document.querySelectorAll('#part g.touch').length >= 5")
            print("cell: touches appear as they come; ms from reception to the page:", sorted(cell.evaluate("window.delays")))
            wait(hall, "document.querySelector('#tile-mill_a .verdict')")
            wait(hall, "document.querySelector('#tile-mill_a .verdict').innerText.includes('to be corrected')")
            print("hall: a verdict changed the tile")

            wait(cell, "document.getElementById('link').textContent === 'Live'")
            cable.cut()
            wait(cell, "document.getElementById('link').classList.contains('cut')")
            assert "old" in cell.inner_text("#link")
            before = metric("cell_touches_total", "mill_a")
            until("touches during the cut", lambda: metric("cell_touches_total", "mill_a") >= before + 3)
            cable.mend()
            cell.wait_for_selector("#notice:not([hidden])")
            notice = cell.inner_text("#notice")
            caught = re.search(r"(\d+) touch", notice)
            assert caught and int(caught.group(1)) >= 3, notice
            wait(cell, "document.getElementById('link').textContent === 'Live'")
            print("cell: after a cut:", notice.replace("\n", " "))

        wait(hall, "document.querySelector('#tile-mill_a').innerText.includes('punch_1, qualified')")
        asked.end()
        browser.audit("/", "hall")
        browser.audit("/?wall", "wall")
        browser.audit("/cell/mill_a", "cell")

        with browser.page(scripts=False) as plain:
            plain.goto(f"http://{ADDRESS}/")
            text = plain.inner_text("main")
            assert "mill_a" in text and "punch_1, qualified" in text and "× noise" in text, text
            assert plain.locator("noscript meta[http-equiv=refresh], meta[http-equiv=refresh]").count() == 1
            plain.goto(f"http://{ADDRESS}/cell/mill_a")
            assert "Wear of tool 2" in plain.inner_text("#ledger") and plain.locator("#part svg g.touch").count() == 32
            view = plain.locator("#part svg").inner_html()
            plain.click("#part .turn a[aria-label='Turn left']")
            assert plain.locator("#part svg").inner_html() != view
        print("without scripts: the state is there, renews itself, and the part turns")

        # The tile that needs a person comes first; not while a pointer is over the tiles, but when asked.
        order = lambda: hall.evaluate("[...document.querySelectorAll('.tile')].map((one) => one.id)")
        assert order()[0] in ("tile-mill_a", "tile-mill_b")
        hall.hover("#tile-mill_a")
        held = order()
        begun = time.monotonic()
        second.process.kill()
        wait(hall, "document.querySelector('#tile-mill_b').innerText.includes('silent')")
        print(f"hall: a killed cell is stale after {time.monotonic() - begun:.1f} s")
        hall.wait_for_selector("#resort:not([hidden])")
        assert order() == held, "tiles moved under the pointer"
        hall.mouse.move(2, 2)
        wait(hall, "document.querySelector('.tile').id === 'tile-mill_b'")
        print("hall: tiles stayed under the pointer, and were sorted when it left")
        browser.audit("/", "hall_silent")

        nodes = live_nodes()
        assert nodes and not any("dashboard" in name for name in nodes), nodes
        first.end()
        return folder / "recordings"


def live_nodes():
    """Names of nodes on the bus, by a witness that is not ours."""
    import zenoh

    config = zenoh.Config.from_json5('{ mode: "client", connect: { endpoints: ["tcp/127.0.0.1:7447"] }, scouting: { multicast: { enabled: false } } }')
    with zenoh.open(config) as session:
        tokens = [str(reply.ok.key_expr) for reply in session.liveliness().get("@ros2_lv/**") if reply.ok]
    return {token.split("/")[8] for token in tokens}


def recordings(browser, folder, recorded):
    """Samples, and what the cells above recorded."""
    shown = folder / "shown"
    shown.mkdir()
    for sample in ("punch", "punch_uncalibrated", "ball_check"):
        shutil.copy(SAMPLES / f"{sample}.mcap", shown)
    (folder / "secret.mcap").write_bytes((SAMPLES / "punch.mcap").read_bytes())
    (shown / "linked.mcap").symlink_to(folder / "secret.mcap")
    server = Process("dashboard", "--recordings", shown, "--recordings", recorded, folder=folder)
    server.says("dashboard: http://")
    try:
        with browser.page() as page:
            page.goto(f"http://{ADDRESS}/sessions")
            names = page.locator(".sessions h2").all_inner_texts()
            assert "punch.mcap" in names and any(name.startswith("mill_a_") for name in names) and "linked.mcap" not in names, names
            touches = [at for at, one in twin("punch", "touch_deviations") if one["plan_id"] == "punch/rough/1"]
            page.goto(f"http://{ADDRESS}/session/punch.mcap?t=0")
            page.evaluate("window.sameDocument = true")
            for wanted in (9.0, 12.0, 7.0):
                page.evaluate("(t) => { const slider = document.getElementById('t'); slider.value = t; slider.dispatchEvent(new Event('input', { bubbles: true })); }", wanted)
                told = sum(at <= wanted for at in touches)
                wait(page, "(count) => document.querySelectorAll('#part g.touch').length === count", told)
                assert f"{wanted:.1f} s" in page.inner_text("#instant")
            assert page.evaluate("window.sameDocument")
            print("session: scrubbed forward and back, each time with as many touches as the twin has")
            with page.expect_download() as download:
                page.click(".title .actions a[download]")
            assert pathlib.Path(download.value.path()).read_bytes() == (SAMPLES / "punch.mcap").read_bytes()
            print("session: downloaded byte for byte")
            for kind, words in (("report", "Measurement punch/finish/1"), ("diagnosis", "probe.stylus_offset")):
                page.goto(f"http://{ADDRESS}/session/punch.mcap/{kind}")
                assert words in page.inner_text("body"), kind
        for path in ("/session/..%2f..%2fetc%2fpasswd", "/session/linked.mcap", "/session/%2e%2e", "/session/secret.mcap/mcap/0", "/session/punch.mcap/mcap/7", "/assets/..%2f..%2fCargo.toml"):
            assert fetch(path)[0] == 404, path
        for method in ("POST", "PUT", "DELETE", "PATCH"):
            for path in ("/", "/cell/mill_a", "/sessions", "/metrics"):
                assert fetch(path, method)[0] == 405, (method, path)
        policy = fetch("/sessions")[1]["content-security-policy"]
        assert "default-src 'none'" in policy and "script-src 'self'" in policy and "unsafe" not in policy
        print("folders: neither links nor parents are followed; nothing but GET is answered")
        browser.audit("/sessions", "sessions")
        browser.audit("/session/punch.mcap?t=12", "session")
        browser.audit("/session/ball_check.mcap", "session_ball_check")
        browser.audit("/compare?a=punch.mcap&b=punch_uncalibrated.mcap", "compare")
    finally:
        server.end()


def main():
    with tempfile.TemporaryDirectory() as work, sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"] if os.getuid() == 0 else [])
        browser = Browser(chromium)
        cable = Cable()
        recorded = live_cells(browser, pathlib.Path(work), cable)
        recordings(browser, pathlib.Path(work), recorded)
        foreign = {url for url in browser.requests if not re.match(rf"({re.escape(f'http://{ADDRESS}')}|{re.escape(cable.address)})/", url)}
        assert not foreign, foreign
        assert not browser.errors, browser.errors
        print(f"{len(browser.requests)} requests, none to another origin; {browser.audited} audits by axe-core without a violation")
        chromium.close()


main()
