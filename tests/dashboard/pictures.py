#!/usr/bin/env python3
"""Makes the pictures of docs/pictures of those that the tests have taken: pictures.py FOLDER_OF_PICTURES TARGET.

Every page at 1400, 800 and 390 px, light and dark, and the sheets of the printed pages beside one another; few colours, so that all
together stay small.
"""

import pathlib
import sys

from PIL import Image

PAGES = ("hall_hosts", "hall_24", "wall", "cell_waiting", "cell_3d", "sessions", "session", "session_ball_check", "machine", "compare", "report", "diagnosis")
PRINTED = ("report_printed", "diagnosis_printed")
COLOURS = 200
LONGEST = 1900  # px; what is below is on the other pictures
SHEET, ACROSS, GAP = 480, 4, 12  # px wide, in a row, px between


def saved(picture, out):
    picture.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(out, optimize=True)
    return out.stat().st_size


def page(file):
    picture = Image.open(file).convert("RGB")
    picture = picture.crop((0, 0, picture.width, min(picture.height, LONGEST)))
    if picture.width > 1000:
        picture = picture.resize((picture.width * 4 // 7, picture.height * 4 // 7), Image.Resampling.LANCZOS)
    return picture


def sheets(files):
    assert files, "no printed page"
    pictures = [Image.open(file).convert("RGB") for file in files]
    height = SHEET * pictures[0].height // pictures[0].width
    across = min(ACROSS, len(pictures))
    rows = -(-len(pictures) // across)
    whole = Image.new("RGB", (across * (SHEET + GAP) + GAP, rows * (height + GAP) + GAP), (150, 150, 150))
    for index, one in enumerate(pictures):
        at = (GAP + index % across * (SHEET + GAP), GAP + index // across * (height + GAP))
        whole.paste(one.resize((SHEET, height), Image.Resampling.LANCZOS), at)
    return whole


def main():
    source, target = map(pathlib.Path, sys.argv[1:])
    names = [f"{page}_{width}_{scheme}.png" for page in PAGES for width in ("1400", "800", "390") for scheme in ("light", "dark")]
    total = sum(saved(page(source / name), target / name) for name in names)
    for name in PRINTED:
        total += saved(sheets(sorted(source.glob(f"{name}_sheet_*.png"))), target / f"{name}.png")
    print(f"{total} bytes")


main()
