//! PSFs of a layout as a stack with axes and units.

use std::path::Path;

use metalith_core::Result;

use crate::netcdf::{Dataset, Values, Variable};
use crate::single::SinglePsf;

/// Write PSFs as NetCDF: `psfs.nc`, or where windows differ `psfs_0.nc` and further files, each with the PSFs of a window.
///
/// # Errors
/// If a file cannot be written.
pub(crate) fn write_stacks(psfs: &[SinglePsf], assumptions: &[(&'static str, String)], folder: &Path) -> Result<()> {
    let mut stacks: Vec<Vec<&SinglePsf>> = Vec::new();
    for psf in psfs {
        match stacks.iter_mut().find(|s| s[0].psf.window == psf.psf.window) {
            Some(stack) => stack.push(psf),
            None => stacks.push(vec![psf]),
        }
    }
    let alone = stacks.len() == 1;
    for (k, stack) in stacks.iter().enumerate() {
        let name = if alone {
            "psfs.nc".into()
        } else {
            format!("psfs_{k}.nc")
        };
        dataset(stack, assumptions).write(&folder.join(name))?;
    }
    Ok(())
}

/// Stack of PSFs that have one window.
fn dataset(psfs: &[&SinglePsf], assumptions: &[(&'static str, String)]) -> Dataset {
    // Order of the axes below.
    let [of_psf, y, x, letter] = [0, 1, 2, 3];
    let window = psfs[0].psf.window;
    let longest = psfs.iter().map(|p| p.element.len()).max().unwrap_or(0);
    // Zeros end a name, as in C.
    let names = psfs.iter().map(|p| format!("{:\0<longest$}", p.element)).collect();
    let axis = |axis: usize| {
        let places = (0..window.samples).map(|i| window.coordinate_um(axis, i));
        Values::Double(places.collect())
    };
    let of_micrometres = |words: &str| vec![("units", "um".to_owned()), ("long_name", words.to_owned())];
    let variable = |name, axes: &[usize], notes, values| Variable {
        name,
        axes: axes.to_vec(),
        notes,
        values,
    };
    let intensity = psfs.iter().flat_map(|p| p.psf.values.iter().copied());
    let wavelength = psfs.iter().map(|p| p.wavelength_um * 1e3);
    let assumed: Vec<String> = assumptions
        .iter()
        .map(|(what, value)| format!("{what}: {value}"))
        .collect();
    Dataset {
        axes: vec![
            ("psf", psfs.len()),
            ("y", window.samples),
            ("x", window.samples),
            ("letter", longest),
        ],
        notes: vec![
            ("Conventions", "CF-1.8".to_owned()),
            ("source", format!("metalith {}", env!("CARGO_PKG_VERSION"))),
            ("distance_um", window.distance_um.to_string()),
            ("assumptions", assumed.join("; ")),
        ],
        variables: vec![
            variable(
                "x",
                &[x],
                of_micrometres("distance from the axis of the element along x"),
                axis(0),
            ),
            variable(
                "y",
                &[y],
                of_micrometres("distance from the axis of the element along y"),
                axis(1),
            ),
            variable(
                "wavelength",
                &[of_psf],
                vec![
                    ("units", "nm".to_owned()),
                    ("long_name", "wavelength in vacuum".to_owned()),
                ],
                Values::Double(wavelength.collect()),
            ),
            variable("element", &[of_psf, letter], Vec::new(), Values::Text(names)),
            variable(
                "intensity",
                &[of_psf, y, x],
                vec![
                    ("units", "1".to_owned()),
                    ("long_name", "|E|^2 over that of the incident wave".to_owned()),
                    ("coordinates", "wavelength element".to_owned()),
                ],
                Values::Double(intensity.collect()),
            ),
        ],
    }
}
