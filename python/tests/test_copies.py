"""Copies: designs, arrays and results are copied and pickled, to this process and to others of every start method."""

from __future__ import annotations

import copy
import multiprocessing
import pickle
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import metalith as ml
from calls import MINI, PILLARS, Calls, told

COPIES: list[Callable[[Any], Any]] = [copy.copy, copy.deepcopy, lambda of: pickle.loads(pickle.dumps(of))]


@pytest.fixture(scope="module")
def calls(tmp_path_factory: pytest.TempPathFactory) -> Calls:
    return Calls(tmp_path_factory.mktemp("calls"))


def pillars(array: ml.Array) -> tuple[str, str]:
    return told(array.widths(0)), "" if array.design is None else array.design.digest


def width_of_one(design: ml.Design) -> tuple[str, int]:
    return design.digest, int(ml.widths_of(1.0, design))


@pytest.mark.parametrize("start", multiprocessing.get_all_start_methods())
def test_designs_and_arrays_go_to_other_processes(start: str, calls: Calls) -> None:
    design, array = calls.design, calls.array
    drawn = ml.write_layout(calls.new(".gds"), PILLARS, pitch_nm=350)
    context = multiprocessing.get_context(start)
    with ProcessPoolExecutor(1, mp_context=context) as pool:
        assert pool.submit(width_of_one, design).result() == width_of_one(design)
        assert pool.submit(pillars, array).result() == pillars(array)
        back = pool.submit(copy.copy, drawn).result()
    assert pillars(back) == pillars(drawn) and back.centres_nm == drawn.centres_nm


def test_dask_takes_a_design(calls: Calls) -> None:
    dask: Any = pytest.importorskip("dask")
    with dask.config.set({"multiprocessing.context": "spawn"}):
        (found,) = dask.compute(dask.delayed(width_of_one)(calls.design), scheduler="processes", num_workers=1)
    assert found == width_of_one(calls.design)


def test_joblib_takes_an_array(calls: Calls) -> None:
    joblib: Any = pytest.importorskip("joblib")
    assert joblib.Parallel(2)(joblib.delayed(pillars)(calls.array) for _ in range(2)) == [pillars(calls.array)] * 2


@pytest.mark.parametrize("copied", COPIES)
def test_results_are_copied(copied: Callable[[Any], Any], calls: Calls) -> None:
    assert copied(calls.design).digest == calls.design.digest
    assert pillars(copied(calls.array)) == pillars(calls.array)
    layout = ml.read_layout(calls.chip)
    assert np.array_equal(copied(layout).widths[0], layout.widths[0])
    psfs = ml.psf(calls.array, [660], fast=True, samples=16, through_focus=True, planes=3)
    assert told(copied(psfs)[0].values) == told(psfs[0].values)
    t = ml.cell([150.0, 200.0], [600.0, 660.0], orders=5)
    again = copied(t)
    assert t.width_nm is not None
    assert told(np.asarray(again)) == told(np.asarray(t)) and np.array_equal(again.width_nm, t.width_nm)
    assert told(np.asarray(again[:1])) == told(np.asarray(t[:1])) and again[:1].width_nm is None
    report = ml.check(calls.chip, design=calls.design)
    assert copied(report) == report
    verified = ml.verify(calls.design, calls.chip, fast=True)
    assert copied(verified) == verified
    study = ml.Study(calls.folder / "nothing.toml", draws_per_shard=2)
    assert copied(study).folder == study.folder
    frame = copied(calls.frame)
    assert told(frame.planes[0]) == told(calls.frame.planes[0]) and frame.saturated == calls.frame.saturated
    assert told(copied(calls.system).restore(frame)) == told(calls.system.restore(calls.frame))


def test_a_design_whose_files_have_changed_is_refused(tmp_path: Path) -> None:
    table = tmp_path / "phase.csv"
    table.write_text("r_um,phase_rad\n0,0\n40,-20\n")
    text = MINI.read_text()
    assert 'source = "hyperbola"' in text
    named = text.replace('source = "hyperbola"', 'source = "table"\nfile = "phase.csv"').replace("wavelength_nm = 550\n\n[array]", "\n[array]")
    design = ml.Design.parse(named, tmp_path / "design.toml")
    kept = pickle.dumps(design)
    assert pickle.loads(kept).digest == design.digest
    table.write_text("r_um,phase_rad\n0,0\n40,-21\n")
    with pytest.raises(ml.MetalithError, match="has changed"):
        pickle.loads(kept)
