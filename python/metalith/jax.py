"""PSFs in JAX: :func:`psf` gives a function that is differentiable by ``jax.grad`` in phases or widths, distance and wedge.

It needs the package ``jax`` (``pip install jax``), which is imported at the first call."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._figures import imported
from ._gradient import PsfModel, pair_of


def psf(model: PsfModel) -> Any:
    """A function ``f(x, distance_um=None, wedge_deg=None)`` of JAX arrays that gives the PSF, shape ``[samples, samples]``, of
    the type of ``x``.

    ``x``: shape ``[sites, sites]``, phases (rad) or widths (nm) as the model takes them. ``distance_um``: one number, left out
    that of the model. ``wedge_deg``: two numbers, left out zero. The function works under ``jax.jit``, ``jax.vmap`` and
    ``jax.grad`` in reverse mode, once: there are no second derivatives. It calls back to the processor, where the PSF is
    computed once more for its derivatives."""
    jax = imported("jax")
    jnp = imported("jax.numpy")

    def values(x: Any, distance_um: Any, wedge_deg: Any) -> Any:
        found = model(x, distance_um=float(distance_um), wedge_deg=pair_of(wedge_deg))
        return found.astype(x.dtype)

    def derivatives(x: Any, distance_um: Any, wedge_deg: Any, cotangents: Any) -> Any:
        _, pull = model.vjp(x, distance_um=float(distance_um), wedge_deg=pair_of(wedge_deg))
        found = pull(cotangents)
        distance = np.asarray(found.distance_um, distance_um.dtype).reshape(distance_um.shape)
        return found.map.astype(x.dtype), distance, np.asarray(found.wedge_deg, wedge_deg.dtype)

    def called(x: Any, distance_um: Any, wedge_deg: Any) -> Any:
        shape = jax.ShapeDtypeStruct((model.samples, model.samples), x.dtype)
        call = _on_host(values)
        return jax.pure_callback(call, shape, x, distance_um, wedge_deg, vmap_method="sequential")

    def forward(x: Any, distance_um: Any, wedge_deg: Any) -> Any:
        return called(x, distance_um, wedge_deg), (x, distance_um, wedge_deg)

    def backward(at: Any, cotangents: Any) -> Any:
        shapes = tuple(jax.ShapeDtypeStruct(a.shape, a.dtype) for a in at)
        return jax.pure_callback(_on_host(derivatives), shapes, *at, cotangents, vmap_method="sequential")

    differentiable = jax.custom_vjp(called)
    differentiable.defvjp(forward, backward)

    def f(x: Any, distance_um: Any = None, wedge_deg: Any = None) -> Any:
        given = jnp.asarray(x)
        real = given.dtype
        distance = jnp.asarray(model.distance_um if distance_um is None else distance_um, real)
        wedge = jnp.asarray((0.0, 0.0) if wedge_deg is None else wedge_deg, real)
        return differentiable(given, distance, wedge)

    return f


def _on_host(function: Any) -> Any:
    """A function of numpy arrays, whatever kind of array it is called back with."""
    return lambda *arguments: function(*map(np.asarray, arguments))
