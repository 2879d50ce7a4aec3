"""PSFs in PyTorch: :func:`psf` is differentiable by ``backward`` in phases or widths, distance and wedge.

It needs the package ``torch`` (``pip install torch``), which is imported at the first call."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from ._figures import imported
from ._gradient import PsfModel, pair_of


def psf(model: PsfModel, x: Any, distance_um: Any = None, wedge_deg: Any = None) -> Any:
    """The PSF of a lens as a tensor of shape ``[samples, samples]``, of the type and on the device of ``x``.

    ``x``: tensor of shape ``[sites, sites]``, phases (rad) or widths (nm) as the model takes them. ``distance_um``: a number or
    a tensor of one; left out, it is that of the model. ``wedge_deg``: two numbers, or a tensor of two. Derivatives are computed
    of what requires them, once: there are no second ones. The computation is on the processor, in the precision of
    :class:`metalith.PsfModel`."""
    return _function().apply(x, distance_um, wedge_deg, model)


@cache
def _function() -> Any:
    torch = imported("torch")

    class Psf(torch.autograd.Function):  # type: ignore[name-defined, misc]
        @staticmethod
        def forward(ctx: Any, x: Any, distance_um: Any, wedge_deg: Any, model: PsfModel) -> Any:
            ctx.like = [_like(given) for given in (x, distance_um, wedge_deg)]
            distance = None if distance_um is None else float(_array(distance_um))
            wedge = (0.0, 0.0) if wedge_deg is None else pair_of(_array(wedge_deg))
            # The derivative by the distance costs time: it is computed where it is required.
            found, ctx.pull = model._vjp(_array(x), distance, wedge, ctx.needs_input_grad[1])
            return torch.as_tensor(found, dtype=x.dtype, device=x.device)

        @staticmethod
        def backward(ctx: Any, cotangents: Any) -> Any:
            return once(ctx, cotangents)

    def _backward(ctx: Any, cotangents: Any) -> Any:
        found = ctx.pull(_array(cotangents))
        by = (found.map, found.distance_um, found.wedge_deg)
        return *(_tensor(values, like) for values, like in zip(by, ctx.like)), None

    once = torch.autograd.function.once_differentiable(_backward)

    def _tensor(values: Any, like: Any) -> Any:
        if like is None or values is None:
            return None
        dtype, device, shape = like
        return torch.as_tensor(np.asarray(values), dtype=dtype, device=device).reshape(shape)

    def _like(value: Any) -> Any:
        return (value.dtype, value.device, value.shape) if isinstance(value, torch.Tensor) else None

    def _array(value: Any) -> Any:
        return value.detach().cpu().numpy() if isinstance(value, torch.Tensor) else np.asarray(value)

    return Psf
