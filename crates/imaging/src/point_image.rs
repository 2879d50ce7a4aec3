//! The image of a white point of the scene, as kernels have it.

use metalith_report::{Cell, Column, ImageGrid, Page, Table};
use ndarray::Array2;
use serde::Serialize;

use crate::imaging_system::ImagingSystem;

/// Elements whose images are drawn, at most: figures of the others stand in the table.
const DRAWN: usize = 6;

/// The image of a white point in the middle of the field of an element, in the light of one channel.
#[derive(Clone, Debug, Serialize)]
pub struct PointImage {
    /// An element, and how many are copies of it, itself among them.
    pub element: String,
    pub copies: usize,
    pub channel: String,
    /// Diameter of the circle about the middle of its light that holds half of it (pixels of the sensor).
    pub half_light_pixels: f64,
    /// Share of the light of the channel at the element that lands in the window of the kernel.
    pub in_window: f64,
    /// Energy in a pixel of the sensor at every half of one, as a share of the light of the channel at the element; rows along +y.
    #[serde(skip)]
    pub values: Array2<f64>,
}

impl ImagingSystem {
    /// Images of a point by each distinct element and channel.
    pub fn point_images(&self) -> Vec<PointImage> {
        let (bank, elements) = (&self.bank, self.design.elements());
        let middle = [(bank.spec.nodes - 1) / 2; 2];
        let mut all = Vec::new();
        for distinct in 0..bank.distinct.len() {
            let copies = bank.elements.iter().filter(|(of, _)| *of == distinct).count();
            let Some(k) = bank.elements.iter().position(|(of, _)| *of == distinct) else {
                continue;
            };
            for (c, channel) in self.channels.iter().enumerate() {
                let mut values = Array2::zeros((bank.spec.side(), bank.spec.side()));
                for basis in self.primaries() {
                    let kernel = bank.kernel(k, middle, c, basis);
                    let turned = kernel.turned();
                    values
                        .iter_mut()
                        .zip(turned.iter())
                        .for_each(|(to, v)| *to += f64::from(*v));
                }
                all.push(PointImage {
                    element: elements[k].label(),
                    copies,
                    channel: channel.name.clone(),
                    half_light_pixels: 0.5 * half_light(&values),
                    // Each place counts four times.
                    in_window: 0.25 * values.sum(),
                    values,
                });
            }
        }
        all
    }
}

/// Diameter of the circle about the middle of an image that holds half of it (places of the image).
fn half_light(values: &Array2<f64>) -> f64 {
    let all = values.sum();
    if all <= 0.0 {
        return 0.0;
    }
    let mean = |of: fn((usize, usize)) -> usize| {
        let moments = values.indexed_iter().map(|(at, v)| v * of(at) as f64);
        moments.sum::<f64>() / all
    };
    let (row, column) = (mean(|(y, _)| y), mean(|(_, x)| x));
    let distance = |((y, x), v): ((usize, usize), &f64)| ((y as f64 - row).hypot(x as f64 - column), *v);
    let mut by_distance: Vec<(f64, f64)> = values.indexed_iter().map(distance).collect();
    by_distance.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut sum = 0.0;
    let reached = by_distance.iter().find(|(_, v)| {
        sum += v;
        sum >= 0.5 * all
    });
    2.0 * reached.map_or(0.0, |(distance, _)| *distance)
}

/// The section of a page.
pub(crate) fn section(page: &mut Page, images: &[PointImage], pixel_um: f64) {
    let Some(first) = images.first() else { return };
    page.section("Polychromatic PSFs");
    let channels = images.iter().filter(|i| i.element == first.element).count();
    let mut grid = ImageGrid::new("Image of a white point", channels)
        .values("share of the light in a pixel", "")
        .pixel_um(0.5 * pixel_um)
        .side(150.0)
        .log(4.0);
    for image in images.iter().take(DRAWN * channels) {
        grid.image(format!("{}, {}", image.element, image.channel), image.values.clone());
    }
    page.figure(grid.caption(
        "Image of a white point in the middle of the field of each distinct element, as each channel counts it. A wedge spreads its wavelengths over the sensor. Values are the energy in a pixel of the sensor, as a share of the light of the channel that arrives at the element. Shown is the window of the kernels, four decades. Light outside this window is in the stray light.",
    ));
    let mut table = Table::new([
        Column::text("Element"),
        Column::number("Copies", ""),
        Column::text("Channel"),
        Column::number("Half of the light within", "pixels"),
        Column::number("In the window", "%"),
    ]);
    for image in images {
        table.row([
            Cell::from(image.element.as_str()),
            Cell::exact(image.copies as f64),
            Cell::from(image.channel.as_str()),
            Cell::fixed(image.half_light_pixels, 1),
            Cell::fixed(100.0 * image.in_window, 1),
        ]);
    }
    page.table(table.caption(
        "Half of the light within: diameter of the circle about the middle of the image that contains half of its light, pixel included. In the window: share of the arriving light of the channel that is in the image.",
    ));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_of_the_light_is_within_its_circle() {
        // A disc of even light: half of it is within 1 / sqrt(2) of its radius.
        let (middle, radius) = ([60.0, 70.0], 40.0);
        let disc =
            |(y, x): (usize, usize)| f64::from(u8::from((y as f64 - middle[0]).hypot(x as f64 - middle[1]) <= radius));
        let values = Array2::from_shape_fn((128, 128), disc);
        // Places on a grid of one.
        assert!((half_light(&values) - 2.0 * radius / 2f64.sqrt()).abs() < 1.0);
        assert_eq!(half_light(&Array2::zeros((8, 8))), 0.0);
    }
}
