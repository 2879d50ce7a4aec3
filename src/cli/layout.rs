//! `metalith layout`: a design becomes the files that a cleanroom writes.

use std::path::PathBuf;

use clap::Args;
use metalith::{Design, Hierarchy, PillarArray, Result, write_apertures, write_layer_properties, write_pillars};

use super::{Outcome, Terminal};

/// Write the pillar layout, the aperture layout and the layer colours of a design.
#[derive(Args)]
#[command(after_help = "Example:\n  metalith layout designs/mini_3x3.toml --out out/mini --hierarchy flat")]
pub struct LayoutArgs {
    /// The design file.
    design: PathBuf,

    #[command(flatten)]
    target: Target,

    /// Print what was written as JSON.
    #[arg(long)]
    json: bool,
}

/// Where files go and how they are nested.
#[derive(Args)]
pub struct Target {
    /// Folder for the files, created if need be; `out/NAME` of the design if left out.
    #[arg(long, short, value_name = "FOLDER")]
    out: Option<PathBuf>,

    /// How the geometry is nested, instead of what the design says.
    #[arg(long, value_enum)]
    hierarchy: Option<HierarchyArg>,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum HierarchyArg {
    /// What symmetry leaves unique, once.
    Folded,
    /// One reference a pillar.
    Sref,
    /// One square a pillar.
    Flat,
}

impl Target {
    /// The folder that the files of a design go to.
    pub fn folder(&self, design: &Design) -> PathBuf {
        self.out
            .clone()
            .unwrap_or_else(|| PathBuf::from("out").join(&design.name))
    }

    /// The hierarchy that is asked for.
    pub fn hierarchy(&self, design: &Design) -> Hierarchy {
        match self.hierarchy {
            None => design.layout.hierarchy,
            Some(HierarchyArg::Folded) => Hierarchy::Folded,
            Some(HierarchyArg::Sref) => Hierarchy::Sref,
            Some(HierarchyArg::Flat) => Hierarchy::Flat,
        }
    }
}

pub fn run(args: &LayoutArgs, terminal: &Terminal) -> Result<Outcome> {
    let design = Design::read(&args.design)?;
    terminal.stop_on_interrupt();
    let folder = args.target.folder(&design);
    let hierarchy = args.target.hierarchy(&design);
    let array = PillarArray::build(&design, terminal)?;
    let file = |suffix: &str| folder.join(format!("{}{suffix}", design.name));
    let pillars = write_pillars(&design, &array, hierarchy, &file("_pillars.gds"), terminal)?;
    let apertures = write_apertures(&design, &file("_apertures.gds"))?;
    write_layer_properties(&design, &file(".lyp"))?;
    terminal.clear();
    for remark in &pillars.remarks {
        terminal.say(&format!("note: {remark}"));
    }
    if args.json {
        let written = serde_json::json!({
            "design": design.name,
            "digest": design.digest(),
            "hierarchy": hierarchy,
            "pillars": array.pillars(),
            "distinct_elements": array.classes.len(),
            "files": [&pillars.path, &apertures.path, &file(".lyp")],
            "bytes": [pillars.bytes, apertures.bytes],
        });
        println!("{written:#}");
    } else {
        for written in [&pillars, &apertures] {
            println!("{}  {:.1} MB", written.path.display(), written.bytes as f64 * 1e-6);
        }
        println!("{}  open it in KLayout with the layouts", file(".lyp").display());
        println!(
            "{} pillars in {} elements, {} of them distinct",
            array.pillars(),
            array.placed.len(),
            array.classes.len()
        );
    }
    Ok(Outcome::Fine)
}
