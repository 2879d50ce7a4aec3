#!/usr/bin/env python3
"""Check that every file that the documents name is there.

    python3 scripts/check_docs.py

Looks at README.md, CONTRIBUTING.md, docs/ and the READMEs of the crates: targets of links, headings that links point to,
and paths in backticks that begin with a folder of the project. Words in capitals such as NAME stand for any name and are
not looked up. Exit code 0 if all are there, 1 if not.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = "benches|crates|designs|docs|examples|golden|processes|python|rules|scripts|src|tests"
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


def main() -> int:
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md"), *ROOT.glob("crates/*/README.md")]
    wrong = [fault for page in sorted(pages) for fault in faults(page)]
    print("\n".join(wrong) if wrong else f"{len(pages)} pages name only files that are there")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
