//! Layouts for writers of Raith: GDSII in which the datatype of a shape is its dose factor, 1000 for the base dose.
//!
//! As the documentation of the Raith_GDSII toolbox of the National Research Council of Canada states it: `DATATYPE` is a
//! thousand times the dose factor, and the database unit is 1 nm. Curved elements, `.asc` files and position lists are not
//! written.

use std::fs::File;
use std::io::{BufReader, BufWriter, ErrorKind, Read, Write};
use std::path::Path;

use super::dose::doses;
use super::dose_classes::DoseClasses;
use super::layouts::Layouts;
use super::listing::Listing;
use super::process::{JobSpec, Process};
use metalith_core::{AtomicFile, Error, LayerNumber, Result, Silent};
use metalith_design::Design;
use metalith_gds::{FileFormat, Layout};
use metalith_layout::{LayoutFormat, convert};

/// Datatype of the base dose.
const BASE: f64 = 1000.0;
/// Records of GDSII that hold the layer of an element, and the datatype of a polygon, path or box.
const LAYER: u8 = 0x0D;
const DATATYPES: [u8; 2] = [0x0E, 0x2E];

/// Datatype of a dose factor; factors of processes and classes are at most 20.
pub(super) fn datatype(factor: f64) -> u16 {
    (factor * BASE).round() as u16
}

/// Layouts with dose factors of all that the first step of a design exposes, where the process asks for them.
///
/// # Errors
/// As [`write`].
pub(super) fn of_design(
    files: &mut Listing,
    process: &Process,
    layouts: &Layouts,
    classes: Option<&DoseClasses>,
    design: &Design,
) -> Result<()> {
    let own = [
        design.layout.layers.pillars.number(),
        design.layout.layers.pillar_marks.number(),
    ];
    let base = |layer: LayerNumber| own.contains(&layer).then(|| datatype(1.0));
    let paths = &layouts.paths;
    write(files, process, &paths.pillars, "pillars and marks", base)?;
    write(files, process, &paths.tests, "test structures", base)?;
    write(files, process, &paths.reference, "reference lens", base)?;
    write(
        files,
        process,
        &paths.dose_matrix,
        "dose matrix",
        dose_matrix(process, &own),
    )?;
    for class in classes.iter().flat_map(|classes| &classes.classes) {
        let path = files.at(&class.file);
        let purpose = format!("dose class {}", class.number);
        write(files, process, &path, &purpose, |layer| {
            (layer.layer == own[0].layer).then(|| datatype(class.factor))
        })?;
    }
    Ok(())
}

/// Dose factors of the blocks of a dose matrix; its numbers, on these layers, have the base dose.
pub(super) fn dose_matrix<'a>(
    process: &Process,
    own: &'a [LayerNumber],
) -> impl Fn(LayerNumber) -> Option<u16> + use<'a> {
    let (layer, doses) = (process.dose_matrix.layer, doses(process));
    move |number| {
        let dose = doses
            .iter()
            .find(|d| LayerNumber::new(layer as u16, d.number as u16) == number);
        let of_dose = dose.map(|d| datatype(d.factor));
        of_dose.or_else(|| own.contains(&number).then(|| datatype(1.0)))
    }
}

/// Write `job/NAME_raith.gds` for the layout of this name, if the process is for such a writer. `factors` has the datatypes of
/// layers that are exposed; other shapes keep theirs.
///
/// # Errors
/// If the database unit is not 1 nm, or a file cannot be read or written.
pub(super) fn write(
    files: &mut Listing,
    process: &Process,
    layout: &Path,
    purpose: &str,
    factors: impl Fn(LayerNumber) -> Option<u16>,
) -> Result<()> {
    if !matches!(process.job, JobSpec::Raith(_)) {
        return Ok(());
    }
    let opened = Layout::open(layout)?;
    if opened.unit_nm() != 1.0 {
        return Err(Error::refused(
            "handoff/raith-database-unit",
            format!(
                "the database unit of {} is {} nm; the public description of GDSII for Raith has 1 nm",
                layout.display(),
                opened.unit_nm()
            ),
            "use a database unit of 1 nm, or leave `format` in [job] of the process out and hand over dose/dose_table.csv",
        ));
    }
    let stem = layout.file_stem().unwrap_or_default().to_string_lossy();
    let to = files.add(
        format!("job/{stem}_raith.gds"),
        format!("{purpose} for a writer of Raith: datatype is the dose factor times 1000"),
    );
    if opened.format() == FileFormat::Gds {
        return redosed(layout, &to, factors);
    }
    let plain = to.with_extension("part");
    convert(&opened, LayoutFormat::Gds, &plain, &Silent)?;
    redosed(&plain, &to, factors)?;
    std::fs::remove_file(&plain).map_err(Error::io("remove", &plain))
}

/// Copy a GDSII file record by record with other datatypes.
fn redosed(from: &Path, to: &Path, factors: impl Fn(LayerNumber) -> Option<u16>) -> Result<()> {
    let mut input = BufReader::new(File::open(from).map_err(Error::io("read", from))?);
    let mut file = AtomicFile::create(to)?;
    let mut output = BufWriter::new(&mut file);
    let (mut head, mut body, mut layer) = ([0u8; 4], Vec::new(), 0);
    loop {
        match input.read_exact(&mut head) {
            Ok(()) => {}
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => break,
            Err(error) => return Err(Error::io("read", from)(error)),
        }
        let length = usize::from(u16::from_be_bytes([head[0], head[1]]));
        // Zeros fill the last block of a file.
        let Some(length) = length.checked_sub(head.len()) else {
            break;
        };
        body.resize(length, 0);
        input.read_exact(&mut body).map_err(Error::io("read", from))?;
        if let Ok(value) = <[u8; 2]>::try_from(body.as_slice()).map(u16::from_be_bytes) {
            if head[2] == LAYER {
                layer = value;
            } else if DATATYPES.contains(&head[2])
                && let Some(factor) = factors(LayerNumber::new(layer, value))
            {
                body.copy_from_slice(&factor.to_be_bytes());
            }
        }
        output
            .write_all(&head)
            .and_then(|()| output.write_all(&body))
            .map_err(Error::io("write", to))?;
    }
    output.flush().map_err(Error::io("write", to))?;
    drop(output);
    file.commit()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_datatype_is_a_thousand_times_the_factor() {
        assert_eq!([1.0, 0.72, 1.1849, 20.0].map(datatype), [1000, 720, 1185, 20_000]);
        let process = Process::standard();
        let marks = [LayerNumber::new(3, 0)];
        let factors = dose_matrix(&process, &marks);
        assert_eq!(factors(LayerNumber::new(20, 1)), Some(720));
        assert_eq!(factors(LayerNumber::new(20, 5)), Some(1000));
        assert_eq!(factors(marks[0]), Some(1000));
        assert_eq!(factors(LayerNumber::new(11, 0)), None);
    }
}
