"""Hexagonal lattices: where their pillars are, in arrays, files and light."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import metalith as ml

ROOT = Path(__file__).resolve().parents[2]
SHIPPED = ROOT / "designs/hexagonal_1550.toml"
SILICON = "a_si_pierce_1972"
PITCH_NM, ROW_NM = 700, 606
DIAMETER_UM, FOCAL_UM = 30.0, 45.0
CELL: dict[str, Any] = dict(pillar=SILICON, pillar_height_nm=900.0)
HEXAGONAL: dict[str, Any] = dict(pitch_nm=PITCH_NM, shape="circle", lattice="hexagonal")


def small(**changes: str) -> ml.Design:
    """The shipped design with a lens of 30 um, and lines that begin with a key changed."""
    changes = {"diameter_um": f"{DIAMETER_UM}", "focal_length_um": f"{FOCAL_UM}", **changes}
    lines = []
    for line in SHIPPED.read_text().splitlines():
        key = line.split("=")[0].strip()
        lines.append(f"{key} = {changes[key]}" if key in changes else line)
    return ml.Design.parse("\n".join(lines), SHIPPED)


@pytest.fixture(scope="module")
def array() -> ml.Array:
    return small().array()


def pillars(
    widths: npt.NDArray[Any], places: ml.Places, centre: tuple[int, int] = (0, 0)
) -> dict[tuple[int, int], int]:
    """Width of each pillar by its place (nm)."""
    return {
        (int(places.x_nm[ix]) + centre[0], int(places.y_nm[iy]) + centre[1]): int(widths[iy, ix])
        for iy, ix in np.argwhere(widths > 0)
    }


def circles_of(file: Path) -> dict[tuple[int, int], int]:
    """Middle and diameter of each boundary of a flat GDSII file on layer 1 (nm), by the bytes of its records alone."""
    data, at, layer, found = file.read_bytes(), 0, 0, {}
    while at < len(data):
        length, kind = struct.unpack(">HH", data[at : at + 4])
        body = data[at + 4 : at + length]
        if kind == 0x0D02:
            (layer,) = struct.unpack(">h", body)
        if kind == 0x1003 and layer == 1:
            corners = np.frombuffer(body, ">i4").reshape(-1, 2)
            low, high = corners.min(axis=0), corners.max(axis=0)
            found[(int(low[0] + high[0]) // 2, int(low[1] + high[1]) // 2)] = int(high[0] - low[0])
        at += length
    return found


def test_places_are_rows_each_shifted_by_half_a_pitch() -> None:
    places = ml.places(5, pitch_nm=PITCH_NM, lattice="hexagonal")
    assert places.x_nm.tolist() == [-700, -350, 0, 350, 700]
    assert places.y_nm.tolist() == [-1212, -606, 0, 606, 1212]
    # The outermost rows reach farther than the columns.
    assert places.is_site.astype(int).tolist() == [
        [0, 0, 0, 0, 0],
        [0, 1, 0, 1, 0],
        [1, 0, 1, 0, 1],
        [0, 1, 0, 1, 0],
        [0, 0, 0, 0, 0],
    ]
    square = ml.places(4, pitch_nm=PITCH_NM)
    assert square.x_nm.tolist() == square.y_nm.tolist() == [-1050, -350, 350, 1050]
    assert square.is_site.all()
    for lattice, words in [("hexagonal", "use an odd number"), ("rhombic", "square or hexagonal")]:
        with pytest.raises(ml.MetalithError, match=words):
            ml.places(4, pitch_nm=PITCH_NM, lattice=lattice)  # type: ignore[arg-type]


def test_the_pillars_of_a_design_are_where_its_file_has_them(tmp_path: Path) -> None:
    design = small(elements="[2, 1]", spacing_um="40")
    array = design.array()
    assert (design.lattice, array.lattice, array.shape) == ("hexagonal", "hexagonal", "circle")
    assert "hexagonal lattice" in design._repr_html_()
    array.write(tmp_path / "flat.gds", hierarchy="flat")
    places = array.places()
    expected: dict[tuple[int, int], int] = {}
    for k, centre in enumerate(array.centres_nm):
        widths = array.widths(k)
        assert widths.shape == places.is_site.shape and not widths[~places.is_site].any()
        expected.update(pillars(widths, places, centre))
        # One in the middle, and a pillar at each site of the lens.
        assert widths[len(widths) // 2, len(widths) // 2] > 0
        x, y = np.meshgrid(places.x_nm, places.y_nm)
        inside = places.is_site & (x**2 + y**2 <= (500 * DIAMETER_UM) ** 2)
        assert np.array_equal(widths > 0, inside)
    assert len(array) == 2 and len(expected) == array.pillars
    assert circles_of(tmp_path / "flat.gds") == expected


@pytest.mark.parametrize("name", ["chip.gds", "chip.oas"])
def test_what_is_written_is_read_with_and_without_a_design(array: ml.Array, tmp_path: Path, name: str) -> None:
    array.write(tmp_path / name)
    expected = pillars(array.widths(0), array.places())
    file = tmp_path / name
    for layout in (ml.read_layout(file, design=array.design), ml.read_layout(file, array=array), ml.read_layout(file)):
        assert (layout.lattice, layout.pitch_nm, layout.shape) == ("hexagonal", PITCH_NM, "circle")
        assert (layout.pillars, layout.other_shapes) == (array.pillars, 0)
        assert pillars(layout.widths[0], layout.places(0), layout.centres_nm[0]) == expected


def test_any_map_of_diameters_becomes_a_layout(tmp_path: Path) -> None:
    places = ml.places(41, pitch_nm=PITCH_NM, lattice="hexagonal")
    diameters = np.where(places.is_site, 2 * np.random.default_rng(1).integers(75, 250, places.is_site.shape), 0)
    centres = [(0, 0), (40_000, -3_000)]
    # A mirror of a rectangle makes one of the other.
    maps = [diameters, diameters[:, ::-1]]
    for name in ("a.gds", "a.oas"):
        array = ml.write_layout(tmp_path / name, maps, centres_nm=centres, **HEXAGONAL)
        for given in ({"array": array}, {}):
            layout = ml.read_layout(tmp_path / name, **given)  # type: ignore[arg-type]
            found: dict[tuple[int, int], int] = {}
            for k, widths in enumerate(layout.widths):
                found.update(pillars(widths, layout.places(k), layout.centres_nm[k]))
            expected = {**pillars(maps[0], places, centres[0]), **pillars(maps[1], places, centres[1])}
            assert found == expected


def test_what_cannot_stand_on_it_is_refused(tmp_path: Path) -> None:
    places = ml.places(9, pitch_nm=PITCH_NM, lattice="hexagonal")
    file = tmp_path / "a.gds"
    good = np.where(places.is_site, 300, 0)
    beside, beyond = good.copy(), good.copy()
    beside[4, 3] = 300
    # An even sum of row and column, in a row that reaches farther than the columns.
    beyond[0, 0] = 300
    for widths, words in [(beside, "row 4, column 3"), (beyond, "row 0, column 0"), (good[:8, :8], "an odd number")]:
        with pytest.raises(ml.MetalithError, match=words):
            ml.write_layout(file, widths, **HEXAGONAL)
    # Rows are rounded: the nearest pillars are 699.8 nm apart.
    with pytest.raises(ml.MetalithError, match="at most the distance of neighbours, 698 nm"):
        ml.write_layout(file, np.where(places.is_site, 700, 0), **HEXAGONAL)
    with pytest.raises(ml.MetalithError, match="no circles"):
        ml.write_layout(file, good, pitch_nm=PITCH_NM, lattice="hexagonal")
    light: dict[str, Any] = dict(wavelength_nm=1550.0, distance_um=45.0, pitch_nm=PITCH_NM, lattice="hexagonal")
    with pytest.raises(ml.MetalithError, match="row 4, column 3"):
        ml.propagate(beside.astype(complex), **light)
    assert not file.exists()


def test_elements_on_unlike_lattices_are_not_taken_for_one(tmp_path: Path) -> None:
    """The pitch of a layout is that of all its elements."""

    def records(name: str, pitch_nm: int) -> list[tuple[int, bytes]]:
        wide = np.full((40, 40), 200, dtype=np.uint16)
        ml.write_layout(tmp_path / name, wide, pitch_nm=pitch_nm, hierarchy="flat")
        data, at, found = (tmp_path / name).read_bytes(), 0, []
        while at < len(data):
            length, kind = struct.unpack(">HH", data[at : at + 4])
            found.append((kind, data[at + 4 : at + length]))
            at += length
        return found

    boundary, end_of_element, corners, end_of_structure = 0x0800, 0x1100, 0x1003, 0x0700
    own, other = records("a.gds", 400), records("b.gds", 500)
    kinds = [kind for kind, _ in other]
    first, last = kinds.index(boundary), len(kinds) - kinds[::-1].index(end_of_element)
    # Far enough away to be an element of its own.
    away = [(k, (np.frombuffer(b, ">i4") + 100_000).astype(">i4").tobytes() if k == corners else b) for k, b in other]
    at = [kind for kind, _ in own].index(end_of_structure)
    both = own[:at] + away[first:last] + own[at:]
    file = tmp_path / "both.gds"
    file.write_bytes(b"".join(struct.pack(">HH", len(body) + 4, kind) + body for kind, body in both))
    with pytest.raises(ml.MetalithError, match="stands on another lattice"):
        ml.read_layout(file)
    ml.write_layout(file, [np.full((40, 40), 200)] * 2, pitch_nm=400, centres_nm=[(0, 0), (100_000, 0)])
    assert len(ml.read_layout(file).widths) == 2


def test_psfs_are_those_of_the_program(array: ml.Array, tmp_path: Path) -> None:
    """The same pillars, cells and propagators of the same file: to the last bit."""
    array.write(tmp_path / "chip.oas")
    layout = ml.read_layout(tmp_path / "chip.oas")
    cell = tmp_path / "cell.toml"
    pillars = f'lattice = "hexagonal"\nshape = "circle"\npillar_height_nm = 900\npillar_material = "{SILICON}"\n'
    cell.write_text(f"[cell]\npitch_nm = {PITCH_NM}\nwidth_min_nm = 150\nwidth_max_nm = 516\n{pillars}")
    samples = 64
    for fidelity in ("rigorous", "fitted"):
        out = tmp_path / fidelity
        flags = ["--distance-um", str(FOCAL_UM), "--wavelength-nm", "1550", "--cell", str(cell)]
        flags += ["--samples", str(samples)]
        flags += ["--fidelity", fidelity, "--out", str(out), "--quiet"]
        program = Path(sys.executable).with_name("metalith")
        run = subprocess.run([program, "psf", tmp_path / "chip.oas", *flags], capture_output=True, text=True)
        assert run.returncode == 0, run.stderr
        (file,) = out.glob("psf_*.npy")
        light: dict[str, Any] = dict(fidelity=fidelity, samples=samples)
        (of_file,) = ml.psf(layout, [1550], distance_um=FOCAL_UM, **light, **CELL)
        assert np.array_equal(of_file.values, np.load(file))
        if fidelity == "fitted":
            # The design fits all widths that it may write, a layout those that are drawn.
            continue
        (of_design,) = ml.psf(array, [1550], **light)
        (of_map,) = ml.psf(array.widths(0), [1550], distance_um=FOCAL_UM, **light, **CELL, **HEXAGONAL)
        assert np.array_equal(of_map.values, of_design.values)
        # The grid that is found in a file ends with its pillars: sums in single precision, in another order.
        assert np.allclose(of_map.values, of_file.values, rtol=0, atol=1e-6 * of_file.values.max())
    for wanted in ("published", "neighbours"):
        with pytest.raises(ml.MetalithError, match=f"by the `{wanted}` cell"):
            ml.psf(layout, [1550], distance_um=FOCAL_UM, fidelity=wanted, **CELL)
        if wanted == "neighbours":
            with pytest.raises(ml.MetalithError, match="a hexagonal lattice by the `neighbours` cell"):
                ml.psf(array, [1550], fidelity=wanted)


def rayleigh_sommerfeld(
    aperture: npt.NDArray[np.complex128], places: ml.Places, x_um: float, y_um: float, z_um: float, sine: float
) -> complex:
    """The sum over all sites, each with the area of its cell, written out."""
    wavelength_um = 1.55
    k = 2 * np.pi / wavelength_um
    x, y = np.meshgrid(places.x_nm * 1e-3, places.y_nm * 1e-3)
    r = np.sqrt((x_um - x) ** 2 + (y_um - y) ** 2 + z_um**2)
    kernel = z_um / (2 * np.pi * r**2) * (1 / r - 1j * k) * np.exp(1j * k * (r + x * sine))
    return complex((aperture * kernel).sum() * PITCH_NM * ROW_NM * 1e-6)


def test_an_aperture_is_propagated_as_by_the_sum() -> None:
    # Single precision of the fields, and what the accurate fold promises, of the field's largest value.
    single, promised = 1e-5, 1e-4
    places = ml.places(41, pitch_nm=PITCH_NM, lattice="hexagonal")
    x, y = np.meshgrid(places.x_nm * 1e-3, places.y_nm * 1e-3)
    # A lens that passes less towards +x: nothing of it is symmetric but its phase.
    path_um = np.sqrt(x**2 + y**2 + 60.0**2) - 60.0
    aperture = np.where(places.is_site, (1 - 0.03 * x) * np.exp(-2j * np.pi / 1.55 * path_um), 0)
    light: dict[str, Any] = dict(pitch_nm=PITCH_NM, lattice="hexagonal", wavelength_nm=1550.0, distance_um=60.0)
    light.update(samples=12, incidence_deg=(5.0, 0.0), at_um=(4.0, -2.0))
    direct, x_um, y_um = ml.propagate(aperture, **light, direct=True)
    folded, _, _ = ml.propagate(aperture, **light)
    assert np.isclose(np.diff(x_um), 0.7).all()
    sine = float(np.sin(np.radians(5.0)))
    most = np.abs(direct).max()
    for iy, ix in [(0, 0), (3, 8), (11, 5)]:
        expected = rayleigh_sommerfeld(aperture, places, float(x_um[ix]), float(y_um[iy]), 60.0, sine)
        assert abs(direct[iy, ix] - expected) < single * most
    assert np.abs(folded - direct).max() < promised * most


def test_cells_are_those_that_psfs_take() -> None:
    """Behind equal pillars is what an aperture of the transmission of their cell gives."""
    t = ml.cell([300.0], 1550.0, pitch_nm=PITCH_NM, lattice="hexagonal", shape="circle", orders=17, **CELL)
    places = ml.places(41, pitch_nm=PITCH_NM, lattice="hexagonal")
    widths = np.where(places.is_site, 300, 0).astype(np.uint16)
    (psf,) = ml.psf(widths, [1550], distance_um=60.0, samples=8, **CELL, **HEXAGONAL)
    field, x_um, _ = ml.propagate(
        places.is_site * t[0], pitch_nm=PITCH_NM, lattice="hexagonal", wavelength_nm=1550.0, distance_um=60.0, samples=8
    )
    assert np.allclose(x_um, psf.x_um)
    # Single precision of the fields.
    assert np.allclose(np.abs(field) ** 2, psf.values, rtol=1e-4)
    # On a square lattice it is another cell.
    square = ml.cell([300.0], 1550.0, pitch_nm=PITCH_NM, shape="circle", **CELL)
    assert abs(square[0] - t[0]) > 0.01
    with pytest.raises(ml.MetalithError, match="no circles"):
        ml.cell(300.0, 1550.0, pitch_nm=PITCH_NM, lattice="hexagonal", **CELL)
    with pytest.raises(ml.MetalithError, match="whole number"):
        ml.cell(300.0, 1550.0, pitch_nm=700.5, lattice="hexagonal", shape="circle", **CELL)


def test_rules_and_verdicts_are_those_of_the_program(array: ml.Array, tmp_path: Path) -> None:
    file, design = tmp_path / "chip.gds", tmp_path / "design.toml"
    array.write(file)
    lines = SHIPPED.read_text().replace("diameter_um = 160", "diameter_um = 30")
    design.write_text(lines.replace("focal_length_um = 240", "focal_length_um = 45"))
    read = ml.Design.read(design)
    assert ml.check(file, design=read).clean
    found = ml.verify(read, file, fast=True)
    assert found.passed
    program = Path(sys.executable).with_name("metalith")
    out = tmp_path / "out"
    run = subprocess.run(
        [program, "verify", design, file, "--fast", "--out", out, "--quiet"], capture_output=True, text=True
    )
    assert run.returncode == 0, run.stderr
    told = json.loads((out / "report.json").read_text())
    theirs = told.get("verification", told)["distinct"]
    assert found.numbers["distinct"] == theirs


def test_a_picture_is_of_its_scene(array: ml.Array, tmp_path: Path) -> None:
    """Kernels are tested against direct sums in the library; here, that the picture is where the scene is."""
    array.write(tmp_path / "chip.oas")
    shape = (32, 32)
    # A small lens has a small picture: finer pixels, and fewer.
    text = (ROOT / "cameras/swir.toml").read_text()
    smaller = [("pixel_um = 5 ", "pixel_um = 1 "), ("columns = 640", "columns = 64"), ("rows = 512", "rows = 64")]
    for own, other in smaller:
        assert own in text
        text = text.replace(own, other)
    camera = tmp_path / "camera.toml"
    camera.write_text(text)
    design = array.design or pytest.fail()
    system = ml.ImagingSystem(design, tmp_path / "chip.oas", camera, shape=shape, field_deg=30.0)
    scene = np.full((*shape, 3), 0.02)
    scene[4:12, 18:28] = 0.9
    restored, truth = system.restore(system.record(scene)), system.truth(scene)
    assert restored.shape == truth.shape
    # A mirrored, shifted or blurred picture is less like the scene than this.
    assert np.corrcoef(restored.ravel(), truth.ravel())[0, 1] > 0.8
    assert np.corrcoef(restored[::-1].ravel(), truth.ravel())[0, 1] < 0.5
