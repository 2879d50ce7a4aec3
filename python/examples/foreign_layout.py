# %% [markdown]
# # A layout from elsewhere
# Pillars that another program wrote (here KLayout): read, checked against design rules, simulated, and written again from
# arrays.

# %%
import tempfile
from pathlib import Path

import numpy as np
import numpy.typing as npt

import metalith as ml

folder = Path(tempfile.mkdtemp())
PITCH_NM = 350
SITES = 120
FOCUS_UM = 100.0

# %% [markdown]
# A lens whose widths follow a hyperbolic phase by a mapping of one's own.


# %%
def lens() -> npt.NDArray[np.uint16]:
    at_um = (np.arange(SITES) - 0.5 * (SITES - 1)) * PITCH_NM * 1e-3
    r2 = at_um[:, None] ** 2 + at_um[None, :] ** 2
    turns = -(np.sqrt(r2 + FOCUS_UM**2) - FOCUS_UM) / 0.55
    trial = np.arange(100, 300, 2)
    phase = np.angle(ml.cell(trial, [550.0])[:, 0]) / (2 * np.pi)
    # The width whose phase is nearest, on the circle.
    away = (turns[..., None] - phase + 0.5) % 1.0 - 0.5
    widths = trial[np.argmin(np.abs(away), axis=-1)]
    widths[r2 > at_um[-1] ** 2] = 0
    out: npt.NDArray[np.uint16] = widths.astype(np.uint16)
    return out


def drawn(of: npt.NDArray[np.uint16]) -> npt.NDArray[np.uint16]:
    """The part of a map that has pillars: a layout does not say how far its lattice goes on."""
    rows, columns = np.nonzero(of)
    return of[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]


widths = lens()

# %%
from klayout import db

foreign = db.Layout()
foreign.dbu = 0.001
top = foreign.create_cell("LENS")
layer = foreign.layer(1, 0)
# One cell for each width, placed as often as it is needed.
squares: dict[int, db.Cell] = {}
for iy, ix in np.argwhere(widths):
    width = int(widths[iy, ix])
    if width not in squares:
        squares[width] = foreign.create_cell(f"W{width}")
        squares[width].shapes(layer).insert(db.Box(-width // 2, -width // 2, width // 2, width // 2))
    x, y = (int((2 * k - SITES + 1) * PITCH_NM // 2) for k in (ix, iy))
    top.insert(db.CellInstArray(squares[width].cell_index(), db.Trans(x, y)))
foreign.write(str(folder / "foreign.gds"))

# %%
layout = ml.read_layout(folder / "foreign.gds")
print(layout)
assert layout.other_shapes == 0
assert layout.pillars == np.count_nonzero(widths)
assert np.array_equal(drawn(layout.widths[0]), drawn(widths))

# %% [markdown]
# Design rules: those that every layout of square pillars must keep, since no design is named.

# %%
report = ml.check(folder / "foreign.gds")
for rule in report.rules:
    if rule["violations"]:
        print(rule["id"], rule["violations"], rule["words"])
for row in report.table()[:3]:
    print(row)

# %%
for psf in ml.psf(layout, [530, 550, 570], distance_um=FOCUS_UM, pillar="sin_luke_2015", fast=True):
    print(f"{psf.wavelength_nm:g} nm: Strehl {psf.strehl:.3f}, peak at {psf.peak_um}")

# %% [markdown]
# Any map of widths becomes a layout, folded by the symmetries that it has.

# %%
array = ml.write_layout(folder / "again.oas", [widths, widths], pitch_nm=PITCH_NM, centres_nm=[(0, 0), (60_000, 0)])
again = ml.read_layout(folder / "again.oas")
assert again.pillars == 2 * layout.pillars
assert all(np.array_equal(drawn(w), drawn(widths)) for w in again.widths)
print(array, (folder / "again.oas").stat().st_size, "bytes")
