"""What cannot be is refused in words, and what is taken is what was asked for: pixels, models, grey pictures, elements."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import metalith as ml

ROOT = Path(__file__).resolve().parents[2]
MINI = ROOT / "designs/mini_3x3.toml"
MAP: dict[str, Any] = dict(pitch_nm=350, distance_um=20.0, samples=16, pillar="sin_luke_2015")
PILLARS = np.full((8, 8), 200, dtype=np.uint16)

# Pillars 20 nm narrower than drawn: more than enough to be seen.
NARROWER = """
schema = 2
set = "bench"
finding = "explained by cd_bias"
[perturbation.geometry]
cd_bias_nm = -20.0
"""


@pytest.fixture(scope="module")
def array() -> ml.Array:
    return ml.Design.read(MINI).array()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda a: ml.cell(-5, 530), "a pillar -5 nm wide\n  help: .*zero for a site without pillar"),
        (lambda a: ml.cell([200, -1e9], 530), "-1000000000 nm wide"),
        (lambda a: ml.cell(200, np.nan), "a wavelength of nan nm in `wavelength_nm`"),
        (lambda a: ml.cell(200, 530, orders=-3), "`orders` = -3"),
        (lambda a: ml.index("air", [500.0, -1.0]), "a wavelength of -1 nm"),
        (lambda a: ml.psf(a, [np.nan]), "a wavelength of nan nm in `wavelengths_nm`"),
        (lambda a: ml.psf(a, []), "no wavelength"),
        (lambda a: ml.psf(a, [530], []), "`field_deg` .*is no list of pairs"),
        (lambda a: ml.psf(a, [530], (0, 0)), "`field_deg` .*is no list of pairs"),  # type: ignore[arg-type]
        (lambda a: ml.psf(a, [530], [(95, 0)], elements=[4]), r"at \(95, 0\) degrees .*sines 0, 0\n"),
        (lambda a: ml.psf(a, [530], [(np.nan, 0)]), "`field_deg` .*nan at"),
        (lambda a: ml.psf(a, [530], samples=-3), "`samples` = -3"),
        (lambda a: ml.psf(PILLARS, [530], pitch_nm=350, distance_um=20.0, samples=0), "`samples` = 0"),
        (lambda a: ml.psf(a, [530], elements=[9]), "no element 9\n  help: .*0 to 8"),
        (lambda a: ml.psf(a, [530], elements=[-1]), "no element -1"),
        (lambda a: ml.psf(a, [530], elements=[]), "names none"),
        (lambda a: ml.psf(a, [530], pixel_um=0.0), "pixel_um = 0"),
        (lambda a: ml.psf(a, [530], aperture_um=50.0), "leave out .*`aperture_um`"),
        (lambda a: ml.psf(a, [530], model="m.toml", fidelity="fitted"), "leave out one of `fidelity` and `model`"),
        (lambda a: ml.psf(PILLARS[0], [530], **MAP), r"`of` of shape \(8,\)"),
        (lambda a: ml.psf(-PILLARS.astype(int), [530], **MAP), "whole nanometres"),
        (lambda a: ml.propagate(np.ones(4), pitch_nm=350, wavelength_nm=530, distance_um=20), "`aperture` of shape"),
        (lambda a: ml.propagate(np.ones((4, 4)), pitch_nm=-1, wavelength_nm=530, distance_um=20), "`pitch_nm` = -1"),
        (lambda a: a.widths(-1), "no element -1"),
        (lambda a: a.write("chip.gds", layer=(-1, 0)), "`layer` = -1"),
        (lambda a: ml.places(-1, pitch_nm=350), "`sites` = -1"),
        (lambda a: ml.Rectangles(-80, 200).numbers([0.0]), "`width_nm` = -80"),
        (lambda a: ml.denoise(np.zeros(4), 0.1), "grey picture, of shape"),
        (lambda a: ml.denoise(np.zeros((40, 40)), [0.1, 0.2]), "one number, or one for each value"),
    ],
)
def test_what_cannot_be_is_refused_with_a_remedy(
    array: ml.Array, call: Callable[[ml.Array], object], words: str
) -> None:
    with pytest.raises(ml.MetalithError, match=words) as found:
        call(array)
    assert "\n  help: " in str(found.value)


def test_no_widths_have_no_transmissions() -> None:
    assert ml.cell([], 530.0).shape == (0,) and ml.cell([200.0, 250.0], []).shape == (2, 0)
    bare = ml.cell(0.0, 530.0)
    assert bare == ml.cell([0.0, 200.0], 530.0)[0]


def test_figures_are_of_the_pixel_that_was_asked_for(array: ml.Array, tmp_path: Path) -> None:
    array.write(tmp_path / "chip.oas")
    layout = ml.read_layout(tmp_path / "chip.oas")
    design = array.design or pytest.fail()
    light: dict[str, Any] = dict(elements=[4], fast=True)

    def shares(of: ml.Array | ml.Layout, **more: Any) -> tuple[float, float]:
        (psf,) = ml.psf(of, [530], **light, **more)
        assert psf.element == ("element 4" if of is layout else "(0, 0)")
        return psf.pixel_um, psf.energy_1_pixel

    at = dict(distance_um=design.focal_length_um)
    small, large = shares(array, pixel_um=2.0), shares(array)
    assert small[0] == 2.0 and large[0] == 5.86 and small[1] < large[1]
    # The two windows have other samples, and a pixel is summed over them.
    assert shares(layout, **at) == pytest.approx(large, rel=0.02)
    assert shares(layout, pixel_um=2.0, **at) == pytest.approx(small, rel=0.02)


def test_a_model_is_applied_as_the_program_does(array: ml.Array, tmp_path: Path) -> None:
    model, chip = tmp_path / "model.toml", tmp_path / "chip.oas"
    model.write_text(NARROWER)
    lens = array.widths(4)
    ml.write_layout(chip, lens, pitch_nm=350)
    light: dict[str, Any] = dict(distance_um=60.0, samples=64, fast=True, pixel_um=3.0)
    ways: list[dict[str, Any]] = [dict(model=model), {}]
    made, drawn = (ml.psf(ml.read_layout(chip), [530], **light, **how) for how in ways)
    assert drawn.model is None and made.model is not None
    assert made[:1].model == made.model and made.model["finding"] == "explained by cd_bias"
    assert not np.isclose(made[0].strehl, drawn[0].strehl, rtol=0.01)
    # Pillars narrower by as much, drawn so, are the same chip.
    narrower = np.where(lens > 0, lens - 20, 0).astype(np.uint16)
    alike = ml.psf(narrower, [530], pitch_nm=350, **light)[0]
    assert np.allclose(alike.values, made[0].values, rtol=1e-3, atol=1e-3 * float(alike.values.max()))
    options = ["--distance-um=60", "--samples=64", "--wavelength-nm=530", "--pixel-um=3", "--fast", "--json"]
    program = Path(sys.executable).with_name("metalith")
    run = subprocess.run([program, "psf", chip, "--model", model, *options], capture_output=True, text=True)
    (told,) = json.loads(run.stdout)["psfs"]
    for figure in ("strehl", "energy_1_pixel"):
        assert getattr(made[0], figure) == pytest.approx(told[figure], rel=1e-6)


def test_an_array_of_a_design_takes_a_model(array: ml.Array, tmp_path: Path) -> None:
    model = tmp_path / "model.toml"
    model.write_text(NARROWER)
    light: dict[str, Any] = dict(elements=[4], samples=32, fast=True)
    ways: list[dict[str, Any]] = [dict(model=model), {}]
    made, drawn = (ml.psf(array, [530], **light, **how)[0] for how in ways)
    assert not np.isclose(made.strehl, drawn.strehl, rtol=0.01)


def test_elements_are_made_by_where_they_stand(tmp_path: Path) -> None:
    """A term of the model that varies over the chip makes copies of one element different."""
    model, lens = tmp_path / "model.toml", PILLARS
    tilted = "[perturbation.path]\nsensor_tilt_mrad = [200.0, 0.0]\n"
    model.write_text(NARROWER + tilted)
    chip = ml.write_layout(tmp_path / "chip.gds", [lens, lens], pitch_nm=350, centres_nm=[(0, 0), (40000, 0)])
    light: dict[str, Any] = dict(distance_um=20.0, samples=16, fast=True)
    here, there = ml.psf(chip, [530], model=model, **light)
    assert not np.allclose(here.values, there.values)
    (alone,) = ml.psf(chip, [530], model=model, elements=[1], **light)
    assert alone.element == "element 1" and np.array_equal(alone.values, there.values)


def test_a_grey_picture_stays_grey() -> None:
    clean = np.repeat(np.linspace(0.2, 0.8, 48)[None, :], 40, axis=0)
    noisy = clean + 0.1 * np.random.default_rng(1).standard_normal(clean.shape)
    found = ml.denoise(noisy, 0.1)
    assert found.shape == clean.shape and found.dtype == np.float32
    # Colours with the same noise help each other less than those of the test of three: half of it is left at most.
    assert np.sqrt(np.mean((found - clean) ** 2)) < 0.1 / 2
    three = ml.denoise(np.repeat(noisy[:, :, None], 3, axis=2), 0.1)
    assert np.allclose(three.mean(axis=2), found, atol=1e-6)
