//! How a line makes pillars: transmission as stated and as made, and what density adds at each site.

use num_complex::Complex64;

use metalith_cell::{CellModel, PointwiseCell};
use metalith_core::{Error, Progress, Result, WidthMap};
use metalith_design::Design;
use metalith_made::{CalibratedModel, MadeChip, Perturbation};

/// Transmissions at one wavelength.
#[derive(Clone, Debug)]
pub struct ColourTransmissions {
    pub wavelength_um: f64,
    /// |t| of a stated cell that passes everything.
    pub full: f64,
    /// Of intended pillars as stated, by width (nm).
    pub stated: Vec<Complex64>,
    /// Of made pillars, by the place of the drawn width in [`Line::drawn_nm`] and then by step of density.
    made: Vec<Vec<Complex64>>,
}

/// A line, for the wavelengths that a design is verified at.
pub struct Line {
    /// Chips as they would be if nothing differed from what is stated.
    pub stated: MadeChip,
    /// Chips as they are made.
    pub chip: MadeChip,
    pub colours: Vec<ColourTransmissions>,
    /// Widths that may be drawn (nm).
    pub drawn_nm: Vec<u16>,
    /// Radius of the openings in the metal (um).
    pub aperture_radius_um: f64,
    /// The least step of density that transmissions are known for.
    first_step: i32,
}

impl Line {
    /// Solve the cells as stated; those as made are solved once the steps of density are known.
    ///
    /// # Errors
    /// If a cell cannot be solved, or a number of the model cannot be.
    pub fn new(design: &Design, model: &CalibratedModel) -> Result<Self> {
        let drawn_nm: Vec<u16> = design.cell.widths_nm().collect();
        let (_, wide) = design.cell.width_range_nm;
        let directed = model.perturbation.geometry.directed_widths();
        if !directed.is_empty() {
            return Err(Error::invalid(
                format!(
                    "widths as declared by `{}` differ between copies of an element",
                    directed.join("`, `")
                ),
                "compensate for widths that depend on `w`, `fill` and `r` alone, or take the term out of the model",
            ));
        }
        if model.perturbation.cell.rim_height_nm != 0.0 {
            return Err(Error::invalid(
                "pillars that are higher at the rim of a lens are not compensated: a width is chosen for its cell, not for its place",
                "take `rim_height_nm` out of the model; `metalith run --model` shows what it does",
            ));
        }
        let stack = design.cell_stack()?;
        let chip = MadeChip::new(&stack, model)?;
        let nothing = CalibratedModel::new(String::new(), String::new(), Perturbation::default());
        let as_stated = MadeChip::new(&stack, &nothing)?;
        let stated = PointwiseCell::new(stack, drawn_nm.iter().copied());
        let colour = |&wavelength_um: &f64| {
            Ok(ColourTransmissions {
                wavelength_um,
                full: stated.full_transmission(wavelength_um)?,
                stated: stated.transmissions(wavelength_um, wide)?,
                made: Vec::new(),
            })
        };
        Ok(Self {
            stated: as_stated,
            chip,
            colours: design.verify.wavelengths_um.iter().map(colour).collect::<Result<_>>()?,
            drawn_nm,
            aperture_radius_um: design.aperture_radius_um(),
            first_step: 0,
        })
    }

    /// Whether the width of a pillar depends on what is drawn around it.
    pub fn varies_by_site(&self) -> bool {
        self.chip.perturbation().geometry.varies_by_site()
    }

    /// Steps that density adds to the width at every site of a layout as drawn, row by row.
    pub fn steps(&self, drawn: &WidthMap) -> Vec<i32> {
        let element = self.chip.drawn(drawn, self.aperture_radius_um);
        let steps = element.site_steps(&self.chip.perturbation().geometry);
        steps.unwrap_or_else(|| vec![0; drawn.width_nm.len()])
    }

    /// Solve all drawn widths as made, for these steps of density at the least and at the most.
    ///
    /// # Errors
    /// If a cell cannot be solved, or the user stopped it.
    pub fn solve(&mut self, least: i32, most: i32, progress: &dyn Progress) -> Result<()> {
        let steps: Vec<i32> = (least..=most).collect();
        progress.begin("pillars as they are made", (self.colours.len() * steps.len()) as u64);
        self.first_step = least;
        for colour in &mut self.colours {
            colour.made = vec![Vec::new(); self.drawn_nm.len()];
            for &step in &steps {
                let row = self
                    .chip
                    .drawn_widths(&self.drawn_nm, step, colour.wavelength_um, progress)?;
                colour.made.iter_mut().zip(row).for_each(|(to, t)| to.push(t));
                progress.advance(1);
            }
        }
        Ok(())
    }

    /// What a pillar transmits at one of the colours, drawn at a place of [`Line::drawn_nm`], at a step of density
    /// that was solved for.
    pub fn made(&self, colour: &ColourTransmissions, place: usize, step: i32) -> Complex64 {
        colour.made[place][(step - self.first_step) as usize]
    }
}
