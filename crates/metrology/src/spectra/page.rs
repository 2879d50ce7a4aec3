//! Figures of spectra: measured and model, and below them the residual with the repeats as a band.

use metalith_report::{Axis, Chart, Page};

use super::model::SpectrumModel;
use super::set::SpectrumSet;

/// Most objects that are shown.
const MOST_SHOWN: usize = 24;

/// Add the spectra of each object to a page.
pub(crate) fn figures(page: &mut Page, set: &SpectrumSet, model: &SpectrumModel<'_>, theta: &[f64]) {
    page.section("Measured, model, residual");
    let measured = if set.is_transmission {
        "transmission"
    } else {
        "reflectance"
    };
    page.paragraph("The band is the range of the repeats about their mean.");
    for own in set.repeats().iter().take(MOST_SHOWN) {
        let first = own[0];
        let spectrum = &set.spectra[first];
        let (mean, predicted) = (model.mean(first), model.predicted(first, theta));
        let along = |values: Vec<f64>| set.wavelengths_nm.iter().copied().zip(values).collect::<Vec<_>>();
        let (medium, _) = &set.media[spectrum.medium];
        let title = format!("{} nm, {medium}", spectrum.size_nm);
        let axis = || Axis::linear("wavelength", "nm");
        let mut spectra = Chart::new(title.clone(), axis(), Axis::linear(measured, "")).size(460.0, 300.0);
        spectra.line("measured, mean of repeats", along(mean.to_vec()));
        spectra.line("model", along(predicted.clone()));
        let mut residual = Chart::new(
            format!("{title}: residual"),
            axis(),
            Axis::linear("measured less model", ""),
        )
        .size(460.0, 200.0);
        if own.len() > 1 {
            let band = set.wavelengths_nm.iter().enumerate().map(|(k, nm)| {
                let off = own.iter().map(|&s| set.spectra[s].reflectance[k] - mean[k]);
                let (low, high) = off.fold((0.0_f64, 0.0_f64), |(a, b), v| (a.min(v), b.max(v)));
                (*nm, low, high)
            });
            residual.band("repeats", band);
        }
        let off = along(mean.iter().zip(&predicted).map(|(m, p)| m - p).collect());
        if model.used(first).iter().all(|used| *used) {
            residual.line("residual", off);
        } else {
            let used = off.into_iter().zip(model.used(first)).filter(|(_, used)| **used);
            residual.points("residual, where it is used", used.map(|(point, _)| point));
        }
        let role = if spectrum.fitted { "Fitted" } else { "Not fitted" };
        page.row([
            spectra.caption(format!("{role}.")),
            residual.caption("Residual of the mean of the repeats."),
        ]);
    }
}
