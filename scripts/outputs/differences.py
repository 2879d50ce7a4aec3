"""Where two recorded outputs differ."""

import array
import math
import re
from dataclasses import dataclass, field

# Figures of light may move by this much of the peak of a PSF, or of a figure where that is larger: a sum in another order moves
# them by 1e-12, a wrong factor by far more.
LIGHT = 1e-6
# A pixel of a frame or a picture is rounded: light that moves by LIGHT changes the last digit of a few.
FLIPPED_PIXELS = 1e-3
# Keys whose values tell of the program itself.
OF_THE_PROGRAM = {"metalith", "version", "semanticVersion", "command"}
# Words of values (ids, names of effects) that NEW has for those of OLD. Keys that are renamed are found by their values.
RENAMED = {
    "as_lit": "oblique",
    "gap": "defocus",
    "gap_gradient": "defocus_gradient",
    "gap_um": "defocus_um",
    "looks": "viewing_direction",
    "veil": "stray_light",
    "white": "polychromatic",
    "zero_order": "zeroth_order",
}
# Keys that NEW may have and OLD had not: what came with later abilities. Their values are compared where both have them.
ADDED = {"warnings", "mapped_cell", "fwhm_um", "focusing_efficiency"}
# Limits (by their keys) that NEW holds a chip to and OLD did not.
ADDED_LIMITS = {"mapping_phase_rms_max_rad"}
# Stands for a sentence, whose words are free, and for digests of pages that hold sentences.
PROSE = "(prose)"
HASH = re.compile(r"\[([0-9a-f]{16})\]")
SHA256 = re.compile(r"[0-9a-f]{64}")


@dataclass
class Found:
    """What a comparison of two values found."""

    # Each as the place in the value and what stands there.
    differences: list[str] = field(default_factory=list)
    # Keys that have another name.
    renamed: set[tuple[str, str]] = field(default_factory=set)
    # Largest difference of two numbers within the tolerance, in units of it.
    largest: float = 0.0


def without_prose(value):
    """A value whose sentences are replaced by the hashes of places in them."""
    if isinstance(value, dict):
        return {key: without_prose(v) for key, v in value.items() if key not in OF_THE_PROGRAM}
    if isinstance(value, list):
        return [without_prose(v) for v in value if not (isinstance(v, dict) and v.get("key") in ADDED_LIMITS)]
    if isinstance(value, str) and (SHA256.fullmatch(value) or re.search(r"\s", value)):
        return PROSE + "".join(HASH.findall(value))
    return value


def compare(old, new, tolerance: float) -> Found:
    """The differences of two values; numbers may differ by `tolerance` of the larger of them and 1."""
    found = Found()
    _values(without_prose(old), without_prose(new), tolerance, "", found)
    return found


def _values(old, new, tolerance, place, found):
    number = (int, float)
    if isinstance(old, dict) and isinstance(new, dict):
        _objects(old, new, tolerance, place, found)
    elif isinstance(old, list) and isinstance(new, list):
        if len(old) != len(new):
            found.differences.append(f"{place}: {len(old)} entries, {len(new)}")
            return
        for k, pair in enumerate(zip(old, new)):
            _values(*pair, tolerance, f"{place}[{k}]", found)
    elif isinstance(old, number) and isinstance(new, number) and not isinstance(old, bool) and not isinstance(new, bool):
        _numbers(old, new, tolerance, place, found)
    elif isinstance(old, str) and isinstance(new, str):
        if RENAMED.get(old, old) != new and old != new:
            found.differences.append(f"{place}: {old!r}, {new!r}")
    elif old != new:
        found.differences.append(f"{place}: {_short(old)}, {_short(new)}")


def _numbers(old, new, tolerance, place, found):
    if old == new or (math.isnan(old) and math.isnan(new)):
        return
    # Whole numbers count something.
    counts = isinstance(old, int) and isinstance(new, int)
    allowed = 0.0 if counts else tolerance * max(1.0, abs(old), abs(new))
    if not abs(old - new) <= allowed:
        found.differences.append(f"{place}: {old!r}, {new!r}")
    else:
        found.largest = max(found.largest, abs(old - new) / allowed * tolerance)


def _objects(old, new, tolerance, place, found):
    for key in old.keys() & new.keys():
        _values(old[key], new[key], tolerance, f"{place}.{key}", found)
    # Sentences may come and go.
    gone = [key for key in old if key not in new and old[key] != PROSE]
    came = [key for key in new if key not in old and key not in ADDED and new[key] != PROSE]
    for key in gone:
        for candidate in came:
            trial = Found()
            _values(old[key], new[candidate], tolerance, place, trial)
            if not trial.differences:
                found.renamed |= {(key, candidate)} | trial.renamed
                found.largest = max(found.largest, trial.largest)
                came.remove(candidate)
                break
        else:
            found.differences.append(f"{place}.{key}: {_short(old[key])}, nothing")
    found.differences += [f"{place}.{key}: nothing, {_short(new[key])}" for key in came]


def _short(value) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def compare_arrays(old: tuple[list[int], bytes], new: tuple[list[int], bytes]) -> Found:
    """The differences of two arrays of doubles, in units of the larger peak."""
    found = Found()
    if old[0] != new[0]:
        found.differences.append(f"shape {old[0]}, {new[0]}")
        return found
    a, b = (array.array("d", bytes_) for _, bytes_ in (old, new))
    peak = max(max(map(abs, a), default=0.0), max(map(abs, b), default=0.0)) or 1.0
    found.largest = max((abs(x - y) for x, y in zip(a, b)), default=0.0) / peak
    if not found.largest <= LIGHT:
        found.differences.append(f"{found.largest:.2e} of the peak")
    return found


def compare_pixels(old: tuple[list[int], bytes], new: tuple[list[int], bytes]) -> Found:
    """The differences of two pictures of 16 bits: few pixels, by one step."""
    found = Found()
    if old[0] != new[0]:
        found.differences.append(f"shape {old[0]}, {new[0]}")
        return found
    a, b = (array.array("H", bytes_) for _, bytes_ in (old, new))
    off = [abs(x - y) for x, y in zip(a, b) if x != y]
    # A step of the camera is several of the file.
    if len(off) > FLIPPED_PIXELS * len(a):
        found.differences.append(f"{len(off)} of {len(a)} values, by at most {max(off)} of 65535")
    return found
