"""Designs, arrays and layouts."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from . import _arguments, _html, _native
from ._layout_figures import Quantity, has_two_phases, map_figure
from ._shapes import (
    Lattice,
    Places,
    Rectangles,
    Shape,
    UprightRectangles,
    lattice_of,
    places,
    rectangles_of,
    shape_of,
    told_of,
)
from ._types import Float64, PathLike, Progress, Widths


class Design:
    """What is built, how it is written, and what must hold of it: a design file.

    It can be copied and pickled: as its text and its path. The files that it names are read again where it is unpickled, which is
    refused if the design is another by them."""

    def __init__(self, native: _native.Design, text: str) -> None:
        self._native = native
        self._text = text

    @classmethod
    def read(cls, path: PathLike) -> Design:
        """Read a design file; all its mistakes are reported at once."""
        native = _native.Design.read(path)
        return cls(native, Path(path).read_text(encoding="utf-8"))

    @classmethod
    def parse(cls, text: str, path: PathLike = "design.toml") -> Design:
        """The design of a text, such as one that was made in Python. Files that it names count from the folder of
        ``path``, which need not be there."""
        return cls(_native.Design.parse(text, path), text)

    @classmethod
    def lens(
        cls,
        *,
        wavelength_nm: float,
        focal_length_um: float,
        diameter_um: float,
        pillar: str | None = None,
        substrate: str | None = None,
        shape: Literal["square", "circle"] | None = None,
        lattice: Lattice | None = None,
        pitch_nm: float | None = None,
        pillar_height_nm: float | None = None,
        width_nm: tuple[int, int] | None = None,
        name: str = "lens",
        progress: Progress | None = None,
    ) -> Design:
        """The design of one lens for one wavelength, with a hyperbolic phase: what ``metalith new`` makes. What is left out is
        chosen for the wavelength and the aperture: the materials by name, formula or table, the pitch and the height (nm), the
        narrowest and the widest pillar (nm); pillars are circles on a square lattice. Cells are solved for it, which takes
        seconds, and cached. :attr:`text` is the design file, each choice with its reason; the pillars are on layer 1/0.
        :class:`MetalithError` if no pillars make the lens, with the nearest values that do."""
        real, maybe = _arguments.real, _arguments.maybe_real
        lens = (real("wavelength_nm", wavelength_nm), real("focal_length_um", focal_length_um), real("diameter_um", diameter_um))
        least, most = (None, None) if width_nm is None else width_nm
        widths = [_arguments.maybe_whole("width_nm", nm, 1, _arguments.MOST_16) for nm in (least, most)]
        cell = (maybe("pitch_nm", pitch_nm), maybe("pillar_height_nm", pillar_height_nm), widths[0], widths[1])
        native, text = _native.Design.lens(name, lens, [pillar, substrate, shape, lattice], cell, progress)
        return cls(native, text)

    def __copy__(self) -> Design:
        return Design(self._native, self._text)

    def __deepcopy__(self, _: object) -> Design:
        return self.__copy__()

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickled, (self._text, os.path.abspath(self._native.path), self.digest)

    @property
    def name(self) -> str:
        """Name of the design, which its files have."""
        return self._native.name

    @property
    def title(self) -> str:
        """One line for people."""
        return self._native.title

    @property
    def text(self) -> str:
        """The design file, as it was read or parsed."""
        return self._text

    @property
    def digest(self) -> str:
        """SHA-256 of all that decides the layout, in hexadecimal."""
        return self._native.digest

    @property
    def pitch_nm(self) -> int:
        """Distance of the pillars (nm)."""
        return self._native.pitch_nm

    @property
    def lattice(self) -> Lattice:
        """How the pillars stand."""
        return lattice_of(self._native.lattice)

    @property
    def pillar_height_nm(self) -> float:
        """Height of the pillars (nm)."""
        return self._native.pillar_height_nm

    @property
    def diameter_um(self) -> float:
        """Diameter of a lens (um)."""
        return self._native.diameter_um

    @property
    def focal_length_um(self) -> float:
        """From the pillar tops to the sensor (um)."""
        return self._native.focal_length_um

    @property
    def wavelengths_nm(self) -> list[float]:
        """Wavelengths that the design is judged at (nm)."""
        return self._native.wavelengths_nm

    @property
    def elements(self) -> list[tuple[tuple[int, int], tuple[float, float]]]:
        """Index and centre (um) of each element."""
        return [(index, (centre[0], centre[1])) for index, centre in self._native.elements]

    def array(self, progress: Progress | None = None) -> Array:
        """The pillars of all elements."""
        return Array(self._native.array(progress), self)

    def plot(self, quantity: Quantity | None = None) -> Any:
        """As :meth:`Array.plot`, of the pillars of this design: the phase if left out, of upright rectangles the width."""
        array = self.array()
        return array.plot(quantity or ("width" if has_two_phases(array.shape) else "phase"))

    def __repr__(self) -> str:
        return f"Design({self.name!r}, {len(self.elements)} elements of {self.diameter_um:g} um)"

    def _repr_html_(self) -> str:
        rows = [
            ("elements", str(len(self.elements))),
            ("diameter", f"{self.diameter_um:g} um"),
            ("focal length", f"{self.focal_length_um:g} um"),
            ("pitch", f"{self.pitch_nm} nm, {self.lattice} lattice"),
            ("pillar height", f"{self.pillar_height_nm:g} nm"),
            ("wavelengths", ", ".join(f"{nm:g}" for nm in self.wavelengths_nm) + " nm"),
        ]
        return _html.table(rows, caption=f"{self.name}: {self.title}") + self._thumbnail()

    def _thumbnail(self) -> str:
        """The elements from above, to scale."""
        centres = [centre for _, centre in self.elements]
        radius = 0.5 * self.diameter_um
        reach = max(max(abs(x), abs(y)) for x, y in centres) + 1.1 * radius
        circles = "".join(f'<circle cx="{x:g}" cy="{-y:g}" r="{radius:g}"/>' for x, y in centres)
        box = f"{-reach:g} {-reach:g} {2 * reach:g} {2 * reach:g}"
        return f'<svg width="120" height="120" viewBox="{box}" fill="#4a7ab5">{circles}</svg>'


def _unpickled(text: str, path: str, digest: str) -> Design:
    """A design that was pickled, with the digest that it had."""
    design = Design.parse(text, path)
    if design.digest != digest:
        raise _native.MetalithError(
            f"the pickled design {design.name!r} is another here: a file that it names has changed, {path}\n"
            "  help: read the design anew, or bring back the files that it was read with"
        )
    return design


def native_design(given: Design, remedy: str = "give a metalith.Design, such as `Design.read(path)`") -> _native.Design:
    """The native design of what was given as ``design``."""
    if not isinstance(given, Design):
        raise TypeError(f"`design` is a {type(given).__name__}\n  help: {remedy}")
    return given._native


class Array:
    """The pillars of all elements of a chip.

    It can be copied and pickled: as its design, of which it is built again, or as its maps."""

    def __init__(self, native: _native.Array, design: Design | None = None, of_maps: bool = False) -> None:
        self._native = native
        self.design = design
        """The design that it was made from, or whose elements have these pillars; None for pillars that were given as arrays alone."""
        self._of_maps = of_maps

    @property
    def pillars(self) -> int:
        """Number of pillars."""
        return self._native.pillars

    @property
    def pitch_nm(self) -> int:
        """Distance of the pillars (nm)."""
        return self._native.pitch_nm

    @property
    def lattice(self) -> Lattice:
        """How the pillars stand."""
        return lattice_of(self._native.lattice)

    @property
    def shape(self) -> Shape:
        """What the pillars are."""
        return shape_of(self._native.shape)

    def places(self) -> Places:
        """Where the columns and rows of each map of widths are, from the centre of its element."""
        return places(self._native.sites, pitch_nm=self.pitch_nm, lattice=self.lattice)

    @property
    def centres_nm(self) -> list[tuple[int, int]]:
        """Centre of each element (nm)."""
        return [(c[0], c[1]) for _, c, _ in self._native.elements]

    def __len__(self) -> int:
        return len(self._native.elements)

    def widths(self, element: int) -> Widths:
        """Widths of the pillars of one element (nm), diameters of circles, numbers of rectangles: uint16,
        shape ``[sites, sites]``, rows along +y, columns along +x, zero where there is none. :meth:`places` says where these
        are: on a hexagonal lattice every other place of the grid is empty."""
        return self._native.widths(_arguments.element(element, len(self)))

    def rotations_deg(self, element: int) -> Float64:
        """Rotations of the rectangles of one element (degrees), NaN where there is none."""
        return rectangles_of(self.shape).rotations_deg(self.widths(element))

    def write(
        self,
        path: PathLike,
        *,
        hierarchy: str | None = None,
        layer: tuple[int, int] = (1, 0),
        progress: Progress | None = None,
    ) -> int:
        """Write the pillar layout, GDSII or OASIS by the ending ``.gds`` or ``.oas``; returns its length in bytes.

        ``hierarchy`` is ``folded``, ``sref`` or ``flat``, the same geometry; that of the design if left out. ``layer``
        is for arrays without a design."""
        return self._native.write(path, hierarchy, _arguments.layer(layer), progress)

    @classmethod
    def of_maps(
        cls,
        widths: Sequence[npt.ArrayLike] | npt.NDArray[Any],
        *,
        pitch_nm: int | None = None,
        shape: Shape = "square",
        lattice: Lattice = "square",
        centres_nm: Sequence[tuple[int, int]] | None = None,
        design: Design | None = None,
        progress: Progress | None = None,
    ) -> Array:
        """The array of maps of widths (nm), diameters (nm) or rotations (degrees), which are as :func:`write_layout` takes them;
        nothing is written. ``design``: the maps are the pillars of its elements, one map each, in place of those that its
        phase has; cell, places, light and sensor are those of the design, also in :func:`psf`. Leave out ``pitch_nm``, ``shape``,
        ``lattice`` and ``centres_nm`` then. :class:`MetalithError` if a width is odd, wider than the pitch or none of the
        design's, if maps differ in size, or if several have no centres."""
        wrong = _native.MetalithError(
            "maps of no cell, or of two\n  help: give `design`, or `pitch_nm` with `shape`, `lattice` and `centres_nm`"
        )
        if design is not None:
            if pitch_nm is not None or centres_nm is not None or (shape, lattice) != ("square", "square"):
                raise wrong
            native = native_design(design)
            own = shape_of(native.shape)
            maps = [_map("widths", one, own) for one in _arguments.several("widths", widths)]
            return cls(_native.array_of_design(maps, native, progress), design, True)
        if pitch_nm is None:
            raise wrong
        found = [_map("widths", one, shape) for one in _arguments.several("widths", widths)]
        alone = [(0, 0)] if len(found) == 1 else []
        centres = alone if centres_nm is None else _arguments.centres(centres_nm)
        pitch_nm = _arguments.whole("pitch_nm", pitch_nm, 1, _arguments.MOST_32)
        return cls(_native.array_of_widths(found, pitch_nm, lattice, centres, told_of(shape), progress))

    def plot(self, quantity: Quantity = "width") -> Any:
        """A matplotlib figure of all elements from above, places in um: a colour for each pillar by its ``width`` (nm; of
        rotated rectangles the rotation in degrees, of upright ones the width along x), or by the ``phase`` (rad) that
        the mapping of the design has for it. Large elements are drawn by every n-th pillar.
        :class:`MetalithError` for phases of an array without a design, and if matplotlib is not installed."""
        return map_figure(self, quantity)

    def _repr_html_(self) -> str:
        rows = [
            ("elements", len(self)),
            ("pillars", self.pillars),
            ("pitch", f"{self.pitch_nm} nm, {self.lattice} lattice"),
            ("shape", self.shape),
            ("sites of an element", f"{self._native.sites} x {self._native.sites}"),
        ]
        maps = ["maps"] if self.design is None or self._of_maps else []
        names = [] if self.design is None else [self.design.name]
        return _html.table(rows, caption=f"array of {' for '.join(maps + names)}")

    def __copy__(self) -> Array:
        return Array(self._native, self.design, self._of_maps)

    def __deepcopy__(self, _: object) -> Array:
        return self.__copy__()

    def __reduce__(self) -> tuple[Any, ...]:
        if self.design is not None and not self._of_maps:
            return Design.array, (self.design,)
        maps = [self.widths(k) for k in range(len(self))]
        if self.design is not None:
            return _for_design, (maps, self.design)
        return _of_maps, (maps, self.pitch_nm, self.lattice, self.centres_nm, told_of(self.shape))

    def __repr__(self) -> str:
        return f"Array({len(self)} elements, {self.pillars:,} pillars)"


def _of_maps(*told: Any) -> Array:
    """The array of maps that the native module is told."""
    return Array(_native.array_of_widths(*told))


def _for_design(maps: list[Widths], design: Design) -> Array:
    """The array of a design with other pillars, by their numbers."""
    return Array(_native.array_of_design(maps, design._native), design, True)


@dataclass(frozen=True, eq=False)
class Layout:
    """The pillars that a layout file holds."""

    widths: list[Widths] = field(repr=False)
    """Of each element (nm), diameters of circles, numbers of rectangles: uint16, shape ``[sites, sites]``,
    rows along +y, columns along +x, zero where there is no pillar. :meth:`places` says where these are."""
    names: list[str] = field(repr=False)
    """Name of each element."""
    centres_nm: list[tuple[int, int]] = field(repr=False)
    """Centre of each element (nm)."""
    pitch_nm: int
    """Distance of the pillars (nm)."""
    pillars: int
    """Number of pillars."""
    other_shapes: int
    """Shapes on the layer that are no pillar on a lattice."""
    top: str
    """Name of the cell that was read."""
    shape: Shape = "square"
    """What the pillars are."""
    lattice: Lattice = "square"
    """How the pillars stand."""

    def places(self, element: int) -> Places:
        """Where the columns and rows of the map of widths of one element are, from its centre."""
        k = _arguments.element(element, len(self.widths))
        return places(len(self.widths[k]), pitch_nm=self.pitch_nm, lattice=self.lattice)

    def rotations_deg(self, element: int) -> Float64:
        """Rotations of the rectangles of one element (degrees), NaN where there is none."""
        k = _arguments.element(element, len(self.widths))
        return rectangles_of(self.shape).rotations_deg(self.widths[k])


def _map(name: str, given: npt.ArrayLike, shape: Shape) -> Widths:
    """One map of widths, or of the numbers of rectangles."""
    if isinstance(shape, Rectangles):
        found = shape._numbers(name, given)
    elif isinstance(shape, UprightRectangles):
        found = _arguments.pillars(name, given)
    else:
        found = _arguments.widths(name, given)
    _arguments.square(name, found)
    return found


def read_layout(
    path: PathLike,
    *,
    layer: tuple[int, int] | None = None,
    top: str | None = None,
    design: Design | None = None,
    array: Array | None = None,
    progress: Progress | None = None,
) -> Layout:
    """Read the pillars of a GDSII or OASIS file, written by any program: at the elements of ``design`` or of ``array``, or
    wherever squares or circles stand on a lattice on ``layer`` (layer and datatype; if left out the one of the design, else 1/0,
    or if that has no shapes, the only layer with shapes or with pillars on a lattice). Rectangles need one of the two. All
    elements stand on lattices of one kind and pitch. Of squares and circles in one lens (shape ``mixed``) the number of a
    circle is 32768 more than its diameter (nm)."""
    natives = (design._native if design is not None else None, array._native if array is not None else None)
    names, centres, widths, pitch_nm, lattice, pillars, others, found, shape = _native.read_layout(
        path, None if layer is None else _arguments.layer(layer), top, *natives, progress
    )
    return Layout(
        widths=widths,
        names=names,
        centres_nm=[(c[0], c[1]) for c in centres],
        pitch_nm=pitch_nm,
        pillars=pillars,
        other_shapes=others,
        top=found,
        shape=shape_of(shape),
        lattice=lattice_of(lattice),
    )


def write_layout(
    path: PathLike,
    widths: Sequence[npt.ArrayLike] | npt.NDArray[Any],
    *,
    pitch_nm: int,
    shape: Shape = "square",
    lattice: Lattice = "square",
    centres_nm: Sequence[tuple[int, int]] | None = None,
    layer: tuple[int, int] = (1, 0),
    hierarchy: str = "folded",
    progress: Progress | None = None,
) -> Array:
    """Write maps of widths, diameters or rotations as a layout.

    ``widths`` is one map or several, all of one size, each a square array: of whole, even nanometres, zero where there is no
    pillar, edges of squares or diameters of circles by ``shape``; or, where ``shape`` is :class:`Rectangles`, of rotations
    in degrees from x towards y, NaN where there is none, which are rounded to the nearest step; or, where it is
    :class:`UprightRectangles`, of its numbers. ``lattice`` says how pillars
    stand: :func:`places` has the places of a map, and on a hexagonal lattice, of circles alone, those that are sites.
    ``centres_nm`` are the places of the maps; one map alone stands at the origin. Maps that are copies of one another, or
    symmetric, are stored once. Returns the array that was written."""
    array = Array.of_maps(
        widths, pitch_nm=pitch_nm, shape=shape, lattice=lattice, centres_nm=centres_nm, progress=progress
    )
    array.write(path, hierarchy=hierarchy, layer=layer, progress=progress)
    return array
