"""Pillars: their shapes, their lattices, and their places in a map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias, Union

import numpy as np
import numpy.typing as npt

from . import _arguments, _native
from ._types import Bools, Float64, Int64, Widths

ROTATIONS = "give degrees, NaN where there is no pillar"


@dataclass(frozen=True)
class Rectangles:
    """Rectangular pillars of one size, which differ by their rotation."""

    width_nm: int
    """The shorter edge (nm), even, along the direction of the rotation."""
    length_nm: int
    """The longer edge (nm), even, across it."""
    steps: int = 180
    """Rotations in half a turn, which leaves a rectangle as it is."""

    def numbers(self, rotations_deg: npt.ArrayLike) -> Widths:
        """The numbers that stand in maps for rotations (degrees, from x towards y), each for the nearest step: 1 to
        ``steps``, zero where a rotation is NaN."""
        return self._numbers("rotations_deg", rotations_deg)

    def _numbers(self, name: str, rotations_deg: npt.ArrayLike) -> Widths:
        values = _arguments.numbers(name, rotations_deg, np.float64, nan=True, remedy=ROTATIONS)
        _arguments.refuse(name, values, abs(values) > _arguments.MOST_DEG, ROTATIONS)
        numbers = _native.rotation_numbers(values.ravel(), *told_of(self)[1:])
        return numbers.reshape(values.shape)

    def rotations_deg(self, numbers: npt.ArrayLike) -> Float64:
        """Rotations (degrees) from 0 up to 180; NaN where there is no pillar."""
        values = _arguments.pillars("numbers", numbers)
        rotations = _native.rotations_deg(values.ravel(), *told_of(self)[1:])
        return rotations.reshape(values.shape)


@dataclass(frozen=True)
class UprightRectangles:
    """Rectangular pillars with edges along x and y, which differ by both widths: light polarised along each axis has a phase
    of its own."""

    shortest_nm: int
    """The shortest width (nm), even."""
    step_nm: int
    """From one width to the next (nm), even."""
    lengths: int
    """How many widths there are, at most 64."""

    def numbers(self, widths_x_nm: npt.ArrayLike, widths_y_nm: npt.ArrayLike) -> Widths:
        """The numbers that stand in maps for widths along x and y (nm): 1 to ``lengths`` squared, first along x; zero where
        both widths are."""
        x, y = _arguments.widths("widths_x_nm", widths_x_nm), _arguments.widths("widths_y_nm", widths_y_nm)
        if x.shape != y.shape:
            raise _native.MetalithError(
                f"`widths_x_nm` of shape {x.shape}, `widths_y_nm` of {y.shape}\n  help: give both for each pillar"
            )
        return _native.upright_numbers(x.ravel(), y.ravel(), *told_of(self)[1:]).reshape(x.shape)

    def widths_nm(self, numbers: npt.ArrayLike) -> tuple[Widths, Widths]:
        """Widths along x and along y (nm); zero where there is no pillar."""
        values = _arguments.pillars("numbers", numbers)
        x, y = _native.upright_widths(values.ravel(), *told_of(self)[1:])
        return x.reshape(values.shape), y.reshape(values.shape)


Shape: TypeAlias = Union[Literal["square", "circle", "mixed"], Rectangles, UprightRectangles]
"""What pillars are."""


Lattice: TypeAlias = Literal["square", "hexagonal"]
"""How pillars stand: on a hexagonal lattice in rows along x, each shifted by half a pitch against the next."""


@dataclass(frozen=True, eq=False)
class Places:
    """Where the columns and rows of a map are, from the middle of its element."""

    x_nm: Int64
    """Of each column (nm), rising: a pitch apart on a square lattice, half a pitch on a hexagonal one."""
    y_nm: Int64
    """Of each row (nm), rising: a pitch apart on a square lattice, on a hexagonal one half the root of three of it, rounded to
    whole nanometres."""
    is_site: Bools
    """Whether a pillar can stand there, shape ``[rows, columns]``: everywhere on a square lattice. On a hexagonal one where
    the sum of row and column is even, in the rows that reach no farther than the columns; elsewhere maps are zero."""


def places(sites: int, *, pitch_nm: int, lattice: Lattice = "square") -> Places:
    """Where the columns and rows of a map of ``sites`` x ``sites`` are. A hexagonal lattice has an odd number of them, one
    in the middle; ``2 * ceil(diameter / pitch) + 1`` hold a round lens."""
    most = _arguments.MOST_32
    numbers = (_arguments.whole("sites", sites, 1, most), _arguments.whole("pitch_nm", pitch_nm, 1, most))
    return Places(*_native.places(*numbers, lattice))


def lattice_of(told: str) -> Lattice:
    return "hexagonal" if told == "hexagonal" else "square"


def told_of(shape: Shape) -> tuple[str, int, int, int]:
    """A shape as the native module has it: a word and three numbers."""
    if isinstance(shape, Rectangles):
        return ("rectangle", *_numbers(width_nm=shape.width_nm, length_nm=shape.length_nm, steps=shape.steps))
    if isinstance(shape, UprightRectangles):
        return (
            "upright_rectangle",
            *_numbers(shortest_nm=shape.shortest_nm, step_nm=shape.step_nm, lengths=shape.lengths),
        )
    return (shape, 0, 0, 0)


def _numbers(**named: int) -> tuple[int, int, int]:
    """Three numbers of rectangles, by their names."""
    first, second, third = (_arguments.whole(name, value, 1, _arguments.MOST_16) for name, value in named.items())
    return first, second, third


def shape_of(told: tuple[str, int, int, int]) -> Shape:
    word, width, length, steps = told
    if word == "rectangle":
        return Rectangles(width, length, steps)
    if word == "upright_rectangle":
        return UprightRectangles(width, length, steps)
    if word == "mixed":
        return "mixed"
    return "circle" if word == "circle" else "square"


def rectangles_of(shape: Shape) -> Rectangles:
    if isinstance(shape, Rectangles):
        return shape
    what = "upright rectangles" if isinstance(shape, UprightRectangles) else f"{shape}s"
    raise _native.MetalithError(f"{what} have no rotation\n  help: ask for their widths")
