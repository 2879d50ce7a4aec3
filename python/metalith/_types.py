"""Types that several modules share."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, TypeAlias, Union

import numpy as np
import numpy.typing as npt

PathLike: TypeAlias = Union[str, "os.PathLike[str]"]
"""A path."""

Progress: TypeAlias = Callable[[str, int, int], object]
"""Called now and then with what is done, the steps that are done, and all of them."""

Widths: TypeAlias = npt.NDArray[np.uint16]
Complex64: TypeAlias = npt.NDArray[np.complex64]
Complex128: TypeAlias = npt.NDArray[np.complex128]
Bools: TypeAlias = npt.NDArray[np.bool_]
Int64: TypeAlias = npt.NDArray[np.int64]
Float64: TypeAlias = npt.NDArray[np.float64]
Json: TypeAlias = "dict[str, Any]"
