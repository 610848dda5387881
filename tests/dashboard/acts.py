#!/usr/bin/env python3
"""Acts of operators from the page of a cell: only signed, only from its own page, only once.

    acts.py PROBECELL FOLDER

A simulated cell whose corrections wait for an operator; the key is made and kept by Chromium. What the cell has recorded is
verified by another implementation of Ed25519 (cryptography), over a statement that is put together here.
"""

import http.server
import json
import os
import re
import shutil
import struct
import threading
import urllib.error
import urllib.request

import monitoring
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey
from pages import ADDRESS, ENDS, PICTURES, ROOT, Browser, asked, axe, cell_file, fetch, kit, metric, started, wait
from playwright.sync_api import sync_playwright

from kit import until
from kit.recordings import decoded

CELL = "mill_s"


def send(path, content, **headers):
    """What the dashboard answers to a POST from outside of any browser; as a page of its own unless headers say otherwise."""
    own = {"Content-Type": "application/json", "Origin": f"http://{ADDRESS}", "X-Act-Token": token()}
    own = {name: value for name, value in (own | {name.replace("_", "-"): value for name, value in headers.items()}).items() if value}
    data = content if isinstance(content, bytes) else json.dumps(content).encode()
    request = urllib.request.Request(f"http://{ADDRESS}{path}", data=data, headers=own, method="POST")
    try:
        with urllib.request.urlopen(request, timeout=kit.patience(60)) as answer:
            return answer.status, json.loads(answer.read())
    except urllib.error.HTTPError as error:
        text = error.read().decode()
        return error.code, json.loads(text) if text.startswith("{") else text


def token():
    return json.loads(urllib.request.urlopen(f"http://{ADDRESS}/act/token", timeout=kit.patience(60)).read())["token"]


def press(page, act, answer, subject=None, confirmed=True):
    """Presses a button and signs; gives what the dialogue has shown, and what it says in the end."""
    wait(page, "(act) => [...document.querySelectorAll(`[data-act=${act}]`)].some((one) => one.checkVisibility())", act)
    pressed = page.evaluate("(act) => { const one = document.querySelector(`[data-act=${act}]`); one.click(); return one.dataset.subject ?? ''; }", act)
    if subject:
        page.fill("#deed-subject", subject)
        page.click("dialog button[value=go]")
    if confirmed:
        page.wait_for_selector("dialog :text('Sign and send')")
        shown = page.inner_text("dialog form")
        page.click("dialog button[value=go]")
    else:
        shown = ""
    page.wait_for_selector("#deed-answer")
    told = page.inner_text("#deed-answer")
    assert answer in told, (act, told)
    page.click("dialog button")
    page.wait_for_selector("dialog", state="detached")
    if act == "approve":  # until the page knows: what is decided is offered to nobody
        wait(page, "(subject) => ![...document.querySelectorAll('[data-act=approve]')].some((one) => one.dataset.subject === subject)", pressed)
    return shown, told


def make_key(page, name, address):
    page.goto(f"http://{address}/key")
    page.fill("#key-name", name)
    page.click("#key-form button")
    page.wait_for_selector("#key-command:not([hidden])")
    (public,) = re.findall(r"[0-9a-f]{64}", page.inner_text("#key-command"))
    readable = page.evaluate("""async () => {
        const open = indexedDB.open('probecell', 1);
        const base = await new Promise((resolve) => { open.onsuccess = () => resolve(open.result); });
        const get = base.transaction('keys').objectStore('keys').get('operator');
        const own = await new Promise((resolve) => { get.onsuccess = () => resolve(get.result); });
        return crypto.subtle.exportKey('pkcs8', own.key).then(() => true, () => false);
    }""")
    assert not readable, "the private key can be read out"
    return public


def strangers(chromium, offer):
    """Nothing of this reaches the cell."""
    wish = {"cell": CELL, "act": "stop"}
    for what, code, headers in (
        ("from elsewhere", 403, {"Origin": "http://evil.example"}),
        ("without an origin", 403, {"Origin": None}),
        ("without the token of a page", 403, {"X_Act_Token": None}),
        ("with a guessed token", 403, {"X_Act_Token": "0" * 32}),
        ("as another page's script says", 403, {"Sec_Fetch_Site": "cross-site"}),
        ("as a form sends it", 415, {"Content_Type": "text/plain"}),
        ("by a name of somebody else's", 421, {"Host": "evil.example:7480", "Origin": "http://evil.example:7480"}),
    ):
        for path, content in (("/act/offer", wish), ("/act", offer)):
            status, told = send(path, content, **headers)
            assert status == code, (what, path, status, told)
    for content in (b"", b"[]", b"{", json.dumps(wish | {"more": 1}).encode(), b"x" * 20000):
        assert send("/act/offer", content)[0] in (400, 413), content[:20]
    assert send("/act/offer", {"cell": "no_such", "act": "stop"})[1]["text"].startswith("this dashboard was not given the file of cell no_such")
    assert send("/act/offer", {"cell": CELL, "act": "explode"})[1]["text"] == 'there is no act "explode"'
    guessed = {"token": "0" * 32, "operator": "ada", "shown": "x", "signature": "00" * 64}
    assert "was not offered" in send("/act", guessed)[1]["text"]
    status, offered = send("/act/offer", wish)
    assert status == 200
    unsigned = {"token": offered["token"], "operator": "ada", "shown": "x", "signature": ""}
    assert send("/act", unsigned)[1]["text"] == "the act of ada is not signed"

    # A page of another origin in a real browser: its scripts and its forms.
    class Elsewhere(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            self.send_header("content-type", "text/html")
            self.end_headers()
            self.wfile.write(f'<form method=post enctype=text/plain action="http://{ADDRESS}/act/offer"><input name=\'{{"cell":"{CELL}","act":"stop","subject":"\' value=\'"}}\'></form>'.encode())

        def log_message(self, *_):
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Elsewhere)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    context = chromium.new_context()
    page = context.new_page()
    answers = []
    page.on("response", lambda answer: answers.append((answer.request.method, answer.url, answer.status)))
    page.goto(f"http://127.0.0.1:{server.server_address[1]}/")
    for script in (
        f"fetch('http://{ADDRESS}/act/token').then((one) => one.text())",
        f"fetch('http://{ADDRESS}/act/offer', {{ method: 'POST', headers: {{ 'content-type': 'application/json', 'x-act-token': 'x' }}, body: '{{}}' }})",
    ):
        assert page.evaluate(f"{script}.then(() => 'read', () => 'refused')") == "refused", script
    status = page.evaluate(f"fetch('http://{ADDRESS}/act/offer', {{ method: 'POST', mode: 'no-cors', body: '{{}}' }}).then(() => '', () => '')")
    page.evaluate("document.forms[0].submit()")
    page.wait_for_url(f"http://{ADDRESS}/act/offer")
    posts = [one for one in answers if one[0] == "POST"]
    assert posts and all(one[2] in (403, 415) for one in posts), answers
    context.close()
    server.shutdown()
    print("strangers: other origins, names and forms, missing and guessed tokens, and what is not signed are refused")


WAITS = "[...document.querySelectorAll('[data-act=approve]')].some((one) => one.checkVisibility())"


def part_ends(page, name, how):
    """Until it has ended so; what waits on the way is approved."""
    ended = lambda: re.search(rf"{name}, ({ENDS})", page.inner_text("#state"))
    while (told := until(f"{name}, {how}", lambda: ended() or page.evaluate(WAITS))) is True:
        press(page, "approve", "Accepted")
    assert told[1] == how, page.inner_text("#state")


def operator(browser, page, cell, folder):
    """A key, a part with its corrections, touches again, and a stop; gives the public key and the act that approved."""
    sent = []
    page.on("request", lambda request: sent.append(request.post_data_json) if request.method == "POST" and request.url.endswith("/act") else None)
    page.goto(f"http://{ADDRESS}/cell/{CELL}")
    page.wait_for_selector("#state .unsigned")
    assert not page.locator("[data-act]").first.is_visible() and page.locator("[data-act]").count() >= 2
    public = make_key(page, "ada", ADDRESS)
    print("key: made by the browser, which does not give it away")
    told = axe(page)
    assert not told, told
    page.goto(f"http://{ADDRESS}/cell/{CELL}")
    press(page, "make", "Refused: ada is not an operator of this cell", subject="early")
    code, text = asked("key", "add", "ada", public, "--cell", cell, folder=folder)
    assert code == 0, text
    until("the key in force", lambda: "is not of this act" in forged("ada", CELL))
    print("an unregistered key is refused; registered, it counts while the cell runs")

    press(page, "make", "Accepted", subject="punch_1")
    wait(page, WAITS)
    browser.audit(f"/cell/{CELL}", "cell_waiting")
    page.evaluate("document.querySelector('[data-act=approve]').click()")
    page.wait_for_selector("dialog :text('Sign and send')")
    told = axe(page)
    assert not told, told
    page.screenshot(path=PICTURES / "approve_1400_light.png")
    page.click("dialog :text('Cancel')")
    page.wait_for_selector("dialog", state="detached")
    shown, _ = press(page, "approve", "Accepted")
    approval = sent[-1]
    assert all(line in approval["shown"] for line in shown.splitlines()[1:3] if line.strip()), (shown, approval)
    wait(page, "document.querySelector('#ledger').innerText.includes('approved by ada')")
    status, told = send("/act", approval)
    assert status == 403 and "was sent already" in told["text"], told
    print("approve: recorded with what was on the screen; the same act again is refused")
    strangers(browser.chromium, approval)
    part_ends(page, "punch_1", "qualified")
    wait(page, "!!document.querySelector('#why .headline')")
    monitoring.check(fetch("/metrics")[2].decode())

    before = metric("cell_touches_total", CELL)
    press(page, "again", "Accepted")
    until("touches made again", lambda: metric("cell_touches_total", CELL) > before)
    wait(page, "document.querySelector('#state .badge').innerText.includes('idle')")
    print("measure again: the touches were made")

    press(page, "make", "Accepted", subject="punch_3")
    wait(page, "document.querySelector('#state').innerText.includes('punch_3, pass ')")  # whichever a slow page sees first
    press(page, "stop", "Accepted: the machine stands", confirmed=False)
    part_ends(page, "punch_3", "stopped")
    print("stop: the machine stands")
    return public, approval


def next_session(page, cell, folder, approval):
    """The tools are as new, so that there is a correction again."""
    page.goto(f"http://{ADDRESS}/cell/{CELL}")
    until("the keys in force", lambda: "is not of this act" in forged("ada", CELL))
    press(page, "make", "Accepted", subject="punch_2")
    wait(page, WAITS)
    identifier = page.evaluate("document.querySelector('[data-act=approve]').dataset.subject")
    status, offered = send("/act/offer", {"cell": CELL, "act": "approve", "subject": identifier})
    assert status == 200, offered
    status, told = send("/act", approval | {"token": offered["token"]})
    assert status == 200 and not told["accepted"] and "the signature of ada does not match this correction" in told["text"], told
    press(page, "reject", "Accepted")
    wait(page, "document.querySelector('#ledger').innerText.includes('rejected by ada')")
    wait(page, "document.querySelector('#state .badge').innerText.includes('idle')")
    print("an approval of another correction is refused; a rejection ends the part")

    code, text = asked("key", "revoke", "ada", "--cell", cell, folder=folder)
    assert code == 0, text
    until("the key withdrawn", lambda: "withdrawn" in press(page, "stop", ": ", confirmed=False)[1])
    press(page, "make", "Refused: the key of ada was withdrawn", subject="late")
    page.goto(f"http://{ADDRESS}/key")
    page.click("#key-forget")
    page.wait_for_selector("#key-form:not([hidden])")
    page.goto(f"http://{ADDRESS}/cell/{CELL}")
    page.wait_for_selector("#state .unsigned")
    print("a key that was withdrawn is refused")


def forged(name, cell):
    """What is said of a signature that is none."""
    offered = send("/act/offer", {"cell": cell, "act": "make", "subject": "x"})[1]
    return send("/act", {"token": offered["token"], "operator": name, "shown": "x", "signature": "ff" * 64})[1]["text"]


def field(data):
    return struct.pack("<I", len(data)) + data


class Cdr:
    """CDR, little endian: as much of it as an OperatorRequest needs."""

    def __init__(self):
        self.bytes = b""

    def put(self, form, value):
        size = struct.calcsize(form)
        self.bytes += b"\0" * (-len(self.bytes) % size) + struct.pack("<" + form, value)
        return self

    def text(self, value):
        self.put("I", len(value.encode()) + 1)
        self.bytes += value.encode() + b"\0"
        return self


def subject_of(request):
    """An OperatorRequest with nothing but subject and plan, as docs/approvals.md has it."""
    cdr = Cdr().put("i", 0).put("I", 0).text("").put("Q", 0).text(request.subject).text("").put("?", False).text(request.plan_id)
    cdr.put("I", 0).put("I", 0).put("i", 0).put("I", 0).put("i", 0).put("I", 0).text("").put("I", 0)
    return b"\0\1\0\0" + cdr.bytes


def recorded(folder, public):
    """What was signed is in the recording, and verifies elsewhere."""
    (bag,) = (folder / "recordings").glob(f"{CELL}_*")
    code, text = asked("replay", bag, folder=folder)
    assert code == 0, text
    (cell_key,) = re.findall(r"^([0-9a-f]{64})  the cell itself", asked("key", "list", "--cell", folder / f"{CELL}.toml", folder=folder)[1], re.M)
    key = Ed25519PublicKey.from_public_bytes(bytes.fromhex(public))
    verified = []
    for channel, _, message in decoded(bag, [f"/{CELL}/run_requests", f"/{CELL}/stop_requests"]):
        if not message.signature:
            continue
        at = message.signed_at.sec * 10**9 + message.signed_at.nanosec
        kind = channel.topic.rsplit("/", 1)[1].removesuffix("_requests")
        fields = [b"probecell act 1", bytes.fromhex(cell_key), kind.encode(), message.operator_name.encode(), struct.pack("<q", at), message.shown.encode(), subject_of(message)]
        statement = b"".join(map(field, fields))
        key.verify(bytes(message.signature), statement)
        assert "On screen: " in message.shown
        verified.append((kind, message.subject))
        try:
            key.verify(bytes(message.signature), statement + b"\0")
        except InvalidSignature:
            continue
        raise AssertionError("anything verifies")
    runs = [subject for kind, subject in verified if kind == "run"]
    assert runs == ["punch_1", "", "punch_3"] and len(verified) == 4, verified
    print("recording: replays equal; the signatures of", len(verified), "requests verify with another implementation")


def proposed_touches(browser, folder):
    """A cell that cannot tell causes apart is sent for the touches that can."""
    cell = folder / "ball_s.toml"
    source = ROOT / "launch-scripts"
    text = (source / "ball_check.toml").read_text()
    assert 'name = "ball_check"' in text
    cell.write_text(text.replace('name = "ball_check"', 'name = "ball_s"'))
    shutil.copy(source / "wcbxfzyst.urdf", folder)
    up = started("up", cell, folder=folder)
    up.says("is ready")
    with browser.page() as page:
        public = make_key(page, "bob", ADDRESS)
        assert asked("key", "add", "bob", public, "--cell", cell, folder=folder)[0] == 0
        page.goto(f"http://{ADDRESS}/cell/ball_s")
        until("the key in force", lambda: "is not of this act" in forged("bob", "ball_s"))
        press(page, "make", "Accepted", subject="balls")
        wait(page, "[...document.querySelectorAll('#gap [data-act=next]')].some((one) => one.checkVisibility())")
        wait(page, "document.querySelector('#state .badge').innerText.includes('idle')")
        first = page.inner_text("#why .headline code")
        before = metric("cell_touches_total", "ball_s")
        press(page, "next", "Accepted")
        wait(page, "(first) => document.querySelector('#why .headline code').innerText !== first", first)
        made = metric("cell_touches_total", "ball_s") - before
        print(f"proposed touches: {made:.0f} were taken, and the gap was diagnosed again: {page.inner_text('#why .headline code')}")
        assert made > 0
    up.end()


def main(folder):
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"] if os.getuid() == 0 else [])
        browser = Browser(chromium)
        cell = cell_file(folder, CELL, asks=("automatic_approval = true ", "automatic_approval = false "))
        up = started("up", cell, folder=folder)
        up.says(f"dashboard: http://{ADDRESS}/")
        up.says("is ready")
        with browser.page() as page:
            public, approval = operator(browser, page, cell, folder)
            up.end()
            page.goto("about:blank")  # the page loads itself again when its dashboard is back
            recorded(folder, public)
            up = started("up", cell, folder=folder)
            up.says("is ready")
            next_session(page, cell, folder, approval)
            up.end()
        proposed_touches(browser, folder)
        assert not browser.errors, browser.errors
        chromium.close()


kit.main({"acts": main})
