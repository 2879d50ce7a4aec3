//! The most likely picture where light and noise are normal.

use metalith_core::{Progress, Result};

use crate::enlarge::enlarged;
use crate::frame_model::Planes;
use crate::normal_system::NormalSystem;
use crate::scene_statistics::Terms;

/// Steps of conjugate gradients from a black picture. Of 48, 64 and 96 a photograph of 800 x 800 has 22.7, 23.1 and 23.5 dB of linear
/// light; of one kernel for each element and colour, 28.4, 29.8 and 31.0 dB. What comes last is detail in the corners.
const FROM_BLACK: usize = 72;
/// Steps on the coarse model. With half as many, photographs lack 0.2 dB of sRGB values and 0.4 dB of linear light.
const COARSE: usize = 48;
/// Steps from the picture of the coarse model on. More of them bring linear light and cost sRGB values, which weigh noise in shadows:
/// after 20, 23, 26 and 36 three photographs have 20.22, 20.21, 20.19 and 20.07 dB of sRGB values, and 23.15, 23.23, 23.30 and 23.46 dB of
/// linear light. After [`FROM_BLACK`] they have 20.22 and 23.25 dB.
const FROM_COARSE: usize = 23;
/// Share of the mean response in the preconditioner of the steps from a coarse picture. What is smooth is found by then, so more of it
/// does no harm: with [`RESPONSE`](crate::precondition::RESPONSE), a quarter of this, 26 steps reach what 20 do.
const RESPONSE_FROM_COARSE: f64 = 2e-3;

pub(crate) fn restore(system: &NormalSystem<'_>, progress: &dyn Progress) -> Result<Planes> {
    let terms = system.statistics().terms(system.scale);
    let Some(coarse) = system.coarse() else {
        progress.begin("restoring", FROM_BLACK as u64);
        return system.solve(system.black(), &system.data, terms, FROM_BLACK, progress);
    };
    progress.begin("restoring", (COARSE + FROM_COARSE) as u64);
    // The spectrum of scenes in larger pixels: 1 / f^2 looks the same in all, and what falls faster is farther off.
    let finer = coarse.shape().1 as f64 / system.shape().1 as f64;
    let of_scenes = coarse.statistics().terms(coarse.scale);
    let coarse_terms = Terms {
        bends: of_scenes.bends * finer * finer,
        ..of_scenes
    };
    let found = coarse.solve(coarse.black(), &coarse.data, coarse_terms, COARSE, progress)?;
    let first = found.iter().map(|plane| enlarged(plane, system.shape())).collect();
    system.solve_by(RESPONSE_FROM_COARSE, first, &system.data, terms, FROM_COARSE, progress)
}

#[cfg(test)]
mod tests {
    use metalith_core::Silent;
    use ndarray::Array2;

    use super::*;
    use crate::frame_model::FrameModel;
    use crate::quality::psnr_db;

    /// A blur of three by three pixels, and a coarse model of it with pixels twice as large.
    struct Blur {
        side: usize,
        coarse: Option<Box<Blur>>,
    }

    impl Blur {
        fn blurred(&self, x: &Array2<f32>) -> Array2<f32> {
            // Coarse pixels are as large as two, so their neighbours bring half as much.
            let beside = if self.coarse.is_some() { 1.0 / 3.0 } else { 1.0 / 6.0 };
            let n = self.side as i64;
            let along = |x: &Array2<f32>| {
                Array2::from_shape_fn(x.dim(), |(i, j)| {
                    let of = |k: i64| if (0..n).contains(&k) { x[[k as usize, j]] } else { 0.0 };
                    let i = i as i64;
                    beside * (of(i - 1) + of(i + 1)) + (1.0 - 2.0 * beside) * of(i)
                })
            };
            along(&along(x).reversed_axes()).reversed_axes()
        }
    }

    impl FrameModel for Blur {
        fn inputs(&self) -> usize {
            1
        }

        fn channels(&self) -> usize {
            1
        }

        fn elements(&self) -> usize {
            1
        }

        fn picture_shape(&self) -> (usize, usize) {
            (self.side, self.side)
        }

        fn frame_shape(&self) -> (usize, usize) {
            (self.side, self.side)
        }

        fn sees_colours(&self) -> bool {
            false
        }

        fn coarse(&self) -> Option<(usize, &dyn FrameModel)> {
            self.coarse.as_deref().map(|model| (2, model as &dyn FrameModel))
        }

        fn apply_elements(&self, picture: &[Array2<f32>], _: &[usize], _: bool) -> Planes {
            vec![self.blurred(&picture[0])]
        }

        fn adjoint_elements(&self, frame: &[Array2<f32>], _: &[usize], _: bool) -> Planes {
            vec![self.blurred(&frame[0])]
        }
    }

    /// A picture that begins on the coarse model, against the solution and against one that begins with black.
    #[test]
    fn a_coarse_beginning_leads_to_the_solution() {
        const SIDE: usize = 48;
        /// Steps after which a system of some thousand unknowns is solved.
        const LONG: usize = 600;
        /// Quality that the picture may lack of the solution's: half of the last digit that reports state.
        const LACKS_DB: f64 = 0.05;
        let model = Blur {
            side: SIDE,
            coarse: Some(Box::new(Blur {
                side: SIDE / 2,
                coarse: None,
            })),
        };
        let truth = Array2::from_shape_fn((SIDE, SIDE), |(y, x)| 0.1 + 0.2 * ((x / 7 + y / 9) % 4) as f32);
        // A little noise, and pixels that know less towards the border.
        let noise = |y: usize, x: usize| 0.01 * (((y * 31 + x * 17) % 13) as f32 / 6.0 - 1.0);
        let light = vec![Array2::from_shape_fn((SIDE, SIDE), |(y, x)| noise(y, x)) + model.blurred(&truth)];
        let weight = vec![Array2::from_shape_fn((SIDE, SIDE), |(y, _)| 1e4 / (1.0 + y as f32))];
        let system = NormalSystem::new(&model, [&light, &weight], &[0], true);
        let terms = system.statistics().terms(system.scale);
        let solved = |steps: usize| {
            let planes = system.solve(system.black(), &system.data, terms, steps, &Silent);
            planes.unwrap()
        };
        let db = |planes: &Planes, reference: &Array2<f32>| {
            let [found, reference] = [&planes[0], reference].map(|p| p.mapv(f64::from));
            psnr_db(found.view(), reference.view()).unwrap()
        };
        let long = solved(LONG);
        let own = restore(&system, &Silent).unwrap();
        let [of_long, of_own] = [&long, &own].map(|p| db(p, &truth));
        println!("{of_long:.3} {of_own:.3}, apart {:.1}", db(&own, &long[0]));
        assert!(of_own > of_long - LACKS_DB, "{of_own} {of_long}");
    }
}
