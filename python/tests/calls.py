"""Every function of the native module, called as the package calls it, on the smallest chips: what other tests repeat in child
processes and in threads."""

from __future__ import annotations

import itertools
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

import metalith as ml
from metalith import _native

ROOT = Path(__file__).resolve().parents[2]
MINI = ROOT / "designs/mini_3x3.toml"
SHAPE = (24, 24)
PILLARS = np.full((8, 8), 200, dtype=np.uint16)
MAP: dict[str, Any] = dict(pitch_nm=350, distance_um=20.0, samples=16, fast=True, pillar="sin_luke_2015")
LIT: dict[str, Any] = dict(pitch_nm=350, wavelength_nm=660, distance_um=20)
RECTANGLES = ml.Rectangles(100, 250, 90)
UPRIGHT = ml.UprightRectangles(90, 10, 4)

# One lens of 20 um and one wavelength.
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

def camera(pixels: int, band_nm: tuple[int, int]) -> str:
    """A camera file: a square sensor of pixels of 2 um without filters, in one band."""
    return f"""
schema = 1
name = "small"
[sensor]
pixel_um = 2.0
columns = {pixels}
rows = {pixels}
filter = "none"
bits = 12
full_well_e = 10000
read_noise_e = 2
gain_e = 2.5
[[channel]]
name = "green"
band_nm = {list(band_nm)}
[exposure]
time_ms = "auto"
white = 0.8
[illuminant]
source = "equal_energy"
"""


def small_design(folder: Path) -> Path:
    """The design of one small lens, as a file."""
    text = MINI.read_text()
    for was, small in SMALL.items():
        assert was in text, was
        text = text.replace(was, small)
    path = folder / "design.toml"
    path.write_text(text)
    return path


def words(call: Callable[[], object]) -> str:
    """What a call that is refused says."""
    try:
        call()
    except ml.MetalithError as error:
        return str(error)
    raise AssertionError("it is not refused")


class Calls:
    """The functions by name, each with an answer that can be compared."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.design = ml.Design.read(small_design(folder))
        self.array = self.design.array()
        self.chip = folder / "chip.oas"
        self.array.write(self.chip)
        (folder / "small.toml").write_text(camera(40, (655, 665)))
        self.scene: npt.NDArray[np.float64] = np.random.default_rng(3).random((*SHAPE, 3))
        self.system = self.open()
        self.frame = self.system.record(self.scene)
        self._numbers = itertools.count()
        self.model = ml.PsfModel(8, samples=16, **LIT)

    def open(self) -> ml.ImagingSystem:
        return ml.ImagingSystem(self.design, self.chip, self.folder / "small.toml", shape=SHAPE, field_deg=20.0)

    def new(self, ending: str) -> Path:
        """A name that no other call has, in a process or another."""
        return self.folder / f"{os.getpid()}_{next(self._numbers)}{ending}"

    def written(self) -> bytes:
        path = self.new(".gds")
        ml.write_layout(path, PILLARS, pitch_nm=350)
        return path.read_bytes()

    def all(self) -> dict[str, Callable[[], Any]]:
        turns = np.linspace(0.0, 179.0, 5)
        missing = self.folder / "nothing.toml"
        noise = np.full((8, 8), 0.1)
        return {
            "Design.read": lambda: ml.Design.read(self.folder / "design.toml").digest,
            "Design.parse": lambda: ml.Design.parse(MINI.read_text(), MINI).digest,
            "Design.lens": lambda: ml.Design.lens(wavelength_nm=660, focal_length_um=40, diameter_um=20, pitch_nm=380, pillar_height_nm=900).digest,
            "Design.array": lambda: self.design.array().pillars,
            "Array.widths": lambda: self.array.widths(0),
            "Array.write": lambda: self.array.write(self.new(".oas")),
            "array_of_widths": self.written,
            "array_of_design": lambda: ml.Array.of_maps([self.array.widths(k) for k in range(len(self.array))], design=self.design).widths(0),
            "read_layout": lambda: ml.read_layout(self.chip).widths[0],
            "places": lambda: ml.places(5, pitch_nm=350).x_nm,
            "rotation_numbers": lambda: RECTANGLES.numbers(turns),
            "rotations_deg": lambda: RECTANGLES.rotations_deg([0, 1, 90]),
            "upright_numbers": lambda: UPRIGHT.numbers([0, 90], [0, 120]),
            "upright_widths": lambda: UPRIGHT.widths_nm([0, 1, 16])[1],
            "psf_of_array": lambda: ml.psf(self.array, [660], fast=True, samples=16)[0].values,
            "psf_of_widths": lambda: ml.psf(PILLARS, [660], **MAP)[0].values,
            "propagate": lambda: ml.propagate(
                PILLARS, pitch_nm=350, wavelength_nm=660, distance_um=20, samples=8
            )[0],
            "cell": lambda: np.asarray(ml.cell([150.0, 200.0], [600.0, 660.0], orders=5)),
            "index": lambda: ml.index("fused_silica_malitson_1965", [600.0]),
            "PsfModel.plan": lambda: ml.PsfModel(8, samples=8, **LIT)(PILLARS),
            "PsfModel.places": lambda: self.model.x_um,
            "PsfModel.psf": lambda: self.model(PILLARS),
            "PsfModel.pull": lambda: self.model.vjp(PILLARS)[1](np.ones((16, 16))).map,
            "curve_of": lambda: _native.curve_of(self.design._native, 660.0, "published")[1],
            "widths_of": lambda: ml.widths_of(turns, self.design),
            "phases_of": lambda: ml.phases_of(self.array.widths(0), self.design),
            "check": lambda: ml.check(self.chip, design=self.design).numbers,
            "verify": lambda: ml.verify(self.design, self.chip, fast=True).checks,
            # These take minutes: their refusals come from the same threads.
            "calibrate": lambda: words(lambda: ml.calibrate(missing, self.new(".out"))),
            "plan": lambda: words(lambda: ml.plan(self.design, missing, self.folder / "plan")),
            "study_plan": lambda: words(lambda: ml.Study(missing).plan()),
            "study_status": lambda: words(lambda: _native.study_status(missing)),
            "study_run": lambda: words(lambda: _native.study_run(missing, 0)),
            "study_merge": lambda: words(lambda: ml.Study(missing).result()),
            "ImagingSystem.open": lambda: self.open().truth(self.scene),
            "ImagingSystem.record": lambda: self.system.record(self.scene).planes[0],
            "ImagingSystem.frame": lambda: self.system.frame(self.frame.planes).planes[0],
            "ImagingSystem.truth": lambda: self.system.truth(self.scene),
            "ImagingSystem.restore": lambda: self.system.restore(self.frame),
            "ImagingSystem.samples": lambda: self.system.samples(self.frame, 1)[0],
            "ImagingSystem.kernels": lambda: self.system.kernels(step=8).values,
            "denoise": lambda: ml.denoise(noise, 0.1),
        }

    def answers(self) -> dict[str, str]:
        """All of them, one after the other."""
        return {name: told(call()) for name, call in self.all().items()}


def told(answer: Any) -> str:
    """An answer as a text: equal answers, and those alone, are the same."""
    if isinstance(answer, np.ndarray):
        return f"{answer.dtype}{answer.shape}{answer.tobytes().hex()}"
    return answer.hex() if isinstance(answer, bytes) else json.dumps(answer)


def native_names() -> set[str]:
    """Functions and methods of the native module; attributes hold nothing that is computed."""
    found: set[str] = set()
    for name, value in vars(_native).items():
        if isinstance(value, type) and not issubclass(value, Exception):
            found |= {f"{name}.{own}" for own in vars(value) if callable(getattr(value, own)) and own[0] != "_"}
        elif callable(value) and not isinstance(value, type):
            found.add(name)
    # The program: a process of its own.
    return found - {"main"}
