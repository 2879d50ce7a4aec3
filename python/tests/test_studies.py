"""Studies: designs over a grid, from the file to the result."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

import metalith as ml

ROOT = Path(__file__).resolve().parents[2]

# One lens of 20 um, one wavelength, and white light: planned in seconds.
SMALL = {
    "diameter_um = 60": "diameter_um = 20",
    "focal_length_um = 144": "focal_length_um = 48",
    "elements = [3, 3]": "elements = [1, 1]",
    "wavelengths_nm = [455, 530, 660]": "wavelengths_nm = [660]",
    "field_x_deg = [0, 15]": "field_x_deg = [0]",
    "field_y_deg = [0, 0]": "field_y_deg = [0]",
    "window_samples = 128": "window_samples = 32",
    "width_step_nm = 2 ": "width_step_nm = 10 ",
}

TOLERANCE = """
schema = 1
design = "design.toml"
draws = 2
[[vary]]
effect = "defocus"
distribution = "uniform"
low = -4.0
high = 4.0
[[grid]]
key = "lens.focal_length_um"
values = [48, 40]
[[limit]]
figure = "strehl_660nm_0deg"
at_least = 0.01
"""


def test_designs_of_a_grid_are_told_by_their_values(tmp_path: Path) -> None:
    text = (ROOT / "designs/mini_3x3.toml").read_text()
    for was, small in SMALL.items():
        assert was in text, was
        text = text.replace(was, small)
    (tmp_path / "design.toml").write_text(text)
    (tmp_path / "tolerance.toml").write_text(TOLERANCE)
    study = ml.Study(tmp_path / "tolerance.toml", draws_per_shard=3)
    study.run()
    assert study.missing() == []
    result = study.result()
    assert [d["design"]["lens.focal_length_um"] for d in result.draws] == [48, 48, 40, 40]
    rows = result.table()
    assert [row["lens.focal_length_um"] for row in rows] == [48, 48, 40, 40]
    assert len({row["defocus"] for row in rows}) == 4
    assert [point["at"] for point in result.grid] == [[["lens.focal_length_um", f]] for f in (48, 40)]
    mean = result.grid[1]["figures"]["strehl_660nm_0deg"]["mean"]
    assert mean == pytest.approx(sum(row["strehl_660nm_0deg"] for row in rows[2:]) / 2)
    assert result.combinations == []
    labelled = result.to_xarray()
    assert dict(labelled.sizes) == {"lens.focal_length_um": 2} and list(labelled["lens.focal_length_um"].values) == [48, 40]
    assert float(labelled["strehl_660nm_0deg"].sel({"lens.focal_length_um": 40})) == mean
    draws = dataclasses.replace(result, grid=[]).to_xarray()
    assert list(draws["strehl_660nm_0deg"].values) == [row["strehl_660nm_0deg"] for row in rows]
    assert draws["defocus"].attrs["units"] == dict(result.quantities)["defocus"] == "um"
    assert "strehl_660nm_0deg" in result._repr_html_()


def test_a_grid_over_what_is_not_there_is_told_at_its_place(tmp_path: Path) -> None:
    (tmp_path / "design.toml").write_text((ROOT / "designs/mini_3x3.toml").read_text())
    wrong = TOLERANCE.replace("lens.focal_length_um", "lens.focal_lenght_um")
    (tmp_path / "tolerance.toml").write_text(wrong)
    with pytest.raises(ml.MetalithError, match=r"tolerance.toml:11:7: in design.toml, there is no `focal_lenght_um`"):
        ml.Study(tmp_path / "tolerance.toml").plan()
