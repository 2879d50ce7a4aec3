//! Check that a layout is of its design, made before anything is simulated.

use metalith_core::{Error, Progress, Result};
use metalith_design::array::PillarArray;
use metalith_design::{Design, Element};
use metalith_gds::extract::Extraction;
use metalith_pillars::PillarCheck;
use metalith_report::count;
use serde::{Deserialize, Serialize};

/// Count of the pillars of a design that a layout has.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PillarCount {
    /// Pillars on the sites of elements.
    pub pillars: u64,
    /// Sites where the design has a pillar and the layout none.
    pub missing: u64,
    /// Sites where the layout has a pillar and the design none.
    pub extra: u64,
    /// Pillars that are not as wide, or not turned, as the design draws them.
    pub others: u64,
    /// Shapes on the layer of the pillars that are none of the design's.
    pub foreign: u64,
    /// Reason, in words.
    pub why: String,
}

/// Checks that each element of a design has pillars.
///
/// # Errors
/// If one has none: the layout is of another design.
pub(crate) fn check_elements(design: &Design, extraction: &Extraction) -> Result<()> {
    let all = design.elements();
    let found = all.iter().zip(&extraction.elements);
    let empty: Vec<&Element> = found
        .filter(|(_, found)| found.widths.number.iter().all(|w| *w == 0))
        .map(|(element, _)| element)
        .collect();
    let Some(first) = empty.first() else {
        return Ok(());
    };
    let [x, y] = first.centre_um();
    let others = match empty.len() {
        1 => String::new(),
        n => format!(", and {} more of {} have none", n - 1, all.len()),
    };
    let foreign = &extraction.oddities;
    let where_first = foreign.listed.first().map_or_else(String::new, |oddity| {
        let [x, y] = oddity.centre_nm.map(|nm| nm * 1e-3);
        format!(" ({}), the first about ({x:.1}, {y:.1}) um", foreign.by_why.words())
    });
    Err(Error::refused(
        "layout/element-not-found",
        format!(
            "element {} of `{}` at ({x}, {y}) um has no pillar in this layout{others}: on layer {} stand {} pillars on sites of elements, and {} other shapes{where_first}",
            first.label(),
            design.name,
            design.layout.layers.pillars.number(),
            count(extraction.pillars),
            count(foreign.total())
        ),
        "give the layout of this design, or the design of this layout; `metalith psf LAYOUT` finds the elements of a layout",
    ))
}

impl PillarCount {
    /// Count of the pillars read from a layout.
    ///
    /// # Errors
    /// If the user stopped it.
    pub fn of(design: &Design, extraction: &Extraction, progress: &dyn Progress) -> Result<Self> {
        let array = PillarArray::build(design, progress)?;
        let mut found = Self {
            pillars: extraction.pillars,
            foreign: extraction.oddities.total(),
            why: extraction.oddities.by_why.words(),
            ..Self::default()
        };
        for (placed, element) in array.placed.iter().zip(&extraction.elements) {
            let check = PillarCheck::compare(array.all_rows(placed).as_ref(), &element.widths);
            found.missing += check.missing;
            found.extra += check.extra;
            found.others += check.wrong;
        }
        Ok(found)
    }

    /// Each difference from the design in words, but for pillars of other widths.
    fn differences(&self) -> Vec<String> {
        let (missing, extra) = (count(self.missing), count(self.extra));
        let all = [
            (self.missing, format!("{missing} sites of the design have no pillar")),
            (self.extra, format!("{extra} pillars stand on sites where it has none")),
            (
                self.foreign,
                format!(
                    "{} shapes on their layer are none of its pillars ({}) and are left out",
                    count(self.foreign),
                    self.why
                ),
            ),
        ];
        let some = all.into_iter().filter(|(n, _)| *n > 0);
        some.map(|(_, words)| words).collect()
    }

    /// Words for the count.
    pub fn words(&self) -> String {
        let mut all = vec![format!("{} pillars on the sites of the design", count(self.pillars))];
        all.extend(self.differences());
        if self.others > 0 {
            all.push(format!("{} are drawn otherwise than in the design", count(self.others)));
        }
        all.join("; ")
    }

    /// Note to read before pictures are taken for pictures of the design; `None` for a layout that has its pillars.
    pub fn note(&self) -> Option<String> {
        let mut all = self.differences();
        if 2 * self.others > self.pillars {
            all.push(format!(
                "{} of {} pillars are drawn otherwise, as for a process or for another design",
                count(self.others),
                count(self.pillars)
            ));
        }
        (!all.is_empty()).then(|| format!("the layout is not quite that of the design: {}", all.join("; ")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metalith_core::Silent;
    use metalith_layout::{read_pillars, write_pillars};

    /// The small array, with another diameter of its lenses if one is given.
    fn design(diameter_um: Option<f64>) -> Design {
        let path = std::path::Path::new("../../designs/mini_3x3.toml");
        let mut text = std::fs::read_to_string(path).unwrap();
        if let Some(um) = diameter_um {
            text = text.replacen("diameter_um = 60", &format!("diameter_um = {um}"), 1);
        }
        Design::parse(path, &text).unwrap()
    }

    /// Extraction of the layout of an array of a design, for the small array.
    fn read(written: &Design, change: impl FnOnce(&mut PillarArray)) -> Extraction {
        let mut array = PillarArray::build(written, &Silent).unwrap();
        change(&mut array);
        let folder = tempfile::tempdir().unwrap();
        let layout = folder.path().join("layout.gds");
        write_pillars(written, &array, written.layout.hierarchy, &layout, &Silent).unwrap();
        read_pillars(&design(None), &layout, &Silent).unwrap()
    }

    #[test]
    fn a_layout_of_the_design_has_its_pillars() {
        let design = design(None);
        let read = read(&design, |_| {});
        check_elements(&design, &read).unwrap();
        let found = PillarCount::of(&design, &read, &Silent).unwrap();
        let whole = PillarCount {
            pillars: read.pillars,
            ..PillarCount::default()
        };
        assert!(found == whole && found.note().is_none(), "{found:?}");
        assert!(found.words().ends_with("pillars on the sites of the design"));
    }

    #[test]
    fn pillars_that_are_not_those_of_the_design_are_counted() {
        let design = design(None);
        let designed = PillarArray::build(&design, &Silent).unwrap().pillars();
        // Two rings of sites less on each side.
        let narrow = read(&self::design(Some(58.6)), |_| {});
        check_elements(&design, &narrow).unwrap();
        let found = PillarCount::of(&design, &narrow, &Silent).unwrap();
        assert!(found.missing > 0 && found.extra == 0 && found.foreign == 0, "{found:?}");
        assert_eq!(found.pillars + found.missing, designed);
        assert!(found.note().unwrap().contains("sites of the design have no pillar"));
        // Two more: those beyond the lattice of the design are in no element.
        let wide = read(&self::design(Some(61.4)), |_| {});
        let found = PillarCount::of(&design, &wide, &Silent).unwrap();
        assert!(found.missing == 0 && found.extra > 0 && found.foreign > 0, "{found:?}");
        assert!(found.words().contains("outside every element"), "{}", found.words());
    }

    #[test]
    fn a_layout_without_an_element_is_refused() {
        let design = design(None);
        let last = design.elements().last().unwrap().label();
        let eight = read(&design, |array| {
            array.placed.pop();
        });
        let error = check_elements(&design, &eight).unwrap_err();
        assert_eq!(error.id(), "layout/element-not-found");
        assert!(error.to_string().starts_with(&format!("element {last} of `mini_3x3`")));
        // All of them elsewhere: what was found is said, and where.
        let moved = read(&design, |array| {
            array
                .placed
                .iter_mut()
                .for_each(|placed| placed.element.centre_nm.0 += 1_000_000);
        });
        let error = check_elements(&design, &moved).unwrap_err().to_string();
        for words in ["and 8 more of 9", "outside every element", "the first about ("] {
            assert!(error.contains(words), "{error}");
        }
    }
}
