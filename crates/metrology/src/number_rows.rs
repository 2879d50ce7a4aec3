//! Rows of numbers as instruments export them: separators, decimal commas, quotes, and words for missing values.

use metalith_core::text::table_rows;

/// Words that stand for a missing value.
const MISSING: [&str; 8] = ["", "nan", "na", "n/a", "-", "--", "none", "null"];

/// True if a field holds no value.
pub(crate) fn is_missing(field: &str) -> bool {
    MISSING.iter().any(|word| field.eq_ignore_ascii_case(word))
}

/// A table with commas between its fields and points in its numbers, of one with commas, semicolons or tabs. Quotes around fields are
/// left out; a comma in a name becomes a space.
pub(crate) fn with_commas(text: &str) -> String {
    let head = table_rows(text).next().map_or("", |(_, head)| head);
    let pieces = |c: &char| head.matches(*c).count();
    let separator = ['\t', ';', ','].into_iter().max_by_key(pieces).unwrap_or(',');
    let field = |field: &str| {
        let bare = field.trim().trim_matches('"').trim();
        match number(bare, separator != ',') {
            Some(_) => bare.replace(',', "."),
            None => bare.replace(',', " "),
        }
    };
    let line = |line: &str| {
        if line.trim_start().starts_with('#') {
            return line.to_owned();
        }
        line.split(separator).map(field).collect::<Vec<_>>().join(",")
    };
    text.lines().map(line).collect::<Vec<_>>().join("\n")
}

/// Numbers of a line, between tabs, semicolons, commas or spaces; NaN where a value is missing. None if a field is no number.
pub(crate) fn numbers(line: &str) -> Option<Vec<f64>> {
    let line = line.trim();
    let words: Vec<&str> = line.split_whitespace().collect();
    // A comma beside a space separates; one between digits is a decimal comma where something else separates.
    let by_spaces = words.len() > 1 && !words.iter().any(|w| w.starts_with(',') || w.ends_with(','));
    let (fields, decimal_comma): (Vec<&str>, bool) = if line.contains([';', '\t']) {
        (line.trim_end_matches([';', '\t']).split([';', '\t']).collect(), true)
    } else if by_spaces {
        (words, true)
    } else {
        (line.trim_end_matches(',').split(',').collect(), false)
    };
    let value = |field: &str| {
        let bare = field.trim().trim_matches('"').trim();
        if is_missing(bare) {
            Some(f64::NAN)
        } else {
            number(bare, decimal_comma)
        }
    };
    fields.into_iter().map(value).collect()
}

fn number(field: &str, decimal_comma: bool) -> Option<f64> {
    if decimal_comma {
        field.replace(',', ".").parse().ok()
    } else {
        field.parse().ok()
    }
}

/// Median of values; NaN of none.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Ratio of the standard deviation of normal noise to the median of absolute deviations.
pub(crate) const NORMAL: f64 = 1.4826;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stand_between_any_separators() {
        for line in [
            "420.5,7.25",
            "420.5, 7.25",
            "420,5;7,25",
            "420,5\t7,25",
            "420.5 7.25",
            " 420.5\t7.25\t",
            "\"420.5\",\"7.25\"",
        ] {
            assert_eq!(numbers(line), Some(vec![420.5, 7.25]), "{line}");
        }
        assert!(numbers("420;n/a").unwrap()[1].is_nan());
        assert_eq!(numbers("nm,percent"), None);
    }

    #[test]
    fn tables_are_read_with_any_separator() {
        let expected = "pad,drawn_nm\nA left,120.5";
        for text in [
            "\"pad\";drawn_nm\nA,left;120,5",
            "pad\tdrawn_nm\nA,left\t120.5",
            "pad,drawn_nm\nA left,120.5",
        ] {
            assert_eq!(with_commas(text), expected);
        }
    }
}
