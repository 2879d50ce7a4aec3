#!/usr/bin/env python3
"""CPU seconds of calls of the Python package beside those of the same commands of the program.

    python scripts/python_speed.py target/release/metalith [FOLDER]

Runs in an environment where the package is installed. Layouts are of `designs/prototype_3x3.toml`; each is run twice, and the
smaller number counts. FOLDER, `target/python_speed` if left out, takes what they write.
"""

import pathlib
import subprocess
import sys
import time
from collections.abc import Callable

import metalith as ml

from cpu_time import children

ROOT = pathlib.Path(__file__).resolve().parent.parent
DESIGN = ROOT / "designs/prototype_3x3.toml"
SET = ROOT / "golden/session"
EFFECTS = ["cd_bias", "defocus", "pixel_blur", "zero_order"]


def main() -> int:
    program = sys.argv[1]
    folder = pathlib.Path(sys.argv[2] if len(sys.argv) > 2 else ROOT / "target/python_speed")
    folder.mkdir(parents=True, exist_ok=True)
    gds = folder / "prototype_3x3_pillars.gds"
    design = ml.Design.read(DESIGN)

    def command(*words: object) -> Callable[[], float]:
        def run() -> float:
            before = children()
            done = subprocess.run([program, *map(str, words), "-q"], capture_output=True, text=True, check=False)
            # A limit that is not held is no failure.
            if done.returncode not in (0, 1):
                raise SystemExit(done.stderr)
            return children() - before

        return run

    def call(what: Callable[[], object]) -> Callable[[], float]:
        def run() -> float:
            before = time.process_time()
            what()
            return time.process_time() - before

        return run

    cases = {
        "write the layout": (
            command("layout", DESIGN, "--out", folder),
            call(lambda: design.array().write(folder / "own.gds")),
        ),
        "check": (command("check", gds), call(lambda: ml.check(gds))),
        "verify, fast": (
            command("verify", DESIGN, gds, "--fast", "--out", folder / "v1"),
            call(lambda: ml.verify(design, gds, fast=True, out=folder / "v2")),
        ),
        "PSFs of nine elements, fast": (
            command("psf", gds, "--fast", "--wavelength-nm", "530", "--json"),
            call(lambda: ml.psf(ml.read_layout(gds), [530], fast=True, distance_um=2400)),
        ),
        "calibrate": (
            command("calibrate", SET, "--out", folder / "c1", "--effects", ",".join(EFFECTS)),
            call(lambda: ml.calibrate(SET, folder / "c2", effects=EFFECTS)),
        ),
    }
    print("| call | program (CPU s) | Python (CPU s) | ratio |\n| --- | --- | --- | --- |")
    for name, both in cases.items():
        first, second = (min(run() for _ in range(2)) for run in both)
        print(f"| {name} | {first:.2f} | {second:.2f} | {second / first:.2f} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
