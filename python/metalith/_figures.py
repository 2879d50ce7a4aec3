"""Packages for figures, imported when they are asked for."""

from __future__ import annotations

import importlib
import inspect
from functools import partial
from typing import Any

from ._native import MetalithError


def imported(name: str) -> Any:
    """A module of matplotlib or xarray, which the package does not need for anything else."""
    package = name.partition(".")[0]
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        # A package that is there and lacks one of its own is broken in another way.
        if error.name != package:
            raise
        raise MetalithError(f"{package} is not installed\n  help: pip install {package}") from error


def subplots(rows: int = 1, columns: int = 1, **options: Any) -> tuple[Any, Any]:
    """A figure of matplotlib and its axes, as ``pyplot.subplots`` gives them, which a notebook shows once."""
    figure, axes = imported("matplotlib.pyplot").subplots(rows, columns, **options)
    figure._ipython_display_ = partial(_display, figure)
    return figure, axes


def _display(figure: Any) -> None:
    """Nothing for the value of a cell where the notebook shows open figures at the end of the cell; else as every figure."""
    inline = "inline" in imported("matplotlib").get_backend()
    if not (inline and imported("matplotlib.pyplot").fignum_exists(figure.number) and "IPython.core.displayhook" in _callers()):
        # IPython goes on with its own way.
        raise NotImplementedError


def _callers() -> set[str]:
    """Modules of the functions that called."""
    frame, found = inspect.currentframe(), set()
    while frame is not None:
        found.add(frame.f_globals.get("__name__", ""))
        frame = frame.f_back
    return found
