//! A blazed grating: the local picture of a lens where its phase is steep.

use metalith_rcwa::SiteLattice;

/// A phase that rises evenly over the sites.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blaze {
    /// Turns of the phase over `sites` sites along x and along y.
    pub turns: [i32; 2],
    /// Number of sites after which the pattern repeats.
    pub sites: usize,
    /// Phase of the site at the origin (turns).
    pub offset_turns: f64,
}

impl Blaze {
    /// Phase of a site (turns), in 0..1.
    pub fn phase(&self, x: usize, y: usize) -> f64 {
        let [p, q] = self.turns.map(f64::from);
        let phase = ((p * x as f64 + q * y as f64) / self.sites as f64 + self.offset_turns).rem_euclid(1.0);
        // A sum a rounding below a whole number of turns may come out as 1.
        if phase < 1.0 { phase } else { 0.0 }
    }

    /// Widths of the sites of its cell (nm), in the order of the lattice. `width_nm` is the mapping of phase
    /// (turns, 0 <= u < 1) to width.
    pub fn widths_nm(&self, lattice: &SiteLattice, width_nm: impl Fn(f64) -> f64) -> Vec<f64> {
        (0..lattice.len())
            .map(|i| {
                let [x, y] = lattice.site(i);
                width_nm(self.phase(x, y))
            })
            .collect()
    }
}
