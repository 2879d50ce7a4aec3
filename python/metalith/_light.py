"""Light: PSFs, cells, materials, and the propagation of any aperture."""

from __future__ import annotations

import json
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
import numpy.typing as npt

from . import _arguments, _html, _native
from ._figures import imported, subplots
from ._layouts import Array, Design, Layout, _map
from ._shapes import Lattice, Shape, told_of
from ._types import Complex64, Complex128, Float64, Json, PathLike, Progress, Widths

if TYPE_CHECKING:
    from collections.abc import Iterator

# Along an axis of a window: what spectra of the program hold.
MOST_SAMPLES = 8192

SILICON_NITRIDE = "sin_luke_2015"
FUSED_SILICA = "fused_silica_malitson_1965"

# Height of the pillars of the published cell (nm), where a call says none.
HEIGHT_NM = 700.0


# Planes of a through-focus series where no number is asked for, and the most.
PLANES = 9
MOST_PLANES = 101


@dataclass(frozen=True, eq=False)
class ThroughFocus:
    """PSFs of one element in planes along z; arrays have an entry for each plane, NaN where there is no number."""

    focal_length_um: float | None
    """Distance of the greatest Strehl ratio from the pillars (um), by a parabola through it and its neighbours; None if that is the
    first or the last plane."""
    sensor_um: float
    """Distance of the sensor (um)."""
    depth_of_focus_um: float
    """Wavelength over the square of the numerical aperture (um)."""
    plane_spacing_um: float
    distance_um: Float64 = field(repr=False)
    """Distance of each plane from the pillars (um)."""
    strehl: Float64 = field(repr=False)
    """Against the ideal PSF in the plane of the sensor."""
    peak: Float64 = field(repr=False)
    fwhm_x_um: Float64 = field(repr=False)
    fwhm_y_um: Float64 = field(repr=False)
    focusing_efficiency: Float64 = field(repr=False)
    values: Float64 = field(repr=False)
    """Intensity over that of the light that arrives, shape ``[planes, samples, samples]``."""


@dataclass(frozen=True, eq=False)
class Psf:
    """The PSF of one element in one light."""

    element: str
    wavelength_nm: float
    field_deg: tuple[float, float]
    """Angles of the light from where the element looks, in the x-z and y-z plane (degrees)."""
    incidence_sin: tuple[float, float]
    """Direction sines of the light."""
    x_um: Float64 = field(repr=False)
    """Places of the columns from the axis of the element (um)."""
    y_um: Float64 = field(repr=False)
    """Places of the rows (um)."""
    values: Float64 = field(repr=False)
    """Intensity over that of the light that arrives, shape ``[samples, samples]``."""
    pixel_um: float = field(repr=False)
    """Edge of the sensor pixel that energies and frequencies are of (um)."""
    strehl: float
    fwhm_um: tuple[float | None, float | None] = field(repr=False)
    """Full width at half maximum along x and y (um); None if it reaches beyond the window."""
    focusing_efficiency: float | None = field(repr=False)
    """Power in a circle of three full widths about the peak, over the power incident on the aperture."""
    peak_um: tuple[float, float] = field(repr=False)
    centroid_um: tuple[float, float] = field(repr=False)
    energy_1_pixel: float = field(repr=False)
    """Share of the light in a square of one pixel about the peak, of what a perfect aperture passes."""
    energy_2_pixels: float = field(repr=False)
    energy_passed: float = field(repr=False)
    """Share of all light that passes, of the same."""
    mtf_half_nyquist: tuple[float, float] = field(repr=False)
    """MTF along x and y, without the pixel, at half of the finest frequency that pixels tell: 42.7 line pairs a millimetre for
    5.86 um."""
    mtf_nyquist: tuple[float, float] = field(repr=False)
    """The same at all of it: 85.3 line pairs a millimetre for 5.86 um."""
    through_focus: ThroughFocus | None = field(default=None, repr=False)
    """PSFs in planes along z, if asked for."""

    def to_xarray(self) -> Any:
        """As :meth:`PsfSet.to_xarray`, of this one."""
        return PsfSet([self]).to_xarray()

    def plot(self) -> Any:
        """As :meth:`PsfSet.plot`, of this one."""
        return PsfSet([self]).plot(columns=1)

    def _repr_html_(self) -> str:
        return PsfSet([self])._repr_html_()


class PsfSet(Sequence[Psf]):
    """PSFs of elements, wavelengths and fields, in this order."""

    def __init__(self, psfs: list[Psf], model: Json | None = None) -> None:
        self._psfs = psfs
        self.model = model
        """What the model says that they were made by: ``set``, ``finding``, and what was ``not_applied``, each with the
        reason; None for pillars as drawn."""

    @overload
    def __getitem__(self, k: int) -> Psf: ...
    @overload
    def __getitem__(self, k: slice) -> PsfSet: ...
    def __getitem__(self, k: int | slice) -> Psf | PsfSet:
        return PsfSet(self._psfs[k], self.model) if isinstance(k, slice) else self._psfs[k]

    def __len__(self) -> int:
        return len(self._psfs)

    def __iter__(self) -> Iterator[Psf]:
        return iter(self._psfs)

    def table(self) -> list[dict[str, Any]]:
        """The figures of each PSF, for ``pandas.DataFrame`` or a loop."""
        rows = []
        for p in self._psfs:
            row = {k: v for k, v in vars(p).items() if k not in ("x_um", "y_um", "values", "through_focus")}
            rows.append(row)
        return rows

    def to_xarray(self) -> Any:
        """An ``xarray.DataArray`` with dimensions element, wavelength_nm, field, y and x. Windows of steered elements
        lie elsewhere for each PSF: x and y count from the middle of the window, ``centre_x_um`` and ``centre_y_um`` are
        coordinates."""
        xarray = imported("xarray")
        self._some()
        elements = list(dict.fromkeys(p.element for p in self._psfs))
        wavelengths = list(dict.fromkeys(p.wavelength_nm for p in self._psfs))
        fields = list(dict.fromkeys(p.field_deg for p in self._psfs))
        samples = len(self._psfs[0].x_um)
        shape = (len(elements), len(wavelengths), len(fields))
        values = np.full((*shape, samples, samples), np.nan)
        centres = np.full((*shape, 2), np.nan)
        for p in self._psfs:
            at = (elements.index(p.element), wavelengths.index(p.wavelength_nm), fields.index(p.field_deg))
            values[at] = p.values
            centres[at] = (p.x_um[samples // 2], p.y_um[samples // 2])
        first = self._psfs[0]
        dims = ("element", "wavelength_nm", "field")
        return xarray.DataArray(
            values,
            dims=(*dims, "y", "x"),
            coords={
                "element": elements,
                "wavelength_nm": wavelengths,
                "field_x_deg": ("field", [f[0] for f in fields]),
                "field_y_deg": ("field", [f[1] for f in fields]),
                "x": first.x_um - first.x_um[samples // 2],
                "y": first.y_um - first.y_um[samples // 2],
                "centre_x_um": (dims, centres[..., 0]),
                "centre_y_um": (dims, centres[..., 1]),
            },
            name="psf",
            attrs={"long_name": "intensity over that of the light that arrives"},
        )

    def plot(self, columns: int = 4) -> Any:
        """A matplotlib figure of all PSFs on one logarithmic scale of four decades."""
        colors = imported("matplotlib.colors")
        self._some()
        rows = -(-len(self) // columns)
        figure, axes = subplots(rows, columns, squeeze=False, figsize=(3 * columns, 3 * rows))
        most = max(float(p.values.max()) for p in self)
        for axis in axes.flat[len(self) :]:
            axis.set_axis_off()
        for axis, p in zip(axes.flat, self):
            extent = (p.x_um[0], p.x_um[-1], p.y_um[0], p.y_um[-1])
            axis.imshow(p.values, origin="lower", extent=extent, norm=colors.LogNorm(1e-4 * most, most))
            axis.set_title(f"{p.element}, {p.wavelength_nm:g} nm, {p.field_deg[0]:g} deg", fontsize=8)
            axis.set_xlabel("x [um]")
            axis.set_ylabel("y [um]")
        figure.tight_layout()
        return figure

    def _some(self) -> None:
        if not self._psfs:
            raise _native.MetalithError("there is no PSF in this set\n  help: take a part of the set that holds one")

    def __repr__(self) -> str:
        return f"PsfSet({len(self)} PSFs)"

    def _repr_html_(self) -> str:
        columns = ("element", "wavelength (nm)", "field x, y (deg)", "Strehl ratio", "FWHM x (um)", "FWHM y (um)", "focusing efficiency")
        rows = (
            (p.element, p.wavelength_nm, f"{p.field_deg[0]:g}, {p.field_deg[1]:g}", p.strehl, *p.fwhm_um, p.focusing_efficiency)
            for p in self
        )
        return _html.table(rows, columns=columns, caption=repr(self))


def psf(
    of: Array | Layout | Widths,
    wavelengths_nm: npt.ArrayLike,
    field_deg: Sequence[tuple[float, float]] = ((0.0, 0.0),),
    *,
    elements: Sequence[int] | None = None,
    fidelity: str | None = None,
    model: PathLike | None = None,
    fast: bool = False,
    samples: int | None = None,
    pixel_um: float | None = None,
    aperture_um: float | None = None,
    distance_um: float | None = None,
    pitch_nm: int | None = None,
    shape: Shape = "square",
    lattice: Lattice = "square",
    arriving: str | float | None = None,
    analyser: str | float | None = None,
    pillar_height_nm: float | None = None,
    pillar: str | None = None,
    substrate: str | None = None,
    through_focus: bool | float = False,
    planes: int = PLANES,
    progress: Progress | None = None,
) -> PsfSet:
    """PSFs of the distinct lenses of an array, of the elements of a layout that was read, or of one map of widths.

    ``field_deg`` counts from where an element looks. ``elements`` counts from zero. ``fidelity`` is ``rigorous`` (a lattice of
    equal pillars, along the normal; so if left out), ``neighbours`` (each pillar among its own neighbours;
    solved in minutes for each direction of light, then kept), ``fitted`` or
    ``published``. In its place ``model`` takes the chip as made, by the ``model.toml`` of a calibration: what it adds to distance
    and angles is added to those stated, and ``.model`` of the result says what of it was not applied. ``aperture_um`` is the
    diameter of the openings in the metal, for a model whose aperture is off its place: that of the circle around the
    pillars if left out.

    ``pixel_um`` is the edge of the sensor pixel that ``energy_1_pixel``, ``energy_2_pixels`` and the MTF are of. Left out, it is
    that of the design for an array of a design, and 5.86 um for all else: a layout says nothing of the sensor, also of one
    that was read at the elements of a design. ``samples`` along an axis of the window, one pitch apart, are those of the design
    or 128. ``fast`` allows errors of 1e-3 instead of 1e-5 of the peak.

    ``pillar`` and ``substrate`` are materials, 700 nm of silicon nitride on fused silica if left out, which a warning says.

    An array of a design knows its sensor and its pillars; else ``distance_um`` and, for a map of widths, ``pitch_nm`` are needed, ``shape`` where pillars are no
    squares, and ``lattice`` where they stand on a hexagonal one, which ``rigorous`` and ``fitted`` alone know.
    Rectangles are solved by ``rigorous`` alone, in light that arrives ``left`` or ``right`` circularly
    polarised, linearly along ``x`` or ``y`` or at an angle from x towards y in degrees, or ``unpolarised`` (``arriving``);
    left out, it is ``left`` for rotated rectangles and ``x`` for upright ones.
    ``analyser`` is what is before the sensor: ``x``, ``y`` or an angle, or, of rotated rectangles, ``circular``, which passes
    what light that arrives ``left`` or ``right`` is converted to. An
    array of a design is in the light that the design says. Intensities are over that of all light that arrives.

    ``through_focus`` asks for ``planes`` planes along z about the sensor, up to so many micrometres on each side; ``True`` takes two
    depths of focus, twice the wavelength over the square of the numerical aperture. Each PSF then has ``.through_focus``."""
    if isinstance(of, Design):
        raise TypeError("PSFs of a design\n  help: give its array, `design.array()`")
    wavelengths = [float(nm) for nm in _arguments.wavelengths("wavelengths_nm", wavelengths_nm).ravel()]
    if not wavelengths:
        raise _native.MetalithError("PSFs at no wavelength\n  help: give at least one in `wavelengths_nm`")
    fields = _arguments.fields(field_deg)
    samples = _arguments.maybe_whole("samples", samples, 1, MOST_SAMPLES)
    series = None
    if through_focus is not False:
        range_um = None if through_focus is True else float(through_focus)
        series = (range_um, _arguments.whole("planes", planes, 3, MOST_PLANES))
    if isinstance(of, Array) and of.design is not None:
        own = (distance_um, aperture_um, pitch_nm, shape, lattice, arriving, analyser, pillar_height_nm, pillar, substrate)
        if own != (None, None, None, "square", "square", None, None, None, None, None):
            raise _native.MetalithError(
                "an array of a design knows its sensor, its pillars and its light\n"
                "  help: leave out `distance_um`, `aperture_um`, `pitch_nm`, `shape`, `lattice`, `arriving`, `analyser` and what pillars are made of,"
                " or change the design"
            )
        chosen = None if elements is None else _arguments.elements(elements, len(of))
        found, said = _native.psf_of_array(
            of._native, wavelengths, fields, fidelity, model, fast, samples, pixel_um, chosen, series, progress
        )
        return _set(found, said)
    if pillar is None and model is None:
        height = HEIGHT_NM if pillar_height_nm is None else pillar_height_nm
        warnings.warn(
            f"pillars are taken to be {height:g} nm of {SILICON_NITRIDE} on {substrate or FUSED_SILICA}: give `pillar`, `pillar_height_nm` and"
            " `substrate` of the chip",
            stacklevel=2,
        )
    maps, centres, pitch, lattice, shape = _maps(of, pitch_nm, lattice, shape)
    numbers = list(range(len(maps))) if elements is None else _arguments.elements(elements, len(maps))
    if distance_um is None:
        raise _native.MetalithError(
            "a layout says nothing of the sensor\n  help: give `distance_um`, from the pillar tops to the sensor"
        )
    found, said = _native.psf_of_widths(
        [maps[k] for k in numbers],
        [f"element {k}" for k in numbers],
        [centres[k] for k in numbers],
        pitch,
        lattice,
        wavelengths,
        fields,
        distance_um,
        fidelity,
        model,
        aperture_um,
        fast,
        128 if samples is None else samples,
        pixel_um,
        told_of(shape),
        None if arriving is None else str(arriving),
        None if analyser is None else str(analyser),
        HEIGHT_NM if pillar_height_nm is None else pillar_height_nm,
        pillar or SILICON_NITRIDE,
        substrate or FUSED_SILICA,
        series,
        progress,
    )
    return _set(found, said)


def _set(found: list[dict[str, Any]], said: str | None) -> PsfSet:
    for p in found:
        series = p["through_focus"]
        p["through_focus"] = None if series is None else ThroughFocus(**series)
    return PsfSet([Psf(**p) for p in found], None if said is None else json.loads(said))


def _maps(
    of: Array | Layout | Widths, pitch_nm: int | None, lattice: Lattice, shape: Shape
) -> tuple[list[Widths], list[tuple[int, int]], int, Lattice, Shape]:
    """Pillars and centre (nm) of each element, and how they stand."""
    if isinstance(of, Layout):
        maps = [_arguments.widths("of.widths", one) for one in of.widths]
        return maps, of.centres_nm, of.pitch_nm, of.lattice, of.shape
    if isinstance(of, Array):
        return [of.widths(k) for k in range(len(of))], of.centres_nm, of.pitch_nm, of.lattice, of.shape
    if isinstance(of, Design):
        raise TypeError("PSFs of a design\n  help: give its array: `design.array()`")
    if pitch_nm is None:
        raise _native.MetalithError("a map of widths has no pitch\n  help: give `pitch_nm`")
    one = _map("of", of, shape)
    return [one], [(0, 0)], _arguments.whole("pitch_nm", pitch_nm, 1, _arguments.MOST_32), lattice, shape


class Transmission(np.ndarray[Any, np.dtype[np.complex128]]):
    """Complex transmissions that know the widths and wavelengths they are of: an array like any other, which
    :func:`cell` gives. What is computed from it, or taken out of it, knows them no longer."""

    width_nm: Float64 | None
    """Widths of the pillars (nm); the first axes are theirs."""
    wavelength_nm: Float64 | None
    """Wavelengths (nm); the last axes are theirs."""

    def __array_finalize__(self, of: Any) -> None:
        self.width_nm = None
        self.wavelength_nm = None

    def __reduce__(self) -> Any:
        reduced: Any = super().__reduce__()
        make, arguments, state = reduced
        return make, arguments, (state, self.width_nm, self.wavelength_nm)

    def __setstate__(self, state: Any) -> None:
        values, self.width_nm, self.wavelength_nm = state
        super().__setstate__(values)

    def __copy__(self) -> Transmission:
        copied = super().__copy__().view(Transmission)
        copied.width_nm, copied.wavelength_nm = self.width_nm, self.wavelength_nm
        return copied

    def __deepcopy__(self, _: Any) -> Transmission:
        return self.__copy__()

    def _coordinates(self) -> tuple[Float64, Float64]:
        """Widths and wavelengths, both as lists."""
        if self.width_nm is None or self.wavelength_nm is None:
            raise _native.MetalithError(
                "a part of an array of transmissions, or what was computed from one, has no widths and wavelengths\n"
                "  help: call it on what `metalith.cell` gave, and take the part of the result"
            )
        if self.width_nm.ndim > 1 or self.wavelength_nm.ndim > 1:
            raise _native.MetalithError(
                "widths or wavelengths of more than one dimension\n  help: give `metalith.cell` a list of each"
            )
        return np.atleast_1d(self.width_nm), np.atleast_1d(self.wavelength_nm)

    def to_xarray(self) -> Any:
        """An ``xarray.DataArray`` with dimensions width_nm and wavelength_nm."""
        widths, wavelengths = self._coordinates()
        return imported("xarray").DataArray(
            np.asarray(self).reshape(len(widths), len(wavelengths)),
            dims=("width_nm", "wavelength_nm"),
            coords={"width_nm": widths, "wavelength_nm": wavelengths},
            name="transmission",
            attrs={"long_name": "ratio of fields, from the foot of the pillars to their tops"},
        )

    def plot(self) -> Any:
        """A matplotlib figure of modulus and phase: over the wavelength, a line for each width; over the width where
        there is one wavelength."""
        widths, wavelengths = self._coordinates()
        t = np.asarray(self).reshape(len(widths), len(wavelengths))
        over_width = len(wavelengths) == 1
        x, lines = (widths, t.T) if over_width else (wavelengths, t)
        names = [f"{v:g} nm" for v in (wavelengths if over_width else widths)]
        figure, axes = subplots(2, 1, sharex=True, figsize=(6, 6))
        for line, name in zip(lines, names):
            axes[0].plot(x, np.abs(line), label=name)
            axes[1].plot(x, np.angle(line) / (2 * np.pi), label=name)
        axes[0].set_ylabel("modulus")
        axes[1].set_ylabel("phase [turns]")
        axes[1].set_xlabel("width [nm]" if over_width else "wavelength [nm]")
        # More names than this hide the lines.
        if len(names) <= 12:
            axes[0].legend(fontsize=8)
        figure.tight_layout()
        return figure


def cell(
    width_nm: npt.ArrayLike,
    wavelength_nm: npt.ArrayLike,
    *,
    pitch_nm: float = 350.0,
    lattice: Lattice = "square",
    shape: Literal["square", "circle"] = "square",
    pillar_height_nm: float = 700.0,
    pillar: str = SILICON_NITRIDE,
    substrate: str = FUSED_SILICA,
    orders: int = 13,
    progress: Progress | None = None,
) -> Transmission:
    """Complex zero-order transmission of square or round pillars on a lattice of equal ones, by rigorous coupled-wave
    analysis, for light along the normal from the substrate: complex128 of the shape of ``width_nm`` followed by that of
    ``wavelength_nm``. It is a ratio of fields, from the foot of the pillars to their tops; ``orders`` along an axis, odd.
    Widths of circles are diameters; on a hexagonal lattice pillars are circles, and ``pitch_nm`` is a whole number.
    A width of zero is a site without pillar, the bare substrate; a negative one is refused. No widths or no wavelengths give an
    empty array, as numpy's own functions do. ``.to_xarray()`` and ``.plot()`` show it with its widths and wavelengths."""
    widths = _arguments.numbers("width_nm", width_nm, np.float64)
    _arguments.refuse("width_nm", widths, abs(widths) > _arguments.MOST_32, "give widths up to the pitch, in nanometres")
    wavelengths = _arguments.wavelengths("wavelength_nm", wavelength_nm)
    found = _native.cell(
        widths.ravel(),
        wavelengths.ravel(),
        pitch_nm,
        lattice,
        told_of(shape),
        pillar_height_nm,
        pillar,
        substrate,
        _arguments.whole("orders", orders, 1, _arguments.MOST_16),
        progress,
    )
    t = found.reshape(widths.shape + wavelengths.shape).view(Transmission)
    t.width_nm, t.wavelength_nm = widths, wavelengths
    return t


def index(material: str, wavelength_nm: npt.ArrayLike) -> Complex128:
    """Complex refractive index of a material that a design can name, or of a CSV file; absorption is positive."""
    wavelengths = _arguments.wavelengths("wavelength_nm", wavelength_nm)
    return _native.index(material, wavelengths.ravel()).reshape(wavelengths.shape)


def propagate(
    aperture: npt.ArrayLike,
    *,
    pitch_nm: int,
    lattice: Lattice = "square",
    wavelength_nm: float,
    distance_um: float,
    at_um: tuple[float, float] = (0.0, 0.0),
    samples: int = 128,
    step_um: float | None = None,
    incidence_deg: tuple[float, float] = (0.0, 0.0),
    fast: bool = False,
    direct: bool = False,
    progress: Progress | None = None,
) -> tuple[Complex64, Float64, Float64]:
    """The field of a plane wave behind any complex aperture: field (complex64, ``[samples, samples]``), x and y (um).

    ``aperture`` is square, its samples where :func:`places` says about the axis, each a point that weighs the area of its
    cell: ``pitch_nm`` apart, of weight pitch squared, on a square lattice; on a hexagonal one zero where there is no site.
    The window is about ``at_um``, its samples ``step_um`` apart (the pitch if left out). ``direct`` takes the Rayleigh-Sommerfeld sum
    over all samples instead of folded transforms: slow, and what they are tested against."""
    values = _arguments.numbers("aperture", aperture, np.complex128)
    _arguments.square("aperture", values)
    most = _arguments.MOST_MODULUS
    _arguments.refuse("aperture", values, abs(values) > most, f"give transmissions of moduli up to {most:g}")
    along = _arguments.pair("incidence_deg", incidence_deg)
    if max(map(abs, along)) >= 90:
        raise _native.MetalithError(f"`incidence_deg` = {along}\n  help: give angles of less than 90 degrees")
    wavelength = _arguments.wavelengths("wavelength_nm", wavelength_nm)
    if wavelength.ndim != 0:
        raise _native.MetalithError(f"`wavelength_nm` of shape {wavelength.shape}\n  help: give one number")
    return _native.propagate(
        values,
        _arguments.whole("pitch_nm", pitch_nm, 1, _arguments.MOST_32),
        lattice,
        float(wavelength),
        distance_um,
        _arguments.pair("at_um", at_um),
        _arguments.whole("samples", samples, 1, MOST_SAMPLES),
        step_um,
        along,
        fast,
        direct,
        progress,
    )
