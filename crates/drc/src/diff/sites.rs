//! The elements of both layouts on common lattices.

use metalith_gds::extract::ElementSite;

/// Add the elements of a second layout to those of a first: an element on the lattice of one that is known
/// extends it; one that overlaps a known one on another lattice is left out, and its pillars are compared
/// as outlines.
pub(super) fn unite(known: &mut Vec<ElementSite>, more: Vec<ElementSite>) {
    let before = known.len();
    for site in more {
        match known[..before].iter().position(|k| overlap(k, &site)) {
            None => known.push(site),
            Some(k) => {
                if let Some(both) = cover(&known[k], &site) {
                    known[k] = both;
                }
            }
        }
    }
}

/// The ends of the pillars of both from a middle (nm).
fn within(a: &ElementSite, b: &ElementSite, middle_nm: [i64; 2]) -> [[i64; 2]; 2] {
    let (a, b) = (a.ends_nm(), b.ends_nm());
    [0, 1].map(|axis| {
        let ([a0, a1], [b0, b1]) = (a[axis], b[axis]);
        [a0.min(b0), a1.max(b1)].map(|end| end - middle_nm[axis])
    })
}

fn overlap(a: &ElementSite, b: &ElementSite) -> bool {
    let (a, b) = (a.ends_nm(), b.ends_nm());
    (0..2).all(|axis| {
        let ([a0, a1], [b0, b1]) = (a[axis], b[axis]);
        a0 <= b1 && b0 <= a1
    })
}

/// The smallest square lattice with the sites of both, if they are on one; of hexagonal ones the larger, about one middle.
fn cover(a: &ElementSite, b: &ElementSite) -> Option<ElementSite> {
    // Places of lattices with another pitch are reported as their design states them.
    let pitch = i64::from(a.lattice.pitch_nm().whole_nm()?);
    if a.lattice.pitch_nm() != b.lattice.pitch_nm() || a.lattice.kind() != b.lattice.kind() {
        return None;
    }
    if !a.lattice.is_square() {
        let larger = if a.lattice.sites() < b.lattice.sites() { b } else { a };
        return (a.centre_nm == b.centre_nm).then(|| ElementSite {
            name: a.name.clone(),
            within_nm: Some(within(a, b, a.centre_nm)),
            ..larger.clone()
        });
    }
    let (a_ends, b_ends) = (a.ends_nm(), b.ends_nm());
    let (mut first, mut counts) = ([0; 2], [0; 2]);
    for axis in 0..2 {
        let ([a0, a1], [b0, b1]) = (a_ends[axis], b_ends[axis]);
        if (a0 - b0) % pitch != 0 {
            return None;
        }
        first[axis] = a0.min(b0);
        counts[axis] = (a1.max(b1) - first[axis]) / pitch + 1;
    }
    let sites = counts[0].max(counts[1]);
    // The shorter axis is in the middle, as where elements are found. A site is where the middle between two is off the grid.
    let sites = sites + (pitch % 2) * ((sites + 1) % 2);
    let centre_nm = [0, 1].map(|axis| first[axis] - (sites - counts[axis]) / 2 * pitch + (sites - 1) * pitch / 2);
    Some(ElementSite {
        name: a.name.clone(),
        centre_nm,
        within_nm: Some(within(a, b, centre_nm)),
        lattice: a.lattice.with_sites(sites as usize).ok()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_pillars::Lattice;

    #[test]
    fn lattices_grow_together() {
        let site = |x, sites| ElementSite {
            name: "e".into(),
            centre_nm: [x, x],
            lattice: Lattice::new(350, sites).unwrap(),
            within_nm: None,
        };
        let mut known = vec![site(0, 10)];
        unite(&mut known, vec![site(175, 11), site(100_000, 4)]);
        assert_eq!(known.len(), 2);
        assert_eq!((known[0].centre_nm[0], known[0].lattice.sites()), (175, 11));
        // Another phase is another lattice.
        unite(&mut known, vec![site(1, 10)]);
        assert_eq!((known.len(), known[0].lattice.sites()), (2, 11));
    }
}
