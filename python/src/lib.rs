//! metalith from Python: the native half of the package. What it is for people stands in `metalith/*.py`, which is
//! written against these functions; their types are in `metalith/_native.pyi`.
//!
//! Every call that takes longer than a moment runs on threads of its own without the interpreter's lock, while the
//! caller's thread looks for Ctrl-C and reports progress: see [`work`].

mod arrays;
mod checks;
mod gradient;
mod lattices;
mod light;
mod pictures;
mod psf;
mod reading;
mod shapes;
mod studies;
mod wanted;
mod work;

use std::sync::OnceLock;

use metalith::Error;
use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;

create_exception!(
    metalith,
    MetalithError,
    PyException,
    "Something that metalith cannot do, with the words and the remedy that the program would print."
);

/// The program, with the arguments of a process; returns its exit code. It counts on the threads of its process, which are not
/// there in a child of one that ran it.
#[pyfunction]
fn main(py: Python<'_>, arguments: Vec<std::ffi::OsString>) -> PyResult<u8> {
    static RAN_IN: OnceLock<u32> = OnceLock::new();
    let process = std::process::id();
    if *RAN_IN.get_or_init(|| process) != process {
        return Err(work::error(Error::refused(
            "threads/forked",
            "the program was run in the process that this one was forked from",
            "start `metalith` by `subprocess.run`, or processes by the method `spawn`",
        )));
    }
    Ok(py.detach(|| metalith::cli::run_with(arguments)))
}

#[pymodule]
fn _native(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("MetalithError", m.py().get_type::<MetalithError>())?;
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    m.add_class::<arrays::Design>()?;
    m.add_class::<arrays::Array>()?;
    m.add_function(wrap_pyfunction!(main, m)?)?;
    m.add_function(wrap_pyfunction!(arrays::read_layout, m)?)?;
    m.add_function(wrap_pyfunction!(arrays::array_of_design, m)?)?;
    m.add_function(wrap_pyfunction!(arrays::array_of_widths, m)?)?;
    m.add_function(wrap_pyfunction!(lattices::places, m)?)?;
    m.add_function(wrap_pyfunction!(shapes::rotation_numbers, m)?)?;
    m.add_function(wrap_pyfunction!(shapes::rotations_deg, m)?)?;
    m.add_function(wrap_pyfunction!(shapes::upright_numbers, m)?)?;
    m.add_function(wrap_pyfunction!(shapes::upright_widths, m)?)?;
    m.add_function(wrap_pyfunction!(psf::psf_of_array, m)?)?;
    m.add_function(wrap_pyfunction!(psf::psf_of_widths, m)?)?;
    m.add_function(wrap_pyfunction!(light::propagate, m)?)?;
    m.add_function(wrap_pyfunction!(light::cell, m)?)?;
    m.add_function(wrap_pyfunction!(light::index, m)?)?;
    m.add_class::<pictures::ImagingSystem>()?;
    m.add_class::<pictures::Frame>()?;
    m.add_function(wrap_pyfunction!(pictures::denoise, m)?)?;
    m.add_class::<gradient::PsfModel>()?;
    m.add_class::<gradient::PsfPullback>()?;
    m.add_function(wrap_pyfunction!(gradient::curve_of, m)?)?;
    m.add_function(wrap_pyfunction!(gradient::widths_of, m)?)?;
    m.add_function(wrap_pyfunction!(gradient::phases_of, m)?)?;
    m.add_function(wrap_pyfunction!(checks::check, m)?)?;
    m.add_function(wrap_pyfunction!(checks::verify, m)?)?;
    m.add_function(wrap_pyfunction!(checks::calibrate, m)?)?;
    m.add_function(wrap_pyfunction!(checks::plan, m)?)?;
    m.add_function(wrap_pyfunction!(studies::study_plan, m)?)?;
    m.add_function(wrap_pyfunction!(studies::study_status, m)?)?;
    m.add_function(wrap_pyfunction!(studies::study_run, m)?)?;
    m.add_function(wrap_pyfunction!(studies::study_merge, m)?)?;
    Ok(())
}
