"""Lenses by ``scipy.optimize``.

:func:`minimize` needs the package ``scipy`` (``pip install scipy``), which is imported when it is called."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from ._figures import imported
from ._gradient import Merit, PsfModel
from ._types import Float64


def objective(model: PsfModel, merit: Merit, **place: Any) -> Callable[[Float64], tuple[float, Float64]]:
    """The function for ``scipy.optimize.minimize(..., jac=True)``: of the flat list of phases (rad) or widths (nm) of all places
    of a lens, it gives the merit of the PSF, to be lowered, and its derivatives. ``merit``: as for
    :meth:`metalith.PsfModel.value_and_gradient`; ``place``: its ``distance_um`` and ``wedge_deg``."""
    shape = (model.sites, model.sites)

    def function(x: Float64) -> tuple[float, Float64]:
        value, gradient = model.value_and_gradient(merit, np.reshape(x, shape), **place)
        return value, gradient.map.ravel()

    return function


def minimize(
    model: PsfModel,
    merit: Merit,
    start: npt.ArrayLike,
    *,
    distance_um: float | None = None,
    wedge_deg: tuple[float, float] = (0.0, 0.0),
    method: str = "L-BFGS-B",
    **options: Any,
) -> Any:
    """The lens with the least merit of its PSF, from the phases (rad) or widths (nm) ``start`` on, shape ``[sites, sites]``: the
    ``OptimizeResult`` of ``scipy.optimize.minimize``, whose ``x`` and ``jac`` have the shape of the lens. ``options`` go to
    scipy, such as ``bounds=[(100, 300)] * start.size`` for widths and ``options={"maxiter": 50}``. ``L-BFGS-B`` does not stop at a
    small gradient unless ``gtol`` of its options says so: each of thousands of pillars changes a merit by little. ``merit``,
    ``distance_um`` and ``wedge_deg``: as for :meth:`metalith.PsfModel.value_and_gradient`."""
    scipy_optimize = imported("scipy.optimize")
    function = objective(model, merit, distance_um=distance_um, wedge_deg=wedge_deg)
    first = np.asarray(start, dtype=np.float64)
    if method == "L-BFGS-B":
        options["options"] = {"gtol": 0.0, **options.get("options", {})}
    found = scipy_optimize.minimize(function, first.ravel(), jac=True, method=method, **options)
    found.x = found.x.reshape(first.shape)
    if hasattr(found, "jac"):
        found.jac = np.reshape(found.jac, first.shape)
    return found
