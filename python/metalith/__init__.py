"""From the phase of a metalens array to the layout a cleanroom writes, and back from that file to the image it makes.

Lengths carry their unit in their names; angles are degrees; arrays have their rows along +y and their columns along +x.
Everything that cannot be done raises :class:`MetalithError` with the words and the remedy that the program prints.
Long calls release the interpreter's lock, stop at Ctrl-C, and take ``progress``, a callable of what is done, the steps
that are done, and all of them: :class:`ProgressLine` prints them. They work in forked children and in several threads at once; each has as many threads as
``RAYON_NUM_THREADS`` says, or one for each core.
"""

from __future__ import annotations

from ._gradient import PsfGradient, PsfModel, phases_of, widths_of
from ._kernels import Kernels
from ._layouts import Array, Design, Layout, read_layout, write_layout
from ._light import Psf, PsfSet, ThroughFocus, Transmission, cell, index, propagate, psf
from ._native import MetalithError, __version__
from ._pictures import Frame, ImagingSystem, denoise
from ._progress import ProgressLine
from ._checks import MeasurementPlan, CheckReport, Marker, Verification, check, plan, verify
from ._diagnosis import Diagnosis, FoundEffect, RankedEffect, calibrate
from ._shapes import Lattice, Places, Rectangles, Shape, UprightRectangles, places
from ._studies import Study, StudyResult

__all__ = [
    "Array",
    "MeasurementPlan",
    "CheckReport",
    "Design",
    "Diagnosis",
    "FoundEffect",
    "Frame",
    "Kernels",
    "Lattice",
    "Layout",
    "Marker",
    "MetalithError",
    "Places",
    "ProgressLine",
    "Psf",
    "PsfGradient",
    "PsfModel",
    "PsfSet",
    "RankedEffect",
    "Rectangles",
    "Shape",
    "ImagingSystem",
    "Study",
    "StudyResult",
    "ThroughFocus",
    "Transmission",
    "UprightRectangles",
    "Verification",
    "__version__",
    "calibrate",
    "cell",
    "check",
    "denoise",
    "index",
    "phases_of",
    "places",
    "plan",
    "propagate",
    "psf",
    "read_layout",
    "verify",
    "widths_of",
    "write_layout",
]
