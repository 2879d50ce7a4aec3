"""Design rules, verification and calibration."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from . import _native
from ._layouts import Design
from ._types import Json, PathLike, Progress


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
    """Whether all rules ran, and nothing was found that no waiver covers."""
    rules: list[Json] = field(repr=False)
    """Each rule with its status and counts."""
    markers: list[Marker] = field(repr=False)
    """Places, of all rules."""
    numbers: Json = field(repr=False)
    """The whole report, as the JSON of ``metalith check``."""

    def table(self) -> list[dict[str, Any]]:
        """Markers as rows, for ``pandas.DataFrame`` or a loop."""
        return [{"rule": m.rule, **m.numbers} for m in self.markers]


def check(
    layout: PathLike,
    *,
    rules: PathLike | None = None,
    design: Design | None = None,
    with_layouts: Sequence[PathLike] = (),
    waivers: PathLike | None = None,
    markers: int = 100,
    progress: Progress | None = None,
) -> CheckReport:
    """Check a layout against design rules: those of the program if ``rules`` is left out. ``design`` puts the rules in
    force that compare with it."""
    native = design._native if design is not None else None
    text, clean = _native.check(layout, rules, native, list(with_layouts), waivers, markers, progress)
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


def verify(
    design: Design,
    layout: PathLike,
    *,
    fast: bool = False,
    model: PathLike | None = None,
    out: PathLike | None = None,
    progress: Progress | None = None,
) -> Verification:
    """Read a layout back, compare every pillar with the design, simulate it and judge it by the limits of the design.

    ``model``: judge the chip as made, by the model of a calibration. ``out``: a folder for the page."""
    text, passed = _native.verify(design._native, layout, fast, model, out, progress)
    found = json.loads(text)
    return Verification(passed=passed, checks=found["checks"], numbers=found)


def calibrate(
    measured: PathLike,
    out: PathLike,
    *,
    effects: Sequence[str] = (),
    progress: Progress | None = None,
) -> Json:
    """Find the effects by which a measured set differs from its model: the diagnosis, as in ``diagnosis.json``. Page and
    ``model.toml`` are written into ``out``. It takes minutes."""
    found: Json = json.loads(_native.calibrate(measured, out, list(effects), progress))
    return found
