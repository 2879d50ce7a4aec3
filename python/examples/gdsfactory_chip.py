"""From nothing to a checked chip: phases that scipy optimises for two spots, pillars, gdsfactory, design rules, light."""

import tempfile
from pathlib import Path

import gdsfactory as gf
import numpy as np
import numpy.typing as npt

import metalith as ml
import metalith.gdsfactory
import metalith.scipy

design = ml.Design.lens(wavelength_nm=633, focal_length_um=100, diameter_um=40)
model = ml.PsfModel.of_design(design, samples=48)
spots = [np.hypot.outer(model.y_um, model.x_um - x) <= 1.5 for x in (-4.0, 4.0)]


def merit(psf: npt.NDArray[np.float64]) -> tuple[float, npt.NDArray[np.float64]]:
    """Two equal spots: minus the logarithms of their light, and the derivatives by the PSF."""
    left, right = (psf[spot].sum() for spot in spots)
    return -np.log(left * right), -(spots[0] / left + spots[1] / right)


start = np.random.default_rng(1).uniform(0, 2 * np.pi, model.amplitude.shape)
phases = metalith.scipy.minimize(model, merit, start, options={"maxiter": 30}).x
widths = ml.widths_of(np.where(model.amplitude > 0, phases, np.nan), design)

gf.gpdk.PDK.activate()
array = ml.Array.of_maps(widths, design=design)
component = metalith.gdsfactory.component(array, name="two_spots")
chip = gf.Component(name="chip")
chip.add_ref(component).move((200, 100))
chip.add_ref(gf.components.rectangle(size=(800, 600), layer=(10, 0), centered=True))
path = chip.write_gds(Path(tempfile.mkdtemp()) / "chip.gds")
clean = ml.check(path).clean
read = ml.read_layout(path, top=component.name, array=array)
psf = ml.psf(read, [633], distance_um=100, pillar="sin_luke_2015", pillar_height_nm=design.pillar_height_nm, samples=48)[0]
print("light in the spots:", [f"{psf.values[spot].sum() / psf.values.sum():.2f}" for spot in spots])
assert clean and np.array_equal(read.widths[0], widths)
