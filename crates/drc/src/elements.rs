//! Places of the elements of a layout: as designed, or as found.

use super::deck::Deck;
use super::input::CheckInput;
use super::work::Allowance;
use metalith_core::{Error, Progress, Result};
use metalith_gds::extract::{Discovered, Scale, discover};
use metalith_gds::{LayerNumber, Layout, Selection};
use metalith_pillars::{ElementSite, PillarShape};
use metalith_report::exact;

/// The layer that pillars are known by, and further layers whose shapes count as if they were on it.
pub(super) fn pillar_layers(deck: &Deck) -> (LayerNumber, &[LayerNumber]) {
    let (first, doses) = deck.pillars.split_first().expect("a deck names a layer of pillars");
    (*first, doses)
}

/// Elements of the design if there is one, else those that can be found, else why there are none.
pub(super) fn sites(
    layout: &Layout,
    deck: &Deck,
    input: &CheckInput<'_>,
    allowance: &Allowance,
    selection: &Selection,
    progress: &dyn Progress,
) -> Result<(Discovered, String)> {
    if let Some(design) = input.design {
        let designed = Discovered {
            sites: design.sites(),
            shape: design.cell.shape,
            majority: design.cell.shape,
            fits: Vec::new(),
            turn: None,
        };
        return Ok((designed, String::new()));
    }
    let asked = deck.pillars_on.map(|layer| vec![layer]);
    let layers = asked.as_deref().unwrap_or(&deck.pillars);
    // The pillars may be in a companion, where the apertures are what is checked.
    let mut why = String::new();
    for file in std::iter::once(&layout).chain(&input.with) {
        match discover(file, selection, layers, Scale::of(file)?, progress).map_err(Error::from) {
            // Rules look at shapes as they stand.
            Ok(found) if found.turned_deg().is_some() => {
                let deg = found.turned_deg().unwrap_or_default();
                why = format!(
                    "the pillars stand at an angle of {} deg, and this rule is for upright lattices",
                    exact(deg)
                );
            }
            Ok(mut found) => {
                found.shape = found.majority;
                ElementSite::widen(&mut found.sites);
                let total: u64 = found.sites.iter().map(|s| (s.lattice.sites() as u64).pow(2)).sum();
                if total <= allowance.sites {
                    return Ok((found, String::new()));
                }
                why = format!("elements with {total} lattice sites; {} are held", allowance.sites);
            }
            Err(Error::Invalid { what, .. } | Error::Layout { what, .. }) => why = what,
            Err(other) => return Err(other),
        }
    }
    let nothing = Discovered {
        sites: Vec::new(),
        shape: PillarShape::default(),
        majority: PillarShape::default(),
        fits: Vec::new(),
        turn: None,
    };
    Ok((nothing, why))
}
