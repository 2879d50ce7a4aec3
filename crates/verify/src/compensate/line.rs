//! Pillars as a line fabricates them: transmission as stated and as fabricated, and what density adds at each site.

use num_complex::Complex64;

use metalith_cell::{
    CellModel, CellResponse, FocusingStack, JonesTables, PointwiseCell, PolarisationAxis, PolarisedTables, cache_folder,
};
use metalith_core::{Error, Progress, Result, Steps};
use metalith_design::Design;
use metalith_optics::{AsBuiltChip, CalibratedModel, Perturbation};
use metalith_pillars::{PillarMap, PillarShape};

/// Transmissions at one wavelength, of upright rectangles in one polarisation.
#[derive(Clone, Debug)]
pub(crate) struct ColourTransmissions {
    pub wavelength_um: f64,
    /// Axis that the light is polarised along, for upright rectangles, which have a phase for each.
    pub axis: Option<PolarisationAxis>,
    /// |t| of a stated cell that passes everything.
    pub full: f64,
    /// Transmission of intended pillars as stated, by width (nm) or number.
    pub stated: Vec<Complex64>,
    /// Transmission of fabricated pillars, by the place of the drawn pillar in [`Line::drawn`] and then by step of
    /// density.
    made: Vec<Vec<Complex64>>,
}

/// A line, for the wavelengths that a design is verified at.
pub(crate) struct Line {
    /// Chips as they would be if nothing differed from what is stated.
    pub stated: AsBuiltChip,
    /// Chips as they are made.
    pub chip: AsBuiltChip,
    pub colours: Vec<ColourTransmissions>,
    /// Widths (nm) that may be drawn, or numbers of upright rectangles.
    pub drawn: Vec<u16>,
    /// The least step of density that transmissions are known for.
    first_step: i32,
}

impl Line {
    /// Solve the cells as stated; those as made are solved once the steps of density are known.
    ///
    /// # Errors
    /// If a cell cannot be solved, a number of the model cannot be, it says what no width can undo, or the pillars are rotated rectangles.
    pub(crate) fn new(design: &Design, model: &CalibratedModel, progress: &dyn Progress) -> Result<Self> {
        let drawn: Vec<u16> = design.cell.widths_nm().collect();
        check_shape(design.cell.shape)?;
        check_equal_copies(model)?;
        if model.perturbation.cell.rim_height_nm != 0.0 {
            return Err(Error::refused(
                "compensate/height-varies",
                "pillars that are higher at the rim of a lens are not compensated: a width is chosen for its cell, not for its place",
                "take `rim_height_nm` out of the model; `metalith run --model` shows what it does",
            ));
        }
        let lit = design.lit_stack()?;
        let kept = cache_folder();
        let nothing = CalibratedModel::new(String::new(), String::new(), Perturbation::default());
        let mut line = Self {
            stated: AsBuiltChip::in_light(&lit, &nothing)?.cached_in(kept.as_deref()),
            chip: AsBuiltChip::in_light(&lit, model)?.cached_in(kept.as_deref()),
            colours: Vec::new(),
            drawn,
            first_step: 0,
        };
        for &um in &design.verify.wavelengths_um {
            let colours = line.stated_colours(&lit, um, progress)?;
            line.colours.extend(colours);
        }
        Ok(line)
    }

    /// Transmission of intended pillars as stated, at a wavelength (um).
    fn stated_colours(
        &self,
        lit: &FocusingStack,
        wavelength_um: f64,
        progress: &dyn Progress,
    ) -> Result<Vec<ColourTransmissions>> {
        let full = lit.stack.full_transmission(wavelength_um)?;
        let colour = |axis, stated| ColourTransmissions {
            wavelength_um,
            axis,
            full,
            stated,
            made: Vec::new(),
        };
        if lit.focused.is_some() {
            let along = along_axes(&self.stated, &self.drawn, 0, wavelength_um, progress)?;
            let both = PolarisationAxis::ALL.into_iter().zip(along);
            return Ok(both.map(|(axis, table)| colour(Some(axis), table)).collect());
        }
        let wide = self.drawn.last().copied().unwrap_or(0);
        let cell = PointwiseCell::new(lit.stack.clone(), self.drawn.iter().copied());
        Ok(vec![colour(None, cell.transmissions(wavelength_um, wide)?)])
    }

    /// True if the width of a pillar depends on what is drawn around it.
    pub(crate) fn varies_by_site(&self) -> bool {
        self.chip.perturbation().geometry.varies_by_site()
    }

    /// Steps that density adds to the width at every site of an element as drawn, whose opening in the metal has this radius (um), row
    /// by row.
    pub(crate) fn steps(&self, drawn: &PillarMap, aperture_radius_um: f64) -> Vec<i32> {
        let element = self.chip.drawn(drawn, aperture_radius_um);
        let steps = element.site_steps(&self.chip.perturbation().geometry);
        steps.unwrap_or_else(|| vec![0; drawn.number.len()])
    }

    /// Solve all pillars that may be drawn as fabricated, for these steps of density at the least and at the most.
    ///
    /// # Errors
    /// If a cell cannot be solved, or the user stopped it.
    pub(crate) fn solve(&mut self, least: i32, most: i32, progress: &dyn Progress) -> Result<()> {
        let steps: Vec<i32> = (least..=most).collect();
        let of_all = Steps::begin(
            progress,
            "pillars as they are made",
            (self.colours.len() * steps.len()) as u64,
        );
        self.first_step = least;
        for colour in &mut self.colours {
            colour.made = vec![Vec::new(); self.drawn.len()];
            for &step in &steps {
                let row = made(&self.chip, &self.drawn, step, colour, &of_all)?;
                colour.made.iter_mut().zip(row).for_each(|(to, t)| to.push(t));
                of_all.done();
            }
        }
        Ok(())
    }

    /// Transmission of a pillar at one of the colours, drawn at a place of [`Line::drawn`], at a step of density that
    /// was solved for.
    pub(crate) fn made(&self, colour: &ColourTransmissions, place: usize, step: i32) -> Complex64 {
        colour.made[place][(step - self.first_step) as usize]
    }
}

/// Transmission of pillars of a chip at one of the colours where so many steps of density are added.
fn made(
    chip: &AsBuiltChip,
    drawn: &[u16],
    step: i32,
    colour: &ColourTransmissions,
    progress: &dyn Progress,
) -> Result<Vec<Complex64>> {
    let um = colour.wavelength_um;
    let table = match colour.axis {
        None => chip.pillars(drawn, step, um, progress)?.focused()?,
        // Those of both axes are solved together, and remembered.
        Some(axis) => along_axes(chip, drawn, step, um, progress)?.swap_remove(axis.index()),
    };
    Ok(drawn.iter().map(|number| table[usize::from(*number)]).collect())
}

/// Transmission of upright rectangles of a chip for light along x and along y, by their number.
fn along_axes(
    chip: &AsBuiltChip,
    drawn: &[u16],
    step: i32,
    wavelength_um: f64,
    progress: &dyn Progress,
) -> Result<Vec<Vec<Complex64>>> {
    match chip.pillars(drawn, step, wavelength_um, progress)? {
        CellResponse::Jones(JonesTables::Polarised(PolarisedTables::Axes(tables))) => Ok(tables.along.into()),
        other => unreachable!("pillars that were told apart along both axes: {other:?}"),
    }
}

/// Succeeds if copies of an element have equal widths as fabricated, so that one correction is of all of them.
///
/// # Errors
/// If the model declares widths that depend on more than the pillar, the fill around it and its distance from the middle.
pub fn check_equal_copies(model: &CalibratedModel) -> Result<()> {
    let directed = model.perturbation.geometry.directed_widths();
    if directed.is_empty() {
        return Ok(());
    }
    Err(Error::refused(
        "compensate/copies-differ",
        format!(
            "the widths that `{}` declares differ between copies of an element",
            directed.join("`, `")
        ),
        "compensate for widths that depend on `w`, `fill` and `r` alone, or take the term out of the model",
    ))
}

/// Succeeds if another pillar of a design may come out as the intended one.
fn check_shape(shape: PillarShape) -> Result<()> {
    if shape.has_one_size() {
        Err(Error::refused(
            "compensate/rotated-rectangles",
            "the pillars are rotated rectangles of one size: no other of them is nearer to what was intended",
            "draw edges that come out as intended: `width_nm` and `length_nm` of [cell], less the bias of the model; `metalith run --model` \
         judges the chip that they give",
        ))
    } else {
        Ok(())
    }
}
