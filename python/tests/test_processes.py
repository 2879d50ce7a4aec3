"""Children and threads: what a process has computed, its children of every start method compute too, and so do eight threads."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import metalith as ml
from calls import MINI, Calls, native_names, told

# A child that waits for threads of its parent waits without end; the slowest computes for seconds.
LIMIT_S = 60

STARTS = multiprocessing.get_all_start_methods()
forks = pytest.mark.skipif("fork" not in STARTS, reason="no system that forks")


@pytest.fixture(scope="module")
def calls(tmp_path_factory: pytest.TempPathFactory) -> Calls:
    return Calls(tmp_path_factory.mktemp("calls"))


@pytest.fixture(scope="module")
def answers(calls: Calls) -> dict[str, str]:
    """What this process, which keeps threads from then on, finds."""
    return calls.answers()


def send(to: Connection, function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    to.send(function(*arguments))


def in_child(start: str, function: Callable[..., Any], *arguments: Any) -> Any:
    """What a function gives in a child process that ends within the limit."""
    context: Any = multiprocessing.get_context(start)
    here, there = context.Pipe(duplex=False)
    child = context.Process(target=send, args=(there, function, arguments))
    child.start()
    there.close()
    try:
        assert here.poll(LIMIT_S), f"a child by {start} hangs"
        return here.recv()
    finally:
        child.kill()
        child.join()


def small() -> str:
    return told(np.asarray(ml.cell([150.0, 200.0], 530.0, orders=5)))


def grandchild() -> str:
    """The same in a child of a child, which has used its own threads."""
    small()
    return str(in_child("fork", small))


def test_every_function_of_the_native_module_is_tried(calls: Calls) -> None:
    assert set(calls.all()) == native_names()


@forks
def test_a_forked_child_finds_what_its_parent_finds(calls: Calls, answers: dict[str, str]) -> None:
    assert in_child("fork", calls.answers) == answers
    # And the parent goes on with its own threads.
    assert told(calls.all()["psf_of_widths"]()) == answers["psf_of_widths"]


@pytest.mark.parametrize("start", STARTS)
def test_every_start_method_works_after_use(start: str) -> None:
    assert in_child(start, small) == small()


@forks
def test_a_child_of_a_child_works() -> None:
    assert in_child("fork", grandchild) == small()


@forks
def test_a_plain_fork_works() -> None:
    expected = small()
    child = os.fork()
    if child == 0:
        os._exit(0 if small() == expected else 1)
    end = time.monotonic() + LIMIT_S
    while time.monotonic() < end:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            assert os.waitstatus_to_exitcode(status) == 0
            return
        time.sleep(0.01)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    pytest.fail("the child hangs")


@forks
def test_children_forked_while_threads_compute_work(calls: Calls, answers: dict[str, str]) -> None:
    """The child has the locks of the moment, and none of the threads that would open them."""
    over = threading.Event()
    names = ["ImagingSystem.restore", "cell", "denoise", "read_layout"]
    every = calls.all()

    def busy(first: int) -> None:
        k = first
        while not over.is_set():
            every[names[k % len(names)]]()
            k += 1

    def some() -> list[str]:
        return [told(every[name]()) for name in names]

    expected = [answers[name] for name in names]
    threads = [threading.Thread(target=busy, args=(k,)) for k in range(3)]
    for thread in threads:
        thread.start()
    try:
        for _ in range(2):
            # A system that has not restored yet computes its error of the operator while it is forked.
            calls.system = calls.open()
            assert in_child("fork", some) == expected
    finally:
        over.set()
        for thread in threads:
            thread.join()


def run(code: str) -> str:
    """What a program in Python prints, within the limit."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=LIMIT_S)
    assert done.returncode == 0, done.stderr
    return done.stdout


USED = """
import numpy as np, metalith as ml
def one(width): return complex(ml.cell(width, 530.0, orders=5))
widths = [100.0, 150.0, 200.0, 250.0]
here = [one(w) for w in widths]
"""


@forks
def test_executors_of_forked_processes_work() -> None:
    run(USED + """
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("fork")) as pool:
    assert list(pool.map(one, widths)) == here
""")


@forks
def test_dask_with_forked_processes_works() -> None:
    pytest.importorskip("dask")
    run(USED + """
import dask
with dask.config.set({"multiprocessing.context": "fork"}):
    jobs = [dask.delayed(one)(w) for w in widths]
    assert list(dask.compute(*jobs, scheduler="processes", num_workers=2)) == here
""")


def test_joblib_works() -> None:
    pytest.importorskip("joblib")
    run(USED + """
import joblib
for backend in ("loky", "multiprocessing", "threading"):
    assert joblib.Parallel(2, backend=backend)(joblib.delayed(one)(w) for w in widths) == here
""")


@forks
def test_the_program_after_a_fork_is_refused_with_the_remedy() -> None:
    said = run(f"""
import os
from metalith import MetalithError, _native
layout = ["metalith", "layout", {str(MINI)!r}, "--quiet", "--out"]
import tempfile
with tempfile.TemporaryDirectory() as folder:
    assert _native.main(layout + [folder]) == 0
    if os.fork() == 0:
        try:
            _native.main(layout + [folder])
        except MetalithError as error:
            print(error, flush=True)
        os._exit(0)
    os.wait()
""")
    assert "forked" in said and "\n  help: " in said


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="no list of threads")
@pytest.mark.parametrize("wanted", [1, 3])
def test_the_number_of_threads_is_the_one_that_is_asked_for(wanted: int) -> None:
    # A thread names itself after its start, so that the count is read until it stands.
    said = run(f"""
import os, time
os.environ["RAYON_NUM_THREADS"] = "{wanted}"
{USED}
def named():
    names = [open(f"/proc/self/task/{{k}}/comm").read() for k in os.listdir("/proc/self/task")]
    return sum(name.startswith("metalith") for name in names)
until = time.monotonic() + 20
while named() < {wanted} and time.monotonic() < until:
    time.sleep(0.01)
print(named())
""")
    assert int(said) == wanted


def test_eight_threads_find_what_one_finds(calls: Calls, answers: dict[str, str]) -> None:
    """All functions at once, and all threads in the same one."""
    every = calls.all()
    with ThreadPoolExecutor(8) as pool:
        mixed = {name: pool.submit(call) for name, call in every.items()}
        assert {name: told(future.result()) for name, future in mixed.items()} == answers
        for name in ("cell", "ImagingSystem.restore", "rotation_numbers"):
            calls.system = calls.open()
            same = [pool.submit(every[name]) for _ in range(8)]
            assert {told(future.result()) for future in same} == {answers[name]}


def test_ctrl_c_stops_the_main_thread_while_others_compute() -> None:
    code = (
        "import signal, threading, metalith as ml, numpy as np\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "long = lambda: ml.cell(np.arange(100, 300, 0.01), [500.0, 530.0, 600.0], orders=17)\n"
        "threading.Thread(target=long, daemon=True).start()\n"
        "print('begun', flush=True)\n"
        "long()\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    process.stdout.readline()
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=LIMIT_S)
    assert "KeyboardInterrupt" in err
