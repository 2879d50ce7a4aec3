"""What a diagnosis is made of, for effects of one parameter and of two."""

from __future__ import annotations

from pathlib import Path

import pytest

from metalith._diagnosis import Diagnosis, _found, _ranked


def test_effects_have_values_and_intervals() -> None:
    told = {"name": "defocus", "value": 5.0, "unit": "um", "interval": [4.5, 5.5], "confounded_with": ["tilt"], "separate_by": None}
    defocus = _found(told)
    assert (defocus.value, defocus.interval) == (5.0, (4.5, 5.5))
    tilt = _found(told | {"name": "tilt", "value": [1.0, -2.0], "interval": [[0.5, 1.5], [-3.0, -1.0]], "unit": "mrad"})
    assert (tilt.values, tilt.intervals) == ((1.0, -2.0), ((0.5, 1.5), (-3.0, -1.0)))
    assert str(tilt) == "tilt = 1 (0.5 to 1.5), -2 (-3 to -1) mrad"


def test_a_diagnosis_shows_itself() -> None:
    told = {"name": "a<b", "value": 5.0, "unit": "um", "interval": [4.5, 5.5], "confounded_with": [], "separate_by": None}
    ranked = {"name": "defocus", "score": 0.5, "held_out_gain": None, "held_out_gain_interval": None, "rejected": "no gain"}
    diagnosis = Diagnosis(
        verdict="explained",
        effects=(_found(told),),
        ranking=(_ranked(ranked),),
        held_out=(150.0, 0.977),
        fitted=(152.0, 0.976),
        page=Path("report.html"),
        model=None,
        numbers={},
    )
    assert str(diagnosis).splitlines()[0] == "explained: held-out error 150 before, 0.977 after"
    assert "a&lt;b" in diagnosis._repr_html_() and "a<b" not in diagnosis._repr_html_()
    assert diagnosis.effect("a<b") is diagnosis.effects[0] and diagnosis.effect("defocus") is None
    assert diagnosis.ranking[0].gain is None
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    (axis,) = diagnosis.plot().axes
    assert [bar.get_width() for bar in axis.patches] == [0.5]
    assert [label.get_text() for label in axis.get_yticklabels()] == ["defocus"]
