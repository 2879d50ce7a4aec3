"""Arrays in KLayout and gdsfactory, and back from the files that these write."""

from __future__ import annotations

import subprocess
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import metalith as ml
import metalith.gdsfactory
import metalith.klayout
from calls import small_design

kdb = pytest.importorskip("klayout.db")

PITCH_NM = 350
# Random widths: a map that no symmetry leaves as it is.
MAP = 2 * np.random.default_rng(60).integers(50, 150, (24, 24)).astype(np.uint16)


@pytest.fixture(scope="module")
def design(tmp_path_factory: pytest.TempPathFactory) -> ml.Design:
    return ml.Design.read(small_design(tmp_path_factory.mktemp("design")))


def texts(path: Path) -> list[str]:
    """Texts of the top cell of a file."""
    layout = kdb.Layout()
    layout.read(str(path))
    top = layout.top_cell()
    return [s.text_string for k in layout.layer_indexes() for s in top.shapes(k).each() if s.is_text()]


def test_arrays_are_inserted_into_a_layout(design: ml.Design, tmp_path: Path) -> None:
    layout = kdb.Layout()
    of_design = metalith.klayout.insert(layout, design)
    of_maps = metalith.klayout.insert(layout, ml.Array.of_maps(MAP, pitch_nm=PITCH_NM), layer=(7, 1))
    assert metalith.klayout.insert(layout, design).name == of_design.name + "$1"
    top = layout.create_cell("CHIP")
    top.insert(kdb.DCellInstArray(of_design, kdb.DTrans(0, False, 100, 50)))
    top.insert(kdb.DCellInstArray(of_maps, kdb.DTrans(1, True, -100, 50)))
    path = tmp_path / "chip.oas"
    layout.write(str(path))
    lens = ml.read_layout(path, top="CHIP")
    assert (lens.centres_nm, lens.other_shapes) == ([(100_000, 50_000)], 0)
    assert np.array_equal(lens.widths[0], design.array().widths(0))
    mirrored = ml.read_layout(path, top="CHIP", layer=(7, 1))
    # Mirrored at the x axis, then turned by a quarter: x and y change places.
    assert np.array_equal(mirrored.widths[0], MAP.T)


def test_a_database_unit_that_would_move_pillars_is_refused(design: ml.Design) -> None:
    fine, coarse = kdb.Layout(), kdb.Layout()
    fine.dbu, coarse.dbu = 0.0005, 0.002
    found = metalith.klayout.insert(fine, design)
    assert found.dbbox() == metalith.klayout.insert(kdb.Layout(), design, name="OTHER").dbbox()
    with pytest.raises(ml.MetalithError, match="multiples of 1 nm.* 2 nm"):
        metalith.klayout.insert(coarse, design)
    assert coarse.cells() == 0
    with pytest.raises(TypeError, match="ndarray\n  help: .*of_maps"):
        metalith.klayout.insert(coarse, MAP)  # type: ignore[arg-type]


def test_parametrised_cells_are_what_their_designs_are(tmp_path: Path) -> None:
    metalith.klayout.register()
    # Of the same lattice as the other cell: elements of one file are read on one.
    design = ml.Design.lens(wavelength_nm=660, focal_length_um=60, diameter_um=20, pitch_nm=350, width_nm=(100, 300))
    file = tmp_path / "own.toml"
    file.write_text(design.text)
    layout = kdb.Layout()
    top = layout.create_cell("CHIP")

    def placed(cell: str, x_um: float, **parameters: object) -> Any:
        made = layout.create_cell(cell, "metalith", parameters)
        return top.insert(kdb.DCellInstArray(made.cell_index(), kdb.DTrans(kdb.DVector(x_um, 0))))

    placed("Array", -100, design=str(file))
    lens = dict(wavelength_nm=660.0, focal_length_um=40.0, diameter_um=15.0, pitch_nm=350.0, width_min_nm=100, width_max_nm=300)
    instance = placed("Metalens", 100, **lens)
    instance.change_pcell_parameter("diameter_um", 20.0)
    layout.write(str(tmp_path / "chip.gds"))
    found = ml.read_layout(tmp_path / "chip.gds")
    assert found.centres_nm == [(-100_000, 0), (100_000, 0)] and found.other_shapes == 0
    wanted = ml.Design.lens(wavelength_nm=660, focal_length_um=40, diameter_um=20, pitch_nm=350, width_nm=(100, 300))
    for widths, one in zip(found.widths, (design, wanted), strict=True):
        assert np.array_equal(widths, one.array().widths(0))
    # A library that is registered again reads changed files, also for cells that are there.
    file.write_text(wanted.text)
    metalith.klayout.register()
    layout.write(str(tmp_path / "chip.gds"))
    for widths in ml.read_layout(tmp_path / "chip.gds").widths:
        assert np.array_equal(widths, wanted.array().widths(0))


def test_the_program_has_classes_of_its_own(design: ml.Design, monkeypatch: pytest.MonkeyPatch) -> None:
    class Own(kdb.Layout):  # type: ignore[name-defined, misc]
        pass

    monkeypatch.setitem(sys.modules, "pya", types.SimpleNamespace(Application=object, Layout=Own))
    assert type(metalith.klayout.read(design, 0.001)) is Own
    # The package has a module of this name too, without the windows of the program.
    monkeypatch.setitem(sys.modules, "pya", types.SimpleNamespace(Layout=Own))
    assert type(metalith.klayout.read(design, 0.001)) is kdb.Layout


def test_a_lens_is_designed_from_its_numbers() -> None:
    lens = dict(focal_length_um=40, diameter_um=20, name="green", pitch_nm=np.int64(320))
    design = ml.Design.lens(wavelength_nm=532.0, width_nm=(100, 250), **lens)  # type: ignore[arg-type]
    assert (design.name, design.wavelengths_nm, design.pitch_nm) == ("green", [532.0], 320)
    assert (design.focal_length_um, design.diameter_um, design.array().shape) == (40, 20, "circle")
    assert ml.Design.parse(design.text).digest == design.digest
    with pytest.raises(ml.MetalithError, match="`diameter_um` = 'wide'\n  help: "):
        ml.Design.lens(wavelength_nm=532, focal_length_um=40, diameter_um="wide")  # type: ignore[arg-type]
    with pytest.raises(ml.MetalithError, match="nanometres are meant: 532"):
        ml.Design.lens(wavelength_nm=0.532, focal_length_um=40, diameter_um=20)
    with pytest.raises(ml.MetalithError, match="take a pitch of 364 nm or less"):
        ml.Design.lens(wavelength_nm=532, focal_length_um=40, diameter_um=20, pitch_nm=500)
    with pytest.raises(ml.MetalithError, match="no lattice `triangular`"):
        ml.Design.lens(wavelength_nm=532, focal_length_um=40, diameter_um=20, lattice="triangular")  # type: ignore[arg-type]


def test_a_lens_is_that_of_the_program(tmp_path: Path) -> None:
    file = tmp_path / "far.toml"
    told = ["--wavelength-nm", "1550", "--diameter-um", "60", "--focal-length-um", "100", "--material", "a-si"]
    subprocess.run([sys.executable, "-m", "metalith._program", "new", str(file), *told], check=True, capture_output=True)
    chosen = ml.Design.lens(wavelength_nm=1550, diameter_um=60, focal_length_um=100, pillar="a-si", name="far")
    assert chosen.digest == ml.Design.read(file).digest


def test_a_chip_of_gdsfactory_is_read_as_it_was_meant(design: ml.Design, tmp_path: Path) -> None:
    gf = pytest.importorskip("gdsfactory")
    gf.gpdk.PDK.activate()
    arrays = [design.array(), ml.Array.of_maps(MAP, pitch_nm=PITCH_NM)]
    lens, other = (metalith.gdsfactory.component(array) for array in arrays)
    chip = gf.Component(name="chip")
    turned = chip.add_ref(lens)
    turned.rotate(90)
    turned.move((1000, 500))
    chip.add_ref(other).move((-300, 0))
    chip.add_label("first light", position=(0, 900), layer=(11, 0))
    chip.add_ref(gf.components.rectangle(size=(3000, 2000), layer=(10, 0), centered=True))
    path = Path(chip.write_gds(tmp_path / "chip.gds"))
    found = ml.read_layout(path)
    assert found.centres_nm == [(-300_000, 0), (1_000_000, 500_000)] and found.other_shapes == 0
    assert np.array_equal(found.widths[0], MAP)
    # Rows are along +y: a turn from x to y is one of the array by minus a quarter.
    assert np.array_equal(found.widths[1], np.rot90(arrays[0].widths(0), -1))
    for component, array in zip((lens, other), arrays):
        own = ml.read_layout(path, top=component.name, array=array)
        assert np.array_equal(own.widths[0], array.widths(0))
    assert texts(path) == ["first light"]
    assert ml.check(path).clean


def test_components_are_the_arrays_that_they_are_of(design: ml.Design) -> None:
    gf = pytest.importorskip("gdsfactory")
    array = design.array()
    first = metalith.gdsfactory.component(array, name="lens")
    assert metalith.gdsfactory.component(design, name="lens") == first and first.locked
    assert first.info["digest"] == design.digest and first.info["pillars"] == array.pillars
    layout = metalith.klayout.read(array, 0.001)
    # The hierarchy of the file: its cells, and no more.
    assert len(list(first.called_cells())) + 1 == layout.cells()
    other = metalith.gdsfactory.component(ml.Array.of_maps(MAP, pitch_nm=PITCH_NM), name="lens")
    assert other.name == "lens$1"
    cells = gf.kcl.layout.cells()
    assert metalith.gdsfactory.component(design, name="lens") == first and gf.kcl.layout.cells() == cells
