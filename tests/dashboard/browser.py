#!/usr/bin/env python3
"""What a person sees of cells and recordings in a browser: Chromium, driven by Playwright, with axe-core.

    browser.py PROBECELL FOLDER

Cells are simulated and real in everything else; nothing waits but for a condition. Figures are printed, not judged. What is
told of recordings is compared with the readable twins beside the samples.
"""

import csv
import io
import json
import os
import pathlib
import re
import shutil
import time
import urllib.parse
from datetime import datetime, timedelta

from pages import ADDRESS, ENDS, SAMPLES, Browser, Line, cell_file, fetch, metric, micrometres, started, twin, wait
from playwright.sync_api import sync_playwright
from viewer import Viewer, compared, refused

import kit
from kit import until
from kit.recordings import messages

# Puts the slider of a session at an instant, as a hand does.
SLID = "(t) => { const slider = document.getElementById('t'); slider.value = t; slider.dispatchEvent(new Event('input', { bubbles: true })); }"
# What the tile of a cell has said, in order: a word that has come and gone before this process looked is among it.
SAID = """(tile) => { window.said = []; new MutationObserver(() => {
    const now = document.querySelector(tile)?.innerText ?? '';
    if (now !== window.said.at(-1)) window.said.push(now);
}).observe(document.body, { childList: true, subtree: true, characterData: true }); }"""


# What a tile draws: the worst characteristic, its deviation, its limits, the gap over noise, the strip.
TILE = """(tile) => { const one = document.querySelector(tile); return {
    worst: one.querySelector('.verdict').title, error: one.querySelector('.verdict + b').textContent, bar: one.querySelector('.onto').getAttribute('aria-label'),
    sizes: one.querySelector('.of-sizes .spark').getAttribute('aria-label'), gap: one.querySelector('.of-gap b').textContent,
    strip: one.querySelector('.course-strip').getAttribute('aria-label') }; }"""


def newest_touches(sample):
    """Deviation (m) of the newest touch of each point of the plan measured last, by its feature and its place there, by its twin."""
    plan, places, made = twin(sample, "inspection_plan")[-1][1], [], {}
    for point in plan["points"]:
        made[point["feature"]] = made.get(point["feature"], 0) + 1
        places.append((plan["features"][point["feature"]]["id"], made[point["feature"]]))
    touches = [one for _, one in twin(sample, "touch_deviations")]
    return {places[one["point_index"]]: one["deviation"] for one in touches if one["plan_id"] == plan["plan_id"]}


def drawn(told, published):
    """What the tile drew of the part is what the cell published."""
    verdicts = published["verdicts"]
    last = {one.feature_id: one for one in verdicts if one.plan_id == verdicts[-1].plan_id}
    worst = max(last.values(), key=lambda one: abs(one.error) / one.tolerance)
    assert told["worst"] == f"{worst.feature_id} qualified" and told["error"] == f"{micrometres(worst.error)} µm", (told, worst)
    assert told["bar"].startswith(micrometres(worst.error)) and f"to {micrometres(worst.tolerance)} µm" in told["bar"], (told, worst)
    (plan,) = [one for one in published["inspection_plan"][-1:] if one.plan_id == worst.plan_id]
    limits = {one.id: (one.lower_tolerance, one.upper_tolerance) for one in plan.features if one.upper_tolerance > one.lower_tolerance}
    results = [(one.size_deviation, *limits[one.feature_id]) for one in published["feature_results"] if one.plan_id == plan.plan_id and one.feature_id in limits]
    used = max(abs(2 * size - upper - lower) / (upper - lower) for size, lower, upper in results)
    assert f"now {100 * used:.0f} %" in told["sizes"], (told, used)
    gap = published["gap_report"][-1]
    assert told["gap"] == f"{gap.rms / gap.noise_floor:.1f}", (told, gap.rms, gap.noise_floor)
    assert re.search(r"running [0-9.]+ s, measuring [0-9.]+ s", told["strip"]), told
    print("hall: worst size, its limits, gap and strip on the tile are what the cell published")


def live_cells(browser, folder, line):
    a, b = cell_file(folder, "mill_a"), cell_file(folder, "mill_b")
    with browser.page() as hall:
        first = started("up", a, folder=folder)
        first.says(f"dashboard: http://{ADDRESS}/")
        hall.goto(f"http://{ADDRESS}/")
        hall.evaluate("window.sameDocument = true")
        hall.wait_for_selector("#tile-mill_a")
        print("hall: the cell that runs is there")
        second = started("up", b, folder=folder)
        second.says("dashboard: http://127.0.0.1:7481/")
        hall.wait_for_selector("#tile-mill_b")
        assert hall.evaluate("window.sameDocument"), "the page was loaded again"
        print("hall: a second cell appeared by itself; its own dashboard took the next port")
        for one in (first, second):
            one.says("is ready")
        viewer = Viewer("mill_a")
        for name in ("mill_a", "mill_b"):
            viewer.waits_for("offered", f"/{name}/touch_deviations")
        refused()

        with browser.page() as cell:
            cell.goto(f"{line.address}/cell/mill_a")
            cell.evaluate("""() => { window.delays = []; new MutationObserver(() => {
                const at = Number(document.querySelector('#part .newest')?.dataset.made);
                if (at && at !== window.last) { window.last = at; window.delays.push(Date.now() - at); }
            }).observe(document.querySelector('.cards'), { childList: true, subtree: true }); }""")
            hall.evaluate(SAID, "#tile-mill_a")
            asked = started("run", "punch_1", "--cell", a, folder=folder)
            wait(cell, "document.querySelectorAll('#part g.touch').length >= 5")
            print("cell: touches appear as they come; ms from the touch to the page:", sorted(cell.evaluate("window.delays")))

            # From the first touches on: some ninety follow, of which three fall into the cut on the slowest machine.
            wait(cell, "document.getElementById('link').textContent === 'Live'")
            line.cut()
            before = metric("cell_touches_total", "mill_a")
            wait(cell, "document.getElementById('link').classList.contains('cut')")
            assert "old" in cell.inner_text("#link")
            until("touches during the cut", lambda: metric("cell_touches_total", "mill_a") >= before + 3)
            line.mend()
            cell.wait_for_selector("#notice:not([hidden])")
            notice = cell.inner_text("#notice")
            caught = re.search(r"(\d+) touch", notice)
            assert caught and int(caught.group(1)) >= 3, notice
            wait(cell, "document.getElementById('link').textContent === 'Live'")
            print("cell: after a cut:", notice.replace("\n", " "))

        tile = "document.querySelector('#tile-mill_a').innerText"
        wait(hall, f"/punch_1, ({ENDS})/.test({tile})")
        assert "punch_1, qualified" in hall.evaluate(tile), hall.evaluate(tile)
        assert hall.evaluate("window.said.some((one) => one.includes('can be corrected'))"), hall.evaluate("window.said")
        print("hall: a verdict changed the tile")
        asked.end()
        browser.audit("/", "hall")
        browser.audit("/?wall", "wall")
        browser.audit("/cell/mill_a", "cell")

        with browser.page(scripts=False) as plain:
            plain.goto(f"http://{ADDRESS}/")
            text = plain.inner_text("main")
            assert "mill_a" in text and plain.locator("#tile-mill_a svg.spark").count() == 2 and plain.locator("#tile-mill_a .course-strip path").count() >= 2 and "punch_1, qualified" in text and "× noise" in text, text
            assert plain.locator("noscript meta[http-equiv=refresh], meta[http-equiv=refresh]").count() == 1
            plain.goto(f"http://{ADDRESS}/cell/mill_a")
            assert "Wear of tool 2" in plain.inner_text("#ledger") and plain.locator("#part svg g.touch").count() == 32
            view = plain.locator("#part svg.part").inner_html()
            plain.click("#part .turn a[aria-label='Turn left']")
            assert plain.locator("#part svg.part").inner_html() != view
        print("without scripts: the state is there, renews itself, and the part turns")

        # The tile that needs a person comes first; not while a pointer is over the tiles, but when asked.
        order = lambda: hall.evaluate("[...document.querySelectorAll('.tile')].map((one) => one.id)")
        assert order()[0] in ("tile-mill_a", "tile-mill_b")
        hall.hover("#tile-mill_a")
        held = order()
        told = hall.evaluate(TILE, "#tile-mill_a")
        begun = time.monotonic()
        second.kill()
        wait(hall, "document.querySelector('#tile-mill_b').innerText.includes('silent')")
        print(f"hall: a killed cell is stale after {time.monotonic() - begun:.1f} s")
        hall.wait_for_selector("#resort:not([hidden])")
        assert order() == held, "tiles moved under the pointer"
        hall.mouse.move(2, 2)
        wait(hall, "document.querySelector('.tile').id === 'tile-mill_b'")
        print("hall: tiles stayed under the pointer, and were sorted when it left")
        browser.audit("/", "hall_silent")

        with browser.page() as page, browser.page(zone="Asia/Tokyo") as far:
            rows = []
            for one in (page, far):
                one.goto(f"http://{ADDRESS}/sessions")
                wait(one, "!document.querySelector('#listed[data-unread]')")
                rows += [row for row in one.evaluate(ROWS) if row["name"].startswith("mill_a_")]
            here, there = rows
            assert here["verdict"] == "● under way" and not here["alarm"] and here["part"] == "punch_1", here
            late = datetime.fromisoformat(there["when"]) - datetime.fromisoformat(here["when"])
            assert late == timedelta(hours=9) and there["utc"] == here["utc"] and "your zone" in far.inner_text("footer"), rows
        print("sessions: the one that is being recorded is under way, without an alarm; times are of the viewer's zone")

        nodes = live_nodes()
        assert nodes and not any("dashboard" in name for name in nodes), nodes
        viewer.waits_for("gone", "/mill_b/touch_deviations")
        held_up = viewer.load.held_up([first.pid, kit.child(first.pid, "dashboard"), viewer.process.pid]) / (time.monotonic() - viewer.load.begun)
        seen = viewer.end()
        first.end()
        (bag,) = (folder / "recordings").glob("mill_a_*")
        compared(viewer, seen, bag, held_up)
        drawn(told, messages(bag))
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
    for sample in ("punch", "punch_uncalibrated", "ball_check", "guideway", "guideway_straight"):
        shutil.copy(SAMPLES / f"{sample}.mcap", shown)
    (folder / "secret.mcap").write_bytes((SAMPLES / "punch.mcap").read_bytes())
    (shown / "linked.mcap").symlink_to(folder / "secret.mcap")
    server = started("dashboard", "--recordings", shown, "--recordings", recorded, folder=folder)
    server.says("dashboard: http://")
    with browser.page() as page:
        page.goto(f"http://{ADDRESS}/sessions")
        listed(page)
        touches = [at for at, one in twin("punch", "touch_deviations") if one["plan_id"] == "punch/rough/1"]
        page.goto(f"http://{ADDRESS}/session/punch.mcap?t=0")
        page.evaluate("window.sameDocument = true")
        for wanted in (9.0, 12.0, 7.0):
            page.evaluate(SLID, wanted)
            told = sum(at <= wanted for at in touches)
            wait(page, "(count) => document.querySelectorAll('#part g.touch').length === count", told)
            assert f"{wanted:.1f} s" in page.inner_text("#instant")
        page.evaluate("document.activeElement.blur()")
        page.evaluate(SLID, 8.0)
        for key, instant in (("ArrowRight", 9.0), ("Shift+ArrowRight", 19.0), ("ArrowLeft", 18.0)):
            page.keyboard.press(key)
            wait(page, "(instant) => document.getElementById('instant').innerText.startsWith(instant)", f"{instant:.1f} s")
        page.select_option("#speed", "4")
        page.evaluate("document.activeElement.blur()")
        page.keyboard.press(" ")
        wait(page, "document.getElementById('play').innerText === 'Pause'")
        page.click(".timeline .steps a:has-text('Begin')")
        wait(page, "Number(document.getElementById('t').value) < 15 && document.getElementById('play').innerText === 'Pause'")
        page.evaluate("document.activeElement.blur()")
        wait(page, "document.getElementById('play').innerText === 'Play' && Number(document.getElementById('t').value) === Number(document.getElementById('t').max)")
        wait(page, "(count) => document.querySelectorAll('#part g.touch').length === count", len({one["point_index"] for _, one in twin("punch", "touch_deviations") if one["plan_id"] == twin("punch", "inspection_plan")[-1][1]["plan_id"]}))
        print("session: moved by keys, played to its end")
        assert page.evaluate("window.sameDocument")
        print("session: scrubbed forward and back, each time with as many touches as the twin has")
        with page.expect_download() as download:
            page.click(".title .actions a[download]")
        assert pathlib.Path(download.value.path()).read_bytes() == (SAMPLES / "punch.mcap").read_bytes()
        print("session: downloaded byte for byte")
        for kind, words in (("report", "Measurement punch/finish/1"), ("diagnosis", "probe.stylus_offset")):
            page.goto(f"http://{ADDRESS}/session/punch.mcap/{kind}")
            assert words in page.inner_text("body"), kind
        page.goto(f"http://{ADDRESS}/machines")
        table = urllib.parse.unquote(page.get_attribute("a[download='causes.csv']", "href").split(",", 1)[1])
        found = {(row["machine"], row["effect"], row["parameter"]): row["value"] for row in csv.DictReader(io.StringIO(table))}
        for effect in json.loads(twin("punch_uncalibrated", "gap_report")[-1][1]["json"])["effects"]:
            for one in effect["parameters"]:
                assert float(found["turn_mill", effect["effect"], one["name"]]) == one["value"], (found, effect)
        assert page.locator("table.matrix tbody tr").count() == page.locator(".listing > li").count()
        print(f"machines: {len(found)} sizes of causes by machine, as their recordings have them")
        page.click(".listing a[href='/machine/turn_mill']")
        rows = page.locator("section[aria-labelledby=all-title] tbody tr").all_inner_texts()
        for sample in ("punch", "punch_uncalibrated"):
            gap = twin(sample, "gap_report")[-1][1]
            (row,) = [row for row in rows if row.startswith(f"{sample}.mcap")]
            assert f"{gap['rms'] / gap['noise_floor']:.1f}" in row, (row, gap["rms"], gap["noise_floor"])
            found = json.loads(gap["json"])["effects"]
            assert all(effect["effect"] in page.inner_text("section[aria-labelledby=effects-title]") for effect in found), found
        print("machine: two recordings, with the gap and the effects that their twins have")
        page.goto(f"http://{ADDRESS}/compare?a=guideway.mcap&b=guideway_straight.mcap")
        table = urllib.parse.unquote(page.get_attribute("a[download='touches.csv']", "href").split(",", 1)[1])
        rows = [row.split(",") for row in table.splitlines()[1:]]
        drawn = {(row[0], int(row[1])): [float(value) for value in row[2:]] for row in rows}
        a, b = (newest_touches(sample) for sample in ("guideway", "guideway_straight"))
        both = {point: [1e6 * a[point], 1e6 * b[point]] for point in a.keys() & b.keys()}
        assert len(both) > 20 and drawn.keys() == both.keys(), (len(drawn), len(both))
        assert sum(abs(one - other) > 1 for one, other in both.values()) > 5, both
        assert all(abs(one - other) < 0.01 for point in both for one, other in zip(drawn[point], both[point])), (drawn, both)
        assert page.locator("section[aria-labelledby=touches-title] circle").count() == 2 * len(both)
        print(f"compare: {len(both)} touches of two sessions over one another, as their twins have them")
    for path in ("/session/..%2f..%2fetc%2fpasswd", "/session/linked.mcap", "/session/%2e%2e", "/session/secret.mcap/mcap/0", "/session/punch.mcap/mcap/7", "/assets/..%2f..%2fCargo.toml"):
        assert fetch(path)[0] == 404, path
    for method in ("POST", "PUT", "DELETE", "PATCH"):
        for path in ("/", "/cell/mill_a", "/sessions", "/metrics"):
            assert fetch(path, method)[0] == 405, (method, path)
    policy = fetch("/sessions")[1]["content-security-policy"]
    assert "default-src 'none'" in policy and "script-src 'self'" in policy and "unsafe" not in policy
    print("folders: neither links nor parents are followed; nothing but GET is answered")
    browser.audit("/sessions", "sessions")
    browser.audit("/machines", "machines")
    browser.audit("/machine/turn_mill", "machine")
    browser.audit("/session/punch.mcap?t=12", "session")
    browser.audit("/session/ball_check.mcap", "session_ball_check")
    browser.audit("/compare?a=punch.mcap&b=punch_uncalibrated.mcap", "compare")
    browser.audit("/session/punch_uncalibrated.mcap/report", "report")
    browser.audit("/session/ball_check.mcap/diagnosis", "diagnosis")
    (shown / "broken.mcap").write_bytes((SAMPLES / "punch.mcap").read_bytes()[:60000])
    for path in ("/sessions", "/machines", "/machine/turn_mill", "/session/punch.mcap?t=12", "/session/ball_check.mcap", "/session/punch_uncalibrated.mcap/report",
                 "/session/ball_check.mcap/diagnosis", "/compare?a=punch.mcap&b=punch_uncalibrated.mcap"):
        browser.read_without_scripts(path)
    scrubbed_without_scripts(browser)
    words = browser.printed("/session/punch_uncalibrated.mcap/report", "report_printed")
    assert all(word in words for word in ("Released by", "Signature")), words[-300:]
    browser.printed("/session/ball_check.mcap/diagnosis", "diagnosis_printed")
    for path in ("/session/punch.mcap?t=0", "/session/broken.mcap", "/key", "/sessions", "/cell/none", "/none", "/machine/none", "/compare?a=punch.mcap&b=none", "/session/broken.mcap/report"):
        browser.glance(path)


ROWS = """[...document.querySelectorAll('.recordings tbody tr')].map((row) => ({ name: row.querySelector('th a').title, cell: row.querySelector('th a').firstChild.textContent,
    part: row.querySelector('[data-label=Part]').innerText, verdict: row.querySelector('[data-label=Verdict]').innerText,
    when: row.querySelector('time').textContent, utc: row.querySelector('time').title, gap: row.querySelector('[data-label^=Gap]').innerText,
    cause: row.querySelector('[data-label=Cause]').innerText, alarm: !!row.querySelector('.mark') }))"""


def listed(page):
    """The list: each recording with what its twin says of it; searched and filtered; no name made of numbers."""
    wait(page, "document.querySelectorAll('.recordings tbody tr').length >= 5 && !document.querySelector('#listed[data-unread]')")
    rows = {row["name"]: row for row in page.evaluate(ROWS)}
    assert any(name.startswith("mill_a_") for name in rows) and "linked.mcap" not in rows, rows
    for sample in ("punch", "punch_uncalibrated"):
        row = rows[f"{sample}.mcap"]
        report, gap = twin(sample, "part_reports")[-1][1], twin(sample, "gap_report")[-1][1]
        assert row["cell"] == "turn_mill" and row["part"].split()[0] == report["part_id"], (row, report)
        assert row["gap"] == f"{gap['rms'] / gap['noise_floor']:.1f}" and row["cause"] != "–", (row, gap)
        assert re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d", row["when"]) and row["utc"].startswith(row["when"]) and row["utc"].endswith(" UTC"), row
    assert "qualified" in rows["punch.mcap"]["verdict"] and "not qualified any more" in rows["punch_uncalibrated.mcap"]["verdict"], rows
    assert not re.search(r"\d{10}", page.inner_text("main")), "milliseconds since 1970"
    page.fill("#choose input", "uncalib")
    wait(page, "location.search === '?q=uncalib' && document.querySelectorAll('.recordings tbody tr').length === 1")
    page.fill("#choose input", "")
    page.select_option("select[name=cell]", "mill_a")
    wait(page, "location.search === '?cell=mill_a'")
    assert page.evaluate(ROWS)[0]["name"].startswith("mill_a_")
    page.select_option("select[name=cell]", "")
    page.select_option("select[name=verdict]", "bad")
    wait(page, "location.search === '?verdict=bad' && [...document.querySelectorAll('.recordings .verdict')].every((one) => one.classList.contains('bad'))")
    print(f"sessions: {len(rows)} recordings with cell, part, verdict, gap and cause as in their twins, searched and filtered")


def scrubbed_without_scripts(browser):
    """A timeline by links, two sessions side by side by a form, and the way between the pages."""
    with browser.page(scripts=False) as page:
        page.goto(f"http://{ADDRESS}/session/punch.mcap?t=8")
        page.click(".timeline a:has-text('+ 1 s')")
        touches = sum(at <= 9.0 for at, one in twin("punch", "touch_deviations") if one["plan_id"] == "punch/rough/1")
        assert "9.0 s" in page.inner_text("#instant") and page.locator("#part svg g.touch").count() == touches > 0
        page.goto(f"http://{ADDRESS}/sessions")
        page.select_option("select[name=a]", "punch.mcap")
        page.select_option("select[name=b]", "ball_check.mcap")
        page.click("form.compare button")
        assert "ball_check.mcap" in page.inner_text("h1") + page.inner_text("main")
        page.goto(f"http://{ADDRESS}/sessions")
        page.click("tr:has(a[href='/session/punch.mcap']) >> text=Report")
        assert "Measurement punch/finish/1" in page.inner_text("main")
    print("without scripts: every page of recordings says the same, the timeline, the comparison and the links work")


def main(folder):
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"] if os.getuid() == 0 else [])
        browser = Browser(chromium)
        line = Line()
        recorded = live_cells(browser, folder, line)
        recordings(browser, folder, recorded)
        foreign = {url for url in browser.requests if not re.match(rf"({re.escape(f'http://{ADDRESS}')}|{re.escape(line.address)})/", url)}
        assert not foreign, foreign
        assert not browser.errors, browser.errors
        print(f"{len(browser.requests)} requests, none to another origin; {browser.audited} audits by axe-core without a violation")
        chromium.close()


kit.main({"browser": main})
