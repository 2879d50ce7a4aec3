//! Verdict on a set of measurements, whatever their kind.

use serde::Serialize;

/// Verdict on a set: the part of its residual that effects explain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SetVerdict {
    /// The measurements agree with what was stated, to within their noise: there is nothing to explain.
    NoResidual,
    /// The effects that were found explain the residual.
    Explained,
    /// They explain it but for a remainder below the error of the model.
    ExplainedButFor,
    /// One of a few effects that this set cannot distinguish.
    OneOf,
    /// The effects that were found explain a part of the residual.
    Partly,
    /// There is a residual that no known effect explains.
    Unexplained,
    /// More than half of the measurements cannot be used, or there is one alone.
    DataUnfit,
}

impl SetVerdict {
    /// True if there is something that no effect which was found explains, however little.
    pub fn leaves_a_residual(self) -> bool {
        matches!(self, Self::ExplainedButFor | Self::Partly | Self::Unexplained)
    }

    /// True if the model with the effects that were found predicts the set, to within its noise or the error of the model.
    pub fn is_explained(self) -> bool {
        matches!(
            self,
            Self::NoResidual | Self::Explained | Self::ExplainedButFor | Self::OneOf
        )
    }

    /// True if effects explain a part of the residual and a part remains: neither a success nor a failure.
    pub fn is_partial(self) -> bool {
        self == Self::Partly
    }

    /// True if the effects that were found make a model of the chip.
    pub fn has_a_model(self) -> bool {
        !matches!(self, Self::Unexplained | Self::DataUnfit)
    }

    /// The words that [`SetVerdict::sentence`] begins with.
    pub fn label(self) -> &'static str {
        match self {
            Self::NoResidual => "nothing to explain",
            Self::Explained | Self::ExplainedButFor => "explained",
            Self::OneOf => "one of these",
            Self::Partly => "partly explained",
            Self::Unexplained => "unexplained",
            Self::DataUnfit => "data unfit",
        }
    }

    /// One line for a person, with the effects in words and the remainder in words.
    pub fn sentence(self, effects: &[String], remainder: &str) -> String {
        let (label, list) = (self.label(), effects.join("; "));
        match self {
            Self::NoResidual => {
                format!("{label}: the measurements agree with what was stated, to within their noise")
            }
            Self::Explained => format!("{label} by {list}"),
            Self::ExplainedButFor => format!("{label} by {list} but for {remainder}, below the error of the model"),
            Self::OneOf => format!("{label}, which this set cannot distinguish: {list}"),
            Self::Partly => format!("{label} by {list}; {remainder} remains"),
            Self::Unexplained => format!("{label}: there is a residual that no known effect explains"),
            Self::DataUnfit => format!("{label}: too few measurements can be used"),
        }
    }
}
