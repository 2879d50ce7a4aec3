//! The table of optimised phases in `docs/method/optimise.md`, made again: `cargo run --release --example merits`
//!
//! Geometric mean (smallest) of the Strehl ratio on axis, half way between the wavelengths that were optimised on,
//! for two focal lengths, two cells and several limits on the phase step. The rigorous cells use the table that
//! `metalith` keeps, and make it first if there is none. A number after `--` is that of blocks after the sweeps
//! over single rings, 0 for none.

use std::path::Path;
use std::time::Instant;

use metalith::cell::{InversePolynomial, PublishedCell, RigorousCell, cache_folder};
use metalith::design::SolverSpec;
use metalith::optimise::{Checkpoint, OptimiseTask};
use metalith::{CellModel, Design, Error, Fidelity, Result, Silent};

fn main() -> Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("designs");
    let shipped = Design::read(&folder.join("broadband_3x3.toml"))?;
    let blocks = match std::env::args().nth(1) {
        Some(number) => number
            .parse()
            .map_err(|_| Error::refused("example/merits", "no number of blocks", "give 0 or more"))?,
        None => 60,
    };
    println!("focal length  cell       mapping    limit  Strehl (smallest)   wall s");
    let published = InversePolynomial::published();
    for focal_length_um in [2400.0, 2000.0] {
        for (fidelity, mapping, limits) in [
            (Fidelity::Rigorous, "design's", &[0.2, 0.3][..]),
            (Fidelity::Rigorous, "published", &[0.15, 0.2, 0.3, 0.5][..]),
            (Fidelity::Published, "published", &[0.5][..]),
        ] {
            for &limit in limits {
                let mut design = shipped.clone();
                design.lens.focal_length_um = focal_length_um;
                design.optimise.fidelity = fidelity;
                design.optimise.step_limit_waves = limit;
                if mapping == "published" {
                    design.mapping.polynomial = published.clone();
                }
                if limit == 0.5 {
                    // Nothing holds a ring back: what is hot with a limit never settles without one.
                    design.optimise.solver = SolverSpec::Exchange {
                        chains: 4,
                        hot_sweeps: 150,
                        temperature: (1e-3, 3e-5),
                        blocks,
                    };
                } else if let SolverSpec::Exchange { blocks: most, .. } = &mut design.optimise.solver {
                    *most = blocks;
                }
                let cell: Box<dyn CellModel> = match fidelity {
                    Fidelity::Published => Box::new(PublishedCell::new(design.cell.pitch_nm.nm() as u32)),
                    _ => Box::new(RigorousCell::obtain(&shipped.table_spec()?, cache_folder().as_deref(), &Silent)?.0),
                };
                let start = Instant::now();
                let task = OptimiseTask::of(&design)?;
                let found = task.solve(&[cell.as_ref()], Checkpoint::begin(&design), &Silent)?;
                let judged = task.judge_rings(&found.waves, cell.as_ref())?;
                println!(
                    "{focal_length_um:9} um  {:9}  {mapping:9}  {limit:5}  {:.5} ({:.4})     {:6.1}",
                    fidelity.name(),
                    judged.geometric_mean,
                    judged.smallest,
                    start.elapsed().as_secs_f64()
                );
            }
        }
    }
    Ok(())
}
