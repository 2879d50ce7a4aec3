//! Comparison of the layout with its design, and of the design with the limits of the cell.

use super::context::Context;
use super::findings::Findings;
use super::flat::FlatLayout;
use super::rule::{Needs, NotRun, Rule, RuleOutcome};
use super::work::Stop;

use metalith_core::Lattice;
use metalith_core::document::{Limits, Section};
use metalith_design::Design;
use metalith_design::phase::{ElementPhase, LensPhase};
use metalith_rcwa::Material;

enum Against {
    Count,
    Widths,
    /// Share of neighbouring sites whose phase differs by more than pi.
    PhaseStep(f64),
    NoLatticeOrders,
}

pub(super) fn read(check: &str, s: &Section<'_, '_>, _context: &Context) -> Option<Box<dyn Rule>> {
    Some(Box::new(match check {
        "pillar_count" => Against::Count,
        "width_map" => Against::Widths,
        "phase_step" => Against::PhaseStep(s.float("max_share", Limits::new(0.0..=1.0, "of all steps"))),
        "lattice_orders" => Against::NoLatticeOrders,
        _ => return None,
    }))
}

impl Rule for Against {
    fn words(&self) -> String {
        match self {
            Self::Count => "as many pillars as designed, in every element".into(),
            Self::Widths => "widths as designed, at every site".into(),
            Self::PhaseStep(share) => format!("at most {share} of the steps from pillar to pillar exceed pi"),
            Self::NoLatticeOrders => "the lattice sends no light into oblique orders of the substrate".into(),
        }
    }

    fn judge(&self, flat: &FlatLayout<'_>, found: &mut Findings) -> RuleOutcome {
        let Some(design) = flat.design else {
            return Err(NotRun::Skipped("no design was given: name it with --design".into()));
        };
        match self {
            Self::Count | Self::Widths => self.compare(flat, found),
            Self::PhaseStep(share) => phase_step(flat, design, *share, found),
            Self::NoLatticeOrders => lattice_orders(design, found),
        }
    }

    fn needs(&self) -> Needs {
        match self {
            Self::Count | Self::Widths => Needs::Array,
            Self::PhaseStep(_) | Self::NoLatticeOrders => Needs::Numbers,
        }
    }
}

impl Against {
    fn compare(&self, flat: &FlatLayout<'_>, found: &mut Findings) -> RuleOutcome {
        let array = flat.array.expect("made where a rule needs it");
        for (k, (read, placed)) in flat.elements.iter().zip(&array.placed).enumerate() {
            flat.work.spend(read.widths.width_nm.len() as u64)?;
            let designed = array.widths(placed);
            let name = &read.site.name;
            if let Self::Count = self {
                let (there, wanted) = (read.widths.pillars(), designed.pillars());
                if there != wanted {
                    found.plain(&format!("{name} {there}"), || {
                        format!("{there} pillars in {name}, {wanted} designed")
                    });
                }
                continue;
            }
            if read.widths.width_nm == designed.width_nm {
                continue;
            }
            for ((row, column), &w) in read.widths.width_nm.indexed_iter() {
                let wanted = designed.width_nm[[row, column]];
                // Missing and additional pillars are a matter of count.
                if w != wanted && w != 0 && wanted != 0 {
                    found.rect(&flat.pillar(k, row, column), || {
                        format!("{w} nm wide, {wanted} nm designed")
                    });
                }
            }
        }
        Ok(())
    }
}

fn phase_step(flat: &FlatLayout<'_>, design: &Design, most: f64, found: &mut Findings) -> RuleOutcome {
    let lattice = design.lattice();
    let lens = LensPhase::new(lattice, design.lens.diameter_nm, &design.lens.phase);
    for element in design.elements() {
        let phase = ElementPhase::new(&lens, &element.wedge);
        let (steps, steep) = steps(flat, lattice, &phase)?;
        let share = steep as f64 / steps.max(1) as f64;
        found
            .facts
            .push((format!("share of steps beyond pi in {}", element.label()), share));
        if share > most {
            found.plain(&element.label(), || {
                format!(
                    "{share:.4} of the steps of {} exceed pi, at most {most}",
                    element.label()
                )
            });
        }
    }
    Ok(())
}

/// Steps between neighbouring sites, and those beyond half a turn.
fn steps(flat: &FlatLayout<'_>, lattice: Lattice, phase: &ElementPhase<'_>) -> Result<(u64, u64), Stop> {
    let (mut all, mut steep) = (0, 0);
    for iy in 0..lattice.sites() {
        flat.work.look()?;
        for ix in 0..lattice.sites() {
            let Some(own) = phase.turns(ix, iy) else { continue };
            for (x, y) in [(ix + 1, iy), (ix, iy + 1)] {
                if x < lattice.sites()
                    && y < lattice.sites()
                    && let Some(other) = phase.turns(x, y)
                {
                    all += 1;
                    steep += u64::from((own - other).abs() > 0.5);
                }
            }
        }
    }
    Ok((all, steep))
}

fn lattice_orders(design: &Design, found: &mut Findings) -> RuleOutcome {
    let folder = design.path.parent().unwrap_or_else(|| std::path::Path::new("."));
    let substrate = match Material::resolve(&design.cell.substrate_material, folder) {
        Ok(material) => material,
        Err(error) => return Err(NotRun::Failed(error.to_string())),
    };
    let pitch_nm = f64::from(design.cell.pitch_nm);
    for &wavelength_um in &design.verify.wavelengths_um {
        let wavelength_nm = wavelength_um * 1e3;
        let index = match substrate.index(wavelength_um) {
            Ok(index) => index.re,
            Err(error) => return Err(NotRun::Failed(error.to_string())),
        };
        let shortest = index * pitch_nm;
        if wavelength_nm < shortest {
            found.plain(&format!("{wavelength_nm:.3}"), || {
                format!("at {wavelength_nm:.1} nm, below {shortest:.1} nm, the lattice diffracts into the substrate")
            });
        }
    }
    Ok(())
}
