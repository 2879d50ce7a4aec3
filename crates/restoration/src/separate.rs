//! Each element alone: its own picture, and a blend of all by the errors that are expected.

use metalith_core::{Progress, Result};
use ndarray::{Array2, Zip};

use crate::frame_model::Planes;
use crate::method::{RestorationMethod, restore_elements};
use crate::recorded::Recorded;

/// The blend of pictures by how much each is to be trusted at each place.
pub struct Blend {
    sums: Planes,
    weights: Planes,
}

impl Blend {
    /// Blend of nothing yet.
    pub fn new(shape: (usize, usize), planes: usize) -> Self {
        let black = || vec![Array2::zeros(shape); planes];
        Self {
            sums: black(),
            weights: black(),
        }
    }

    /// Add a picture, and one over the variance of each of its values.
    pub fn add(&mut self, picture: &[Array2<f32>], inverse_variance: &[Array2<f32>]) {
        let to = self.sums.iter_mut().zip(&mut self.weights);
        for (((sum, all), p), t) in to.zip(picture).zip(inverse_variance) {
            Zip::from(sum).and(all).and(p).and(t).for_each(|sum, all, p, t| {
                *sum += t * p;
                *all += t;
            });
        }
    }

    /// The blend, black where no picture says anything.
    pub fn finished(mut self) -> Planes {
        for (sum, all) in self.sums.iter_mut().zip(&self.weights) {
            Zip::from(sum)
                .and(all)
                .for_each(|s, t| *s = if *t > 0.0 { *s / t } else { 0.0 });
        }
        self.sums
    }
}

/// Restore by each element alone, then blend.
pub(crate) fn restore(recorded: &Recorded<'_>, method: RestorationMethod, progress: &dyn Progress) -> Result<Planes> {
    let operator = recorded.operator;
    let mut blend = Blend::new(operator.picture_shape(), operator.inputs());
    restore_each(recorded, method, progress, &mut |_, picture, inverse_variance| {
        blend.add(picture, inverse_variance);
    })?;
    Ok(blend.finished())
}

/// Deviation of the light of other elements from the light of a grey scene, as a share of it: about the deviation of
/// natural scenes over their mean.
const OTHERS_UNKNOWN: f32 = 1.0;

/// Restore by each element alone: `take` gets its number, its picture and how much it is to be trusted at each place, one over the variance that
/// noise leaves, both as planes of the operator. Elements that see nothing of the scene are left out.
///
/// An element alone knows nothing of the light that others bring to its pixels. That of a grey scene with the light of the frame is
/// subtracted, and what others' sub-images may bring beside it counts as noise: pixels that two elements share say little to either. Without
/// it each picture has bright edges where the others' begin.
///
/// # Errors
/// If the user stopped it.
pub fn restore_each(
    recorded: &Recorded<'_>,
    method: RestorationMethod,
    progress: &dyn Progress,
    take: &mut dyn FnMut(usize, &Planes, &Planes),
) -> Result<()> {
    let operator = recorded.operator;
    let grey = GreyLight::of(recorded);
    let ones = operator.white();
    for element in 0..operator.elements() {
        let seen = operator.apply_elements(&ones, &[element], false);
        let (mut light, mut inverse_variance) =
            (grey.without_stray_light(recorded), recorded.inverse_variance.to_vec());
        for c in 0..light.len() {
            let others = (&grey.images[c] - &seen[c]) * grey.level[c];
            light[c] -= &others;
            Zip::from(&mut inverse_variance[c]).and(&others).for_each(|t, o| {
                *t /= 1.0 + *t * (OTHERS_UNKNOWN * o).powi(2);
            });
        }
        let weighted: Planes = seen.iter().zip(&inverse_variance).map(|(s, t)| s * t).collect();
        // The light that this element sends to pixels that are trusted.
        let weight = operator.adjoint_elements(&weighted, &[element], false);
        if weight.iter().flatten().all(|w| *w <= 0.0) {
            continue;
        }
        let own = Recorded {
            operator,
            light: &light,
            inverse_variance: &inverse_variance,
            prior: recorded.prior,
        };
        take(
            element,
            &restore_elements(&own, method, &[element], false, progress)?,
            &weight,
        );
    }
    Ok(())
}

/// Light of a frame less the stray light that a grey scene of as much light as the frame has would bring.
pub fn without_stray_light(recorded: &Recorded<'_>) -> Planes {
    GreyLight::of(recorded).without_stray_light(recorded)
}

/// Light that a white scene would bring, and how grey the scene of a frame is.
struct GreyLight {
    /// Images of all sub-images, by channel.
    images: Planes,
    stray_light: Planes,
    /// Light of the frame over that of a white scene, by channel.
    level: Vec<f32>,
}

impl GreyLight {
    fn of(recorded: &Recorded<'_>) -> Self {
        let operator = recorded.operator;
        let ones = operator.white();
        let all = operator.all_elements();
        let with = operator.apply_elements(&ones, &all, true);
        let images = operator.apply_elements(&ones, &all, false);
        let level = |c: usize| {
            let known = |f: &Array2<f32>| {
                let pairs = f.iter().zip(&recorded.inverse_variance[c]).filter(|(_, t)| **t > 0.0);
                pairs.map(|(v, _)| f64::from(*v)).sum::<f64>()
            };
            (known(&recorded.light[c]) / known(&with[c]).max(f64::MIN_POSITIVE)) as f32
        };
        Self {
            level: (0..with.len()).map(level).collect(),
            stray_light: with.iter().zip(&images).map(|(a, b)| a - b).collect(),
            images,
        }
    }

    fn without_stray_light(&self, recorded: &Recorded<'_>) -> Planes {
        let channels = recorded.light.iter().zip(&self.stray_light).zip(&self.level);
        channels
            .map(|((light, stray_light), level)| Zip::from(light).and(stray_light).map_collect(|s, v| s - level * v))
            .collect()
    }
}
