"""What the tests of the dashboard share: cells, a connection that can be cut, and pages that are audited."""

import contextlib
import json
import pathlib
import re
import shutil
import socket
import sys
import threading
import urllib.error
import urllib.request

import pypdfium2
from axe_playwright_python.sync_playwright import Axe
from PIL import ImageChops

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "tests"))
import kit  # noqa: E402

BINARY, PICTURES = sys.argv[1], pathlib.Path(sys.argv[2])
SAMPLES = ROOT / "bags" / "samples"
ADDRESS = "127.0.0.1:7480"
SHEET_SCALE = 1.5  # px per point
WIDTHS = {"1400": (1400, 900), "800": (800, 1100), "390": (390, 844)}


def wait(page, condition, argument=None):
    """Until the page fulfils it. Playwright's own way needs eval in the page, which its policy forbids."""
    return kit.until(condition, lambda: page.evaluate(condition, argument))


def asked(*words, folder):
    """Status and what a command says."""
    code, output, errors = kit.run(BINARY, *words, folder=folder)
    return code, output + errors


def started(*words, folder, inside=()):
    """A probecell process; on another host where a command that leads there is given."""
    return kit.Process(*inside, BINARY, *words, folder=folder)


class Line:
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
        with urllib.request.urlopen(request, timeout=kit.patience(60)) as answer:
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


def micrometres(value):
    """A length (m) as the pages write a difference, without its unit."""
    return f"{abs(value) * 1e6:.1f}" if round(abs(value) * 1e7) == 0 else f"{'−' if value < 0 else '+'}{abs(value) * 1e6:.1f}"


class Browser:
    """Pages in a scheme of colours and a width; every request is noted."""

    def __init__(self, chromium):
        self.chromium, self.requests, self.errors, self.audited = chromium, [], [], 0

    @contextlib.contextmanager
    def page(self, width="1400", scheme="light", scripts=True, touch=False, zone=None):
        size = WIDTHS[width]
        context = self.chromium.new_context(
            viewport={"width": size[0], "height": size[1]}, color_scheme=scheme, java_script_enabled=scripts, has_touch=touch, bypass_csp=False, timezone_id=zone
        )
        context.set_default_timeout(kit.patience(120) * 1000)
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

    def glance(self, path):
        """The same of a page that is seen rarely, without pictures: wide and light, narrow and dark."""
        for scheme, width in (("light", "1400"), ("dark", "390")):
            with self.page(width, scheme) as page:
                page.goto(f"http://{ADDRESS}{path}")
                wide = page.evaluate("[document.documentElement.scrollWidth, document.documentElement.clientWidth]")
                assert wide[0] <= wide[1], f"{path} scrolls sideways at {width} px: {wide}"
                told = axe(page)
                assert not told, f"{path} {width} {scheme}: {json.dumps(told, indent=1)[:4000]}"
                self.audited += 1

    def read_without_scripts(self, path):
        """Whatever the page of scripts says stands there without them as well."""
        texts = []
        for scripts in (True, False):
            with self.page(scripts=scripts) as page:
                page.goto(f"http://{ADDRESS}{path}")
                if scripts:
                    page.evaluate("document.querySelector('.playing')?.remove()")
                text = page.inner_text("main")
                # The button that takes the place of a script, and those that only a script serves.
                for button in ("Show", "SVG", "In 3D"):
                    text = text.replace(f"\n{button}", "")
                texts.append(text)
        assert texts[0] == texts[1] and len(texts[1]) > 40, (path, texts)

    def printed(self, path, name):
        """The page on A4: sheets with their numbers, none half empty but the last, and a picture of each."""
        with self.page() as page:
            page.goto(f"http://{ADDRESS}{path}")
            sheets = pypdfium2.PdfDocument(page.pdf(prefer_css_page_size=True))
        for old in PICTURES.glob(f"{name}_sheet_*.png"):
            old.unlink()
        filled = []
        for number, sheet in enumerate(sheets, 1):
            words = sheet.get_textpage().get_text_range()
            assert f"{number} / {len(sheets)}" in words, (name, number, words[-200:])
            picture = sheet.render(scale=SHEET_SCALE).to_pil().convert("RGB")
            picture.save(PICTURES / f"{name}_sheet_{number:02}.png")
            # Without the number at the foot.
            ink = ImageChops.invert(picture.convert("L").crop((0, 0, picture.width, picture.height * 93 // 100))).getbbox()
            filled.append(round(ink[3] / picture.height, 2) if ink else 0.0)
        assert all(share > 0.5 for share in filled[:-1]), f"{name}: sheets are half empty: {filled}"
        print(f"{name}: {len(filled)} sheets, filled to {filled}")
        return "\n".join(sheet.get_textpage().get_text_range() for sheet in sheets)


ENDS = "qualified|measured only|stopped|scrap"  # how a part may end


def axe(page):
    results = Axe().run(page).response
    return [
        {"id": one["id"], "help": one["help"], "nodes": [(node["html"][:200], node.get("failureSummary", "")[:300]) for node in one["nodes"][:4]]}
        for one in results["violations"]
    ]


