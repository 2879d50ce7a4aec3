//! Known errors of chips and benches.
//!
//! An effect has a name, a unit, a range that physics allows, and sets one or two numbers of a [`Perturbation`]. Most are
//! records of one table, in `table`; those that depend on the set (its lamps, the places of its elements), that make several
//! of one kind, or that a user declares have a file each.

mod aberration;
mod declared;
mod led_centre;
mod sensor_tilt;
mod stitching;
mod table;
mod value_error;

pub use declared::DeclaredEffect;
use metalith_attribution::ConditionalEffect;
pub use metalith_attribution::DeclaredParameter;
pub(crate) use metalith_attribution::MOST_PARAMETERS;
pub use metalith_attribution::Parameter;
pub(crate) use metalith_attribution::ValueError;
pub(crate) use stitching::StitchedFields;
pub(crate) use value_error::value_error_of;

use super::set::MeasuredSet;
use metalith_core::{Error, Result};
use metalith_optics::{DeclaredQuantity, Perturbation};

/// Stage of the model at which an effect acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Places and widths of pillars and apertures.
    Geometry,
    /// The pillar itself: its cell has to be solved again.
    Stack,
    /// The light path.
    Diffraction,
    /// The LEDs.
    Source,
    /// The camera.
    Camera,
}

/// An error that a chip or a bench may have.
pub trait Effect: Send + Sync {
    /// The name it is reported by.
    fn name(&self) -> String;

    /// Unit of the value that is reported.
    fn unit(&self) -> &str;

    /// Stage at which it acts.
    fn stage(&self) -> Stage;

    /// Parameters; zero for each is no effect.
    fn parameters(&self) -> Vec<Parameter>;

    /// True if its derivative jumps at zero, so that the derivative for one sign does not hold for the other.
    fn kinked(&self) -> bool {
        false
    }

    /// True if some of its parameters change nothing while all are zero.
    fn dormant(&self) -> bool {
        false
    }

    /// True if it acts on single pillars at random, so that its parameters do not determine the measurement.
    fn random(&self) -> bool {
        false
    }

    /// Declaration of a unit of one of its parameters in a file: the quantity, and its expression. None where no quantity that
    /// can be declared does the same.
    fn declared_form(&self, _parameter: usize) -> Option<(DeclaredQuantity, String)> {
        None
    }

    /// The effect that this one varies linearly over the chip, where it does that.
    fn gradient_of(&self) -> Option<&'static str> {
        None
    }

    /// Conclusion in words if it is linear in the place of the element.
    fn as_gradient(&self) -> Option<&'static str> {
        None
    }

    /// Error of its values besides noise and the cell: as measured, or what those that were not measured of its stage are
    /// given.
    fn value_error(&self) -> ValueError {
        value_error_of(self.stage())
    }

    /// Set its parameters.
    fn apply(&self, parameters: &[f64], to: &mut Perturbation);

    /// The parameter of an amount of the effect in its [`Effect::unit`], counted from a perfect chip.
    fn parameter(&self, amount: f64) -> f64 {
        amount
    }

    /// The value that is reported for one of its parameters.
    fn value(&self, parameter: f64, _set: &MeasuredSet) -> f64 {
        parameter
    }

    /// The reported values with their confidence intervals: one value for each parameter, unless several parameters
    /// make one value. `half_widths` are those of the parameters.
    fn reported(&self, numbers: &[f64], half_widths: &[f64], set: &MeasuredSet) -> Vec<(f64, [f64; 2])> {
        self.reported_each(numbers, half_widths, set)
    }

    /// One reported value for each parameter, with its confidence interval.
    fn reported_each(&self, numbers: &[f64], half_widths: &[f64], set: &MeasuredSet) -> Vec<(f64, [f64; 2])> {
        let ranges = self.parameters();
        numbers
            .iter()
            .zip(half_widths)
            .zip(ranges)
            .map(|((v, w), p)| {
                let a = self.value((v - w).max(p.range.0), set);
                let b = self.value((v + w).min(p.range.1), set);
                (self.value(*v, set), [a.min(b), a.max(b)])
            })
            .collect()
    }

    /// Effects that this kind of data cannot distinguish from it, each with the measurement that can.
    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        &[]
    }
}

/// The measurement that can distinguish two effects, as listed by either of them.
pub(crate) fn separate_by(a: &dyn Effect, b: &str) -> Option<&'static str> {
    let root = |name: &str| {
        if name.starts_with("led_centre") {
            "led_centre".to_owned()
        } else {
            name.to_owned()
        }
    };
    a.confusions()
        .iter()
        .find(|(name, _)| root(name) == root(b))
        .map(|c| c.1)
}

/// Effects that any chip and bench may have, whatever was measured: all but those of the lamps and of the distances
/// between the elements of a set.
pub fn of_any_chip() -> Vec<Box<dyn Effect>> {
    let mut effects = table();
    effects.extend(aberrations());
    effects
}

fn aberrations() -> impl Iterator<Item = Box<dyn Effect>> {
    aberration::ABERRATIONS
        .into_iter()
        .map(|e| Box::new(e) as Box<dyn Effect>)
}

/// The effects of the table.
fn table() -> Vec<Box<dyn Effect>> {
    let all = table::TABLE.iter();
    all.map(|own| Box::new(*own) as Box<dyn Effect>).collect()
}

/// Effects that are tried on some sets only.
pub(crate) const CONDITIONAL: [ConditionalEffect; 5] = [
    ConditionalEffect {
        name: StitchedFields::NAMES[0],
        needs: "`field_boundary_um` of `[writer]`",
    },
    ConditionalEffect {
        name: StitchedFields::NAMES[1],
        needs: "`field_boundary_um` of `[writer]`",
    },
    ConditionalEffect {
        name: table::CORNER_ROUNDING,
        needs: "`shape = \"square\"` of `[stack]`",
    },
    ConditionalEffect {
        name: "sensor_tilt*",
        needs: "`[[element]]` sections whose `centre_um` differ along its direction, along x and y for `sensor_tilt`",
    },
    ConditionalEffect {
        name: "led_centre_*",
        needs: "an `[[led]]` whose `centre_nm` is the number in its name",
    },
];

/// All effects that are tried on a set.
pub fn all(set: &MeasuredSet) -> Vec<Box<dyn Effect>> {
    let mut effects = table();
    // Circles have no corners: an effect without an effect is never found.
    let has_corners = set.stack.cell.shape.is_square();
    effects.retain(|e| has_corners || e.name() != table::CORNER_ROUNDING);
    effects.extend(sensor_tilt::SensorTilt::of(set).map(|e| Box::new(e) as Box<dyn Effect>));
    effects.extend(aberrations());
    effects.extend(stitching::StitchedFields::of(set).map(|e| Box::new(e) as Box<dyn Effect>));
    for (led, lamp) in set.leds.iter().enumerate() {
        effects.push(Box::new(led_centre::LedCentre {
            led,
            name: format!("led_centre_{}", lamp.name()),
        }));
    }
    effects
}

/// All effects of the library that are tried on a set, and those that were declared.
///
/// # Errors
/// If a declared effect has the name of another.
pub(crate) fn with_declared(set: &MeasuredSet, declared: &[DeclaredEffect]) -> Result<Vec<Box<dyn Effect>>> {
    let mut effects = all(set);
    for own in declared {
        // Boundaries of write fields may be tried later, on a set that does not say where they run.
        let is_reserved = StitchedFields::NAMES.contains(&own.name.as_str());
        if is_reserved || effects.iter().any(|e| e.name() == own.name) {
            let what = format!("there is an effect `{}` already", own.name);
            return Err(Error::refused(
                "effects/name-taken",
                what,
                "give the declared effect another name",
            ));
        }
        effects.push(Box::new(own.clone()));
    }
    Ok(effects)
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_core::Silent;
    use metalith_gds::extract::PillarsAt;

    /// A set that does not say where write fields meet may be searched as if it did.
    #[test]
    fn names_of_boundaries_are_reserved() {
        let folder = tempfile::tempdir().unwrap();
        metalith_testing::session::small_set(folder.path());
        let set = MeasuredSet::read(folder.path(), &PillarsAt::STATED, &Silent).unwrap();
        assert!(set.field_boundary_um.is_none());
        let declared = |name: &str| {
            let file = folder.path().join("effects.toml");
            let text = "range = [-9.0, 9.0]\nprior = 1.0\nstage = \"distance\"\ndistance_um = \"a\"\n";
            std::fs::write(&file, format!("[[effect]]\nname = \"{name}\"\n{text}")).unwrap();
            with_declared(&set, &DeclaredEffect::read(&file).unwrap()).map(|all| all.len())
        };
        assert_eq!(declared("own").unwrap(), all(&set).len() + 1);
        for name in ["stitching_x", "stitching_y", "defocus"] {
            let error = declared(name).unwrap_err().to_string();
            assert!(error.contains(&format!("`{name}` already")), "{error}");
        }
    }
}
