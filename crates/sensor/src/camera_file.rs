//! The camera file, read with a place for every mistake.

use std::path::{Path, PathBuf};

use metalith_core::document::{Document, KeyTable, Limits, Section, explore, load};
use metalith_core::{Error, Result};
use serde::Serialize;

use crate::{
    AngularResponse, Channel, ColourFilter, Exposure, Illuminant, Led, LightLevel, Response, SceneLight, Sensor,
    SensorNoise, Spectrum, StatedExposure, Walls,
};

/// Version of the format of camera files that this program reads.
const SCHEMA: i64 = 1;

/// Most channels of a sensor, and diodes of an illuminant.
const MOST: usize = 16;

/// A camera: sensor, channels, exposure and the light of the scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Camera {
    /// Name of it, for reports.
    pub name: String,
    pub sensor: Sensor,
    pub channels: Vec<Channel>,
    pub illuminant: Illuminant,
    pub exposure: Exposure,
    /// The files that it was read from, itself first; none for the camera that is assumed where none is named.
    #[serde(skip)]
    pub files: Vec<PathBuf>,
}

impl Camera {
    /// Names of the channels.
    pub fn channel_names(&self) -> Vec<String> {
        self.channels.iter().map(|c| c.name.clone()).collect()
    }

    /// Read the camera file at `path`, and the curves that it names.
    ///
    /// # Errors
    /// [`Error::Text`] with every mistake of the file and of the curves that it names, each with line, column and remedy; if a channel
    /// counts none of the light.
    pub fn read(path: &Path) -> Result<Self> {
        let text = load(path)?;
        Document::read(path, &text, |root| Self::of_sections(root, path))?.check_light(path)
    }

    /// The keys of a camera file.
    pub fn keys() -> KeyTable {
        explore(&[], Self::of_sections)
    }

    /// The camera that the sections of the file at `path` describe, with the curves that they name.
    fn of_sections(root: &Section<'_, '_>, path: &Path) -> Self {
        root.integer("schema", SCHEMA..=SCHEMA, "");
        let mut files = vec![path.to_owned()];
        let name = root.text("name");
        let sensor_section = root.section("sensor");
        let sensor = read_sensor(&sensor_section, &mut files);
        let channels = read_channels(root, &sensor_section, &sensor, &mut files);
        let illuminant = root.section("illuminant");
        let exposure = Exposure::read(&root.section("exposure"), &illuminant, &sensor_section, &sensor);
        let illuminant = read_illuminant(&illuminant, &mut files);
        files.dedup();
        Self {
            name,
            sensor,
            channels,
            illuminant,
            exposure,
            files,
        }
    }

    /// The camera that is assumed of a design for this band (nm) where none is named: three flat bands if it holds the
    /// visible, else one over the whole of it.
    pub fn assumed(pixel_um: f64, band_nm: [f64; 2]) -> Self {
        let three = Self::three_bands(pixel_um);
        if band_nm[0] <= VISIBLE_NM[0] && band_nm[1] >= VISIBLE_NM[1] {
            return three;
        }
        Self {
            name: "one flat band".into(),
            channels: vec![flat_channel("band", band_nm)],
            ..three
        }
    }

    /// Three channels of flat response, 400 to 500, 500 to 600 and 600 to 700 nm, in light of equal energy, with the noise
    /// of Tseng et al. (2021).
    pub fn three_bands(pixel_um: f64) -> Self {
        let [short, long] = VISIBLE_NM;
        let third = (long - short) / 3.0;
        let band = |name: &str, k: f64| flat_channel(name, [short + k * third, short + (k + 1.0) * third]);
        let noise = crate::Noise::default();
        Self {
            name: "three flat bands".into(),
            sensor: Sensor {
                pixel_um,
                columns: 1936,
                rows: 1216,
                offset_um: [0.0; 2],
                distance_um: None,
                tilt_rad: [0.0; 2],
                filter: ColourFilter::None,
                angular_response: AngularResponse::Unstated,
                walls: Walls::None,
                bits: 12,
                gain_e: 1.0,
                noise: SensorNoise::FullScale {
                    photon: noise.photon,
                    read: noise.read,
                },
            },
            channels: vec![band("blue", 0.0), band("green", 1.0), band("red", 2.0)],
            illuminant: Illuminant::EqualEnergy,
            exposure: Exposure {
                time_s: 1.0,
                auto: true,
                white: 0.9,
                light: SceneLight::unstated(),
            },
            files: Vec::new(),
        }
    }

    /// This camera in the light and for the time that a command states.
    ///
    /// # Errors
    /// If one is out of its range, or an illuminance is stated and next to none of the light of its illuminant is visible.
    pub fn stated(mut self, stated: &StatedExposure) -> Result<Self> {
        stated.check()?;
        if let Some(time_ms) = stated.time_ms {
            (self.exposure.auto, self.exposure.time_s) = (false, 1e-3 * time_ms);
        }
        if let Some(longest_ms) = stated.longest_ms {
            (self.exposure.auto, self.exposure.time_s) = (true, 1e-3 * longest_ms);
        }
        let Some(lux) = stated.lux else {
            return Ok(self);
        };
        self.exposure.light.level = Some(LightLevel::IlluminanceLux(lux));
        let path = self.files.first().cloned().unwrap_or_default();
        self.check_light(&path)
    }

    /// Every channel must count something, and light in lux must be visible.
    fn check_light(self, path: &Path) -> Result<Self> {
        let dark = self.channels.iter().find(|c| !c.counts_any(&self.illuminant));
        match dark {
            None if matches!(self.exposure.light.level, Some(LightLevel::IlluminanceLux(_))) && !self.is_seen() => {
                Err(Error::refused(
                    "camera/light-not-visible",
                    format!(
                        "{}: next to none of the light is visible, so that lux do not state it",
                        path.display()
                    ),
                    "give `radiance_w_m2_sr` of a white surface instead of `illuminance_lux`",
                ))
            }
            None => Ok(self),
            Some(channel) => Err(Error::refused(
                "camera/channel-without-light",
                format!(
                    "{}: channel `{}` receives no light of the illuminant",
                    path.display(),
                    channel.name
                ),
                "let the efficiency of each channel and the illuminant overlap in wavelength",
            )),
        }
    }
}

/// Band of colour sensors (nm).
const VISIBLE_NM: [f64; 2] = [400.0, 700.0];

/// A channel that counts all light of a band (nm).
fn flat_channel(name: &str, band_nm: [f64; 2]) -> Channel {
    Channel {
        name: name.to_owned(),
        response: Response::Band {
            band_nm,
            efficiency: 1.0,
        },
    }
}

/// What `read` reads in the file that a key names, which is added to the files of the camera.
fn curve<T>(
    s: &Section<'_, '_>,
    key: &str,
    files: &mut Vec<PathBuf>,
    read: impl FnOnce(&Path) -> Result<T>,
) -> Option<T> {
    let (file, curve) = s.contents(key, read)?;
    files.push(file);
    Some(curve)
}

/// The sensor, with the curve that it names.
fn read_sensor(s: &Section<'_, '_>, files: &mut Vec<PathBuf>) -> Sensor {
    let positive = |key: &str, least: f64, most: f64, unit: &'static str| s.float(key, Limits::new(least..=most, unit));
    let optional =
        |key: &str, range, unit: &'static str, default: f64| s.float_or(key, Limits::new(range, unit), default);
    let bits = s.integer("bits", 1..=32, "bits") as u32;
    ["noise_photon", "noise_read"].iter().for_each(|key| s.may_have(key));
    let in_paper_terms = s.has("noise_photon") || s.has("noise_read");
    let noise = if in_paper_terms {
        for key in ["full_well_e", "read_noise_e", "dark_current_e_s"] {
            // Read, so that the key is known; said to be one too many.
            if s.optional_float(key, Limits::new(0.0..=f64::MAX, "electrons"))
                .is_some()
            {
                s.fault(
                    key,
                    format!("noise is given twice: `{key}`, and in units of full scale"),
                    "keep `noise_photon` and `noise_read`, or the numbers in electrons",
                );
            }
        }
        SensorNoise::FullScale {
            photon: s.float("noise_photon", Limits::new(0.0..=1.0, "of full scale")),
            read: s.float("noise_read", Limits::new(0.0..=1.0, "of full scale")),
        }
    } else {
        SensorNoise::Electrons {
            full_well_e: positive("full_well_e", 1.0, 1e9, "electrons"),
            read_noise_e: positive("read_noise_e", 0.0, 1e6, "electrons"),
            dark_current_e_s: optional("dark_current_e_s", 0.0..=1e9, "electrons a second", 0.0),
        }
    };
    let steps = f64::from(bits).exp2();
    let whole = noise.full_scale_e().map_or(1.0, |full| full / steps);
    let sensor = Sensor {
        pixel_um: positive("pixel_um", 0.1, 100.0, "um"),
        columns: s.integer("columns", 1..=100_000, "pixels") as u32,
        rows: s.integer("rows", 1..=100_000, "pixels") as u32,
        offset_um: s
            .optional_array("offset_um", Limits::new(-1e5..=1e5, "um"))
            .unwrap_or([0.0; 2]),
        distance_um: s.optional_float("distance_um", Limits::new(1.0..=1e5, "um")),
        tilt_rad: s
            .optional_array("tilt_deg", Limits::new(-20.0..=20.0, "degrees"))
            .unwrap_or([0.0_f64; 2])
            .map(f64::to_radians),
        filter: s.choice(
            "filter",
            &[&[("none", ColourFilter::None)], &ColourFilter::BAYER[..]].concat(),
            None,
        ),
        bits,
        // Full scale is the whole of the well, unless the file says otherwise.
        gain_e: optional("gain_e", 1e-6..=1e6, "electrons a step", whole),
        noise,
        angular_response: if s.has("angular_response") {
            curve(s, "angular_response", files, AngularResponse::read_csv).unwrap_or_default()
        } else {
            s.may_have("angular_response");
            AngularResponse::Unstated
        },
        walls: s.choice(
            "walls",
            &[("none", Walls::None), ("between_elements", Walls::BetweenElements)],
            Some(Walls::None),
        ),
    };
    s.finish();
    sensor
}

fn read_channels(
    root: &Section<'_, '_>,
    sensor_section: &Section<'_, '_>,
    sensor: &Sensor,
    files: &mut Vec<PathBuf>,
) -> Vec<Channel> {
    let sections = root.sections("channel");
    let mut channels: Vec<Channel> = Vec::new();
    for s in sections.iter().take(MOST) {
        let name = s.text("name");
        if channels.iter().any(|known| known.name == name) {
            s.fault(
                "name",
                format!("a second channel `{name}`"),
                "give each channel its own name",
            );
        }
        let response = read_response(s, files);
        channels.push(Channel { name, response });
        s.finish();
    }
    if sections.is_empty() && !root.has("channel") {
        root.fault(
            "channel",
            "a camera without channels counts no light",
            "add one or more sections [[channel]]",
        );
    }
    if sections.len() > MOST {
        sections[MOST].fault("name", format!("more than {MOST} channels"), "leave some out");
    }
    let wanted = sensor.filter.channels();
    let has = |name: &str| channels.iter().any(|known| known.name == name);
    if let Some(wanted) = wanted
        && !(channels.len() == wanted.len() && wanted.iter().all(|w| has(w)))
        && sections.iter().all(|s| s.sound(&["channel.name"]))
    {
        sensor_section.fault(
            "filter",
            "this colour filter array does not fit the channels",
            "name three channels red, green and blue, or use `filter = \"none\"`",
        );
    }
    channels
}

fn read_response(s: &Section<'_, '_>, files: &mut Vec<PathBuf>) -> Response {
    if s.has("quantum_efficiency") {
        let found = curve(s, "quantum_efficiency", files, |path| Spectrum::read_csv(path, 1.0));
        for key in ["band_nm", "efficiency"] {
            if s.has(key) {
                s.floats("band_nm", WAVELENGTH);
                s.optional_float("efficiency", Limits::new(0.0..=1.0, "electrons a photon"));
                s.fault(
                    key,
                    "a channel has a curve or a band",
                    format!("keep one of `quantum_efficiency` and `{key}`"),
                );
            }
        }
        // A flat one stands in for one that cannot be used.
        return found.map_or_else(|| flat_channel("", VISIBLE_NM).response, Response::Curve);
    }
    let band_nm: [f64; 2] = s.array("band_nm", WAVELENGTH);
    if band_nm[0] >= band_nm[1] {
        s.fault(
            "band_nm",
            "a band must end after it begins",
            "give its shortest and its longest wavelength",
        );
    }
    Response::Band {
        band_nm,
        efficiency: s.float_or("efficiency", Limits::new(1e-6..=1.0, "electrons a photon"), 1.0),
    }
}

fn read_illuminant(s: &Section<'_, '_>, files: &mut Vec<PathBuf>) -> Illuminant {
    #[derive(Clone, Copy, PartialEq)]
    enum Source {
        D65,
        A,
        EqualEnergy,
        File,
        Leds,
    }
    let source = s.choice(
        "source",
        &[
            ("d65", Source::D65),
            ("a", Source::A),
            ("equal_energy", Source::EqualEnergy),
            ("file", Source::File),
            ("leds", Source::Leds),
        ],
        None,
    );
    let illuminant = match source {
        Source::D65 => Illuminant::D65,
        Source::A => Illuminant::A,
        Source::EqualEnergy => Illuminant::EqualEnergy,
        Source::File => curve(s, "file", files, |path| Spectrum::read_csv(path, f64::MAX))
            .map_or(Illuminant::EqualEnergy, Illuminant::File),
        Source::Leds => Illuminant::Leds(read_leds(s)),
    };
    for (key, of) in [("file", Source::File), ("led", Source::Leds)] {
        if s.has(key) && source != of {
            // Asked for, so that this is its one fault.
            s.sections("led");
            s.fault(
                key,
                format!("`{key}` is of no use with this source"),
                "remove it, or change `source`",
            );
        }
    }
    s.finish();
    illuminant
}

fn read_leds(s: &Section<'_, '_>) -> Vec<Led> {
    let sections = s.sections("led");
    if sections.is_empty() && !s.has("led") {
        s.fault(
            "source",
            "there is no diode",
            "add one or more sections [[illuminant.led]]",
        );
    }
    if sections.len() > MOST {
        sections[MOST].fault("centre_nm", format!("more than {MOST} diodes"), "leave some out");
    }
    let led = |s: &Section<'_, '_>| {
        let led = Led {
            centre_nm: s.float("centre_nm", WAVELENGTH),
            width_nm: s.float("width_nm", Limits::new(0.1..=500.0, "nm")),
            power: s.float_or("power", Limits::new(1e-6..=1e6, ""), 1.0),
        };
        s.finish();
        led
    };
    sections.iter().take(MOST).map(led).collect()
}

const WAVELENGTH: Limits = Limits {
    range: 200.0..=5000.0,
    unit: "nm",
};
