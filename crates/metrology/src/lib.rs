//! Measured heights, spectra, widths and point spread functions of known objects: from a set of files to the effects that its stated
//! model lacks.
//!
//! A set is a `measurement.toml` whose `kind` is `heights`, `spectra`, `widths` or `psf_stack`. Its files are found by patterns of
//! their names. The
//! model as stated predicts each measurement; effects are selected by `metalith-attribution`; the answer is a
//! `diagnosis.json` and a page.
//!
//! | folder or file | holds | may use |
//! | --- | --- | --- |
//! | `pattern` | names of files by patterns | |
//! | `number_rows` | rows of numbers with any separator | |
//! | `widths` | tables of widths: set, model, figures, `model.toml` | |
//! | `declared` | effects of a file, by expressions | |
//! | `heights` | drawn maps and measured maps: set, model, figures | `pattern`, `declared` |
//! | `spectra` | reflectance of film stacks and of pads of pillars: set, model, figures | `pattern`, `declared` |
//! | `noise` | white noise by second differences | |
//! | `proposal` | patterns of what no effect explains | `declared`, `heights`, `spectra` |
//! | `psf_stack` | stacks of point spread functions of reliefs and complex transmissions: set, light, sensor, model, figures | `pattern`, the transforms of `heights` |
//! | `diagnosis`, `page` | the answer for programs and for people | |
//! | `run` | a set from its files to its answer | all above |

mod declared;
mod diagnosis;
mod heights;
mod noise;
mod number_rows;
mod page;
mod pattern;
mod proposal;
mod psf_stack;
mod run;
mod spectra;
mod widths;

pub use diagnosis::{Diagnosis, FoundEffect, LadderStep, NotInModel, Ranked};
pub use heights::{HeightField, HeightModel, HeightSet};
pub use metalith_attribution::SetVerdict;
pub use pattern::NamePattern;
pub use proposal::Proposal;
pub use psf_stack::{ApertureShape, StackBench, StackModel, StackObject, StackPlane, StackSet, ThinLens, Transmission};
pub use run::{Answer, SetKind, calibrate, keys_of_effects, kind_of};
pub use spectra::{ForecastEffect, Spectrum, SpectrumForecast, SpectrumModel, SpectrumSet, StatedLayer, StatedPads};
pub use widths::{WidthModel, WidthSet, WidthSite};
