//! Measured heights, spectra and widths of known objects: from a set of files to the effects that its stated model lacks.
//!
//! A set is a `measurement.toml` whose `kind` is `heights`, `spectra` or `widths`. Its files are found by patterns of their names. The
//! model as stated predicts each measurement; effects are selected by `metalith-attribution`; the answer is a
//! `diagnosis.json` and a page.
//!
//! | folder or file | holds | may use |
//! | --- | --- | --- |
//! | `pattern` | names of files by patterns | |
//! | `heights` | drawn maps and measured maps: set, model, figures | `pattern` |
//! | `spectra` | reflectance of film stacks: set, model, figures | `pattern` |
//! | `widths` | tables of widths: set, model, figures, `model.toml` | |
//! | `diagnosis`, `page` | the answer for programs and for people | |
//! | `run` | a set from its files to its answer | all above |

mod diagnosis;
mod heights;
mod page;
mod pattern;
mod run;
mod spectra;
mod widths;

pub use diagnosis::{Diagnosis, FoundEffect, LadderStep, NotInModel, Ranked, SetVerdict};
pub use heights::{HeightField, HeightModel, HeightSet};
pub use pattern::NamePattern;
pub use run::{Answer, SetKind, calibrate, kind_of};
pub use spectra::{Spectrum, SpectrumModel, SpectrumSet, StatedLayer};
pub use widths::{WidthModel, WidthSet, WidthSite};
