"""Run two programs and compare what they write; see scripts/compare_outputs.sh."""

import argparse
import hashlib
import io
import json
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
from pathlib import Path

import forms
from differences import LIGHT, OF_THE_PROGRAM, compare, compare_arrays, compare_pixels
from program import Program
from tasks import all_tasks, designs

ROOT = Path(__file__).resolve().parents[2]
# Files of the tree that programs are given: what a program does not bring.
FILES = ["cameras", "golden", "scripts/study", "tests/broken"]
# Differences of one comparison that are printed; all are counted.
SHOWN = 3


def tree(commit: str | None, folder: Path) -> Path:
    """The files that a program is given: of the working tree, or of a commit."""
    if commit is None:
        return ROOT
    packed = subprocess.run(["git", "archive", commit, *FILES], cwd=ROOT, capture_output=True, check=True).stdout
    with tarfile.open(fileobj=io.BytesIO(packed)) as files:
        files.extractall(folder, filter="data")
    return folder


def key(program: Path, files: Path) -> str:
    """What decides the answers of a program: itself, these scripts, the files that it is given."""
    hash_ = hashlib.sha256()
    given = sorted(p for name in FILES for p in (files / name).rglob("*") if p.is_file())
    for path in [program, *sorted(Path(__file__).parent.glob("*.py")), *given]:
        hash_.update(hashlib.sha256(path.read_bytes()).digest())
    return hash_.hexdigest()[:16]


class Recorded:
    """The answers of a program, kept from one run to the next."""

    def __init__(self, program: Path, files: Path, fresh: bool):
        self.program, self.files = program, files
        self.kept = ROOT / "target/compare_outputs" / key(program, files)
        if fresh:
            shutil.rmtree(self.kept, ignore_errors=True)
        self.kept.mkdir(parents=True, exist_ok=True)

    def answers(self, name: str, task) -> dict:
        file = self.kept / (name.replace(" ", "_") + ".json")
        if not file.exists():
            with tempfile.TemporaryDirectory(dir=self.kept, prefix="run-") as folder:
                answers = task(Program(self.program, Path(folder) / "work", self.files, self.kept / "cache"))
                answers = self.with_files(answers, file.with_suffix(""), Path(folder))
            part = file.with_suffix(".part")
            part.write_text(json.dumps(answers))
            part.rename(file)
        return json.loads(file.read_text())

    def with_files(self, value, kept: Path, folder: Path):
        """Answers whose files are moved to where they are kept."""
        if isinstance(value, dict) and set(value) == {"kept"}:
            path = Path(value["kept"])
            to = kept / path.relative_to(folder)
            to.parent.mkdir(parents=True, exist_ok=True)
            shutil.move(path, to)
            return {"kept": str(to)}
        if isinstance(value, dict):
            return {k: self.with_files(v, kept, folder) for k, v in value.items()}
        return value


class Comparison:
    """Counts what is compared, and prints what differs."""

    def __init__(self, labels_may_differ: bool):
        self.labels_may_differ = labels_may_differ
        self.compared = self.differing = 0
        self.largest: dict[str, float] = {}
        self.renamed: set[tuple[str, str]] = set()

    def say(self, place: str, differences: list[str]):
        self.compared += 1
        if differences:
            self.differing += 1
            more = f" and {len(differences) - SHOWN} more" if len(differences) > SHOWN else ""
            print(f"DIFFERS  {place}: {'; '.join(differences[:SHOWN])}{more}", flush=True)

    def found(self, place: str, found, what: str = ""):
        self.renamed |= found.renamed
        if what:
            self.largest[what] = max(self.largest.get(what, 0.0), found.largest)
        self.say(place, found.differences)

    def values(self, place: str, old, new):
        """Go down to what is compared as one."""
        if not (isinstance(old, dict) and isinstance(new, dict)):
            self.found(place, compare(old, new, 0.0))
        elif set(old) == {"file"} == set(new):
            self.files(place, old["file"], new["file"])
        elif set(old) == {"light"} == set(new):
            self.found(place, compare(old["light"], new["light"], LIGHT), "figures of light")
        elif set(old) == {"kept"} == set(new):
            self.kept(place, Path(old["kept"]), Path(new["kept"]))
        elif place.endswith(("/report", "/summary", "/diagnosis")):
            self.found(place, compare(old, new, 0.0))
        else:
            for name in [*old, *(n for n in new if n not in old)]:
                if name in OF_THE_PROGRAM:
                    continue
                if name not in old or name not in new:
                    self.say(f"{place}/{name}", ["only of OLD" if name in old else "only of NEW"])
                else:
                    self.values(f"{place}/{name}", old[name], new[name])

    def files(self, place: str, old: list[str], new: list[str]):
        differences = []
        if old[0] != new[0]:
            label = old[1] == new[1]
            if not (label and self.labels_may_differ):
                differences = ["only in the digest of the design" if label else "other bytes"]
        self.say(place, differences)

    def kept(self, place: str, old: Path, new: Path):
        if old.read_bytes() == new.read_bytes():
            self.say(place, [])
        elif old.suffix == ".npy":
            self.found(place, compare_arrays(forms.npy(old), forms.npy(new)), "PSFs, of the peak")
        else:
            self.found(place, compare_pixels(forms.png(old), forms.png(new)))


def main() -> int:
    parser = argparse.ArgumentParser(prog="compare_outputs.sh", description=__doc__)
    parser.add_argument("old", type=lambda p: Path(p).resolve(strict=True))
    parser.add_argument("new", type=lambda p: Path(p).resolve(strict=True))
    parser.add_argument("--slow", action="store_true", help="what takes minutes too")
    parser.add_argument("--only", default="", metavar="WORDS", help="tasks whose names hold one of these, separated by commas")
    parser.add_argument("--old-files", metavar="COMMIT", help="commit of the cameras, studies and golden files that OLD is given")
    parser.add_argument("--labels-may-differ", action="store_true", help="digests of designs in layouts may differ")
    parser.add_argument("--fresh", action="store_true", help="run again what is kept of an earlier comparison")
    parser.add_argument("--list", action="store_true", help="print the names of the tasks")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        old_files = tree(arguments.old_files, Path(folder) / "files")
        recorded = [Recorded(p, f, arguments.fresh) for p, f in ((arguments.old, old_files), (arguments.new, ROOT))]
        names = designs(Program(arguments.old, Path(folder) / "names", ROOT, Path(folder) / "cache"))
        tasks = all_tasks(names, arguments.slow)
        words = [w for w in arguments.only.split(",") if w]
        chosen = {n: t for n, t in tasks.items() if not words or any(w in n for w in words)}
        if arguments.list or not chosen:
            print("\n".join(tasks))
            return 0 if chosen else 2
        comparison = Comparison(arguments.labels_may_differ)
        for name, task in chosen.items():
            begun = time.monotonic()
            try:
                old, new = (r.answers(name, task) for r in recorded)
            except Exception as error:  # what a program writes may be anything
                comparison.say(name, [f"{type(error).__name__}: {error}"])
                continue
            comparison.values(name, old, new)
            print(f"         {name}: {time.monotonic() - begun:.0f} s", file=sys.stderr, flush=True)
    for what, largest in comparison.largest.items():
        print(f"largest difference of {what}: {largest:.2e} (at most {LIGHT:.0e})")
    for old, new in sorted(comparison.renamed):
        print(f"renamed: {old} -> {new}")
    print(f"{comparison.compared} comparisons, {comparison.differing} differ")
    return 1 if comparison.differing else 0


if __name__ == "__main__":
    sys.exit(main())
