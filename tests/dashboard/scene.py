#!/usr/bin/env python3
"""The machine and its part in three dimensions: where the axes are, and the touches with their values.

    scene.py PROBECELL FOLDER

Chromium draws WebGL by its own software. What is drawn is read back from the page and compared with what the cell publishes: the frame of
the probe with the description of the machine written out by hand, the values under the pointer with the recording.
"""

import json
import math
import os
import re
import shutil
from xml.etree import ElementTree

import numpy as np
from pages import ADDRESS, ENDS, PICTURES, ROOT, SAMPLES, WIDTHS, Browser, axe, cell_file, started, twin, wait
from playwright.sync_api import sync_playwright

import kit
from kit.recordings import messages

SOFTWARE = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
# Where a processor draws, a person asks for the picture.
ASKED = "() => { const one = [...document.querySelectorAll('#part .turn button')][0]; one?.click(); return !!one; }"
DRAWN = "document.body.classList.contains('solid') && !!document.querySelector('#part canvas')?.dataset.mount"
# Each place that the frame of the probe was drawn at, with the axes of that instant.
POSES = """() => { window.poses = []; new MutationObserver(() => {
    const mount = document.querySelector('#part canvas')?.dataset.mount, axes = document.querySelector('#axes [data-joints]')?.dataset.joints;
    if (mount && axes && window.poses.at(-1)?.[0] !== mount) window.poses.push([mount, axes]);
}).observe(document.querySelector('#part canvas'), { attributes: true, attributeFilter: ['data-mount'] }); }"""


ARM = ROOT / "launch-scripts" / "robot_arm.urdf"
MOVED = """async (poses) => {
    const axes = document.querySelector('#axes [data-joints]'), drawn = [];
    for (const pose of poses) {
        axes.dataset.joints = JSON.stringify(pose);
        dispatchEvent(new Event('put'));
        await new Promise(requestAnimationFrame);
        drawn.push(document.querySelector('#part canvas').dataset.mount);
    }
    return drawn;
}"""
SCRUBBED = """async () => {
    const slider = document.getElementById('t'), steps = 20, begun = performance.now();
    for (let step = 0; step < steps; step += 1) {
        slider.value = 8 + step;
        slider.dispatchEvent(new Event('input', { bubbles: true }));
        while (!document.getElementById('instant').innerText.startsWith(`${8 + step}.0 s`)) await new Promise(requestAnimationFrame);
    }
    return [1000 * steps / (performance.now() - begun), steps];
}"""


def mount(axes):
    """Of turn_mill.urdf: Z at 0.2 m along z, on it X at 0.1 m along x, on it Y; the part turns about C and carries none of these."""
    return axes["X"] + 0.1, axes["Y"], axes["Z"] + 0.2


def chain(urdf, link):
    """Joints from the root to a link: fixed transformation, kind and axis of each."""
    carried = {one.find("child").get("link"): one for one in ElementTree.parse(urdf).getroot().findall("joint")}
    found = []
    while link in carried:
        one = carried[link]
        origin, axis = one.find("origin"), one.find("axis")
        roll, pitch, yaw = numbers(origin, "rpy", (0, 0, 0))
        fixed = np.eye(4)
        fixed[:3, :3] = turn((0, 0, 1), yaw) @ turn((0, 1, 0), pitch) @ turn((1, 0, 0), roll)
        fixed[:3, 3] = numbers(origin, "xyz", (0, 0, 0))
        found.insert(0, (one.get("name"), one.get("type"), fixed, numbers(axis, "xyz", (1, 0, 0))))
        link = one.find("parent").get("link")
    return found


def numbers(element, name, standard):
    text = None if element is None else element.get(name)
    return np.array(text.split() if text else standard, dtype=float)


def turn(axis, angle):
    """Rotation matrix after Rodrigues."""
    x, y, z = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def place(joints, axes):
    whole = np.eye(4)
    for name, kind, fixed, axis in joints:
        moved = np.eye(4)
        if kind == "prismatic":
            moved[:3, 3] = axes[name] * axis
        elif kind != "fixed":
            moved[:3, :3] = turn(axis, axes[name])
        whole = whole @ fixed @ moved
    return whole[:3, 3]


def arm(browser):
    """A six-axis arm in a thousand poses: the frame of its probe is drawn where the chain of its description has it."""
    joints = chain(ARM, "probe_mount")
    names = [name for name, kind, *_ in joints if kind != "fixed"]
    random = np.random.default_rng(7)
    poses = [dict(zip(names, map(float, random.uniform(-math.pi, math.pi, len(names))))) for _ in range(1000)]
    with browser.page("390") as page:
        page.route("**/description*", lambda route: route.fulfill(body=ARM.read_text(), content_type="text/plain"))
        page.goto(f"http://{ADDRESS}/session/punch.mcap")
        wait(page, ASKED)
        wait(page, DRAWN)
        drawn = page.evaluate(MOVED, poses)
    far = [np.linalg.norm(np.array(one.split(), dtype=float) - place(joints, axes)) for one, axes in zip(drawn, poses)]
    assert len(names) == 6 and len(set(drawn)) == len(poses) and max(far) < 2e-6, (names, max(far))
    print(f"3D: {len(poses)} poses of an arm drawn where its chain has them, at most {max(far) * 1e6:.1f} µm away")


def posed(page):
    poses = [(tuple(map(float, drawn.split())), json.loads(axes)) for drawn, axes in page.evaluate("window.poses")]
    worst = max(math.dist(drawn, mount(axes)) for drawn, axes in poses)
    assert len(poses) >= 20 and len({drawn for drawn, _ in poses}) >= 10, poses
    assert worst < 2e-6, worst
    print(f"3D: {len(poses)} poses of the probe drawn where the axes are, at most {worst * 1e6:.1f} µm away")


def read(page):
    """What the picture says under the pointer, all over it."""
    frame = page.locator("#part canvas").bounding_box()
    said = set()
    for row in range(1, 60):
        for column in range(1, 60):
            page.mouse.move(frame["x"] + frame["width"] * column / 60, frame["y"] + frame["height"] * row / 60)
        said.add(page.inner_text("#part output"))
        for column in range(20, 42):
            page.mouse.move(frame["x"] + frame["width"] * column / 60, frame["y"] + frame["height"] * row / 60)
            said.add(page.inner_text("#part output"))
    found = [re.fullmatch(r"(\S+), point (\d+): ([−+][0-9.]+) µm, u ([0-9.]+) µm", one) for one in said]
    return {int(one[2]): (one[1], float(one[3].replace("−", "-"))) for one in found if one}


def valued(page, touches, plan):
    said = read(page)
    assert len(said) >= 8, said
    for index, (feature, deviation) in said.items():
        assert feature == plan["features"][plan["points"][index]["feature"]]["id"], (index, feature)
        assert abs(deviation - touches[index] * 1e6) < 0.06, (index, deviation, touches[index])
    print(f"3D: {len(said)} of {len(touches)} touches found by the pointer, with the values that were published")


def pictures(browser):
    """The page of the cell in both schemes and at all widths, without a violation of axe-core."""
    for scheme in ("light", "dark"):
        for width in WIDTHS:
            with browser.page(width, scheme) as page:
                page.goto(f"http://{ADDRESS}/cell/mill_a")
                wait(page, ASKED)
                wait(page, DRAWN)
                wide = page.evaluate("[document.documentElement.scrollWidth, document.documentElement.clientWidth]")
                assert wide[0] <= wide[1], (width, wide)
                page.screenshot(path=PICTURES / f"cell_3d_{width}_{scheme}.png", full_page=True)
                told = axe(page)
                assert not told, told


def live(browser, folder):
    file = cell_file(folder, "mill_a")
    cell = started("up", file, folder=folder)
    cell.says("is ready")
    with browser.page() as page:
        page.goto(f"http://{ADDRESS}/cell/mill_a")
        run = started("run", "punch_1", "--cell", file, folder=folder)
        wait(page, ASKED)
        wait(page, DRAWN)
        page.evaluate(POSES)
        page.evaluate("document.querySelector('#part canvas').dataset.kept = 'yes'")
        wait(page, f"/punch_1, ({ENDS})/.test(document.querySelector('#state').innerText)")
        run.end()
        posed(page)
        assert page.evaluate("document.querySelector('#part canvas').dataset.kept") == "yes", "the picture was made anew"
        drawn = page.evaluate("JSON.parse(document.querySelector('#part .scene').dataset.part)")
        bottom = page.evaluate("document.querySelector('#part .heat').getBoundingClientRect().bottom")
        assert bottom <= 900, f"the picture and its legend are above the fold: {bottom}"
        page.click("#part .looks button:has-text('Machine')")
        page.keyboard.press("Tab")
        told = axe(page)
        assert not told, told
        page.click("#part .looks button:has-text('Sketch')")
        assert page.is_visible("#part svg.part") and not page.is_visible("#part canvas")
    pictures(browser)
    cell.end()
    (bag,) = (folder / "recordings").glob("mill_a_*")
    published = messages(bag)
    touches = {one.point_index: one.deviation for one in published["touch_deviations"] if one.plan_id == drawn["plan"]}
    assert {int(index): value[0] for index, value in drawn["touches"].items()} == {index: round(value * 1e6, 2) + 0.0 for index, value in touches.items()}
    order = [one for one in published["measurement_order"] if one.plan_id == drawn["plan"]][-1]
    assert drawn["order"] == list(order.order)
    print(f"3D: {len(touches)} touches and their order drawn as they were published")


def session(browser, folder):
    shutil.copy(SAMPLES / "punch.mcap", folder)
    server = started("dashboard", "--recordings", folder, folder=folder)
    server.says("dashboard: http://")
    with browser.page(scheme="dark") as page:
        page.goto(f"http://{ADDRESS}/session/punch.mcap")
        wait(page, ASKED)
        wait(page, DRAWN)
        plan = twin("punch", "inspection_plan")[-1][1]
        touches = {one["point_index"]: one["deviation"] for _, one in twin("punch", "touch_deviations") if one["plan_id"] == plan["plan_id"]}
        valued(page, touches, plan)
        rate, steps = page.evaluate(SCRUBBED)
        print(f"3D: {steps} instants of a session, each drawn by the processor, at {rate:.0f} a second")
    arm(browser)
    server.end()


def main(folder):
    with sync_playwright() as playwright:
        flags = SOFTWARE + (["--no-sandbox"] if os.getuid() == 0 else [])
        chromium = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=flags)
        browser = Browser(chromium)
        session(browser, folder)
        live(browser, folder)
        foreign = {url for url in browser.requests if not re.match(rf"http://{re.escape(ADDRESS)}/", url)}
        assert not foreign and not browser.errors, (foreign, browser.errors)
        chromium.close()


kit.main({"scene": main})
