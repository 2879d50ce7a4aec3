//! A surrogate about what was found: what the former one says of the rest is used where it still holds.

use std::sync::Arc;

use metalith_core::{Progress, Result};

use super::curve::Curve;
use super::{BESIDE, BESIDE_ONE_SIDED, Surrogate, change, offsets, point_at};
use crate::forward_model::{Model, ParameterPoint};
use crate::measurements::Measurements;

/// Multiples of the typical size at which a parameter is simulated about a position that a fit has come to.
const NEAR: [f64; 4] = [-0.6, -0.3, 0.3, 0.6];

/// No effect is simulated by itself if no other value is nearer (typical sizes): polynomials through nodes closer
/// together magnify rounding.
const APART: f64 = 0.3;

impl<M: Measurements> Surrogate<M> {
    /// A surrogate about other values. Parameters in `found` are simulated anew close to these, and at no effect, so
    /// that another may take their place. The changes of all others are taken to add as before.
    ///
    /// # Errors
    /// As [`ForwardModel::predictions`](crate::ForwardModel::predictions).
    pub fn recentred(
        &self,
        model: &Model<'_, M>,
        about: &[f64],
        found: &[usize],
        progress: &dyn Progress,
    ) -> Result<Self> {
        let nodes = found.iter().map(|&s| {
            let mut nodes = offsets::<M>(model, about, s, [&NEAR, &NEAR]);
            let is_apart = |node: &f64| (node + about[s]).abs() > APART * model.slots()[s].parameter.typical;
            if nodes.iter().all(is_apart) {
                nodes.push(-about[s]);
            }
            nodes
        });
        let nodes: Vec<Vec<f64>> = nodes.collect();
        let mut points = vec![ParameterPoint::new(about.to_vec())];
        for (s, nodes) in found.iter().zip(&nodes) {
            points.extend(nodes.iter().map(|node| point_at(about, *s, *node)));
        }
        let mut predictions = model.predictions(&points, progress)?.into_iter();
        let base = predictions.next().expect("the first point is the base");
        let mut out = self.clone();
        out.stated = Some(self.stated.clone().unwrap_or_else(|| Arc::new(self.clone())));
        for (&s, nodes) in found.iter().zip(nodes) {
            let own = predictions.by_ref().take(nodes.len());
            let changes: Vec<_> = own.map(|p| change::<M>(&p, &base, 1.0)).collect();
            out.curves[s] = Curve::new(about[s], nodes, changes, is_kinked::<M>(model, about, s));
        }
        if let Some(stated) = &out.stated {
            // What is no longer there changes a prediction as it did where it was not.
            for (s, own) in out.curves.iter_mut().enumerate() {
                if !own.is_about(about[s]) && stated.curves[s].is_about(about[s]) {
                    own.clone_from(&stated.curves[s]);
                }
            }
        }
        out.about = about.to_vec();
        out.renewed = false;
        out.base = Arc::new(base);
        Ok(out)
    }

    /// Simulate anew what all parameters but those in `found` change beside these, because it depends on them; not where that is
    /// dear. A second side is simulated where the first does not determine it.
    ///
    /// # Errors
    /// As [`ForwardModel::predictions`](crate::ForwardModel::predictions).
    pub fn renew_others(&mut self, model: &Model<'_, M>, found: &[usize], progress: &dyn Progress) -> Result<()> {
        let about = self.about.clone();
        let mut first: Vec<(usize, f64)> = Vec::new();
        let mut second: Vec<(usize, f64)> = Vec::new();
        let before = self.curves.clone();
        let known = self.elsewhere.clone().filter(|e| e.about == about);
        for s in 0..model.slots().len() {
            if found.contains(&s) || model.is_dear_beside(&about, s) {
                continue;
            }
            if let Some(known) = known.as_ref().filter(|k| k.curves[s].is_simulated()) {
                self.curves[s].clone_from(&known.curves[s]);
                continue;
            }
            self.curves[s] = Curve::new(about[s], Vec::new(), [], is_kinked::<M>(model, &about, s));
            match offsets::<M>(model, &about, s, [&BESIDE, &BESIDE_ONE_SIDED])[..] {
                [one, other] if one == -other => {
                    first.push((s, one));
                    second.push((s, other));
                }
                ref nodes => first.extend(nodes.iter().map(|node| (s, *node))),
            }
        }
        self.simulate_nodes(model, &first, progress)?;
        let mut open = Vec::new();
        for (s, node) in second {
            match before[s].other_side(&self.curves[s], node) {
                Some(changes) => self.curves[s].add(node, changes),
                None => open.push((s, node)),
            }
        }
        self.simulate_nodes(model, &open, progress)?;
        self.renewed = true;
        Ok(())
    }

    /// Add nodes to curves: the parameter, and the offset.
    fn simulate_nodes(&mut self, model: &Model<'_, M>, nodes: &[(usize, f64)], progress: &dyn Progress) -> Result<()> {
        if nodes.is_empty() {
            return Ok(());
        }
        let points: Vec<_> = nodes.iter().map(|(s, node)| point_at(&self.about, *s, *node)).collect();
        for (predictions, (s, node)) in model.predictions(&points, progress)?.iter().zip(nodes) {
            self.curves[*s].add(*node, change::<M>(predictions, &self.base, 1.0));
        }
        Ok(())
    }
}

/// True if the derivative by a parameter jumps at the base.
fn is_kinked<M: Measurements>(model: &Model<'_, M>, about: &[f64], s: usize) -> bool {
    model.kinked(model.slots()[s].effect) && about[s] == 0.0
}

#[cfg(test)]
mod tests {
    use metalith_core::Silent;

    use super::*;
    use crate::index::MeasurementIndex;
    use crate::test_model::Samples;
    use crate::test_model::{LinearModel, Term, setups};

    /// What another search simulated about a point is taken about this point, and no other. It was of a model in which the second
    /// parameter acts twice as strongly, by which it is recognised.
    #[test]
    fn what_was_simulated_elsewhere_is_taken_about_the_same_point() {
        const TERMS: [[u32; 2]; 2] = [[2, 3], [5, 4]];
        let model = LinearModel::new(TERMS.map(Term::linear).to_vec(), setups(1, 1, 1));
        let twice = Term {
            amplitude: |theta| 2.0 * theta,
            ..Term::linear(TERMS[1])
        };
        let other = LinearModel::new(vec![Term::linear(TERMS[0]), twice], setups(1, 1, 1));
        let about = |surrogate: Surrogate<Samples>, model: &LinearModel, at: f64| {
            let mut surrogate = surrogate.recentred(model, &[at, 0.0], &[0], &Silent).unwrap();
            surrogate.renew_others(model, &[0], &Silent).unwrap();
            surrogate
        };
        let elsewhere = about(other.surrogate(), &other, 0.04);
        let slope = |surrogate: &Surrogate<Samples>, at| {
            let slope = surrogate.derivative(&[at, 0.0], 1, MeasurementIndex::from(0));
            Samples::mean_square(&slope).sqrt()
        };
        let own = slope(&model.surrogate(), 0.0);
        let knowing = || model.surrogate().knowing(&elsewhere, &[Some(0), Some(1)]);
        for (at, factor) in [(0.04, 2.0), (0.05, 1.0)] {
            let found = slope(&about(knowing(), &model, at), at) / own;
            assert!((found - factor).abs() < 1e-3, "{at}: {found}");
        }
    }

    /// The first parameter acts by its square too. Found at 0.04, and gone again: its change is that from nothing.
    #[test]
    fn what_was_found_and_is_gone_changes_as_it_did_before() {
        /// Of a mean square of 1e-3: single precision.
        const ROUNDING: f64 = 1e-9;
        let bent = Term {
            amplitude: |theta| theta + 10.0 * theta * theta,
            ..Term::linear([2, 3])
        };
        let model = LinearModel::new(vec![bent, Term::linear([5, 4])], setups(1, 1, 1));
        let error = |surrogate: &Surrogate<Samples>, theta: &[f64]| {
            let own = model.prediction(&ParameterPoint::new(theta.to_vec()), &setups(1, 1, 1)[0]);
            let said = surrogate.prediction(theta, MeasurementIndex::from(0));
            Samples::mean_square(&Samples::combine(&[(&said, 1.0), (&own, -1.0)]))
        };
        let found = model
            .surrogate()
            .recentred(&model, &[0.04, 0.0], &[0], &Silent)
            .unwrap();
        assert!(error(&found, &[0.046, 0.0]) < ROUNDING);
        let mut other = found.recentred(&model, &[0.0, 0.02], &[1], &Silent).unwrap();
        assert!(
            error(&other, &[0.03, 0.02]) < ROUNDING,
            "{}",
            error(&other, &[0.03, 0.02])
        );
        other.renew_others(&model, &[1], &Silent).unwrap();
        assert!(error(&other, &[0.02, 0.026]) < ROUNDING);
    }
}
