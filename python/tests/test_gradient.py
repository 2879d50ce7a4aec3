"""PSFs with their derivatives against difference quotients, through each of the packages that people optimise with; and the mapping
from phases to pillars and back."""

from __future__ import annotations

import copy
import importlib
import importlib.util
import multiprocessing
import pickle
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import metalith as ml
import metalith.jax
import metalith.scipy
import metalith.torch
from calls import MINI, small_design

# Agreement of derivatives with difference quotients, over their size.
QUOTIENT = 1e-4
# Fields are computed in single precision.
SINGLE = 1e-5

SITES = 24
ARGUMENTS: dict[str, Any] = dict(pitch_nm=350, wavelength_nm=550, distance_um=30.0, samples=20, at_um=(1.0, -2.0), step_um=0.3)
WIDTHS = np.arange(100.0, 301.0, 10.0)
CELL = (WIDTHS, (0.95 - 0.001 * WIDTHS) * np.exp(0.03j * WIDTHS))

Array = npt.NDArray[np.float64]


@pytest.fixture(scope="module")
def model() -> ml.PsfModel:
    return ml.PsfModel(SITES, **ARGUMENTS)


@pytest.fixture(scope="module")
def phase() -> Array:
    found: Array = np.random.default_rng(60).uniform(0.0, 2.0 * np.pi, (SITES, SITES))
    return found


@pytest.fixture(scope="module")
def weights() -> Array:
    found: Array = np.random.default_rng(61).random((20, 20))
    return found


def quotient(of: Callable[[float], float], step: float) -> float:
    """A derivative at zero, by the quotient whose error falls with the fourth power of the step."""
    near, far = ((of(h) - of(-h)) / (2 * h) for h in (step, 2 * step))
    return (4 * near - far) / 3


def is_near(found: float, wanted: float) -> bool:
    return abs(found - wanted) < QUOTIENT * abs(wanted)


def test_the_psf_is_the_field_of_propagate(model: ml.PsfModel, phase: Array) -> None:
    aperture = model.amplitude * np.exp(1j * phase)
    lit = {k: v for k, v in ARGUMENTS.items()}
    field, x_um, y_um = ml.propagate(aperture, **lit)
    wanted = np.abs(field.astype(complex)) ** 2
    found = model(phase)
    assert found.shape == (20, 20) and found.dtype == np.float64
    assert np.abs(found - wanted).max() < SINGLE * model(np.zeros((SITES, SITES))).max() + SINGLE * wanted.max()
    assert np.array_equal(x_um, model.x_um) and np.array_equal(y_um, model.y_um)


def test_derivatives_by_phases_wedge_and_distance(model: ml.PsfModel, phase: Array, weights: Array) -> None:
    # In the middle of the distances that have one plan of the propagator.
    place: dict[str, Any] = dict(distance_um=30.08, wedge_deg=(3.0, -1.0))
    value, found = model.value_and_gradient(weights, phase, **place)
    assert value == pytest.approx(float((model(phase, **place) * weights).sum()))

    def of(phase: Array = phase, **changed: Any) -> float:
        return float((model(phase, **{**place, **changed}) * weights).sum())

    norm = float(np.linalg.norm(found.map))
    assert is_near(norm, quotient(lambda h: of(phase + found.map * (h / norm)), 0.02))
    assert found.distance_um is not None
    assert is_near(found.distance_um, quotient(lambda h: of(distance_um=30.08 + h), 0.03))
    assert is_near(found.wedge_deg[0], quotient(lambda h: of(wedge_deg=(3.0 + h, -1.0)), 0.02))
    assert is_near(found.wedge_deg[1], quotient(lambda h: of(wedge_deg=(3.0, -1.0 + h)), 0.02))
    # The corners are outside of the circle.
    assert found.map[0, 0] == 0 and model.value_and_gradient(weights, phase)[1].distance_um is None


def test_derivatives_are_as_large_as_those_of_the_merit(model: ml.PsfModel, phase: Array, weights: Array) -> None:
    _, pull = model.vjp(phase)
    wanted = pull(weights).map
    for factor in (2.0**-900, 2.0**900, 0.0):
        assert np.array_equal(pull(weights * factor).map, wanted * factor)
    with pytest.raises(ml.MetalithError, match="cotangents"):
        pull(weights[1:])


def test_derivatives_by_widths(weights: Array) -> None:
    model = ml.PsfModel(SITES, cell=CELL, **ARGUMENTS)
    widths = np.random.default_rng(62).uniform(120.0, 280.0, (SITES, SITES))
    _, found = model.value_and_gradient(lambda psf: (float((psf**2 * weights).sum()), 2 * psf * weights), widths)
    norm = float(np.linalg.norm(found.map))

    def along(h: float) -> float:
        return float((model(widths + found.map * (h / norm)) ** 2 * weights).sum())

    assert is_near(norm, quotient(along, 2.0))
    widths[4, 5] = 301.0
    with pytest.raises(ml.MetalithError, match="301 nm wide at row 4, column 5"):
        model(widths)


def test_the_model_of_a_design_is_its_psf(tmp_path: Any) -> None:
    design = ml.Design.read(small_design(tmp_path))
    array = design.array()
    # Drawn widths are those that were solved: nothing is interpolated.
    model = ml.PsfModel.of_design(design, variable="width", fidelity="fitted", samples=32, at_um=(0.0, 0.0))
    widths = array.widths(0).astype(float)
    assert np.array_equal(model.amplitude > 0, widths > 0)
    wanted = ml.psf(array, [660], fidelity="fitted", samples=32)[0]
    # Here the window of the design is sampled at every pitch.
    assert np.array_equal(wanted.x_um, model.x_um)
    found = model(np.where(widths > 0, widths, np.nan))
    assert np.abs(found - wanted.values).max() < SINGLE * wanted.values.max()
    half = ml.PsfModel.of_design(design, amplitude=np.ones(widths.shape), fast=True)
    assert half.variable == "phase" and half.amplitude.all()


def test_copies_are_equal(model: ml.PsfModel, phase: Array) -> None:
    for other in (copy.deepcopy(model), pickle.loads(pickle.dumps(model))):
        assert np.array_equal(other(phase), model(phase)) and repr(other) == repr(model)


def test_scipy_makes_a_lens_out_of_noise(model: ml.PsfModel, phase: Array) -> None:
    pytest.importorskip("scipy")
    focus = np.zeros((20, 20))
    focus[10, 10] = -1.0
    start = np.random.default_rng(1).uniform(0.0, 2.0 * np.pi, (SITES, SITES))
    found = metalith.scipy.minimize(model, focus, start, options={"maxiter": 40})
    x, y = model.x_um[10], model.y_um[10]
    at = ml.places(SITES, pitch_nm=350)
    path = np.sqrt((at.x_nm * 1e-3 - x) ** 2 + (at.y_nm[:, None] * 1e-3 - y) ** 2 + 900.0)
    ideal = model(-2.0 * np.pi / 0.55 * path)[10, 10]
    assert found.x.shape == found.jac.shape == (SITES, SITES)
    # The best phase at one point brings all pillars into step: the ideal lens is that of Fermat's principle.
    assert -found.fun > 0.999 * ideal


def torch_finds_the_same(model: ml.PsfModel, phase: Array, weights: Array) -> None:
    torch: Any = importlib.import_module("torch")
    place: dict[str, Any] = dict(distance_um=30.5, wedge_deg=(3.0, -1.0))
    x = torch.tensor(phase, requires_grad=True)
    distance = torch.tensor(30.5, dtype=torch.float64, requires_grad=True)
    wedge = torch.tensor([3.0, -1.0], dtype=torch.float64, requires_grad=True)
    value = (metalith.torch.psf(model, x, distance, wedge) * torch.tensor(weights)).sum()
    value.backward()
    wanted, found = model.value_and_gradient(weights, phase, **place)
    assert float(value.detach()) == pytest.approx(wanted)
    assert np.array_equal(x.grad.numpy(), found.map)
    assert float(distance.grad) == found.distance_um and tuple(wedge.grad.tolist()) == found.wedge_deg
    # A number for the distance, single precision, and nothing that is to be derived.
    half = torch.tensor(phase, dtype=torch.float32, requires_grad=True)
    metalith.torch.psf(model, half, 30.5).sum().backward()
    assert half.grad.dtype == torch.float32
    assert metalith.torch.psf(model, half.detach()).requires_grad is False


def jax_finds_the_same(model: ml.PsfModel, phase: Array, weights: Array) -> None:
    jax: Any = importlib.import_module("jax")
    psf = metalith.jax.psf(model)

    def merit(x: Any, distance: Any, wedge: Any) -> Any:
        return (psf(x, distance, wedge) * weights).sum()

    single = phase.astype(np.float32)
    found = jax.jit(jax.value_and_grad(merit, argnums=(0, 1, 2)))(single, 30.5, np.array([3.0, -1.0], np.float32))
    wanted, by = model.value_and_gradient(weights, single, distance_um=30.5, wedge_deg=(3.0, -1.0))
    value, (by_map, by_distance, by_wedge) = found
    assert float(value) == pytest.approx(wanted, rel=SINGLE)
    assert np.abs(by_map - by.map).max() < SINGLE * np.abs(by.map).max()
    assert float(by_distance) == pytest.approx(by.distance_um, rel=QUOTIENT)
    assert np.allclose(by_wedge, by.wedge_deg, rtol=QUOTIENT)
    # Several lenses at once, at the distance of the model.
    both = jax.vmap(psf)(np.stack([single, single[::-1]]))
    assert both.shape == (2, 20, 20)
    assert np.allclose(both[1], model(single[::-1]), rtol=SINGLE, atol=SINGLE * float(both.max()))


@pytest.mark.parametrize(("package", "compared"), [("torch", torch_finds_the_same), ("jax", jax_finds_the_same)])
def test_other_packages_find_the_same(
    package: str, compared: Callable[..., None], model: ml.PsfModel, phase: Array, weights: Array
) -> None:
    if importlib.util.find_spec(package) is None:
        pytest.skip(f"{package} is not installed")
    # In a process of its own: these packages start threads, and other tests fork this one.
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        pool.submit(compared, model, phase, weights).result()


def test_phases_and_widths_are_mapped_to_one_another() -> None:
    design = ml.Design.read(MINI)
    array = design.array()
    widths = array.widths(4)
    phases = ml.phases_of(widths, design)
    assert phases.shape == widths.shape and np.array_equal(np.isnan(phases), widths == 0)
    assert np.array_equal(ml.widths_of(phases, design), widths)
    assert np.array_equal(ml.widths_of(phases + 4 * np.pi, design, element=4), widths)
    with pytest.raises(ml.MetalithError, match=r"40 at \(1,\) is of no phase"):
        ml.phases_of([200, 40], design)
    with pytest.raises(ml.MetalithError, match="phase_rad"):
        ml.widths_of([np.inf], design)
    with pytest.raises(ml.MetalithError, match="no element 9"):
        ml.widths_of([0.0], design, element=9)


def test_a_merit_that_is_no_number_is_refused() -> None:
    model = ml.PsfModel(SITES, **ARGUMENTS)
    phases = np.zeros((SITES, SITES))
    merits: list[Any] = [lambda psf: (np.nan, psf), lambda psf: (0.0, np.full_like(psf, np.inf))]
    for merit in merits:
        with pytest.raises(ml.MetalithError, match="finite"):
            model.value_and_gradient(merit, phases)
