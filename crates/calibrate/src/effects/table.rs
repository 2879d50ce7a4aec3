//! The effects that any chip and bench may have, each a record of one table.

use metalith_optics::{DeclaredQuantity, Perturbation};

use super::{Effect, Parameter, Stage, ValueError, value_error_of};
use crate::set::MeasuredSet;

/// Measurements that distinguish more than one pair of effects.
const WIDTHS_BY_SEM: &str = "widths by SEM, from above, with an offset known to better than the bias";
const WIDTHS_OVER_THE_LENS: &str = "widths by SEM in the middle and at the rim of a lens";
const HEIGHTS_OVER_THE_LENS: &str = "heights by AFM in the middle and at the rim of a lens";
const HEIGHT_WITHOUT_MASK: &str = "a height by profilometer or AFM, before and after stripping the mask";
const INDEX_OF_THE_FILM: &str = "ellipsometry of the film on the chip";
const DARK_FIELD: &str = "a dark-field micrograph, which shows single missing pillars";

/// Reported values with their intervals, from the parameters and their half-widths.
type Reported = fn(&[f64], &[f64]) -> Vec<(f64, [f64; 2])>;

/// An effect of the table.
#[derive(Clone, Copy)]
pub(crate) struct TableEffect {
    /// The name it is reported by.
    pub name: &'static str,
    /// Unit of the value that is reported.
    pub unit: &'static str,
    /// Stage at which it acts.
    pub stage: Stage,
    /// Parameters: physical range and a size that is not unusual.
    pub parameters: &'static [Parameter],
    /// Set its parameters.
    pub apply: fn(&[f64], &mut Perturbation),
    /// Effects that this kind of data cannot distinguish from it, each with the measurement that can.
    pub confusions: &'static [(&'static str, &'static str)],
    /// Error of its values; if none, the error of its stage.
    pub value_error: Option<ValueError>,
    /// True if its derivative jumps at zero.
    pub kinked: bool,
    /// True if it acts on single pillars at random.
    pub random: bool,
    /// Declaration of a unit of its parameter in a file.
    pub declared_form: Option<(DeclaredQuantity, &'static str)>,
    /// Conclusion if it is linear in the place of the element.
    pub as_gradient: Option<&'static str>,
    /// The parameter of an amount.
    pub parameter: fn(f64) -> f64,
    /// The value that is reported for a parameter.
    pub value: fn(f64, &MeasuredSet) -> f64,
    /// Value of several parameters together.
    pub reported: Option<Reported>,
}

/// Defaults of a record: the parameter is reported unchanged.
const PLAIN: TableEffect = TableEffect {
    name: "",
    unit: "",
    stage: Stage::Geometry,
    parameters: &[],
    apply: |_, _| {},
    confusions: &[],
    value_error: None,
    kinked: false,
    random: false,
    declared_form: None,
    as_gradient: None,
    parameter: |amount| amount,
    value: |parameter, _| parameter,
    reported: None,
};

/// All of them, in the order of tables and of the search.
pub(crate) static TABLE: [TableEffect; 18] = [
    // Every pillar is wider or narrower than drawn by the same amount.
    TableEffect {
        name: "cd_bias",
        unit: "nm",
        parameters: &[Parameter::new(-30.0, 30.0, 5.0)],
        apply: |p, to| to.geometry.cd_bias_nm = p[0],
        value_error: Some(ValueError::of_value(1e-3)),
        declared_form: Some((DeclaredQuantity::WidthNm, "1")),
        as_gradient: Some("a dose or an etch that is not the same all over the chip"),
        confusions: &[
            ("corner_rounding", WIDTHS_BY_SEM),
            ("sidewall_taper", WIDTHS_BY_SEM),
            ("film_index", "ellipsometry of the film on the chip, or widths by SEM"),
            ("cd_bias_density", WIDTHS_OVER_THE_LENS),
        ],
        ..PLAIN
    },
    // Pillars are wider where more is exposed around them: backscattered electrons, or loading of the etch. Width added for
    // each unit of area fraction, averaged over the range of the backscatter.
    TableEffect {
        name: "cd_bias_density",
        unit: "nm",
        parameters: &[Parameter::new(-80.0, 80.0, 15.0)],
        apply: |p, to| to.geometry.cd_bias_density_nm = p[0],
        declared_form: Some((DeclaredQuantity::WidthNm, "fill")),
        confusions: &[("cd_bias", WIDTHS_OVER_THE_LENS)],
        ..PLAIN
    },
    // The film, and so every pillar, is thicker or thinner than stated; the height of the film is reported.
    TableEffect {
        name: "film_height",
        unit: "nm",
        stage: Stage::Stack,
        parameters: &[Parameter::new(-60.0, 60.0, 10.0)],
        apply: |p, to| to.cell.height_nm = p[0],
        value: |parameter, set| set.stack.cell.height_nm + parameter,
        confusions: &[
            ("residual_mask", HEIGHT_WITHOUT_MASK),
            ("film_index", INDEX_OF_THE_FILM),
            ("cd_bias", WIDTHS_BY_SEM),
        ],
        ..PLAIN
    },
    // Pillars at the rim of a lens are higher or lower than in its middle, on a flat substrate: the film is not flat, or masks
    // and tops wear unevenly, because the etch is loaded by what is open around them (C. J. Mogab, J. Electrochem. Soc. 124,
    // 1262 (1977)). An etch that goes deeper at the rim is another change: tops are level there, and film or a trench stays
    // between the pillars. The height grows with the square of the radius: the first term of any smooth change that is the
    // same all around. It is the same in every lens.
    TableEffect {
        name: "rim_height",
        unit: "nm",
        stage: Stage::Stack,
        // As of the height of the film, whose cells then serve both.
        parameters: &[Parameter::new(-60.0, 60.0, 10.0)],
        apply: |p, to| to.cell.rim_height_nm = p[0],
        confusions: &[
            (
                "defocus",
                "heights by AFM in the middle and at the rim of a lens, or the distance by another way",
            ),
            ("source_distance", HEIGHTS_OVER_THE_LENS),
            ("film_height", HEIGHTS_OVER_THE_LENS),
            ("spherical_aberration", HEIGHTS_OVER_THE_LENS),
            ("cd_bias_density", WIDTHS_OVER_THE_LENS),
        ],
        ..PLAIN
    },
    // The refractive index of the film differs from the ellipsometry: another position on the wafer, or densified since. Added
    // to n at every wavelength.
    TableEffect {
        name: "film_index",
        unit: "delta n",
        stage: Stage::Stack,
        parameters: &[Parameter::new(-0.15, 0.15, 0.02)],
        apply: |p, to| to.cell.index = p[0],
        confusions: &[
            (
                "film_height",
                "ellipsometry of the film on the chip, or a height by profilometer",
            ),
            ("cd_bias", WIDTHS_BY_SEM),
        ],
        ..PLAIN
    },
    // The top keeps its width, the foot is wider or narrower: angle of the wall from the vertical, positive if the foot is
    // wider.
    TableEffect {
        name: "sidewall_taper",
        unit: "deg",
        stage: Stage::Stack,
        parameters: &[Parameter::new(-3.0, 3.0, 0.6)],
        apply: |p, to| to.cell.taper_deg = p[0],
        confusions: &[
            ("cd_bias", WIDTHS_BY_SEM),
            ("corner_rounding", "a cross-section by SEM"),
        ],
        ..PLAIN
    },
    // Vertical edges are round: resist and etch do not resolve corners. Area and phase fall with the square of the radius,
    // which is what is fitted.
    TableEffect {
        name: CORNER_ROUNDING,
        unit: "nm",
        stage: Stage::Stack,
        parameters: &[Parameter::new(0.0, 4900.0, 625.0)],
        apply: |p, to| to.cell.corner_rounding_nm = p[0].max(0.0).sqrt(),
        parameter: |amount| amount * amount.abs(),
        value: |parameter, _| parameter.max(0.0).sqrt(),
        confusions: &[("cd_bias", WIDTHS_BY_SEM), ("sidewall_taper", "a cross-section by SEM")],
        ..PLAIN
    },
    // Alumina of the etch mask was left on the pillars.
    TableEffect {
        name: "residual_mask",
        unit: "nm",
        stage: Stage::Stack,
        parameters: &[Parameter::new(0.0, 80.0, 15.0)],
        apply: |p, to| to.cell.residual_mask_nm = p[0].max(0.0),
        confusions: &[("film_height", HEIGHT_WITHOUT_MASK), ("film_index", INDEX_OF_THE_FILM)],
        ..PLAIN
    },
    // A share of the pillars is missing, at random positions.
    TableEffect {
        name: "missing_pillars",
        parameters: &[Parameter::new(0.0, 0.3, 0.02)],
        apply: |p, to| to.geometry.missing_pillars = p[0].max(0.0),
        random: true,
        confusions: &[
            ("zero_order", DARK_FIELD),
            ("stray_light", "a dark-field micrograph, or the light beside the window"),
        ],
        ..PLAIN
    },
    // The camera's plane is farther from the chip than stated: added to every distance.
    TableEffect {
        name: "defocus",
        unit: "um",
        stage: Stage::Diffraction,
        parameters: &[Parameter::new(-60.0, 60.0, 4.0)],
        apply: |p, to| to.path.defocus_um = p[0],
        value_error: Some(ValueError::of_value(1e-4)),
        declared_form: Some((DeclaredQuantity::DistanceUm, "1")),
        as_gradient: Some("a sensor that is tilted against the chip: um per mm are mrad"),
        confusions: &[
            ("source_distance", "a measurement at another distance of the source"),
            ("led_centre", "the spectrum of the LED"),
        ],
        ..PLAIN
    },
    // The angle of incidence along x and y differs from the stated one, by the same angle for every measurement.
    TableEffect {
        name: "tilt",
        unit: "mrad",
        stage: Stage::Diffraction,
        parameters: &[Parameter::new(-40.0, 40.0, 3.0); 2],
        apply: |p, to| to.path.tilt_mrad = [p[0], p[1]],
        value_error: Some(ValueError::of_value(1e-4)),
        confusions: &[("aperture_offset", "a micrograph of the aperture's rim")],
        ..PLAIN
    },
    // The source is not at infinity: the incident wave is spherical. The reciprocal distance is fitted (1/m), the distance is
    // reported: 1e6 um to the metre; collimated light comes from infinitely far.
    TableEffect {
        name: "source_distance",
        unit: "um",
        stage: Stage::Diffraction,
        parameters: &[Parameter::new(0.0, 200.0, 25.0)],
        apply: |p, to| to.path.source_per_m = p[0].max(0.0),
        value_error: Some(ValueError::of_value(2e-4)),
        parameter: |amount| 1e6 / amount,
        value: |parameter, _| 1e6 / parameter.max(1e-6),
        confusions: &[("defocus", "measurements at two distances of the source")],
        ..PLAIN
    },
    // Spectra are wider or narrower than stated: the ratio of the width of all spectra to the stated one less one is fitted.
    TableEffect {
        name: "led_width",
        stage: Stage::Source,
        parameters: &[Parameter::new(-0.6, 1.5, 0.15)],
        apply: |p, to| to.light.led_width = p[0],
        value_error: Some(ValueError::of_typical(3e-3)),
        value: |parameter, _| 1.0 + parameter,
        confusions: &[
            ("pixel_blur", "the spectra of the LEDs"),
            ("source_size", "the spectra of the LEDs"),
        ],
        ..PLAIN
    },
    // The source is larger or smaller than stated: the ratio of its diameter to the stated one less one is fitted.
    TableEffect {
        name: "source_size",
        stage: Stage::Source,
        parameters: &[Parameter::new(-1.0, 6.0, 0.5)],
        apply: |p, to| to.light.source_size = p[0],
        value_error: Some(ValueError::of_value(1e-4)),
        value: |parameter, _| 1.0 + parameter,
        confusions: &[
            ("pixel_blur", "a measurement with the source stopped down"),
            ("led_width", "the spectra of the LEDs"),
        ],
        ..PLAIN
    },
    // The camera blurs: its relay, or charge that diffuses. The square of the standard deviation of a Gaussian is fitted.
    TableEffect {
        name: "pixel_blur",
        unit: "um",
        stage: Stage::Camera,
        parameters: &[Parameter::new(0.0, 9.0, 0.09)],
        apply: |p, to| to.camera.pixel_blur_um = p[0].max(0.0).sqrt(),
        value_error: Some(ValueError::of_value(1e-4)),
        parameter: |amount| amount * amount.abs(),
        value: |parameter, _| parameter.max(0.0).sqrt(),
        confusions: &[
            ("source_size", "a measurement with the source stopped down"),
            ("led_width", "the spectra of the LEDs"),
        ],
        ..PLAIN
    },
    // Light passes the aperture without interacting with pillars: its amplitude relative to the incident wave, in phase with
    // it and in quadrature, because the path of that light is not known.
    TableEffect {
        name: "zero_order",
        parameters: &[Parameter::new(-0.6, 0.6, 0.05); 2],
        apply: |p, to| {
            to.geometry.zero_order = p[0].hypot(p[1]);
            to.geometry.zero_order_phase = p[1].atan2(p[0]);
        },
        value_error: Some(ValueError::of_value(2e-3)),
        reported: Some(amplitude),
        confusions: &[("missing_pillars", DARK_FIELD)],
        ..PLAIN
    },
    // A share of the light of a window is spread over it uniformly: scatter in the relay.
    TableEffect {
        name: "stray_light",
        stage: Stage::Camera,
        parameters: &[Parameter::new(0.0, 0.6, 0.02)],
        apply: |p, to| to.camera.stray_light = p[0],
        value_error: Some(ValueError::of_value(8e-3)),
        confusions: &[("missing_pillars", "light beside the window, or a dark-field micrograph")],
        ..PLAIN
    },
    // Overlay error: the aperture is shifted along x and y against the pillars by the second exposure. Light through the
    // crescent that opens on the far side is not deflected and left out. The derivative jumps at zero: the rim covers other
    // pillars on either side.
    TableEffect {
        name: "aperture_offset",
        unit: "um",
        parameters: &[Parameter::new(-20.0, 20.0, 2.0); 2],
        apply: |p, to| to.geometry.aperture_offset_um = [p[0], p[1]],
        kinked: true,
        value_error: Some(ValueError::of_value(1e-2)),
        confusions: &[("tilt", "a micrograph of the aperture's rim")],
        ..PLAIN
    },
];

/// The effect that chips of circles cannot have.
pub(crate) const CORNER_ROUNDING: &str = "corner_rounding";

/// The amplitude of two parameters in quadrature, with its interval.
fn amplitude(numbers: &[f64], half_widths: &[f64]) -> Vec<(f64, [f64; 2])> {
    let amplitude = numbers[0].hypot(numbers[1]);
    let along = numbers.iter().zip(half_widths).map(|(n, w)| n * w);
    let width = along.fold(0.0, f64::hypot) / amplitude.max(f64::MIN_POSITIVE);
    vec![(amplitude, [(amplitude - width).max(0.0), amplitude + width])]
}

impl Effect for TableEffect {
    fn name(&self) -> String {
        self.name.into()
    }

    fn unit(&self) -> &str {
        self.unit
    }

    fn stage(&self) -> Stage {
        self.stage
    }

    fn parameters(&self) -> Vec<Parameter> {
        self.parameters.to_vec()
    }

    fn kinked(&self) -> bool {
        self.kinked
    }

    fn random(&self) -> bool {
        self.random
    }

    fn declared_form(&self, _parameter: usize) -> Option<(DeclaredQuantity, String)> {
        self.declared_form.map(|(quantity, factor)| (quantity, factor.into()))
    }

    fn as_gradient(&self) -> Option<&'static str> {
        self.as_gradient
    }

    fn value_error(&self) -> ValueError {
        self.value_error.unwrap_or(value_error_of(self.stage))
    }

    fn apply(&self, parameters: &[f64], to: &mut Perturbation) {
        (self.apply)(parameters, to);
    }

    fn parameter(&self, amount: f64) -> f64 {
        (self.parameter)(amount)
    }

    fn value(&self, parameter: f64, set: &MeasuredSet) -> f64 {
        (self.value)(parameter, set)
    }

    fn reported(&self, numbers: &[f64], half_widths: &[f64], set: &MeasuredSet) -> Vec<(f64, [f64; 2])> {
        match self.reported {
            Some(reported) => reported(numbers, half_widths),
            None => self.reported_each(numbers, half_widths, set),
        }
    }

    fn confusions(&self) -> &'static [(&'static str, &'static str)] {
        self.confusions
    }
}
