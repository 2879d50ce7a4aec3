//! Planes along z, the derivative along z, and the adjoint from any of the planes.

use ndarray::Array2;
use num_complex::Complex32;

use super::FoldedPropagator;
use crate::error::Result;
use crate::propagation::aperture::Together;
use crate::propagation::propagator::{check_shape, check_wave};
use crate::propagation::{Aperture, Field, PlaneWave, Scratch, Window};

/// A quantity on a plane behind the element.
#[derive(Clone, Copy)]
pub(super) struct Plane {
    pub window: Window,
    /// Distance for which the fade weighs the frequencies (um).
    pub faded_at_um: f64,
    /// The derivative along z of the field's envelope, which is the field over exp(i k z), instead of the field.
    pub slope: bool,
}

impl Plane {
    pub(super) fn field(window: Window) -> Self {
        Self {
            window,
            faded_at_um: window.distance_um,
            slope: false,
        }
    }
}

impl FoldedPropagator {
    /// Fields in planes along z by one transform of the aperture: at each of `distances_um` in a window of the size of the
    /// planned one, about the ray from the centre of the element through the middle of that window.
    ///
    /// Frequencies are those whose rays reach the planned window: a plan is for the nearest of the planes.
    ///
    /// # Errors
    /// As [`Propagator::field`](crate::propagation::Propagator::field), and if a distance is not positive.
    pub fn fields_at(
        &self,
        aperture: &dyn Aperture,
        wave: &PlaneWave,
        distances_um: &[f64],
        scratch: &mut Scratch,
    ) -> Result<Vec<Field>> {
        let plane = |z: &f64| {
            Plane::field(Window {
                distance_um: *z,
                centre_um: self.window.centre_um.map(|c| c * z / self.window.distance_um),
                ..self.window
            })
        };
        let planes: Vec<Plane> = distances_um.iter().map(plane).collect();
        let values = self.on_planes(aperture, wave, &planes, scratch)?;
        let field = |(plane, values): (&Plane, Array2<Complex32>)| Field {
            window: plane.window,
            ..self.finished(values, wave)
        };
        Ok(planes.iter().zip(values).map(field).collect())
    }

    /// The field on the planned window moved along z to `distance_um`, and with `slope` the derivative along z of its envelope,
    /// which is the field over exp(i k z): the intensity has the same derivative with either, 2 Re(conj(field) slope).
    ///
    /// The fade weighs frequencies as at the planned distance, so that the slope is exact; a plan is for distances that are farther
    /// by no more than half a percent or so.
    ///
    /// # Errors
    /// As [`FoldedPropagator::fields_at`].
    pub fn field_and_slope(
        &self,
        aperture: &dyn Aperture,
        wave: &PlaneWave,
        distance_um: f64,
        slope: bool,
        scratch: &mut Scratch,
    ) -> Result<(Field, Option<Array2<Complex32>>)> {
        let window = self.window.at_distance(distance_um);
        let plane = self.moved(window);
        let planes = [plane, Plane { slope: true, ..plane }];
        let planes = if slope { &planes[..] } else { &planes[..1] };
        let mut values = self.on_planes(aperture, wave, planes, scratch)?.into_iter();
        let field = Field {
            window,
            ..self.finished(values.next().expect("one for each plane"), wave)
        };
        Ok((field, values.next()))
    }

    /// The adjoint of [`FoldedPropagator::field_and_slope`] without the slope.
    ///
    /// # Errors
    /// As [`Propagator::adjoint`](crate::propagation::Propagator::adjoint), and if the distance is not positive.
    pub fn adjoint_at(
        &self,
        values: &Array2<Complex32>,
        wave: &PlaneWave,
        distance_um: f64,
        scratch: &mut Scratch,
    ) -> Result<Array2<Complex32>> {
        let window = self.window.at_distance(distance_um);
        window.check(self.wavelength_um)?;
        check_wave(wave, self.wavelength_um)?;
        check_shape(values, &window)?;
        self.window_rows_adjoint(values, scratch);
        self.columns_adjoint(&self.moved(window), scratch);
        let mut sites = Array2::zeros([self.lattice.sites(); 2]);
        self.rows_adjoint(wave, scratch, &mut sites);
        Ok(sites)
    }

    /// The field on a window, with the fade of the planned one.
    fn moved(&self, window: Window) -> Plane {
        Plane {
            faded_at_um: self.window.distance_um,
            ..Plane::field(window)
        }
    }

    /// What is on each of several planes.
    fn on_planes(
        &self,
        aperture: &dyn Aperture,
        wave: &PlaneWave,
        planes: &[Plane],
        scratch: &mut Scratch,
    ) -> Result<Vec<Array2<Complex32>>> {
        let windows = planes.iter().map(|plane| plane.window);
        windows
            .clone()
            .try_for_each(|window| window.check(self.wavelength_um))?;
        self.spectra(&Together(vec![aperture]), wave, planes, scratch, &mut |_, _| {})?;
        let formed = |(k, window): (usize, Window)| {
            let mut values = Array2::zeros([window.samples; 2]);
            self.window_rows(k, scratch, &mut values.view_mut());
            values
        };
        Ok(windows.enumerate().map(formed).collect())
    }
}
