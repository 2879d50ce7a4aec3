//! Tables as CSV: a head that names the columns, in any order, then a row in each line, with commas between its fields. Empty lines,
//! comments, which begin with #, and the mark of a byte order do not count.

use crate::text::{printable, quoted, table_rows};

/// Maker of the error for a mistake, from its line and what it is.
type Refuse<'a, E> = &'a dyn Fn(Option<usize>, String) -> E;

/// A row of a table.
pub struct CsvRow<'a, E> {
    /// Line in the file, counted from one.
    pub line: usize,
    /// The row as it stands in the file.
    pub text: &'a str,
    columns: &'a str,
    fields: Vec<&'a str>,
    refuse: Refuse<'a, E>,
}

impl<E> CsvRow<'_, E> {
    /// The field of the column with this place among the wanted ones.
    pub fn field(&self, place: usize) -> &str {
        self.fields[place]
    }

    /// The first `N` of the wanted columns as finite numbers.
    ///
    /// # Errors
    /// With the line and the column of a field that is none.
    pub fn numbers<const N: usize>(&self) -> Result<[f64; N], E> {
        let mut numbers = [0.0; N];
        for ((number, field), column) in numbers.iter_mut().zip(&self.fields).zip(self.columns.split(',')) {
            let found = field.parse().ok().filter(|v: &f64| v.is_finite());
            *number = found.ok_or_else(|| {
                let what = format!("`{}` in column `{column}` is not a finite number", quoted(field));
                self.refused(what)
            })?;
        }
        Ok(numbers)
    }

    /// Error for a mistake in this row.
    pub fn refused(&self, what: impl Into<String>) -> E {
        (self.refuse)(Some(self.line), what.into())
    }
}

/// Beginnings of formulas; a spreadsheet takes the wide forms of East Asian text for the same.
const FORMULA: [char; 8] = ['=', '+', '-', '@', '\u{FF1D}', '\u{FF0B}', '\u{FF0D}', '\u{FF20}'];

/// A text as one field of a row, as RFC 4180 asks: quoted where a comma or a quote would be taken for structure; a line break is
/// written out. A text that a spreadsheet would compute as a formula has an apostrophe before it, which makes it a text there.
pub fn csv_field(text: &str) -> String {
    let shown = printable(text);
    let is_formula = shown.trim_start().starts_with(FORMULA) && shown.parse::<f64>().is_err();
    let apostrophe = if is_formula { "'" } else { "" };
    if shown.contains([',', '"']) {
        format!("\"{apostrophe}{}\"", shown.replace('"', "\"\""))
    } else {
        format!("{apostrophe}{shown}")
    }
}

/// Names of the columns of a table; none of an empty text.
pub fn csv_columns(text: &str) -> Vec<&str> {
    let head = table_rows(text).next();
    head.map_or_else(Vec::new, |(_, head)| fields(head).collect())
}

fn fields(line: &str) -> impl Iterator<Item = &str> {
    line.split(',').map(str::trim)
}

/// Rows of a table that has these columns (`x_um,y_um`) and no others.
///
/// # Errors
/// If the head lacks a column or has another one, with its line; of a row, if it has more or fewer fields than the head.
pub fn csv_rows<'a, E>(
    text: &'a str,
    columns: &'a str,
    refuse: Refuse<'a, E>,
) -> Result<impl Iterator<Item = Result<CsvRow<'a, E>, E>>, E> {
    let mut lines = table_rows(text);
    let (line, head) = lines
        .next()
        .ok_or_else(|| refuse(None, "there is nothing in it".into()))?;
    let names: Vec<&str> = fields(head).collect();
    let known = |(k, name): &(usize, &&str)| columns.split(',').any(|c| c == **name) && !names[..*k].contains(name);
    if let Some((k, name)) = names.iter().enumerate().find(|named| !known(named)) {
        let what = format!(
            "column {}, `{}`, is not known, or stands there twice",
            k + 1,
            quoted(name)
        );
        return Err(refuse(Some(line), what));
    }
    let place = |column: &str| {
        let found = names.iter().position(|name| *name == column);
        found.ok_or_else(|| refuse(Some(line), format!("there is no column `{column}`")))
    };
    let places = columns.split(',').map(place).collect::<Result<Vec<_>, E>>()?;
    Ok(lines.map(move |(line, text)| {
        let all: Vec<&str> = fields(text).collect();
        if all.len() != names.len() {
            let what = format!("{} fields under {} columns: `{}`", all.len(), names.len(), quoted(text));
            return Err(refuse(Some(line), what));
        }
        let fields = places.iter().map(|place| all[*place]).collect();
        Ok(CsvRow {
            line,
            text,
            columns,
            fields,
            refuse,
        })
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<[f64; 2]>, String> {
        let refuse = |line: Option<usize>, what: String| format!("{line:?}: {what}");
        csv_rows(text, "x,y", &refuse)?.map(|row| row?.numbers()).collect()
    }

    #[test]
    fn fields_are_neither_structure_nor_formulas() {
        let fields = [
            "",
            "LENS_1",
            "a, \"b\"",
            "-1.5",
            "+2.50",
            "=1+1",
            " @SUM(A1)",
            "+x,y",
            "\u{ff1d}1+1",
            "a\r\nb",
            "\u{202e}x",
        ]
        .map(csv_field);
        insta::assert_snapshot!(fields.join("\n"), @r#"

        LENS_1
        "a, ""b"""
        -1.5
        +2.50
        '=1+1
        ' @SUM(A1)
        "'+x,y"
        '＝1+1
        a\u{d}\u{a}b
        \u{202e}x
        "#);
    }

    #[test]
    fn columns_are_found_by_their_names() {
        let text = "# a comment\r\n y, x\r\n\r\n1,2\r\n# another\r\n 3 ,-4e1\r\n";
        for mark in ["", "\u{feff}"] {
            assert_eq!(read(&format!("{mark}{text}")).unwrap(), [[2.0, 1.0], [-40.0, 3.0]]);
        }
        assert_eq!(csv_columns(text), ["y", "x"]);
        assert!(csv_columns("# nothing\n").is_empty());
    }

    #[test]
    fn each_mistake_has_its_line_and_column() {
        let texts = [
            "",
            "x\n",
            "x,y,z\n",
            "x,y,x\n",
            "x,y\n1\n",
            "x,y\n\n1,2,3\n",
            "x,y\n1,a\n",
            "y,x\n1,inf\n",
        ];
        let said: Vec<String> = texts.into_iter().map(|text| read(text).unwrap_err()).collect();
        insta::assert_snapshot!(said.join("\n"), @"
        None: there is nothing in it
        Some(1): there is no column `y`
        Some(1): column 3, `z`, is not known, or stands there twice
        Some(1): column 3, `x`, is not known, or stands there twice
        Some(2): 1 fields under 2 columns: `1`
        Some(3): 3 fields under 2 columns: `1,2,3`
        Some(2): `a` in column `y` is not a finite number
        Some(2): `inf` in column `x` is not a finite number
        ");
    }
}
