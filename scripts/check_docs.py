#!/usr/bin/env python3
"""Check that every file that the documents name is there, and that pages can be read.

    python3 scripts/check_docs.py [--list]

Looks at README.md, CONTRIBUTING.md, docs/, the READMEs of the crates and of packaging: targets of links, headings that links point to,
and paths in backticks that begin with a folder of the project. Words in capitals such as NAME stand for any name and are
not looked up. docs/history is left out: it names what was there.

Cells of tables in README.md and docs/ have at most 200 characters: what is longer is a paragraph. `--list` prints those that
are longer. README.md has a length that is read at once. Exit code 0 if all of it holds, 1 if not.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
HISTORY = ROOT / "docs/history"
LONGEST_CELL = 200
# Pages with longer cells, and how many of them: to become fewer.
LONGER_CELLS: dict[str, int] = {}
LONGEST_README = 150
FOLDERS = "benches|crates|designs|docs|examples|golden|packaging|processes|python|rules|scripts|src|tests"
LINK = re.compile(r"\]\(([^)#\s]*)(#[^)\s]*)?\)")
PATH = re.compile(rf"`((?:{FOLDERS})/[\w./-]*)")


def anchors(page: Path) -> set[str]:
    """Headings of a page as links name them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.M)
    return {"#" + re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def faults(page: Path) -> list[str]:
    """What a page names that is not there, with the line."""
    wrong = []
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
        place = f"{page.relative_to(ROOT)}:{number}"
        for target, anchor in LINK.findall(line):
            if target.startswith(("http:", "https:")):
                continue
            file = page.parent / target if target else page
            if not file.exists():
                wrong.append(f"{place}: the link to {target} leads nowhere")
            elif anchor and file.suffix == ".md" and anchor not in anchors(file):
                wrong.append(f"{place}: {target or 'this page'} has no heading {anchor}")
        for path in PATH.findall(line):
            path = path.rstrip(".")
            if not re.search(r"(^|/)[A-Z]+(/|\.|$)", path) and not (ROOT / path).exists():
                wrong.append(f"{place}: there is no {path}")
    return wrong


def long_cells(page: Path) -> list[str]:
    """Cells of tables that are longer than they may be, each with its line and its beginning."""
    found = []
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
        if line.lstrip().startswith("|"):
            # A bar in a cell stands behind a backslash.
            cells = (cell.strip() for cell in re.split(r"(?<!\\)\|", line))
            place = f"{page.relative_to(ROOT)}:{number}"
            found += [f"{place}: {len(cell)} characters: {cell[:60]}..." for cell in cells if len(cell) > LONGEST_CELL]
    return found


def too_long(pages: list[Path], listed: bool) -> list[str]:
    """Pages with more long cells than are excused, and a README that is too long."""
    wrong = []
    for page in pages:
        name, found = str(page.relative_to(ROOT)), long_cells(page)
        if listed and found:
            print("\n".join(found))
        excused = LONGER_CELLS.get(name, 0)
        if len(found) > excused:
            wrong += [f"{name}: {len(found)} cells of tables are longer than {LONGEST_CELL} characters, {excused} are excused:", *found]
        elif len(found) < excused:
            print(f"{name}: {len(found)} long cells of tables, {excused} are excused: lower the number in {Path(__file__).name}")
    lines = len((ROOT / "README.md").read_text(encoding="utf-8").splitlines())
    if lines > LONGEST_README:
        wrong.append(f"README.md: {lines} lines, at most {LONGEST_README}")
    return wrong


def main() -> int:
    readme, docs = ROOT / "README.md", [p for p in (ROOT / "docs").rglob("*.md") if HISTORY not in p.parents]
    pages = sorted([readme, ROOT / "CONTRIBUTING.md", *docs, *ROOT.glob("crates/*/README.md"), *ROOT.glob("packaging/*.md")])
    wrong = [fault for page in pages for fault in faults(page)]
    wrong += too_long(sorted([readme, *docs]), "--list" in sys.argv[1:])
    print("\n".join(wrong) if wrong else f"{len(pages)} pages name only files that are there")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
