//! Each element alone: its own picture, and a blend of all by the errors that are expected.

use metalith_core::{Progress, Result};
use ndarray::{Array2, Zip};

use super::normal::Planes;
use super::{Recorded, RestorationMethod, restore_by};

/// An element alone knows nothing of the light that others bring to its pixels. The veil of a grey scene with the light
/// of the frame is subtracted; what neighbours' sub-images overlap stays.
pub fn restore(recorded: &Recorded<'_>, method: RestorationMethod, progress: &dyn Progress) -> Result<Planes> {
    let operator = recorded.operator;
    let shape = (operator.view().rows, operator.view().columns);
    let mut sums: Planes = vec![Array2::zeros(shape); operator.inputs()];
    let mut weights: Planes = vec![Array2::zeros(shape); operator.inputs()];
    restore_each(recorded, method, progress, &mut |picture, weight| {
        for (((s, w), p), v) in sums.iter_mut().zip(&mut weights).zip(picture).zip(weight) {
            Zip::from(s).and(w).and(p).and(v).for_each(|s, w, p, v| {
                *s += v * p;
                *w += v;
            });
        }
    })?;
    for (sum, weight) in sums.iter_mut().zip(&weights) {
        Zip::from(sum)
            .and(weight)
            .for_each(|s, w| *s = if *w > 0.0 { *s / w } else { 0.0 });
    }
    Ok(sums)
}

/// Restore by each element alone: `take` gets its picture and how much it is to be trusted at each place, one over the variance that
/// noise leaves, both as planes of the operator. Elements that see nothing of the scene are left out.
///
/// # Errors
/// If the user stopped it.
pub fn restore_each(
    recorded: &Recorded<'_>,
    method: RestorationMethod,
    progress: &dyn Progress,
    take: &mut dyn FnMut(&[Array2<f32>], &[Array2<f32>]),
) -> Result<()> {
    let operator = recorded.operator;
    let own = Recorded {
        operator,
        light: &without_veil(recorded),
        trust: recorded.trust,
        prior: recorded.prior,
    };
    let view = operator.view();
    let ones = vec![Array2::<f32>::ones((view.rows, view.columns)); operator.inputs()];
    for element in 0..operator.elements() {
        let seen = operator.apply_elements(&ones, &[element], false);
        let weighted: Planes = seen.iter().zip(recorded.trust).map(|(s, t)| s * t).collect();
        // The light that this element sends to pixels that are trusted.
        let weight = operator.adjoint_elements(&weighted, &[element], false);
        if weight.iter().flatten().all(|w| *w <= 0.0) {
            continue;
        }
        take(&restore_by(&own, method, &[element], false, progress)?, &weight);
    }
    Ok(())
}

/// Light of a frame less the veil that a grey scene of as much light as the frame has would bring.
pub fn without_veil(recorded: &Recorded<'_>) -> Planes {
    let operator = recorded.operator;
    let view = operator.view();
    let ones = vec![Array2::<f32>::ones((view.rows, view.columns)); operator.inputs()];
    let all: Vec<usize> = (0..operator.elements()).collect();
    let with = operator.apply_elements(&ones, &all, true);
    let without = operator.apply_elements(&ones, &all, false);
    (0..with.len())
        .map(|c| {
            let known = |f: &Array2<f32>| {
                let pairs = f.iter().zip(&recorded.trust[c]).filter(|(_, t)| **t > 0.0);
                pairs.map(|(v, _)| f64::from(*v)).sum::<f64>()
            };
            let level = (known(&recorded.light[c]) / known(&with[c]).max(f64::MIN_POSITIVE)) as f32;
            Zip::from(&recorded.light[c])
                .and(&with[c])
                .and(&without[c])
                .map_collect(|s, a, b| s - level * (a - b))
        })
        .collect()
}
