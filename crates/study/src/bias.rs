//! Check that all draws of a design can exist, made before the first of them is judged.

use metalith_cell::CellStack;
use metalith_core::{Error, Result};
use metalith_gds::extract::Extraction;
use metalith_optics::{CalibratedModel, Perturbation};

use crate::draw::Sampler;

/// Succeeds if pillars can be as wide as every draw of a design makes them.
///
/// # Errors
/// With the draw that leaves nothing of the narrowest pillar, or joins the widest ones.
pub(crate) fn check_biases(
    drawer: &Sampler,
    key: [u8; 32],
    design: u64,
    stack: &CellStack,
    pillars: &Extraction,
) -> Result<()> {
    let own = (0..drawer.count()).filter(|k| drawer.design_of(*k) == design);
    let mut extremes: [Option<(f64, u64)>; 2] = [None; 2];
    for k in own {
        let bias_nm = drawer.perturbation(&drawer.draw(key, k)?).geometry.cd_bias_nm;
        let [least, most] = &mut extremes;
        if least.is_none_or(|(nm, _)| bias_nm < nm) {
            *least = Some((bias_nm, k));
        }
        if most.is_none_or(|(nm, _)| bias_nm > nm) {
            *most = Some((bias_nm, k));
        }
    }
    let counts: Vec<Vec<u64>> = pillars.elements.iter().map(|e| e.widths.histogram()).collect();
    for (bias_nm, k) in extremes.into_iter().flatten() {
        let mut made = Perturbation::default();
        made.geometry.cd_bias_nm = bias_nm;
        let model = CalibratedModel::new(String::new(), String::new(), made);
        model.check_drawn(stack, counts.clone()).map_err(|error| match error {
            Error::Invalid { id, what, hint, .. } => Error::refused(
                id,
                format!("draw {k} of the study: {what}"),
                format!("vary `cd_bias` over less, or {hint}"),
            ),
            other => other,
        })?;
    }
    Ok(())
}
