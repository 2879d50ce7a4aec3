//! Orders of the mapping of an element into which its light goes.

use super::{ElementSimulator, ReadElement};
use crate::psf_metrics::OrderEfficiencies;
use crate::site_orders::site_shares;
use metalith_cell::{CellResponse, Illumination, NeighbourTables};
use metalith_core::{Progress, Result};
use metalith_design::Element;
use metalith_design::array::PillarRule;
use metalith_design::phase::ElementPhase;
use metalith_optics::CaseOptics;
use metalith_wave::Aperture;

impl ElementSimulator<'_> {
    /// Orders into which light goes, at each wavelength in each case, along the normal. Where widths follow density,
    /// their mean over the element counts; where cells are coupled, the sites of the element in light from the middle
    /// of its field.
    ///
    /// # Errors
    /// If a cell cannot be solved, or the user stopped it.
    pub(crate) fn orders(
        &self,
        element: &Element,
        phase: &ElementPhase<'_>,
        rule: &PillarRule,
        read: &ReadElement<'_>,
        progress: &dyn Progress,
    ) -> Result<Vec<OrderEfficiencies>> {
        let numbers = OrderEfficiencies::drawn_nm(rule);
        let mut all = Vec::new();
        for &um in &self.design.verify.wavelengths_um {
            for (case, own) in self.cases.iter().map(CaseOptics::case).zip(&read.cases) {
                let (fidelity, full) = (case.fidelity(), case.full_transmission(um)?);
                let of = |light: &Illumination<'_>| {
                    let response = own.response(light, &numbers, progress)?;
                    let CellResponse::Neighbours(tables) = response.as_ref() else {
                        let table = CellResponse::clone(&response).focused()?;
                        let orders = OrderEfficiencies::of(rule, um, fidelity, full, &table);
                        return Ok(match response.polarised() {
                            Some(tables) => orders.of_light(tables, light.polarised, rule, full),
                            None => orders,
                        });
                    };
                    let fields = own.in_light(light, progress)?;
                    let apertures = fields.fields.iter().map(|field| field.aperture(&fields.light));
                    let apertures = apertures.collect::<Result<Vec<_>>>()?;
                    let apertures: Vec<&dyn Aperture> = apertures.iter().map(AsRef::as_ref).collect();
                    let found = site_shares(&apertures, phase, full);
                    Ok(OrderEfficiencies {
                        wavelength_um: um,
                        fidelity,
                        first: found.orders[1],
                        zero: found.orders[0],
                        second: found.orders[2],
                        transmitted: found.transmitted,
                        unconverted: None,
                        diverging: None,
                        left_out: match tables {
                            NeighbourTables::Fitted(fitted) => Some(fitted.left_out),
                            NeighbourTables::Band(_) => None,
                        },
                    })
                };
                all.push(self.in_middle(element, um, of)?);
            }
        }
        Ok(all)
    }
}
