//! `metalith dataset`: frames and scenes for those who train a restoration.

use std::path::{Path, PathBuf};

use clap::Args;
use metalith::file::InputFiles;
use metalith::imaging::scene::{images_in, read_far_scene};
use metalith::imaging::{
    DatasetManifest, DatasetOrigin, ImagingSystem, check_images, check_pairs_apart, write_dataset,
};
use metalith::report::counted;
use metalith::study::{PairsRequest, is_planned, plan_pairs};
use metalith::{Error, Result};

use super::camera_args::{CameraArgs, CameraFiles};
use super::paths::paths;
use super::reading::ReadingArgs;
use super::standard_input::{self, InputFile};
use super::{Outcome, Terminal, print_line};

/// Simulate the frame of every image of a folder, for learning: frames, pictures of an ideal camera, and a manifest.
///
/// Images are used in the order of their names. They must have one size; all are checked before the work begins. The noise of
/// an image depends only on its bytes and the seed. Undamaged pairs of the same image, seed, chip and camera are reused, so an
/// interrupted run continues.
#[derive(Args)]
#[command(
    after_help = "Example:\n  metalith dataset photographs --layout out/prototype_3x3/prototype_3x3_pillars.gds \\\n    --camera cameras/gt1930.toml --design designs/prototype_3x3.toml --out out/pairs"
)]
pub(crate) struct DatasetArgs {
    /// Folder of PNG, JPEG, TIFF, EXR or NPY images.
    images: PathBuf,

    /// The pillar layout; `-` for standard input.
    #[arg(long)]
    layout: PathBuf,

    #[command(flatten)]
    reading: ReadingArgs,

    #[command(flatten)]
    with: CameraArgs,

    /// Seed of the noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,

    /// Folder for the pairs.
    #[arg(long, short, value_name = "FOLDER")]
    out: PathBuf,

    /// Only plan the set, as shards that any number of machines can run. `metalith study run`, `submit`, `status` and `merge`
    /// work on the folder.
    #[arg(long)]
    plan: bool,

    /// Images in a shard; as many as take ten minutes if left out. The set does not depend on it.
    #[arg(long, value_name = "N", requires = "plan", value_parser = clap::value_parser!(u64).range(1..))]
    images_per_shard: Option<u64>,
}

/// The folder of a set that shards make.
fn plan(args: &DatasetArgs, images: Vec<PathBuf>, terminal: &Terminal) -> Result<Outcome> {
    if args.reading.layer.is_some() || args.reading.file.top.is_some() {
        return Err(Error::refused(
            "option/not-with-plan",
            "--layer or --top is given with --plan, and shards read the layout as the design says",
            "state the layer in [layout.layers] of the design, or write the cell to its own file: metalith convert IN OUT --top CELL",
        ));
    }
    standard_input::named(standard_input::OF_PLANS, [args.with.design.as_path(), &args.layout])?;
    let request = PairsRequest {
        design: args.with.design.clone(),
        layout: args.layout.clone(),
        camera: args.with.camera.clone(),
        model: args.with.model.clone(),
        field_deg: args.with.field_deg,
        exposure: args.with.exposure.stated(),
        seed: args.seed,
        images,
    };
    let plan = plan_pairs(&request, &args.out, args.images_per_shard, terminal)?;
    terminal.clear();
    print_line!(
        "{} of {:.2} s in {} of {}: {}",
        counted(plan.digests.len(), "image"),
        plan.seconds_per_image,
        counted(plan.cut().shards() as usize, "shard"),
        plan.images_per_shard,
        args.out.display()
    );
    Ok(Outcome::Fine)
}

pub(crate) fn run(args: &DatasetArgs, terminal: &Terminal) -> Result<Outcome> {
    terminal.stop_on_interrupt();
    let files = args.with.read(terminal)?;
    let images = images_in(&args.images)?;
    let inputs = files.inputs(&args.with, paths(&images).chain([args.layout.as_path()]));
    let CameraFiles {
        mut design,
        camera,
        model,
    } = files;
    args.reading.aim(&mut design);
    if args.plan {
        return plan(args, images, terminal);
    }
    if is_planned(&args.out) {
        return Err(Error::refused(
            "dataset/folder-holds-plan",
            format!("{} holds a plan, which is carried out in shards", args.out.display()),
            "make them by `metalith study run FOLDER --missing`, or name another folder with --out",
        ));
    }
    check_pairs_apart(images.len(), &args.out, &InputFiles::of(paths(&inputs)))?;
    check_images(&images, terminal)?;
    let read = |path: &Path| read_far_scene(path, args.with.field_deg);
    let layout = InputFile::of(&args.layout)?.below(&args.reading.file, terminal)?;
    let origin = DatasetOrigin::of(&design, &layout, &camera, args.with.model.as_deref())?;
    let system = ImagingSystem::open(&design, &layout, &camera, model.as_ref(), &read(&images[0])?, terminal)?;
    let notes = system.light().notes().into_iter().chain(system.direction_notes());
    notes.for_each(|note| terminal.say(&note));
    let operator = system.simulation();
    let head = DatasetManifest::of(&system, origin, args.seed);
    let turn = terminal.turn_at(&args.out, paths(&inputs))?;
    let manifest = write_dataset(&system, &operator, &images, &read, head, &turn, terminal)?;
    terminal.clear();
    print_line!("{} in {}", counted(manifest.pairs.len(), "pair"), args.out.display());
    Ok(Outcome::Fine)
}
