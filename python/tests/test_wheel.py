"""The wheel as it is installed: everything that the guide says, on small chips."""

from __future__ import annotations

import io
import json
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import metalith as ml

ROOT = Path(__file__).resolve().parents[2]
MINI = ROOT / "designs/mini_3x3.toml"


@pytest.fixture(scope="module")
def array() -> ml.Array:
    return ml.Design.read(MINI).array()


def test_a_design_shows_itself_in_a_notebook() -> None:
    shown = ml.Design.read(MINI)._repr_html_()
    assert "mini_3x3" in shown and "<svg" in shown


def test_a_design_can_be_a_text() -> None:
    text = MINI.read_text().replace('name = "mini_3x3"', 'name = "mine"')
    design = ml.Design.parse(text, MINI)
    assert design.name == "mine"
    assert design.elements[4] == ((0, 0), (0.0, 0.0))


def test_mistakes_have_the_words_and_the_remedy_of_the_program() -> None:
    text = MINI.read_text().replace("pitch_nm = 350", "pitch_nm = 3500000")
    with pytest.raises(ml.MetalithError, match="pitch_nm.*cannot be"):
        ml.Design.parse(text, MINI)
    with pytest.raises(ml.MetalithError, match="help: check the path"):
        ml.Design.read("nothing.toml")


@pytest.mark.parametrize("name", ["chip.gds", "chip.oas"])
@pytest.mark.parametrize("hierarchy", ["folded", "sref", "flat"])
def test_what_is_written_is_read(array: ml.Array, tmp_path: Path, name: str, hierarchy: str) -> None:
    array.write(tmp_path / name, hierarchy=hierarchy)
    layout = ml.read_layout(tmp_path / name, design=array.design)
    assert layout.pillars == array.pillars
    for k, found in enumerate(layout.widths):
        assert found.dtype == np.uint16
        assert np.array_equal(found, array.widths(k))


def test_any_map_of_widths_becomes_a_layout(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    widths = (2 * rng.integers(50, 150, (40, 40))).astype(np.uint16)
    for name in ("a.gds", "a.oas"):
        ml.write_layout(tmp_path / name, widths, pitch_nm=400)
        layout = ml.read_layout(tmp_path / name)
        assert (layout.pitch_nm, layout.other_shapes) == (400, 0)
        assert np.array_equal(layout.widths[0], widths)
    with pytest.raises(ml.MetalithError, match="even"):
        ml.write_layout(tmp_path / "odd.gds", widths + 1, pitch_nm=400)
    with pytest.raises(ml.MetalithError, match="whole nanometres"):
        ml.write_layout(tmp_path / "half.gds", widths + 0.5, pitch_nm=400)


def test_psfs_are_those_of_the_program(array: ml.Array, tmp_path: Path) -> None:
    file = tmp_path / "chip.gds"
    array.write(file)
    found = ml.verify(array.design or pytest.fail(), file, fast=True)
    design = found.numbers["distinct"]
    psfs = ml.psf(array, [530], fidelity=found.numbers["fidelity"], fast=True)
    assert len(psfs) == len(design)
    for psf, element in zip(psfs, design):
        at = [s for s in element["spots"] if abs(s["wavelength_um"] - 0.53) < 1e-9 and s["field"]["x_deg"] == 0]
        # Strehl ratios are against the whole lens there, and against the pillars here. Centroids are of the same light, to
        # single precision (um).
        ours, theirs = psf.centroid_um, at[0]["extracted"][0][1]["centroid_um"]
        assert np.allclose(ours, theirs, atol=1e-3), (ours, theirs)


def test_any_aperture_is_propagated() -> None:
    sites, pitch_nm = 64, 400
    rng = np.random.default_rng(2)
    aperture = rng.normal(size=(sites, sites)) + 1j * rng.normal(size=(sites, sites))
    light: dict[str, Any] = dict(pitch_nm=pitch_nm, wavelength_nm=600.0, distance_um=80.0, samples=16)
    folded, x_um, _ = ml.propagate(aperture, **light)
    direct, _, _ = ml.propagate(aperture, **light, direct=True)
    # What the accurate fold promises, of the field's largest value.
    assert np.abs(folded - direct).max() < 1e-4 * np.abs(direct).max()
    assert np.isclose(np.diff(x_um), 0.4).all()


def test_cells_have_the_shape_that_was_asked_for() -> None:
    one = ml.cell(200.0, 530.0)
    many = ml.cell([150.0, 200.0], np.array([[530.0, 600.0]]))
    assert one.shape == () and many.shape == (2, 1, 2)
    assert many[1, 0, 0] == one
    assert ml.index("fused_silica_malitson_1965", 587.6).real == pytest.approx(1.4585, abs=1e-4)


def test_rules_are_a_table(array: ml.Array, tmp_path: Path) -> None:
    file = tmp_path / "chip.gds"
    array.write(file)
    assert ml.check(file, design=array.design).clean
    widths = array.widths(4).copy()
    widths[80, 80] = 20
    ml.write_layout(file, widths, pitch_nm=350)
    assert ml.check(file).clean, "rules of squares say nothing of widths"
    report = ml.check(file, rules=ROOT / "rules/sin_pillars.toml")
    assert not report.clean
    assert any("20" in row["words"] for row in report.table()), report.table()


def test_noise_goes_by_the_learnt_prior() -> None:
    row = np.linspace(0.2, 0.8, 48)
    clean = np.repeat(np.repeat(row[None, :, None], 40, axis=0), 3, axis=2)
    noisy = clean + 0.1 * np.random.default_rng(1).standard_normal(clean.shape)
    found = ml.denoise(noisy, 0.1)
    assert found.shape == clean.shape
    # A ramp has nothing that could be taken for noise: a third of it is left at most.
    assert np.sqrt(np.mean((found - clean) ** 2)) < 0.1 / 3
    with pytest.raises(ml.MetalithError, match="shape"):
        ml.denoise(noisy[:, :, :2], 0.1)


def test_ctrl_c_stops_a_long_call_soon() -> None:
    code = (
        "import signal, metalith as ml, numpy as np\n"
        # A shell that runs the tests in the background has its children ignore the signal.
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "print('begun', flush=True)\n"
        "ml.cell(np.arange(100, 300, 0.01), [500.0, 530.0, 600.0], orders=17)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    process.stdout.readline()
    time.sleep(1.0)
    process.send_signal(2)
    _, err = process.communicate(timeout=30)
    assert "KeyboardInterrupt" in err


def test_a_line_of_progress_has_the_time_left(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 0.0
    monkeypatch.setattr("time.monotonic", lambda: now)
    log = io.StringIO()
    line = ml.ProgressLine(log)
    for now, done in [(100.0, 0), (100.5, 1), (110.0, 20), (135.0, 25), (140.0, 50)]:  # noqa: B020
        line("making kernels", done, 100)
    # A log hears of it once in half a minute; what is short is not told.
    assert log.getvalue() == "making kernels: 25%, about 105 s left\n"


def test_the_lock_is_released_and_progress_is_told() -> None:
    told: list[tuple[str, int, int]] = []
    counted = [0]
    done = threading.Event()

    def count() -> None:
        while not done.is_set():
            counted[0] += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    ml.cell(np.arange(100, 300, 2.0), [500.0, 530.0], orders=17, progress=lambda *what: told.append(what))
    done.set()
    thread.join()
    # A call that holds the lock would let the other thread count a few times at most.
    assert counted[0] > 50
    assert told and all(what == "solving cells" for what, _, _ in told if what)


def test_the_wheel_carries_the_program(tmp_path: Path) -> None:
    program = Path(sys.executable).with_name("metalith")
    run = subprocess.run([program, "layout", MINI, "--out", tmp_path, "--quiet"], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    run = subprocess.run([program, "check", tmp_path / "mini_3x3_pillars.gds", "--json"], capture_output=True, text=True)
    assert json.loads(run.stdout)["rules"]
    assert subprocess.run([program, "layout", "nothing.toml"], capture_output=True).returncode == 2
