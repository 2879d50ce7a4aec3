//! The downhill simplex of Nelder and Mead (Comput. J. 7, 308 (1965)).

/// Steps of the simplex; by then it has shrunk to nothing for degrees up to six.
const SIMPLEX_STEPS: usize = 1500;

/// Place near `start` at which `loss` is least.
pub fn simplex(start: &[f64], loss: impl Fn(&[f64]) -> f64) -> Vec<f64> {
    let n = start.len();
    let mut corners: Vec<(f64, Vec<f64>)> = (0..=n)
        .map(|k| {
            let mut x = start.to_vec();
            if k > 0 {
                x[k - 1] += 0.05;
            }
            (loss(&x), x)
        })
        .collect();
    let along = |from: &[f64], to: &[f64], share: f64| -> Vec<f64> {
        from.iter().zip(to).map(|(a, b)| a + share * (b - a)).collect()
    };
    for _ in 0..SIMPLEX_STEPS {
        corners.sort_by(|a, b| a.0.total_cmp(&b.0));
        let centre: Vec<f64> = (0..n)
            .map(|i| corners[..n].iter().map(|c| c.1[i]).sum::<f64>() / n as f64)
            .collect();
        let tried = |share: f64, worst: &[f64]| {
            let x = along(&centre, worst, share);
            (loss(&x), x)
        };
        let worst = corners[n].1.clone();
        let mirrored = tried(-1.0, &worst);
        let next = if mirrored.0 < corners[0].0 {
            let further = tried(-2.0, &worst);
            if further.0 < mirrored.0 { further } else { mirrored }
        } else if mirrored.0 < corners[n - 1].0 {
            mirrored
        } else {
            let nearer = tried(if mirrored.0 < corners[n].0 { -0.5 } else { 0.5 }, &worst);
            if nearer.0 < corners[n].0.min(mirrored.0) {
                nearer
            } else {
                let best = corners[0].1.clone();
                for corner in &mut corners[1..] {
                    let x = along(&best, &corner.1, 0.5);
                    *corner = (loss(&x), x);
                }
                continue;
            }
        };
        corners[n] = next;
    }
    corners.sort_by(|a, b| a.0.total_cmp(&b.0));
    corners.swap_remove(0).1
}
