//! Where the light of an element goes, by orders of its mapping.

use num_complex::Complex64;

use super::{ElementSimulator, MIDDLE, ReadElement, arriving};
use crate::case::{TransmissionTables, not_held};
use crate::psf_metrics::OrderEfficiencies;
use crate::site_orders::site_shares;
use metalith_core::{Progress, Result};
use metalith_design::Element;
use metalith_design::array::PillarRule;
use metalith_design::phase::ElementPhase;
use metalith_optics::{AsBuiltChip, SimulationCase};
use metalith_wave::Aperture;

impl ElementSimulator<'_> {
    /// Where light goes, at each wavelength in each case, along the normal. Where widths follow density, their
    /// mean over the element counts; where cells know unlike neighbours, the sites of the element in light from the middle
    /// of its field.
    ///
    /// # Errors
    /// If a cell cannot be solved, or the user stopped it.
    pub fn orders(
        &self,
        element: &Element,
        phase: &ElementPhase<'_>,
        rule: &PillarRule,
        read: &ReadElement<'_>,
        progress: &dyn Progress,
    ) -> Result<Vec<OrderEfficiencies>> {
        let mut all = Vec::new();
        for colour in &self.colours {
            let middle = arriving(element, colour.wavelength_um, MIDDLE)?;
            for (at, case) in colour.cases.iter().zip(&self.cases) {
                if let Some(tables) = &at.tables
                    && let Some(pillars) = tables.among_neighbours(read.widths, &middle)?
                {
                    let pillars: Vec<&dyn Aperture> = pillars.iter().map(|a| a as _).collect();
                    let found = site_shares(&pillars, phase, at.full);
                    all.push(OrderEfficiencies {
                        wavelength_um: colour.wavelength_um,
                        fidelity: at.fidelity,
                        first: found.orders[1],
                        zero: found.orders[0],
                        second: found.orders[2],
                        transmitted: found.transmitted,
                        unconverted: None,
                        diverging: None,
                        left_out: tables.left_out(&middle),
                    });
                    continue;
                }
                let (made, made_rectangles);
                let polarised = at.tables.as_ref().and_then(TransmissionTables::polarised);
                let (table, polarised) = match (&at.tables, case) {
                    (Some(tables), _) => (&tables.normal[..], polarised),
                    (None, SimulationCase::Made(chip)) => {
                        let drawn = read.drawn.as_ref().ok_or_else(not_held)?;
                        let steps = drawn.mean_site_steps(&chip.perturbation().geometry);
                        let numbers = OrderEfficiencies::drawn_nm(rule);
                        let um = colour.wavelength_um;
                        made_rectangles = chip.drawn_rectangles(&numbers, steps, um, progress)?;
                        match &made_rectangles {
                            Some((tables, light)) => (tables.own(), Some((tables, *light))),
                            None => {
                                made = by_drawn_width(chip, rule, steps, colour.wavelength_um, progress)?;
                                (&made[..], None)
                            }
                        }
                    }
                    (None, SimulationCase::Cell(_)) => unreachable!("every cell has its tables"),
                };
                let orders = OrderEfficiencies::of(rule, colour.wavelength_um, at.fidelity, at.full, table);
                all.push(match polarised {
                    Some((tables, light)) => orders.of_light(tables, light, rule, at.full),
                    None => orders,
                });
            }
        }
        Ok(all)
    }
}

/// Transmissions with the drawn width (nm) as index, for the widths that a rule draws.
fn by_drawn_width(
    chip: &AsBuiltChip,
    rule: &PillarRule,
    density_steps: i32,
    wavelength_um: f64,
    progress: &dyn Progress,
) -> Result<Vec<Complex64>> {
    let widths = OrderEfficiencies::drawn_nm(rule);
    let t = chip.drawn_widths(&widths, density_steps, wavelength_um, progress)?;
    let mut table = vec![Complex64::ZERO; usize::from(widths.last().copied().unwrap_or(0)) + 1];
    for (w, t) in widths.iter().zip(t) {
        table[usize::from(*w)] = t;
    }
    Ok(table)
}
