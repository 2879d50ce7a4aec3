//! The cell in terms of the cleanroom: film, height, taper, corners, what is left of the mask.

use ndarray::Array2;
use num_complex::Complex64;
use rayon::prelude::*;
use serde::Serialize;

use metalith_core::{Error, Result};
use metalith_pillars::{OutlineForm, PillarShape};
use metalith_rcwa::{
    CellLattice, Incidence, Layer, LayerStack, Material, Orders, Outline, Side, solve, solve_each, transmit,
    transmit_each,
};

/// A pillar on its substrate, as etched: everything that decides its transmission but its width.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CellStack {
    /// Pitch of the lattice (nm).
    pub pitch_nm: f64,
    /// Lattice of the pillars.
    #[serde(skip_serializing_if = "is_square")]
    pub lattice: CellLattice,
    /// Height of the pillar (nm).
    pub height_nm: f64,
    /// Cross-section of the pillar; its width is the edge of a square, the diameter of a circle.
    #[serde(skip_serializing_if = "PillarShape::is_square")]
    pub shape: PillarShape,
    /// Material that the pillar is etched from.
    pub film: Material,
    pub substrate: Material,
    /// Unstructured layers between substrate and pillar, from the substrate upwards: a spacer, what the etch left of the film.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub under: Vec<UniformLayer>,
    /// Medium around and above the pillar.
    pub ambient: Material,
    /// Angle of the walls from upright (rad). The width is that of the top; positive is wider at the foot.
    pub taper: f64,
    /// Radius of the vertical edges (nm).
    pub corner_radius_nm: f64,
    /// Thickness of the mask left on top (nm); 0 for none.
    pub mask_height_nm: f64,
    /// Material of the mask.
    pub mask: Material,
}

fn is_square(lattice: &CellLattice) -> bool {
    *lattice == CellLattice::Square
}

/// A layer without structure.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UniformLayer {
    pub material: Material,
    /// Thickness (nm).
    pub height_nm: f64,
}

/// Slices that stand for a leaning wall, each as wide as the pillar is in its middle. At one degree
/// (24 nm between top and foot) six differ from twelve by less than 0.01 in t (see the tests) and from 24 by 0.012.
const TAPER_SLICES: usize = 6;

impl CellStack {
    /// The materials of the paper, silicon nitride on fused silica in air, on a pitch (nm) and so high (nm).
    ///
    /// # Errors
    /// None but those of a program that does not know its own materials.
    pub fn paper(pitch_nm: f64, height_nm: f64) -> Result<Self> {
        Ok(Self {
            pitch_nm,
            lattice: CellLattice::Square,
            height_nm,
            shape: PillarShape::default(),
            film: Material::named("sin_luke_2015")?,
            substrate: Material::named("fused_silica_malitson_1965")?,
            under: Vec::new(),
            ambient: Material::named("air")?,
            taper: 0.0,
            corner_radius_nm: 0.0,
            mask_height_nm: 0.0,
            mask: Material::named("alumina_zhukovsky_2015")?,
        })
    }

    /// True if it is the cell of the paper, whose polynomials are published: squares of any silicon nitride, 700 nm
    /// high on a pitch of 350 nm, on fused silica, in air.
    pub fn is_of_the_paper(&self) -> bool {
        /// Refractive indices of silicon nitrides at 550 nm, from rich in nitrogen to rich in silicon.
        const NITRIDES: std::ops::Range<f64> = 1.8..2.4;
        let paper = Self::paper(350.0, 700.0).map(|paper| Self {
            film: self.film.clone(),
            ambient: self.ambient.clone(),
            ..paper
        });
        let index = |material: &Material, um| material.index(um).ok().map(|n| n.re);
        paper.is_ok_and(|paper| paper == *self)
            && index(&self.ambient, 1.0) == Some(1.0)
            && index(&self.film, 0.55).is_some_and(|n| NITRIDES.contains(&n))
    }

    /// Layers of the pillar of a width (nm) at a wavelength (um), from the substrate upwards. A width of
    /// zero leaves the bare substrate.
    ///
    /// # Errors
    /// If the foot is wider than the pitch, the wavelength is outside the range of a material, or the pillars are
    /// rectangles, which no width distinguishes: see [`CellStack::rectangle_layers`] and [`CellStack::birefringent`].
    pub fn layers(&self, width_nm: f64, wavelength_um: f64) -> Result<LayerStack> {
        if !self.shape.has_width() {
            return Err(Error::refused(
                "cell/rectangles-unsupported",
                format!(
                    "the pillars are {}, and a pillar with one width is needed here",
                    self.shape.plural()
                ),
                "use squares or circles here: calibration knows no rectangles, `optimise` no upright ones; the other commands do",
            ));
        }
        self.layers_of(wavelength_um, |wider_nm| self.outline((width_nm + wider_nm).max(0.0)))
    }

    /// Number of cross-sections that stand for the walls of a pillar: one where they are upright.
    pub fn slices(&self) -> usize {
        if self.taper == 0.0 { 1 } else { TAPER_SLICES }
    }

    /// Layers of a pillar with these cross-sections, each by how much wider than the top it is (nm).
    pub(super) fn layers_of(&self, wavelength_um: f64, outline: impl Fn(f64) -> Outline) -> Result<LayerStack> {
        self.check()?;
        let ambient = self.ambient.index(wavelength_um)?;
        let film = self.film.index(wavelength_um)?;
        let layer = |height_nm: f64, wider_nm: f64, inside: Complex64| -> Layer {
            Layer {
                height_nm,
                outline: outline(wider_nm),
                inside,
                outside: ambient,
            }
        };
        let slices = self.slices();
        let slope = 2.0 * self.taper.tan();
        let mut layers = Vec::new();
        for under in self.under.iter().filter(|u| u.height_nm > 0.0) {
            layers.push(Layer::uniform(under.height_nm, under.material.index(wavelength_um)?));
        }
        layers.extend((0..slices).map(|slice| {
            let depth_nm = self.height_nm * (1.0 - (slice as f64 + 0.5) / slices as f64);
            layer(self.height_nm / slices as f64, slope * depth_nm, film)
        }));
        if self.mask_height_nm > 0.0 {
            layers.push(layer(self.mask_height_nm, 0.0, self.mask.index(wavelength_um)?));
        }
        Ok(LayerStack {
            pitch_nm: self.pitch_nm,
            lattice: self.lattice,
            below: Complex64::from(self.arriving_index(wavelength_um)?),
            layers,
            above: ambient,
        })
    }

    /// Cross-section of the pillar where it is so wide (nm).
    fn outline(&self, width_nm: f64) -> Outline {
        match self.shape.outline() {
            _ if width_nm <= 0.0 => Outline::empty(),
            OutlineForm::Square => Outline::rounded(width_nm, self.corner_radius_nm),
            OutlineForm::Circle => Outline::circle(width_nm),
            OutlineForm::Polygon | OutlineForm::Mixed => Outline::empty(),
        }
    }

    /// Zero-order transmission along the normal, from the substrate: the field where the stack ends (the
    /// top of the mask, if one is left) over the incident field at the foot.
    ///
    /// # Errors
    /// As [`CellStack::layers`]; also if the width is no number, or negative.
    pub fn transmission(&self, width_nm: f64, wavelength_um: f64, orders: Orders) -> Result<Complex64> {
        Self::check_width(width_nm)?;
        Ok(transmit(
            &self.layers(width_nm, wavelength_um)?,
            wavelength_um,
            Side::Below,
            orders,
        )?)
    }

    /// [`CellStack::transmission`] of pillars of several stacks, each of its own width (nm): the modes of layers that they have in
    /// common are found once.
    ///
    /// # Errors
    /// As [`CellStack::transmission`], the first in order.
    pub fn transmission_each(pillars: &[(&Self, f64)], wavelength_um: f64, orders: Orders) -> Result<Vec<Complex64>> {
        let of = |(stack, width_nm): &(&Self, f64)| {
            Self::check_width(*width_nm)?;
            stack.layers(*width_nm, wavelength_um)
        };
        let stacks = pillars.iter().map(of).collect::<Result<Vec<_>>>()?;
        Ok(transmit_each(&stacks, wavelength_um, Side::Below, orders)?)
    }

    /// [`CellStack::transmission`] of a pillar at several heights (nm): most of the work is done once. The mean of both
    /// polarisations.
    ///
    /// # Errors
    /// As [`CellStack::transmission`].
    pub fn at_heights(
        &self,
        width_nm: f64,
        wavelength_um: f64,
        heights_nm: &[f64],
        orders: Orders,
    ) -> Result<Vec<Complex64>> {
        Self::check_width(width_nm)?;
        let of = |&height_nm: &f64| {
            let stack = Self {
                height_nm,
                ..self.clone()
            };
            stack.layers(width_nm, wavelength_um)
        };
        let stacks = heights_nm.iter().map(of).collect::<Result<Vec<_>>>()?;
        let solved = solve_each(&stacks, &Incidence::normal(wavelength_um, Side::Below), orders)?;
        let mean = solved
            .iter()
            .map(|answer| 0.5 * (answer.jones[0][0] + answer.jones[1][1]));
        Ok(mean.collect())
    }

    /// Zero-order transmission of light whose direction has these sines in air, along x and y: of light
    /// polarised across the plane of incidence (s) into s and p, and of light polarised in it (p) into s and p.
    ///
    /// Scaled by the cosines of the ray on both sides, so that the share of power in the zero order follows
    /// from |t| as it does along the normal.
    ///
    /// # Errors
    /// As [`CellStack::transmission`]; also if no light arrives or leaves at that angle.
    pub fn oblique(
        &self,
        width_nm: f64,
        wavelength_um: f64,
        sines: [f64; 2],
        orders: Orders,
    ) -> Result<[[Complex64; 2]; 2]> {
        Self::check_width(width_nm)?;
        let layers = self.layers(width_nm, wavelength_um)?;
        let cosine = |index: Complex64| (1.0 - (sines[0].powi(2) + sines[1].powi(2)) / index.re.powi(2)).sqrt();
        let (below, above) = (cosine(layers.below), cosine(layers.above));
        if above.is_nan() || above <= 0.0 {
            return Err(Error::refused(
                "light/evanescent",
                format!(
                    "light at sines of {:.4}, {:.4} is evanescent behind the pillars",
                    sines[0], sines[1]
                ),
                "use an angle of less than 90 degrees in air",
            ));
        }
        let incidence = Incidence::of_sines(wavelength_um, Side::Below, sines);
        let jones = solve(&layers, &incidence, orders)?.transmission;
        let scale = (above / below).sqrt();
        Ok([0, 1].map(|arrives| [0, 1].map(|leaves| jones[leaves][arrives] * scale)))
    }

    /// [`CellStack::transmission`] of all pairs of widths (nm) and wavelengths (um), in parallel. Shape
    /// `[wavelengths, widths]`.
    ///
    /// # Errors
    /// As [`CellStack::transmission`], the first in order.
    pub fn transmissions(
        &self,
        widths_nm: &[f64],
        wavelengths_um: &[f64],
        orders: Orders,
    ) -> Result<Array2<Complex64>> {
        let columns = widths_nm.len();
        let values = (0..columns * wavelengths_um.len())
            .into_par_iter()
            .map(|i| self.transmission(widths_nm[i % columns], wavelengths_um[i / columns], orders))
            .collect::<Vec<_>>();
        let values = values.into_iter().collect::<Result<Vec<_>>>()?;
        Ok(Array2::from_shape_vec((wavelengths_um.len(), columns), values).expect("one value for each pair"))
    }

    /// |t| where all power goes on in the zero order: sqrt of the index of the substrate over that of
    /// the medium above.
    ///
    /// # Errors
    /// If the wavelength is outside the range of a material.
    pub fn full_transmission(&self, wavelength_um: f64) -> Result<f64> {
        let above = self.ambient.index(wavelength_um)?;
        Ok((self.arriving_index(wavelength_um)? / above.re).sqrt())
    }

    /// Index of the half-space that light arrives from: that of the substrate without its loss, since a wave in a medium that
    /// absorbs has no defined power. How much of the light is lost on the way is not counted.
    ///
    /// # Errors
    /// If the wavelength (um) is outside the range of the substrate, or it absorbs more than [`MOST_SUBSTRATE_K`] there.
    pub fn arriving_index(&self, wavelength_um: f64) -> Result<f64> {
        let index = self.substrate.index(wavelength_um)?;
        self.check_loss(wavelength_um, index.im)?;
        Ok(index.re)
    }

    /// Refuses a substrate that absorbs more than [`MOST_SUBSTRATE_K`] anywhere from one wavelength to another (um).
    ///
    /// # Errors
    /// If it does, with the wavelength at which it does most.
    pub fn check_substrate(&self, band_um: (f64, f64)) -> Result<()> {
        let (wavelength_um, k) = self.substrate.most_absorbing(band_um);
        self.check_loss(wavelength_um, k)
    }

    fn check_loss(&self, wavelength_um: f64, k: f64) -> Result<()> {
        if k <= MOST_SUBSTRATE_K {
            return Ok(());
        }
        Err(Error::refused(
            "cell/absorbing-substrate",
            format!(
                "the substrate {} has k = {k} at {:.1} nm, where light arrives through it",
                self.substrate,
                wavelength_um * 1e3
            ),
            format!(
                "use a substrate with k of at most {MOST_SUBSTRATE_K}, or wavelengths and a band (`band_nm` in [cell]) at which it is \
                 clear: what absorbs on so thick a way passes no light"
            ),
        ))
    }

    /// The materials that light passes.
    pub fn materials(&self) -> impl Iterator<Item = &Material> {
        let masks = (self.mask_height_nm > 0.0).then_some(&self.mask);
        [&self.film, &self.substrate, &self.ambient]
            .into_iter()
            .chain(self.under.iter().map(|u| &u.material))
            .chain(masks)
    }

    /// Wavelengths at which every material is known (um).
    pub fn range_um(&self) -> (f64, f64) {
        self.materials()
            .map(Material::range_um)
            .fold((0.0, f64::INFINITY), |(low, high), (a, b)| (low.max(a), high.min(b)))
    }

    /// Refuses what is no width. Corrections of a width may take [`CellStack::layers`] below zero, where nothing is left of the
    /// pillar; a width that is asked for may not be.
    fn check_width(width_nm: f64) -> Result<()> {
        if width_nm.is_finite() && width_nm >= 0.0 {
            return Ok(());
        }
        Err(Error::refused(
            "cell/width-out-of-range",
            format!("a pillar {width_nm} nm wide"),
            "give its width in nm, zero for a site without pillar",
        ))
    }

    fn check(&self) -> Result<()> {
        let lean = self.taper.abs();
        if lean.is_nan() || lean >= MOST_TAPER {
            return Err(Error::refused(
                "cell/side-wall-out-of-range",
                format!("the side walls lean by {} degrees", self.taper.to_degrees()),
                "use an angle below 45 degrees from upright",
            ));
        }
        if !(self.height_nm.is_finite() && self.height_nm > 0.0) {
            return Err(Error::refused(
                "cell/height-out-of-range",
                format!("the pillars are {} nm high", self.height_nm),
                "give a positive height",
            ));
        }
        let sound = |v: f64| v.is_finite() && v >= 0.0;
        if let Some(under) = self.under.iter().find(|u| !sound(u.height_nm)) {
            return Err(Error::refused(
                "cell/residual-film-out-of-range",
                format!("{} nm of {} under the pillars", under.height_nm, under.material),
                "give a thickness of zero or more",
            ));
        }
        if !sound(self.corner_radius_nm) || !sound(self.mask_height_nm) {
            return Err(Error::refused(
                "cell/corner-radius-out-of-range",
                format!(
                    "a corner radius of {} nm with {} nm of mask",
                    self.corner_radius_nm, self.mask_height_nm
                ),
                "neither may be negative",
            ));
        }
        Ok(())
    }
}

/// Largest k of a substrate whose loss is left out. It changes what a face of glass passes by less than a millionth; a
/// tenth of a millimetre of such a medium passes 9 % of green light.
pub const MOST_SUBSTRATE_K: f64 = 1e-3;

/// Leaning walls beyond this are not a pillar any more (rad).
const MOST_TAPER: f64 = std::f64::consts::FRAC_PI_4;

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(crate) fn paper() -> CellStack {
        CellStack::paper(350.0, 700.0).unwrap()
    }

    #[test]
    fn six_slices_stand_for_a_taper() {
        let orders = Orders::new(9).unwrap();
        let stack = CellStack {
            taper: 1.0_f64.to_radians(),
            ..paper()
        };
        let six = stack.transmission(180.0, 0.53, orders).unwrap();
        // Twelve slices, by hand.
        let mut fine = stack.layers(180.0, 0.53).unwrap();
        let model = fine.layers[0].clone();
        let slope = 2.0 * stack.taper.tan();
        fine.layers = (0..12)
            .map(|slice| Layer {
                height_nm: 700.0 / 12.0,
                outline: Outline::square(180.0 + slope * 700.0 * (1.0 - (f64::from(slice) + 0.5) / 12.0)),
                ..model.clone()
            })
            .collect();
        let twelve = transmit(&fine, 0.53, Side::Below, orders).unwrap();
        let upright = paper().transmission(180.0, 0.53, orders).unwrap();
        // The error of the slices falls with their number squared and is below the tolerance of a table.
        const SLICED: f64 = 0.01;
        // What the walls change must be far more than that error, or the test shows nothing.
        const TAPERED: f64 = 20.0 * SLICED;
        assert!((six - twelve).norm() < SLICED, "{six} {twelve}");
        assert!((six - upright).norm() > TAPERED, "{six} {upright}");
    }

    #[test]
    fn a_mask_adds_path_and_no_width_is_bare_glass() {
        let orders = Orders::new(9).unwrap();
        let masked = CellStack {
            mask_height_nm: 20.0,
            ..paper()
        };
        let phase = |s: &CellStack| s.transmission(150.0, 0.6, orders).unwrap().arg();
        // At least the path of 20 nm of air, at most that of solid alumina.
        const ALUMINA: f64 = 1.7;
        let added = (phase(&masked) - phase(&paper())).rem_euclid(std::f64::consts::TAU);
        let air = std::f64::consts::TAU * 0.020 / 0.6;
        assert!(added > air && added < ALUMINA * air, "{added} {air}");

        let n = paper().substrate.index(0.6).unwrap().re;
        let bare = paper().transmission(0.0, 0.6, orders).unwrap();
        // Fresnel's closed form; the solver inverts small matrices of numbers of size one.
        const ROUNDING: f64 = 1e-12;
        assert!((bare.norm() - 2.0 * n / (n + 1.0)).abs() < ROUNDING);
    }

    #[test]
    fn a_substrate_that_hardly_absorbs_is_one_without_loss() {
        let orders = Orders::new(3).unwrap();
        let on = |k: f64| CellStack {
            substrate: Material::constant(1.46, k).unwrap(),
            ..paper()
        };
        let [clear, little] = [0.0, MOST_SUBSTRATE_K].map(|k| on(k).transmission(150.0, 0.6, orders).unwrap());
        assert_eq!(clear, little);
        assert_eq!(on(MOST_SUBSTRATE_K).full_transmission(0.6).unwrap(), 1.46_f64.sqrt());
        on(MOST_SUBSTRATE_K).check_substrate((0.4, 0.7)).unwrap();
        for refused in [
            on(0.002).transmission(150.0, 0.6, orders).unwrap_err(),
            on(0.002).full_transmission(0.6).unwrap_err(),
            on(0.002).check_substrate((0.6, 0.7)).unwrap_err(),
        ] {
            assert_eq!(refused.id(), "cell/absorbing-substrate");
            insta::allow_duplicates! {
                insta::assert_snapshot!(refused, @"
                    the substrate n = 1.46 + 0.002 i has k = 0.002 at 600.0 nm, where light arrives through it
                      help: use a substrate with k of at most 0.001, or wavelengths and a band (`band_nm` in [cell]) at which it is clear: what absorbs on so thick a way passes no light
                    ");
            }
        }
    }

    #[test]
    fn impossible_stacks_are_refused() {
        let orders = Orders::new(3).unwrap();
        let refused = |stack: CellStack, width: f64, wavelength: f64, id: &str| {
            let error = stack.transmission(width, wavelength, orders).unwrap_err();
            assert_eq!(error.id(), id, "{error}");
        };
        refused(
            CellStack {
                height_nm: 0.0,
                ..paper()
            },
            100.0,
            0.5,
            "cell/height-out-of-range",
        );
        refused(
            CellStack { taper: 1.0, ..paper() },
            100.0,
            0.5,
            "cell/side-wall-out-of-range",
        );
        refused(
            CellStack {
                corner_radius_nm: -1.0,
                ..paper()
            },
            100.0,
            0.5,
            "cell/corner-radius-out-of-range",
        );
        refused(
            CellStack { taper: 0.1, ..paper() },
            330.0,
            0.5,
            "rcwa/width-out-of-range",
        );
        refused(paper(), 100.0, 0.25, "rcwa/material-out-of-range");
        for width in [f64::NAN, f64::INFINITY, -5.0, -1e9] {
            refused(paper(), width, 0.5, "cell/width-out-of-range");
            let oblique = paper().oblique(width, 0.5, [0.1, 0.0], orders);
            assert_eq!(oblique.unwrap_err().id(), "cell/width-out-of-range");
        }
    }
}
