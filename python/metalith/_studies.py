"""Studies: a chip made many times, in shards for any number of processes."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from . import _arguments, _native
from ._types import Json, PathLike, Progress


@dataclass(frozen=True)
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
