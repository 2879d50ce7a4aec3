#!/usr/bin/env python3
"""Hold the crates of the workspace to the map in docs/architecture.md.

    python3 scripts/check_crates.py

The table of that page between the two markers `crates: begin` and `crates: end` is the only statement of which
crate may use which. This script reads it, reads `cargo metadata`, and fails if

- a crate has a normal or a build dependency on a crate of the workspace that its row does not name
  (dev-dependencies are free: tests may use anything);
- a row names a crate that stands below it, so that the table could hold a circle;
- a crate has no row, or a row has no crate;
- one of the crates that stand alone (oasis, gds, rcwa, wave) may use, or uses, more than core and pillars (gds also oasis, wave also fourier);
- a crate of the program uses `testing`, which is for tests only.

Exit code 0 if all of it holds, 1 if not.
"""

import json
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "architecture.md"
PREFIX = "metalith-"
# Crates that others may take without the rest of the project, and all that they may use of it.
STAND_ALONE = {
    "oasis": set(),
    "gds": {"core", "pillars", "oasis"},
    "rcwa": {"core", "pillars"},
    "wave": {"core", "fourier", "pillars"},
}
# For dev-dependencies only.
TESTS_ONLY = "testing"


def short(package: str) -> str:
    """`gds` for `metalith-gds`; the package at the root keeps its name."""
    return package.removeprefix(PREFIX)


def read_table(page: str) -> tuple[dict[str, set[str]], list[str]]:
    """What each crate may use, in the order of the rows, and what is wrong with the table itself."""
    found = re.search(r"<!-- crates: begin -->\n(.*?)<!-- crates: end -->", page, re.S)
    if not found:
        return {}, ["no table between `<!-- crates: begin -->` and `<!-- crates: end -->`"]
    rows: dict[str, set[str]] = {}
    wrong = []
    lines = [line for line in found.group(1).splitlines() if line.startswith("|")]
    for line in lines[2:]:  # below the head and its rule
        name, uses = (cell.strip().strip("`") for cell in line.strip("|").split("|")[:2])
        if name in rows:
            wrong.append(f"a second row for `{name}`: keep one")
        if uses == "all":
            allowed = set(rows) - {TESTS_ONLY}
        else:
            allowed = {use.strip().strip("`") for use in uses.split(",") if use.strip()}
        for use in sorted(allowed - set(rows)):
            wrong.append(f"`{name}` may use `{use}`, which has no row above: use runs upwards in the table")
        if extra := allowed - STAND_ALONE.get(name, allowed):
            listed = ", ".join(sorted(extra))
            wrong.append(f"`{name}` stands alone, its row also names {listed}")
        rows[name] = allowed
    return rows, wrong


def read_workspace() -> dict[str, set[str]]:
    """What each crate of the workspace uses of it, dev-dependencies left out."""
    command = ["cargo", "metadata", "--locked", "--format-version", "1", "--no-deps"]
    answer = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE).stdout
    packages = json.loads(answer)["packages"]
    ours = {package["name"] for package in packages}
    return {
        short(package["name"]): {
            short(d["name"]) for d in package["dependencies"] if d["name"] in ours and d["kind"] != "dev"
        }
        for package in packages
    }


def compare(rows: dict[str, set[str]], uses: dict[str, set[str]]) -> list[str]:
    """Where the workspace and the table differ."""
    wrong = [f"`{name}` is in the workspace and has no row: add one" for name in sorted(set(uses) - set(rows))]
    wrong += [f"`{name}` has a row and is not in the workspace: remove the row" for name in rows if name not in uses]
    for name, used in sorted(uses.items()):
        allowed = rows.get(name)
        if allowed is None:
            continue
        for use in sorted(used - allowed):
            if use == TESTS_ONLY:
                wrong.append(f"`{name}` depends on `{use}`: make it a dev-dependency")
                continue
            listed = ", ".join(sorted(allowed)) or "no other crate"
            wrong.append(
                f"`{name}` depends on `{use}`; its row allows {listed}. Remove the dependency from "
                f"{'Cargo.toml' if name == 'metalith' else f'crates/{name}/Cargo.toml'}, or change the row "
                "if the new direction of use is wanted"
            )
    return wrong


def main() -> int:
    rows, wrong = read_table(PAGE.read_text(encoding="utf-8"))
    if rows:
        wrong += compare(rows, read_workspace())
    for fault in wrong:
        print(f"{PAGE.relative_to(ROOT)}: {fault}", file=sys.stderr)
    if not wrong:
        print(f"{len(rows)} crates use what the table of {PAGE.relative_to(ROOT)} allows")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
