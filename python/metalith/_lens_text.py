"""The design file of one lens."""

from __future__ import annotations

import json
import numbers

from ._native import MetalithError

# Chip and marks lie so far from the rim of the lens (um).
MARGIN_UM = 100

TEXT = """\
schema = 1
name = {name}

[cell]
shape = {shape}
lattice = {lattice}
pitch_nm = {pitch_nm}
pillar_height_nm = {pillar_height_nm}
width_min_nm = {width_min_nm}
width_max_nm = {width_max_nm}
pillar_material = {pillar}
substrate_material = {substrate}
band_nm = [{shortest_nm}, {longest_nm}]

[lens]
diameter_um = {diameter_um}
focal_length_um = {focal_length_um}

[phase]
source = "hyperbola"
wavelength_nm = {wavelength_nm}

[array]
elements = [1, 1]
spacing_um = {spacing_um}
wedge_wavelength_nm = {wavelength_nm}

[mapping]
source = "cells"
wavelength_nm = {wavelength_nm}

[layers]
pillars        = {{ layer = 1, datatype = 0, purpose = "pillars" }}
pillar_marks   = {{ layer = 3, datatype = 0, purpose = "marks written with the pillars" }}
apertures      = {{ layer = 2, datatype = 0, purpose = "openings in the metal" }}
aperture_marks = {{ layer = 4, datatype = 0, purpose = "marks written with the apertures" }}
outline        = {{ layer = 10, datatype = 0, purpose = "edge of the chip" }}
label          = {{ layer = 11, datatype = 0, purpose = "name and digest of the design" }}

[apertures]
margin_um = 2
chord_error_nm = 5
max_vertices = 200

[chip]
size_um = [{chip_um}, {chip_um}]

[verify]
fidelity = "rigorous"
wavelengths_nm = [{wavelength_nm}]
field_x_deg = [0]
field_y_deg = [0]
window_samples = 128

[verify.limits]
wrong_widths_max = 0
foreign_shapes_max = 0
"""


def lens_text(
    name: str,
    shape: str,
    lattice: str,
    pillar: str,
    substrate: str,
    wavelength_nm: float,
    focal_length_um: float,
    diameter_um: float,
    pitch_nm: int,
    pillar_height_nm: float,
    width_min_nm: int,
    width_max_nm: int,
) -> str:
    """The design file of one lens with a hyperbolic phase. What values may be is told by the reader of designs."""
    words = dict(name=name, shape=shape, lattice=lattice, pillar=pillar, substrate=substrate)
    values = dict(
        wavelength_nm=wavelength_nm,
        focal_length_um=focal_length_um,
        diameter_um=diameter_um,
        pitch_nm=pitch_nm,
        pillar_height_nm=pillar_height_nm,
        width_min_nm=width_min_nm,
        width_max_nm=width_max_nm,
    )
    for key, value in values.items():
        if isinstance(value, bool) or not isinstance(value, numbers.Real) or not abs(value) < float("inf"):
            raise MetalithError(f"`{key}` = {value!r}\n  help: give a number")
    # One per cent on each side: cells are tabulated for this light alone.
    band = dict(shortest_nm=round(0.99 * wavelength_nm), longest_nm=round(1.01 * wavelength_nm))
    chip = dict(spacing_um=2 * diameter_um, chip_um=diameter_um + 2 * MARGIN_UM)
    # A text of JSON is one of TOML.
    return TEXT.format(**{key: json.dumps(value) for key, value in words.items()}, **values, **band, **chip)
