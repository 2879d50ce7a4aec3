"""Bench sessions: what is planned, and what is said of what cannot be."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import metalith as ml

ROOT = Path(__file__).resolve().parents[2]
MINI = ROOT / "designs/mini_3x3.toml"
PROGRAM = Path(sys.executable).with_name("metalith")

# One narrow colour and one element: few cells to solve.
BENCH = """
schema = 1
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
centre_nm = 560
fwhm_nm = 6.0
[captures]
elements = [0, 0]
distance_um = [139.0, 144.0, 149.0]
frames = [16]
[wanted]
defocus = 2.0
"""


def test_a_session_is_planned_as_the_program_plans_it(tmp_path: Path) -> None:
    (tmp_path / "bench.toml").write_text(BENCH)
    effects = ["defocus", "pixel_blur"]
    told: list[str] = []
    planned = ml.plan(
        ml.Design.read(MINI),
        tmp_path / "bench.toml",
        tmp_path / "session",
        effects=effects,
        progress=lambda what, done, of: told.append(what),
    )
    assert planned.folder == tmp_path / "session" and planned.page.is_file()
    assert {e["name"] for e in planned.effects} == set(effects)
    assert planned.finds_all == all(e["detected"] for e in planned.effects)
    # The defocus is found by a capture out of focus.
    distances = {c["distance_um"] for c in planned.measurements}
    assert distances <= {139.0, 144.0, 149.0} and distances != {144.0}, planned.sentence
    assert told
    arguments: list[str | Path] = ["plan", MINI, "--bench", tmp_path / "bench.toml", "--out", tmp_path / "again"]
    arguments += ["--effects", ",".join(effects), "--json", "--quiet"]
    run = subprocess.run([PROGRAM, *arguments], capture_output=True, text=True)
    theirs = json.loads(run.stdout)
    for key in ("measurements", "effects", "confusions", "candidates"):
        assert theirs[key] == planned.numbers[key], key
    for file in ("measurement.toml", "layout.gds"):
        assert (tmp_path / "again" / file).read_bytes() == (tmp_path / "session" / file).read_bytes()


def test_a_session_that_was_begun_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "bench.toml").write_text(BENCH)
    (tmp_path / "captures").mkdir()
    (tmp_path / "captures/a.npy").write_bytes(b"")
    with pytest.raises(ml.MetalithError, match="there are frames in"):
        ml.plan(ml.Design.read(MINI), tmp_path / "bench.toml", tmp_path)


def test_exceptions_have_the_text_of_the_program(tmp_path: Path) -> None:
    (tmp_path / "bench.toml").write_text(BENCH.replace("defocus = 2.0", "defocus = -2.0"))
    (tmp_path / "wrong.toml").write_text(MINI.read_text().replace("pitch_nm = 350", "pitch_nm = 3"))
    design = ml.Design.read(MINI)
    cases: list[tuple[list[str | Path], Callable[[], object]]] = [
        (["layout", "nothing.toml"], lambda: ml.Design.read("nothing.toml")),
        (["check", "nothing.gds"], lambda: ml.check("nothing.gds")),
        (["layout", tmp_path / "wrong.toml"], lambda: ml.Design.read(tmp_path / "wrong.toml")),
        (
            ["plan", MINI, "--bench", tmp_path / "bench.toml", "--out", tmp_path / "out"],
            lambda: ml.plan(design, tmp_path / "bench.toml", tmp_path / "out"),
        ),
    ]
    for arguments, call in cases:
        run = subprocess.run([PROGRAM, *arguments, "--quiet"], capture_output=True, text=True)
        assert run.returncode == 2 or run.returncode == 3, run.stderr
        with pytest.raises(ml.MetalithError) as raised:
            call()
        text = str(raised.value)
        if run.stderr.startswith("error: "):
            assert run.stderr == f"error: {text}\n"
            continue
        # Mistakes in a text are drawn at their places: the same words, in another arrangement.
        drawn = " ".join(run.stderr.split())
        for line in text.splitlines():
            words = line.rpartition(": ")[2] if "help:" not in line else line.split("help: ")[1]
            assert words.split("; ")[0] in drawn, (words, run.stderr)
