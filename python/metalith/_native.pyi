"""Types of the native module. It is not called by hand: ``metalith`` is written on it."""

import os
from typing import Any, TypeAlias, final

import numpy as np
import numpy.typing as npt

from ._types import Bools, Complex64, Complex128, Float64, Int64, PathLike, Progress, Widths

__version__: str

ToldShape: TypeAlias = tuple[str, int, int, int]
"""Word, width and length (nm), rotations in half a turn."""

class MetalithError(Exception): ...

@final
class Design:
    @staticmethod
    def read(path: PathLike) -> Design: ...
    @staticmethod
    def parse(text: str, path: PathLike) -> Design: ...
    @staticmethod
    def lens(
        name: str,
        lens: tuple[float, float, float],
        words: list[str | None],
        cell: tuple[float | None, float | None, int | None, int | None],
        progress: Progress | None = None,
    ) -> tuple[Design, str]: ...
    @property
    def name(self) -> str: ...
    @property
    def title(self) -> str: ...
    @property
    def digest(self) -> str: ...
    @property
    def path(self) -> os.PathLike[str]: ...
    @property
    def pitch_nm(self) -> int: ...
    @property
    def lattice(self) -> str: ...
    @property
    def sites(self) -> int: ...
    @property
    def shape(self) -> ToldShape: ...
    @property
    def pillar_height_nm(self) -> float: ...
    @property
    def diameter_um(self) -> float: ...
    @property
    def focal_length_um(self) -> float: ...
    @property
    def wavelengths_nm(self) -> list[float]: ...
    @property
    def elements(self) -> list[tuple[tuple[int, int], tuple[float, float]]]: ...
    def array(self, progress: Progress | None = None) -> Array: ...

@final
class Array:
    @property
    def pillars(self) -> int: ...
    @property
    def pitch_nm(self) -> int: ...
    @property
    def lattice(self) -> str: ...
    @property
    def sites(self) -> int: ...
    @property
    def shape(self) -> ToldShape: ...
    @property
    def elements(self) -> list[tuple[str, tuple[int, int], int]]: ...
    def widths(self, element: int) -> Widths: ...
    def write(
        self,
        path: PathLike,
        hierarchy: str | None = None,
        layer: tuple[int, int] = (1, 0),
        progress: Progress | None = None,
    ) -> int: ...

def main(arguments: list[str]) -> int: ...
def read_layout(
    path: PathLike,
    layer: tuple[int, int] | None = None,
    top: str | None = None,
    design: Design | None = None,
    array: Array | None = None,
    progress: Progress | None = None,
) -> tuple[list[str], list[tuple[int, int]], list[Widths], int, str, int, int, str, ToldShape]: ...
def array_of_widths(
    widths: list[Widths],
    pitch_nm: int,
    lattice: str,
    centres_nm: list[tuple[int, int]],
    shape: ToldShape,
    progress: Progress | None = None,
) -> Array: ...
def array_of_design(widths: list[Widths], design: Design, progress: Progress | None = None) -> Array: ...
def places(sites: int, pitch_nm: int, lattice: str) -> tuple[Int64, Int64, Bools]: ...
def rotation_numbers(rotations_deg: Float64, width_nm: int, length_nm: int, steps: int) -> Widths: ...
def rotations_deg(numbers: Widths, width_nm: int, length_nm: int, steps: int) -> Float64: ...
def upright_numbers(widths_x: Widths, widths_y: Widths, shortest_nm: int, step_nm: int, lengths: int) -> Widths: ...
def upright_widths(numbers: Widths, shortest_nm: int, step_nm: int, lengths: int) -> tuple[Widths, Widths]: ...
def psf_of_array(
    array: Array,
    wavelengths_nm: list[float],
    fields_deg: list[tuple[float, float]],
    fidelity: str | None,
    model: PathLike | None,
    fast: bool,
    samples: int | None,
    pixel_um: float | None,
    elements: list[int] | None = None,
    through_focus: tuple[float | None, int] | None = None,
    progress: Progress | None = None,
) -> tuple[list[dict[str, Any]], str | None]: ...
def psf_of_widths(
    widths: list[Widths],
    names: list[str],
    centres_nm: list[tuple[int, int]],
    pitch_nm: int,
    lattice: str,
    wavelengths_nm: list[float],
    fields_deg: list[tuple[float, float]],
    distance_um: float,
    fidelity: str | None,
    model: PathLike | None,
    aperture_um: float | None,
    fast: bool,
    samples: int,
    pixel_um: float | None,
    shape: ToldShape,
    arriving: str | None,
    analyser: str | None,
    height_nm: float,
    pillar: str,
    substrate: str,
    through_focus: tuple[float | None, int] | None = None,
    progress: Progress | None = None,
) -> tuple[list[dict[str, Any]], str | None]: ...
def propagate(
    aperture: Complex128,
    pitch_nm: int,
    lattice: str,
    wavelength_nm: float,
    distance_um: float,
    at_um: tuple[float, float],
    samples: int,
    step_um: float | None,
    incidence_deg: tuple[float, float],
    fast: bool,
    direct: bool,
    progress: Progress | None = None,
) -> tuple[Complex64, Float64, Float64]: ...
def cell(
    widths_nm: Float64,
    wavelengths_nm: Float64,
    pitch_nm: float,
    lattice: str,
    shape: ToldShape,
    height_nm: float,
    pillar: str,
    substrate: str,
    orders: int,
    progress: Progress | None = None,
) -> Complex128: ...
def index(material: str, wavelengths_nm: Float64) -> Complex128: ...
@final
class PsfPullback: ...

@final
class PsfModel:
    @staticmethod
    def plan(
        amplitude: npt.NDArray[np.float32],
        pitch_nm: int,
        lattice: str,
        wavelength_nm: float,
        distance_um: float,
        at_um: tuple[float, float],
        samples: int,
        step_um: float,
        fast: bool,
        curve: tuple[Float64, Complex128] | None,
    ) -> PsfModel: ...
    def places(self) -> tuple[Float64, Float64]: ...
    def psf(
        self, given: Float64, wedge_sin: tuple[float, float], distance_um: float, along_z: bool
    ) -> tuple[Float64, PsfPullback]: ...
    def pull(self, pullback: PsfPullback, cotangents: Float64) -> tuple[Float64, tuple[float, float], float | None]: ...

def curve_of(
    design: Design, wavelength_nm: float, fidelity: str, progress: Progress | None = None
) -> tuple[Float64, Complex128]: ...
def widths_of(phases_rad: Float64, design: Design, element: int | None = None) -> Widths: ...
def phases_of(widths: Widths, design: Design, element: int | None = None) -> tuple[Float64, int | None, list[int]]: ...
def check(
    layout: PathLike,
    rules: PathLike | None = None,
    design: Design | None = None,
    with_layouts: list[PathLike] = ...,
    waivers: PathLike | None = None,
    markers: int = 100,
    progress: Progress | None = None,
    layer: tuple[int, int] | None = None,
    top: str | None = None,
) -> tuple[str, bool]: ...
def verify(
    design: Design,
    layout: PathLike,
    fast: bool = False,
    model: PathLike | None = None,
    out: PathLike | None = None,
    progress: Progress | None = None,
    layer: tuple[int, int] | None = None,
    top: str | None = None,
) -> tuple[str, bool]: ...
def calibrate(
    set: PathLike,
    out: PathLike,
    effects: list[str] = ...,
    progress: Progress | None = None,
    layer: tuple[int, int] | None = None,
    top: str | None = None,
) -> str: ...
def plan(
    design: Design,
    bench: PathLike,
    out: PathLike,
    layout: PathLike | None = None,
    effects: list[str] = ...,
    progress: Progress | None = None,
    layer: tuple[int, int] | None = None,
    top: str | None = None,
) -> tuple[str, bool, str]: ...
def study_plan(
    tolerance: PathLike,
    folder: PathLike,
    draws_per_shard: int | None = None,
    progress: Progress | None = None,
    layer: tuple[int, int] | None = None,
    top: str | None = None,
) -> str: ...
def study_status(folder: PathLike) -> str: ...
def study_run(folder: PathLike, shard: int, progress: Progress | None = None) -> None: ...
def study_merge(
    folder: PathLike,
    out: PathLike | None = None,
    psfs: int = 0,
    progress: Progress | None = None,
) -> str: ...

@final
class Frame:
    @property
    def planes(self) -> list[npt.NDArray[np.float32]]: ...
    @property
    def saturated(self) -> int: ...

@final
class ImagingSystem:
    @staticmethod
    def open(
        design: Design,
        layout: PathLike,
        camera: PathLike,
        rows: int,
        columns: int,
        field_deg: float,
        distance_mm: float | None = None,
        model: PathLike | None = None,
        prior: PathLike | None = None,
        lux: float | None = None,
        time_ms: float | None = None,
        longest_ms: float | None = None,
        progress: Progress | None = None,
    ) -> ImagingSystem: ...
    def record(self, scene: Float64, seed: int = 1, progress: Progress | None = None) -> Frame: ...
    def frame(self, planes: list[npt.NDArray[np.float32]]) -> Frame: ...
    def truth(self, scene: Float64) -> Float64: ...
    def restore(
        self, frame: Frame, method: str = "tikhonov", joint: bool = True, progress: Progress | None = None
    ) -> Float64: ...
    def samples(self, frame: Frame, count: int, progress: Progress | None = None) -> list[Float64]: ...
    def kernels(
        self, element: int, step: int
    ) -> tuple[npt.NDArray[np.float32], list[float], list[float], list[tuple[str, float]]]: ...

def denoise(
    values: npt.NDArray[np.float32], deviation: npt.NDArray[np.float32], weights: PathLike | None = None
) -> npt.NDArray[np.float32]: ...
