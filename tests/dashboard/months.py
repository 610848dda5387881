#!/usr/bin/env python3
"""A machine over weeks, whose history is known: the page of the machine against what was planted and what was done.

    months.py PROBECELL FOLDER_FOR_PICTURES

A turn-mill makes a part each week on virtual time (example `make_part`): six weeks, or sixteen with MONTHS=4. A collision displaces the
stylus; later the effect that the diagnosis names is adopted into the declared model. What the page says is compared with what was
planted, and with the messages of the recordings, read by mcap-ros2-support. RECORDINGS=FOLDER keeps them, and uses them if they are there.
"""

import json
import math
import os
import pathlib
import re
import shutil
import time

from mcap.reader import make_reader
from mcap.writer import Writer
from pages import ADDRESS, BINARY, ROOT, Browser, asked, kit, started
from playwright.sync_api import sync_playwright

from kit.recordings import decoded

MAKE_PART = ROOT / "target" / "release" / "examples" / "make_part"
WEEKS, COLLISION, ADOPTED = (16, 6, 10) if os.environ.get("MONTHS") == "4" else (6, 2, 4)
OFFSETS = {False: -6.0, True: -30.0}  # µm, of the stylus before and after the collision
WEEK = 7 * 86_400_000_000_000  # ns
EFFECT = "probe.stylus_offset"


def later(source, target, shift):
    """The same recording, received that much later."""
    with open(source, "rb") as file, open(target, "wb") as out:
        reader, writer = make_reader(file), Writer(out)
        writer.start(profile="ros2", library="probecell 0.1.0")
        summary, schemas, channels = reader.get_summary(), {}, {}
        for number, schema in summary.schemas.items():
            schemas[number] = writer.register_schema(schema.name, schema.encoding, schema.data)
        for number, channel in summary.channels.items():
            channels[number] = writer.register_channel(channel.topic, channel.message_encoding, schemas[channel.schema_id], channel.metadata)
        for one in reader.iter_attachments():
            writer.add_attachment(one.create_time, one.log_time, one.name, one.media_type, one.data)
        for _, channel, message in reader.iter_messages():
            writer.add_message(channels[channel.id], message.log_time + shift, message.data, message.publish_time + shift, message.sequence)
        writer.finish()


def messages(bag, topic):
    return [message for _, _, message in decoded(bag, [f"/turn_mill/{topic}"])]


def shown(micrometres):
    """As the page writes micrometres with a sign."""
    value = round(micrometres, 1) + 0.0
    return f"{'+' if value > 0 else ''}{value:.1f}".replace("-", "−")


def make(folder, made):
    """Recordings of all weeks."""
    cell = folder / "cell.toml"
    made.mkdir(parents=True)
    shutil.copy(ROOT / "launch-scripts" / "turn_mill.urdf", folder)
    text = (ROOT / "launch-scripts" / "turn_mill_uncalibrated.toml").read_text().replace("[path_planning]\n", "[path_planning]\nkicks = 50\n")
    assert "center_error_um = [-30.0, 0.0, 0.0]" in text and "seed = 1\n" in text
    cell.write_text(text)
    for week in range(WEEKS):
        text = re.sub(r"center_error_um = \[[-0-9.]+,", f"center_error_um = [{OFFSETS[week >= COLLISION]},", cell.read_text(), count=1)
        cell.write_text(re.sub(r"seed = \d+\n", f"seed = {week + 1}\n", text, count=1))
        raw = folder / "raw.mcap"
        code, _, errors = kit.run(MAKE_PART, cell, "punch", raw)
        assert code == 0, errors
        later(raw, made / f"week_{week + 1:02}.mcap", week * WEEK)
        if week + 1 == ADOPTED:
            _, report, _ = kit.run(BINARY, "diagnose", raw, "--json", folder=folder)
            (folder / "report.json").write_text(report)
            status, told = asked("adopt", "report.json", "--cell", cell, "--as", EFFECT, folder=folder)
            assert status == 0, told
            print(told.strip())


def day(week):
    return time.strftime("%Y-%m-%d", time.gmtime(1_767_225_600 + week * WEEK // 10**9))


def refuted(bag):
    """Features whose readings on the part of a recording its reference contradicts: E_n > 1 (ISO 13528:2015, 9.7)."""
    expanded = lambda one: one.coverage_factor * one.standard_uncertainty
    readings = {(one.plan_id, one.feature_id): one for one in messages(bag, "feature_results")}
    features = set()
    for one in messages(bag, "reference_results"):
        reading = readings[one.plan_id, one.feature_id]
        if abs(reading.size_deviation - one.size_deviation) > math.hypot(expanded(reading), expanded(one)):
            features.add(one.feature_id)
    return features


def compare(page, bags):
    assert len(bags) == WEEKS, bags
    rows = lambda name: page.locator(f"section[aria-labelledby={name}-title] :is(li, details)").all_text_contents()
    gaps = [messages(bag, "gap_report")[-1] for bag in bags]
    reports = [json.loads(gap.json) for gap in gaps]

    def found(week):
        (effect,) = [one for one in reports[week]["effects"] if one["effect"] == EFFECT]
        (dx,) = [one for one in effect["parameters"] if one["name"] == "dx"]
        return 1e6 * dx["value"], [1e6 * one for one in dx["ci95"]]

    changes = rows("changes")
    assert len(changes) == 2, changes
    (before, low), (after, high) = found(COLLISION - 1), found(COLLISION)
    numbers = [float(one.replace("−", "-")) for one in re.search(r"dx = ([−0-9.]+)\s±\s[0-9.]+\sµm → ([−0-9.]+)\s±", changes[0]).groups()]
    assert day(COLLISION) in changes[0] and all(abs(a - b) < 0.06 for a, b in zip(numbers, (before, after), strict=True)), (changes[0], before, after)
    planted, spread = OFFSETS[True] - OFFSETS[False], max(low[1] - low[0], high[1] - high[0])
    assert abs(after - before - planted) < spread, (before, after, planted, spread)
    print(f"a change is told in the week of the collision and no other: {after - before:.1f} µm, planted {planted:.1f} µm, 95 % intervals {spread:.1f} µm wide")

    ratios = [f"{gap.rms / gap.noise_floor:.1f}" for gap in gaps]
    (declared,) = [one for one in reports[ADOPTED]["declared"] if one["effect"] == EFFECT]
    told = [f"{1e6 * declared[which][size]:.1f} µm" for which in ("promised", "achieved") for size in ("rms_before", "rms_after")]
    assert day(ADOPTED) in changes[1] and "Adopted" in changes[1], changes[1]
    assert f"{ratios[ADOPTED - 1]} → {ratios[ADOPTED]} × noise" in changes[1], (changes[1], ratios)
    assert "promised {} → {} rms, achieved {} → {} rms".format(*told) in changes[1], (changes[1], told)
    print("the adoption is told in the week after it, with the gap before and after, what it promised and what it achieved:", told)

    sizes = rows("days")
    recordings = page.locator("section[aria-labelledby=all-title] tbody tr").all_text_contents()
    # One part a day, with its reading; marked where the reference contradicts that.
    days = lambda row: {at: (value, bool(mark)) for at, mark, value in re.findall(r"(\d{4}-\d\d-\d\d)1(1 contradicted)?([−+]?\d+\.\d)", row)}
    doubted = [refuted(bag) for bag in bags]
    assert any(doubted), doubted
    for week, bag in enumerate(bags):
        newest = {(one.feature_id, round(1e4 * one.nominal_size * 1e3)): one for one in messages(bag, "feature_results")}
        for (feature, nominal), one in newest.items():
            (row,) = [row for row in sizes if row.startswith(f"{feature} ") and f"nominal {nominal / 1e4:.4f} mm" in row]
            expected = (shown(1e6 * one.size_deviation), feature in doubted[week])
            assert days(row)[day(week)] == expected, (row, week, one.size_deviation, expected)
        tools = {one.correction_id: one.tool_number for one in messages(bag, "corrections")}
        (row,) = [row for row in recordings if row.startswith(bag.name)]
        offsets = {tools[one.correction_id]: one.value_after for one in messages(bag, "correction_acknowledgements")}
        assert offsets and all(f"tool {tool} {shown(1e6 * value)}" in row for tool, value in offsets.items()), (row, offsets)
        assert ratios[week] in row, (row, ratios[week])
    print(f"sizes of each day, gaps and offsets are those of the recordings; those of {sum(map(bool, doubted))} weeks are marked as contradicted by the reference")


def main(folder):
    with sync_playwright() as playwright:
        made = pathlib.Path(os.environ.get("RECORDINGS", folder / "made"))
        if not made.exists():
            begun = time.monotonic()
            make(folder, made)
            print(f"{WEEKS} recordings in {time.monotonic() - begun:.0f} s")
        server = started("dashboard", "--recordings", made, folder=folder)
        server.says("dashboard: http://")
        chromium = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"] if os.getuid() == 0 else [])
        browser = Browser(chromium)
        with browser.page() as page:
            page.goto(f"http://{ADDRESS}/machine/turn_mill")
            compare(page, sorted(made.glob("week_*.mcap")))
        browser.audit("/machine/turn_mill", "machine")
        with browser.page() as page:
            page.goto(f"http://{ADDRESS}/machine/turn_mill")
            (told,) = page.locator("section[aria-labelledby=changes-title] li.unsure").all_inner_texts()
            page.goto(f"http://{ADDRESS}/machines")
            assert page.locator(".listing li.unsure").all_inner_texts() == [told], told
        print("machines: the change of the machine, as its own page tells it")
        server.end()
        chromium.close()


kit.main({"months": main})
