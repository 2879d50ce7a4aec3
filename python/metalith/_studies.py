"""Studies: a chip made many times, in shards for any number of processes."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from . import _arguments, _html, _native
from ._figures import imported
from ._types import Json, PathLike, Progress


@dataclass(frozen=True, eq=False)
class StudyResult:
    """All draws of a study, and what they say."""

    draws: list[Json] = field(repr=False)
    """Each draw: ``draw``, ``amounts``, ``figures``, ``reached``, ``passed``."""
    quantities: list[tuple[str, str]]
    """Name and unit of each of the amounts."""
    yields: list[Json] = field(repr=False)
    """Yield over each limit and over ``all``, with Wilson's interval of 95 %."""
    responses: list[Json] = field(repr=False)
    """What contributes to the variance of the margin of each limit."""
    tightenings: list[Json] = field(repr=False)
    """What spreads would have to be multiplied by for a yield of 90 %."""
    grid: list[Json] = field(repr=False)
    """Draws at each value of a grid: ``at``, ``draws``, ``held``, and mean and ``sd`` of each of the ``figures``."""
    combinations: list[Json] = field(repr=False)
    """The same at each combination of values of several grids."""

    def table(self) -> list[dict[str, Any]]:
        """Draws as rows of amounts and figures, for ``pandas.DataFrame`` or a loop."""
        names = [name for name, _ in self.quantities]
        return [
            {
                "draw": d["draw"],
                **dict(zip(names, d["amounts"])),
                **d.get("design", {}),
                **d["figures"],
                "passed": d["passed"],
            }
            for d in self.draws
        ]

    def to_xarray(self) -> Any:
        """An ``xarray.Dataset``. Of a study over a grid, its dimensions are the quantities of the grid: ``yield`` (0 to 1), and mean
        and ``NAME_sd`` of each figure NAME over the draws at each place. Without a grid, or where it has too many
        combinations to be merged, the dimension is ``draw``: each figure, the amounts (with ``units``) and ``passed`` as
        coordinates. NaN where a figure is no number. :class:`MetalithError` if xarray is not installed."""
        xarray = imported("xarray")
        units = dict(self.quantities)
        points = self.combinations or self.grid
        names = list(dict.fromkeys(name for point in points for name, _ in point["at"]))
        if not points or any(len(point["at"]) != len(names) for point in points):
            return self._draws_to_xarray(xarray, units)
        axes = {name: list(dict.fromkeys(dict(point["at"])[name] for point in points)) for name in names}
        shape = tuple(len(axis) for axis in axes.values())
        figures = list(dict.fromkeys(key for point in points for key in point["figures"]))
        keys = ["yield", *(key + ending for key in figures for ending in ("", "_sd"))]
        values = {key: np.full(shape, np.nan) for key in keys}
        for point in points:
            at = tuple(axes[name].index(value) for name, value in point["at"])
            values["yield"][at] = point["held"] / point["draws"]
            for key, found in point["figures"].items():
                values[key][at], values[key + "_sd"][at] = found["mean"], found["sd"]
        return xarray.Dataset(
            {key: (names, array) for key, array in values.items()},
            coords={name: (name, axis, {"units": units.get(name, "")}) for name, axis in axes.items()},
        )

    def _draws_to_xarray(self, xarray: Any, units: dict[str, str]) -> Any:
        figures = list(dict.fromkeys(key for d in self.draws for key in d["figures"]))
        held = list(dict.fromkeys(key for d in self.draws for key in d.get("design", {})))
        coords: dict[str, Any] = {"draw": [d["draw"] for d in self.draws]}
        for k, (name, unit) in enumerate(units.items()):
            coords[name] = ("draw", [d["amounts"][k] for d in self.draws], {"units": unit})
        for name in held:
            coords[name] = ("draw", [d["design"].get(name) for d in self.draws])
        coords["passed"] = ("draw", [d["passed"] for d in self.draws])
        values = {key: np.array([d["figures"].get(key) for d in self.draws], dtype=np.float64) for key in figures}
        return xarray.Dataset({key: ("draw", array) for key, array in values.items()}, coords=coords)

    def _repr_html_(self) -> str:
        rows = ((y["key"], y["share"], "{:.3g} to {:.3g}".format(*y["interval"]), y["of"]) for y in self.yields)
        columns = ("limit", "yield", "95 % interval", "draws")
        return _html.table(rows, columns=columns, caption=f"study of {len(self.draws)} draws")


class Study:
    """A study of ``tolerance.toml`` in a folder, which is planned when it is first needed. ``layer`` (layer and datatype) is that
    of the pillars of the layout that the tolerance file names, if it is not as its design says; ``top`` the cell to start
    from, if this layout has several."""

    def __init__(
        self,
        tolerance: PathLike,
        folder: PathLike | None = None,
        *,
        draws_per_shard: int | None = None,
        layer: tuple[int, int] | None = None,
        top: str | None = None,
    ) -> None:
        self.tolerance = Path(tolerance)
        self.folder = Path(folder) if folder is not None else self.tolerance.with_suffix(".study")
        self._draws_per_shard = _arguments.maybe_whole("draws_per_shard", draws_per_shard, 1, _arguments.MOST_64)
        self._layer = None if layer is None else _arguments.layer(layer)
        self._top = top
        self._shards: int | None = None

    def plan(self, progress: Progress | None = None) -> Json:
        """Plan it, if it is not planned: the manifest. Tables of cells are made here, once."""
        settings = (self._draws_per_shard, progress, self._layer, self._top)
        found = json.loads(_native.study_plan(self.tolerance, self.folder, *settings))
        self._shards = int(found["shards"])
        plan: Json = found["plan"]
        return plan

    def missing(self) -> list[int]:
        """Numbers of the shards that are not there."""
        if self._shards is None:
            self.plan()
        missing: list[int] = json.loads(_native.study_status(self.folder))["missing"]
        return missing

    def run(self, client: Any = None, progress: Progress | None = None) -> None:
        """Make what is missing: here, or with ``client``, a ``dask.distributed.Client`` or a
        ``concurrent.futures.Executor`` of processes that see the same folder. Shards that are there are left as they are,
        so that a study that was stopped goes on."""
        missing = self.missing()
        if client is None:
            for shard in missing:
                _native.study_run(self.folder, shard, progress)
            return
        folder = os.path.abspath(self.folder)
        for future in [client.submit(run_shard, folder, shard) for shard in missing]:
            future.result()

    def result(self, out: PathLike | None = None, psfs: int = 0, progress: Progress | None = None) -> StudyResult:
        """All draws. ``out``: a folder for the page, with the PSFs of so many of the worst draws."""
        shown = _arguments.whole("psfs", psfs, 0, _arguments.MOST_32)
        found = json.loads(_native.study_merge(self.folder, out, shown, progress))
        study = found["study"]
        return StudyResult(
            draws=found["draws"],
            quantities=[(name, unit) for name, unit in study["plan"]["quantities"]],
            yields=study["yields"],
            responses=study["responses"],
            tightenings=study["tightenings"],
            grid=study["grid"],
            combinations=study["combinations"],
        )


def run_shard(folder: str, shard: int) -> int:
    """Make one shard of a planned study, in whatever process this is called."""
    _native.study_run(folder, shard)
    return shard
