"""Pictures: frames that a small camera records, and what is restored from them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import metalith as ml

ROOT = Path(__file__).resolve().parents[2]
MINI = ROOT / "designs/mini_3x3.toml"
SHAPE = (48, 48)

# A sensor that sees the nine lenses of 60 um, 150 um apart, in one narrow band.
CAMERA = """
schema = 1
name = "small"
[sensor]
pixel_um = 2.0
columns = 240
rows = 240
filter = "none"
bits = 12
full_well_e = 10000
read_noise_e = 2
gain_e = 2.5
[[channel]]
name = "green"
band_nm = [525, 535]
[exposure]
time_ms = "auto"
white = 0.8
[illuminant]
source = "equal_energy"
"""


def scene() -> npt.NDArray[np.float64]:
    """Stripes and a bright square on grey."""
    values = np.full((*SHAPE, 3), 0.3)
    values[:, ::12] = 0.8
    values[16:30, 20:34] = 0.9
    return values


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> ml.ImagingSystem:
    folder = tmp_path_factory.mktemp("system")
    (folder / "small.toml").write_text(CAMERA)
    design = ml.Design.read(MINI)
    design.array().write(folder / "chip.oas")
    return ml.ImagingSystem(design, folder / "chip.oas", folder / "small.toml", shape=SHAPE, field_deg=60.0)


def test_a_frame_is_what_the_sensor_records(system: ml.ImagingSystem) -> None:
    frame = system.record(scene())
    (plane,) = frame.planes
    assert plane.shape == (240, 240) and plane.dtype == np.float32
    assert 0 <= plane.min() and plane.max() <= 1 and frame.saturated == 0
    # A white surface is exposed to 0.8 of full scale; the scene is darker.
    assert 0.1 < plane.max() < 0.8
    assert np.array_equal(system.record(scene()).planes[0], plane), "a seed has one frame"
    other = system.record(scene(), seed=2).planes[0]
    assert not np.array_equal(other, plane)
    # 10000 electrons, two of read noise: the difference of two frames of mean signal s has variance 2 s / 10000, and more.
    lit = plane > 0.1
    expected = np.sqrt(2 * (plane[lit].mean() / 1e4 + (2 / 1e4) ** 2))
    assert np.std((other - plane)[lit]) == pytest.approx(expected, rel=0.2)


def test_a_grey_scene_is_one_of_three_equal_colours(system: ml.ImagingSystem) -> None:
    grey = scene()[:, :, 0]
    colours = np.repeat(grey[:, :, None], 3, axis=2)
    for given in (grey, grey[:, :, None]):
        assert np.array_equal(system.record(given).planes[0], system.record(colours).planes[0])
        assert np.array_equal(system.truth(given), system.truth(colours))


def test_a_picture_is_restored(system: ml.ImagingSystem) -> None:
    truth = system.truth(scene())
    assert truth.shape == (*SHAPE, 3)
    frame = system.record(scene())
    found = {method: system.restore(frame, method) for method in ("tikhonov", "tv")}
    inside = (slice(6, -6), slice(6, -6))
    spread = float(np.std(truth[inside]))
    for method, picture in found.items():
        assert picture.shape == truth.shape
        error = float(np.sqrt(np.mean((picture - truth)[inside] ** 2)))
        # A picture of nothing but its mean would err by the spread of the truth.
        assert error < 0.7 * spread, (method, error, spread)
    assert not np.array_equal(found["tikhonov"], found["tv"])
    alone = system.restore(frame, joint=False)
    assert alone.shape == truth.shape and not np.array_equal(alone, found["tikhonov"])
    assert np.array_equal(system.restore(frame), found["tikhonov"])


def test_a_frame_from_elsewhere_is_restored_as_one_that_was_simulated(system: ml.ImagingSystem) -> None:
    frame = system.record(scene())
    again = system.frame(frame.planes)
    assert again.saturated == frame.saturated
    assert np.array_equal(system.restore(again), system.restore(frame))
    plane = frame.planes[0]
    with pytest.raises(ml.MetalithError, match="the frame has 2 planes, and the camera gives 1"):
        system.frame([plane, plane])
    with pytest.raises(ml.MetalithError, match="another camera"):
        system.frame([plane[:-2]])
    with pytest.raises(ml.MetalithError, match=r"`planes` of shape \(3,\)"):
        system.frame([[1.0, 2.0, 3.0]])
    with pytest.raises(ml.MetalithError, match="`planes` .*nan at"):
        system.frame([plane * np.nan])


def test_what_cannot_be_recorded_or_restored_is_told(system: ml.ImagingSystem) -> None:
    with pytest.raises(ml.MetalithError, match=r"give one of shape \(48, 48, 3\)"):
        system.record(np.zeros((20, 48, 3)))
    with pytest.raises(ml.MetalithError, match=r"of shape \(48, 48, 2\)\n  help: give three colours.*or a grey picture"):
        system.record(np.zeros((*SHAPE, 2)))
    with pytest.raises(ml.MetalithError, match="`seed` = -1"):
        system.record(scene(), seed=-1)
    with pytest.raises(ml.MetalithError, match="`count` = -1"):
        system.samples(system.record(scene()), -1)
    with pytest.raises(ml.MetalithError, match="magic"):
        system.restore(system.record(scene()), "magic")
