#!/usr/bin/env python3
"""Kill commands at chosen system calls, let calls fail, run several at once, and see what is left.

    python3 scripts/faults.py target/release/metalith [--times 100] [--only layout,run] [--without-locks]

Needs strace; --without-locks needs a C compiler, and lets every lock fail as some network file systems do. Each command has two inputs of other content, whose files are known from runs that nothing disturbed. It
replaces the files of the one by those of the other, and

- is killed at its first, second, ... rename, unlink, mkdir, fsync, write: every file that stands is then whole, and all
  of them are of the same input; of a hand-off none is missing; the manifest of a set of pairs lists those that stand;
- is told that the disk is full, or of an I/O error, from the n-th of these calls on: it ends with exit code 3, or has
  done all it was asked for; what stands is whole as above, and either all of it stands or the message says that
  the next run completes it;
- runs two to four times at once: at least one run wins, and all files are of one that did. Without locks a run may
  say instead that another one came between.

The next run that nothing disturbs must succeed, and leave nothing behind. Exit code 1 if any of that fails.
"""

import argparse
import hashlib
import json
import os
import pathlib
import random
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import zlib
from collections import Counter
from dataclasses import dataclass

ROOT = pathlib.Path(__file__).resolve().parent.parent
CALLS = ["rename", "unlink,unlinkat,rmdir", "mkdir", "fsync", "write"]
FAULTS = {"write": "ENOSPC", "fsync": "EIO", "rename": "ENOSPC", "mkdir": "ENOSPC"}
# Exit codes: all well, a limit not met; not all could be done (rules that do not run, a disk that refuses).
DONE = (0, 1)
NOT_ALL = 3
KILLED = (-9, 137)


CAMERA = """schema = 1
name = "tiny"
[sensor]
pixel_um = 2.0
columns = 32
rows = 32
filter = "none"
offset_um = [0, 0]
tilt_deg = [0, 0]
bits = 12
full_well_e = 32000
read_noise_e = 7
dark_current_e_s = 5
gain_e = 7.8
[[channel]]
name = "mono"
efficiency = 0.6
band_nm = [658, 662]
[exposure]
time_ms = "auto"
white = 0.9
[illuminant]
source = "leds"
[[illuminant.led]]
centre_nm = 660
width_nm = 4
"""

BENCH = """schema = 1
[source]
kind = "collimated"
divergence_mrad = 2.35
divergence_axes = "uniform disc"
[camera]
pixel_um = 0.5
rows = 48
cols = 48
black_level_dn = 40.0
gain_e_per_dn = 5.0
read_noise_dn = 2.0
saturation_dn = 4095
registration_sigma_px = 0.5
flux_sigma = 0.01
[[led]]
centre_nm = 660
fwhm_nm = 6.0
[captures]
"""

TOLERANCE = """schema = 1
design = "{design}"
draws = {draws}
[[vary]]
effect = "defocus"
distribution = "uniform"
low = -4.0
high = 4.0
[[limit]]
figure = "strehl_660nm_0deg"
at_least = 0.5
"""

# Answers of a run that another one has disturbed where there are no locks.
CAME_BETWEEN = ("another process", "was replaced while it was written")


@dataclass
class Case:
    """A command, what makes its input another one, and the options that make it short."""

    name: str
    options: list[str]
    # No file may be missing after a kill.
    together: bool = False
    command: str = ""
    # Results that are put into place one after the other; 0 where files of one result are of no use to another.
    sets: int = 1
    # What the command reads: "design", "set", or one of those of `Bench.input`.
    kind: str = "design"


IMAGING = ["--field-deg", "20"]
CASES = [
    Case("layout", []),
    Case("run", ["--fast", "--fidelity", "published"], sets=2),
    Case("handoff", ["--fast", "--fidelity", "published"], together=True),
    # Of a layout, which is no design.
    Case(
        "handoff-layout",
        ["--process", str(ROOT / "processes/jbx6300_zep520a.toml"), "--layer", "1/0", "--expose", "3/0"],
        together=True,
        command="handoff",
        kind="layout",
    ),
    Case("cells", ["--orders", "5", "--tolerance", "0.1"]),
    Case("optimize", ["--no-report"], sets=2),
    Case("calibrate", ["--effects", "defocus,pixel_blur"], kind="set"),
    Case("plan", ["--effects", "defocus,pixel_blur"], kind="design and bench"),
    Case("verify", ["--fast", "--fidelity", "published"], kind="design and layout"),
    Case("psf", ["--layer", "1/0", "--wavelength-nm", "660"], kind="layout"),
    Case("check", [], kind="layout"),
    Case("picture", [*IMAGING, "--no-forecast"], kind="scene"),
    Case("restore", [*IMAGING, "--pixels", "64"], kind="frame"),
    Case("compare", IMAGING, kind="photographs"),
    Case("dataset", IMAGING, sets=0, kind="photographs"),
    Case("study", ["--psfs", "0"], kind="study"),
]


def png(level: int) -> bytes:
    """A picture of 64 x 64 pixels: a ramp, from a level on."""
    rows = b"".join(
        b"\0" + bytes(min(level + 2 * (x + y), 255) for x in range(64) for _ in range(3)) for y in range(64)
    )

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", 64, 64, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


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

    def __init__(self, program: str, case: Case, folder: pathlib.Path, preload: str):
        self.program, self.case, self.folder, self.preload = program, case, folder, preload
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

    def prepare(self, *command):
        """A run that makes an input."""
        words = [self.program, *(str(word) for word in command), "-q"]
        subprocess.run(words, env=self.environment(), check=True, capture_output=True)

    def input(self, n: int) -> pathlib.Path:
        kind = self.case.kind
        if kind == "set":
            folder = self.folder / f"set-{n}"
            shutil.copytree(ROOT / "golden/session", folder)
            description = folder / "measurement.toml"
            description.write_text(description.read_text().replace("small chip", f"chip {n}"))
            return folder
        # What sees pictures has one chip, and two scenes.
        version = n if kind in ("design", "design and bench", "design and layout", "layout", "study") else 0
        path = self.folder / f"design-{version}.toml"
        text = re.sub(r'(?m)^title = .*$', f'title = "version {version}"', small_design(), count=1)
        path.write_text(text.replace("width_max_nm = 300", f"width_max_nm = {300 + 10 * version}"))
        if kind == "design and bench":
            (self.folder / "bench.toml").write_text(BENCH)
        if kind in ("design", "design and bench"):
            return path
        made = self.folder / f"layout-{version}"
        # All have one name, so that files of one replace those of the other.
        layout = made / "lens.gds"
        if not layout.exists():
            self.prepare("layout", path, "--out", made)
            next(made.glob("*_pillars.gds")).rename(layout)
        if kind == "study":
            tolerance = self.folder / f"tolerance-{n}.toml"
            tolerance.write_text(TOLERANCE.format(design=path, draws=6 + n))
            study = self.folder / f"study-{n}"
            self.prepare("study", "plan", tolerance, "--out", study)
            self.prepare("study", "run", study, "--missing")
            return study
        if kind == "layout" or kind == "design and layout":
            return layout
        (self.folder / "camera.toml").write_text(CAMERA)
        photographs = self.folder / f"photographs-{n}"
        photographs.mkdir()
        for k in (0, 1):
            (photographs / f"{k}.png").write_bytes(png(20 * (n + 1) + 10 * k))
        if kind == "photographs":
            return photographs
        if kind == "scene":
            return photographs / "0.png"
        frame = self.folder / f"picture-{n}"
        self.prepare("picture", *self.seen(photographs / "0.png"), *IMAGING, "--no-forecast", "--out", frame)
        return frame / "frame.png"

    def seen(self, what: pathlib.Path) -> list[str]:
        """Arguments of what is seen through the chip."""
        files = [self.folder / "layout-0/lens.gds", what]
        with_camera = ["--camera", self.folder / "camera.toml", "--design", self.folder / "design-0.toml"]
        return [*map(str, files), *map(str, with_camera)]

    def command(self, n: int) -> list[str]:
        name, given, out = self.case.command or self.case.name, str(self.inputs[n]), str(self.out)
        design, layout = str(self.folder / "design-0.toml"), str(self.folder / "layout-0/lens.gds")
        camera = ["--camera", str(self.folder / "camera.toml")]
        reports = [word for form in ("lyrdb", "junit", "sarif") for word in (f"--{form}", f"{out}/found.{form}")]
        words = {
            "verify": [str(self.folder / f"design-{n}.toml"), given],
            "plan": [given, "--bench", str(self.folder / "bench.toml")],
            "psf": [given, "--distance-um", str(48 + 4 * n)],
            "check": [given, "--design", design, *reports],
            "picture": [*self.seen(self.inputs[n]), *(["--separate"] if n else [])],
            "restore": self.seen(self.inputs[n]),
            "compare": [given, *camera, "--design", f"{design}:{layout}"],
            "dataset": [given, "--layout", layout, *camera, "--design", design],
            "study": ["merge", given, "--out", f"{out}/result.csv"],
        }.get(name, [given])
        # Where the files go is in these words already.
        named = [] if name in ("check", "study") else ["--out", out]
        return [self.program, name, *words, *named, "-q", *self.case.options]

    def environment(self) -> dict[str, str]:
        preload = {"LD_PRELOAD": self.preload} if self.preload else {}
        return {**os.environ, "METALITH_CACHE": str(self.folder / "cache"), **preload}

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
        elif self.case.sets and versions:
            assert set.intersection(*versions.values()), f"files of two inputs: {versions}"
        manifest = self.out / "manifest.json"
        if self.case.name == "dataset" and manifest.exists():
            for pair in json.loads(manifest.read_text())["pairs"]:
                for kind in ("frame", "truth"):
                    found = hashlib.sha256((self.out / pair[kind]).read_bytes()).hexdigest()
                    assert found == pair[f"{kind}_sha256"], f"{pair[kind]} is not the one of the manifest"

    def is_all_there(self) -> bool:
        """True if all files of one of both stand."""
        stands = {name: digest for name, digest in self.stand().items() if not hidden(name)}
        return any(stands == {name: d for name, d in known.items() if not hidden(name)} for known in self.known)

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


def self_contained(bench: Bench, is_said: bool) -> bool:
    """True if a failed run left all files of one input, or said what becomes of them."""
    return bench.case.together or bench.case.sets != 1 or is_said or bench.is_all_there()


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
                        is_said = "the next run into this folder" in done.stderr
                        assert self_contained(bench, is_said), f"files are missing, and nothing says so: {done.stderr}"
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
                excuses = CAME_BETWEEN if bench.preload else ("another process is writing",)
                came_between = any(words in text for words in excuses)
                assert code in (*DONE, NOT_ALL) or came_between, f"exit code {code}: {text}"
            winners = {n for n, code in zip(of, codes, strict=True) if code in (*DONE, NOT_ALL)}
            stands = bench.stand()
            if not winners and bench.preload:
                assert "out/manifest.json" not in stands, "none won, and a manifest stands"
                continue
            assert winners, f"none won: {said}"
            left = [name for name in stands if name not in bench.known[0] | bench.known[1]]
            assert not left, f"left behind: {left}"
            assert any(stands == bench.known[n] for n in winners), "not what one of the winners writes"
        except AssertionError as error:
            wrong.append(f"{bench.case.name}, race {turn}: {error}")
            bench.clear()
    return wrong


def without_locks(folder: pathlib.Path) -> str:
    """A library in which locks are not offered."""
    source, made = folder / "nolock.c", folder / "nolock.so"
    source.write_text("#include <errno.h>\nint flock(int fd, int op) { errno = ENOLCK; return -1; }\n")
    subprocess.run(["cc", "-shared", "-fPIC", "-o", str(made), str(source)], check=True)
    return str(made)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", type=lambda p: str(pathlib.Path(p).resolve()))
    parser.add_argument("--times", type=int, default=100, help="kills of each command")
    parser.add_argument("--races", type=int, default=200, help="races of all commands together")
    parser.add_argument("--only", default=",".join(case.name for case in CASES), help="commands, separated by commas")
    parser.add_argument("--without-locks", action="store_true", help="let every lock fail")
    arguments = parser.parse_args()
    chosen = [case for case in CASES if case.name in arguments.only.split(",")]
    failures = []
    for case in chosen:
        with tempfile.TemporaryDirectory() as folder:
            preload = without_locks(pathlib.Path(folder)) if arguments.without_locks else ""
            bench = Bench(arguments.program, case, pathlib.Path(folder), preload)
            rng = random.Random(7)
            # What a killed run leaves cannot be told from what a living one makes, and stays.
            kills, faults, wrong = (0, 0, []) if preload else disturb(bench, arguments.times, rng)
            rounds = -(-arguments.races // len(chosen))
            wrong += race(bench, rounds, rng)
        print(f"{case.name}: killed {kills} times, {faults} errors, {rounds} races, {len(wrong)} failures", flush=True)
        for line in wrong:
            print("  ", line, flush=True)
        failures += wrong
    sys.exit(len(failures) > 0)


if __name__ == "__main__":
    main()
