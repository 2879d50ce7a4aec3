//! Shares of rows by columns, named on both sides.

use svg::node::element::Group;

use super::figure::{Anchor, Figure, rectangle, text};

/// A table of shares as shaded squares: what was there against what was said, for instance.
#[derive(Clone, Debug)]
pub struct Matrix {
    title: String,
    columns: Vec<String>,
    rows: Vec<(String, Vec<f64>)>,
    across: String,
    down: String,
}

impl Matrix {
    /// A matrix with these columns.
    pub fn new<N: Into<String>>(title: impl Into<String>, columns: impl IntoIterator<Item = N>) -> Self {
        Self {
            title: title.into(),
            columns: columns.into_iter().map(Into::into).collect(),
            rows: Vec::new(),
            across: String::new(),
            down: String::new(),
        }
    }

    /// Meaning of columns and rows.
    #[must_use]
    pub fn axes(mut self, across: impl Into<String>, down: impl Into<String>) -> Self {
        (self.across, self.down) = (across.into(), down.into());
        self
    }

    /// One row of shares from 0 to 1; those that are missing are zero.
    pub fn row(&mut self, name: impl Into<String>, shares: impl IntoIterator<Item = f64>) -> &mut Self {
        let mut shares: Vec<f64> = shares.into_iter().collect();
        shares.resize(self.columns.len(), 0.0);
        self.rows.push((name.into(), shares));
        self
    }
}

impl From<Matrix> for Figure {
    fn from(matrix: Matrix) -> Self {
        const STEP: f64 = 26.0;
        const LETTER: f64 = 6.9;
        let longest =
            |names: &mut dyn Iterator<Item = &String>| names.map(|n| n.chars().count()).max().unwrap_or(0) as f64;
        let left = 26.0 + LETTER * longest(&mut matrix.rows.iter().map(|r| &r.0));
        let top = 34.0 + LETTER * longest(&mut matrix.columns.iter());
        let right = left + STEP * matrix.columns.len() as f64;
        let bottom = top + STEP * matrix.rows.len() as f64;
        let mut drawing = Group::new();
        for (k, name) in matrix.columns.iter().enumerate() {
            let x = left + STEP * (k as f64 + 0.5) + 4.0;
            let turn = format!("rotate(-90 {x:.1} {:.1})", top - 6.0);
            drawing = drawing.add(text(x, top - 6.0, Anchor::Start, name.as_str()).set("transform", turn));
        }
        let mut words = Vec::new();
        for (i, (name, shares)) in matrix.rows.iter().enumerate() {
            let y = top + STEP * i as f64;
            drawing = drawing.add(text(left - 6.0, y + 0.5 * STEP + 4.0, Anchor::End, name.as_str()));
            for (k, &share) in shares.iter().enumerate() {
                let x = left + STEP * k as f64;
                let field = rectangle(x + 1.0, y + 1.0, STEP - 2.0, STEP - 2.0, "f6").set("fill-opacity", "0.12");
                drawing = drawing.add(field);
                if share <= 0.0 {
                    continue;
                }
                let filled = rectangle(x + 1.0, y + 1.0, STEP - 2.0, STEP - 2.0, "f0")
                    .set("fill-opacity", format!("{:.2}", 0.15 + 0.6 * share.min(1.0)));
                let number = format!("{:.0}", 100.0 * share);
                drawing = drawing
                    .add(filled)
                    .add(text(x + 0.5 * STEP, y + 0.5 * STEP + 4.0, Anchor::Middle, number));
                words.push(format!("{name} as {} {:.0} %", matrix.columns[k], 100.0 * share));
            }
        }
        let middle = 0.5 * (left + right);
        drawing = drawing
            .add(text(middle, 14.0, Anchor::Middle, matrix.across.as_str()).set("class", "title"))
            .add(text(left - 6.0, top - 6.0, Anchor::End, matrix.down.as_str()).set("class", "title"));
        Figure::new(right + 12.0, bottom + 10.0, &matrix.title, &words.join("; "), drawing)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_drawn_and_told() {
        let mut matrix = Matrix::new("Taken for what", ["gap", "tilt"]).axes("said", "true");
        matrix.row("gap", [1.0]).row("tilt", [0.25, 0.75]);
        let svg = matrix.caption("").to_svg();
        // What is read aloud of it: a share for each pair that has one.
        let told = svg.split("<desc>").nth(1).and_then(|rest| rest.split("</desc>").next());
        insta::assert_snapshot!(told.unwrap(), @"gap as gap 100 %; tilt as gap 25 %; tilt as tilt 75 %");
    }
}
