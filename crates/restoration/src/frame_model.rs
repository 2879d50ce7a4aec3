//! The linear model of a frame: all that a restoration knows of a camera.

use ndarray::Array2;

/// Planes of a picture, or of a frame by channel.
pub type Planes = Vec<Array2<f32>>;

/// A linear map from the planes of a picture to the light in each pixel of a frame, by channel.
///
/// A frame is the sum of the images of several elements, which may overlap, and of stray light, which each place of the
/// picture may bring to each pixel. Its adjoint obeys `<A x, y> = <x, A* y>` for any picture x and any frame y.
pub trait FrameModel: Sync {
    /// Number of planes of a picture.
    fn inputs(&self) -> usize;

    /// Number of planes of a frame.
    fn channels(&self) -> usize;

    /// Number of elements.
    fn elements(&self) -> usize;

    /// Rows and columns of a picture.
    fn picture_shape(&self) -> (usize, usize);

    /// Rows and columns of a frame.
    fn frame_shape(&self) -> (usize, usize);

    /// True if the planes of a picture are red, green and blue; else each is a grey picture.
    fn sees_colours(&self) -> bool;

    /// A model of the same field with fewer pixels in frame and picture, and the pixels an axis of this frame that one of its is the
    /// mean of; `None` if there is none.
    fn coarse(&self) -> Option<(usize, &dyn FrameModel)> {
        None
    }

    /// The frame of a picture behind some of the elements, with or without the stray light of all.
    fn apply_elements(&self, picture: &[Array2<f32>], elements: &[usize], stray_light: bool) -> Planes;

    /// The adjoint of [`FrameModel::apply_elements`].
    fn adjoint_elements(&self, frame: &[Array2<f32>], elements: &[usize], stray_light: bool) -> Planes;

    /// The frame of a picture.
    fn apply(&self, picture: &[Array2<f32>]) -> Planes {
        self.apply_elements(picture, &self.all_elements(), true)
    }

    /// The adjoint of [`FrameModel::apply`].
    fn adjoint(&self, frame: &[Array2<f32>]) -> Planes {
        self.adjoint_elements(frame, &self.all_elements(), true)
    }

    /// The numbers of all elements.
    fn all_elements(&self) -> Vec<usize> {
        (0..self.elements()).collect()
    }

    /// A white picture.
    fn white(&self) -> Planes {
        vec![Array2::ones(self.picture_shape()); self.inputs()]
    }

    /// Row sums of A* W A, an estimate of its diagonal; W is the weight of each pixel.
    fn row_sums(&self, weight: &[Array2<f32>], elements: &[usize], stray_light: bool) -> Planes {
        let seen = self.apply_elements(&self.white(), elements, stray_light);
        let weighted: Planes = seen.iter().zip(weight).map(|(s, w)| s * w).collect();
        self.adjoint_elements(&weighted, elements, stray_light)
    }
}
