//! Simulation of pillars and its light, by the words of a caller.

use std::path::Path;

use metalith::cell::{
    Analyser, CellStack, FittedCell, FocusedLight, Handedness, Mapping, MixedCell, NeighbourCell, PointwiseCell,
    Polarisation, PolarisationAxis, PolarisedLight, PublishedCell, cache_folder, polarising_cell,
};
use metalith::design::band_about;
use metalith::{
    CalibratedModel, CellModel, Error, Fidelity, LatticeKind, OutlineForm, PillarMap, PillarShape, PolarisationBasis,
    Result,
};

/// Simulation that the caller asks for.
pub enum Wanted {
    /// Pillars as drawn, by such a cell.
    Cell(Fidelity),
    /// Pillars as fabricated on a measured line and bench.
    Model(Box<CalibratedModel>),
}

impl Wanted {
    /// Simulation that a word and a file name; a model has its own cells.
    pub fn of(fidelity: Option<&str>, model: Option<&Path>) -> Result<Self> {
        match (fidelity, model) {
            (Some(word), Some(_)) => Err(Error::refused(
                "option/model-and-fidelity",
                format!("the fidelity `{word}` and a model"),
                "leave out one of `fidelity` and `model`: a model has its own cells",
            )),
            (None, Some(path)) => Ok(Self::Model(Box::new(CalibratedModel::read(path)?))),
            (word, None) => Ok(Self::Cell(word.map_or(Ok(Fidelity::Rigorous), self::fidelity)?)),
        }
    }
}

/// The cell that a word names.
fn fidelity(word: &str) -> Result<Fidelity> {
    match word {
        "rigorous" => Ok(Fidelity::Rigorous),
        "neighbours" => Ok(Fidelity::Neighbours),
        "fitted" => Ok(Fidelity::Fitted),
        "published" => Ok(Fidelity::Published),
        _ => Err(Error::refused(
            "cell/unknown-fidelity",
            format!("there is no fidelity `{word}`"),
            "use rigorous, neighbours, fitted or published",
        )),
    }
}

/// The light that words or angles name, at pillars of a shape.
pub fn polarised(arriving: Option<&str>, analyser: Option<&str>, shape: PillarShape) -> Result<PolarisedLight> {
    let own = match shape.basis() {
        Some(PolarisationBasis::Linear) => PolarisationAxis::X.polarisation(),
        _ => Polarisation::Circular(Handedness::default()),
    };
    let arriving: Polarisation = arriving.map_or(Ok(own), str::parse)?;
    let analyser: Option<Analyser> = analyser.map(str::parse).transpose()?;
    let usual = arriving == own && analyser.is_none();
    if shape.basis() == Some(PolarisationBasis::Linear) && analyser == Some(Analyser::Circular) {
        return Err(Error::refused(
            "light/not-focused",
            "a circular analyser behind upright rectangles, which focus no hand",
            "give `analyser` x, y or an angle",
        ));
    }
    if shape.basis().is_none() && !usual {
        return Err(Error::refused(
            "light/polarisation-without-rectangles",
            format!("light of a polarisation for {}", shape.plural()),
            "leave out `arriving` and `analyser`: they count for rectangles alone",
        ));
    }
    if analyser == Some(Analyser::Circular) && !matches!(arriving, Polarisation::Circular(_)) {
        return Err(Error::refused(
            "light/handedness-missing",
            format!("a circular analyser in light that arrives {arriving}"),
            "give an array of a design, which says what the pillars focus: the analyser passes what that is converted to",
        ));
    }
    Ok(PolarisedLight {
        arriving: Some(arriving),
        analyser,
    })
}

/// The light that pillars of a shape are taken to focus.
pub fn focused(light: PolarisedLight, shape: PillarShape) -> FocusedLight {
    if shape.basis() == Some(PolarisationBasis::Linear) {
        return FocusedLight::Linear(light.arriving.map_or(PolarisationAxis::X, PolarisationAxis::nearest));
    }
    FocusedLight::Circular(match light.arriving {
        Some(Polarisation::Circular(hand)) if light.analyser.is_some() => hand,
        _ => Handedness::default(),
    })
}

/// Cells that pillars of a shape on such a lattice do not have.
pub fn refuse(wanted: Fidelity, shape: PillarShape, kind: LatticeKind) -> Result<()> {
    // Its polynomials are of squares.
    if shape.outline() == OutlineForm::Circle && wanted == Fidelity::Published {
        return Err(Error::refused(
            "cell/fidelity-not-for-pillars",
            format!("{} by the `{wanted}` cell", shape.plural()),
            "use rigorous, neighbours or fitted",
        ));
    }
    wanted.check(shape, kind)
}

/// The cell of maps of pillars, without a design.
pub fn cell_of(
    wanted: Fidelity,
    stack: CellStack,
    maps: &[PillarMap],
    light: PolarisedLight,
    wavelengths_nm: &[f64],
) -> Result<Box<dyn CellModel>> {
    let (shape, cache) = (stack.shape, cache_folder());
    if let Some(cell) = polarising_cell(&stack, focused(light, shape), cache.as_deref()) {
        return Ok(cell);
    }
    let drawn = drawn(maps);
    Ok(match wanted {
        Fidelity::Published => Box::new(PublishedCell::new(stack.pitch_nm as u32)),
        Fidelity::Neighbours => {
            let mapping = Mapping::of_widths(maps.iter().map(PillarMap::histogram))?;
            Box::new(NeighbourCell::new(stack, vec![mapping], cache))
        }
        Fidelity::Fitted => {
            let band = band_about(wavelengths_nm.iter().map(|nm| nm * 1e-3), stack.range_um());
            let range = (*drawn.first().unwrap_or(&100), *drawn.last().unwrap_or(&300));
            Box::new(FittedCell::of_stack(&stack, band, range, cache.as_deref())?)
        }
        _ if shape == PillarShape::Mixed => Box::new(MixedCell::new(&stack, drawn).cached_in(cache.as_deref())),
        _ => Box::new(PointwiseCell::new(stack, drawn).cached_in(cache.as_deref())),
    })
}

/// The widths that are drawn (nm), rising.
fn drawn(maps: &[PillarMap]) -> Vec<u16> {
    let mut widths: Vec<u16> = Vec::new();
    for map in maps {
        let histogram = map.histogram();
        let there = histogram.iter().enumerate().skip(1).filter(|(_, n)| **n > 0);
        widths.extend(there.map(|(w, _)| w as u16));
    }
    widths.sort_unstable();
    widths.dedup();
    widths
}
