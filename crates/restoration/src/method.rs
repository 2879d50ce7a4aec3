//! The methods of restoration, and which code runs each.

use std::str::FromStr;

use metalith_core::{Error, Progress, Result};

use crate::frame_model::Planes;
use crate::recorded::Recorded;
use crate::slope_denoiser::SlopeDenoiser;
use crate::{half_quadratic, richardson_lucy, tikhonov, total_variation};

/// Method by which a picture is restored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RestorationMethod {
    Tikhonov,
    TotalVariation,
    RichardsonLucy,
    HalfQuadratic,
    /// Half-quadratic splitting with the learnt prior.
    LearnedPrior,
}

impl RestorationMethod {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Tikhonov,
        Self::TotalVariation,
        Self::RichardsonLucy,
        Self::HalfQuadratic,
        Self::LearnedPrior,
    ];

    /// Methods of these names, each once; `wiener` is another name of `tikhonov`, which knows the spectrum of scenes.
    ///
    /// # Errors
    /// If one is no way to restore.
    pub fn of_names(names: &[String]) -> Result<Vec<Self>> {
        let mut methods = Vec::new();
        for name in names {
            let method = name.parse()?;
            if !methods.contains(&method) {
                methods.push(method);
            }
        }
        Ok(methods)
    }

    /// Name in options and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tikhonov => "tikhonov",
            Self::TotalVariation => "tv",
            Self::RichardsonLucy => "richardson-lucy",
            Self::HalfQuadratic => "hqs",
            Self::LearnedPrior => "prior",
        }
    }
}

impl FromStr for RestorationMethod {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let known = |m: &Self| m.name() == text || (*m == Self::Tikhonov && text == "wiener");
        Self::ALL.into_iter().find(known).ok_or_else(|| {
            Error::refused(
                "restore/unknown-method",
                format!("there is no method `{text}` of restoration"),
                "use tikhonov (or wiener, which is the same here), tv, richardson-lucy, hqs or prior",
            )
        })
    }
}

/// Restore by some of the elements, with or without the stray light of all.
///
/// # Errors
/// If the user stopped it.
pub(crate) fn restore_elements(
    recorded: &Recorded<'_>,
    method: RestorationMethod,
    elements: &[usize],
    stray_light: bool,
    progress: &dyn Progress,
) -> Result<Planes> {
    if method == RestorationMethod::RichardsonLucy {
        richardson_lucy::restore(recorded, elements, stray_light, progress)
    } else {
        let system = recorded.system(elements, stray_light);
        let clean = |pictures: Result<[Planes; 3]>| pictures.map(|[_, _, clean]| clean);
        let independent = match method {
            RestorationMethod::Tikhonov => tikhonov::restore(&system, progress),
            RestorationMethod::TotalVariation => total_variation::restore(&system, progress),
            RestorationMethod::LearnedPrior => clean(half_quadratic::restore(&system, recorded.prior, progress)),
            _ => clean(half_quadratic::restore(
                &system,
                &SlopeDenoiser::new(system.statistics()),
                progress,
            )),
        };
        Ok(system.statistics().picture(&independent?))
    }
}
