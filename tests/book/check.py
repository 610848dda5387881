#!/usr/bin/env python3
"""The book (docs/SUMMARY.md): every link leads somewhere, also of README and the pages beside it, every command runs and prints what the page
shows, every configuration is taken by the program.

    check.py PROBECELL [WORD]      WORD: only pages whose path contains it

Each page has a network namespace, keys and a folder of its own, with launch-scripts, templates, bags and msgs of the project in it, in which
its blocks are carried out in order:

    ```console               `$ COMMAND` and what it prints. `…` stands for any text, on a line of its own for any lines. A command that
                             ends with ` &` goes on while the following run; the next one waits until it has printed each shown line.
                             Without shown lines nothing is compared. Every command ends with status 0 (`; echo "status $?"` shows another).
    ```console terminal=WORD what the command with WORD, which goes on, prints meanwhile
    ```LANGUAGE file=NAME    is written to NAME; a `toml` of these is checked by `probecell doctor`
    ```toml [into=CELL]      sections of a cell file, put into launch-scripts/CELL (turn_mill.toml) and checked by `probecell doctor`

Other languages are neither; a block that holds a line `probecell …` and is none of these is an error.
"""

import os
import pathlib
import re
import shutil
import sys
import tomllib

import tomli_w

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "tests"))
import kit  # noqa: E402

DOCS = ROOT / "docs"
PROGRAM = pathlib.Path(sys.argv[1]).resolve()
LONGEST = 300  # s, of one command
MAX_PAGE_LINES = 150  # a longer page is split by subject
COUNTS = "counts.txt"  # in the folder of a page
SHOWN = ("launch-scripts", "templates", "bags", "msgs")
BESIDE = ["README.md", "ARCHITECTURE.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md", "neighbours/python/README.md"]


def pages():
    """Pages of the book, in order."""
    return [DOCS / target for target in re.findall(r"\]\(([^)#]+\.md)\)", (DOCS / "SUMMARY.md").read_text())]


def included(path):
    """Text of a page, with what it includes."""
    def whole(match):
        name, _, anchor = match[1].partition(":")
        text = (path.parent / name).read_text()
        if anchor:
            (text,) = re.findall(rf"ANCHOR: {anchor}\b.*?\n(.*?)[^\n]*ANCHOR_END: {anchor}\b", text, re.DOTALL)
        return text

    return re.sub(r"\{\{#include ([^}]+)\}\}", whole, path.read_text())


def blocks(text):
    """Language, attributes, content and line of each fenced block."""
    for match in re.finditer(r"^```([^\n`]*)\n(.*?)^```$", text, re.DOTALL | re.MULTILINE):
        language, *attributes = match[1].split() or [""]
        yield language, dict(one.split("=", 1) for one in attributes), match[2], text[: match.start()].count("\n") + 1


# -- links ---------------------------------------------------------------------------------------------------------------------------


def anchors(path):
    """Anchors of the headings of a page, as mdBook and GitHub make them."""
    text = re.sub(r"^```.*?^```$", "", included(path), flags=re.DOTALL | re.MULTILINE)
    found = set()
    for heading in re.findall(r"^#+ (.+)$", text, re.MULTILINE):
        plain = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading)
        found.add(re.sub(r"[^\w\- ]", "", plain.lower()).strip().replace(" ", "-"))
    return found


def links(page):
    """Links of a page to files: as written, with the file and the anchor that they lead to."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
    for target in re.findall(r"\]\(([^)\s]+)\)", re.sub(r"`[^`\n]*`", "", text)):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        to = (page.parent / name).resolve() if name else page
        assert to.exists(), f"{page}: {target} leads nowhere"
        assert not anchor or anchor in anchors(to), f"{page}: {target}: there is no such heading"
        yield target, to


def check_links(book):
    known, count = set(book), 0
    for page in book:
        assert page.is_file(), f"SUMMARY.md names {page}, which is not there"
        lines = page.read_text().count("\n")
        assert lines <= MAX_PAGE_LINES, f"{page} has {lines} lines: split it by subject"
        for target, to in links(page):
            assert DOCS in to.parents, f"{page}: {target} leads out of the book"
            assert to.suffix != ".md" or to in known, f"{page}: {target} is not in SUMMARY.md"
            count += 1
    count += sum(1 for name in BESIDE for _ in links(ROOT / name))
    for path in DOCS.rglob("*.md"):
        assert path in known or path.name == "SUMMARY.md", f"{path} is not in SUMMARY.md"
    print(f"good    {len(book)} pages, {len(BESIDE)} beside them, {count} links", flush=True)


# -- commands ------------------------------------------------------------------------------------------------------------------------


def commands(content):
    """Commands of a console block with the lines that are shown below each."""
    found = []
    for line in content.splitlines():
        if line.startswith("$ "):
            found.append((line[2:], []))
        elif found and found[-1][0].endswith("\\"):
            found[-1] = (found[-1][0][:-1].rstrip() + " " + line.strip(), found[-1][1])
        else:
            assert found, f"output before any command: {line!r}"
            found[-1][1].append(line)
    return found


def as_pattern(shown):
    """Shown lines as a regular expression."""
    lines = []
    for line in shown:
        if line.strip() == "…":
            lines.append(r"(?:[^\n]*\n)*?")
        else:
            # Blanks stand for blanks, as many as there are.
            words = [re.escape(word).replace("…", "[^\\n]*?") for word in line.split()]
            lines.append(r"[ \t]*" + r"[ \t]+".join(words) + r"[ \t]*\n")
    return "".join(lines)


class Background:
    """A command that goes on; what it prints is read as it comes."""

    def __init__(self, command, folder, environment):
        self.command = command
        self.process = kit.Process("bash", "-c", f"exec {command}", folder=folder, environment=environment)

    def says(self, shown):
        """Waits until all shown lines have come, in whatever order: processes of a cell speak as they are scheduled."""
        for line in shown:
            if line.strip() == "…":
                continue
            pattern = re.compile("^" + as_pattern([line]), re.MULTILINE)

            def found(pattern=pattern):
                is_silent = self.process.is_silent()
                return pattern.search(self.process.output) or is_silent

            kit.until(f"{line!r} of {self.command}", found, LONGEST)
            assert pattern.search(self.process.output), f"{self.command} has ended without {line!r}:\n{self.process.output}"


def search_path():
    """Where the commands of a page are looked for."""
    places = [PROGRAM.parent, pathlib.Path(sys.executable).parent]
    return ":".join([*map(str, places), os.environ["PATH"]])


def run_page(folder, page):
    """Carries out the blocks of a page, and leaves the numbers of commands and configurations."""
    for name in SHOWN:
        (folder / name).symlink_to(ROOT / name)
    environment = os.environ | {
        "PATH": search_path(),
        "HOME": str(folder),
        "USER": os.environ.get("USER", "operator"),
    }
    running, counts = [], [0, 0]
    for language, attributes, content, line in blocks(included(page)):
        place = f"{page.relative_to(ROOT)}:{line}"
        if "terminal" in attributes:
            (one,) = [one for one in running if attributes["terminal"] in one.command]
            one.says(content.splitlines())
        elif language == "console":
            for command, shown in commands(content):
                run(command, shown, place, folder, environment, running)
                counts[0] += 1
        elif "file" in attributes:
            (folder / attributes["file"]).write_text(content)
            if language == "toml":
                load(folder / attributes["file"], place, environment)
                counts[1] += 1
        elif language == "toml":
            load(merged(content, attributes.get("into", "turn_mill.toml"), folder), place, environment)
            counts[1] += 1
        else:
            loose = [line for line in content.splitlines() if re.match(r"(\$ )?probecell ", line)]
            assert not loose, f"{place}: no test runs {loose[0]!r}: make the block `console`"
    for one in reversed(running):
        one.process.end(seconds=LONGEST)
    (folder / COUNTS).write_text(" ".join(map(str, counts)))


def run(command, shown, place, folder, environment, running):
    if command.endswith(" &"):
        running.append(Background(command[:-2], folder, environment))
        return running[-1].says(shown)
    code, printed = finished("bash", "-c", command, folder=folder, environment=environment)
    assert code == 0, f"{place}: {command} ended with status {code}:\n{printed}"
    if shown and not re.fullmatch(as_pattern(shown) + r"\s*", printed if printed.endswith("\n") else printed + "\n"):
        raise AssertionError(f"{place}: {command}\n--- the page shows\n" + "\n".join(shown) + f"\n--- it prints\n{printed}")


def finished(*words, folder, environment):
    """Status of a command, and its output with its errors in it."""
    code, printed, _ = kit.Process(*words, folder=folder, environment=environment).ended(LONGEST)
    return code, printed


# -- configurations ------------------------------------------------------------------------------------------------------------------


def merged(fragment, into, folder):
    """A cell file with the sections of a page in it, beside the robot descriptions."""
    cell = tomllib.loads((ROOT / "launch-scripts" / into).read_text())

    def put(old, new):
        for key, value in new.items():
            if isinstance(value, dict) and isinstance(old.get(key), dict):
                put(old[key], value)
            elif isinstance(value, list) and isinstance(old.get(key), list):
                old[key] = old[key] + value
            else:
                old[key] = value

    put(cell, tomllib.loads(fragment))
    for description in (ROOT / "launch-scripts").glob("*.urdf"):
        (folder / description.name).write_text(description.read_text())
    path = folder / "of_the_page.toml"
    path.write_text(tomli_w.dumps(cell))
    return path


def load(path, place, environment):
    """The program takes a cell file."""
    _, printed = finished(PROGRAM, "doctor", path.name, folder=path.parent, environment=environment)
    assert re.search(r"^good +cell file:", printed, re.MULTILINE), f"{place}: the program refuses it:\n{printed}"


def main():
    wanted = sys.argv[2] if len(sys.argv) > 2 else ""
    book = pages()
    if not wanted:
        check_links(book)
    totals = [0, 0]
    for page in book:
        if wanted not in str(page.relative_to(DOCS)):
            continue
        asks_lake = re.search(r"^\$ probecell (lake|fleet) ", included(page), re.MULTILINE)
        if asks_lake and not shutil.which("probecell-fleet", path=search_path()):
            print(f"skipped: {page.relative_to(DOCS)}, which runs probecell-fleet: .ci/run fleet builds it and runs the page")
            continue
        with kit.new_folder() as folder:
            if not kit.apart(run_page, pathlib.Path(folder), page):
                raise SystemExit(f"FAILED: {page.relative_to(DOCS)}")
            counts = [int(one) for one in (pathlib.Path(folder) / COUNTS).read_text().split()]
        if any(counts):
            print(f"good    {page.relative_to(DOCS)}: {counts[0]} commands, {counts[1]} configurations", flush=True)
        totals = [a + b for a, b in zip(totals, counts)]
    print(f"{totals[0]} commands, {totals[1]} configurations")
    assert wanted or min(totals) > 0


if __name__ == "__main__":
    main()
