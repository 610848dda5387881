#!/usr/bin/env python3
"""Pages that the command line writes, read by another program: well-formed, alone, and with the numbers of the JSON.

    pages.py PROBECELL

Every scenario's page is checked where it is made (crates/validation); here it is the way through the command line, on
scenarios that take no time. Needs nothing but Python.
"""

import html.parser
import json
import math
import pathlib
import re
import sys

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1]))
import kit  # noqa: E402

NAMES = ["C-shaft", "C-slip", "D-blind", "E-twist"]
VOID = {"meta"}


class Page(html.parser.HTMLParser):
    """Rows of all tables, and every element with its attributes; refuses what does not nest."""

    def __init__(self, text):
        super().__init__()
        self.open, self.elements, self.tables = [], [], []
        self.feed(text)
        self.close()
        assert not self.open, f"left open: {self.open}"

    def handle_starttag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))
        if tag not in VOID:
            self.open.append(tag)
        if tag == "table":
            self.tables.append([])
        elif tag == "tr":
            self.tables[-1].append([])
        elif tag in ("td", "th"):
            self.tables[-1][-1].append("")

    def handle_startendtag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        assert self.open and self.open.pop() == tag, f"</{tag}> closes nothing"

    def handle_data(self, data):
        if {"td", "th"} & set(self.open):
            self.tables[-1][-1][-1] += data


def same(cell, value):
    """A cell against a value of the JSON: words are equal, numbers to four digits."""
    if isinstance(value, str):
        return cell == value
    numbers = value if isinstance(value, list) else [value]
    shown = [float(word) for word in cell.split(", ")]
    return len(shown) == len(numbers) and all(
        math.isclose(one, other, rel_tol=5.1e-3) for one, other in zip(shown, numbers, strict=True)
    )


def check(name, text, row):
    page = Page(text)
    strangers = {"script", "img", "link", "iframe", "image", "object"} & {tag for tag, _ in page.elements}
    assert not strangers, strangers
    assert not any({"href", "src"} & set(attributes) for _, attributes in page.elements), "points elsewhere"
    assert not re.search(r"\b(nan|inf)\b", text, re.IGNORECASE), "a number is none"
    figures = page.tables[0][1:]
    assert len(figures) == len(row["figures"]), f"{len(figures)} figures"
    for cells, figure in zip(figures, row["figures"], strict=True):
        assert cells[0] == figure["title"] and cells[3] == figure["unit"], cells
        assert same(cells[2], row["ours"][figure["name"]]), cells
        if figure["source"] is not None:
            assert same(cells[1], row["source"][figure["name"]]), cells
        assert cells[4] == figure["rule"], cells
        assert not cells[4] or cells[5] == ("yes" if figure["pass"] else "NO"), cells
    pictures = sum(tag == "svg" for tag, _ in page.elements)
    assert pictures, "no picture"
    print(f"{name}: {len(figures)} figures, {pictures} pictures")


def run(probecell, *arguments):
    code, output, errors = kit.run(probecell, "scenario", "run", *arguments, seconds=300)
    assert code == 0, errors
    return json.loads(output)["scenarios"]


def main(probecell):
    with kit.new_folder() as folder:
        folder = pathlib.Path(folder)
        rows = run(probecell, *NAMES, "--json", "--html", str(folder / "pages"))
        assert [row["name"] for row in rows] == NAMES
        for row in rows:
            check(row["name"], (folder / "pages" / f"{row['name']}.html").read_text(), row)
        one = folder / "one.html"
        [row] = run(probecell, "E-twist", "--json", "--html", str(one))
        check("E-twist, one file", one.read_text(), row)


if __name__ == "__main__":
    raise SystemExit(not kit.guarded(main, sys.argv[1]))
