//! Scene before the camera: a picture of it, in light, with spectra.
//!
//! | question | file |
//! | --- | --- |
//! | which files can be read | `read`, `pictures`, `exr` |
//! | colour profiles | `colours` |
//! | scenes that need no file | `chart` |
//! | a spectral cube as a few planes | `cube` |
//! | how far each pixel is | `depth` |
//! | larger pixels | `average` |
//! | how many pixels it may have | `pixel_count` |

mod average;
mod chart;
mod colours;
mod cube;
mod depth;
mod exr;
mod folder;
mod jpeg;
mod pictures;
mod pixel_count;
mod read;

use ndarray::{Array2, Array3};

use crate::geometry::SceneView;
use crate::spectra::{SceneSpectrum, linear_rgb, rgb_basis};

pub use average::averaged;
pub use chart::{BuiltIn, chart};
pub(crate) use chart::{LEAN_DEG, SPOKES, STAR};
pub use depth::read_depth;
pub use folder::images_in;
pub use pixel_count::SCORED_SIDES;
pub(crate) use pixel_count::sides_words;
pub use read::{SceneFile, read_far_scene, read_picture, read_scene};

/// A scene: planes of light, each with the spectrum of its reflectance.
///
/// Between the middles of its pixels a plane changes linearly, along rows and columns; beyond its border there is no
/// light.
#[derive(Clone, Debug)]
pub struct SceneImage {
    /// Name of it, for reports.
    pub name: String,
    pub view: SceneView,
    pub basis: Vec<SceneSpectrum>,
    /// One for each spectrum of the basis, a white surface being one. Shape `[rows, columns]`, rows along +y.
    pub planes: Vec<Array2<f32>>,
    /// Share of the light of a cube that the basis leaves out (root mean square); zero for what is read as colours.
    pub left_out: f64,
    /// Distance of each pixel from the chip (um); without it the scene is flat and as far as the view says.
    pub depth_um: Option<Array2<f32>>,
}

impl SceneImage {
    /// Scene of linear sRGB, `[row, column, colour]`, white being one.
    pub fn of_rgb(name: &str, rgb: &Array3<f64>, field_deg: f64, distance_um: f64) -> Self {
        let (rows, columns, _) = rgb.dim();
        Self {
            name: name.to_owned(),
            view: SceneView {
                rows,
                columns,
                field_deg,
                distance_um,
            },
            basis: rgb_basis().to_vec(),
            planes: (0..3)
                .map(|c| Array2::from_shape_fn((rows, columns), |(y, x)| rgb[[y, x, c]] as f32))
                .collect(),
            left_out: 0.0,
            depth_um: None,
        }
    }

    /// This scene, white everywhere.
    #[must_use]
    pub fn white(&self) -> Self {
        let shape = (self.view.rows, self.view.columns);
        let mut white = Self::of_rgb(
            "white",
            &Array3::ones((1, 1, 3)),
            self.view.field_deg,
            self.view.distance_um,
        );
        white.view = self.view;
        white.planes = vec![Array2::ones(shape); 3];
        white
    }

    /// Linear sRGB in daylight, `[row, column, colour]`.
    pub fn rgb(&self) -> Array3<f64> {
        let colours: Vec<[f64; 3]> = self.basis.iter().map(|b| linear_rgb(|nm| b.at(nm))).collect();
        Array3::from_shape_fn((self.view.rows, self.view.columns, 3), |(y, x, c)| {
            let planes = self.planes.iter().zip(&colours);
            planes.map(|(p, colour)| f64::from(p[[y, x]]) * colour[c]).sum()
        })
    }
}
