//! `metalith layout`: a design becomes the files that a cleanroom writes.

use std::path::{Path, PathBuf};

use clap::Args;
use metalith::CalibratedModel;
use metalith::compensate::{compensate, compensated_name, write_compensation_report};
use metalith::file::file_digest;
use metalith::layout::{
    KeptPieces, LayoutFormat, OasisEncoding, PieceShard, Written, make_pieces, write_apertures_as, write_pillars_as,
    write_pillars_by_pieces,
};
use metalith::report::{count, counted, sig};
use metalith::text::hex;
use metalith::{Design, FolderLock, Hierarchy, PillarArray, Progress, Result, write_layer_properties};

use super::course::Course;
use super::out_folder::OutFolder;
use super::paths::{inputs_of, paths};
use super::{Outcome, Terminal, print_json, print_line, standard_input};

/// Write the pillar layout, the aperture layout and the layer colours of a design.
#[derive(Args)]
#[command(
    after_help = "Examples:\n  metalith layout designs/mini_3x3.toml --out out/mini --hierarchy flat\n  metalith layout designs/mini_3x3.toml --format oasis\n  metalith layout designs/mini_3x3.toml --compensate out/calibrate/session-1/model.toml"
)]
pub(crate) struct LayoutArgs {
    /// The design file.
    design: PathBuf,

    #[command(flatten)]
    target: Target,

    /// Draw pillars that have the intended size after fabrication, as the `model.toml` of `metalith calibrate` predicts it. The
    /// files are named NAME_compensated and have a report.
    #[arg(long, value_name = "MODEL")]
    compensate: Option<PathBuf>,

    /// Keep the pieces of the file in a folder while it is made: the same command goes on where an earlier run was stopped. They
    /// are removed when the layout is complete. For OASIS alone.
    #[arg(long, value_name = "FOLDER")]
    pieces: Option<PathBuf>,

    /// Make one of several shards of the pieces, and no layout: run `1/4` to `4/4`, on machines that share the folder, then the
    /// command without this option. The bytes are those of one run.
    #[arg(long, value_name = "K/N", requires = "pieces", value_parser = shard)]
    shard: Option<PieceShard>,

    /// Print names and counts of the files as JSON.
    #[arg(long)]
    json: bool,
}

fn shard(text: &str) -> std::result::Result<PieceShard, String> {
    let numbers = text.split_once('/').map(|(number, of)| (number.parse(), of.parse()));
    match numbers {
        Some((Ok(number), Ok(of))) if (1..=of).contains(&number) => Ok(PieceShard { number, of }),
        _ => Err("give a number from 1 to that of all shards, and that number, as 1/4 to 4/4".into()),
    }
}

/// Writer of the pillar layout of a design.
pub(crate) type PillarWriter<'w> =
    &'w dyn Fn(&Design, &PillarArray, Hierarchy, LayoutFormat, &Path, &dyn Progress) -> Result<Written>;

/// Folder of the files, and the nesting of their geometry.
#[derive(Args)]
pub(crate) struct Target {
    /// Folder for the files, created if it does not exist; `out/NAME` of the design if left out.
    #[arg(long, short, value_name = "FOLDER")]
    out: Option<PathBuf>,

    /// Nesting of the geometry; `hierarchy` in [layout] of the design if left out.
    #[arg(long, value_enum)]
    hierarchy: Option<HierarchyArg>,

    #[command(flatten)]
    format: FormatArgs,
}

/// The format of layouts that are written.
#[derive(Args, Clone, Copy)]
pub(crate) struct FormatArgs {
    /// Format of the layouts; GDSII if left out.
    #[arg(long, value_enum)]
    format: Option<FormatArg>,

    /// Encoding of pillars in OASIS; implies `--format oasis`.
    #[arg(long, value_enum, value_name = "ENCODING")]
    oasis: Option<EncodingArg>,
}

#[derive(Clone, Copy, clap::ValueEnum)]
pub enum FormatArg {
    /// GDSII: every mask writer reads it.
    Gds,
    /// OASIS: files of about 1 % of the size.
    Oasis,
}

impl From<FormatArg> for LayoutFormat {
    fn from(format: FormatArg) -> Self {
        match format {
            FormatArg::Gds => Self::Gds,
            FormatArg::Oasis => Self::Oasis(OasisEncoding::Compact),
        }
    }
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum EncodingArg {
    /// Lists of places for each width: fastest to read.
    Compact,
    /// One outline for each pillar, no repetitions, one layer in a file: for mask tools.
    Plain,
    /// Lists or references, whichever is smaller for each cell.
    Smallest,
}

impl FormatArgs {
    /// The format that is asked for, if one is.
    ///
    /// # Errors
    /// If an encoding of OASIS is asked for in GDSII.
    pub(crate) fn asked(&self) -> Result<Option<LayoutFormat>> {
        let encoding = match self.oasis {
            Some(EncodingArg::Compact) | None => OasisEncoding::Compact,
            Some(EncodingArg::Plain) => OasisEncoding::Plain,
            Some(EncodingArg::Smallest) => OasisEncoding::Smallest,
        };
        match (self.format, self.oasis) {
            (Some(FormatArg::Gds), Some(_)) => Err(metalith::Error::refused(
                "option/two-formats",
                "--oasis and --format gds exclude each other",
                "leave one of them out",
            )),
            (Some(FormatArg::Gds), None) => Ok(Some(LayoutFormat::Gds)),
            (None, None) => Ok(None),
            (Some(FormatArg::Oasis), _) | (None, Some(_)) => Ok(Some(LayoutFormat::Oasis(encoding))),
        }
    }
}

/// Files that were written.
pub(crate) struct Files {
    pub pillars: Written,
    pub apertures: Written,
    pub properties: PathBuf,
}

impl Files {
    fn moved_to(mut self, folder: &Path) -> Self {
        let layouts = [&mut self.pillars, &mut self.apertures];
        let of_layouts = layouts
            .into_iter()
            .flat_map(|written| std::iter::once(&mut written.path).chain(&mut written.beside));
        for path in of_layouts.chain([&mut self.properties]) {
            *path = folder.join(path.file_name().expect("it is a file"));
        }
        self
    }
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum HierarchyArg {
    /// Each unique part once; its symmetric copies as rotated and mirrored references.
    Folded,
    /// One reference for each pillar.
    Sref,
    /// One outline for each pillar.
    Flat,
}

impl Target {
    /// The folder that the files of a design of this name go to, which is read from `path`.
    ///
    /// # Errors
    /// As [`OutFolder::of`].
    pub(crate) fn folder(&self, name: &str, path: &Path) -> Result<OutFolder> {
        OutFolder::of(self.out.as_deref(), Path::new("out").join(name), path)
    }

    /// Write all files of a design into the folder of a turn, with others that `also` writes beside them and of them; `pillars` writes
    /// the pillar layout. Files named in
    /// `stale` go.
    pub(crate) fn publish(
        &self,
        (design, array): (&Design, &PillarArray),
        turn: &FolderLock,
        stale: &[&str],
        pillars: PillarWriter<'_>,
        also: impl FnOnce(&Files, &Path) -> Result<()>,
        terminal: &Terminal,
    ) -> Result<Files> {
        // Layouts of several formats may lie side by side.
        let set = format!(
            "{}_{}",
            design.name,
            self.format.asked()?.unwrap_or_default().extension()
        );
        let files = turn.publish(&set, stale, |folder| {
            let files = self.write(design, array, folder, pillars, terminal)?;
            also(&files, folder)?;
            Ok(files)
        })?;
        Ok(files.moved_to(turn.folder()))
    }

    fn write(
        &self,
        design: &Design,
        array: &PillarArray,
        folder: &Path,
        pillars: PillarWriter<'_>,
        terminal: &Terminal,
    ) -> Result<Files> {
        let file = |suffix: &str| folder.join(format!("{}{suffix}", design.name));
        let properties = file(".lyp");
        let format = self.format.asked()?.unwrap_or_default();
        let named = |what: &str| file(&format!("_{what}.{}", format.extension()));
        let hierarchy = self.hierarchy(design);
        let pillars = pillars(design, array, hierarchy, format, &named("pillars"), terminal)?;
        let apertures = write_apertures_as(design, format, &named("apertures"))?;
        write_layer_properties(design, &properties)?;
        for remark in &pillars.remarks {
            terminal.say(&format!("note: {remark}"));
        }
        Ok(Files {
            pillars,
            apertures,
            properties,
        })
    }

    /// The hierarchy that is asked for.
    fn hierarchy(&self, design: &Design) -> Hierarchy {
        match self.hierarchy {
            None => design.layout.hierarchy,
            Some(HierarchyArg::Folded) => Hierarchy::Folded,
            Some(HierarchyArg::Sref) => Hierarchy::Sref,
            Some(HierarchyArg::Flat) => Hierarchy::Flat,
        }
    }
}

impl LayoutArgs {
    /// The pieces that are kept of a design, and the encoding that they are of.
    fn kept_pieces(&self, design: &Design, terminal: &Terminal) -> Result<Option<(KeptPieces, OasisEncoding)>> {
        let Some(folder) = &self.pieces else {
            return Ok(None);
        };
        let LayoutFormat::Oasis(encoding) = self.target.format.asked()?.unwrap_or_default() else {
            return Err(metalith::Error::refused(
                "option/pieces-of-gdsii",
                "--pieces keeps the pieces of a layout in OASIS",
                "give --oasis compact too, or leave out --pieces",
            ));
        };
        let model = self.compensate.as_deref().map(file_digest).transpose()?;
        let layout = format!(
            "metalith {}\ndesign {}\nhierarchy {:?}\nencoding {encoding:?}\nmodel {}\n",
            env!("CARGO_PKG_VERSION"),
            design.digest(),
            self.target.hierarchy(design),
            model.map_or_else(|| "none".into(), |digest| hex(&digest)),
        );
        Ok(Some((KeptPieces::open(folder, &layout, terminal)?, encoding)))
    }
}

pub(crate) fn run(args: &LayoutArgs, terminal: &Terminal) -> Result<Outcome> {
    let mut design = standard_input::design(&args.design, terminal)?;
    let warnings = design.warnings()?;
    terminal.warnings(&warnings);
    let name = match &args.compensate {
        Some(_) => compensated_name(&design.name),
        None => design.name.clone(),
    };
    let out = args.target.folder(&name, &args.design)?;
    terminal.follow(Course::of_layout(&design));
    terminal.stop_on_interrupt();
    // What is written once is made once, when it is written; a model of the process compares all pillars many times.
    let is_written_once = args.compensate.is_none() && args.target.hierarchy(&design) == Hierarchy::Folded;
    let mut array = if is_written_once {
        PillarArray::build_to_write(&design, terminal)?
    } else {
        PillarArray::build(&design, terminal)?
    };
    let mut compensation = None;
    if let Some(path) = &args.compensate {
        let model = CalibratedModel::read(path)?;
        let compensated = compensate(&design, &array, &model, terminal)?;
        design.name = name;
        let intended = std::mem::replace(&mut array, compensated.array.clone());
        compensation = Some((model, intended, compensated));
    }
    let pieces = args.kept_pieces(&design, terminal)?;
    if let Some((kept, _)) = &pieces
        && let found @ 1.. = kept.count()?
    {
        terminal.say(&format!("{} made before, not made again", counted(found, "piece")));
    }
    if let (Some((kept, encoding)), Some(shard)) = (&pieces, args.shard) {
        make_pieces(
            &design,
            &array,
            args.target.hierarchy(&design),
            *encoding,
            (kept, shard),
            terminal,
        )?;
        terminal.clear();
        if args.json {
            print_json(&serde_json::json!({ "pieces": args.pieces, "shard": [shard.number, shard.of] }));
        } else if !terminal.is_quiet() {
            print_line!(
                "shard {} of {} is made; when all are, the same command without --shard writes the layout",
                shard.number,
                shard.of
            );
        }
        return Ok(Outcome::Fine);
    }
    let inputs = inputs_of(&design, args.compensate.as_deref());
    let turn = out.turn(paths(&inputs), terminal)?;
    let report = |files: &Files, folder: &Path| match &compensation {
        Some((model, intended, compensated)) => {
            let pillars = &files.pillars.path;
            write_compensation_report(&design, intended, compensated, model, pillars, folder, terminal)
        }
        None => Ok(()),
    };
    let writer: PillarWriter<'_> = match &pieces {
        None => &write_pillars_as,
        Some((kept, encoding)) => &|design, array, hierarchy, _, path, progress| {
            write_pillars_by_pieces(design, array, hierarchy, *encoding, (path, kept), progress)
        },
    };
    let written = args
        .target
        .publish((&design, &array), &turn, &[], writer, report, terminal);
    if let (Err(_), Some((kept, _))) = (&written, &pieces) {
        let made = counted(kept.count()?, "piece");
        terminal.say(&format!("{made} kept: the same command goes on from there"));
    }
    let written = written?;
    if let Some((kept, _)) = pieces {
        kept.remove()?;
    }
    terminal.clear();
    if args.json {
        let json = serde_json::json!({
            "design": design.name,
            "digest": design.digest(),
            "warnings": warnings,
            "hierarchy": args.target.hierarchy(&design),
            "pillars": array.pillars(),
            "distinct_elements": array.classes.len(),
            "files": [&written.pillars.path, &written.apertures.path, &written.properties],
            "bytes": [written.pillars.bytes, written.apertures.bytes],
            "compensation": compensation.as_ref().map(|c| &c.2.summary),
        });
        print_json(&json);
    } else if !terminal.is_quiet() {
        for file in [&written.pillars, &written.apertures] {
            print_line!("{}  {:.3} MB", file.path.display(), file.bytes as f64 * 1e-6);
            for beside in &file.beside {
                print_line!("{}  a further layer of it", beside.display());
            }
        }
        print_line!(
            "{}  for KLayout: names and colours of the layers",
            written.properties.display()
        );
        print_line!(
            "{} pillars in {}, {} of them distinct",
            array.pillars(),
            counted(array.placed.len(), "element"),
            array.classes.len()
        );
        if let Some((_, _, compensated)) = &compensation {
            let s = &compensated.summary;
            print_line!(
                "compensated: widths moved by {} nm rms; error as made {} uncorrected, {} corrected; {} pillars newly at an end of the range",
                sig(s.moved_rms_nm, 3),
                sig(s.error[0], 3),
                sig(s.error[1], 3),
                count(s.at_limit)
            );
            for quantity in compensated.not_applied() {
                print_line!("{quantity}");
            }
            let report = out.path.join("compensation.html");
            print_line!("{}", report.display());
        }
    }
    Ok(Outcome::Fine)
}
