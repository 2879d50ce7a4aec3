"""Arrays of every kind at every function that takes them: the answer for a plain copy in double precision, or a refusal that names
the argument, its shape, or what stands in it."""

from __future__ import annotations

import pickle
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import metalith as ml
from calls import MAP, RECTANGLES, SHAPE, UPRIGHT, Calls, told

Array = npt.NDArray[Any]

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def calls(tmp_path_factory: pytest.TempPathFactory) -> Calls:
    return Calls(tmp_path_factory.mktemp("calls"))


class Taken:
    """An argument that takes arrays: its name, a plain array for it, and the call."""

    def __init__(self, name: str, plain: Array, call: Callable[[Calls, Any], Any], nan: bool = False) -> None:
        self.name = name
        self.plain = plain
        self.call = call
        self.nan = nan
        """Whether NaN has a meaning."""


def write(calls: Calls, widths: Any, **how: Any) -> Any:
    how = {"pitch_nm": 350, **how}
    path = calls.new(".gds")
    ml.write_layout(path, [widths], **how)
    return path.read_bytes()


def square(values: list[float]) -> Array:
    """A map that no symmetry leaves as it is."""
    return np.resize(np.array(values), (6, 6)).astype(float)


# Of two widths: each is solved at each call.
WIDTHS = square([200, 180, 200, 0, 180])
TURNS = square([0, 20, 45, 90, 150])
LIGHT = np.linspace(0.1, 0.9, SHAPE[0] * SHAPE[1] * 3).reshape(*SHAPE, 3)
PICTURE = np.linspace(0.1, 0.9, 12 * 10 * 3).reshape(12, 10, 3)
NM = np.array([500.0, 530.0, 600.0])
LIT: dict[str, Any] = dict(pitch_nm=350, wavelength_nm=660, distance_um=20, samples=8)

TAKEN = {
    "psf": Taken("of", WIDTHS, lambda _, v: ml.psf(v, [660], **MAP)[0].values),
    "psf at wavelengths": Taken("wavelengths_nm", NM, lambda c, v: ml.psf(WIDTHS, v, **MAP)[0].values),
    "psf at fields": Taken(
        "field_deg", np.array([[0.0, 0.0], [3.0, 5.0]]), lambda c, v: ml.psf(WIDTHS, [660], v, **MAP)[1].values
    ),
    "write_layout": Taken("widths", WIDTHS, write),
    "write_layout of rotations": Taken("widths", TURNS, lambda c, v: write(c, v, shape=RECTANGLES), nan=True),
    "write_layout of numbers": Taken(
        "widths", square([1, 2, 16, 0, 5]), lambda c, v: write(c, v, shape=UPRIGHT, pitch_nm=360)
    ),
    "write_layout at centres": Taken(
        "centres_nm", np.array([[9000.0, 2000.0]]), lambda c, v: write(c, WIDTHS, centres_nm=v)
    ),
    "Rectangles.numbers": Taken("rotations_deg", TURNS, lambda _, v: RECTANGLES.numbers(v), nan=True),
    "Rectangles.rotations_deg": Taken("numbers", square([1, 7, 90, 0]), lambda _, v: RECTANGLES.rotations_deg(v)),
    "UprightRectangles.numbers": Taken(
        "widths_x_nm", square([90, 100, 110, 120]), lambda _, v: UPRIGHT.numbers(v, square([90]))
    ),
    "UprightRectangles.widths_nm": Taken("numbers", square([1, 7, 16, 0]), lambda _, v: UPRIGHT.widths_nm(v)[1]),
    "cell": Taken("width_nm", WIDTHS[:2, :2].copy(), lambda _, v: np.asarray(ml.cell(v, 530.0, orders=3))),
    "cell at wavelengths": Taken("wavelength_nm", NM, lambda _, v: np.asarray(ml.cell(200.0, v, orders=3))),
    "index": Taken("wavelength_nm", NM, lambda _, v: ml.index("fused_silica_malitson_1965", v)),
    "propagate": Taken("aperture", square([1, 0.5, -1, 0, 2]), lambda _, v: ml.propagate(v, **LIT)[0]),
    "widths_of": Taken("phase_rad", TURNS, lambda c, v: ml.widths_of(v, c.design), nan=True),
    "phases_of": Taken("width_nm", WIDTHS, lambda c, v: ml.phases_of(v, c.design)),
    "PsfModel": Taken("x", square([1, 7, 0.5, 0]), lambda _, v: ml.PsfModel(6, **LIT)(v), nan=True),
    "PsfModel of amplitudes": Taken(
        "amplitude", square([1, 0.5, 0]), lambda _, v: ml.PsfModel(6, amplitude=v, **LIT)(np.ones((6, 6)))
    ),
    "record": Taken("scene", LIGHT, lambda c, v: c.system.record(v).planes[0]),
    "truth": Taken("scene", LIGHT, lambda c, v: c.system.truth(v)),
    "frame": Taken("planes", np.linspace(0, 1, 1600).reshape(40, 40), lambda c, v: c.system.frame([v]).planes[0]),
    "denoise": Taken("values", PICTURE, lambda _, v: ml.denoise(v, 0.1)),
    "denoise of deviations": Taken("deviation", PICTURE, lambda _, v: ml.denoise(PICTURE, v)),
}


def strided(plain: Array) -> Array:
    """Every third value of a larger array."""
    large = np.full([3 * n for n in plain.shape], -7.0)
    view = large[tuple(slice(1, None, 3) for _ in plain.shape)]
    view[...] = plain
    return view


def backward(plain: Array) -> Array:
    """Negative strides along all axes."""
    return np.flip(np.flip(plain).copy())


def unaligned(plain: Array) -> Array:
    """Values that begin a byte off."""
    room = np.zeros(plain.nbytes + 1, dtype=np.uint8)[1:].view(np.float64).reshape(plain.shape)
    room[...] = plain
    return room


def frozen(plain: Array) -> Array:
    """No one may write to it."""
    copy = plain.copy()
    copy.flags.writeable = False
    return copy


# What an array is, with the same values.
SAME: dict[str, Callable[[Array], Any]] = {
    "strided": strided,
    "backward": backward,
    "Fortran": np.asfortranarray,
    "transposed": lambda a: np.ascontiguousarray(a.T).T,
    "unaligned": unaligned,
    "read-only": frozen,
    "big-endian": lambda a: a.astype(">f8"),
    "longdouble": lambda a: a.astype(np.longdouble),
    "list": lambda a: a.tolist(),
    "masked nowhere": lambda a: np.ma.masked_array(a, False),
}

# And with the values that the type has room for.
TYPES = ["float16", "float32", ">f4", "int16", "int64", ">i8", "uint16", ">u2", "uint64", "bool"]

# What is an answer of no use.
REFUSED: dict[str, Callable[[Array], Any]] = {
    "complex": lambda a: a + 1j,
    "object": lambda a: a.astype(object),
    "None": lambda a: np.full(a.shape, None),
    "text": lambda a: a.astype(str),
    "bytes": lambda a: a.astype("S8"),
    "durations": lambda a: a.astype("m8[s]"),
    "records": lambda a: np.zeros(a.shape, dtype=[("x", "f8")]),
    "NaN": lambda a: put(a, np.nan),
    "infinite": lambda a: put(a, np.inf),
    "minus infinite": lambda a: put(a, -np.inf),
    "huge": lambda a: put(a, 1e300),
    "minus huge": lambda a: put(a, -1e300),
    "beyond single precision": lambda a: put(a, 1e39),
    "largest integer": lambda a: np.full(a.shape, 2**64 - 1, dtype=np.uint64),
    "masked": lambda a: np.ma.masked_array(a, np.arange(a.size).reshape(a.shape) == 0),
    "five axes": lambda a: np.full((1, 1, 1, 1, 1), 1e300),
    "ragged": lambda a: [[1.0, 2.0], [3.0]],
}


def put(plain: Array, value: float) -> Array:
    """The array with one value that is another."""
    copy = plain.copy()
    copy.flat[copy.size // 2] = value
    return copy


def answer(taken: Taken, calls: Calls, given: Any) -> str:
    """The answer, or the class and the words of the refusal; nothing else may be raised, and nothing be warned of."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return told(taken.call(calls, given))
        except (ml.MetalithError, TypeError, ValueError) as error:
            words = str(error)
            assert "report this as a bug" not in words
            return f"refused: {words}"


@pytest.mark.parametrize("function", TAKEN)
def test_an_array_is_its_values(calls: Calls, function: str) -> None:
    taken = TAKEN[function]
    plain = answer(taken, calls, taken.plain.copy())
    assert not plain.startswith("refused"), plain
    for kind, make in SAME.items():
        given = make(taken.plain)
        assert answer(taken, calls, given) == plain, kind
    for kind in TYPES:
        with np.errstate(all="ignore"):
            given = taken.plain.astype(kind)
        found, of_copy = answer(taken, calls, given), answer(taken, calls, given.astype(np.float64))
        assert found == of_copy or (found.startswith("refused") and of_copy.startswith("refused")), kind


@pytest.mark.parametrize("function", TAKEN)
def test_what_is_no_array_of_numbers_is_refused_by_name(calls: Calls, function: str) -> None:
    taken = TAKEN[function]
    for kind, make in REFUSED.items():
        if (kind == "NaN" and taken.nan) or (kind == "complex" and function == "propagate"):
            continue
        found = answer(taken, calls, make(taken.plain))
        assert found.startswith("refused"), (kind, found[:200])
        assert found.startswith(f"refused: `{taken.name}`") or f"in `{taken.name}`" in found, (kind, found[:200])
        assert "\n  help: " in found, (kind, found)


@pytest.mark.parametrize("function", TAKEN)
def test_no_array_is_too_small(calls: Calls, function: str) -> None:
    """Of no values, and of no axis: empty, as numpy answers, or refused in words."""
    taken = TAKEN[function]
    small: list[Any] = [np.zeros(shape) for shape in ((0,), (0, 0), (0, 5, 3), (4, 0), ())]
    for given in [*small, 0.0, [], [[]]]:
        found = answer(taken, calls, given)
        assert not found.startswith("refused") or "\n  help: " in found, (given, found)


@pytest.mark.parametrize("least", [91, 2**16 - 1])
def test_numbers_of_rectangles_that_are_not_there_are_refused(least: int) -> None:
    with pytest.raises(ml.MetalithError, match="numbers go from 1 to 90"):
        RECTANGLES.rotations_deg([least])
    with pytest.raises(ml.MetalithError, match="numbers go from 1 to 16"):
        UPRIGHT.widths_nm([least])


@pytest.mark.parametrize("um", [np.nan, np.inf, 0.0, -1.0, 1e300])
def test_a_distance_that_is_none_is_refused(um: float, tmp_path: Path) -> None:
    with pytest.raises(ml.MetalithError, match="distance_um"):
        ml.psf(WIDTHS, [660], pitch_nm=350, distance_um=um, samples=8, pillar="sin_luke_2015")
    for name in ("incidence_deg", "at_um"):
        if not np.isfinite(um):
            with pytest.raises(ml.MetalithError, match=f"`{name}`"):
                ml.propagate(WIDTHS, **{**LIT, name: (um, 0.0)})


def test_maps_of_a_design_have_its_cell() -> None:
    design = ml.Design.read(ROOT / "designs/hexagonal_1550.toml")
    own = design.array()
    same = ml.Array.of_maps(own.widths(0), design=design)
    assert (same.pitch_nm, same.shape, same.lattice, same.pillars) == (own.pitch_nm, own.shape, own.lattice, own.pillars)
    either: list[dict[str, Any]] = [{"pitch_nm": 350, "design": design}, {}, {"shape": "circle", "design": design}]
    for both in either:
        with pytest.raises(ml.MetalithError, match="design"):
            ml.Array.of_maps(own.widths(0), **both)


def test_pillars_for_a_design_are_in_its_light(tmp_path: Path) -> None:
    design = ml.Design.read(ROOT / "designs/mini_3x3.toml")
    own = design.array()
    maps = [own.widths(k) for k in range(len(own))]
    same = ml.Array.of_maps(maps, design=design)
    asked: dict[str, Any] = {"elements": [1], "samples": 32, "fast": True, "fidelity": "published"}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        seen = [ml.psf(array, [530], **asked)[0] for array in (own, same, pickle.loads(pickle.dumps(same)))]
    for other in seen[1:]:
        assert (other.strehl, other.pixel_um) == (seen[0].strehl, seen[0].pixel_um)
        np.testing.assert_array_equal(other.values, seen[0].values)
    files = [tmp_path / name for name in ("own.gds", "same.gds")]
    own.write(files[0])
    same.write(files[1])
    assert files[0].read_bytes() == files[1].read_bytes()
    wrong = [m.copy() for m in maps]
    wrong[2][wrong[2] > 0] = 20
    for given, match in [(wrong, "20 nm wide, and the design allows 100 to 300"), (maps[:2], "2 maps"), ([m[1:, 1:] for m in maps], "sites")]:
        with pytest.raises(ml.MetalithError, match=match):
            ml.Array.of_maps(given, design=design)


@pytest.mark.parametrize("nm", [0.53, 0.0, -530.0])
def test_wavelengths_are_nanometres(nm: float) -> None:
    calls: list[Callable[[], Any]] = [
        lambda: ml.psf(WIDTHS, [nm], pitch_nm=350, distance_um=5, pillar="sin_luke_2015"),
        lambda: ml.index("sin_luke_2015", nm),
        lambda: ml.cell(200, nm),
    ]
    for call in calls:
        with pytest.raises(ml.MetalithError, match="nanometres"):
            call()


def test_what_is_no_design_is_told() -> None:
    wrong: Any = "chip.gds"
    calls: list[Callable[[], Any]] = [
        lambda: ml.verify(wrong, wrong),
        lambda: ml.check(wrong, design=wrong),
        lambda: ml.plan(wrong, wrong, wrong),
        lambda: ml.widths_of(wrong, wrong),
        lambda: ml.PsfModel.of_design(wrong),
        lambda: ml.Array.of_maps(wrong, design=wrong),
        lambda: ml.ImagingSystem(wrong, wrong, wrong, shape=(8, 8)),
    ]
    for call in calls:
        with pytest.raises(TypeError, match="`design` is a str"):
            call()
    with pytest.raises(TypeError, match="design.array"):
        ml.psf(ml.Design.read(ROOT / "designs/mini_3x3.toml"), [530])  # type: ignore[arg-type]


def test_limits_of_widths_are_told_before_cells_are_solved() -> None:
    for limits, match in [((300, 100), "narrowest pillar of 300 nm"), ((5, 300), "10 nm or more"), ((100, 900), "900 nm are asked for")]:
        with pytest.raises(ml.MetalithError, match=match):
            ml.Design.lens(wavelength_nm=850, focal_length_um=75, diameter_um=50, width_nm=limits)


def test_a_guessed_cell_is_said() -> None:
    widths = np.full((8, 8), 200)
    asked: dict[str, Any] = {"pitch_nm": 350, "distance_um": 5.0, "samples": 16, "fast": True}
    with pytest.warns(UserWarning, match="pillar"):
        ml.psf(widths, [530], **asked)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ml.psf(widths, [530], pillar="sin_luke_2015", **asked)
    with pytest.raises(ml.MetalithError, match="multiple of 0.05 nm, such as 430.05"):
        ml.Design.lens(wavelength_nm=780, focal_length_um=50, diameter_um=20, pitch_nm=430.04)
