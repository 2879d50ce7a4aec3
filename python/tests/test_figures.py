"""Figures and labelled arrays, and what is said where their packages are missing."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import metalith as ml

ROOT = Path(__file__).resolve().parents[2]
OPTIONAL = ("xarray", "matplotlib", "torch", "jax", "scipy", "klayout", "gdsfactory")


@pytest.fixture(scope="module")
def psfs() -> ml.PsfSet:
    array = ml.Design.read(ROOT / "designs/mini_3x3.toml").array()
    return ml.psf(array, [530, 660], [(0, 0), (15, 0)], elements=[0, 4], samples=32, fast=True)


def test_psfs_are_a_labelled_array(psfs: ml.PsfSet) -> None:
    labelled = psfs.to_xarray()
    assert dict(labelled.sizes) == {"element": 2, "wavelength_nm": 2, "field": 2, "y": 32, "x": 32}
    for psf in psfs:
        here = labelled.sel(element=psf.element, wavelength_nm=psf.wavelength_nm)
        here = here.isel(field=int(psf.field_deg[0] > 0))
        assert np.array_equal(here.values, psf.values)
        # Places count from the middle of the window, which is a coordinate.
        assert np.allclose(here.x + float(here.centre_x_um), psf.x_um)
    one = psfs[3].to_xarray()
    assert np.array_equal(one.values[0, 0, 0], psfs[3].values)


def test_cells_are_a_labelled_array() -> None:
    widths, wavelengths = [150.0, 200.0, 250.0], np.array([530.0, 600.0])
    t = ml.cell(widths, wavelengths)
    labelled = t.to_xarray()
    assert np.array_equal(labelled.sel(width_nm=200.0, wavelength_nm=600.0), t[1, 1])
    one = ml.cell(200.0, wavelengths).to_xarray()
    assert one.sizes["width_nm"] == 1 and np.array_equal(one.values[0], t[1])
    # A part, or what is computed, is an array without names.
    others: list[Any] = [t[0], t * 2, np.abs(t)]
    for other in others:
        with pytest.raises(ml.MetalithError, match="no widths and wavelengths\n  help: "):
            other.to_xarray()
    with pytest.raises(ml.MetalithError, match="more than one dimension"):
        ml.cell([[150.0], [200.0]], 530.0).to_xarray()


def test_figures_are_drawn_of_what_was_computed(psfs: ml.PsfSet) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    figure = psfs.plot(columns=3)
    drawn = [axis.images[0].get_array() for axis in figure.axes if axis.images]
    assert len(drawn) == len(psfs) and all(np.array_equal(d, p.values) for d, p in zip(drawn, psfs))
    assert len(psfs[0].plot().axes) == 1
    t = ml.cell([150.0, 200.0], [530.0, 600.0, 660.0])
    modulus, phase = t.plot().axes
    assert [line.get_label() for line in modulus.lines] == ["150 nm", "200 nm"]
    assert np.allclose(modulus.lines[1].get_ydata(), np.abs(t[1]))
    assert np.allclose(phase.lines[0].get_ydata(), np.angle(t[0]) / (2 * np.pi))
    over_width = ml.cell([150.0, 200.0, 250.0], 530.0).plot().axes[0]
    assert np.allclose(over_width.lines[0].get_xdata(), [150, 200, 250])


def test_designs_are_drawn_in_place() -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    design = ml.Design.read(ROOT / "designs/mini_3x3.toml")
    images = design.plot().axes[0].images
    assert len(images) == 9
    # The element in the middle, its 172 sites about the origin.
    array = design.array()
    middle = images[array.centres_nm.index((0, 0))]
    assert middle.get_extent() == pytest.approx((-30.1, 30.1, -30.1, 30.1))
    phases = ml.phases_of(array.widths(4), design)
    assert np.array_equal(middle.get_array().filled(np.nan), phases, equal_nan=True)
    widths = array.plot("width").axes[0].images[4].get_array()
    assert np.array_equal(widths.filled(0), array.widths(4))
    rectangles = ml.Rectangles(100, 250)
    turned = ml.Array.of_maps(np.full((8, 8), 30.0), pitch_nm=350, shape=rectangles)
    assert turned.plot().axes[0].images[0].get_array().max() == pytest.approx(30.0)
    with pytest.raises(ml.MetalithError, match="no phases\n  help: "):
        turned.plot("phase")
    with pytest.raises(ml.MetalithError, match="`quantity` = 'colour'"):
        turned.plot("colour")  # type: ignore[arg-type]
    with pytest.raises(ml.MetalithError, match="one phase for each polarisation"):
        ml.Design.read(ROOT / "designs/birefringent_532.toml").plot("phase")


def test_a_notebook_shows_a_figure_once() -> None:
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    before = "import metalith as ml, numpy as np\na = ml.Array.of_maps(np.full((8, 8), 200), pitch_nm=350)\n"
    # The value of a cell, one in the middle of a cell, and one that is shown again.
    cells = [before + "f = a.plot()\nf", "f = a.plot()\nprint()", "f"]
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])
    environment = {key: value for key, value in os.environ.items() if key != "MPLBACKEND"}
    client = nbclient.NotebookClient(notebook, timeout=120, kernel_name="python3", extra_arguments=["--log-level=ERROR"])
    client.execute(env=environment)
    images = [sum("image/png" in output.get("data", {}) for output in cell.outputs) for cell in notebook.cells]
    assert images == [1, 1, 1]


def test_results_are_tables_in_a_notebook(psfs: ml.PsfSet) -> None:
    cells = psfs._repr_html_().count("<td>")
    assert cells == 7 * len(psfs), "a row for each PSF"
    array = ml.Design.read(ROOT / "designs/mini_3x3.toml").array()
    assert f"{array.pillars:,}" in array._repr_html_()
    rule: dict[str, Any] = dict(id="a<b", words="a & b", status="run", violations=2, waived=0)
    report = ml.CheckReport(False, [{**rule, "id": "clean", "violations": 0}, rule], [], {})
    shown = report._repr_html_()
    assert "a&lt;b" in shown and "a &amp; b" in shown and shown.index("a&lt;b") < shown.index("<td>clean</td>")
    many = ml.CheckReport(True, [rule] * 50, [], {})._repr_html_()
    assert many.count("<tr>") == 41 and "10 more rows" in many
    check = dict(key="k", what="rms [rad]", reached=0.56266, limit=0.6, sense="at_most")
    assert "<td>0.5627</td><td>at most</td><td>0.6</td>" in ml.Verification(True, [check], {})._repr_html_()


@pytest.mark.parametrize(
    ("call", "package"),
    [
        ("t.to_xarray()", "xarray"),
        ("t.plot()", "matplotlib"),
        ("p.to_xarray()", "xarray"),
        ("p.plot()", "matplotlib"),
        ("metalith.torch.psf(model, np.ones((8, 8)))", "torch"),
        ("metalith.jax.psf(model)", "jax"),
        ("metalith.scipy.minimize(model, np.ones((8, 8)), np.ones((8, 8)))", "scipy"),
        ("a.plot()", "matplotlib"),
        ("metalith.klayout.insert(Nothing(), a)", "klayout"),
        ("metalith.klayout.register()", "klayout"),
        ("metalith.gdsfactory.component(a)", "gdsfactory"),
    ],
)
def test_a_package_that_is_missing_is_named_with_the_remedy(call: str, package: str) -> None:
    code = (
        "import sys, numpy as np, metalith as ml, metalith.gdsfactory, metalith.jax, metalith.klayout\n"
        "import metalith.scipy, metalith.torch\n"
        f"assert not {set(OPTIONAL)} & set(sys.modules), 'imported before they are asked for'\n"
        # What Python's own search gives where a package is not installed.
        "class Nothing:\n"
        "    dbu = 0.001\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        f"        if name.partition('.')[0] in {OPTIONAL}:\n"
        "            raise ModuleNotFoundError(f'No module named {name!r}', name=name.partition('.')[0])\n"
        "sys.meta_path.insert(0, Nothing())\n"
        "t = ml.cell([200.0], [530.0], orders=3)\n"
        "p = ml.psf(np.full((8, 8), 200, dtype=np.uint16), [530], pitch_nm=350, distance_um=20.0, samples=8, fast=True)\n"
        "model = ml.PsfModel(8, pitch_nm=350, wavelength_nm=530, distance_um=20.0, samples=8)\n"
        "a = ml.Array.of_maps(np.full((8, 8), 200), pitch_nm=350)\n"
        f"try:\n    {call}\n"
        "except ml.MetalithError as error:\n    print(error)\n"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert run.stdout == f"{package} is not installed\n  help: pip install {package}\n", run.stderr


def test_each_element_has_its_psf_also_where_another_is_alike(tmp_path: Path) -> None:
    """Elements of one layout are simulated together, and one that is like another takes its PSF."""
    lens = np.full((16, 16), 200, dtype=np.uint16)
    other = lens.copy()
    other[:, :8] = 120
    centres = [(0, 0), (14000, 0), (28000, 0)]
    array = ml.write_layout(tmp_path / "chip.gds", [lens, other, lens], pitch_nm=350, centres_nm=centres)

    def look(elements: list[int] | None) -> ml.PsfSet:
        return ml.psf(array, [530, 660], elements=elements, distance_um=20.0, samples=16)

    together = look(None)
    names = [(p.element, round(p.wavelength_nm)) for p in together]
    assert names == [(f"element {k}", nm) for k in range(3) for nm in (530, 660)]
    assert np.array_equal(together[0].values, together[4].values)
    for k in range(3):
        for alone, here in zip(look([k]), together[2 * k : 2 * k + 2], strict=True):
            assert np.array_equal(alone.values, here.values) and alone.strehl == here.strehl
