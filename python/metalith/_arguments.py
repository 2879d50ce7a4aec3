"""Arguments that cannot be, told before native code sees them: it would raise errors of Python's own, without their names."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from typing import Any, SupportsIndex

import numpy as np
import numpy.typing as npt

from ._native import MetalithError
from ._types import Float64, Widths

MOST_16 = 2**16 - 1
MOST_32 = 2**32 - 1
MOST_64 = 2**64 - 1

# Places in a layout file have 32 bits, one of them for the sign.
MOST_NM = 2**31 - 1


def whole(name: str, value: SupportsIndex, least: int, most: int) -> int:
    """A whole number within a range."""
    number = operator.index(value)
    if least <= number <= most:
        return number
    raise MetalithError(f"`{name}` = {number}\n  help: give a whole number from {least} to {most}")


def maybe_whole(name: str, value: SupportsIndex | None, least: int, most: int) -> int | None:
    """The same, or nothing where nothing was given."""
    return None if value is None else whole(name, value, least, most)


def element(number: SupportsIndex, count: int) -> int:
    """The number of one of so many elements."""
    k = operator.index(number)
    if 0 <= k < count:
        return k
    there = f"give one from 0 to {count - 1}" if count else "there is none"
    raise MetalithError(f"there is no element {k}\n  help: elements count from zero here: {there}")


def elements(numbers: Sequence[SupportsIndex], count: int) -> list[int]:
    """Numbers of some of so many elements."""
    chosen = [element(k, count) for k in numbers]
    if not chosen:
        raise MetalithError("`elements` names none\n  help: give at least one number, or leave it out")
    return chosen


def layer(given: tuple[int, int]) -> tuple[int, int]:
    """Layer and datatype."""
    if len(given) != 2:
        raise MetalithError(f"a layer of {len(given)} numbers\n  help: give layer and datatype, such as (1, 0)")
    return whole("layer", given[0], 0, MOST_16), whole("layer", given[1], 0, MOST_16)


def wavelengths(name: str, given: npt.ArrayLike) -> Float64:
    """Wavelengths (nm), in the shape that they were given in."""
    nm = np.asarray(given, dtype=float)
    wrong = nm[~(np.isfinite(nm) & (nm > 0))]
    if wrong.size:
        raise MetalithError(f"a wavelength of {wrong[0]:g} nm in `{name}`\n  help: give positive numbers, in nanometres")
    return nm


def fields(given: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Pairs of angles (degrees), at least one."""
    try:
        deg = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        deg = np.empty(0)
    if deg.ndim != 2 or deg.shape[1] != 2 or len(deg) == 0:
        raise MetalithError(
            "`field_deg` is no list of pairs\n"
            "  help: give the angles in the x-z and y-z plane of each field, in degrees, such as [(0, 0), (15, 0)]"
        )
    if not np.isfinite(deg).all():
        raise MetalithError("an angle in `field_deg` that is no number\n  help: give finite degrees")
    return [(float(x), float(y)) for x, y in deg]


def square(name: str, values: npt.NDArray[Any]) -> None:
    """Refuses what is no map of rows and columns; that there are as many of each is seen to by native code."""
    if values.ndim != 2:
        raise MetalithError(f"`{name}` of shape {values.shape}\n  help: give an array of shape (rows, columns)")


def widths(values: npt.NDArray[np.generic]) -> Widths:
    """Widths as uint16, if that changes none."""
    if values.dtype == np.uint16:
        return np.ascontiguousarray(values, dtype=np.uint16)
    with np.errstate(invalid="ignore"):
        numbers = values.astype(np.uint16)
    if not np.array_equal(numbers, values):
        raise MetalithError(
            "widths that are not whole nanometres from 0 to 65535\n  help: round them to even nanometres first"
        )
    return numbers


def colours(name: str, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """A picture ``[row, column, colour]``; a grey one ``[row, column]`` has its value in each colour, as in the program."""
    if values.ndim == 2:
        values = np.repeat(values[:, :, np.newaxis], 3, axis=2)
    elif values.ndim == 3 and values.shape[2] == 1:
        values = np.repeat(values, 3, axis=2)
    if values.ndim != 3 or values.shape[2] != 3:
        raise MetalithError(
            f"`{name}` of shape {values.shape}\n"
            "  help: give three colours, of shape (rows, columns, 3), or a grey picture, of shape (rows, columns)"
        )
    return np.ascontiguousarray(values)
