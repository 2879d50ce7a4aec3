//! Result of a selection: effects with values and intervals, errors, and reasons for refusals.

use crate::fit::Gain;

/// Errors with some effects: what was fitted, what was left out, what was never fitted.
#[derive(Clone, Debug)]
pub struct RefitErrors {
    /// Root mean square of the fitted residual.
    pub fitted: f64,
    /// Root mean square of the residual of measurements left out, in each way; none where nothing is predicted.
    pub held_out: Vec<Option<f64>>,
    /// Figures of merit of what was fitted, and of what was never fitted.
    pub figures: [Vec<f64>; 2],
    /// Mean square of each measurement when it was left out, in each way.
    pub(super) own: Vec<Vec<Option<f64>>>,
}

/// Reason why an effect is not taken.
#[derive(Clone, Debug, PartialEq)]
pub enum RefitRejection {
    /// It lowers the mean square by so small a share.
    Little(f64),
    /// Measurements that were left out, in this way, are not surely predicted better: the group that is predicted worse.
    Unsure { way: String, worse: Option<String> },
    /// It fits better, and predicts measurements worse that were left out: what they are, the error before and after.
    Worse { what: String, before: f64, after: f64 },
    /// The 95 % interval of its values includes those without it.
    Nothing,
    /// Its value is at the end of the physical range.
    Unphysical,
    /// It changes an effect that was not taken.
    NoBase(String),
}

impl RefitRejection {
    /// One clause for a person.
    pub fn sentence(&self) -> String {
        match self {
            Self::Little(share) if *share <= 0.0 => "does not lower the fitted mean square".into(),
            Self::Little(share) => format!("lowers the fitted mean square by {:.1} % only", 100.0 * share),
            Self::Unsure { way, worse } => {
                let own = format!("the 95 % interval of its gain includes zero where each {way} is left out");
                worse
                    .as_ref()
                    .map_or(own.clone(), |group| format!("{own}: {way} {group} is predicted worse"))
            }
            Self::Worse { what, before, after } => {
                // Four digits of the larger one.
                let decimals = (3.0 - before.abs().max(after.abs()).log10().floor()).clamp(0.0, 9.0) as usize;
                format!(
                    "fits better and predicts worse: {what}, {before:.decimals$} before, {after:.decimals$} with it"
                )
            }
            Self::Nothing => "the 95 % interval of its value includes no effect".into(),
            Self::Unphysical => "its fitted value is at the end of its physical range".into(),
            Self::NoBase(name) => format!("it changes `{name}`, which was not found"),
        }
    }
}

/// An effect as it was tried last.
#[derive(Clone, Debug)]
pub struct RefitTried {
    pub effect: usize,
    /// Share of the fitted mean square that it removes.
    pub score: f64,
    /// Gain in mean square of measurements left out, with the ends of its 95 % interval.
    pub gain: Gain,
    /// Values of its parameters.
    pub values: Vec<f64>,
    pub errors: RefitErrors,
    /// None if it was taken.
    pub rejected: Option<RefitRejection>,
}

/// Outcome of a selection.
#[derive(Clone, Debug)]
pub struct RefitFinding {
    /// Effects in the order in which they were taken.
    pub chosen: Vec<usize>,
    /// Errors before, and after each of them.
    pub ladder: Vec<RefitErrors>,
    /// All effects as they were tried last, those taken first.
    pub tried: Vec<RefitTried>,
    /// Values of all parameters.
    pub theta: Vec<f64>,
    /// 95 % interval of each parameter; none of one that was not fitted.
    pub intervals: Vec<Option<[f64; 2]>>,
    /// Value of each parameter that was fitted in each group of objects alone, with all else as it was found: slot, and groups.
    pub by_group: Vec<(usize, Vec<GroupValue>)>,
    /// Scope of each chosen effect.
    pub belongings: Vec<Belonging>,
    /// Groups of objects that each chosen effect predicts worse, when they are left out, than all others without it.
    pub worse: Vec<Vec<usize>>,
}

/// Value of a parameter in one group alone, with its 95 % interval.
#[derive(Clone, Debug)]
pub struct GroupValue {
    pub group: usize,
    pub value: f64,
    pub interval: [f64; 2],
}

/// Scope of an effect, by its values in groups of objects.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Belonging {
    /// The values of all groups agree within their intervals.
    Bench,
    /// They differ.
    Groups,
    /// One group has a value, all others have none.
    One(usize),
    /// The values of all groups but one agree.
    AllBut(usize),
}
