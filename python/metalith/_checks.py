"""Design rules, verification, and the plan of a measurement."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from . import _arguments, _html, _native
from ._layouts import Design, native_design
from ._types import Json, PathLike, Progress

DESIGN_FIRST = "give a metalith.Design first"


@dataclass(frozen=True)
class Marker:
    """One place where a rule does not hold."""

    rule: str
    numbers: Json
    """What is known of the place: coordinates, cell, what was found, as in the JSON of ``metalith check``."""


@dataclass(frozen=True)
class CheckReport:
    """What design rules say of a layout."""

    clean: bool
    """Whether no rule failed to run, and nothing was found that no waiver covers."""
    rules: list[Json] = field(repr=False)
    """Each rule with its status and counts. ``not_in_force``: it needs what was not given, such as a ``design``."""
    markers: list[Marker] = field(repr=False)
    """Places, of all rules."""
    numbers: Json = field(repr=False)
    """The whole report, as the JSON of ``metalith check``."""

    def __repr__(self) -> str:
        broken = [f"{r['id']} {r['violations'] - r['waived']}" for r in self.rules if r["violations"] > r["waived"]]
        idle = sum(r["status"] == "not_in_force" for r in self.rules)
        return f"CheckReport(clean={self.clean}, violations: {', '.join(broken) or 'none'}; {idle} of {len(self.rules)} rules not in force)"

    def table(self) -> list[dict[str, Any]]:
        """Markers as rows, for ``pandas.DataFrame`` or a loop."""
        return [{"rule": m.rule, **m.numbers} for m in self.markers]

    def _repr_html_(self) -> str:
        # Rules with places first; an order that is stable keeps that of the deck.
        rules = sorted(self.rules, key=lambda rule: not rule["violations"])
        columns = ("rule", "what must hold", "status", "violations", "waived")
        rows = ((r["id"], r["words"], r["status"], r["violations"], r["waived"]) for r in rules)
        return _html.table(rows, columns=columns, caption="clean" if self.clean else "not clean")


def check(
    layout: PathLike,
    *,
    rules: PathLike | None = None,
    design: Design | None = None,
    with_layouts: Sequence[PathLike] = (),
    waivers: PathLike | None = None,
    markers: int = 100,
    layer: tuple[int, int] | None = None,
    top: str | None = None,
    progress: Progress | None = None,
) -> CheckReport:
    """Check a layout against design rules: those of the program for the shape of its pillars, or for the ``design``, if
    ``rules`` is left out. ``design`` puts the rules in force that compare with it. ``layer`` (layer and datatype) is that
    of the pillars, if it is not as the rules say; ``top`` the cell to start from, if the layout has several."""
    native = native_design(design) if design is not None else None
    most = _arguments.whole("markers", markers, 0, _arguments.MOST_32)
    on = None if layer is None else _arguments.layer(layer)
    text, clean = _native.check(layout, rules, native, list(with_layouts), waivers, most, progress, on, top)
    found = json.loads(text)
    places = [Marker(rule["id"], m) for rule in found["rules"] for m in rule.get("markers", [])]
    return CheckReport(clean=clean, rules=found["rules"], markers=places, numbers=found)


@dataclass(frozen=True)
class Verification:
    """A layout that was read back, compared with its design, and simulated."""

    passed: bool
    """Whether all limits of the design hold."""
    checks: list[Json]
    """Each limit: ``key``, ``what``, ``reached``, ``limit``, ``sense``."""
    numbers: Json = field(repr=False)
    """All figures, as in ``report.json`` of ``metalith verify``."""

    def _repr_html_(self) -> str:
        columns = ("figure", "reached", "sense", "limit")
        rows = ((c["what"], c["reached"], c["sense"].replace("_", " "), c["limit"]) for c in self.checks)
        return _html.table(rows, columns=columns, caption="passed" if self.passed else "not passed")


def verify(
    design: Design,
    layout: PathLike,
    *,
    fast: bool = False,
    model: PathLike | None = None,
    out: PathLike | None = None,
    layer: tuple[int, int] | None = None,
    top: str | None = None,
    progress: Progress | None = None,
) -> Verification:
    """Read a layout back, compare every pillar with the design, simulate it and judge it by the limits of the design.

    ``model``: judge the chip as made, by the model of a calibration. ``out``: a folder for the page. ``layer`` (layer and
    datatype) is that of the pillars, if it is not as the design says; ``top`` the cell to start from, if the layout has several."""
    on = None if layer is None else _arguments.layer(layer)
    text, passed = _native.verify(native_design(design, DESIGN_FIRST), layout, fast, model, out, progress, on, top)
    found = json.loads(text)
    return Verification(passed=passed, checks=found["checks"], numbers=found)


@dataclass(frozen=True)
class MeasurementPlan:
    """The measurements that a bench should take of a design."""

    folder: Path
    """Folder of the measured set, its frames still to be taken."""
    page: Path
    """The check list, to print."""
    sentence: str
    """One line for a person."""
    finds_all: bool
    """Whether every effect is found at its wanted size."""
    measurements: list[Json] = field(repr=False)
    """What to take: ``file``, ``element``, ``led_nm``, ``aoi_deg``, ``distance_um``, ``window_centre_um``, ``frames`` and
    exposure."""
    effects: list[Json] = field(repr=False)
    """What is expected of each effect: ``name``, ``wanted``, ``detected`` and more."""
    confusions: list[Json] = field(repr=False)
    """Pairs of effects that the measurements cannot distinguish, with the measurement that would."""
    numbers: Json = field(repr=False)
    """All of it, as in ``plan.json`` of ``metalith plan``."""

    def _repr_html_(self) -> str:
        rows = ((e["name"], e["detected"]) for e in self.effects)
        return _html.table(rows, columns=("effect", "is detected"), caption=self.sentence)


def plan(
    design: Design,
    bench: PathLike,
    out: PathLike,
    *,
    layout: PathLike | None = None,
    effects: Sequence[str] = (),
    layer: tuple[int, int] | None = None,
    top: str | None = None,
    progress: Progress | None = None,
) -> MeasurementPlan:
    """Plan a bench session into the folder ``out``: the fewest measurements that find every effect of a chip at a wanted size
    and tell it from the others.

    ``bench``: a file of what the bench can do and what is wanted. ``layout``: the one that was written; left out, the pillars
    of the design are written into ``out``. ``effects``: plan for these alone. ``layer`` and ``top``: as in :func:`verify`. A
    folder with frames is not overwritten. It takes minutes."""
    on = None if layer is None else _arguments.layer(layer)
    told = _native.plan(native_design(design, DESIGN_FIRST), bench, out, layout, list(effects), progress, on, top)
    text, finds_all, sentence = told
    found = json.loads(text)
    return MeasurementPlan(
        folder=Path(found["folder"]),
        page=Path(found["page"]),
        sentence=sentence,
        finds_all=finds_all,
        measurements=found["measurements"],
        effects=found["effects"],
        confusions=found["confusions"],
        numbers=found,
    )
