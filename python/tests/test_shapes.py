"""Round and rectangular pillars: from arrays to files, back, and to light."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import metalith as ml

ROOT = Path(__file__).resolve().parents[2]
RECTANGLES = ml.Rectangles(width_nm=100, length_nm=250, steps=180)
TIO2 = "tio2_siefke_2016"


@pytest.mark.parametrize("name", ["a.gds", "a.oas"])
def test_circles_of_any_diameters_become_a_layout(tmp_path: Path, name: str) -> None:
    diameters = (2 * np.random.default_rng(1).integers(50, 150, (40, 40))).astype(np.uint16)
    array = ml.write_layout(tmp_path / name, diameters, pitch_nm=400, shape="circle")
    assert array.shape == "circle"
    layout = ml.read_layout(tmp_path / name)
    assert (layout.shape, layout.pitch_nm, layout.other_shapes) == ("circle", 400, 0)
    assert np.array_equal(layout.widths[0], diameters)
    with pytest.raises(ml.MetalithError, match="circles have no rotation"):
        layout.rotations_deg(0)


@pytest.mark.parametrize("name", ["a.gds", "a.oas"])
@pytest.mark.parametrize("hierarchy", ["folded", "sref", "flat"])
def test_rectangles_of_any_rotations_become_a_layout(tmp_path: Path, name: str, hierarchy: str) -> None:
    rng = np.random.default_rng(2)
    rotations = rng.integers(0, 180, (20, 20)).astype(float)
    rotations[rng.random(rotations.shape) < 0.1] = np.nan
    # Half a turn of the whole map leaves each rectangle as it is: the second is a copy of the first.
    maps = [rotations, rotations[::-1, ::-1]]
    places = [(0, 0), (20_000, -3_000)]
    array = ml.write_layout(
        tmp_path / name, maps, pitch_nm=360, shape=RECTANGLES, centres_nm=places, hierarchy=hierarchy
    )
    assert array.pillars == 2 * np.count_nonzero(~np.isnan(rotations))
    layout = ml.read_layout(tmp_path / name, array=array)
    assert (layout.shape, layout.pillars, layout.other_shapes) == (RECTANGLES, array.pillars, 0)
    assert layout.centres_nm == places
    for k, wanted in enumerate(maps):
        assert np.allclose(layout.rotations_deg(k), wanted, equal_nan=True)
        assert np.allclose(array.rotations_deg(k), wanted, equal_nan=True)


def test_rotations_go_to_the_nearest_step_and_half_a_turn_is_none() -> None:
    coarse = ml.Rectangles(width_nm=100, length_nm=250, steps=4)
    found = coarse.rotations_deg(coarse.numbers([0.0, 180.0, -45.0, 60.0, 170.0, np.nan]))
    assert np.allclose(found, [0.0, 0.0, 135.0, 45.0, 0.0, np.nan], equal_nan=True)


def test_what_cannot_be_a_pillar_is_refused(tmp_path: Path) -> None:
    none = np.zeros((4, 4))
    for shape, words in [
        (ml.Rectangles(101, 250), "even edges"),
        (ml.Rectangles(250, 100), "width below the length"),
        (ml.Rectangles(100, 250, 0), "steps"),
        (ml.Rectangles(100, 500), "at most the pitch"),
        ("hexagon", "no shape `hexagon`"),
    ]:
        with pytest.raises(ml.MetalithError, match=words):
            ml.write_layout(tmp_path / "a.gds", none, pitch_nm=360, shape=shape)  # type: ignore[arg-type]
    with pytest.raises(ml.MetalithError, match="`widths` of shape .*inf at"):
        ml.write_layout(tmp_path / "a.gds", none + np.inf, pitch_nm=360, shape=RECTANGLES)
    with pytest.raises(ml.MetalithError, match="even"):
        ml.write_layout(tmp_path / "a.gds", none + 101, pitch_nm=360, shape="circle")
    assert not (tmp_path / "a.gds").exists()


@pytest.mark.parametrize("name", ["tio2_532", "geometric_phase_532", "birefringent_532"])
def test_psfs_of_a_file_are_those_of_its_design(tmp_path: Path, name: str) -> None:
    design = ml.Design.read(ROOT / f"designs/{name}.toml")
    array = design.array()
    array.write(tmp_path / "chip.oas")
    layout = ml.read_layout(tmp_path / "chip.oas", design=design)
    assert layout.shape == array.shape
    light: dict[str, Any] = dict(fast=True, samples=64)
    of_design = ml.psf(array, [532], [(0, 0), (5, 0)], **light)
    of_file = ml.psf(
        layout,
        [532],
        [(0, 0), (5, 0)],
        distance_um=design.focal_length_um,
        pillar_height_nm=design.pillar_height_nm,
        pillar=TIO2,
        **light,
    )
    for theirs, ours in zip(of_design, of_file):
        # The same pillars in the same light: single precision of the fields.
        assert np.allclose(ours.values, theirs.values, rtol=1e-4, atol=1e-5 * theirs.values.max())
    with pytest.raises(ml.MetalithError, match="by the `published` cell"):
        ml.psf(layout, [532], distance_um=80.0, fidelity="published", pillar=TIO2)


def image_of(
    design: ml.Design,
    numbers: npt.NDArray[np.uint16],
    shape: ml.Shape,
    samples: int,
    arriving: str | float | None,
    analyser: str | None = None,
) -> npt.NDArray[np.float64]:
    """The PSF of a lens of titanium dioxide at 532 nm, of pillars that only a map of numbers says."""
    return ml.psf(
        numbers,
        [532],
        shape=shape,
        arriving=arriving,
        analyser=analyser,
        pitch_nm=design.pitch_nm,
        distance_um=design.focal_length_um,
        pillar_height_nm=design.pillar_height_nm,
        pillar=TIO2,
        fast=True,
        samples=samples,
    )[0].values


def test_light_of_the_other_handedness_is_not_focused() -> None:
    design = ml.Design.read(ROOT / "designs/geometric_phase_532.toml")
    array = design.array()
    numbers = array.widths(0)

    image = partial(image_of, design, numbers, array.shape, 64)
    values = {arriving: image(arriving) for arriving in ("left", "right", "x", "y", 30, -60.0, "unpolarised")}
    peak = values["left"].max()
    # A lens for one is a diverging lens for the other.
    assert values["right"].max() < 1e-2 * peak
    for pair in (("left", "right"), ("x", "y"), (30, -60.0)):
        mean = 0.5 * (values[pair[0]] + values[pair[1]])
        # Single precision of the fields.
        assert np.allclose(values["unpolarised"], mean, rtol=0, atol=1e-5 * peak)
    # Images behind crossed analysers are all of the light.
    analysed = {analyser: image("right", analyser) for analyser in ("x", "y", "circular")}
    assert np.allclose(analysed["x"] + analysed["y"], values["right"], rtol=0, atol=1e-5 * peak)
    # What is converted, without what is not.
    assert analysed["circular"].sum() < 0.999 * values["right"].sum()
    with pytest.raises(ml.MetalithError, match="a circular analyser in light that arrives unpolarised"):
        ml.psf(
            numbers,
            [532],
            shape=array.shape,
            arriving="unpolarised",
            analyser="circular",
            pitch_nm=design.pitch_nm,
            distance_um=80.0,
        )
    with pytest.raises(ml.MetalithError, match="no light of polarisation `diagonal`"):
        ml.psf(numbers, [532], shape=array.shape, arriving="diagonal", pitch_nm=design.pitch_nm, distance_um=80.0)
    with pytest.raises(ml.MetalithError, match="light of a polarisation for squares"):
        ml.psf(np.full((8, 8), 200, np.uint16), [532], arriving="x", pitch_nm=350, distance_um=80.0)


UPRIGHT = ml.UprightRectangles(shortest_nm=90, step_nm=10, lengths=20)


@pytest.mark.parametrize("name", ["a.gds", "a.oas"])
def test_upright_rectangles_of_any_widths_become_a_layout(tmp_path: Path, name: str) -> None:
    rng = np.random.default_rng(3)
    x, y = 10 * rng.integers(9, 29, (2, 30, 30))
    there = rng.random(x.shape) > 0.1
    x, y = np.where(there, x, 0), np.where(there, y, 0)
    numbers = UPRIGHT.numbers(x, y)
    array = ml.write_layout(tmp_path / name, numbers, pitch_nm=350, shape=UPRIGHT)
    assert (array.shape, array.pillars) == (UPRIGHT, there.sum())
    layout = ml.read_layout(tmp_path / name, array=array)
    assert (layout.shape, layout.other_shapes) == (UPRIGHT, 0)
    for read, wanted in zip(UPRIGHT.widths_nm(layout.widths[0]), (x, y)):
        assert np.array_equal(read, wanted)
    # Without the array: the widths that occur.
    found = ml.read_layout(tmp_path / name)
    assert isinstance(found.shape, ml.UprightRectangles)
    assert np.array_equal(found.shape.widths_nm(found.widths[0])[0], x)
    with pytest.raises(ml.MetalithError, match="upright rectangles have no rotation"):
        layout.rotations_deg(0)
    with pytest.raises(ml.MetalithError, match="a pillar of 95 x 100 nm"):
        UPRIGHT.numbers([95], [100])
    with pytest.raises(ml.MetalithError, match="1 to 64 widths"):
        ml.write_layout(tmp_path / name, numbers, pitch_nm=350, shape=ml.UprightRectangles(90, 10, 65))


def test_light_along_each_axis_is_focused_to_its_own_side() -> None:
    design = ml.Design.read(ROOT / "designs/birefringent_532.toml")
    array = design.array()

    image = partial(image_of, design, array.widths(0), array.shape, 96)
    x, y, both = image("x"), image("y"), image("unpolarised")
    assert np.array_equal(image(None), x)
    column = [int(np.unravel_index(np.argmax(v), v.shape)[1]) - 48 for v in (x, y)]
    assert abs(0.35 * column[0] - 8) < 0.5 and abs(0.35 * column[1] + 8) < 0.5
    assert np.allclose(both, 0.5 * (x + y), rtol=0, atol=1e-5 * x.max())
    assert np.allclose(image("unpolarised", "x"), 0.5 * x, rtol=0, atol=1e-5 * x.max())
    with pytest.raises(ml.MetalithError, match="which focus no hand"):
        image("x", "circular")
