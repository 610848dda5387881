#!/usr/bin/env python3
"""A hall of many machines in a browser: 24 tiles and 100 small ones on a screen, chosen and sorted, drawn from what they published.

    hall.py PROBECELL FOLDER

The cells are none: the example `load`, which stands beside the program, plays a sample as so many. Times are printed, not judged.
"""

import csv
import io
import os
import pathlib
import re
import shutil
import subprocess

from pages import ADDRESS, BINARY, PICTURES, SAMPLES, Browser, fetch, micrometres, started, twin, wait
from playwright.sync_api import sync_playwright

import kit

ROUTER = "tcp/127.0.0.1:7500"
LOAD = pathlib.Path(BINARY).resolve().parent / "examples" / "load"
SAMPLE = "punch_uncalibrated"
EVERY = "20"  # of the messages at 100 Hz

OUTSIDE = "[...document.querySelectorAll('.tile')].filter((one) => one.getBoundingClientRect().bottom > innerHeight).length"
FILTERED = """(letters) => new Promise((done) => {
    const input = document.querySelector('#choose input'), tiles = document.getElementById('tiles'), begun = performance.now();
    const seen = new MutationObserver(() => {
        if (document.getElementById('tiles') === tiles) return;
        seen.disconnect();
        requestAnimationFrame(() => setTimeout(() => done(Math.round(performance.now() - begun)), 0));
    });
    seen.observe(document.querySelector('main'), { childList: true, subtree: true });
    input.value = letters;
    input.dispatchEvent(new Event('input', { bubbles: true }));
})"""
TILES = "[...document.querySelectorAll('.tile')].map((one) => one.id.replace('tile-', ''))"
DRAWN = """[...document.querySelectorAll('.tile')].map((one) => ({ name: one.id.replace('tile-', ''),
    error: one.querySelector('.verdict + b')?.textContent, gap: one.querySelector('.of-gap b')?.textContent, cause: one.querySelector('.named')?.title }))"""


def plays(first, count, folder):
    one = kit.Process(LOAD, ROUTER, SAMPLES / f"{SAMPLE}.mcap", str(first), str(count), EVERY, folder=folder, stdin=subprocess.PIPE)
    one.says("ready")
    return one


def shows(page, count):
    wait(page, "(count) => document.querySelectorAll('.tile').length === count", count)


def published(page):
    """Deviations, gaps and causes on tiles are some that the cell has published, and most cells have some."""
    errors = {f"{micrometres(one['error'])} µm" for _, one in twin(SAMPLE, "verdicts")}
    # A size that a reference contradicts stands there with what was read.
    errors |= {f"{micrometres(one['size_deviation'])} µm" for _, one in twin(SAMPLE, "feature_results")}
    gaps = {f"{one['rms'] / one['noise_floor']:.1f}" for _, one in twin(SAMPLE, "gap_report")}
    drawn = page.evaluate(DRAWN)
    assert all(one["error"] in errors for one in drawn if one["error"]), (drawn, errors)
    assert all(one["gap"] in gaps for one in drawn if one["gap"]), (drawn, gaps)
    assert sum(bool(one["gap"]) for one in drawn) > len(drawn) / 2, drawn
    rows = {row["cell"]: row for row in csv.DictReader(io.StringIO(fetch("/hall.csv")[2].decode()))}
    assert set(rows) == {one["name"] for one in drawn}
    print(f"hall: the values on {len(drawn)} tiles are such as the cells published; {len(rows)} rows of CSV")


def chosen(page):
    """By words, by order; the address says it, and a page that is loaded from it shows the same."""
    page.fill("#choose input", "cell_2")
    wait(page, "document.querySelectorAll('.tile').length < 24 && location.search === '?q=cell_2'")
    kept = page.evaluate(TILES)
    assert set(kept) == {"cell_2", *(f"cell_{one}" for one in range(20, 24))}, kept
    page.select_option("select[name=sort]", "name")
    wait(page, "location.search === '?q=cell_2&sort=name'")
    wait(page, f"JSON.stringify({TILES}) === '{'[' + ','.join(chr(34) + one + chr(34) for one in sorted(kept)) + ']'}'")
    page.reload()
    assert page.evaluate(TILES) == sorted(kept) and page.input_value("#choose input") == "cell_2"
    wait(page, "document.getElementById('link').textContent === 'Live'")
    assert page.evaluate(TILES) == sorted(kept)
    page.fill("#choose input", "no such machine")
    shows(page, 0)


def main(folder):
    router = started("router", "--listen", ROUTER, "--strangers", "write", folder=folder)
    dashboard = started("dashboard", "--connect", ROUTER, "--recordings", folder, folder=folder)
    dashboard.says(f"dashboard: http://{ADDRESS}/")
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"] if os.getuid() == 0 else [])
        browser = Browser(chromium)
        few = plays(0, 24, folder)
        with browser.page() as page:
            page.goto(f"http://{ADDRESS}/")
            shows(page, 24)
            wait(page, "document.querySelectorAll('.of-gap b').length > 12")
            page.screenshot(path=PICTURES / "hall_24_screen.png")
            assert page.evaluate(OUTSIDE) == 0, "24 tiles are on one screen"
            published(page)
            chosen(page)
        browser.audit("/", "hall_24")
        many = plays(24, 76, folder)
        with browser.page() as page:
            page.goto(f"http://{ADDRESS}/?dense")
            shows(page, 100)
            page.reload()
            assert page.evaluate(OUTSIDE) == 0, "100 small tiles are on one screen"
            wait(page, "performance.getEntriesByName('first-contentful-paint').length > 0")
            paint = page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime")
            taken = [page.evaluate(FILTERED, letters) for letters in ("cell_7", "cell_", "cell_31", "cell", "9")]
            print(f"hall: 100 machines filtered and drawn, ms after the last letter: {taken}")
            print(f"hall: 100 machines on one screen, {len(page.content()) / 1e3:.0f} kB, first paint after {paint:.0f} ms")
        browser.audit("/?dense", "hall_dense")
        with browser.page(scripts=False) as plain:
            plain.goto(f"http://{ADDRESS}/")
            plain.fill("#choose input", "cell_7")
            plain.select_option("select[name=sort]", "name")
            plain.click("#choose button")
            names = plain.locator(".tile h2").all_inner_texts()
            assert names == ["cell_7", *(f"cell_{one}" for one in range(70, 80))], names
        print("without scripts: the machines are chosen by a form")
        foreign = {url for url in browser.requests if not re.match(rf"http://{re.escape(ADDRESS)}/", url)}
        assert not foreign and not browser.errors, (foreign, browser.errors)
        print(f"{browser.audited} audits by axe-core without a violation")
        chromium.close()
    for one in (few, many, dashboard, router):
        one.end()


kit.main({"hall": main})
