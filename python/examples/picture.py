# %% [markdown]
# # A picture through a metalens
# A camera behind a small lens records a photograph, and the picture is restored from this frame alone. It is compared with the
# picture of an ideal camera.

# %%
import tempfile
from pathlib import Path

import matplotlib.image
import numpy as np
import numpy.typing as npt

import metalith as ml

root = next(p for p in (Path.cwd(), *Path.cwd().parents) if (p / "designs/mini_3x3.toml").is_file())
folder = Path(tempfile.mkdtemp())

# %% [markdown]
# The chip has one lens of 60 um: the design of nine with another array. The camera has 64 x 64 pixels of 2 um behind a narrow
# filter for green light.

# %%
CAMERA = """
schema = 1
name = "green"
[sensor]
pixel_um = 2.0
columns = 64
rows = 64
filter = "none"
bits = 12
full_well_e = 10000
read_noise_e = 2
gain_e = 2.5
[[channel]]
name = "green"
band_nm = [528, 532]
[exposure]
time_ms = "auto"
white = 0.8
[illuminant]
source = "equal_energy"
"""
(folder / "camera.toml").write_text(CAMERA)
nine = (root / "designs/mini_3x3.toml").read_text()
design = ml.Design.parse(nine.replace("elements = [3, 3]", "elements = [1, 1]"), root / "designs/mini_3x3.toml")
design.array().write(folder / "chip.oas")
design.plot()

# %% [markdown]
# The scene is a photograph of NASA in grey, in linear light: a scene counts photons. Each of its pixels is the mean of four by
# four.

# %%
figure = matplotlib.image.imread(root / "docs/photograph.png")
srgb = np.asarray(figure, dtype=np.float64)[32:232, 16:216, :3]
linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
scene = linear.reshape(50, 4, 50, 4, 3).mean(axis=(1, 3, 4))
system = ml.ImagingSystem(design, folder / "chip.oas", folder / "camera.toml", shape=scene.shape, field_deg=40)
frame = system.record(scene)
frame.plot()

# %% [markdown]
# The frame is blurred towards its edges, where light is oblique, and has the noise of the pixels. It is all that restorations
# know: `tikhonov` is the fastest method, `tv` takes the total variation as prior, and `prior` a network that has learnt photographs.

# %%
truth = system.truth(scene)
restored = {method: system.restore(frame, method) for method in ("tikhonov", "tv", "prior")}


def psnr_db(picture: npt.NDArray[np.float64]) -> float:
    """PSNR against the truth (dB), in linear light, white being 1."""
    return float(-10 * np.log10(np.mean((picture - truth) ** 2)))


for method, picture in restored.items():
    print(f"{method}: PSNR {psnr_db(picture):.1f} dB")
system.plot(truth=truth, **restored)

# %% [markdown]
# As a labelled array, the picture has the angles under which the chip sees its pixels.

# %%
error = abs(system.to_xarray(restored["tikhonov"]) - system.to_xarray(truth)).mean("colour")
axis = error.sel(y=slice(-0.1, 0.1)).mean("y")
print(f"mean error within {float(np.degrees(np.arctan(0.1))):.1f} degrees of the middle row {float(axis.mean()):.3f}")
assert psnr_db(restored["tikhonov"]) > psnr_db(np.full_like(truth, truth.mean())) + 3
