#!/usr/bin/env python3
"""Hold the tests that `cargo test` leaves out to the tiers that run them.

    python3 scripts/check_ignored.py LISTED    every ignored test of the sources is in a list of `cargo test -- --list --ignored`
    python3 scripts/check_ignored.py --full    print the names of those that `.ci/run` runs
    python3 scripts/check_ignored.py --weekly  print the options of `cargo test` that leave the other ones: `scripts/slow_tests.sh`

A test that is ignored is run weekly, unless it is named in FULL below or started by another test. So none is run nowhere, as
long as `cargo test` finds it at all: a test in a crate that is no default member, or behind a feature, is not in LISTED.
Exit code 0 if all of it holds, 1 if not.
"""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
# Run by `.ci/run`: each below 20 CPU s, but for the layouts of full size, studies, plans and calibrations, which hold what
# users rely on most, and the test that an effect is the same in every command, a minute.
FULL = {
    # Layouts of full size.
    "golden_digests_of_the_full_size_designs",
    # Calibrations and plans.
    "a_displaced_part_of_every_lens_is_found",
    "what_is_planned_for_is_found_in_what_comes_back",
    # Studies and other work in shards.
    "pairs_of_shards_are_those_of_one_run",
    "starts_of_the_optimiser_are_runs_with_their_seeds",
    "the_draws_depend_neither_on_the_cut_nor_on_the_order_nor_on_threads",
    "a_design_of_a_grid_is_the_design_of_its_own_file",
    "shards_are_whole_are_of_one_plan_and_are_counted",
    "a_limit_on_no_figure_is_told",
    # Chips as fabricated.
    "real_pillars_between_the_nodes_are_those_solved_exactly",
}
# Played by other processes that tests start.
STARTED = {"other_process"}
IGNORED = re.compile(r"#\[ignore\b[^\]]*\]\s*(?:#\[[^\]]*\]\s*)*fn (\w+)")


def in_sources() -> dict[str, list[str]]:
    """The names of all ignored tests, and the files that they are in."""
    files = subprocess.run(["git", "ls-files", "*.rs"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    found: dict[str, list[str]] = {}
    for file in files:
        for name in IGNORED.findall((ROOT / file).read_text(encoding="utf-8")):
            found.setdefault(name, []).append(file)
    return found


def faults(listed: str | None) -> list[str]:
    found = in_sources()
    wrong = [f"{name}: named in FULL or STARTED, and no ignored test has this name" for name in (FULL | STARTED) - set(found)]
    for name in FULL | STARTED:
        # cargo takes names as parts of names.
        longer = [other for other in found if name in other and other != name]
        wrong += [f"{name}: a part of {other}, so that both are run: rename one" for other in longer]
        if len(found.get(name, [])) > 1:
            wrong.append(f"{name}: a name of several ignored tests, in {', '.join(found[name])}: rename one")
    if listed is not None:
        known = {line.removesuffix(": test").rsplit("::", 1)[-1] for line in listed.splitlines() if line.endswith(": test")}
        wrong += [f"{name} in {found[name][0]}: run by no tier, `cargo test` does not find it" for name in set(found) - known]
    return sorted(wrong)


def main() -> int:
    if sys.argv[1:] in (["--full"], ["--weekly"]):
        wrong = faults(None)
        names = sorted(FULL) if sys.argv[1] == "--full" else [f"--skip {name}" for name in sorted(FULL | STARTED)]
        print("\n".join(wrong) if wrong else " ".join(names), file=sys.stderr if wrong else sys.stdout)
        return 1 if wrong else 0
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 1
    wrong = faults(Path(sys.argv[1]).read_text(encoding="utf-8"))
    total = sum(len(files) for files in in_sources().values())
    weekly = total - len(FULL) - len(STARTED)
    print("\n".join(wrong) if wrong else f"{total} ignored tests: {len(FULL)} in .ci/run, {weekly} weekly, {len(STARTED)} started by others")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
