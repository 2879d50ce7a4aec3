"""Calibration of a measured set."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from . import _arguments, _html, _native
from ._figures import subplots
from ._types import Json, PathLike, Progress


@dataclass(frozen=True)
class FoundEffect:
    """An effect that explains a part of what was measured."""

    name: str
    unit: str
    values: tuple[float, ...]
    """Its parameters, in ``unit``: one, or one along each axis."""
    intervals: tuple[tuple[float, float], ...]
    """95 % interval of each."""
    confounded_with: tuple[str, ...]
    """Effects that this set cannot tell it from."""
    separate_by: str | None
    """The measurement that would."""

    @property
    def value(self) -> float:
        """The first parameter: the only one of most effects."""
        return self.values[0]

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the first parameter."""
        return self.intervals[0]

    def __str__(self) -> str:
        both = zip(self.values, self.intervals, strict=True)
        each = ", ".join(f"{v:.4g} ({low:.4g} to {high:.4g})" for v, (low, high) in both)
        return f"{self.name} = {each} {self.unit}"


@dataclass(frozen=True)
class RankedEffect:
    """A candidate that was tried."""

    name: str
    score: float
    """Share of the residual that it alone explains."""
    gain: float | None
    """By how much it lowers the reduced chi-square of measurements held out."""
    gain_interval: tuple[float, float] | None
    """95 % interval of the gain."""
    rejected: str | None
    """Why it was not taken; none for the one that was."""


@dataclass(frozen=True)
class Diagnosis:
    """What a measured set says of a chip."""

    verdict: str
    """``no_residual``, ``explained``, ``one_of``, ``explained_but_for``, ``partly``, ``unexplained`` or ``data_unfit``."""
    effects: tuple[FoundEffect, ...]
    ranking: tuple[RankedEffect, ...] = field(repr=False)
    """Candidates of the first step, the best first."""
    held_out: tuple[float, float]
    """Reduced chi-square per pixel of measurements held out, before and after."""
    fitted: tuple[float, float] = field(repr=False)
    """The same of those that the effects were fitted to."""
    page: Path = field(repr=False)
    model: Path | None = field(repr=False)
    """``model.toml``, the chip as it was made; none where the verdict has none."""
    numbers: Json = field(repr=False)
    """All of it, as in ``diagnosis.json``."""

    def effect(self, name: str) -> FoundEffect | None:
        """The effect of this name, if it was found."""
        return next((e for e in self.effects if e.name == name), None)

    def __str__(self) -> str:
        before, after = self.held_out
        lines = [f"{self.verdict}: held-out error {before:.4g} before, {after:.4g} after"]
        return "\n".join(lines + [f"  {e}" for e in self.effects])

    def _repr_html_(self) -> str:
        rows = ((e.name, str(e).partition(" = ")[2], ", ".join(e.confounded_with)) for e in self.effects)
        columns = ("effect", "value (95 % interval)", "not distinguished from")
        return _html.table(rows, columns=columns, caption=str(self).partition("\n")[0])

    def plot(self) -> Any:
        """A matplotlib figure of the ranking: the share of the residual that each candidate alone explains (0 to 1), the best
        at the top, the effects that were found darker. :class:`MetalithError` if matplotlib is not installed."""
        figure, axis = subplots(figsize=(6, 1 + 0.25 * len(self.ranking)))
        colours = ["#4a7ab5" if self.effect(e.name) else "#c3d2e6" for e in self.ranking]
        axis.barh([e.name for e in self.ranking], [e.score for e in self.ranking], color=colours)
        axis.invert_yaxis()
        axis.set_xlabel("share of the residual that is explained")
        axis.set_title(str(self).partition("\n")[0], fontsize=8)
        figure.tight_layout()
        return figure


def _found(told: Json) -> FoundEffect:
    # Effects along two axes have a list of values, and of intervals.
    several = isinstance(told["value"], list)
    values = told["value"] if several else [told["value"]]
    intervals = told["interval"] if several else [told["interval"]]
    return FoundEffect(
        name=told["name"],
        unit=told["unit"],
        values=tuple(values),
        intervals=tuple((low, high) for low, high in intervals),
        confounded_with=tuple(told["confounded_with"]),
        separate_by=told["separate_by"],
    )


def _ranked(told: Json) -> RankedEffect:
    interval = told["held_out_gain_interval"]
    return RankedEffect(
        name=told["name"],
        score=told["score"],
        gain=told["held_out_gain"],
        gain_interval=None if interval is None else (interval[0], interval[1]),
        rejected=told["rejected"],
    )


def calibrate(
    measured: PathLike,
    out: PathLike,
    *,
    effects: Sequence[str] = (),
    layer: tuple[int, int] | None = None,
    top: str | None = None,
    progress: Progress | None = None,
) -> Diagnosis:
    """Find the effects by which a measured set differs from its model. Page, ``diagnosis.json`` and ``model.toml`` are written
    into ``out``. ``effects`` are those that are tried, all if left out. The pillars are on ``layer`` (layer and datatype) below
    the cell ``top`` of the layout, if that is not as the set says. It takes minutes."""
    on = None if layer is None else _arguments.layer(layer)
    told: Json = json.loads(_native.calibrate(measured, out, list(effects), progress, on, top))
    before, after = told["error"]["before"], told["error"]["after"]
    folder = Path(out)
    model = folder / "model.toml"
    return Diagnosis(
        verdict=told["verdict"],
        effects=tuple(_found(e) for e in told["effects"]),
        ranking=tuple(_ranked(e) for e in told["ranking"]),
        held_out=(before["held_out"], after["held_out"]),
        fitted=(before["fit"], after["fit"]),
        page=folder / "report.html",
        model=model if model.is_file() else None,
        numbers=told,
    )
