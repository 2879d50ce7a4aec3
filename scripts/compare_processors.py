"""Hold the draws of a study made without AVX2, in an emulator, to those made with the instructions of this machine.

usage: compare_processors.py METALITH FOLDER

The figures agree to the difference that `merge` states; each shard names its processor; `status` states that there are two kinds.
Needs qemu-x86_64. Where it is missing, Debian's package is unpacked into FOLDER, if it can be fetched; else nothing is compared,
which is said. Exit code 1 on a difference.
"""

import json
import pathlib
import platform
import shutil
import subprocess
import sys

# What `metalith study merge` states of shards from two kinds of processors.
DIFFERENCE = 3e-6
# An x86_64 processor with SSE4.2 and without AVX.
WITHOUT_AVX = "Nehalem"
# Longest time for fetching the emulator: 60 MB.
FETCH_SECONDS = 60
TOLERANCE = """schema = 1
design = "small.toml"
draws = 2

[[vary]]
effect = "defocus"
distribution = "uniform"
low = -4.0
high = 4.0

[[limit]]
figure = "strehl_530nm_0deg"
at_least = 0.5
"""


def emulator(folder):
    """The program that emulates a processor; none where it is not to be had."""
    found = shutil.which("qemu-x86_64") or shutil.which("qemu-x86_64-static")
    if found or not shutil.which("apt-get"):
        return found
    quiet = {"cwd": folder, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    try:
        subprocess.run(["apt-get", "download", "qemu-user-static"], check=True, timeout=FETCH_SECONDS, **quiet)
    except (subprocess.CalledProcessError, subprocess.TimeoutExpired):
        return None
    for package in folder.glob("qemu-user-static_*.deb"):
        subprocess.run(["dpkg", "-x", package.name, "emulator"], check=True, **quiet)
        return str(folder / "emulator/usr/bin/qemu-x86_64-static")
    return None


def small_design(folder):
    """One lens of 20 um."""
    text = (pathlib.Path(__file__).parent.parent / "designs/mini_3x3.toml").read_text()
    for old, new in (("elements = [3, 3]", "elements = [1, 1]"), ("diameter_um = 60", "diameter_um = 20")):
        if old not in text:
            sys.exit(f"mini_3x3.toml has no {old}")
        text = text.replace(old, new)
    (folder / "small.toml").write_text(text)


def draws(path):
    header, *lines, _ = map(json.loads, path.read_text().splitlines())
    return header["instructions"], lines


def main(program, folder):
    program = pathlib.Path(program).resolve()
    folder = pathlib.Path(folder).resolve()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    if platform.machine() != "x86_64":
        sys.exit(print(f"processors are NOT compared: this one is {platform.machine()}"))
    other = emulator(folder)
    if other is None:
        sys.exit(print("processors are NOT compared: there is no qemu-x86_64, and none can be fetched"))
    small_design(folder)
    (folder / "tolerance.toml").write_text(TOLERANCE)

    def metalith(*arguments, by=()):
        return subprocess.run([*by, program, *arguments, "--quiet"], check=True, cwd=folder, capture_output=True, text=True).stdout

    emulated = (other, "-cpu", WITHOUT_AVX)
    for study, by in (("own", ()), ("without", emulated)):
        metalith("study", "plan", "tolerance.toml", "--out", study, "--draws-per-shard", "1")
        metalith("study", "run", study, "--missing", by=by)
    kinds, largest = set(), 0.0
    for number in range(2):
        name = f"shards/{number:06}.jsonl"
        (own, here), (without, there) = draws(folder / "own" / name), draws(folder / "without" / name)
        kinds |= {own, without}
        for a, b in zip(here, there, strict=True):
            differences = [abs(a["figures"][k] - b["figures"][k]) for k in a["figures"] if a["figures"][k] is not None]
            largest = max(largest, *differences)
    print(f"{' and '.join(sorted(kinds))}: figures differ by up to {largest:.1e}")
    if largest > DIFFERENCE or (len(kinds) != 2 and "avx2" in " ".join(kinds)):
        sys.exit(1)
    shutil.copy(folder / "without/shards/000001.jsonl", folder / "own/shards/000001.jsonl")
    said = metalith("study", "status", "own")
    if len(kinds) == 2 and "different vector instructions" not in said:
        sys.exit(f"status says nothing of two kinds of processors: {said}")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
