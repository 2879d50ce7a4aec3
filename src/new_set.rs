//! A measured set begun from a layout and a folder of frames: what their names and the layout state is filled in, the rest is
//! left open.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use crate::schema::FileKind;
use metalith_core::{AtomicFile, Error, FolderLock, LayerNumber, Progress, Result};
use metalith_gds::Layout;
use metalith_gds::extract::{ExtractedElement, ExtractionPlan, extract};
use metalith_pillars::PillarShape;
use metalith_report::{Cell, Column, ImageGrid, Page, Table};
use metalith_sensor::frame;

use crate::frame_names::{NamedConditions, conditions};

/// Mark of a key that only the user knows.
const OPEN: &str = "# state this";

/// Most frames of one set.
const MOST_FRAMES: usize = 10_000;

/// Most frames that the page shows.
const SHOWN: usize = 64;

/// Largest edge of a window (pixels), as sets take them.
const MOST_PIXELS: usize = 1024;

/// A frame with the conditions that its name states.
#[derive(Clone, Debug)]
pub struct RecognisedFrame {
    pub file: PathBuf,
    pub conditions: NamedConditions,
    /// Rows and columns, or what is wrong with the file.
    pub size: std::result::Result<(usize, usize), String>,
}

/// A set that was begun.
#[derive(Clone, Debug)]
pub struct NewSet {
    pub frames: Vec<RecognisedFrame>,
    /// Keys that the user must state, with their sections.
    pub open: Vec<String>,
    /// `measurement.toml`.
    pub file: PathBuf,
    /// The page of the frames.
    pub page: PathBuf,
}

/// Begin a set: write `measurement.toml` and a page of the frames beside it. `frames` are files and folders of frames; the pillars
/// are on `layer` of the layout, or where it is left out on that of [`Layout::pillar_layer`].
///
/// # Errors
/// If `out` exists, the layout has no element on this layer, there is no frame, or a file cannot be written.
pub fn new_set(
    layout: &Layout,
    layer: Option<LayerNumber>,
    frames: &[PathBuf],
    out: &Path,
    progress: &dyn Progress,
) -> Result<NewSet> {
    if out.exists() {
        return Err(Error::refused(
            "new/exists",
            format!("{} exists", out.display()),
            "give another file with --out; nothing is ever replaced",
        ));
    }
    let frames = recognised(&files_of(frames)?);
    progress.begin("pillars of the layout", 0);
    let layer = match layer {
        Some(layer) => layer,
        None => layout.pillar_layer(progress)?,
    };
    let found = extract(layout, &ExtractionPlan::discover(layer), progress)?;
    let folder = out.parent().unwrap_or(Path::new(""));
    let mut open = Vec::new();
    let text = text(
        layout.path(),
        layer,
        (&found.elements, found.shape),
        &frames,
        folder,
        &mut open,
    );
    let page = out.with_extension("html");
    let name = |path: &Path| path.file_name().unwrap_or_default().to_owned();
    let set = name(out).to_string_lossy().into_owned();
    FolderLock::wait(folder, progress, || ())?.replace(&set, &[], |folder| {
        write_page(&folder.join(name(&page)), &frames, &open)?;
        AtomicFile::write(&folder.join(name(out)), text.as_bytes())
    })?;
    FileKind::Set.write_beside(out)?;
    Ok(NewSet {
        frames,
        open,
        file: out.to_owned(),
        page,
    })
}

/// Frames among these files and in these folders, by name.
fn files_of(given: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let is_frame = |path: &PathBuf| {
        let ending = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
        frame::ENDINGS.iter().any(|known| ending.eq_ignore_ascii_case(known))
    };
    let mut all = Vec::new();
    for path in given {
        if path.is_dir() {
            let entries = std::fs::read_dir(path).map_err(Error::io("read", path))?;
            all.extend(entries.filter_map(|e| Some(e.ok()?.path())).filter(is_frame));
        } else {
            all.push(path.clone());
        }
    }
    all.sort();
    all.dedup();
    if all.is_empty() || all.len() > MOST_FRAMES {
        return Err(Error::refused(
            "new-set/frames",
            format!("there are {} frames", all.len()),
            format!("give 1 to {MOST_FRAMES} frames of NPY, PNG, TIFF or FITS, or their folder"),
        ));
    }
    Ok(all)
}

fn recognised(files: &[PathBuf]) -> Vec<RecognisedFrame> {
    let of = |file: &PathBuf| RecognisedFrame {
        file: file.clone(),
        conditions: conditions(&file.file_stem().unwrap_or_default().to_string_lossy()),
        size: frame::size(file),
    };
    files.iter().map(of).collect()
}

/// Lines of a file, with a list of the keys that are left open.
struct Lines<'a> {
    text: String,
    section: String,
    open: &'a mut Vec<String>,
}

impl Lines<'_> {
    fn section(&mut self, head: &str) {
        self.section = head.into();
        let _ = writeln!(self.text, "\n{head}");
    }

    fn key(&mut self, key: &str, value: impl std::fmt::Display) {
        let _ = writeln!(self.text, "{key} = {value}");
    }

    /// A key that only the user knows, with an example.
    fn state(&mut self, key: &str, example: &str, meaning: &str) {
        let _ = writeln!(self.text, "# {key} = {example}  {OPEN}: {meaning}");
        let name = format!("{key} of {}", self.section);
        if !self.open.contains(&name) {
            self.open.push(name);
        }
    }

    fn known(&mut self, key: &str, value: Option<String>, example: &str, meaning: &str) {
        match value {
            Some(value) => self.key(key, value),
            None => self.state(key, example, meaning),
        }
    }
}

/// Text as TOML writes it.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "/").replace('"', "\\\""))
}

/// A path as seen from a folder, where it is in it; else the whole path.
fn path_from(path: &Path, folder: &Path) -> String {
    let whole = |p: &Path| std::fs::canonicalize(p).unwrap_or_else(|_| p.to_owned());
    let folder = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    let (path, folder) = (whole(path), whole(folder));
    path.strip_prefix(&folder).unwrap_or(&path).display().to_string()
}

/// Numbers of elements along x and y: places of their centres among all, about the middle one.
fn indices(centres: &[[i64; 2]]) -> Vec<[i64; 2]> {
    let axes = [0, 1].map(|axis| centres.iter().map(|c| c[axis]).collect::<BTreeSet<i64>>());
    let place = |axis: usize, nm: i64| {
        let all = &axes[axis];
        all.iter().take_while(|v| **v < nm).count() as i64 - (all.len() as i64 - 1) / 2
    };
    centres.iter().map(|c| [place(0, c[0]), place(1, c[1])]).collect()
}

fn text(
    layout: &Path,
    layer: LayerNumber,
    (elements, shape): (&[ExtractedElement], PillarShape),
    frames: &[RecognisedFrame],
    folder: &Path,
    open: &mut Vec<String>,
) -> String {
    let mut lines = Lines {
        text: FileKind::Set.reference()
            + "# Keys are explained in docs/measured-sets.md. Lines with `state this` are for you: remove the first #.\n",
        section: "the file".into(),
        open,
    };
    lines.key("schema", 1);
    lines.key(
        "title",
        quoted(&format!(
            "chip of {}",
            layout.file_stem().unwrap_or_default().to_string_lossy()
        )),
    );
    lines.key("layout", quoted(&path_from(layout, folder)));
    lines.section("[layout_layers]");
    lines.key("pillars", format!("[{}, {}]", layer.layer, layer.datatype));
    lines.key(
        "apertures",
        format!("[{}, {}]  # as the layout has them", layer.layer + 1, layer.datatype),
    );
    stack(&mut lines, elements, shape);
    lines.section("[source]");
    lines.key("kind", "\"collimated\"");
    lines.state("divergence_mrad", "2.0", "full angle of the light (mrad)");
    lines.key("divergence_axes", "\"uniform disc\"");
    camera(&mut lines, frames);
    let mut leds: Vec<f64> = frames.iter().filter_map(|f| f.conditions.led_nm).collect();
    leds.sort_by(f64::total_cmp);
    leds.dedup();
    if leds.is_empty() {
        lines.section("[[led]]");
        lines.state("centre_nm", "530", "wavelength (nm); no name of a frame has one");
        lines.state("fwhm_nm", "33.0", "full width at half maximum (nm)");
    }
    for led in &leds {
        lines.section("[[led]]");
        lines.key("centre_nm", led);
        lines.state("fwhm_nm", "33.0", "full width at half maximum (nm)");
    }
    let centres: Vec<[i64; 2]> = elements.iter().map(|e| e.site.centre_nm).collect();
    let known = indices(&centres);
    for (element, index) in elements.iter().zip(&known) {
        lines.section("[[element]]");
        lines.key("index", format!("{index:?}"));
        lines.key(
            "centre_um",
            format!("{:?}", element.site.centre_nm.map(|nm| nm as f64 * 1e-3)),
        );
        lines.state("aperture_diameter_um", "140.0", "diameter of its opening (um)");
    }
    let only = <[[i64; 2]; 1]>::try_from(known.clone()).ok().map(|[one]| one);
    captures(&mut lines, frames, &known, only, &leds, folder);
    lines.text
}

fn stack(lines: &mut Lines<'_>, elements: &[ExtractedElement], shape: PillarShape) {
    let first = elements.first();
    lines.section("[stack]");
    lines.known(
        "pitch_nm",
        first.map(|e| e.site.lattice.pitch_nm().to_string()),
        "350",
        "pitch of the lattice (nm)",
    );
    if let Some((word, _)) = PillarShape::CHOICES.iter().find(|(_, own)| *own == shape) {
        lines.key("shape", quoted(word));
    }
    if first.is_some_and(|e| !e.site.lattice.is_square()) {
        lines.key("lattice", "\"hexagonal\"");
    }
    lines.state("pillar_height_nm", "700", "height of the pillars (nm)");
    lines.state("pillar_index", "\"film_nk.csv\"", "table of the index of the film");
    lines.key(
        "substrate",
        "\"fused_silica_malitson_1965\"  # correct it for another substrate",
    );
    lines.key("ambient_index", "1.0");
    lines.key("incidence", "\"substrate\"");
    let radius_um = elements.iter().map(|e| e.widths.circle_um()).fold(0.0, f64::max);
    // To the outermost pillars and half a pitch beyond.
    let pitch_um = first.map_or(0.0, |e| e.site.lattice.pitch_um());
    let diameter_um = ((2.0 * radius_um + pitch_um) * 10.0).ceil() / 10.0;
    lines.key(
        "lens_diameter_um",
        format!("{diameter_um:?}  # to the outermost pillars of the layout"),
    );
    lines.state("focal_length_um", "336.0", "focal length as designed (um)");
}

fn camera(lines: &mut Lines<'_>, frames: &[RecognisedFrame]) {
    lines.section("[camera]");
    lines.state(
        "pixel_um",
        "0.5",
        "edge of a pixel in the plane of the image, relay included (um)",
    );
    let sizes: BTreeSet<(usize, usize)> = frames.iter().filter_map(|f| f.size.clone().ok()).collect();
    let size = (sizes.len() == 1).then(|| sizes.iter().next().copied()).flatten();
    let size = size.filter(|(rows, cols)| rows.max(cols) <= &MOST_PIXELS);
    lines.known(
        "rows",
        size.map(|s| s.0.to_string()),
        "128",
        "rows of each frame, all alike, at most 1024",
    );
    lines.known(
        "cols",
        size.map(|s| s.1.to_string()),
        "128",
        "columns of each frame, all alike, at most 1024",
    );
    lines.state("black_level_dn", "40.0", "mean without light (DN)");
    lines.state("gain_e_per_dn", "5.0", "electrons per DN");
    lines.state(
        "read_noise_dn",
        "2.0",
        "standard deviation of one frame without light (DN)",
    );
    lines.state("saturation_dn", "4095", "value of a full pixel (DN)");
    lines.key("registration_sigma_px", "0.5");
    lines.key("flux_sigma", "0.01");
}

/// A section for each measurement; frames that differ by exposure alone are joined.
fn captures(
    lines: &mut Lines<'_>,
    frames: &[RecognisedFrame],
    known: &[[i64; 2]],
    only: Option<[i64; 2]>,
    leds: &[f64],
    folder: &Path,
) {
    let mut done: Vec<&NamedConditions> = Vec::new();
    let without_exposure = |c: &NamedConditions| NamedConditions {
        exposure_ms: None,
        ..c.clone()
    };
    for frame in frames {
        let own = &frame.conditions;
        let alike: Vec<&RecognisedFrame> = match own.exposure_ms {
            None => vec![frame],
            Some(_) => frames
                .iter()
                .filter(|f| f.conditions.exposure_ms.is_some())
                .filter(|f| without_exposure(&f.conditions) == without_exposure(own))
                .collect(),
        };
        if done
            .iter()
            .any(|d| own.exposure_ms.is_some() && without_exposure(d) == without_exposure(own))
        {
            continue;
        }
        done.push(own);
        lines.section("[[capture]]");
        let is_joined = alike.len() > 1;
        if !is_joined {
            lines.key("file", quoted(&path_from(&frame.file, folder)));
        }
        let element = own.element.filter(|e| known.contains(e)).or(only);
        let meaning = match own.element {
            Some(named) => format!("its name says {named:?}, and the layout has no such element"),
            None => "index of its [[element]]".into(),
        };
        lines.known("element", element.map(|e| format!("{e:?}")), "[0, 0]", &meaning);
        let led = own.led_nm.or_else(|| <[f64; 1]>::try_from(leds).ok().map(|[one]| one));
        lines.known("led_nm", led.map(|nm| nm.to_string()), "530", "centre of its LED (nm)");
        match own.aoi_deg {
            Some(angle) => lines.key("aoi_deg", format!("{angle:?}")),
            None => lines.key(
                "aoi_deg",
                "[0.0, 0.0]  # correct it for light that is not along the axis",
            ),
        }
        let plane = own.plane.map_or_else(String::new, |p| format!(" of plane {p}"));
        lines.known(
            "distance_um",
            own.distance_um.map(|um| um.to_string()),
            "336.0",
            &format!("distance from the pillar tops{plane} (um)"),
        );
        lines.key(
            "window_centre_um",
            "[0.0, 0.0]  # correct it for a window beside the axis",
        );
        let light = |lines: &mut Lines<'_>| {
            lines.state(
                "scale_dn",
                "0.6",
                "DN of the open aperture, see docs/guide/calibrate.md",
            );
            lines.state("frames", "64", "frames in the mean");
        };
        if is_joined {
            for exposure in alike {
                lines.section("[[capture.exposure]]");
                lines.key("file", quoted(&path_from(&exposure.file, folder)));
                light(lines);
            }
        } else {
            light(lines);
        }
    }
}

impl RecognisedFrame {
    /// Conditions in words, each empty where the name states none: element, colour, distance, angle, exposure, pixels.
    pub fn words(&self) -> [String; 6] {
        let c = &self.conditions;
        let distance = c.distance_um.map(|um| format!("{um} um"));
        [
            c.element.map_or_else(String::new, |e| format!("{e:?}")),
            c.led_nm.map_or_else(String::new, |nm| format!("{nm} nm")),
            distance
                .or_else(|| c.plane.map(|p| format!("plane {p}")))
                .unwrap_or_default(),
            c.aoi_deg.map_or_else(String::new, |a| format!("{a:?} deg")),
            c.exposure_ms.map_or_else(String::new, |ms| format!("{ms} ms")),
            match &self.size {
                Ok((rows, cols)) => format!("{rows} x {cols}"),
                Err(what) => what.clone(),
            },
        ]
    }

    /// Name of the file.
    pub fn name(&self) -> String {
        self.file.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }
}

impl NewSet {
    /// Names of the columns of a table of frames.
    pub const COLUMNS: [&str; 6] = ["element", "colour", "distance", "angle", "exposure", "pixels"];

    /// Keys with values that neither layout nor names state.
    pub const ASSUMED: [&str; 4] = [
        "substrate, ambient_index of [stack]: pillars on fused silica in air",
        "registration_sigma_px, flux_sigma of [camera]: 0.5 pixels, 1 %",
        "aoi_deg of [[capture]]: along the axis, where no name has an angle",
        "window_centre_um of [[capture]]: window about the axis of the element",
    ];
}

fn write_page(path: &Path, frames: &[RecognisedFrame], open: &[String]) -> Result<()> {
    let mut page = Page::new("Frames of a new set", metalith_report::counted(frames.len(), "frame"));
    page.section("State these in measurement.toml");
    page.list(open);
    page.section("Correct these where they are assumed");
    page.list(NewSet::ASSUMED);
    page.section("Recognised by the names of the files");
    let mut table = Table::new(["frame"].into_iter().chain(NewSet::COLUMNS).map(Column::text));
    for frame in frames {
        let words = frame.words();
        table.row(
            [Cell::code(frame.name())]
                .into_iter()
                .chain(words.iter().map(|w| w.as_str().into())),
        );
    }
    page.table(table);
    let mut grid = ImageGrid::new("Frames", 4).values("signal", "DN");
    for frame in frames.iter().take(SHOWN) {
        let Ok((rows, cols)) = frame.size else { continue };
        if rows.max(cols) > MOST_PIXELS {
            continue;
        }
        if let Ok(recorded) = frame::read(&frame.file, rows, cols, f64::MAX) {
            grid.image(frame.name(), recorded.dn.mapv(f64::from));
        }
    }
    page.figure(
        grid.caption("Rows grow upwards, as +y of the layout: a spot that runs to the other side is mirrored."),
    );
    page.write(path)
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_core::Silent;

    /// A file that is begun says what is missing, and nothing else is wrong with it once this is filled in.
    #[test]
    fn a_set_is_begun_from_a_layout_and_frames() {
        let folder = tempfile::tempdir().unwrap();
        let whole = metalith_testing::session::small_set(folder.path());
        std::fs::remove_file(whole).unwrap();
        let out = folder.path().join("measurement.toml");
        let layout = Layout::open(&folder.path().join("layout.gds")).unwrap();
        let begun = new_set(&layout, None, &[folder.path().to_owned()], &out, &Silent).unwrap();
        assert_eq!(begun.frames.len(), 8);
        assert!(begun.page.is_file());
        let text = std::fs::read_to_string(&out).unwrap();
        for part in [
            "pitch_nm = 350",
            "file = \"e1_560_z1.npy\"",
            "element = [1, 0]",
            "led_nm = 560",
            "rows = 48",
            "centre_nm = 500",
        ] {
            assert!(text.contains(part), "{part} is not in:\n{text}");
        }
        let wanted = begun
            .open
            .iter()
            .map(|o| o.split(' ').next().unwrap())
            .collect::<BTreeSet<_>>();
        assert!(
            wanted.contains("scale_dn") && wanted.contains("distance_um") && !wanted.contains("rows"),
            "{wanted:?}"
        );
        assert_eq!(
            text.lines().filter(|l| l.contains(OPEN)).count(),
            text.matches(OPEN).count()
        );
        let stated: String = text
            .lines()
            .map(|line| match line.strip_prefix("# ").filter(|l| l.contains(OPEN)) {
                Some(line) => format!("{line}\n"),
                None => format!("{line}\n"),
            })
            .collect();
        std::fs::write(&out, stated).unwrap();
        let read = metalith_calibrate::MeasuredSet::read(&out, &metalith_gds::extract::PillarsAt::STATED, &Silent);
        assert_eq!(read.unwrap().measurements.len(), 8);
        let again = new_set(&layout, None, &[folder.path().to_owned()], &out, &Silent);
        assert_eq!(again.unwrap_err().id(), "new/exists");
    }
}
