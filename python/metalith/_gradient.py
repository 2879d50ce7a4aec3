"""The PSF of a lens with its derivatives, and the mapping between phases and pillars."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal, SupportsIndex, TypeAlias, Union

import numpy as np
import numpy.typing as npt

from . import _arguments, _native
from ._layouts import Design, native_design
from ._light import MOST_SAMPLES
from ._shapes import Lattice, places
from ._types import Float64, Progress, Widths

Merit: TypeAlias = Union[Callable[[Float64], "tuple[float, npt.ArrayLike]"], npt.NDArray[Any]]
"""A merit of a PSF: a function of its values that gives the merit and its derivatives by them, of their shape; or weights of
the values, whose sum is the merit."""

MAPS_FIRST = "give phases or widths first, then a metalith.Design"

Pullback: TypeAlias = "Callable[[npt.ArrayLike], PsfGradient]"
"""From the derivatives of a merit by the values of a PSF to those by what the PSF is a function of."""


def widths_of(phase_rad: npt.ArrayLike, design: Design, *, element: SupportsIndex | None = None) -> Widths:
    """Widths of the pillars that the mapping of a design has for phases (rad), as they are written: uint16 in nanometres, of
    the shape of ``phase_rad``; of rectangles their numbers. A phase counts modulo 2 pi; NaN is a place without pillar,
    whose width is zero. ``element``: of a design whose steered elements have mappings of their own, the number of the element
    from zero; left out, the mapping that all others have. :class:`MetalithError` if a phase is infinite, or there is no such
    element."""
    native, chosen = native_design(design, MAPS_FIRST), _element(design, element)
    phases = _arguments.phases("phase_rad", phase_rad)
    return _native.widths_of(phases.ravel(), native, chosen).reshape(phases.shape)


def phases_of(width_nm: npt.ArrayLike, design: Design, *, element: SupportsIndex | None = None) -> Float64:
    """The phases (rad, 0 to 2 pi) for which the mapping of a design has pillars of these widths (nm), or these numbers of
    rectangles: the middle of the phases that are rounded to the width, so that :func:`widths_of` gives the width again. float64 of
    the shape of ``width_nm``, NaN where the width is zero. ``element``: as for :func:`widths_of`. :class:`MetalithError`
    for a width that the mapping has for no phase, with the widths that it has."""
    native, chosen = native_design(design, MAPS_FIRST), _element(design, element)
    widths = _arguments.widths("width_nm", width_nm)
    phases, missing, known = _native.phases_of(widths.ravel(), native, chosen)
    if missing is not None:
        at = tuple(int(k) for k in np.unravel_index(missing, widths.shape))
        raise _native.MetalithError(
            f"`width_nm` of shape {widths.shape}: {widths[at]} at {at} is of no phase\n"
            f"  help: the mapping of this design has {len(known)} widths from {known[0]} to {known[-1]}: take the nearest of them"
        )
    return phases.reshape(widths.shape)


def _element(design: Design, element: SupportsIndex | None) -> int | None:
    return None if element is None else _arguments.element(element, len(design.elements))


@dataclass(frozen=True, eq=False)
class PsfGradient:
    """Derivatives of a merit of a PSF."""

    map: Float64 = field(repr=False)
    """By the phase (1/rad) or the width (1/nm) of each pillar, shape ``[sites, sites]``; zero where nothing passes."""
    wedge_deg: tuple[float, float]
    """By the angles of the wedge (1/degree)."""
    distance_um: float | None
    """By the distance (1/um); None if no distance was given."""


class PsfModel:
    """The PSF of a lens as a differentiable function of its phases or widths, of its wedge, and of the distance.

    ``model(x)`` is the intensity on a window of the sensor over that of the light that arrives, float64 of shape
    ``[samples, samples]``, rows along +y. ``x`` has the shape ``[sites, sites]``: phases (rad) of pillars that pass all
    light, or, with ``cell``, widths (nm), a site without pillar being one whose ``amplitude`` is zero. Values at places that
    pass nothing do not count. The PSF is that of :func:`propagate`, with its accuracy: 1e-5 of the peak of a lens, 1e-3 if
    ``fast``; derivatives are those of this PSF, exact but for rounding in single precision.

    ``sites`` along an axis, ``pitch_nm`` and ``lattice`` are as :func:`places` has them. ``amplitude``: factor of the transmission of
    each site, shape ``[sites, sites]``; left out, it is one in the circle of ``diameter_um``, which fills the lattice if left
    out, and zero around it. ``cell``: widths (nm, rising) and the transmission of each, such as ``(widths, ml.cell(widths,
    532.0))``; widths between them are interpolated by cubics, and those outside of them refused. The window is about
    ``at_um``, its samples ``step_um`` apart (the pitch if left out). ``incidence_deg`` is the direction of the light.

    A wedge of angles ``wedge_deg`` (in the x-z and y-z plane) adds the phase 2 pi (x sin a + y sin b) / wavelength to the lens.
    ``distance_um`` of a call is that from the pillar tops to the sensor, left out that of the model.

    It can be copied, pickled, and used in several threads and in child processes at once. It has no state."""

    def __init__(
        self,
        sites: SupportsIndex,
        *,
        pitch_nm: SupportsIndex,
        wavelength_nm: float,
        distance_um: float,
        lattice: Lattice = "square",
        diameter_um: float | None = None,
        amplitude: npt.ArrayLike | None = None,
        cell: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
        at_um: tuple[float, float] = (0.0, 0.0),
        samples: SupportsIndex = 64,
        step_um: float | None = None,
        incidence_deg: tuple[float, float] = (0.0, 0.0),
        fast: bool = False,
    ) -> None:
        n = _arguments.whole("sites", sites, 1, _arguments.MOST_16)
        pitch = _arguments.whole("pitch_nm", pitch_nm, 1, _arguments.MOST_32)
        wavelength = _arguments.wavelengths("wavelength_nm", wavelength_nm)
        if wavelength.ndim != 0:
            raise _native.MetalithError(f"`wavelength_nm` of shape {wavelength.shape}\n  help: give one number")
        self.distance_um = _length("distance_um", distance_um)
        """From the pillar tops to the sensor where a call does not say (um)."""
        self.variable: Literal["phase", "width"] = "phase" if cell is None else "width"
        """What lenses are given by: phases (rad) or widths (nm)."""
        self._incidence = _sines("incidence_deg", _arguments.pair("incidence_deg", incidence_deg))
        open_sites = _amplitude(n, pitch, lattice, diameter_um, amplitude)
        self._arguments = (
            open_sites,
            pitch,
            lattice,
            float(wavelength),
            self.distance_um,
            _arguments.pair("at_um", at_um),
            _arguments.whole("samples", samples, 1, MOST_SAMPLES),
            _length("step_um", pitch * 1e-3 if step_um is None else step_um),
            bool(fast),
            None if cell is None else _curve(*cell),
        )
        self._native = _native.PsfModel.plan(*self._arguments)

    @classmethod
    def of_design(
        cls,
        design: Design,
        wavelength_nm: float | None = None,
        *,
        variable: Literal["phase", "width"] = "phase",
        fidelity: str = "rigorous",
        progress: Progress | None = None,
        **window: Any,
    ) -> PsfModel:
        """The PSF of lenses of the pitch, lattice, diameter and distance of a design, at a wavelength (the first that the design
        is verified at, if left out). ``variable``: lenses are given by their phases (rad), or by widths (nm) from the
        narrowest to the widest pillar of the design, whose transmissions are solved with ``fidelity``. ``window``: any of
        ``amplitude``, ``at_um``, ``samples``, ``step_um``, ``incidence_deg``, ``fast``."""
        native = native_design(design)
        nm = design.wavelengths_nm[0] if wavelength_nm is None else wavelength_nm
        if variable == "width":
            window["cell"] = _native.curve_of(native, float(nm), fidelity, progress)
        elif variable != "phase":
            raise _native.MetalithError(f"`variable` = {variable!r}\n  help: give 'phase' or 'width'")
        window.setdefault("diameter_um", None if "amplitude" in window else design.diameter_um)
        return cls(
            native.sites,
            pitch_nm=design.pitch_nm,
            lattice=design.lattice,
            wavelength_nm=nm,
            distance_um=design.focal_length_um,
            **window,
        )

    @property
    def sites(self) -> int:
        """Places along an axis of the map of a lens."""
        return int(self._arguments[0].shape[0])

    @property
    def samples(self) -> int:
        """Samples along an axis of the window."""
        return self._arguments[6]

    @property
    def amplitude(self) -> npt.NDArray[np.float32]:
        """Factor of the transmission of each site, shape ``[sites, sites]``: zero where nothing passes. A copy."""
        return self._arguments[0].copy()

    @property
    def x_um(self) -> Float64:
        """Places of the columns of the window from the axis of the lens (um)."""
        return self._native.places()[0]

    @property
    def y_um(self) -> Float64:
        """Places of the rows (um)."""
        return self._native.places()[1]

    def __call__(
        self, x: npt.ArrayLike, *, distance_um: float | None = None, wedge_deg: tuple[float, float] = (0.0, 0.0)
    ) -> Float64:
        """The PSF of phases (rad) or widths (nm): float64, shape ``[samples, samples]``."""
        return self._psf(x, distance_um, wedge_deg, False)[0]

    def vjp(
        self, x: npt.ArrayLike, *, distance_um: float | None = None, wedge_deg: tuple[float, float] = (0.0, 0.0)
    ) -> tuple[Float64, Pullback]:
        """The PSF, and the function that takes the derivatives of a merit by its values (shape ``[samples, samples]``) to a
        :class:`PsfGradient`: a vector-Jacobian product. The derivative by the distance is computed if ``distance_um`` is
        given."""
        return self._vjp(x, distance_um, wedge_deg, distance_um is not None)

    def _vjp(
        self, x: npt.ArrayLike, distance_um: float | None, wedge_deg: tuple[float, float], along_z: bool
    ) -> tuple[Float64, Pullback]:
        """The same, the derivative by the distance or none."""
        psf, back = self._psf(x, distance_um, wedge_deg, along_z)
        slopes = [float(np.cos(np.radians(deg)) * np.pi / 180.0) for deg in wedge_deg]

        def pull(cotangents: npt.ArrayLike) -> PsfGradient:
            values = _arguments.numbers("cotangents", cotangents, np.float64)
            if values.shape != psf.shape:
                raise _native.MetalithError(f"`cotangents` of shape {values.shape}\n  help: give {psf.shape}, as the PSF")
            by_map, sines, distance = self._native.pull(back, values)
            return PsfGradient(by_map, (sines[0] * slopes[0], sines[1] * slopes[1]), distance)

        return psf, pull

    def value_and_gradient(
        self,
        merit: Merit,
        x: npt.ArrayLike,
        *,
        distance_um: float | None = None,
        wedge_deg: tuple[float, float] = (0.0, 0.0),
    ) -> tuple[float, PsfGradient]:
        """A merit of the PSF, and its derivatives. ``merit``: a function that takes the PSF and gives the merit and its
        derivatives by the values of the PSF, or an array of weights of the values, whose sum is the merit.
        :class:`MetalithError` if merit or derivatives are no finite numbers."""
        psf, pull = self.vjp(x, distance_um=distance_um, wedge_deg=wedge_deg)
        if callable(merit):
            value, cotangents = merit(psf)
            if not (np.isfinite(value) and np.all(np.isfinite(cotangents))):
                raise _native.MetalithError(
                    f"a merit of {float(value):g}: it or one of its derivatives is not finite\n"
                    "  help: keep logarithms and quotients of the merit away from zero"
                )
            return float(value), pull(cotangents)
        weights = _arguments.numbers("merit", merit, np.float64)
        if weights.shape != psf.shape:
            raise _native.MetalithError(f"`merit` of shape {weights.shape}\n  help: give weights of shape {psf.shape}")
        return float(np.sum(psf * weights)), pull(weights)

    def _psf(
        self, x: npt.ArrayLike, distance_um: float | None, wedge_deg: tuple[float, float], along_z: bool
    ) -> tuple[Float64, _native.PsfPullback]:
        values = _lens(x)
        wedge = _sines("wedge_deg", _arguments.pair("wedge_deg", wedge_deg))
        sines = (self._incidence[0] + wedge[0], self._incidence[1] + wedge[1])
        distance = self.distance_um if distance_um is None else _length("distance_um", distance_um)
        return self._native.psf(values, sines, distance, along_z)

    def __reduce__(self) -> tuple[Any, ...]:
        return _planned, (self._arguments, self.variable, self._incidence)

    def __repr__(self) -> str:
        return f"PsfModel({self.sites} x {self.sites} sites by {self.variable}, {self.samples} x {self.samples} samples)"


def _planned(
    arguments: tuple[Any, ...], variable: Literal["phase", "width"], incidence: tuple[float, float]
) -> PsfModel:
    """A model of the arguments of another: a copy in this process or another."""
    model = PsfModel.__new__(PsfModel)
    model._arguments = arguments
    model.distance_um, model.variable, model._incidence = arguments[4], variable, incidence
    model._native = _native.PsfModel.plan(*arguments)
    return model


def _lens(x: npt.ArrayLike) -> Float64:
    """Phases or widths as native code takes them, which holds widths to those of the cell. Arrays of the right kind are passed on
    after one look: an optimiser calls often."""
    most = _arguments.MOST_RAD
    if type(x) is np.ndarray and x.dtype == np.float64 and x.ndim == 2 and x.size and x.flags.carray:
        # False where a value is NaN.
        if -most <= x.min() and x.max() <= most:
            return x
    values = _arguments.phases("x", x)
    _arguments.square("x", values)
    return values


def pair_of(values: Any) -> tuple[float, float]:
    """Two numbers of an array of any package."""
    return float(values[0]), float(values[1])


def _length(name: str, um: float) -> float:
    value = float(um)
    if not (np.isfinite(value) and value > 0):
        raise _native.MetalithError(f"`{name}` = {um}\n  help: give a positive number of micrometres")
    return value


def _sines(name: str, deg: tuple[float, float]) -> tuple[float, float]:
    if max(map(abs, deg)) >= 90:
        raise _native.MetalithError(f"`{name}` = {deg}\n  help: give angles of less than 90 degrees")
    return float(np.sin(np.radians(deg[0]))), float(np.sin(np.radians(deg[1])))


def _amplitude(
    sites: int, pitch_nm: int, lattice: Lattice, diameter_um: float | None, given: npt.ArrayLike | None
) -> npt.NDArray[np.float32]:
    """Factors of the transmission of each site."""
    if given is not None:
        if diameter_um is not None:
            raise _native.MetalithError("`amplitude` and `diameter_um`\n  help: leave out one of them")
        values = _arguments.numbers("amplitude", given, np.float32)
        if values.shape != (sites, sites):
            raise _native.MetalithError(f"`amplitude` of shape {values.shape}\n  help: give ({sites}, {sites}), as the sites")
        most = _arguments.MOST_MODULUS
        _arguments.refuse("amplitude", values, abs(values) > most, f"give factors up to {most:g}")
        return values.copy()
    at = places(sites, pitch_nm=pitch_nm, lattice=lattice)
    diameter_nm = float(sites * pitch_nm if diameter_um is None else _length("diameter_um", diameter_um) * 1e3)
    inside = np.hypot.outer(at.y_nm, at.x_nm) <= 0.5 * diameter_nm
    return (inside & at.is_site).astype(np.float32)


def _curve(widths: npt.ArrayLike, t: npt.ArrayLike) -> tuple[Float64, npt.NDArray[np.complex128]]:
    """Widths and their transmissions, as lists."""
    nm = _arguments.numbers("cell", widths, np.float64).ravel()
    transmissions = _arguments.numbers("cell", np.asarray(t), np.complex128).ravel()
    return nm, transmissions
