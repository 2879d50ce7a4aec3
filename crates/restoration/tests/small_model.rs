//! Every method on a model of a frame that is no camera: two elements that shift and blur a picture, and stray light.

use metalith_core::Silent;
use metalith_restoration::{
    FrameFit, FrameModel, LearnedDenoiser, Planes, Recorded, RestorationMethod, psnr_db, restore_joint,
    restore_separate,
};
use ndarray::Array2;

/// Rows and columns of the picture and of the frame.
const SIDE: usize = 32;
/// Share of the mean light that each pixel of a frame gets from everywhere.
const STRAY: f32 = 0.05;
/// Columns that the second element shifts a picture by.
const SHIFT: usize = 3;

struct TwoBlurs;

/// Mean of three columns, moved to the right; light that leaves the frame is lost.
fn blurred(x: &Array2<f32>, shift: usize) -> Array2<f32> {
    let mut y = Array2::zeros(x.dim());
    for ((i, j), v) in x.indexed_iter() {
        for to in (j + shift).saturating_sub(1)..=(j + shift + 1).min(SIDE - 1) {
            y[[i, to]] += v / 3.0;
        }
    }
    y
}

fn blurred_adjoint(y: &Array2<f32>, shift: usize) -> Array2<f32> {
    Array2::from_shape_fn(y.dim(), |(i, j)| {
        let seen = (j + shift).saturating_sub(1)..=(j + shift + 1).min(SIDE - 1);
        seen.map(|to| y[[i, to]] / 3.0).sum()
    })
}

/// The mean of a plane everywhere: it is its own adjoint.
fn stray(x: &Array2<f32>) -> Array2<f32> {
    Array2::from_elem(x.dim(), STRAY * x.mean().unwrap())
}

impl FrameModel for TwoBlurs {
    fn inputs(&self) -> usize {
        1
    }

    fn channels(&self) -> usize {
        1
    }

    fn elements(&self) -> usize {
        2
    }

    fn picture_shape(&self) -> (usize, usize) {
        (SIDE, SIDE)
    }

    fn frame_shape(&self) -> (usize, usize) {
        (SIDE, SIDE)
    }

    fn sees_colours(&self) -> bool {
        false
    }

    fn apply_elements(&self, picture: &[Array2<f32>], elements: &[usize], stray_light: bool) -> Planes {
        let mut frame = Array2::zeros((SIDE, SIDE));
        elements.iter().for_each(|e| frame += &blurred(&picture[0], e * SHIFT));
        if stray_light {
            frame += &stray(&picture[0]);
        }
        vec![frame]
    }

    fn adjoint_elements(&self, frame: &[Array2<f32>], elements: &[usize], stray_light: bool) -> Planes {
        let mut picture = Array2::zeros((SIDE, SIDE));
        elements
            .iter()
            .for_each(|e| picture += &blurred_adjoint(&frame[0], e * SHIFT));
        if stray_light {
            picture += &stray(&frame[0]);
        }
        vec![picture]
    }
}

/// Patches of light between 0.1 and 0.7.
fn scene() -> Array2<f32> {
    Array2::from_shape_fn((SIDE, SIDE), |(y, x)| 0.1 + 0.2 * ((x / 7 + y / 9) % 4) as f32)
}

#[test]
fn the_model_has_its_adjoint() {
    /// Sums of a thousand products in single precision.
    const SINGLE: f32 = 1e-5;
    let x = vec![scene()];
    let y = vec![Array2::from_shape_fn((SIDE, SIDE), |(i, j)| {
        ((i * 5 + j * 3) % 7) as f32
    })];
    let dot = |a: &Planes, b: &Planes| (&a[0] * &b[0]).sum();
    for (elements, stray_light) in [(vec![0, 1], true), (vec![1], false)] {
        let there = dot(&TwoBlurs.apply_elements(&x, &elements, stray_light), &y);
        let back = dot(&x, &TwoBlurs.adjoint_elements(&y, &elements, stray_light));
        assert!((there / back - 1.0).abs() < SINGLE, "{there} {back}");
    }
    let sums = TwoBlurs.row_sums(&y, &[0, 1], true);
    let weighted = vec![&TwoBlurs.apply(&TwoBlurs.white())[0] * &y[0]];
    assert_eq!(sums, TwoBlurs.adjoint(&weighted));
}

#[test]
fn each_method_restores_what_a_frame_tells() {
    /// Quality of a joint restoration (dB); both sub-images laid over one another and halved have 17.6 dB.
    const JOINT_DB: f64 = 22.0;
    /// Each element alone takes the other for noise.
    const ALONE_DB: f64 = 15.0;
    let truth = scene();
    let light = TwoBlurs.apply(std::slice::from_ref(&truth));
    let inverse_variance = vec![Array2::from_elem((SIDE, SIDE), 1e4)];
    let prior = LearnedDenoiser::shipped().unwrap();
    let recorded = Recorded {
        operator: &TwoBlurs,
        light: &light,
        inverse_variance: &inverse_variance,
        prior: &prior,
    };
    let db = |planes: &Planes| {
        let [found, truth] = [&planes[0], &truth].map(|p| p.mapv(f64::from));
        psnr_db(found.view(), truth.view()).unwrap()
    };
    println!("halved {:.1}", db(&vec![&light[0] * 0.5]));
    for method in RestorationMethod::ALL {
        let joint = db(&restore_joint(&recorded, method, &Silent).unwrap());
        let alone = db(&restore_separate(&recorded, method, &Silent).unwrap());
        println!("{}: {joint:.1} {alone:.1}", method.name());
        assert!(joint > JOINT_DB, "{}: {joint}", method.name());
        assert!(alone > ALONE_DB, "{}, each alone: {alone}", method.name());
    }
}

/// The gradient of a sum over the fitted picture is that of differences.
#[test]
fn the_fit_to_a_frame_has_its_adjoint() {
    /// The steps of the solver change a little with the picture, which the adjoint leaves out.
    const QUOTIENT: f32 = 0.02;
    /// Share of the gradient that the frame takes away at least, or the test would hold without a fit.
    const TAKEN: f32 = 0.1;
    let light = TwoBlurs.apply(&[scene()]);
    let inverse_variance = vec![Array2::from_elem((SIDE, SIDE), 1e4)];
    let prior = LearnedDenoiser::shipped().unwrap();
    let fit = FrameFit::new(&TwoBlurs, &light, &inverse_variance, &prior);
    let wave = |k: f32| {
        Array2::from_shape_fn((SIDE, SIDE), |(y, x)| {
            0.4 + 0.3 * (k * (y as f32 + 0.7 * x as f32)).sin()
        })
    };
    let [z, gradient, change] = [wave(0.21), wave(0.35), wave(0.5) - 0.4];
    let moved = |share: f32| {
        let fitted = fit.fitted(&[&z + &(&change * share)], &Silent).unwrap();
        (&gradient * &fitted[0]).sum()
    };
    let quotient = (moved(0.1) - moved(-0.1)) / 0.2;
    let found = (&fit.adjoint(std::slice::from_ref(&gradient))[0] * &change).sum();
    let whole = (&gradient * &change).sum();
    assert!(
        (found - quotient).abs() < QUOTIENT * whole.abs(),
        "{found} {quotient} {whole}"
    );
    assert!((found - whole).abs() > TAKEN * whole.abs(), "{found} {whole}");
}
