//! Light of a sample near the place where a chief ray lands: coherent sums over its sites.

use std::f64::consts::{PI, TAU};

use ndarray::Array2;
use num_complex::{Complex32, Complex64};

use super::patches::Tiles;
use metalith_core::Result;
use metalith_design::phase::ElementPhase;
use metalith_optics::IncoherentFields;
use metalith_wave::psf::FocusMetrics;
use metalith_wave::{Direct, IdealPsf, PlaneWave, Psf, Window};

/// A light of an element, and where it is looked at.
pub(super) struct Lit<'a> {
    pub phase: &'a ElementPhase<'a>,
    /// Diameter of the circle that holds the lens (nm).
    pub diameter_nm: u32,
    pub wave: PlaneWave,
    pub window: Window,
    /// Place where the chief ray lands (um).
    pub chief_um: [f64; 2],
    /// |t| of a cell that passes all its power.
    pub full: f64,
}

/// Sums over the sites of a sample, without the area of a cell, which all share.
#[derive(Clone)]
pub(super) struct Sums {
    /// Fields on the window of the layout, one for each that does not interfere with others, then of the target.
    fields: Vec<Array2<Complex64>>,
    /// Share of the light of each field of the layout.
    weight: f64,
    /// Squared moduli of the terms of single patches, added up: of the layout, and of the target. That is the square of a sum of
    /// patches without any relation.
    unrelated: [f64; 2],
    /// Moduli of the terms of all sites: the sum if all arrive in phase.
    open: f64,
    /// Sites inside the lens, and inside its circle.
    inside: u64,
    in_circle: u64,
}

impl Sums {
    /// Sums over the sites of tiles. Beside the chief ray, all sites of a patch count as one in its middle: at the rim of the window of a
    /// lens of 1 mm and 2.4 mm focal length, the way from the outermost of them is a hundredth of a wavelength off.
    pub(super) fn of(tiles: &Tiles, fields: &IncoherentFields<'_>, lit: &Lit<'_>) -> Result<Self> {
        let (lattice, window) = (lit.phase.lattice(), &lit.window);
        let transmitted = transmissions(tiles, fields)?;
        let targets = transmitted.len();
        let limit = lattice.most_units2(lit.diameter_nm);
        let at = |[x, y]: [f64; 2]| [x, y, window.distance_um];
        let mut sums = Self {
            fields: vec![Array2::zeros([window.samples; 2]); targets + 1],
            weight: fields.weight,
            unrelated: [0.0; 2],
            open: 0.0,
            inside: 0,
            in_circle: 0,
        };
        for k in 0..tiles.patches() {
            let (mut terms, mut middle_um, mut inside) = (vec![Complex64::ZERO; targets + 1], [0.0; 2], 0);
            for ([column, row], [ix, iy]) in tiles.patch(k) {
                sums.in_circle += u64::from(lattice.has(ix, iy) && lattice.units2(ix, iy) <= limit);
                let Some(turns) = lit.phase.turns(ix, iy) else {
                    continue;
                };
                inside += 1;
                let place_um = [lattice.place_um(0, ix), lattice.place_um(1, iy)];
                let way = Direct::of_site(place_um, at(lit.chief_um), &lit.wave);
                sums.open += way.norm();
                for (term, t) in terms.iter_mut().zip(&transmitted) {
                    let t = t[[row, column]];
                    *term += Complex64::new(t.re.into(), t.im.into()) * way;
                }
                terms[targets] += Complex64::cis(TAU * turns.fract()) * way;
                middle_um = [0, 1].map(|axis| middle_um[axis] + place_um[axis]);
            }
            if inside == 0 {
                continue;
            }
            sums.inside += inside;
            let (layout, target) = terms.split_at(targets);
            sums.unrelated[0] += fields.weight * layout.iter().map(Complex64::norm_sqr).sum::<f64>();
            sums.unrelated[1] += target[0].norm_sqr();
            let middle_um = middle_um.map(|sum| sum / inside as f64);
            let way = |point_um| Direct::of_site(middle_um, at(point_um), &lit.wave);
            let to_chief = way(lit.chief_um).inv();
            for iy in 0..window.samples {
                for ix in 0..window.samples {
                    let aside = way([window.coordinate_um(0, ix), window.coordinate_um(1, iy)]) * to_chief;
                    for (field, term) in sums.fields.iter_mut().zip(&terms) {
                        field[[iy, ix]] += term * aside;
                    }
                }
            }
        }
        Ok(sums)
    }

    /// Sums over all of these samples but one.
    pub(super) fn without(parts: &[Self], left_out: Option<usize>) -> Option<Self> {
        let kept = parts.iter().enumerate().filter(|(k, _)| Some(*k) != left_out);
        kept.map(|(_, part)| part.clone()).reduce(|mut sum, part| {
            sum.fields
                .iter_mut()
                .zip(&part.fields)
                .for_each(|(to, from)| *to += from);
            (sum.open, sum.inside) = (sum.open + part.open, sum.inside + part.inside);
            sum.in_circle += part.in_circle;
            sum.unrelated = [0, 1].map(|k| sum.unrelated[k] + part.unrelated[k]);
            sum
        })
    }

    /// Sites inside the lens.
    pub(super) fn sites(&self) -> u64 {
        self.inside
    }

    /// Share of the circle of the lens that is inside it, by the sample; exactly one for a round lens.
    pub(super) fn open_share(&self) -> f64 {
        self.inside as f64 / self.in_circle as f64
    }

    /// Figures in focus of layout and target, of which the sample stands for the whole lens.
    pub(super) fn focus(&self, lit: &Lit<'_>) -> [FocusMetrics; 2] {
        let circle_um2 = PI * (f64::from(lit.diameter_nm) * 0.5e-3).powi(2);
        let site_um2 = circle_um2 / self.in_circle as f64;
        let perfect = IdealPsf {
            peak: (site_um2 * self.open).powi(2),
            power_um2: circle_um2 * self.open_share(),
        };
        let psf = |field: &Array2<Complex64>| Psf {
            window: lit.window,
            values: field.mapv(|e| e.norm_sqr() * site_um2 * site_um2),
            otf: None,
        };
        let (target, layout) = self.fields.split_last().expect("the target is the last");
        let layout = Psf::sum(layout.iter().map(psf).collect(), self.weight);
        [layout.focus(&perfect.scaled(lit.full)), psf(target).focus(&perfect)]
    }

    /// Mean Strehl ratios, of layout and target, of as many patches without any relation.
    pub(super) fn by_chance(&self, lit: &Lit<'_>) -> [f64; 2] {
        let open2 = self.open * self.open;
        [
            self.unrelated[0] / (open2 * lit.full * lit.full),
            self.unrelated[1] / open2,
        ]
    }
}

/// Transmissions of the sites of the map of tiles in each field.
fn transmissions(tiles: &Tiles, fields: &IncoherentFields<'_>) -> Result<Vec<Array2<Complex32>>> {
    let of = |field: &metalith_optics::Field<'_>| {
        let aperture = field.aperture(&fields.light)?;
        let mut all = Array2::zeros(tiles.map.number.dim());
        for (iy, mut row) in all.rows_mut().into_iter().enumerate() {
            aperture.fill_row(iy, row.as_slice_mut().expect("rows are contiguous"));
        }
        Ok(all)
    };
    fields.fields.iter().map(of).collect()
}
