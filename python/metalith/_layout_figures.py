"""Figures of designs and arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from ._figures import subplots
from ._native import MetalithError
from ._shapes import Rectangles, Shape, UprightRectangles
from ._types import Float64, Widths

if TYPE_CHECKING:
    from ._layouts import Array

Quantity: TypeAlias = Literal["width", "phase"]
"""What a figure shows of pillars."""

# Samples of an element along an axis: more than a figure has pixels.
MOST_SAMPLES = 600

# A circle in a lens of squares and circles has this much more than its diameter (nm) in a map.
CIRCLE = 0x8000


def map_figure(array: Array, quantity: Quantity) -> Any:
    """A matplotlib figure of the pillars of all elements from above."""
    if quantity not in ("width", "phase"):
        raise MetalithError(f"`quantity` = {quantity!r}\n  help: give 'width' or 'phase'")
    if quantity == "phase" and array.design is None:
        raise MetalithError("an array of maps has no phases\n  help: plot its widths, or give a design")
    if quantity == "phase" and has_two_phases(array.shape):
        raise MetalithError("upright rectangles have one phase for each polarisation\n  help: plot their widths")
    at = array.places()
    x_um, y_um = at.x_nm * 1e-3, at.y_nm * 1e-3
    dx, dy = (float(np.ptp(places)) / max(len(places) - 1, 1) for places in (x_um, y_um))
    stride = -(-len(x_um) // MOST_SAMPLES)
    figure, axis = subplots(figsize=(6, 5))
    images, extents, values = [], np.empty((len(array), 4)), []
    for k, (cx, cy) in enumerate(array.centres_nm):
        widths = array.widths(k)
        if array.lattice == "hexagonal":
            # Half of the places are no sites: each shows the pillar on its left.
            widths = np.hstack([widths[:, :1], np.maximum(widths[:, 1:], widths[:, :-1])])
        values.append(_values(array, k, widths[::stride, ::stride], quantity))
        left, bottom = cx * 1e-3 + x_um[0] - dx / 2, cy * 1e-3 + y_um[0] - dy / 2
        extents[k] = (left, left + dx * len(x_um), bottom, bottom + dy * len(y_um))
        images.append(axis.imshow(values[k], origin="lower", extent=extents[k], interpolation="nearest"))
    limits = [(float(np.nanmin(v)), float(np.nanmax(v))) for v in values if not np.isnan(v).all()]
    whole_wave = (0.0, 2 * np.pi)
    low, high = whole_wave if quantity == "phase" else (min(v for v, _ in limits), max(v for _, v in limits))
    for image in images:
        image.set_clim(low, high)
        image.set_cmap("twilight" if quantity == "phase" else "viridis")
    axis.set_xlim(extents[:, 0].min(), extents[:, 1].max())
    axis.set_ylim(extents[:, 2].min(), extents[:, 3].max())
    axis.set_xlabel("x [um]")
    axis.set_ylabel("y [um]")
    figure.colorbar(images[0], ax=axis, label=_label(array.shape, quantity))
    figure.tight_layout()
    return figure


def has_two_phases(shape: Shape) -> bool:
    """Whether pillars of this shape have a phase for each polarisation."""
    return isinstance(shape, UprightRectangles)


def _values(array: Array, element: int, widths: Widths, quantity: Quantity) -> Float64:
    """What is drawn of each pillar, NaN where there is none."""
    from ._gradient import phases_of

    if quantity == "phase" and array.design is not None:
        return phases_of(widths, array.design, element=element)
    if isinstance(array.shape, Rectangles):
        return array.shape.rotations_deg(widths)
    found: npt.NDArray[Any] = widths
    if isinstance(array.shape, UprightRectangles):
        found = array.shape.widths_nm(widths)[0]
    elif array.shape == "mixed":
        found = widths % CIRCLE
    return np.where(widths > 0, found.astype(np.float64), np.nan)


def _label(shape: Shape, quantity: Quantity) -> str:
    if quantity == "phase":
        return "phase of the mapping [rad]"
    if isinstance(shape, Rectangles):
        return "rotation [degrees]"
    if isinstance(shape, UprightRectangles):
        return "width along x [nm]"
    return "diameter [nm]" if shape == "circle" else "width [nm]"
