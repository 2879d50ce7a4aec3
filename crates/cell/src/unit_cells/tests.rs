//! Tables as programs write them, of a pillar whose transmission is known everywhere.

use std::f64::consts::TAU;

use super::*;
use crate::PhaseCurve;

/// Largest distance between a transmission and its interpolation from samples 10 nm apart.
const CLOSE: f64 = 0.01;

const WIDTHS: [u16; 5] = [81, 120, 145, 203, 319];

/// A pillar that fills its cell more and more (nm).
fn pillar(width: f64, height: f64, wavelength: f64) -> Complex64 {
    let n = 1.0 + 1.3 * (width / 400.0).powf(1.6);
    Complex64::from_polar(
        0.97 - 0.05 * (width / 80.0).sin().powi(2),
        TAU * n * height / wavelength,
    )
}

fn widths() -> impl Iterator<Item = f64> {
    (8..=32).map(|w| f64::from(w) * 10.0)
}

fn read(text: &str) -> Result<UnitCellTable> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cells.txt");
    std::fs::write(&path, text).unwrap();
    UnitCellTable::read(&path).map(|table| table.expect("no mapping"))
}

/// A script of Lumerical: radii in metres, amplitude and angle.
fn lumerical(sign: f64) -> String {
    let rows = widths().map(|w| {
        let t = pillar(w, 600.0, 633.0);
        format!("{:.6e}, {:.6}, {:.6}\n", w * 0.5e-9, t.norm(), sign * t.arg())
    });
    format!("radius (m), abs(S21), angle(S21) (rad)\n{}", rows.collect::<String>())
}

/// `DataArray.to_dataframe().to_csv()`: lengths in um, frequencies in Hz, complex numbers of numpy.
fn tidy3d() -> String {
    let mut text = "width,height,f,t\n".to_owned();
    for w in widths() {
        for h in [520.0, 560.0, 600.0, 640.0, 680.0] {
            for l in [600.0, 620.0, 640.0, 660.0, 680.0] {
                let t = pillar(w, h, l);
                text += &format!(
                    "{},{},{},({}{:+}j)\n",
                    w * 1e-3,
                    h * 1e-3,
                    2.997_924_58e17 / l,
                    t.re,
                    t.im
                );
            }
        }
    }
    text
}

fn off(curve: &PhaseCurve, height: f64, wavelength: f64) -> f64 {
    let piston = Complex64::cis(-pillar(80.0, height, wavelength).arg());
    let truth = |w: u16| pillar(f64::from(w), height, wavelength) * piston;
    let each = curve.widths_nm.iter().zip(&curve.t);
    each.map(|(w, t)| (truth(*w) - t).norm()).fold(0.0, f64::max)
}

#[test]
fn radii_of_lumerical_are_read_in_either_convention() {
    for (sign, convention) in [(1.0, PhaseConvention::Minus), (-1.0, PhaseConvention::Plus)] {
        let table = read(&lumerical(sign)).unwrap();
        for stated in [None, Some(convention)] {
            let (curve, note) = table.curve(600.0, 0.633, &WIDTHS, stated).unwrap();
            assert!(off(&curve, 600.0, 633.0) < CLOSE);
            assert_eq!((note.convention, note.samples), (convention, [25, 0, 0]));
            let error = note.interpolation.unwrap();
            assert!(error.worst_rad > 0.0 && error.worst_rad < 2.0 * CLOSE, "{error:?}");
        }
        let other = PhaseConvention::CHOICES[usize::from(convention == PhaseConvention::Minus)].1;
        let error = table.curve(600.0, 0.633, &WIDTHS, Some(other)).unwrap_err();
        assert_eq!(error.id(), "mapping/phase-convention");
    }
    let (_, note) = read(&lumerical(-1.0))
        .unwrap()
        .curve(600.0, 0.633, &[80, 90, 310, 320], None)
        .unwrap();
    insta::assert_snapshot!(note.words(), @"cells.txt (25 widths; `radius (m)` in m, `angle(S21) (rad)` as phase in rad, `abs(S21)` as amplitude); phase convention exp(+iwt): found, since the phase falls by 0.77 waves from 80 to 320 nm of width and a wider pillar delays light more; no interpolation");
}

#[test]
fn frequencies_and_complex_numbers_of_tidy3d_are_read() {
    let table = read(&tidy3d()).unwrap();
    for (height, wavelength) in [(600.0, 620.0), (600.0, 633.0), (575.0, 633.0)] {
        let (curve, note) = table.curve(height, wavelength * 1e-3, &WIDTHS, None).unwrap();
        let error = note.interpolation.unwrap();
        // The estimate is an upper one.
        assert!(off(&curve, height, wavelength) < error.worst_rad + error.worst_amplitude);
        assert_eq!(note.samples, [25, 5, 5]);
    }
    for (height, wavelength, widths) in [
        (800.0, 0.633, [81, 319]),
        (600.0, 0.59, [81, 319]),
        (600.0, 0.633, [60, 319]),
    ] {
        let error = table.curve(height, wavelength, &widths, None).unwrap_err();
        assert_eq!(error.id(), "mapping/table-range", "{error}");
    }
}

#[test]
fn columns_have_many_names() {
    let rows =
        |row: &dyn Fn(f64, Complex64) -> String| widths().map(|w| row(w, pillar(w, 600.0, 633.0))).collect::<String>();
    for text in [
        format!(
            "# made by hand\n# width_nm re im\n{}",
            rows(&|w, t| format!("{w} {} {}\n", t.re, t.im))
        ),
        format!(
            "diameter (um)\tRe(t)\tIm(t)\n{}",
            rows(&|w, t| format!("{}\t{}\t{}\n", w * 1e-3, t.re, t.im))
        ),
        format!(
            "\u{feff}\"D\";\"T\";\"phase (deg)\"\r\n{}",
            rows(&|w, t| format!("{w};{};{}\r\n", t.norm_sqr(), t.arg().to_degrees()))
        ),
        format!("title\nW, S21\n{}", rows(&|w, t| format!("{w}, {}{:+}i\n", t.re, t.im))),
        format!(
            "radius[nm], T_Gn, phase\n{}",
            rows(&|w, t| format!("{}, {}, {}\n", w * 0.5, t.norm_sqr(), t.arg()))
        ),
        format!(
            "radius (um) |t|^2 phase (waves)\n{}",
            rows(&|w, t| format!("{} {} {}\n", w * 5e-4, t.norm_sqr(), t.arg() / TAU))
        ),
    ] {
        let (curve, _) = read(&text).unwrap().curve(600.0, 0.633, &WIDTHS, None).unwrap();
        assert!(off(&curve, 600.0, 633.0) < CLOSE, "{}", &text[..60]);
    }
}

#[test]
fn what_is_no_table_is_said() {
    let said = [
        "",
        "80 0.1 0.2\n",
        "width,colour\n80,3\n",
        "colour,phase\n80,3\n",
        "width,phase\n80,30\n90,20\n",
        "width,phase,angle\n80,1,2\n",
        "width,re,im\n80,0.1\n",
        "width,re,im\n80,nan,0\n",
        "width,re,im\n80,1.2,0\n",
        "width,re,im\n80,0.1,0\n80,0.2,0\n",
        "width,height,re,im\n80,600,0.1,0\n90,700,0.2,0\n",
        "width (deg),re,im\n80,0.1,0\n",
    ]
    .map(|text| match read(text).unwrap_err() {
        Error::Table { line, what, .. } => format!("{}{what}", line.map_or(String::new(), |line| format!("{line}: "))),
        other => other.to_string(),
    });
    insta::assert_snapshot!(said.join("\n"), @"
        no row begins with a number
        1: numbers whose columns have no names
        1: no column of phases, nor a complex transmission
        1: no column of widths, diameters or radii
        1: `phase` goes to 30 and has no unit: name it `phase (rad)` or `phase (deg)`
        1: `phase` and `angle` are the same quantity
        1: 3 names of columns, and rows of 2
        2: `nan` is no number
        2: an amplitude of 1.2000: more power than arrives
        3: this width, height and wavelength stand here twice
        2 rows, and 2 of width x 2 of height values make a larger grid
        1: `width (deg)` holds values that are no width of a unit cell
        ");
    // A phase that hardly varies has no sign.
    let flat: String = widths()
        .map(|w| format!("{w},0.9,{}\n", 0.1 * (w / 50.0).sin()))
        .collect();
    let error = read(&format!("width,abs,phase\n{flat}"))
        .unwrap()
        .curve(600.0, 0.633, &WIDTHS, None)
        .unwrap_err();
    assert_eq!(error.id(), "mapping/phase-convention");
}

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../golden/unit_cells")
        .join(name)
}

/// Files of `golden/unit_cells/make.py`, which has the same pillar.
#[test]
fn arrays_of_hdf5_are_read() {
    for (name, samples) in [
        ("tidy3d.hdf5", [25, 3, 4]),
        ("latest.hdf5", [25, 3, 4]),
        ("chunks.h5", [25, 3, 4]),
        ("parts.nc", [25, 0, 1]),
    ] {
        let table = UnitCellTable::read(&golden(name)).unwrap().unwrap();
        for (height, wavelength) in [(600.0, 620.0), (590.0, 633.0)] {
            let found = table.curve(height, wavelength * 1e-3, &WIDTHS, None);
            if samples[2] == 1 && wavelength != 620.0 {
                assert_eq!(found.unwrap_err().id(), "mapping/table-range");
                continue;
            }
            let (curve, note) = found.unwrap();
            assert!(off(&curve, height, wavelength) < CLOSE, "{name}");
            assert_eq!(note.samples, samples, "{name}");
        }
    }
}

/// Whatever is cut or changed in a file, it is read or refused.
#[test]
fn damaged_hdf5_is_refused() {
    let read = |bytes: &[u8]| UnitCellTable::of_bytes(Path::new("cells.h5"), bytes);
    for name in ["tidy3d.hdf5", "latest.hdf5", "chunks.h5", "parts.nc"] {
        let whole = std::fs::read(golden(name)).unwrap();
        for end in (600..whole.len()).step_by(297) {
            let _ = read(&whole[..end]);
        }
        // What says where things are stands before the numbers and behind them.
        for at in (0..2400).step_by(5).chain(whole.len() - 300..whole.len()) {
            let mut bytes = whole.clone();
            bytes[at] ^= [0x10, 0xff, 0x01][at % 3];
            let _ = read(&bytes);
        }
    }
    assert_eq!(read(b"\x89HDF\r\n\x1a\n").unwrap_err().id(), "mapping/hdf5");
}

/// A column without a value keeps its place: the values behind it do not move into it.
#[test]
fn an_empty_first_column_is_not_filled_from_the_next() {
    let text = |first: &str| {
        let rows = widths().map(|w| {
            let t = pillar(w, 600.0, 633.0);
            format!("{w}\t{:.6}\t{:.6}\n", t.norm(), t.arg())
        });
        let rows: String = rows.collect();
        format!("width (nm)\tabs(t)\tphase (rad)\n{first}{rows}")
    };
    assert!(read(&text("")).is_ok());
    for empty in ["\t90\t0.5\t0.1\n", "\t0.5\t0.1\n"] {
        let lines = text("70\t0.5\t0.1\n").replacen("80\t", &format!("{empty}80\t"), 1);
        assert!(read(&lines).is_err(), "{empty:?}");
    }
    let words = read(&text("").replacen("\n90\t", "\n\t", 1)).unwrap_err().to_string();
    assert!(words.contains(":3:") || words.contains("line 3"), "{words}");
    assert!(words.contains("no number in the column `width (nm)`"), "{words}");
    // An index without a name, as pandas writes it.
    let indexed = text("").replace('\n', "\n0\t");
    let indexed = format!("\t{}", indexed.trim_end_matches("0\t"));
    assert!(read(&indexed).is_ok());
}
