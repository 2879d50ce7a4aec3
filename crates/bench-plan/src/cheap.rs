//! Measurements that cost less than a session at the bench, and the effects of the process that they determine.

use metalith_calibrate::MeasuredSet;
use metalith_core::{Error, Progress, Result};
use metalith_metrology::{ForecastEffect, SpectrumForecast, StatedLayer, StatedPads};
use metalith_pillars::OutlineForm;
use serde::Serialize;

use crate::PlannedEffect;
use crate::bench_file::{SemOffer, Spectrometer};

/// Widths of pads that are considered, from the narrowest to the widest pillar of the design.
const WIDTHS: usize = 8;

/// Half of a 95 % interval in standard deviations.
const HALF_95: f64 = 1.96;

/// Fewest wavelengths of a spectrum.
const FEWEST_WAVELENGTHS: usize = 9;

/// Cheap measurements of a process.
#[derive(Clone, Debug, Serialize)]
pub struct CheapMeasurements {
    /// Widths of the pads whose spectra to measure (nm).
    pub pad_widths_nm: Vec<f64>,
    /// Widths to measure by SEM; none if the bench has no SEM, or if its offset alone is too large.
    pub sem_widths: Option<usize>,
    pub effects: Vec<CheapEffect>,
}

/// An effect with half of its 95 % interval by each measurement alone.
#[derive(Clone, Debug, Serialize)]
pub struct CheapEffect {
    pub name: String,
    pub unit: String,
    /// Size that is to be found; none of an effect that the session does not ask for.
    pub wanted: Option<f64>,
    pub film: Option<f64>,
    pub pads: Option<f64>,
    pub sem: Option<f64>,
    /// The cheapest measurement whose interval is narrower than the wanted size.
    pub determined_by: Option<&'static str>,
}

/// Cheap measurements for the process of a set, by the sensitivities of the model that a calibration of spectra fits.
///
/// # Errors
/// If the materials are not known over enough of the wavelengths, or the user stopped it.
pub(crate) fn cheap(
    set: &MeasuredSet,
    spectrometer: &Spectrometer,
    sem: Option<SemOffer>,
    planned: &[PlannedEffect],
    progress: &dyn Progress,
) -> Result<CheapMeasurements> {
    let (forecast, widths_nm) = forecast(set, spectrometer)?;
    let wanted = |name: &str| planned.iter().find(|e| e.name == name).map(|e| e.wanted);
    let (pad_widths_nm, pads) = forecast.of_pads(&widths_nm, &wanted, progress)?;
    let film = forecast.of_film();
    let by_sem =
        |sem: SemOffer, widths: usize| HALF_95 * sem.offset_sigma_nm.hypot(sem.sigma_nm / (widths as f64).sqrt());
    let enough = |sem: &SemOffer| {
        let wanted = wanted("cd_bias").unwrap_or(f64::INFINITY);
        (2..=sem.sites).find(|&n| by_sem(*sem, n) <= wanted)
    };
    let sem_widths = sem.as_ref().and_then(enough);
    let effect = |own: &ForecastEffect| {
        let wanted = wanted(own.name);
        let film = film.iter().find(|e| e.name == own.name).map(|e| e.half_interval);
        let sem = sem
            .filter(|_| own.name == "cd_bias")
            .map(|sem| by_sem(sem, sem_widths.unwrap_or(sem.sites)));
        let ways = [
            ("spectrum of the film", film),
            ("spectra of pads", Some(own.half_interval)),
            ("widths by SEM", sem),
        ];
        let enough = |half: Option<f64>| half.zip(wanted).is_some_and(|(half, wanted)| half <= wanted);
        CheapEffect {
            name: own.name.into(),
            unit: own.unit.into(),
            wanted,
            film,
            pads: Some(own.half_interval),
            sem,
            determined_by: ways.into_iter().find(|(_, half)| enough(*half)).map(|(way, _)| way),
        }
    };
    Ok(CheapMeasurements {
        pad_widths_nm,
        sem_widths,
        effects: pads.iter().map(effect).collect(),
    })
}

/// The process of a set as spectra see it, and widths of pads.
fn forecast(set: &MeasuredSet, spectrometer: &Spectrometer) -> Result<(SpectrumForecast, Vec<f64>)> {
    let cell = &set.stack.cell;
    let materials = [&cell.film, &cell.substrate, &cell.ambient].into_iter();
    let materials: Vec<_> = materials.chain(cell.under.iter().map(|u| &u.material)).collect();
    let known = |nm: &f64| {
        let um = nm * 1e-3;
        materials
            .iter()
            .all(|m| (m.range_um().0..=m.range_um().1).contains(&um))
    };
    let wavelengths_nm: Vec<f64> = spectrometer.wavelengths_nm().into_iter().filter(known).collect();
    if wavelengths_nm.len() < FEWEST_WAVELENGTHS {
        return Err(Error::refused(
            "plan/spectrometer-range",
            format!(
                "the materials of the design are known at fewer than {FEWEST_WAVELENGTHS} wavelengths of [spectrometer]"
            ),
            "change its `from_nm`, `to_nm` or `step_nm`, or give tables of the materials that reach farther",
        ));
    }
    let all = || set.elements.iter().flat_map(|e| e.pillars.number.iter().copied());
    let drawn = || all().filter(|width| *width > 0).map(f64::from);
    let (narrowest, widest) = (drawn().fold(f64::MAX, f64::min), drawn().fold(0.0, f64::max));
    let step = (widest - narrowest) / (WIDTHS - 1) as f64;
    let widths_nm = (0..WIDTHS).map(|k| (narrowest + step * k as f64).round()).collect();
    let is_residual = |material: &metalith_cell::Material| *material == cell.film;
    let under = cell.under.iter().rev().filter(|u| !is_residual(&u.material));
    let forecast = SpectrumForecast {
        film: cell.film.clone(),
        substrate: cell.substrate.clone(),
        under: under
            .map(|u| StatedLayer {
                name: String::new(),
                material: Some(u.material.clone()),
                thickness_nm: Some(u.height_nm),
            })
            .collect(),
        ambient: cell.ambient.clone(),
        pads: StatedPads {
            layer: 0,
            pitch_nm: cell.pitch_nm,
            lattice: cell.lattice,
            is_round: cell.shape.outline() == OutlineForm::Circle,
            height_nm: cell.height_nm,
            residual_nm: cell
                .under
                .iter()
                .filter(|u| is_residual(&u.material))
                .map(|u| u.height_nm)
                .sum(),
            taper_deg: 0.0,
        },
        wavelengths_nm,
        sigma: spectrometer.sigma,
    };
    Ok((forecast, widths_nm))
}
