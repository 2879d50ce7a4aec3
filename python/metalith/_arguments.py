"""Arguments that cannot be, told before native code sees them: it would raise errors of Python's own, without their names."""

from __future__ import annotations

import numbers as numbers_
import operator
from collections.abc import Iterable, Sequence
from typing import Any, SupportsIndex

import numpy as np
import numpy.typing as npt

from ._native import MetalithError
from ._types import Float64, Widths

MOST_16 = 2**16 - 1
MOST_32 = 2**32 - 1
MOST_64 = 2**64 - 1

# Shorter wavelengths are micrometres (nm), as for the program.
LEAST_NM = 10.0

# Places in a layout file have 32 bits, one of them for the sign.
MOST_NM = 2**31 - 1


# Largest moduli of transmissions: the square of a sum of them over 10^12 sites is a number in single precision.
MOST_MODULUS = 1e12

# Largest values of pictures that are denoised, white being 1: single precision resolves a thousandth of white there.
MOST_PICTURE = 1e4


# Most light of a scene, white being 1: a million of it saturates every camera, and its squares are numbers in single precision.
MOST_LIGHT = 1e6

# Largest rotation (degrees): a double resolves a millionth of a degree there.
MOST_DEG = 1e9

# Largest phase (rad): a double resolves a millionth of a radian there.
MOST_RAD = 1e9

# Most of a frame, full scale being 1: what is larger are counts.
MOST_SIGNAL = 10.0


def numbers(
    name: str, given: npt.ArrayLike, dtype: type[np.generic], *, nan: bool = False, remedy: str = "give finite numbers"
) -> npt.NDArray[Any]:
    """The one way of arrays to native code: what was given as values of ``dtype`` in the machine's byte order, contiguous and
    aligned. Whatever would change a value is refused, as is what is not finite, unless NaN has a meaning (``nan``)."""
    parts = given if isinstance(given, (list, tuple)) else [given]
    if any(np.ma.is_masked(part) for part in parts):
        raise MetalithError(f"`{name}` has values that are masked\n  help: say what stands there, by `.filled(...)`")
    try:
        found = np.asarray(given)
    except ValueError:
        raise MetalithError(f"`{name}` has rows of several lengths\n  help: give as many values in each") from None
    wanted = np.dtype(dtype)
    if found.dtype.kind not in ("biufc" if wanted.kind == "c" else "biuf"):
        real = "" if wanted.kind == "c" else "real "
        raise TypeError(
            f"`{name}` of shape {found.shape} has values of type {found.dtype}\n"
            f"  help: give {real}numbers, such as by `.astype(float)`"
        )
    if found.dtype == wanted and wanted.kind in "iu":
        return np.require(found, wanted, ["C", "A"])
    with np.errstate(invalid="ignore", over="ignore"):
        values = np.require(found, wanted, ["C", "A"])
    wrong = values != found if wanted.kind in "iu" else ~np.isfinite(values)
    refuse(name, found, wrong & ~np.isnan(found) if nan else wrong, remedy)
    return values


def refuse(name: str, values: npt.NDArray[Any], wrong: npt.NDArray[np.bool_], remedy: str) -> None:
    """Refuses the first of the values that are wrong."""
    if wrong.any():
        at = tuple(int(k) for k in np.argwhere(wrong)[0])
        raise MetalithError(f"`{name}` of shape {values.shape}: {values[at]} at {at}\n  help: {remedy}")


def real(name: str, value: object) -> float:
    """A positive finite number."""
    number = float(value) if isinstance(value, numbers_.Real) and not isinstance(value, bool) else 0.0
    if not 0 < number < float("inf"):
        raise MetalithError(f"`{name}` = {value!r}\n  help: give a positive number")
    return number


def maybe_real(name: str, value: object) -> float | None:
    """A positive finite number, or none."""
    return None if value is None else real(name, value)


def pair(name: str, given: npt.ArrayLike) -> tuple[float, float]:
    """Two finite numbers."""
    values = numbers(name, given, np.float64)
    if values.shape != (2,):
        raise MetalithError(f"`{name}` of shape {values.shape}\n  help: give two numbers, along x and along y")
    return float(values[0]), float(values[1])


def whole(name: str, value: SupportsIndex, least: int, most: int) -> int:
    """A whole number within a range."""
    try:
        number = operator.index(value)
    except TypeError:
        raise TypeError(f"`{name}` = {value!r}\n  help: give a whole number from {least} to {most}") from None
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
    if not isinstance(given, Sequence) or len(given) != 2:
        raise MetalithError(f"`layer` = {given!r}\n  help: give layer and datatype, such as (1, 0)")
    return whole("layer", given[0], 0, MOST_16), whole("layer", given[1], 0, MOST_16)


def wavelengths(name: str, given: npt.ArrayLike) -> Float64:
    """Wavelengths (nm), in the shape that they were given in."""
    nm: Float64 = numbers(name, given, np.float64, nan=True, remedy="give positive numbers, in nanometres")
    refuse(name, nm, nm > MOST_32, f"give at most {MOST_32}, in nanometres")
    wrong = nm[~(nm >= LEAST_NM)]
    if wrong.size:
        meant = f"nanometres are meant: {1e3 * wrong[0]:g}?" if wrong[0] > 0 else "give positive numbers, in nanometres"
        raise MetalithError(f"a wavelength of {wrong[0]:g} nm in `{name}`\n  help: {meant}")
    return nm


def fields(given: npt.ArrayLike) -> list[tuple[float, float]]:
    """Pairs of angles (degrees), at least one."""
    deg = numbers("field_deg", given, np.float64, remedy="give finite degrees")
    if deg.ndim != 2 or deg.shape[1] != 2 or len(deg) == 0:
        raise MetalithError(
            f"`field_deg` of shape {deg.shape} is no list of pairs\n"
            "  help: give the angles in the x-z and y-z plane of each field, in degrees, such as [(0, 0), (15, 0)]"
        )
    refuse("field_deg", deg, abs(deg) > 360, "give angles of less than 90 degrees")
    return [(float(x), float(y)) for x, y in deg]


def centres(given: npt.ArrayLike) -> list[tuple[int, int]]:
    """Places of maps (nm)."""
    nm = numbers("centres_nm", given, np.int64, remedy="give whole nanometres")
    if nm.ndim != 2 or nm.shape[1] != 2:
        raise MetalithError(f"`centres_nm` of shape {nm.shape}\n  help: give x and y of each map, such as [(0, 0)]")
    refuse("centres_nm", nm, (nm > MOST_NM) | (nm < -MOST_NM), f"give whole nanometres from {-MOST_NM} to {MOST_NM}")
    return [(int(x), int(y)) for x, y in nm]


def square(name: str, values: npt.NDArray[Any]) -> None:
    """Refuses what is no map of rows and columns; that there are as many of each is seen to by native code."""
    if values.ndim != 2 or values.size == 0:
        raise MetalithError(f"`{name}` of shape {values.shape}\n  help: give an array of shape (rows, columns)")


def several(name: str, given: Iterable[npt.ArrayLike]) -> list[npt.ArrayLike]:
    """Arrays that were given one by one; one of less than three axes is one alone."""
    if isinstance(given, np.ndarray) and given.ndim < 3:
        return [given]
    try:
        return list(given)
    except TypeError:
        raise TypeError(f"`{name}` is a {type(given).__name__}\n  help: give a list of arrays") from None


def phases(name: str, given: npt.ArrayLike) -> Float64:
    """Phases (rad), NaN where there is no pillar."""
    rad: Float64 = numbers(name, given, np.float64, nan=True, remedy="give finite phases, or NaN where there is no pillar")
    refuse(name, rad, abs(rad) > MOST_RAD, f"give phases up to {MOST_RAD:g}, in radians")
    return rad


def widths(name: str, given: npt.ArrayLike) -> Widths:
    """Widths as uint16, if that changes none."""
    return numbers(name, given, np.uint16, remedy="give whole nanometres from 0 to 65535: round them to even ones first")


def pillars(name: str, given: npt.ArrayLike) -> Widths:
    """Numbers of rectangles as uint16, if that changes none; that there is one of each is seen to by native code."""
    return numbers(name, given, np.uint16, remedy="give the numbers of rectangles, zero where there is none")


def colours(name: str, values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """A picture ``[row, column, colour]``; a grey one ``[row, column]`` has its value in each colour, as in the program."""
    shape = values.shape
    if values.ndim == 2:
        values = np.repeat(values[:, :, np.newaxis], 3, axis=2)
    elif values.ndim == 3 and values.shape[2] == 1:
        values = np.repeat(values, 3, axis=2)
    if values.ndim != 3 or values.shape[2] != 3 or values.size == 0:
        raise MetalithError(
            f"`{name}` of shape {shape}\n"
            "  help: give three colours, of shape (rows, columns, 3), or a grey picture, of shape (rows, columns)"
        )
    return np.ascontiguousarray(values)
