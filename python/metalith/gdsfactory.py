"""Arrays as components of gdsfactory.

:func:`component` needs the package ``gdsfactory`` of version 9 (``pip install gdsfactory``), which is imported when it is called."""

from __future__ import annotations

import hashlib
from typing import Any

from ._figures import imported
from ._layouts import Array, Design
from .klayout import read


def component(
    of: Design | Array, *, name: str | None = None, hierarchy: str | None = None, layer: tuple[int, int] = (1, 0)
) -> Any:
    """A ``gdsfactory.Component`` of a design or an array; of maps, by :meth:`metalith.Array.of_maps`.

    It has the layers, the cells and the hierarchy that :meth:`metalith.Array.write` writes, its origin the middle of the chip.
    ``name``: of the component, the one of the file if left out; ``hierarchy`` and ``layer``: as for :meth:`metalith.Array.write`.
    Two calls for equal arrays and names give the same component, which is locked, as those of ``gdsfactory.cell`` are; of
    another array of a name that is taken, the name has ``$1`` and so on added, as have cells below it. ``info`` has
    ``pillars``, ``pitch_nm``, of a design ``design``, and its ``digest`` if the pillars are those of its phase.

    :func:`metalith.read_layout` reads the file of a chip with components anywhere, or with ``top=component.name`` this one in its
    own place, also at the elements of ``array``.
    :class:`MetalithError` if coordinates are no multiples of the database unit of gdsfactory, or gdsfactory is not installed; the
    layout of gdsfactory is as it was then."""
    gf = imported("gdsfactory")
    array = of.array() if isinstance(of, Design) else of
    source = read(array, gf.kcl.dbu, hierarchy, layer)
    top = source.top_cell()
    wanted = name or top.name
    digest = _digest(source)
    found, number = wanted, 0
    while (there := gf.kcl.layout.cell(found)) is not None:
        cell = gf.kcl[there.cell_index()]
        if cell.info.model_dump().get("metalith") == digest:
            return gf.Component(base=cell.base)
        number += 1
        found = f"{wanted}${number}"
    made = gf.Component(name=found)
    made.kdb_cell.copy_tree(top)
    made.info["metalith"] = digest
    made.info["pillars"] = array.pillars
    made.info["pitch_nm"] = array.pitch_nm
    if array.design is not None:
        made.info["design"] = array.design.name
        if not array._of_maps:
            made.info["digest"] = array.design.digest
    made.locked = True
    return made


def _digest(layout: Any) -> str:
    """SHA-256 of all shapes and cells of a layout."""
    kdb = imported("klayout.db")
    options = kdb.SaveLayoutOptions()
    options.format = "GDS2"
    options.gds2_write_timestamps = False
    return hashlib.sha256(layout.write_bytes(options)).hexdigest()
