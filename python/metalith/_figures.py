"""Packages for figures, imported when they are asked for."""

from __future__ import annotations

import importlib
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
