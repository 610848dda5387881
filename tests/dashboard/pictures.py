#!/usr/bin/env python3
"""Makes the pictures of docs/pictures of those that the tests have taken: pictures.py FOLDER_OF_PICTURES TARGET.

Every page at 1400, 800 and 390 px, light and dark; few colours, so that all together stay small.
"""

import pathlib
import sys

from PIL import Image

PAGES = ("hall_hosts", "wall", "cell_waiting", "cell", "sessions", "session", "session_ball_check", "machine", "compare", "report", "diagnosis")
COLOURS = 32
LONGEST = 1900  # px; what is below is on the other pictures


def main():
    source, target = map(pathlib.Path, sys.argv[1:])
    total = 0
    for page in PAGES:
        for width in ("1400", "800", "390"):
            for scheme in ("light", "dark"):
                file = source / f"{page}_{width}_{scheme}.png"
                picture = Image.open(file).convert("RGB")
                picture = picture.crop((0, 0, picture.width, min(picture.height, LONGEST)))
                if picture.width > 1000:
                    picture = picture.resize((picture.width * 4 // 7, picture.height * 4 // 7), Image.Resampling.LANCZOS)
                out = target / file.name
                picture.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(out, optimize=True)
                total += out.stat().st_size
    print(f"{total} bytes")


main()
