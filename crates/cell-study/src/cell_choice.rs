//! Pitch, height and widths of the pillars of a new lens, from its material, wavelength and aperture.

use rayon::prelude::*;

use metalith_cell::{AVOIDED_BELOW, CellStack, PhaseCurve, SolvedMapping, UniformLayer};
use metalith_core::{Error, Progress, Result};
use metalith_pillars::{DatabaseUnit, LatticeKind, PillarShape, Pitch};
use metalith_rcwa::{CellLattice, Material, Orders};

/// Diffraction orders along an axis while cells are tried, and widths of each.
const ORDERS: usize = 9;
const WIDTHS: usize = 40;

/// Pitches that are tried, over the greatest that does not diffract.
const PITCHES: [f64; 4] = [0.96, 0.88, 0.80, 0.72];

/// Heights that are tried, in steps of a tenth of wavelength over index contrast, which is a wave of phase against air.
const HEIGHTS: std::ops::RangeInclusive<u32> = 7..=32;

/// Least phase (waves) that light gains in the film against air: phases of lower pillars come from resonances alone, which unlike
/// neighbours shift.
const LEAST_GAIN_WAVES: f64 = 0.7;

/// Narrowest pillar and narrowest gap over the nearest distance of two pillars, and both at least (nm).
const NARROWEST: f64 = 0.25;
const GAP: f64 = 0.15;
const LEAST_NM: f64 = 50.0;

/// Fewest steps from the narrowest to the widest pillar: with fewer the phases of a mapping are too far apart.
const LEAST_STEPS: f64 = 10.0;

/// Light in the first order that is given up for an aspect ratio (height over narrowest width) less by one.
const PER_ASPECT: f64 = 0.005;

/// Light in the first order that is given up for phases without a gap of a wave beyond a small one, which the few widths that are
/// tried have too.
const PER_GAP: f64 = 0.3;
const SMALL_GAP_WAVES: f64 = 0.06;

/// Largest distance (waves) from one phase that pillars give to the next: beyond it a lens has no full wave of phase.
pub const WIDEST_GAP_WAVES: f64 = 0.2;

/// The same for a height that was asked for, of a film that is there or of a published lens: `run` judges its mapping by the limit of
/// the design.
const WIDEST_ASKED_GAP_WAVES: f64 = 0.3;

/// Least share of the light that the mapping of a cell sends to the first order.
pub const LEAST_LIGHT: f64 = 0.3;

/// Purpose of a cell.
#[derive(Clone, Debug)]
pub struct CellRequest {
    pub film: Material,
    pub substrate: Material,
    /// Wavelength (um).
    pub wavelength_um: f64,
    pub shape: PillarShape,
    pub lattice: LatticeKind,
    /// Sine of the angle from the rim of a lens to its focus, and the largest sine of steering along an axis.
    pub numerical_aperture: f64,
    pub steering_sine: f64,
    /// Pitch and height (nm), where they are given.
    pub pitch_nm: Option<Pitch>,
    pub height_nm: Option<f64>,
    /// Narrowest and widest pillar (nm), where they are given.
    pub width_min_nm: Option<u16>,
    pub width_max_nm: Option<u16>,
}

/// A cell that was chosen.
#[derive(Clone, Debug)]
pub struct ChosenCell {
    pub pitch_nm: Pitch,
    /// Database unit of its layouts.
    pub database_unit: DatabaseUnit,
    pub height_nm: f64,
    /// Narrowest and widest pillar, and the step between widths (nm).
    pub widths_nm: (u16, u16),
    pub step_nm: u16,
    /// Pitch (nm) from which on the lattice diffracts into the substrate, and from which on the phase at the rim steps by more than
    /// half a wave a pitch.
    pub diffracts_nm: f64,
    pub nyquist_nm: f64,
    /// Number of cells that were tried.
    pub tried: usize,
    /// Mapping, as it is solved for the design.
    pub mapping: SolvedMapping,
}

/// A pitch and a height with the mapping of a few widths.
#[derive(Clone, Debug)]
struct Trial {
    pitch_nm: Pitch,
    height_nm: f64,
    mapping: SolvedMapping,
    score: f64,
}

/// Database unit for a pitch: the largest of which half the pitch is a multiple, so that a lens has as many sites on either side
/// of its centre; else the largest that divides the pitch, with a site in the centre; else the finest.
fn unit_of(pitch: Pitch) -> DatabaseUnit {
    let exact = DatabaseUnit::ALL.into_iter().find(|unit| unit.divides_half(pitch));
    let exact = exact.or_else(|| DatabaseUnit::of_pitch(pitch));
    exact.unwrap_or(DatabaseUnit::Tenth)
}

/// Light in the first order, less what is given up for low pillars and for phases that have no gap.
fn score(mapping: &SolvedMapping, height_nm: f64, narrowest_nm: u16) -> f64 {
    let aspect = height_nm / f64::from(narrowest_nm);
    mapping.light.first - PER_ASPECT * aspect - PER_GAP * (mapping.gap_waves - SMALL_GAP_WAVES).max(0.0)
}

impl CellRequest {
    fn index(&self, material: &Material) -> Result<f64> {
        Ok(material.index(self.wavelength_um)?.re)
    }

    /// Pitch from which on light along the steepest element has an order in the substrate (nm).
    fn diffracts_nm(&self) -> Result<f64> {
        let index = self.index(&self.substrate)? + self.steering_sine;
        // The shortest vector of a hexagonal lattice is 2 / sqrt(3) over the pitch.
        let rows = match self.lattice {
            LatticeKind::Square => 1.0,
            LatticeKind::Hexagonal => 2.0 / 3f64.sqrt(),
        };
        Ok(1e3 * self.wavelength_um * rows / index)
    }

    fn sine(&self) -> f64 {
        self.numerical_aperture + self.steering_sine
    }

    fn stack(&self, pitch_nm: Pitch, height_nm: f64) -> Result<CellStack> {
        Ok(CellStack {
            lattice: CellLattice::drawn(self.lattice, pitch_nm, unit_of(pitch_nm)),
            shape: self.shape,
            film: self.film.clone(),
            substrate: self.substrate.clone(),
            under: Vec::<UniformLayer>::new(),
            ambient: Material::constant(1.0, 0.0)?,
            ..CellStack::paper(f64::from(pitch_nm), height_nm)?
        })
    }

    /// Check what is asked for against the lattice and the film, before anything is solved.
    fn check(&self) -> Result<(f64, f64)> {
        let nm = self.wavelength_um * 1e3;
        let diffracts_nm = self.diffracts_nm()?;
        let nyquist_nm = 0.5 * nm / self.sine().max(1e-6);
        let even_below = |pitch: f64| 2.0 * ((pitch - 1e-9) / 2.0).floor();
        if self.sine() >= 1.0 {
            return Err(Error::refused(
                "new/aperture-too-high",
                format!(
                    "a numerical aperture of {:.3} and steering by a sine of {:.3}: no lattice carries more than 1 together",
                    self.numerical_aperture, self.steering_sine
                ),
                format!(
                    "take a longer focal length or less steering: a numerical aperture below {:.3}",
                    (1.0 - self.steering_sine).max(0.0)
                ),
            ));
        }
        let (film, substrate) = (self.index(&self.film)?, self.index(&self.substrate)?);
        if film <= 1.2 {
            return Err(Error::refused(
                "new/index-too-low",
                format!(
                    "{} has an index of {film:.3} at {nm:.1} nm, hardly more than air",
                    self.film
                ),
                format!("take a film of a higher index than that of the substrate, {substrate:.3}"),
            ));
        }
        let Some(pitch_nm) = self.pitch_nm.map(f64::from) else {
            return Ok((diffracts_nm, nyquist_nm));
        };
        if pitch_nm >= diffracts_nm {
            return Err(Error::refused(
                "new/pitch-diffracts",
                format!(
                    "a pitch of {pitch_nm} nm diffracts into the substrate (index {substrate:.3}) at {nm:.1} nm: orders exist from {diffracts_nm:.1} \
                     nm on"
                ),
                format!(
                    "take a pitch of {} nm or less, or a longer wavelength",
                    even_below(diffracts_nm)
                ),
            ));
        }
        if pitch_nm > nyquist_nm {
            return Err(Error::refused(
                "new/pitch-too-coarse",
                format!(
                    "a pitch of {pitch_nm} nm samples the phase at the rim by more than half a wave: a numerical aperture of {:.3} needs {nyquist_nm:.1} \
                     nm or less",
                    self.sine()
                ),
                format!(
                    "take a pitch of {} nm, or a numerical aperture of {:.3} or less",
                    even_below(nyquist_nm),
                    0.5 * nm / pitch_nm
                ),
            ));
        }
        Ok((diffracts_nm, nyquist_nm))
    }

    /// Choose the cell: of the pitches and heights that are not given those whose mapping sends most light to the first order,
    /// less a little for high pillars and for phases that none gives.
    ///
    /// # Errors
    /// If the pitch diffracts or is too coarse for the aperture, the height gives no full wave of phase, the film absorbs, or the user
    /// stopped it: with the number, and the nearest value that works.
    pub fn choose(&self, cache: Option<&std::path::Path>, progress: &dyn Progress) -> Result<ChosenCell> {
        let (diffracts_nm, nyquist_nm) = self.check()?;
        let mut trials = self.trials(diffracts_nm, progress)?;
        let tried = trials.len();
        trials.sort_by(|a, b| b.score.total_cmp(&a.score));
        let index = self.index(&self.film)?;
        let gain_waves = |height_nm: f64| height_nm * 1e-3 * (index - 1.0) / self.wavelength_um + 1e-9;
        let asked = |trial: &&Trial| self.height_nm.is_none_or(|height| height == trial.height_nm);
        let working: Vec<&Trial> = trials
            .iter()
            .filter(|t| self.works(&t.mapping) && gain_waves(t.height_nm) >= LEAST_GAIN_WAVES)
            .collect();
        // What few widths and orders say may not hold for all.
        const SOLVED: usize = 3;
        let (mut refused, mut best): (Option<SolvedMapping>, Option<(f64, ChosenCell)>) = (None, None);
        for trial in working.iter().copied().filter(asked).take(SOLVED) {
            let (widths_nm, step_nm) = self.widths(trial.pitch_nm)?;
            let all: Vec<u16> = (widths_nm.0..=widths_nm.1).step_by(usize::from(step_nm)).collect();
            let stack = self.stack(trial.pitch_nm, trial.height_nm)?;
            let mapping = SolvedMapping::solve(&stack, self.wavelength_um, &all, cache, progress)?;
            if !self.works(&mapping) {
                refused.get_or_insert(mapping);
                continue;
            }
            let score = score(&mapping, trial.height_nm, widths_nm.0);
            if best.as_ref().is_none_or(|(most, _)| score > *most) {
                let cell = ChosenCell {
                    pitch_nm: trial.pitch_nm,
                    database_unit: unit_of(trial.pitch_nm),
                    height_nm: trial.height_nm,
                    widths_nm,
                    step_nm,
                    diffracts_nm,
                    nyquist_nm,
                    tried,
                    mapping,
                };
                best = Some((score, cell));
            }
        }
        if let Some((_, cell)) = best {
            return Ok(cell);
        }
        let low = self.height_nm.map(gain_waves).filter(|gain| *gain < LEAST_GAIN_WAVES);
        Err(self.refusal(&trials, &working, refused, low))
    }

    /// Reason why no cell that was asked for works, and the nearest that does.
    fn refusal(&self, trials: &[Trial], working: &[&Trial], solved: Option<SolvedMapping>, low: Option<f64>) -> Error {
        let nm = self.wavelength_um * 1e3;
        let of_asked = trials
            .iter()
            .find(|t| self.height_nm.is_none_or(|height| height == t.height_nm));
        let found = solved.or_else(|| of_asked.map(|t| t.mapping.clone()));
        let few = low.map(|gain| {
            format!("a phase of {gain:.2} waves more than air, at least {LEAST_GAIN_WAVES} for a full wave without resonances")
        });
        let of_mapping = found.map_or_else(
            || format!("every width passes less than {AVOIDED_BELOW} of the light"),
            |m| {
                format!(
                    "phases of {:.2} waves with a gap of {:.2} (at most {}), and {:.2} of the light in the first order (at least \
                     {LEAST_LIGHT})",
                    m.span_waves,
                    m.gap_waves,
                    self.widest_gap_waves(),
                    m.light.first
                )
            },
        );
        let numbers = few.unwrap_or(of_mapping);
        let k = self.film.index(self.wavelength_um).map_or(0.0, |index| index.im);
        let what = match self.height_nm {
            Some(height) => format!("pillars of {} {height} nm high at {nm:.1} nm have {numbers}", self.film),
            None => format!(
                "no pillars of {} at {nm:.1} nm give a lens: the best have {numbers}",
                self.film
            ),
        };
        let near = |height: f64| {
            let apart = |t: &&&Trial| (t.height_nm - height).abs();
            working
                .iter()
                .min_by(|a, b| apart(a).total_cmp(&apart(b)))
                .map(|t| t.height_nm)
        };
        let hint = match self.height_nm.and_then(near) {
            Some(height) => format!("take a pillar height of {height} nm, the nearest that works"),
            None if k > 0.01 => format!(
                "{} absorbs there (k = {k:.3}): take another material or a longer wavelength",
                self.film
            ),
            None => "take another material, or leave the pitch out".into(),
        };
        Error::refused("new/no-usable-height", what, hint)
    }

    /// True if a mapping makes a lens.
    fn works(&self, mapping: &SolvedMapping) -> bool {
        mapping.gap_waves <= self.widest_gap_waves() && mapping.light.first >= LEAST_LIGHT
    }

    fn widest_gap_waves(&self) -> f64 {
        match self.height_nm {
            Some(_) => WIDEST_ASKED_GAP_WAVES,
            None => WIDEST_GAP_WAVES,
        }
    }

    /// Narrowest and widest pillar and the step (nm) on a pitch.
    fn widths(&self, pitch_nm: Pitch) -> Result<((u16, u16), u16)> {
        let widest = f64::from(self.lattice.widest_nm(pitch_nm, DatabaseUnit::Nanometre));
        let step = 2.0 * (f64::from(pitch_nm) / 500.0).round().max(1.0);
        let narrowest = self.width_min_nm.map_or((NARROWEST * widest).max(LEAST_NM), f64::from);
        let gapped = self
            .width_max_nm
            .map_or(widest - (GAP * widest).max(LEAST_NM), f64::from);
        let widest_with_gaps = widest - LEAST_NM;
        if gapped > widest_with_gaps {
            return Err(Error::refused(
                "new/width-too-wide",
                format!(
                    "a pitch of {pitch_nm} nm leaves pillars of up to {widest_with_gaps} nm with gaps of {LEAST_NM} nm, and {gapped} nm are asked for"
                ),
                "take a narrower widest pillar, a longer pitch, or a longer wavelength",
            ));
        }
        let low = step * (narrowest / step).ceil();
        let high = step * (gapped / step).floor();
        if high < low + LEAST_STEPS * step {
            let (gaps, remedy) = match (self.width_min_nm, self.width_max_nm) {
                (None, None) => (format!(", with pillars and gaps of {LEAST_NM} nm at least"), ""),
                _ => (String::new(), ", or a wider range of widths"),
            };
            return Err(Error::refused(
                "new/pitch-too-small",
                format!(
                    "a pitch of {pitch_nm} nm leaves widths from {low} to {high} nm{gaps}: too few steps of {step} nm"
                ),
                format!("take a longer pitch, or a longer wavelength{remedy}"),
            ));
        }
        Ok(((low as u16, high as u16), step as u16))
    }

    fn heights(&self) -> Result<Vec<f64>> {
        let unit = 1e2 * self.wavelength_um / (self.index(&self.film)? - 1.0);
        let round = if unit > 300.0 { 100.0 } else { 10.0 };
        let mut heights: Vec<f64> = HEIGHTS
            .map(|k| round * (f64::from(k) * unit / round).round().max(1.0))
            .collect();
        heights.extend(self.height_nm);
        heights.sort_by(f64::total_cmp);
        heights.dedup();
        Ok(heights)
    }

    /// All pitches and heights, with a few widths each.
    fn trials(&self, diffracts_nm: f64, progress: &dyn Progress) -> Result<Vec<Trial>> {
        // At longer pitches the steps of the phase send light past the lens, into an order that travels in air.
        let limit_nm = diffracts_nm.min(1e3 * self.wavelength_um / (1.0 + self.sine()));
        let pitches: Vec<Pitch> = match self.pitch_nm {
            Some(pitch) => vec![pitch],
            None => PITCHES
                .iter()
                .map(|share| Pitch::whole(2 * (0.5 * share * limit_nm).floor() as u32))
                .collect(),
        };
        let heights = self.heights()?;
        let orders = Orders::new(ORDERS)?;
        let mut work = Vec::new();
        for &pitch in &pitches {
            match self.widths(pitch) {
                Ok(((low, high), step)) => {
                    let steps = usize::from((high - low) / step);
                    let mut widths: Vec<u16> = (0..WIDTHS)
                        .map(|k| low + step * ((k * steps) as f64 / (WIDTHS - 1) as f64).round() as u16)
                        .collect();
                    widths.dedup();
                    work.push((pitch, widths));
                }
                Err(error) if pitch == pitches[0] => return Err(error),
                Err(_) => {}
            }
        }
        progress.begin("trying cells", work.iter().map(|(_, widths)| widths.len() as u64).sum());
        let mut trials = Vec::new();
        for (pitch_nm, widths_nm) in work {
            let stack = self.stack(pitch_nm, heights[0])?;
            let full = stack.full_transmission(self.wavelength_um)?;
            let solve = |&width: &u16| {
                progress.check_stopped()?;
                let t = stack.at_heights(f64::from(width), self.wavelength_um, &heights, orders);
                progress.advance(1);
                t
            };
            let solved = widths_nm.par_iter().map(solve).collect::<Result<Vec<_>>>()?;
            for (k, &height_nm) in heights.iter().enumerate() {
                let t = solved.iter().map(|of_width| of_width[k] / full).collect();
                let curve = PhaseCurve::of_transmissions(self.wavelength_um, widths_nm.clone(), t);
                // Of a film that absorbs everything there is no mapping.
                let Ok(mapping) = SolvedMapping::of_curve(&curve, ORDERS) else {
                    continue;
                };
                trials.push(Trial {
                    pitch_nm,
                    height_nm,
                    score: score(&mapping, height_nm, widths_nm[0]),
                    mapping,
                });
            }
        }
        Ok(trials)
    }
}

#[cfg(test)]
mod tests {
    use metalith_core::Silent;

    use super::*;

    fn request() -> CellRequest {
        CellRequest {
            film: Material::named("tio2").unwrap(),
            substrate: Material::named("sio2").unwrap(),
            wavelength_um: 0.633,
            shape: PillarShape::Circle,
            lattice: LatticeKind::Square,
            numerical_aperture: 0.24,
            steering_sine: 0.0,
            pitch_nm: None,
            height_nm: None,
            width_min_nm: None,
            width_max_nm: None,
        }
    }

    fn said(request: &CellRequest) -> String {
        match request.check() {
            Err(Error::Invalid { what, hint, .. }) => format!("{what}: {hint}"),
            other => panic!("{other:?}"),
        }
    }

    /// What cannot be is refused with the number and the nearest value that works.
    #[test]
    fn pitches_and_apertures_beyond_the_lattice_are_refused() {
        let coarse = said(&CellRequest {
            pitch_nm: Some(500.into()),
            ..request()
        });
        assert!(coarse.contains("434.") && coarse.contains(" 434 nm"), "{coarse}");
        let steep = said(&CellRequest {
            pitch_nm: Some(400.into()),
            numerical_aperture: 0.9,
            ..request()
        });
        assert!(steep.contains("351.7") && steep.contains("0.791"), "{steep}");
        let beyond = said(&CellRequest {
            numerical_aperture: 0.8,
            steering_sine: 0.3,
            ..request()
        });
        assert!(beyond.contains("below 0.700"), "{beyond}");
    }

    #[test]
    fn widths_and_heights_are_on_their_grids() {
        let ((low, high), step) = request().widths(400.into()).unwrap();
        assert_eq!((low, high, step), (100, 340, 2));
        let ((low, high), step) = request().widths(2700.into()).unwrap();
        assert!(step == 10 && low % step == 0 && high % step == 0);
        assert!(request().widths(110.into()).is_err());
        let heights = request().heights().unwrap();
        assert!(heights.is_sorted() && heights.iter().all(|h| h % 10.0 == 0.0) && heights.len() > 20);
    }

    /// A height that gives too little phase is refused, with one that gives enough.
    #[test]
    #[ignore = "solves cells: seconds in a build that is optimised"]
    fn a_height_too_low_names_the_nearest() {
        let low = CellRequest {
            height_nm: Some(200.0),
            ..request()
        };
        let error = low.choose(None, &Silent).unwrap_err();
        assert_eq!(error.id(), "new/no-usable-height");
        let text = error.to_string();
        let named = text.split("height of ").nth(1).and_then(|rest| rest.split(' ').next());
        assert!(named.unwrap().parse::<f64>().unwrap() > 200.0, "{text}");
        assert!(request().choose(None, &Silent).unwrap().mapping.light.first > 0.7);
    }
}
