"""Pictures: the frame that a camera records of a scene, and the picture restored from it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _arguments, _html, _native
from ._figures import imported, subplots
from ._kernels import Kernels
from ._layouts import Design, native_design
from ._types import Float64, PathLike, Progress

# Pixels along a side of a scene, as in the program.
MOST_SIDE = 4096

METHODS = ("tikhonov", "tv", "richardson-lucy", "hqs", "prior")


class Frame:
    """A frame that was recorded. It can be copied; it is pickled with the system that recorded it."""

    def __init__(self, native: _native.Frame, system: ImagingSystem) -> None:
        self._native = native
        self._system = system

    def __copy__(self) -> Frame:
        return Frame(self._native, self._system)

    def __deepcopy__(self, _: object) -> Frame:
        return self.__copy__()

    def __reduce__(self) -> tuple[Any, ...]:
        return ImagingSystem.frame, (self._system, self.planes)

    @property
    def planes(self) -> list[npt.NDArray[np.float32]]:
        """Values from 0 to 1, full scale: one plane ``[row, column]`` of a sensor with a colour filter array, else one for
        each channel."""
        return self._native.planes

    @property
    def saturated(self) -> int:
        """Pixels at full scale."""
        return self._native.saturated

    def to_xarray(self) -> Any:
        """An ``xarray.DataArray`` of float32 with dimensions plane, y and x: signals over full scale. Coordinates are numbers of
        planes and of pixels, from zero. :class:`MetalithError` if xarray is not installed."""
        xarray = imported("xarray")
        planes = np.stack(self.planes)
        return xarray.DataArray(
            planes,
            dims=("plane", "y", "x"),
            coords={name: np.arange(n) for name, n in zip(("plane", "y", "x"), planes.shape)},
            name="frame",
            attrs={"long_name": "signal over full scale", "units": "1", "saturated": self.saturated},
        )

    def plot(self) -> Any:
        """A matplotlib figure of the planes, from no signal to full scale. :class:`MetalithError` if matplotlib is not
        installed."""
        planes = self.planes
        return _pictures_figure({f"plane {k}" if len(planes) > 1 else "frame": plane for k, plane in enumerate(planes)})

    def _repr_html_(self) -> str:
        planes = self.planes
        rows = [
            ("planes", len(planes)),
            ("rows x columns (pixels)", " x ".join(map(str, planes[0].shape))),
            ("largest signal (of full scale)", float(max(plane.max() for plane in planes))),
            ("pixels at full scale", self.saturated),
        ]
        return _html.table(rows, caption="frame")


class ImagingSystem:
    """A layout behind a camera, for scenes of one size and field.

    The pillars are read from the bytes of the layout. Kernels over the field are made once, which takes minutes, and kept on the
    disk as the program keeps them: ``progress=ml.ProgressLine()`` says how long.

    ``shape``: rows and columns of the scenes. Pixels finer than half a pixel of the sensor are averaged to these, and truth
    and pictures have their number. ``field_deg``: angle from their left to their right edge.
    ``distance_mm``: of their plane; far if left out. ``model``: the chip as made, by the model of a calibration.
    ``prior``: weights for the method ``prior`` that ``metalith train`` wrote; those of the program if left out.
    ``lux`` and ``time_ms``: illuminance of the scenes (lux) and time of the exposure (ms), in place of what the camera file
    states. ``longest_ms`` instead of ``time_ms``: the camera chooses a time up to this by its light.

    It can be copied and pickled: as its design and its files, from which it is opened again."""

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
        lux: float | None = None,
        time_ms: float | None = None,
        longest_ms: float | None = None,
        progress: Progress | None = None,
    ) -> None:
        if len(shape) != 2:
            raise _native.MetalithError(f"a `shape` of {len(shape)} numbers\n  help: give rows and columns of the scenes")
        rows, columns = (_arguments.whole("shape", n, 1, MOST_SIDE) for n in shape)
        self.shape = shape
        self.field_deg = field_deg
        self._native = _native.ImagingSystem.open(
            native_design(design), layout, camera, rows, columns, field_deg, distance_mm, model, prior, lux, time_ms, longest_ms, progress
        )
        files = (None if path is None else os.path.abspath(path) for path in (layout, camera, model, prior))
        self._opened = (design, *files, shape, field_deg, distance_mm, lux, time_ms, longest_ms)

    def __copy__(self) -> ImagingSystem:
        copied = ImagingSystem.__new__(ImagingSystem)
        vars(copied).update(vars(self))
        return copied

    def __deepcopy__(self, _: object) -> ImagingSystem:
        return self.__copy__()

    def __reduce__(self) -> tuple[Any, ...]:
        return _opened, self._opened

    def record(self, scene: npt.ArrayLike, *, seed: int = 1, progress: Progress | None = None) -> Frame:
        """The frame of a scene ``[row, column, colour]`` in linear sRGB, white being 1, or of a grey one ``[row, column]``; noise
        is drawn from ``seed``."""
        drawn = _arguments.whole("seed", seed, 0, _arguments.MOST_64)
        return Frame(self._native.record(_scene(scene), drawn, progress), self)

    def frame(self, planes: Sequence[npt.ArrayLike]) -> Frame:
        """The frame that a camera recorded, to be restored: ``planes`` as those of :attr:`Frame.planes`, full scale being 1 and no
        signal 0. How bright its pictures are follows from ``white`` in ``[exposure]`` of the camera."""
        signals = [_arguments.numbers("planes", plane, np.float32) for plane in _arguments.several("planes", planes)]
        most = _arguments.MOST_SIGNAL
        for plane in signals:
            _arguments.square("planes", plane)
            _arguments.refuse("planes", plane, abs(plane) > most, f"divide by full scale: signals reach {most:g} at most")
        return Frame(self._native.frame(signals), self)

    def truth(self, scene: npt.ArrayLike) -> Float64:
        """What an ideal camera with the same channels gives of a scene, as :meth:`record` takes it, linear sRGB: what pictures
        are held to. It is ``[row, column, colour]``, of a grey scene too."""
        return self._native.truth(_scene(scene))

    def restore(
        self, frame: Frame, method: str = "tikhonov", *, joint: bool = True, progress: Progress | None = None
    ) -> Float64:
        """The picture ``[row, column, colour]`` restored from a frame, linear sRGB, by one of ``METHODS``: by all elements at
        once (``joint``), or by each alone and blended."""
        return self._native.restore(frame._native, method, joint, progress)

    def samples(self, frame: Frame, count: int, *, progress: Progress | None = None) -> Sequence[Float64]:
        """Pictures that a frame may be of, drawn by the learnt prior: their mean is a picture, their spread says how sure
        it is."""
        wanted = _arguments.whole("count", count, 1, _arguments.MOST_32)
        return self._native.samples(frame._native, wanted, progress)

    def kernels(self, element: int = 0, *, step: int = 1) -> Kernels:
        """Images of points through one element, counted from zero, at every ``step``-th place of its field along both axes."""
        chosen = _arguments.whole("element", element, 0, _arguments.MOST_32)
        return Kernels(chosen, *self._native.kernels(chosen, _arguments.whole("step", step, 1, _arguments.MOST_32)))


    def to_xarray(self, picture: npt.ArrayLike) -> Any:
        """A scene, a truth or a restored picture of this system, ``[row, column, colour]`` or grey ``[row, column]``, as an
        ``xarray.DataArray`` of float64 with dimensions y, x and, in colours, colour (red, green, blue). Values are linear sRGB,
        white being 1. The coordinates x and y are tangents of the angles under which the chip sees the middles of pixels, x_deg and
        y_deg these angles (degrees). :class:`MetalithError` for other dimensions, and if xarray is not
        installed."""
        values = _arguments.numbers("picture", picture, np.float64)
        if values.ndim not in (2, 3) or values.shape[2:] not in ((), (3,)) or values.size == 0:
            raise _native.MetalithError(
                f"`picture` of shape {values.shape}\n  help: give one of shape (rows, columns, 3), or a grey one of (rows, columns)"
            )
        # The field is from edge to edge, and pixels are square. Pictures of fine scenes have fewer pixels than these.
        rows, columns = values.shape[:2]
        step = 2 * np.tan(np.radians(self.field_deg) / 2) / columns
        y, x = ((np.arange(n) - (n - 1) / 2) * step for n in (rows, columns))
        tangent, degrees = {"units": "1", "long_name": "tangent of the angle"}, {"units": "degree"}
        coords: dict[str, Any] = {
            "y": ("y", y, tangent),
            "x": ("x", x, tangent),
            "y_deg": ("y", np.degrees(np.arctan(y)), degrees),
            "x_deg": ("x", np.degrees(np.arctan(x)), degrees),
        }
        dims = ("y", "x", "colour")[: values.ndim]
        if values.ndim == 3:
            coords["colour"] = ["red", "green", "blue"]
        attrs = {"long_name": "linear sRGB, white is 1", "units": "1"}
        return imported("xarray").DataArray(values, dims=dims, coords=coords, name="picture", attrs=attrs)

    def plot(self, **pictures: npt.ArrayLike) -> Any:
        """A matplotlib figure of pictures in linear sRGB side by side, such as ``plot(truth=truth, restored=picture)``, drawn in
        sRGB. :class:`MetalithError` if there is none, and if matplotlib is not installed."""
        if not pictures:
            raise _native.MetalithError("no picture to plot\n  help: give them by name, such as `plot(restored=picture)`")
        shown = {name: _srgb(_arguments.numbers(name, given, np.float64)) for name, given in pictures.items()}
        return _pictures_figure(shown)


def _srgb(linear: Float64) -> Float64:
    """Linear sRGB as sRGB values from 0 to 1 (IEC 61966-2-1)."""
    light = np.clip(linear, 0.0, 1.0)
    values: Float64 = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return values


def _pictures_figure(pictures: dict[str, Any]) -> Any:
    """Values from 0 to 1 side by side, the first row at the top."""
    figure, axes = subplots(1, len(pictures), squeeze=False, figsize=(4 * len(pictures), 4))
    for axis, (name, picture) in zip(axes.flat, pictures.items()):
        axis.imshow(picture, cmap="gray", vmin=0, vmax=1)
        axis.set_title(name, fontsize=8)
        axis.set_axis_off()
    figure.tight_layout()
    return figure


def _opened(
    design: Design, layout: str, camera: str, model: str | None, prior: str | None, shape: tuple[int, int], field_deg: float,
    distance_mm: float | None, lux: float | None, time_ms: float | None, longest_ms: float | None,
) -> ImagingSystem:
    """A system that was pickled."""
    return ImagingSystem(
        design, layout, camera, shape=shape, field_deg=field_deg, distance_mm=distance_mm, model=model, prior=prior, lux=lux,
        time_ms=time_ms, longest_ms=longest_ms,
    )


def _scene(given: npt.ArrayLike) -> Float64:
    """A scene in three colours."""
    light = _arguments.numbers("scene", given, np.float64)
    most = _arguments.MOST_LIGHT
    _arguments.refuse("scene", light, ~((light >= 0) & (light <= most)), f"give values from 0 to {most:g}, white being 1")
    return _arguments.colours("scene", light)


def denoise(
    values: npt.ArrayLike, deviation: npt.ArrayLike, *, weights: PathLike | None = None
) -> npt.NDArray[np.float32]:
    """A picture ``[row, column, colour]`` of sRGB values from 0 to 1 without its normal noise, or a grey one ``[row, column]``,
    which stays grey. ``deviation``: of the noise, in the same unit; one number, or one for each value."""
    given = _arguments.numbers("values", values, np.float32)
    noise = _arguments.numbers("deviation", deviation, np.float32)
    most = _arguments.MOST_PICTURE
    _arguments.refuse("values", given, abs(given) > most, f"give values of at most {most:g}, white being 1")
    _arguments.refuse("deviation", noise, ~((noise >= 0) & (noise <= most)), f"give deviations from 0 to {most:g}, white being 1")
    try:
        everywhere = np.broadcast_to(noise, given.shape)
    except ValueError:
        raise _native.MetalithError(
            f"`deviation` of shape {noise.shape} for `values` of {given.shape}\n"
            "  help: give one number, or one for each value"
        ) from None
    found = _native.denoise(_arguments.colours("values", given), _arguments.colours("deviation", everywhere), weights)
    if given.ndim == 3 and given.shape[2] == 3:
        return found
    # As restoration does with the plane of a camera that sees no colours.
    grey: npt.NDArray[np.float32] = found.mean(axis=2, dtype=np.float32).reshape(given.shape)
    return grey
