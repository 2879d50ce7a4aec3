//! Assumptions on the media around the pillars: light is lost on no way through them, and is sent into no oblique
//! order.

use std::f64::consts::TAU;

use metalith_cell::{Fidelity, Material};
use metalith_design::{Design, LatticeOrders};
use metalith_report::{fixed, sig};

use super::Verification;

/// Thickness of a substrate that its loss is said for (um).
const MILLIMETRE_UM: f64 = 1000.0;

/// Rows of the table of assumptions: what, its size for the design, and how it is known.
pub(super) fn rows(row: &mut impl FnMut(&str, String, &str), design: &Design, found: &Verification) {
    let sentences = LatticeOrders::summary(&found.lattice_orders);
    let known = match found.fidelity {
        Fidelity::Published | Fidelity::Fitted => "this simulation model does not subtract this light",
        _ => "the tables of orders give the remaining light as all light in the zeroth order of the lattice",
    };
    row(
        "Light that the lattice of the pillars sends into oblique orders does not reach the image",
        if sentences.is_empty() {
            "none: neither medium has such orders".into()
        } else {
            sentences.join("; ")
        },
        &format!(
            "indices, pitch and direction of all light of [verify], and at the shortest wavelength of the band; {known}"
        ),
    );
    if let Some(solved) = &design.mapping.solved {
        row(
            match solved.cells {
                Some(_) => "The mapping was made from a table of unit cells",
                None => "The mapping was solved from the cell of the design",
            },
            solved.words(),
            "width with the nearest phase in a lattice of equal pillars; widths that transmit less than 0.3 of the light, or at which the phase falls with the width, are avoided",
        );
    }
    if let Some(gaps) = gaps(design) {
        row(
            "The refractive index between samples that are far apart is a guess",
            gaps,
            "monotonic cubic between the two samples, which stays between their values; to improve it, measure the film nearer to the wavelength",
        );
    }
    if let Some(loss) = loss(design) {
        row(
            "Light arrives through a substrate without loss",
            loss,
            "the index is taken as real, which changes the transmission of a face by less than a millionth; no figure counts the loss in the substrate",
        );
    }
}

/// Samples of the materials that are far apart about a wavelength of `[verify]`.
fn gaps(design: &Design) -> Option<String> {
    let stack = design.cell_stack().ok()?;
    let nm = |um: f64| fixed(um * 1e3, 1);
    let of = |material: &Material, um: f64| {
        let (low, high) = material.wide_gap_um(um)?;
        let index = |um| {
            material
                .index(um)
                .map_or_else(|_| String::new(), |n| format!("{} + {} i", sig(n.re, 4), sig(n.im, 2)))
        };
        let (low_nm, high_nm) = (nm(low), nm(high));
        Some(format!(
            "{material} at {} nm is taken for {}, between {} at {low_nm} nm and {} at {high_nm} nm",
            nm(um),
            index(um),
            index(low),
            index(high)
        ))
    };
    let mut found: Vec<String> = Vec::new();
    for um in &design.verify.wavelengths_um {
        let new = stack.materials().filter_map(|material| of(material, *um));
        for words in new.collect::<Vec<_>>() {
            if !found.contains(&words) {
                found.push(words);
            }
        }
    }
    (!found.is_empty()).then(|| found.join("; "))
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
            let text = metalith_testing::accepting(&text).replacen("[cell]\n", &format!("[cell]\n{cell}"), 1);
            loss(&Design::parse(&folder.path().join("own.toml"), &text).unwrap())
        };
        assert_eq!(said(""), None);
        let said = said("substrate_material = \"glass.csv\"\n").unwrap();
        insta::assert_snapshot!(
            metalith_testing::without_folder(said, folder.path()),
            @"k of glass.csv is 7.3×10⁻⁵ at 400.0 nm, at other wavelengths of the band no more: a millimetre of it passes 10.0 % of that light"
        );
    }
}
