# %% [markdown]
# # A lens out of noise
# The PSF of a lens is a differentiable function of the phases of its pillars. An optimiser of scipy starts from random phases
# and finds a lens, which becomes pillars and a layout. The same function has adapters for PyTorch (`metalith.torch`) and
# JAX (`metalith.jax`).

# %%
import tempfile
from pathlib import Path

import numpy as np

import metalith as ml
import metalith.scipy

root = next(p for p in (Path.cwd(), *Path.cwd().parents) if (p / "designs/mini_3x3.toml").is_file())
design = ml.Design.read(root / "designs/mini_3x3.toml")
wavelength_nm = 530.0
model = ml.PsfModel.of_design(design, wavelength_nm, samples=32)
print(model, f"at {model.distance_um:g} um")

# %% [markdown]
# The merit is the light within 1 um of the axis, over that of the ideal lens: the lens of Fermat's principle, which brings all
# light there in phase. An optimiser lowers its function, so the weights are negative.

# %%
inside = np.hypot.outer(model.y_um, model.x_um) <= 1.0
at = ml.places(model.sites, pitch_nm=design.pitch_nm)
path_um = np.sqrt(np.add.outer((at.y_nm * 1e-3) ** 2, (at.x_nm * 1e-3) ** 2) + model.distance_um**2)
ideal = model(-2 * np.pi / (wavelength_nm * 1e-3) * path_um)
weights = -1.0 * inside / ideal[inside].sum()
noise = np.random.default_rng(60).uniform(0, 2 * np.pi, (model.sites, model.sites))
print(f"noise {-(model(noise) * weights).sum():.4f}")

# %%
found = metalith.scipy.minimize(model, weights, noise, options={"maxiter": 60})
print(f"after {found.nfev} PSFs with their gradients {-found.fun:.4f}")
assert -found.fun > 0.98

# %% [markdown]
# The gradient is that of a difference quotient, here along itself.

# %%
value, gradient = model.value_and_gradient(weights, noise)
norm = np.linalg.norm(gradient.map)
step = gradient.map / norm * 0.1
quotient = ((model(noise + step) - model(noise - step)) * weights).sum() / 0.2
print(f"gradient {norm:.4e}, quotient {quotient:.4e}")
assert abs(quotient / norm - 1) < 1e-3

# %% [markdown]
# Pillars by the mapping of the design, written as a layout and simulated with the rigorous cell.

# %%
phases = np.where(model.amplitude > 0, found.x, np.nan)
widths = ml.widths_of(phases, design)
folder = Path(tempfile.mkdtemp())
array = ml.write_layout(folder / "lens.oas", widths, pitch_nm=design.pitch_nm)
psf = ml.psf(array, [wavelength_nm], distance_um=model.distance_um, pillar="sin_luke_2015", fast=True)[0]
print(f"{array.pillars} pillars, Strehl {psf.strehl:.3f}")
