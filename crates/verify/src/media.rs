//! Assumptions on the media around the pillars: light is lost on no way through them, and is sent into no oblique
//! order.

use std::f64::consts::TAU;

use metalith_cell::Fidelity;
use metalith_design::{Design, LatticeOrders};
use metalith_report::{fixed, sig};

use super::Verification;

/// Thickness of a substrate that its loss is said for (um).
const MILLIMETRE_UM: f64 = 1000.0;

/// Their rows of the table of assumptions: what, its size for the design, and how it is known.
pub(super) fn rows(row: &mut impl FnMut(&str, String, &str), design: &Design, found: &Verification) {
    let sentences = LatticeOrders::summary(&found.lattice_orders);
    let known = match found.fidelity {
        Fidelity::Published | Fidelity::Fitted => "this cell takes nothing off for it",
        _ => "what is left is in the tables of where light goes, as all transmitted in the zero order of the lattice",
    };
    row(
        "What the lattice of the pillars sends into oblique orders is lost to the image",
        if sentences.is_empty() {
            "nothing: there are no such orders in either medium".into()
        } else {
            sentences.join("; ")
        },
        &format!(
            "indices, pitch and direction of all light of [verify], and at the shortest wavelength of the band; {known}"
        ),
    );
    if let Some(loss) = loss(design) {
        row(
            "Light arrives through a substrate without loss",
            loss,
            "its index is taken for real, which changes what a face passes by less than a millionth; what is lost on the way is in no figure",
        );
    }
}

/// Loss in a substrate that absorbs a little, at the wavelength of the band at which it absorbs most.
fn loss(design: &Design) -> Option<String> {
    let substrate = design.cell_stack().ok()?.substrate;
    let (wavelength_um, k) = substrate.most_absorbing(design.band_um().ok()?);
    let passed = (-2.0 * TAU * k * MILLIMETRE_UM / wavelength_um).exp();
    (k > 0.0).then(|| {
        format!(
            "k of {substrate} is {} at {} nm, at other wavelengths of the band no more: a millimetre of it passes {} % of that light",
            sig(k, 2),
            fixed(wavelength_um * 1e3, 1),
            fixed(passed * 100.0, 1)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_substrate_that_absorbs_a_little_is_said() {
        let path = metalith_testing::design("array_2x4");
        let text = std::fs::read_to_string(&path).unwrap();
        let folder = tempfile::tempdir().unwrap();
        // A tenth of the light is left after a millimetre, at 400 nm.
        let k = 10f64.ln() * 0.4 / (2.0 * TAU * MILLIMETRE_UM);
        let rows = format!("wavelength_nm,n,k\n400,1.5,{k}\n720,1.5,0\n");
        std::fs::write(folder.path().join("glass.csv"), rows).unwrap();
        let said = |cell: &str| {
            let text = text.replacen("[cell]\n", &format!("[cell]\n{cell}"), 1);
            loss(&Design::parse(&folder.path().join("own.toml"), &text).unwrap())
        };
        assert_eq!(said(""), None);
        let said = said("substrate_material = \"glass.csv\"\n").unwrap();
        assert!(said.contains("glass.csv") && said.contains("400.0 nm"), "{said}");
        assert!(said.contains("passes 10.0 % of that light"), "{said}");
    }
}
