//! The rigorous cell of upright rectangular pillars of many sizes.

mod cache;

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use num_complex::Complex64;
use rayon::prelude::*;

use metalith_core::{Error, Memo, Progress, Result, Silent};
use metalith_pillars::UprightRectangles;
use metalith_rcwa::{Incidence, LayerStack, Orders, Outline, Side, solve_each};

use crate::BAND_ORDERS;
use crate::{
    CellModel, CellResponse, CellStack, Fidelity, Illumination, JonesTables, LinearTables, PolarisationAxis,
    PolarisedTables, Spectral,
};

/// Diffraction orders along an axis of upright rectangles: the longer edge asks for more than squares do.
pub const UPRIGHT_ORDERS: usize = 25;

/// Response of upright rectangular pillars to light along x and along y, in infinite lattices of pillars of one size.
#[derive(Debug)]
pub struct UprightCell {
    stack: CellStack,
    pillars: UprightRectangles,
    focused: PolarisationAxis,
    /// Folder of the cache of what is solved for single wavelengths.
    folder: Option<PathBuf>,
    /// Along both axes, by wavelength, and whether it is one of a band.
    solved: Memo<(u64, bool), Arc<Along>>,
}

/// Transmissions of light along x and along y, by the number of the pillar; the first entry stands for no pillar.
pub type Along = [Vec<Complex64>; 2];

impl CellStack {
    /// Transmission of the zero order of an upright rectangular pillar with these edges along x and y (nm), along the normal from the
    /// substrate: of light along x and of light along y, which keep their polarisation. The shape of the stack itself does not count,
    /// its taper widens both edges alike.
    ///
    /// # Errors
    /// If corners are rounded, an edge is not a positive number, the foot is wider than the pitch, or the wavelength (um) is outside
    /// the range of a material.
    pub fn birefringent(&self, edges_nm: [f64; 2], wavelength_um: f64, orders: Orders) -> Result<[Complex64; 2]> {
        let solved = birefringent_stacks(&[(self, edges_nm)], wavelength_um, orders)?;
        Ok(solved[0])
    }

    fn birefringent_layers(&self, edges_nm: [f64; 2], wavelength_um: f64) -> Result<LayerStack> {
        let [x, y] = edges_nm;
        if edges_nm.iter().any(|edge| !(edge.is_finite() && *edge > 0.0)) {
            return Err(Error::refused(
                "cell/edges-out-of-range",
                format!("a pillar of {x} x {y} nm"),
                "give both edges in nm, above zero",
            ));
        }
        self.check_sharp()?;
        self.layers_of(wavelength_um, |wider_nm| {
            let [x, y] = edges_nm.map(|edge| (edge + wider_nm).max(0.0));
            if x <= 0.0 || y <= 0.0 {
                Outline::empty()
            } else {
                Outline::rectangle(x, y)
            }
        })
    }
}

/// [`CellStack::birefringent`] of several stacks, each with the edges of its pillar (nm): where only the height differs from one to the next, most of the
/// work is done once.
///
/// # Errors
/// As [`CellStack::birefringent`].
pub fn birefringent_stacks(
    pillars: &[(&CellStack, [f64; 2])],
    wavelength_um: f64,
    orders: Orders,
) -> Result<Vec<[Complex64; 2]>> {
    let stacks = pillars.iter();
    let stacks = stacks.map(|(stack, edges)| stack.birefringent_layers(*edges, wavelength_um));
    let stacks = stacks.collect::<Result<Vec<_>>>()?;
    let solved = solve_each(&stacks, &Incidence::normal(wavelength_um, Side::Below), orders)?;
    let along = solved.iter().map(|answer| [answer.jones[0][0], answer.jones[1][1]]);
    Ok(along.collect())
}

/// Transmissions of light along x and along y of pillars with these edges along x and y (nm), in their order. A pillar that is exchanged
/// with its mirror image about the diagonal exchanges x and y, so that `solve` is asked for one of the two.
///
/// # Errors
/// Those of `solve`; also if the user stopped it.
pub fn birefringent_pillars(
    edges_nm: &[[f64; 2]],
    solve: impl Fn([f64; 2]) -> Result<[Complex64; 2]> + Sync,
    progress: &dyn Progress,
) -> Result<Vec<[Complex64; 2]>> {
    let wide = |[x, y]: [f64; 2]| if x >= y { [x, y] } else { [y, x] };
    let key = |edges: [f64; 2]| wide(edges).map(f64::to_bits);
    let mut distinct: Vec<[f64; 2]> = edges_nm.iter().copied().map(wide).collect();
    distinct.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    distinct.dedup();
    progress.begin("cells of upright rectangles", distinct.len() as u64);
    let solved = distinct.par_iter().map(|&edges| {
        progress.check_stopped()?;
        progress.advance(1);
        Ok((key(edges), solve(edges)?))
    });
    let solved = solved.collect::<Result<HashMap<_, _>>>()?;
    let of = |edges: &[f64; 2]| {
        let [x, y] = solved[&key(*edges)];
        if edges[0] >= edges[1] { [x, y] } else { [y, x] }
    };
    Ok(edges_nm.iter().map(of).collect())
}

impl UprightCell {
    /// The cell of these pillars; light along the axis `focused` has the phase of the design.
    pub fn new(stack: CellStack, pillars: UprightRectangles, focused: PolarisationAxis) -> Self {
        Self {
            stack,
            pillars,
            focused,
            folder: None,
            solved: Memo::default(),
        }
    }

    /// This cell, whose answers for single wavelengths are cached in a folder from one run to the next.
    #[must_use]
    pub fn cached_in(mut self, folder: Option<&Path>) -> Self {
        self.folder = folder.map(Path::to_owned);
        self
    }

    /// Transmissions of all pillars at a wavelength (um), with progress told of the pillars that are solved.
    ///
    /// # Errors
    /// As [`CellStack::birefringent`]; also if the user stopped it.
    pub fn along(&self, wavelength_um: f64, progress: &dyn Progress) -> Result<Along> {
        let table = cache::table(
            self.folder.as_deref(),
            &self.stack,
            self.pillars,
            wavelength_um,
            UPRIGHT_ORDERS,
        );
        let decode = |content: &[u8]| cache::decode(content, usize::from(self.pillars.count()));
        if let Some(along) = table.read(decode, progress) {
            return Ok(along);
        }
        let along = self.solve(wavelength_um, Orders::new(UPRIGHT_ORDERS)?, progress)?;
        table.write(&cache::encode(&along), progress);
        Ok(along)
    }

    fn solved(&self, wavelength_um: f64, of_band: bool, progress: &dyn Progress) -> Result<Arc<Along>> {
        self.solved.get_or_make((wavelength_um.to_bits(), of_band), || {
            Ok(Arc::new(if of_band {
                self.solve(wavelength_um, Orders::new(BAND_ORDERS)?, &Silent)?
            } else {
                self.along(wavelength_um, progress)?
            }))
        })
    }

    fn solve(&self, wavelength_um: f64, orders: Orders, progress: &dyn Progress) -> Result<Along> {
        let edges_nm: Vec<[f64; 2]> = (1..=self.pillars.count())
            .map(|number| self.pillars.edges_nm(number).map(f64::from))
            .collect();
        let one = |edges_nm| self.stack.birefringent(edges_nm, wavelength_um, orders);
        let solved = birefringent_pillars(&edges_nm, one, progress)?;
        Ok([0, 1].map(|axis| {
            let of_axis = solved.iter().map(|t| t[axis]);
            std::iter::once(Complex64::ZERO).chain(of_axis).collect()
        }))
    }

    /// Table of light along one axis, up to a number.
    fn table(of: &Along, axis: PolarisationAxis, last: u16) -> Vec<Complex64> {
        let own = &of[axis.index()];
        let at = |number: u16| own.get(usize::from(number)).copied().unwrap_or(Complex64::ZERO);
        (0..=last).map(at).collect()
    }

    fn tables(&self, wavelength_um: f64, of_band: bool, last: u16, progress: &dyn Progress) -> Result<PolarisedTables> {
        let solved = self.solved(wavelength_um, of_band, progress)?;
        Ok(PolarisedTables::Axes(LinearTables {
            focused: self.focused,
            along: PolarisationAxis::ALL.map(|axis| Self::table(&solved, axis, last)),
        }))
    }
}

impl CellModel for UprightCell {
    fn fidelity(&self) -> Fidelity {
        Fidelity::Rigorous
    }

    fn response(&self, light: &Illumination<'_>, last: u16, progress: &dyn Progress) -> Result<CellResponse> {
        if light.cell_sines() != [0.0; 2] {
            return Err(crate::oblique_refused());
        }
        let tables = self.tables(light.wavelength_um, light.spectral == Spectral::InBand, last, progress)?;
        Ok(CellResponse::Jones(JonesTables::Polarised(tables)))
    }

    fn full_transmission(&self, wavelength_um: f64) -> Result<f64> {
        self.stack.full_transmission(wavelength_um)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rotated::jones::tests::titania;
    use crate::{RotatedRectangle, dark};

    const PILLARS: UprightRectangles = UprightRectangles {
        shortest_nm: 100,
        step_nm: 70,
        lengths: 3,
    };

    /// A square is the pillar of its width, and each mirror image what the solver has of it.
    #[test]
    fn squares_are_those_of_their_width_and_mirror_images_are_solved() {
        // Two ways through the solver; exchanging x and y rounds otherwise.
        const SAME: f64 = 1e-9;
        let cell = UprightCell::new(titania(), PILLARS, PolarisationAxis::X);
        let along = cell.along(0.532, &Silent).unwrap();
        let orders = Orders::new(UPRIGHT_ORDERS).unwrap();
        for (number, width) in [(1, 100.0), (5, 170.0), (9, 240.0)] {
            let square = titania().transmission(width, 0.532, orders).unwrap();
            assert!((along[0][number] - square).norm() < SAME && (along[1][number] - square).norm() < SAME);
        }
        for number in 1..=9u16 {
            let direct = titania()
                .birefringent(PILLARS.edges_nm(number).map(f64::from), 0.532, orders)
                .unwrap();
            for (axis, wanted) in direct.into_iter().enumerate() {
                assert!(
                    (along[axis][usize::from(number)] - wanted).norm() < SAME,
                    "{number} {axis}"
                );
            }
        }
        // Light along the longer edge is delayed more.
        let later = (along[1][7] / along[0][7]).arg();
        assert!(later > 1.0, "{later}");
        assert!(along.iter().all(|table| table[0] == Complex64::ZERO && !dark(table)));
    }

    /// The rule for sides along the axes and that for any angle come from both sides to one answer, and are that near to it here.
    #[test]
    fn an_upright_pillar_is_a_rotated_one_at_no_angle() {
        // With 25 orders 0.0027 and 0.0005 are left of this pillar; of thinner ones next to a resonance it is more.
        const BETWEEN_RULES: f64 = 0.005;
        let orders = |n: usize| Orders::new(n).unwrap();
        let pillar = RotatedRectangle {
            width_nm: 150.0,
            length_nm: 200.0,
            rotation: 0.0,
        };
        let jones = titania().jones(&pillar, 0.532, [0.0; 2], orders(25)).unwrap();
        let [x, y] = titania()
            .birefringent([150.0, 200.0], 0.532, orders(UPRIGHT_ORDERS))
            .unwrap();
        let (off_x, off_y) = ((x - jones[0][0]).norm(), (y - jones[1][1]).norm());
        println!("{off_x} {off_y}");
        assert!(off_x < BETWEEN_RULES && off_y < BETWEEN_RULES, "{off_x} {off_y}");
    }

    #[test]
    fn tables_are_of_the_axis_that_is_focused() {
        for axis in PolarisationAxis::ALL {
            let cell = UprightCell::new(titania(), PILLARS, axis);
            let response = cell
                .response(&Illumination::normal(0.532).in_band(), 9, &Silent)
                .unwrap();
            let Some(PolarisedTables::Axes(tables)) = response.polarised().cloned() else {
                panic!("it has tables of both axes")
            };
            let table = response.focused().unwrap();
            assert_eq!((table, axis), (tables.along[axis.index()].clone(), tables.focused));
        }
        let error = titania().birefringent([100.0, -1.0], 0.532, Orders::new(3).unwrap());
        assert_eq!(error.unwrap_err().id(), "cell/edges-out-of-range");
    }

    /// A table that is kept is read again, to the bit; one that is damaged or of another stack is not.
    #[test]
    fn what_is_solved_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let cell =
            |stack: CellStack| UprightCell::new(stack, PILLARS, PolarisationAxis::X).cached_in(Some(folder.path()));
        let files = || {
            std::fs::read_dir(folder.path())
                .unwrap()
                .map(|f| f.unwrap().path())
                .collect::<Vec<_>>()
        };
        let first = cell(titania()).along(0.532, &Silent).unwrap();
        let [file] = &files()[..] else { panic!("{:?}", files()) };
        let written = std::fs::metadata(file).unwrap().modified().unwrap();
        assert_eq!(cell(titania()).along(0.532, &Silent).unwrap(), first);
        assert_eq!(std::fs::metadata(file).unwrap().modified().unwrap(), written);
        let mut bytes = std::fs::read(file).unwrap();
        bytes[200] ^= 1;
        std::fs::write(file, bytes).unwrap();
        assert_eq!(cell(titania()).along(0.532, &Silent).unwrap(), first);
        let lower = CellStack {
            height_nm: 300.0,
            ..titania()
        };
        assert_ne!(cell(lower).along(0.532, &Silent).unwrap(), first);
        assert_eq!(files().len(), 2);
    }
}
