"""Pictures: frames that a small camera records, and what is restored from them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import metalith as ml
from calls import camera

ROOT = Path(__file__).resolve().parents[2]
MINI = ROOT / "designs/mini_3x3.toml"
SHAPE = (48, 48)

# A sensor that sees the nine lenses of 60 um, 150 um apart, in one narrow band.
CAMERA = camera(240, (525, 535))


def scene() -> npt.NDArray[np.float64]:
    """Stripes and a bright square on grey."""
    values = np.full((*SHAPE, 3), 0.3)
    values[:, ::12] = 0.8
    values[16:30, 20:34] = 0.9
    return values


def nine_lenses(folder: Path) -> ml.ImagingSystem:
    """The nine lenses behind this camera."""
    (folder / "small.toml").write_text(CAMERA)
    design = ml.Design.read(MINI)
    design.array().write(folder / "chip.oas")
    return ml.ImagingSystem(design, folder / "chip.oas", folder / "small.toml", shape=SHAPE, field_deg=60.0)


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> ml.ImagingSystem:
    return nine_lenses(tmp_path_factory.mktemp("system"))


@pytest.fixture(scope="module")
def frame(system: ml.ImagingSystem) -> ml.Frame:
    return system.record(scene())


def test_a_frame_is_what_the_sensor_records(system: ml.ImagingSystem, frame: ml.Frame) -> None:
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


def test_a_grey_scene_is_one_of_three_equal_colours(system: ml.ImagingSystem, frame: ml.Frame) -> None:
    # The scene has the same value in each colour.
    grey = scene()[:, :, 0]
    assert np.array_equal(system.record(grey).planes[0], frame.planes[0])
    for given in (grey, grey[:, :, None]):
        assert np.array_equal(system.truth(given), system.truth(scene()))


def test_a_picture_is_restored(system: ml.ImagingSystem, frame: ml.Frame) -> None:
    truth = system.truth(scene())
    assert truth.shape == (*SHAPE, 3)
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


def test_pictures_are_labelled_arrays(system: ml.ImagingSystem) -> None:
    picture = scene()
    labelled = system.to_xarray(picture)
    assert dict(labelled.sizes) == {"y": 48, "x": 48, "colour": 3} and np.array_equal(labelled.values, picture)
    # The field is from edge to edge: half a pixel beyond the outermost middles.
    step = float(labelled.x[1] - labelled.x[0])
    assert float(labelled.x[-1]) + step / 2 == pytest.approx(np.tan(np.radians(30.0)))
    assert float(labelled.y[0]) == -float(labelled.x[-1])
    assert float(labelled.x_deg[24]) == pytest.approx(np.degrees(np.arctan(step / 2)))
    assert system.to_xarray(picture[:, :, 0]).dims == ("y", "x")
    with pytest.raises(ml.MetalithError, match=r"`picture` of shape \(48,\)"):
        system.to_xarray(picture[0, :, 0])


def test_frames_and_pictures_are_shown(system: ml.ImagingSystem, frame: ml.Frame) -> None:
    labelled = frame.to_xarray()
    assert dict(labelled.sizes) == {"plane": 1, "y": 240, "x": 240}
    assert np.array_equal(labelled.values[0], frame.planes[0])
    assert "240 x 240" in frame._repr_html_()
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    assert np.array_equal(frame.plot().axes[0].images[0].get_array(), frame.planes[0])
    # Half of white is 0.735 in sRGB (IEC 61966-2-1), and what is above white is white.
    grey = np.full((48, 48), 0.5)
    half, over = system.plot(half=grey, over=4 * grey).axes
    assert half.get_title() == "half" and half.images[0].get_array()[0, 0] == pytest.approx(0.7354, abs=1e-4)
    assert over.images[0].get_array().max() == pytest.approx(1.0)
    with pytest.raises(ml.MetalithError, match="no picture to plot"):
        system.plot()


def test_a_frame_from_elsewhere_is_restored_as_one_that_was_simulated(system: ml.ImagingSystem, frame: ml.Frame) -> None:
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


def test_what_cannot_be_recorded_or_restored_is_told(system: ml.ImagingSystem, frame: ml.Frame) -> None:
    with pytest.raises(ml.MetalithError, match=r"give one of shape \(48, 48, 3\)"):
        system.record(np.zeros((20, 48, 3)))
    with pytest.raises(ml.MetalithError, match=r"of shape \(48, 48, 2\)\n  help: give three colours.*or a grey picture"):
        system.record(np.zeros((*SHAPE, 2)))
    with pytest.raises(ml.MetalithError, match="`seed` = -1"):
        system.record(scene(), seed=-1)
    with pytest.raises(ml.MetalithError, match="`count` = -1"):
        system.samples(frame, -1)
    with pytest.raises(ml.MetalithError, match="magic"):
        system.restore(frame, "magic")
