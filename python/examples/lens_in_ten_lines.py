# %% [markdown]
# # A lens in ten lines
# From a design file to a layout, back from its bytes, and to the light it makes.

# %%
import tempfile
from pathlib import Path

import numpy as np

import metalith as ml

root = next(p for p in (Path.cwd(), *Path.cwd().parents) if (p / "designs/mini_3x3.toml").is_file())
folder = Path(tempfile.mkdtemp())

# %%
design = ml.Design.read(root / "designs/mini_3x3.toml")
array = design.array()
array.write(folder / "chip.oas")
layout = ml.read_layout(folder / "chip.oas")
widths = layout.widths[0]
psfs = ml.psf(array, wavelengths_nm=[455, 530, 660], field_deg=[(0, 0), (15, 0)], elements=[4], fast=True)
for psf in psfs:
    print(f"{psf.wavelength_nm:g} nm, {psf.field_deg[0]:g} deg: Strehl {psf.strehl:.3f}")

# %% [markdown]
# Figures and labelled arrays are of matplotlib and xarray, which are imported when they are asked for.

# %%
psfs.plot(columns=2)
print(psfs.to_xarray().max(["x", "y"]).squeeze().values.round(1))

# %% [markdown]
# What was read is what was meant, pillar by pillar.

# %%
assert layout.pillars == array.pillars
assert widths.dtype == np.uint16
# Elements of a file are found from the lower left; those of a design are in its own order.
for centre, found in zip(layout.centres_nm, layout.widths):
    assert np.array_equal(found, array.widths(array.centres_nm.index(centre)))

# %% [markdown]
# The cell of the pillars, over width and wavelength, and the same lens by a propagation of one's own.

# %%
drawn = np.unique(array.widths(4))[1:]
ml.cell(drawn, [455.0]).plot()
t = ml.cell(drawn, [530.0])[:, 0]
table = np.zeros(int(drawn[-1]) + 1, dtype=complex)
table[drawn] = t
field, x_um, y_um = ml.propagate(
    table[array.widths(4)], pitch_nm=350, wavelength_nm=530, distance_um=design.focal_length_um, samples=64
)
own = np.abs(field) ** 2
middle = psfs[2]
print(f"peak {own.max():.1f}, of the library {middle.values.max():.1f}")
# The library solves its cells with more orders, and a narrow resonance of one width moves with them.
assert abs(own.max() / middle.values.max() - 1) < 0.1
