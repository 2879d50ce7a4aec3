//! Part of the field that each element images, light of other elements in its image, and places of its pixels.

use metalith_report::{Cell, Column, Page, Table};
use metalith_restoration::FrameModel;
use metalith_sensor::{ColourFilter, Walls};
use ndarray::Array2;
use serde::Serialize;

use crate::acceptance::Acceptance;
use crate::geometry::ElementView;
use crate::imaging_system::ImagingSystem;

/// Image of one element on the sensor.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ElementImage {
    pub element: String,
    /// Least and greatest field angle along x and along y that its image holds (degrees).
    pub field_deg: [[f64; 2]; 2],
    /// Greatest angle from the normal at which its image arrives at pixels (degrees).
    pub steepest_deg: f64,
    /// Cross-talk: share of the images of other elements in the light of its pixels, weighted by its own light in a white scene.
    pub cross_talk: f64,
    /// Place of its axis between the middles of pixels, x and y (pixels, from 0 to 1).
    pub lattice_phase: [f64; 2],
    /// Number of other elements with the same steering whose pixels of one colour look at the same places, to a tenth of a pixel.
    pub alike: usize,
}

/// Places an axis of the sensor at which images are looked up.
const PLACES: usize = 97;
/// Distance below which pixels of two elements look at the same places (pixels).
const SAME: f64 = 0.1;
/// Angle from the normal from which on a response that is not stated is a note: corners of the fields of 30 degrees that kernels have at
/// least are below it.
const UNPROVEN_DEG: f64 = 40.0;

impl ImagingSystem {
    /// Images of the elements.
    pub fn element_images(&self) -> Vec<ElementImage> {
        let cross_talk = self.cross_talk();
        let labels = self.design.elements();
        let axes: Vec<[f64; 2]> = self
            .elements
            .iter()
            .map(|e| self.camera.sensor.pixel_at(e.centre_um))
            .collect();
        (0..self.elements.len())
            .map(|k| {
                let (field_deg, steepest_deg) = self.imaged(k);
                ElementImage {
                    element: labels[k].label(),
                    field_deg,
                    steepest_deg,
                    cross_talk: cross_talk[k],
                    lattice_phase: [1, 0].map(|a| axes[k][a].rem_euclid(1.0)),
                    alike: self.alike(k, &axes),
                }
            })
            .collect()
    }

    /// Angles at which images arrive at pixels, and what pixels make of them, in words.
    pub(crate) fn angle_words(&self) -> String {
        let sensor = &self.camera.sensor;
        let walls = match sensor.walls {
            Walls::None => "no walls between elements",
            Walls::BetweenElements => "thin walls between elements let pixels see the nearest one alone",
        };
        let response = match sensor.angular_response.last_deg() {
            None => "the camera file states no angular response: pixels count all angles alike, a guess".to_owned(),
            Some(last) => format!("angular response of the camera file, up to {last} degrees"),
        };
        format!(
            "images arrive at up to {:.0} degrees from the normal of the sensor; {response}; {walls}",
            self.steepest_deg()
        )
    }

    /// Note on angles at which the response of the pixels is not known.
    pub(crate) fn angle_note(&self) -> Option<String> {
        let steepest = self.steepest_deg();
        match self.camera.sensor.angular_response.last_deg() {
            None if steepest > UNPROVEN_DEG => Some(format!(
                "images arrive at pixels at up to {steepest:.0} degrees, and the camera file states no angular response: pixels with microlenses count less there; give `angular_response` in [sensor]"
            )),
            Some(last) if steepest > last => Some(format!(
                "images arrive at pixels at up to {steepest:.0} degrees, and the angular response is stated up to {last}: steeper light counts as it does there"
            )),
            _ => None,
        }
    }

    fn steepest_deg(&self) -> f64 {
        (0..self.elements.len()).map(|k| self.imaged(k).1).fold(0.0, f64::max)
    }

    /// Field along x and y that an element images on the sensor, and the greatest angle of arrival (degrees).
    fn imaged(&self, element: usize) -> ([[f64; 2]; 2], f64) {
        let (view, sensor) = (&self.elements[element], &self.camera.sensor);
        let acceptance = Acceptance::new(&self.elements, sensor);
        let at = |k: usize, n: u32| k * (n as usize - 1) / (PLACES - 1);
        let (mut field, mut steepest) = ([[f64::MAX, f64::MIN]; 2], 0.0f64);
        for k in 0..PLACES * PLACES {
            let place = sensor.place_um([at(k / PLACES, sensor.rows), at(k % PLACES, sensor.columns)]);
            let Some(tangents) = self
                .looks_at(view, place)
                .filter(|_| acceptance.is_open(element, place))
            else {
                continue;
            };
            for (ends, tangent) in field.iter_mut().zip(tangents) {
                let deg = tangent.atan().to_degrees();
                *ends = [ends[0].min(deg), ends[1].max(deg)];
            }
            steepest = steepest.max(view.arrival_cosine(place).clamp(0.0, 1.0).acos().to_degrees());
        }
        let field = field.map(|[low, high]| if low > high { [0.0; 2] } else { [low, high] });
        (field, steepest)
    }

    /// Tangents of the scene that an element images at a place of the chip (um), if that is of the scene and in the kernels' field.
    fn looks_at(&self, view: &ElementView, place_um: [f64; 2]) -> Option<[f64; 2]> {
        let way = [0, 1].map(|a| place_um[a] - view.centre_um[a]);
        let sines = view.sines_of_landing(way, view.wedge.wavelength_um);
        let tangents = view.tangents(sines, self.view.distance_um)?;
        let [row, column] = self.view.place(tangents);
        let inside = |v: f64, n: usize| v > -0.5 && v < n as f64 - 0.5;
        let held = way.iter().all(|um| um.abs() <= self.bank.spec.reach_um);
        (held && inside(row, self.view.rows) && inside(column, self.view.columns)).then_some(tangents)
    }

    /// Cross-talk of each element.
    fn cross_talk(&self) -> Vec<f64> {
        let operator = self.restoration();
        let white = operator.white();
        let sum = |planes: Vec<Array2<f32>>| planes.into_iter().reduce(|a, b| a + b).expect("a camera has channels");
        let one = |k: usize| sum(operator.apply_elements(&white, &[k], false));
        let images: Vec<Array2<f32>> = (0..self.elements.len()).map(one).collect();
        let all = sum(images.clone());
        let of = |own: &Array2<f32>| {
            let (mut foreign, mut light) = (0.0f64, 0.0f64);
            for (own, all) in own.iter().zip(&all).filter(|(own, _)| **own > 0.0) {
                let (own, all) = (f64::from(*own), f64::from(*all));
                foreign += own * (all - own).max(0.0) / all;
                light += own;
            }
            if light > 0.0 { foreign / light } else { 0.0 }
        };
        images.iter().map(of).collect()
    }

    /// Number of other elements that look as one does and sample the same places, which have these axes on the sensor (pixels).
    fn alike(&self, element: usize, axes: &[[f64; 2]]) -> usize {
        let period = match self.camera.sensor.filter {
            ColourFilter::None => 1.0,
            _ => 2.0,
        };
        let own = &self.elements[element];
        let same = |k: &usize| {
            let next = &self.elements[*k];
            let apart = |a: usize| {
                let far = (axes[*k][a] - axes[element][a]).rem_euclid(period);
                far.min(period - far)
            };
            *k != element && next.wedge == own.wedge && apart(0) < SAME && apart(1) < SAME
        };
        (0..self.elements.len()).filter(same).count()
    }
}

/// Section of the elements on the page of a picture.
pub(crate) fn section(page: &mut Page, elements: &[ElementImage]) {
    page.section("Images of the elements");
    let mut table = Table::new([
        Column::text("Element"),
        Column::text("Field along x (degrees)"),
        Column::text("Field along y (degrees)"),
        Column::number("Steepest arrival", "degrees"),
        Column::number("Cross-talk", "%"),
        Column::text("Phase of the pixel lattice, x and y"),
        Column::number("Elements alike", ""),
    ]);
    let range = |[low, high]: [f64; 2]| format!("{low:.1} to {high:.1}");
    for image in elements {
        table.row([
            Cell::from(image.element.as_str()),
            Cell::from(range(image.field_deg[0])),
            Cell::from(range(image.field_deg[1])),
            Cell::fixed(image.steepest_deg, 1),
            Cell::fixed(100.0 * image.cross_talk, 2),
            Cell::from(format!("{:.2}, {:.2}", image.lattice_phase[0], image.lattice_phase[1])),
            Cell::from(image.alike.to_string()),
        ]);
    }
    page.table(table.caption(
        "Field: the part of the scene whose image by this element lands on the sensor. Cross-talk: share of the images of other elements in the light of its pixels, in a white scene; stray light is not in it. Phase: place of the axis of the element between the middles of pixels, from 0 to 1. Elements alike: other elements with the same steering whose pixels of one colour look at the same places to a tenth of a pixel; together they see no finer detail than one does.",
    ));
}
