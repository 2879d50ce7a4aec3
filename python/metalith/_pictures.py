"""Pictures: the frame that a camera records of a scene, and the picture restored from it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from . import _native
from ._layouts import Design
from ._types import Float64, PathLike, Progress

METHODS = ("tikhonov", "tv", "richardson-lucy", "hqs", "prior")


class Frame:
    """A frame that was recorded."""

    def __init__(self, native: _native.Frame) -> None:
        self._native = native

    @property
    def planes(self) -> list[npt.NDArray[np.float32]]:
        """Values from 0 to 1, full scale: one plane ``[row, column]`` of a sensor with a colour filter array, else one for
        each channel."""
        return self._native.planes

    @property
    def saturated(self) -> int:
        """Pixels at full scale."""
        return self._native.saturated


class Studio:
    """A layout behind a camera, for scenes of one size and field.

    The pillars are read from the bytes of the layout. Kernels over the field are made once, which takes minutes for
    lenses of 1 mm, and kept on the disk as the program keeps them.

    ``shape``: rows and columns of the scenes. Pixels finer than half a pixel of the sensor are averaged to these, and truth
    and pictures have their number. ``field_deg``: angle from their left to their right edge.
    ``distance_mm``: of their plane; far if left out. ``model``: the chip as made, by the model of a calibration.
    ``prior``: weights for the method ``prior`` that ``metalith train`` wrote; those of the program if left out."""

    def __init__(
        self,
        design: Design,
        layout: PathLike,
        camera: PathLike,
        *,
        shape: tuple[int, int],
        field_deg: float = 90.0,
        distance_mm: float | None = None,
        model: PathLike | None = None,
        prior: PathLike | None = None,
        progress: Progress | None = None,
    ) -> None:
        rows, columns = shape
        self.shape = shape
        self.field_deg = field_deg
        self._native = _native.Studio.open(
            design._native, layout, camera, rows, columns, field_deg, distance_mm, model, prior, progress
        )

    def record(self, scene: npt.ArrayLike, *, seed: int = 1, progress: Progress | None = None) -> Frame:
        """The frame of a scene ``[row, column, colour]`` in linear sRGB, white being 1; noise is drawn from ``seed``."""
        return Frame(self._native.record(np.ascontiguousarray(scene, dtype=np.float64), seed, progress))

    def truth(self, scene: npt.ArrayLike) -> Float64:
        """What an ideal camera with the same channels gives of a scene, linear sRGB: what pictures are held to."""
        return self._native.truth(np.ascontiguousarray(scene, dtype=np.float64))

    def restore(
        self, frame: Frame, method: str = "tikhonov", *, joint: bool = True, progress: Progress | None = None
    ) -> Float64:
        """The picture ``[row, column, colour]`` restored from a frame, linear sRGB, by one of ``METHODS``: by all elements at
        once (``joint``), or by each alone and blended."""
        return self._native.restore(frame._native, method, joint, progress)

    def samples(self, frame: Frame, count: int, *, progress: Progress | None = None) -> Sequence[Float64]:
        """Pictures that a frame may be of, drawn by the learnt prior: their mean is a picture, their spread says how sure
        it is."""
        return self._native.samples(frame._native, count, progress)


def denoise(
    values: npt.ArrayLike, deviation: npt.ArrayLike, *, weights: PathLike | None = None
) -> npt.NDArray[np.float32]:
    """A picture ``[row, column, colour]`` of sRGB values from 0 to 1 without its normal noise. ``deviation``: of the noise, in
    the same unit; one number, or one for each value."""
    given = np.ascontiguousarray(values, dtype=np.float32)
    everywhere = np.ascontiguousarray(np.broadcast_to(np.asarray(deviation, dtype=np.float32), given.shape))
    return _native.denoise(given, everywhere, weights)
