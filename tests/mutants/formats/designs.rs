//! Design files and what they name.

use std::fs;
use std::path::Path;

use metalith::Design;
use metalith::cell::{MappingTable, Material, PillarLibrary, UnitCellTable};
use metalith::phase::{Interpolation, RadialPhase};
use metalith_testing::design;

use super::{Format, Kind, copy, file, files};

/// Materials as refractiveindex.info writes them.
const TABLE: &str = "# CC0\nREFERENCES: \"x\"\nDATA:\n  - type: tabulated nk\n    data: |\n        0.4 2.1 0.01\n        0.5 2.05 0\n        0.7 2 0\n";
const FORMULA: &str = "DATA:\n  - type: formula 1\n    wavelength_range: 0.21 6.7\n    coefficients: 0 0.6961663 0.0684043 0.4079426 0.1162414 0.8974794 9.896161\n  - type: tabulated k\n    data: |\n        0.3 0.01\n        0.8 0.02\n";

/// Phases of a square map as rows of numbers.
fn phase_text(side: usize) -> String {
    let row = |y: usize| {
        let numbers: Vec<String> = (0..side).map(|x| format!("{}.25", (x * y) % 7)).collect();
        numbers.join(",") + "\n"
    };
    (0..side).map(row).collect()
}

pub(super) fn all(folder: &Path) -> Vec<Format> {
    for part in ["", "/phases", "/mappings"] {
        copy(&format!("designs{part}"), &folder.join(format!(".{part}")));
    }
    let lens = folder.join("lens_of_a_file.toml");
    let mini = fs::read_to_string(design("mini_3x3")).unwrap();
    let term = "\n[[phase.term]]\nsource = \"optic_studio\"\nfile = \"lens.zmx\"\nsurface = 1\n";
    fs::write(&lens, mini + term).unwrap();
    let zmx = "VERS 190513\nUNIT MM X W X CM MR CPMM\nSURF 0\n  TYPE STANDARD\nSURF 1\n  TYPE BINARY_2\n  PARM 0 1\n  PARM 1 0\n  \
               XDAT 1 2.0 0 0 1.0 0.0 0 \"\"\n  XDAT 2 0.5 0 0 1.0 0.0 0 \"\"\n  XDAT 3 -600.0 0 0\n  XDAT 4 25.0 0 0\n";
    let text_design = folder.join("hologram_of_text.toml");
    let hologram = fs::read_to_string(design("hologram")).unwrap();
    fs::write(&text_design, hologram.replace("four_spots.npy", "map.csv")).unwrap();
    let map_design = folder.join("hologram.toml");
    let tio2 = Design::read(&design("tio2_532")).unwrap();
    let allowed: Vec<u16> = tio2.cell.widths_nm().collect();
    let upright = Design::read(&design("birefringent_532"))
        .unwrap()
        .cell
        .shape
        .upright()
        .unwrap();
    vec![
        Format::new(
            "design",
            folder.join("mutant.toml"),
            Kind::Text,
            files("designs", "toml"),
            Design::read,
        ),
        Format::new(
            "zmx",
            folder.join("lens.zmx"),
            Kind::Text,
            vec![zmx.into()],
            move |_| Design::read(&lens),
        ),
        Format::new(
            "phase_map",
            folder.join("phases/four_spots.npy"),
            Kind::Bytes,
            vec![file("designs/phases/four_spots.npy")],
            move |_| Design::read(&map_design),
        ),
        Format::new(
            "phase_table",
            folder.join("mutant.csv"),
            Kind::Text,
            ["broadband", "imaging", "neighbours", "robust"]
                .map(|name| file(&format!("designs/phases/{name}.csv")))
                .into(),
            |path| RadialPhase::read_table(path, Interpolation::Nearest, 1.0),
        ),
        Format::new(
            "library",
            folder.join("library.csv"),
            Kind::Text,
            vec![file("designs/phases/birefringent_532.csv")],
            move |path| PillarLibrary::read_csv(path, upright),
        ),
        Format::new(
            "mapping",
            folder.join("mapping.csv"),
            Kind::Text,
            files("designs/mappings", "csv"),
            move |path| MappingTable::read_csv(path, &allowed),
        ),
        Format::new(
            "unit cells",
            folder.join("cells.h5"),
            Kind::Bytes,
            ["tidy3d.hdf5", "latest.hdf5", "chunks.h5", "parts.nc"]
                .map(|name| file(&format!("golden/unit_cells/{name}")))
                .to_vec(),
            unit_cells,
        ),
        Format::new(
            "unit cells as text",
            folder.join("cells.txt"),
            Kind::Text,
            cells_as_text(),
            unit_cells,
        ),
        Format::new(
            "material",
            folder.join("material.csv"),
            Kind::Text,
            vec![file("golden/measured/film_nk.csv")],
            Material::read_csv,
        ),
        Format::new(
            "material of refractiveindex.info",
            folder.join("material.yml"),
            Kind::Text,
            [TABLE, FORMULA].map(|text| text.as_bytes().to_vec()).into(),
            Material::read_file,
        ),
        Format::new(
            "phase_text",
            folder.join("phases/map.csv"),
            Kind::Text,
            vec![phase_text(180).into_bytes()],
            move |_| Design::read(&text_design),
        ),
    ]
}

/// Unit cells of pillars from 100 to 160 nm whose phase rises by half a wave, in the columns of two programs.
fn cells_as_text() -> Vec<Vec<u8>> {
    let mut texts = ["radius (m), abs(S21), angle(S21)\n", "width,f,t\n"].map(str::to_owned);
    for k in 0..=15 {
        let (nm, phase_rad) = (100.0 + 4.0 * f64::from(k), 0.2 * f64::from(k));
        let [re, im] = [0.9 * phase_rad.cos(), 0.9 * phase_rad.sin()];
        texts[0].push_str(&format!("{:e},0.9,{phase_rad}\n", 0.5e-9 * nm));
        texts[1].push_str(&format!("{},{:e},({re}{im:+}j)\n", 1e-3 * nm, 299_792_458.0 / 0.62e-6));
    }
    texts.map(String::into_bytes).into()
}

/// Reads unit cells as a design does.
fn unit_cells(path: &Path) -> metalith::Result<()> {
    match UnitCellTable::read(path)? {
        Some(table) => table.curve(600.0, 0.62, &[101, 121, 159], None).map(|_| ()),
        None => Ok(()),
    }
}
