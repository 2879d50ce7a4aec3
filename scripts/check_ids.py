#!/usr/bin/env python3
"""Hold the list of the identities of refusals and warnings, `docs/identities.md`, to the sources.

    python3 scripts/check_ids.py [--write]

An identity is `subject/what-is-wrong`: a subject that the user touched (a command, a section, a file), and words of the field. Callers
and tests match on it, so it outlives its message. A new, renamed or removed one changes the list, which a review reads. `--write`
writes the list. Exit code 0 if it holds, 1 if not. Mistakes in text files have identities of another form, `key/kind`, and are not in it.
"""

import argparse
import re
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LIST = ROOT / "docs" / "identities.md"
ID = r"[a-z]+/[a-z]{2,}(?:-[a-z]+)*"
# A literal as the first argument of a call, in a tuple, or the answer of an arm: `Self::Pitch { .. } => "rcwa/pitch-out-of-range"`.
PLACES = [
    re.compile(rf'\b(?:refused?|refuse|fault|warning|Warning::new)\(\s*"({ID})"'),
    re.compile(rf'=>\s*"({ID})",'),
    re.compile(rf'\(\s*"({ID})",\s*(?:"|format!)'),
    re.compile(rf'\([a-z_]+, "[a-z]+", "({ID})"\)'),
]
HEAD = """# Identities of refusals and warnings

The identity of a refusal stands in brackets on standard error, `error[subject/what-is-wrong]`; `Error::id` returns it. The text of
a message may change, its identity stays. Written by `python3 scripts/check_ids.py --write`.

| identity | crate |
| --- | --- |
"""


def identities() -> dict[str, set[str]]:
    """Each identity of the sources without their tests, with the crates that refuse by it."""
    listed = subprocess.run(["git", "ls-files", "--", "*.rs"], cwd=ROOT, capture_output=True, text=True, check=True)
    found = defaultdict(set)
    for file in listed.stdout.split():
        parts = Path(file).parts
        if parts[0] in ("examples", "tests", "benches") or {"tests", "examples"} & set(parts) or parts[-1] == "tests.rs":
            continue
        text = (ROOT / file).read_text(encoding="utf-8").split("#[cfg(test)]\nmod tests {")[0]
        crate = parts[1] if parts[0] == "crates" else {"src": "program"}.get(parts[0], parts[0])
        for place in PLACES:
            for identity in place.findall(text):
                found[identity].add(crate)
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="write the list")
    arguments = parser.parse_args()
    rows = (f"| `{identity}` | {', '.join(sorted(crates))} |\n" for identity, crates in sorted(identities().items()))
    text = HEAD + "".join(rows)
    if arguments.write:
        LIST.write_text(text, encoding="utf-8")
    elif not LIST.exists() or LIST.read_text(encoding="utf-8") != text:
        print("docs/identities.md differs from the sources: `python3 scripts/check_ids.py --write`, then read the difference")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
