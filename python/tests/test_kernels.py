"""Kernels of an imaging system: images of points through one element."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import metalith as ml

from test_imaging_system import MINI, nine_lenses

# The kernels are of a band of 10 nm and of cells without neighbours, the PSF is of 530 nm: the light in a pixel differs by 1 % of
# what arrives. Found: 0.4 %.
PIXEL = 0.01
PIXEL_UM = 2.0


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> ml.ImagingSystem:
    return nine_lenses(tmp_path_factory.mktemp("kernels"))


def test_a_kernel_is_the_psf_over_pixels(system: ml.ImagingSystem) -> None:
    kernels = system.kernels(4)
    at = len(kernels.places_um) // 2
    assert kernels.places_um[at] == 0
    # Primaries add up to white.
    kernel = kernels.values[at, at, 0].sum(axis=0)
    design = ml.Design.read(MINI)
    (psf,) = ml.psf(design.array(), [530], [(0, 0)], elements=[4])
    step = psf.x_um[1] - psf.x_um[0]
    # PSFs are of |E|^2 over that of the wave in the substrate, kernels of energy.
    area = np.pi * 30.0**2 * ml.index("fused_silica_malitson_1965", 530).real

    def share(samples_um: npt.NDArray[np.float64], pixel_um: float) -> npt.NDArray[np.float64]:
        """Share of each sample that is in a pixel with this middle."""
        left = np.maximum(samples_um - step / 2, pixel_um - PIXEL_UM / 2)
        right = np.minimum(samples_um + step / 2, pixel_um + PIXEL_UM / 2)
        inside: npt.NDArray[np.float64] = np.clip((right - left) / step, 0, 1)
        return inside

    for i in (-3, -1, 0, 2):
        for j in (-2, 0, 1):
            row, column = len(kernels.offsets_um) // 2 + i, len(kernels.offsets_um) // 2 + j
            y, x = kernels.offsets_um[row], kernels.offsets_um[column]
            expected = share(psf.y_um, y) @ psf.values @ share(psf.x_um, x) * step**2 / area
            assert abs(kernel[row, column] - expected) < PIXEL


def test_every_so_manieth_place_is_one_of_all(system: ml.ImagingSystem) -> None:
    every, some = system.kernels(0), system.kernels(0, step=4)
    assert np.array_equal(some.values, every.values[::4, ::4])
    assert np.array_equal(some.places_um, every.places_um[::4])
    assert np.all(every.values.sum(axis=(-2, -1)) / 4 < 1)


def test_kernels_have_axes_and_units(system: ml.ImagingSystem, tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    stack = system.kernels(4, step=8).to_xarray()
    assert stack.dims == ("row", "column", "channel", "colour", "y", "x")
    assert {stack[name].attrs["units"] for name in ("row", "column", "y", "x")} == {"um"}
    stack.to_netcdf(tmp_path / "kernels.nc", engine="scipy")
    with xarray.open_dataarray(tmp_path / "kernels.nc", engine="scipy") as again:
        assert np.array_equal(again.values, stack.values)
        assert again.attrs["convention"] == stack.attrs["convention"]


def test_an_element_that_is_not_there_is_refused(system: ml.ImagingSystem) -> None:
    with pytest.raises(ml.MetalithError, match="0 to 8"):
        system.kernels(9)
    with pytest.raises((ml.MetalithError, TypeError, ValueError)):
        system.kernels(0, step=0)
