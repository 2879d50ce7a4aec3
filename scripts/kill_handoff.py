#!/usr/bin/env python3
"""Kill `metalith handoff` at chosen system calls, and see what the next run finds.

    python3 scripts/kill_handoff.py target/release/metalith [--times 100]

Needs strace. For each kind of call the program is killed at the first, second, ... of them while it replaces an
older hand-off. A folder that stands then must be complete, and an archive beside it must hold the same; the next
run must succeed and leave nothing behind. Exit code 1 if any of that fails.
"""

import argparse
import hashlib
import json
import pathlib
import random
import subprocess
import sys
import tempfile
import zipfile

CALLS = ["rename", "unlinkat,unlink", "rmdir", "mkdir", "fsync", "write", "openat"]
ROOT = pathlib.Path(__file__).resolve().parent.parent


def run(program, out, design, prefix=()):
    command = [program, "handoff", design, "--out", out, "--fast", "--fidelity", "published"]
    return subprocess.run([*prefix, *command], cwd=ROOT, capture_output=True, text=True, check=False)


def whole(program, out, archive_too=False):
    """The folder is complete, and the archive, if it is there, holds the same."""
    verified = subprocess.run([program, "handoff", "--verify", out], capture_output=True, text=True, check=False)
    assert verified.returncode == 0, f"not complete: {verified.stdout}{verified.stderr}"
    manifest = json.loads((out / "manifest.json").read_text())
    packed = out.with_suffix(".zip")
    if not packed.exists():
        assert not archive_too, "no archive"
        return
    with zipfile.ZipFile(packed) as archive:
        names = {n.split("/", 1)[1] for n in archive.namelist()}
        assert names == set(manifest["files"]) | {"manifest.json"}, "archive and folder differ"
        for name, entry in manifest["files"].items():
            digest = hashlib.sha256(archive.read(f"{out.name}/{name}")).hexdigest()
            assert digest == entry["sha256"], f"{name} differs in the archive"


def calls_made(program, out, design, calls, folder):
    log = folder / "strace.log"
    run(program, out, design, ["strace", "-f", "-o", log, "-e", f"trace={calls}"])
    return sum(1 for line in log.read_text().splitlines() if "(" in line and "resumed" not in line)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", type=lambda p: str(pathlib.Path(p).resolve()))
    parser.add_argument("--times", type=int, default=100, help="kills for each kind of call")
    arguments = parser.parse_args()
    random.seed(7)
    failures = 0
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        designs = []
        for version in ("first", "second"):
            text = (ROOT / "designs/mini_3x3.toml").read_text()
            text = text.replace("3 x 3 array of 60 um metalenses", f"{version} version")
            designs.append(folder / f"{version}.toml")
            designs[-1].write_text(text)
        for calls in CALLS:
            out = folder / "kit"
            run(arguments.program, out, designs[0])
            count = calls_made(arguments.program, out, designs[1], calls, folder)
            chosen = range(1, count + 1)
            if count > arguments.times:
                # The last calls are those of publishing and removing.
                last = list(chosen)[-arguments.times // 2 :]
                chosen = sorted({*last, *random.sample(list(chosen)[: -len(last)], arguments.times - len(last))})
            killed = 0
            for when in chosen:
                inject = f"inject={calls}:signal=KILL:when={when}"
                strace = ["strace", "-f", "-qq", "-o", "/dev/null", "-e", inject]
                killed += run(arguments.program, out, designs[when % 2], strace).returncode != 0
                try:
                    if out.exists():
                        whole(arguments.program, out)
                    again = run(arguments.program, out, designs[1 - when % 2])
                    assert again.returncode in (0, 1, 3), again.stderr
                    whole(arguments.program, out, archive_too=True)
                    rest = {p.name for p in folder.iterdir() if p.name.startswith(".kit")}
                    assert not rest, f"left behind: {rest}"
                except AssertionError as error:
                    failures += 1
                    print(f"{calls} {when}: {error}")
            print(f"{calls}: {count} calls, killed {killed} times")
    print("failures:", failures)
    sys.exit(failures > 0)


if __name__ == "__main__":
    main()
