//! Share of the light of each element that a place of the sensor counts: response by angle, and walls between elements.

use metalith_sensor::{Sensor, Walls};
use ndarray::Array2;

use crate::geometry::ElementView;

/// Rule for the light of elements that places of a sensor count.
///
/// All light of an element arrives at a place from its middle: lenses are small against their distance from the sensor.
pub(crate) struct Acceptance<'a> {
    elements: &'a [ElementView],
    sensor: &'a Sensor,
}

impl<'a> Acceptance<'a> {
    /// Rule of a sensor behind elements.
    pub(crate) fn new(elements: &'a [ElementView], sensor: &'a Sensor) -> Self {
        Self { elements, sensor }
    }

    /// Share of the light of an element that is counted at a place of the chip (um).
    pub(crate) fn share(&self, element: usize, place_um: [f64; 2]) -> f64 {
        if self.sensor.counts_all_light() {
            return 1.0;
        }
        let response = self
            .sensor
            .angular_response
            .at_cosine(self.elements[element].arrival_cosine(place_um));
        response * self.behind_walls(element, place_um)
    }

    /// Share of a pixel about a place that walls leave open to an element. They stand from the chip to the sensor on the lines
    /// halfway to the other elements, so that a straight way crosses one if and only if the place lies beyond its line.
    fn behind_walls(&self, element: usize, place_um: [f64; 2]) -> f64 {
        if self.sensor.walls == Walls::None {
            return 1.0;
        }
        let own = self.elements[element].centre_um;
        let others = self.elements.iter().map(|e| e.centre_um).filter(|c| *c != own);
        let open = |other: [f64; 2]| {
            let way = [0, 1].map(|a| other[a] - own[a]);
            let middle = [0, 1].map(|a| 0.5 * (other[a] + own[a]) - place_um[a]);
            let before_um = (way[0] * middle[0] + way[1] * middle[1]) / way[0].hypot(way[1]);
            (0.5 + before_um / self.sensor.pixel_um).clamp(0.0, 1.0)
        };
        others.map(open).fold(1.0, f64::min)
    }

    /// True if no wall stands between an element and a place of the chip (um).
    pub(crate) fn is_open(&self, element: usize, place_um: [f64; 2]) -> bool {
        self.behind_walls(element, place_um) >= 0.5
    }

    /// Shares of the pixels of the sensor; none if every pixel counts all light.
    pub(crate) fn over_sensor(&self, element: usize) -> Option<Array2<f32>> {
        if self.sensor.counts_all_light() {
            return None;
        }
        let shape = (self.sensor.rows as usize, self.sensor.columns as usize);
        let share = |(row, column)| self.share(element, self.sensor.place_um([row, column])) as f32;
        Some(Array2::from_shape_fn(shape, share))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_sensor::{AngularResponse, Camera};

    fn element(x: f64, y: f64) -> ElementView {
        ElementView::ahead([x, y], 100.0)
    }

    /// Walls leave a pixel the light of the nearest element alone; half of it where they cut the pixel in half.
    #[test]
    fn walls_leave_the_light_of_the_nearest_element() {
        let elements = [element(-50.0, 0.0), element(50.0, 0.0), element(0.0, 200.0)];
        let mut sensor = Camera::three_bands(2.0).sensor;
        (sensor.columns, sensor.rows, sensor.walls) = (101, 301, Walls::BetweenElements);
        let shares: Vec<Array2<f32>> = {
            let acceptance = Acceptance::new(&elements, &sensor);
            (0..3).map(|k| acceptance.over_sensor(k).unwrap()).collect()
        };
        let nearest = |place: [f64; 2]| {
            let away = |k: &usize| (place[0] - elements[*k].centre_um[0]).hypot(place[1] - elements[*k].centre_um[1]);
            (0..3).min_by(|a, b| away(a).total_cmp(&away(b))).unwrap()
        };
        for at in [[10, 10], [10, 90], [290, 20], [150, 45], [290, 52]] {
            let k = nearest(sensor.place_um(at));
            for (j, share) in shares.iter().enumerate() {
                assert_eq!(share[at], f32::from(u8::from(j == k)), "{at:?} {j}");
            }
        }
        assert_eq!([shares[0][[20, 50]], shares[1][[20, 50]]], [0.5; 2]);
        sensor.walls = Walls::None;
        assert!(Acceptance::new(&elements, &sensor).over_sensor(0).is_none());
    }

    #[test]
    fn pixels_respond_by_the_angle_to_the_middle_of_the_element() {
        // Tangents of places in double precision.
        const ROUNDING: f64 = 1e-9;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("angles.csv");
        std::fs::write(&path, "deg,value\n0,1\n45,0.55\n60,0\n").unwrap();
        let mut sensor = Camera::three_bands(2.0).sensor;
        sensor.angular_response = AngularResponse::read_csv(&path).unwrap();
        let mut elements = [element(30.0, 0.0)];
        let share = |elements: &[ElementView], place| Acceptance::new(elements, &sensor).share(0, place);
        for (place, want) in [
            ([30.0, 0.0], 1.0),
            ([130.0, 0.0], 0.55),
            ([30.0, -100.0], 0.55),
            ([30.0, 300.0], 0.0),
        ] {
            assert!((share(&elements, place) - want).abs() < ROUNDING, "{place:?}");
        }
        // A sensor that falls away towards +x: light there arrives by its tilt farther from its normal, on the other side closer to it.
        const TILT_DEG: f64 = 10.0;
        let slope = TILT_DEG.to_radians().tan();
        elements[0].slope = [slope, 0.0];
        for (way, tilt_deg) in [(50.0, TILT_DEG), (-50.0, -TILT_DEG)] {
            // The middle of the element is 30 um from that of the chip, by which the sensor stands 100 um away.
            let z = 100.0 + slope * (30.0 + way);
            let deg = (f64::abs(way) / z).atan().to_degrees() + tilt_deg;
            let found = share(&elements, [30.0 + way, 0.0]);
            assert!((found - (1.0 - 0.01 * deg)).abs() < ROUNDING, "{way}: {found} {deg}");
        }
    }
}
