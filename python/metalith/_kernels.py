"""Images of points on the sensor of a camera."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from . import _native
from ._figures import imported

COLOURS = ("red", "green", "blue")


class Kernels:
    """Kernels of one element: what a restoration deconvolves by. Those of an :class:`~metalith.ImagingSystem` are its
    ``kernels()``."""

    def __init__(
        self,
        element: int,
        values: npt.NDArray[np.float32],
        places_um: list[float],
        offsets_um: list[float],
        channels: list[tuple[str, float]],
    ) -> None:
        self.element = element
        self.values = values
        """``[row, column, channel, colour, y, x]``: energy in a pixel, as a share of the light of white in its channel that
        arrives at the element. Colours are the primaries of linear sRGB, and their sum is the kernel of white. Pixels stand at
        every half of one, so that all values of a kernel sum to four times its energy. Row and column are places of the field."""
        self.places_um = np.array(places_um)
        """Where light of the wavelength of the wedge lands, from the axis of the element (um), along both axes."""
        self.offsets_um = np.array(offsets_um)
        """Middle of each pixel from where light of the wavelength of the channel lands (um), along both axes."""
        self.channels = [name for name, _ in channels]
        self.channel_nm = np.array([nm for _, nm in channels])
        """Wavelength whose chief ray the kernels of each channel are about (nm)."""

    def to_xarray(self) -> Any:
        """An ``xarray.DataArray`` with dimensions row, column, channel, colour, y and x; it can be written as NetCDF or Zarr."""
        return imported("xarray").DataArray(
            self.values,
            dims=("row", "column", "channel", "colour", "y", "x"),
            coords={
                "row": ("row", self.places_um, {"units": "um", "long_name": "place of the field from the axis, along y"}),
                "column": ("column", self.places_um, {"units": "um", "long_name": "place of the field from the axis, along x"}),
                "channel": self.channels,
                "channel_nm": ("channel", self.channel_nm, {"units": "nm", "long_name": "wavelength of the chief ray"}),
                "colour": list(COLOURS),
                "y": ("y", self.offsets_um, {"units": "um", "long_name": "distance from the chief ray along y"}),
                "x": ("x", self.offsets_um, {"units": "um", "long_name": "distance from the chief ray along x"}),
            },
            name="energy",
            attrs={
                "units": "1",
                "long_name": "energy in a pixel over the light of white in the channel at the element",
                "element": self.element,
                "source": f"metalith {_native.__version__}",
                "convention": "pixels at every half of one along both axes; colours are primaries of linear sRGB and add up to white",
            },
        )

    def __repr__(self) -> str:
        rows, columns, channels, _, _, side = self.values.shape
        return f"<kernels of element {self.element}: {rows} x {columns} places, {channels} channels, {side} x {side} values>"
