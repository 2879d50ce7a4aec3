//! Refusals: what a search cannot do for a cell, each with its place in the file.

use super::{MeritSpec, OptimiseSpec, SolverSpec};
use crate::spec::CellSpec;
use metalith_cell::Fidelity;
use metalith_core::document::Section;
use metalith_pillars::PolarisationBasis;

impl OptimiseSpec {
    /// Dissimilar neighbours are known to the exchange of rings for the field on the axis, of pillars as drawn.
    pub(super) fn check_neighbours(&self, s: &Section<'_, '_>, cell: &CellSpec) {
        if self.fidelity != Fidelity::Neighbours {
            return;
        }
        if let Some((what, _)) = self.fidelity.refusal(cell.shape, cell.lattice) {
            s.fault_given(&["cell.shape", "cell.lattice"], "cell", what, "use the cell `rigorous`");
        }
        let MeritSpec {
            deconvolution,
            side_lobes,
            ..
        } = self.merit;
        for (wrong, what) in [
            (matches!(self.solver, SolverSpec::Adam { .. }), "the solver `adam`"),
            (deconvolution != 0.0, "the merit `deconvolution`"),
            (side_lobes != 0.0, "the merit `side_lobes`"),
            (self.robust.is_some(), "errors of fabrication"),
        ] {
            if wrong {
                s.fault(
                    "cell",
                    format!("{what} with the coupled model"),
                    "use `exchange` for `log` and `sum` without [optimise.robust], or the cell `rigorous`",
                );
            }
        }
    }

    /// Rotated rectangles have one size, and their number does not go on from the last rotation to the first as widths do: a ring
    /// takes one of them, and no slope or error of a width is known.
    pub(super) fn check_rotations(&self, s: &Section<'_, '_>, cell: &CellSpec) {
        if cell.shape.basis() == Some(PolarisationBasis::Linear) {
            s.fault_given(
                &["cell.shape"],
                "cell",
                "a search for one phase, and upright rectangles have a phase for each polarisation",
                "leave [optimise] out, or use squares, circles or rotated rectangles",
            );
            return;
        }
        if cell.shape.has_width() {
            return;
        }
        if matches!(self.fidelity, Fidelity::Fitted | Fidelity::Published) {
            s.fault_given(
                &["cell.shape"],
                "cell",
                format!("rectangular pillars by the `{}` cell", self.fidelity),
                "use the cell `rigorous`",
            );
        }
        if matches!(self.solver, SolverSpec::Adam { .. }) {
            s.fault_given(
                &["cell.shape"],
                "solver",
                "slopes of the number of a rotation, which begins anew after the last one",
                "use `exchange`, which takes one of the rotations for each ring",
            );
        }
        if self.merit.deconvolution != 0.0 {
            s.fault_given(
                &["cell.shape"],
                "merit",
                "the merit `deconvolution` of rotated rectangles: the light that they do not convert is in no image of it",
                "give weights to `log`, `sum` or `side_lobes`",
            );
        }
        if self
            .robust
            .as_ref()
            .is_some_and(|r| r.width_bias_nm != 0.0 || r.height != 0.0)
        {
            s.fault_given(
                &["cell.shape"],
                "robust",
                "errors of the width and height of rotated rectangles",
                "set `width_bias_nm = 0` and `height_percent = 0` in [optimise.robust]: of rectangles the gap alone is drawn; `metalith \
                 study` judges a chip by the others",
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use metalith_core::Error;

    use crate::Design;

    /// Case of a lattice that no tables are made for.
    #[test]
    fn unlike_neighbours_on_a_hexagonal_lattice_are_refused() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../designs/hexagonal_1550.toml");
        let text = std::fs::read_to_string(&path).unwrap();
        let text = text.replacen("[verify]", "[optimise]\ncell = \"neighbours\"\n\n[verify]", 1);
        let error = Design::parse(&path, &text).unwrap_err();
        assert_eq!(error.ids(), ["optimise.cell/inconsistent"]);
        insta::assert_snapshot!(metalith_testing::without_folder(error, path.parent().unwrap()), @"
            hexagonal_1550.toml:62:8: a hexagonal lattice by the `neighbours` cell
              help: use the cell `rigorous`
            ");
    }

    /// Refusals of what the exchange of rings cannot do with the coupled model, each in a separate fault.
    #[test]
    fn what_unlike_neighbours_are_not_known_to_is_refused() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../designs/broadband_3x3.toml");
        let text = std::fs::read_to_string(&path).unwrap();
        let with = |change: &dyn Fn(String) -> String| {
            let text = text.replacen("cell = \"rigorous\"", "cell = \"neighbours\"", 1);
            Design::parse(&path, &change(text)).map(|d| d.optimise.fidelity.name())
        };
        assert_eq!(with(&|text| text).unwrap(), "neighbours");
        let merit =
            |key: &'static str| move |text: String| text.replacen("log = 1.0", &format!("log = 1.0\n{key} = 0.1"), 1);
        let changes: [&dyn Fn(String) -> String; 4] = [
            &merit("deconvolution"),
            &merit("side_lobes"),
            &|text| text + "\n[optimise.robust]\nwidth_bias_nm = 5\n",
            &|text| text.replacen("solver = \"exchange\"", "solver = \"adam\"", 1),
        ];
        let mut said = Vec::new();
        for change in changes {
            let Error::Text(faults) = with(change).unwrap_err() else {
                panic!("a cell that does not fit is a mistake of the text");
            };
            // Keys of the other solver may be mistakes beside it.
            let fault = &faults.faults()[0];
            assert_eq!(fault.id(), "optimise.cell/inconsistent");
            said.push(fault.what.clone());
        }
        // Which of them it is is in the words.
        insta::assert_snapshot!(said.join("\n"), @"
            the merit `deconvolution` with the coupled model
            the merit `side_lobes` with the coupled model
            errors of fabrication with the coupled model
            the solver `adam` with the coupled model
            ");
    }

    /// Settings of a search of cameras that no camera can have.
    #[test]
    fn cameras_that_cannot_be_are_refused() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../designs/imaging_3x3.toml");
        let design = std::fs::read_to_string(&path).unwrap();
        let ids = |change: [&str; 2]| {
            let section = "\n[optimise.camera]\nfield_deg = 80\nmost_track_um = 2400\ncolumns = [2]\nrows = [2]\ndiameters_um = [200]\n";
            match Design::parse(&path, &format!("{design}{}", section.replace(change[0], change[1]))) {
                Ok(_) => Vec::new(),
                Err(error) => error.ids().iter().map(ToString::to_string).collect(),
            }
        };
        assert!(ids(["", ""]).is_empty());
        let wrong = [
            ["rows = [2]", "rows = [2, 3]"],
            ["rows = [2]", "rows = [1.5]"],
            ["columns = [2]\nrows = [2]", "columns = [9]\nrows = [9]"],
            ["diameters_um = [200]", "diameters_um = []"],
            [
                "diameters_um = [200]",
                "diameters_um = [200]\nfocal_lengths_um = [2500]",
            ],
            ["diameters_um = [200]", "diameters_um = [200]\nwedge_shares = [2]"],
            ["field_deg = 80", "field_deg = 180"],
            ["field_deg = 80", "field_deg = 80\nwall = \"yes\""],
        ];
        for change in wrong {
            assert_eq!(ids(change).len(), 1, "{change:?}: {:?}", ids(change));
        }
    }
}
