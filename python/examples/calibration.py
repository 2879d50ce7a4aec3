# %% [markdown]
# # Calibration of a set
# Eight measurements of two lenses, in two colours and at two distances: which effects tell what the bench saw from what was
# predicted? The set is a synthetic one, so the answer is known: its pillars are 8 nm too narrow, its sensor 5 um too far.

# %%
import tempfile
from pathlib import Path

import numpy as np

import metalith as ml

root = next(p for p in (Path.cwd(), *Path.cwd().parents) if (p / "golden/session").is_dir())
folder = root / "golden/session"
out = Path(tempfile.mkdtemp())
for file in sorted(folder.glob("*.npy"))[:2]:
    frame = np.load(file)
    print(file.name, frame.shape, f"{frame.min():.0f} to {frame.max():.0f} DN")

# %% [markdown]
# Four effects are tried here; left out, `effects` means all of them, which takes some ten minutes.

# %%
TRIED = ["cd_bias", "defocus", "pixel_blur", "zero_order"]
diagnosis = ml.calibrate(folder, out, effects=TRIED)
print(diagnosis)
for effect in diagnosis.effects:
    low, high = effect.interval
    print(f"{effect.name}: {effect.value:.2f} {effect.unit}, 95 % from {low:.2f} to {high:.2f}")

# %% [markdown]
# The error is the reduced chi-square per pixel: of measurements that the effects were fitted to, and of those that were held out.

# %%
for when, fitted, held_out in zip(("before", "after"), diagnosis.fitted, diagnosis.held_out, strict=True):
    print(f"{when}: fitted {fitted:.2f}, held out {held_out:.2f}")
assert sorted(e.name for e in diagnosis.effects) == ["cd_bias", "defocus"]
for name, truth in (("cd_bias", -8.0), ("defocus", 5.0)):
    found = diagnosis.effect(name)
    assert found is not None and found.interval[0] < truth < found.interval[1], (name, truth, found)
for tried in diagnosis.ranking:
    print(f"{tried.name}: {tried.rejected or 'taken'}")

# %% [markdown]
# `model.toml` is the chip as it was made. Verification judges by it what was built, and a layout can be compensated for it.

# %%
assert diagnosis.model is not None
print(diagnosis.model.read_text()[:400])
