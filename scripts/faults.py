#!/usr/bin/env python3
"""Kill commands at chosen system calls, let calls fail, run several at once, and see what is left.

    python3 scripts/faults.py target/release/metalith [--times 100] [--only layout,run]

Needs strace. Each command has two inputs of other content, whose files are known from runs that nothing disturbed. It
replaces the files of the one by those of the other, and

- is killed at its first, second, ... rename, unlink, mkdir, fsync, write: every file that stands is then whole and of
  one of the two; of a hand-off all files are of the same, and a report is never older than the layout beside it;
- is told that the disk is full, or of an I/O error, from the n-th of these calls on: it ends with exit code 3, or has
  done all it was asked for; what stands is whole as above;
- runs two to four times at once: at least one run wins, and all files are of one that did.

The next run that nothing disturbs must succeed, and leave nothing behind. Exit code 1 if any of that fails.
"""

import argparse
import hashlib
import os
import pathlib
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass

ROOT = pathlib.Path(__file__).resolve().parent.parent
CALLS = ["rename", "unlink,unlinkat", "mkdir", "fsync", "write"]
FAULTS = {"write": "ENOSPC", "fsync": "EIO", "rename": "ENOSPC", "mkdir": "ENOSPC"}
# Exit codes: all well, a limit not met; not all could be done (rules that do not run, a disk that refuses).
DONE = (0, 1)
NOT_ALL = 3
KILLED = (-9, 137)


@dataclass
class Case:
    """A command, what makes its input another one, and the options that make it short."""

    name: str
    options: list[str]
    together: bool = False
    command: str = ""


CASES = [
    Case("layout", []),
    Case("run", ["--fast", "--fidelity", "published"]),
    Case("handoff", ["--fast", "--fidelity", "published"], together=True),
    # Of a layout, which is no design.
    Case(
        "handoff-layout",
        ["--process", str(ROOT / "processes/jbx6300_zep520a.toml"), "--layer", "1/0", "--expose", "3/0"],
        together=True,
        command="handoff",
    ),
    Case("cells", ["--orders", "5", "--tolerance", "0.1"]),
    Case("optimize", ["--no-report"]),
    Case("calibrate", ["--effects", "defocus,pixel_blur"]),
]


def small_design() -> str:
    """One lens of 20 um: whatever a command does, it does it in a second."""
    text = (ROOT / "designs/mini_3x3.toml").read_text()
    for key, value in {
        "diameter_um": "20",
        "focal_length_um": "48",
        "elements": "[1, 1]",
        "wavelengths_nm": "[660]",
        "field_x_deg": "[0]",
        "field_y_deg": "[0]",
        "window_samples": "32",
    }.items():
        text, count = re.subn(rf"(?m)^{key} = .*$", f"{key} = {value}", text, count=1)
        assert count == 1, f"mini_3x3.toml has no {key}"
    # Limits are of lenses of another size.
    limits = text.index("[verify.limits]")
    return text[:limits]


class Bench:
    """A command with two inputs, and the files that each leads to."""

    def __init__(self, program: str, case: Case, folder: pathlib.Path):
        self.program, self.case, self.folder = program, case, folder
        self.out = folder / "place" / "out"
        self.out.parent.mkdir(parents=True)
        self.inputs = [self.input(n) for n in (0, 1)]
        self.known = []
        for n in (0, 1):
            self.clear()
            done = self.run(n)
            assert done.returncode in (*DONE, NOT_ALL) and "error" not in done.stderr, done.stderr
            self.known.append(self.stand())
        assert self.known[0] != self.known[1], "both inputs give the same"

    def input(self, n: int) -> pathlib.Path:
        if self.case.name == "calibrate":
            folder = self.folder / f"set-{n}"
            shutil.copytree(ROOT / "golden/session", folder)
            description = folder / "measurement.toml"
            description.write_text(description.read_text().replace("small chip", f"chip {n}"))
            return folder
        path = self.folder / f"design-{n}.toml"
        text = re.sub(r'(?m)^title = .*$', f'title = "version {n}"', small_design(), count=1)
        text = text.replace("width_max_nm = 300", f"width_max_nm = {300 + 10 * n}")
        path.write_text(text)
        if self.case.name == "handoff-layout":
            made = self.folder / f"layout-{n}"
            command = [self.program, "layout", str(path), "--out", str(made), "-q"]
            subprocess.run(command, env=self.environment(), check=True, capture_output=True)
            # Both have one name, so that files of one hand-off replace those of the other.
            path = made / "lens.gds"
            next(made.glob("*_pillars.gds")).rename(path)
        return path

    def command(self, n: int) -> list[str]:
        command = self.case.command or self.case.name
        return [self.program, command, str(self.inputs[n]), "--out", str(self.out), "-q", *self.case.options]

    def environment(self) -> dict[str, str]:
        return {**os.environ, "METALITH_CACHE": str(self.folder / "cache")}

    def run(self, n: int, prefix=()):
        return subprocess.run(
            [*prefix, *self.command(n)], env=self.environment(), capture_output=True, text=True, check=False
        )

    def clear(self):
        shutil.rmtree(self.out.parent)
        self.out.parent.mkdir()

    def stand(self) -> dict[str, str]:
        """All files that stand, with digests; an archive beside the folder too."""
        found = {}
        for path in sorted(self.out.parent.rglob("*")):
            if path.is_file():
                found[str(path.relative_to(self.out.parent))] = hashlib.sha256(path.read_bytes()).hexdigest()
        return found

    def check_whole(self):
        """What stands after a fault: each file whole, and what belongs together of one input."""
        stands = {name: digest for name, digest in self.stand().items() if not hidden(name)}
        versions = {}
        for name, digest in stands.items():
            of = [n for n in (0, 1) if self.known[n].get(name) == digest]
            assert of, f"{name} is neither the old nor the new"
            versions[name] = set(of)
        inside = {name: v for name, v in versions.items() if "/" in name}
        if self.case.together and inside:
            assert set.intersection(*inside.values()), "files of two inputs in one folder"
            n = min(set.intersection(*inside.values()))
            missing = {name for name in self.known[n] if "/" in name} - set(inside)
            assert not missing, f"missing: {missing}"
            archives = [v for name, v in versions.items() if "/" not in name]
            assert all(n in v for v in archives), "archive and folder differ"
        if self.case.name == "run" and any(name.endswith("report.json") for name in versions):
            assert set.intersection(*versions.values()), "the report is of another layout"

    def check_next(self, n: int):
        """A run that nothing disturbs does all, and leaves nothing behind."""
        done = self.run(n)
        assert done.returncode in (*DONE, NOT_ALL), f"the next run: {done.returncode} {done.stderr}"
        stands, known = self.stand(), self.known[n]
        wrong = {name for name in stands.keys() | known.keys() if stands.get(name) != known.get(name)}
        assert not wrong, f"after the next run: {sorted(wrong)}"

    def calls(self, calls: str, n: int) -> int:
        """The most calls of a kind that a thread of a run makes: strace counts for each thread."""
        log = self.folder / "strace.log"
        self.run(n, ["strace", "-f", "-o", str(log), "-e", f"trace={calls}"])
        made = Counter(line.split()[0] for line in log.read_text().splitlines() if "(" in line and "resumed" not in line)
        return max(made.values(), default=0)


def hidden(name: str) -> bool:
    """A lock, or what an unfinished run left: its name says so."""
    return any(part.startswith(".") or part.endswith(".part") for part in name.split("/"))


def spread(count: int, times: int, rng: random.Random) -> list[int]:
    """The calls to disturb: all of them, or so many, the last ones (of publishing) always among them."""
    if count <= times:
        return list(range(1, count + 1))
    last = range(count - times // 2 + 1, count + 1)
    return sorted({*last, *rng.sample(range(1, count - times // 2 + 1), times - len(last))})


def disturb(bench: Bench, times: int, rng: random.Random) -> tuple[int, int, list[str]]:
    """Kills and failing calls; how many of each took place, and what went wrong."""
    kills, faults, wrong = 0, 0, []
    bench.check_next(0)
    points = {calls: bench.calls(calls, 1) for calls in CALLS}
    bench.check_next(0)
    standing = 0
    while kills < times:
        before = kills
        for calls, when in [(c, w) for c, count in points.items() for w in spread(count, max(times // len(CALLS), 1), rng)]:
            for fault in ("kill", FAULTS.get(calls)):
                if fault is None:
                    continue
                # Always the other one than stands: else nothing would show that a file is not renewed.
                n = 1 - standing
                action = "signal=KILL" if fault == "kill" else f"error={fault}"
                at = str(when) if fault == "kill" else f"{when}+"
                inject = ["strace", "-f", "-qq", "-o", "/dev/null", "-e", f"inject={calls}:{action}:when={at}"]
                done = bench.run(n, inject)
                try:
                    kills += done.returncode in KILLED
                    all_there = bench.stand() == bench.known[n]
                    if fault != "kill":
                        assert done.returncode in (*DONE, NOT_ALL), f"exit code {done.returncode}: {done.stderr[-300:]}"
                        assert done.returncode == NOT_ALL or all_there, "nothing is said, and files are missing"
                        faults += done.returncode == NOT_ALL and not all_there
                    bench.check_whole()
                    standing = n if rng.randrange(2) else 1 - n
                    bench.check_next(standing)
                except AssertionError as error:
                    wrong.append(f"{bench.case.name}, {fault} at {calls} {when}: {error}")
                    bench.clear()
                    bench.check_next(standing)
        assert kills > before, "no call could be disturbed"
    return kills, faults, wrong


def race(bench: Bench, rounds: int, rng: random.Random) -> list[str]:
    """Two to four runs at once."""
    wrong = []
    for turn in range(rounds):
        of = [rng.randrange(2) for _ in range(2 + turn % 3)]
        runs = [
            subprocess.Popen(
                bench.command(n), env=bench.environment(), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
            )
            for n in of
        ]
        said = [run.communicate()[1] for run in runs]
        codes = [run.returncode for run in runs]
        try:
            for code, text in zip(codes, said, strict=True):
                assert code in (*DONE, NOT_ALL) or "another process is writing" in text, f"exit code {code}: {text}"
            winners = {n for n, code in zip(of, codes, strict=True) if code in (*DONE, NOT_ALL)}
            assert winners, f"none won: {said}"
            stands = bench.stand()
            assert not [name for name in stands if hidden(name)], f"left behind: {list(stands)}"
            assert any(stands == bench.known[n] for n in winners), "not what one of the winners writes"
        except AssertionError as error:
            wrong.append(f"{bench.case.name}, race {turn}: {error}")
            bench.clear()
    return wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", type=lambda p: str(pathlib.Path(p).resolve()))
    parser.add_argument("--times", type=int, default=100, help="kills of each command")
    parser.add_argument("--races", type=int, default=200, help="races of all commands together")
    parser.add_argument("--only", default=",".join(case.name for case in CASES), help="commands, separated by commas")
    arguments = parser.parse_args()
    chosen = [case for case in CASES if case.name in arguments.only.split(",")]
    failures = []
    for case in chosen:
        with tempfile.TemporaryDirectory() as folder:
            bench = Bench(arguments.program, case, pathlib.Path(folder))
            rng = random.Random(7)
            kills, faults, wrong = disturb(bench, arguments.times, rng)
            rounds = -(-arguments.races // len(chosen))
            wrong += race(bench, rounds, rng)
        print(f"{case.name}: killed {kills} times, {faults} errors, {rounds} races, {len(wrong)} failures", flush=True)
        for line in wrong:
            print("  ", line, flush=True)
        failures += wrong
    sys.exit(len(failures) > 0)


if __name__ == "__main__":
    main()
