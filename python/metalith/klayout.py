"""Arrays in KLayout: :func:`insert` puts one into a layout, :func:`register` adds a library of parametrised cells.

They work in the program KLayout, after ``import pya``, and with the package ``klayout`` (``pip install klayout``), which is
imported when they are called."""

from __future__ import annotations

import sys
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

from ._figures import imported
from ._layouts import Array, Design
from ._native import MetalithError

LIBRARY = "metalith"
"""Name of the library, if :func:`register` is told no other."""


def insert(
    layout: Any, of: Design | Array, *, name: str | None = None, hierarchy: str | None = None, layer: tuple[int, int] = (1, 0)
) -> Any:
    """The array as a new top cell of a ``klayout.db.Layout``, with the layers and the hierarchy that :meth:`metalith.Array.write`
    writes: a ``klayout.db.Cell``, its origin the middle of the chip. ``name``: of the cell, the one of the file if left
    out; where it is taken, ``$1`` and so on is added, as KLayout does. ``hierarchy`` and ``layer``: as for
    :meth:`metalith.Array.write`. :class:`MetalithError` if coordinates of the array are no multiples of the database unit of
    the layout, or klayout is not installed; nothing is added then."""
    if not hasattr(layout, "dbu"):
        raise TypeError(f"`layout` is a {type(layout).__name__}\n  help: give a klayout.db.Layout")
    source = read(of, layout.dbu, hierarchy, layer)
    cell = layout.create_cell(name or source.top_cell().name)
    cell.copy_tree(source.top_cell())
    return cell


def read(of: Design | Array, dbu_um: float, hierarchy: str | None = None, layer: tuple[int, int] = (1, 0)) -> Any:
    """The array as a ``klayout.db.Layout`` of its own, of one top cell, to be copied into one with the database unit ``dbu_um``
    (um)."""
    kdb = _database()
    array = of.array() if isinstance(of, Design) else of
    if not isinstance(array, Array):
        raise TypeError(f"no array but a {type(of).__name__}\n  help: give a design or an array, of maps by `metalith.Array.of_maps`")
    layout = kdb.Layout()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "array.gds"
        array.write(path, hierarchy=hierarchy, layer=layer)
        layout.read(str(path))
    steps = layout.dbu / dbu_um
    if abs(steps - round(steps)) > 1e-6:
        raise MetalithError(
            f"places of the array are multiples of {1e3 * layout.dbu:g} nm, those of the layout of {1e3 * dbu_um:g} nm\n"
            f"  help: give the layout a database unit of {layout.dbu:g} um"
        )
    return layout


def _database() -> Any:
    """KLayout's classes: those of the program in its own Python, else those of the package."""
    of_program = sys.modules.get("pya")
    return of_program if hasattr(of_program, "Application") else imported("klayout.db")


def register(name: str = LIBRARY) -> Any:
    """Register the library of parametrised cells with KLayout: a ``klayout.db.Library`` with ``Array``, of a design file, and
    ``Metalens``, of a wavelength, a focal length and a diameter. A second call replaces the library, as KLayout does with equal
    names, and reads changed design files, also for cells of open layouts. :class:`MetalithError` if klayout is not installed."""
    library: Any = _classes()(name)
    return library


@cache
def _designed(path: str, _changed: int) -> Array:
    """The array of a design file, made once as long as the file is unchanged."""
    return Design.read(path).array()


@cache
def _lens(**parameters: Any) -> Array:
    return Design.lens(**parameters).array()


@cache
def _classes() -> Any:
    kdb = _database()

    class Pillars(kdb.PCellDeclarationHelper):  # type: ignore[name-defined, misc]
        """A cell of an array. KLayout reports what its parameters cannot be, and leaves it empty."""

        def array(self) -> Array:
            raise NotImplementedError

        def produce_impl(self) -> None:
            source = read(self.array(), self.layout.dbu)
            self.cell.copy_tree(source.top_cell())

    class ArrayCell(Pillars):
        def __init__(self) -> None:
            super().__init__()
            self.param("design", self.TypeString, "Design file", default="")

        def display_text_impl(self) -> str:
            return f"Array({Path(self.design).stem})"

        def array(self) -> Array:
            path = Path(self.design)
            # Whether there is such a file is told by reading it.
            return _designed(str(path), path.stat().st_mtime_ns if path.is_file() else 0)

    class MetalensCell(Pillars):
        def __init__(self) -> None:
            super().__init__()
            self.param("wavelength_nm", self.TypeDouble, "Wavelength", unit="nm", default=550.0)
            self.param("focal_length_um", self.TypeDouble, "Focal length", unit="um", default=100.0)
            self.param("diameter_um", self.TypeDouble, "Diameter", unit="um", default=50.0)
            self.param("pillar", self.TypeString, "Material of the pillars; by the wavelength if empty", default="")
            self.param("pitch_nm", self.TypeDouble, "Pitch; 0: chosen", unit="nm", default=0.0)
            self.param("pillar_height_nm", self.TypeDouble, "Height of the pillars; 0: chosen", unit="nm", default=0.0)
            self.param("width_min_nm", self.TypeInt, "Narrowest pillar; 0: chosen", unit="nm", default=0)
            self.param("width_max_nm", self.TypeInt, "Widest pillar; 0: chosen", unit="nm", default=0)

        def display_text_impl(self) -> str:
            return f"Metalens({self.diameter_um:g} um, f = {self.focal_length_um:g} um, {self.wavelength_nm:g} nm)"

        def array(self) -> Array:
            widths = (self.width_min_nm, self.width_max_nm)
            return _lens(
                wavelength_nm=self.wavelength_nm,
                focal_length_um=self.focal_length_um,
                diameter_um=self.diameter_um,
                pillar=self.pillar or None,
                pitch_nm=self.pitch_nm or None,
                pillar_height_nm=self.pillar_height_nm or None,
                width_nm=widths if any(widths) else None,
            )

    class Library(kdb.Library):  # type: ignore[name-defined, misc]
        def __init__(self, name: str) -> None:
            super().__init__()
            self.description = "Metalenses and arrays of them"
            self.layout().register_pcell("Array", ArrayCell())
            self.layout().register_pcell("Metalens", MetalensCell())
            self.register(name)

    return Library
