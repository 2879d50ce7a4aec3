//! All draws as one table.

use std::collections::BTreeSet;

use metalith_core::csv_field;
use metalith_core::document::Scalar;

use crate::merge::StudyResult;

/// One column, with a value for each draw.
pub(crate) struct Column {
    pub name: String,
    pub values: Values,
}

/// Values of a column, in the order of the draws.
pub(crate) enum Values {
    Whole(Vec<u64>),
    /// Numbers; `None` where there is none.
    Number(Vec<Option<f64>>),
    Switch(Vec<bool>),
    Text(Vec<String>),
}

impl Values {
    /// Values of a key of the design: numbers or switches if all are, else texts.
    fn of_key(values: &[&Scalar]) -> Self {
        let numbers: Option<Vec<f64>> = values.iter().map(|v| v.number()).collect();
        let switches: Option<Vec<bool>> = values
            .iter()
            .map(|v| match v {
                Scalar::Switch(on) => Some(*on),
                _ => None,
            })
            .collect();
        match (numbers, switches) {
            (Some(numbers), _) => Self::Number(numbers.into_iter().map(Some).collect()),
            (None, Some(switches)) => Self::Switch(switches),
            (None, None) => Self::Text(values.iter().map(ToString::to_string).collect()),
        }
    }

    /// A value as CSV has it; empty where there is none.
    fn field(&self, row: usize) -> String {
        match self {
            Self::Whole(v) => v[row].to_string(),
            Self::Number(v) => v[row].map_or_else(String::new, |v| v.to_string()),
            Self::Switch(v) => v[row].to_string(),
            Self::Text(v) => csv_field(&v[row]),
        }
    }
}

/// The columns of a study: draw, amounts, figures, what was reached of each limit, whether all of them hold.
pub(crate) fn columns(result: &StudyResult) -> Vec<Column> {
    let draws = &result.draws;
    let column = |name: String, values| Column { name, values };
    let mut columns = vec![column(
        "draw".into(),
        Values::Whole(draws.iter().map(|d| d.draw).collect()),
    )];
    for (q, (name, unit)) in result.plan.quantities.iter().enumerate() {
        let of_design: Option<Vec<&Scalar>> = draws.iter().map(|d| d.design.get(name)).collect();
        let values = match of_design {
            Some(values) if !values.is_empty() => Values::of_key(&values),
            _ => Values::Number(draws.iter().map(|d| Some(d.amounts[q])).collect()),
        };
        let head = match unit.as_str() {
            "" => name.clone(),
            unit => format!("{name}_{}", unit.replace(' ', "_")),
        };
        columns.push(column(head, values));
    }
    // Designs of a grid may have their own figures.
    let figures: BTreeSet<&String> = draws.iter().flat_map(|d| d.figures.keys()).collect();
    for key in figures {
        let values = draws.iter().map(|d| d.figures.get(key).copied().flatten());
        columns.push(column(key.clone(), Values::Number(values.collect())));
    }
    for (k, limit) in result.plan.limits.iter().enumerate() {
        let values = draws.iter().map(|d| d.reached[k]);
        columns.push(column(format!("limit_{}", limit.key), Values::Number(values.collect())));
    }
    columns.push(column(
        "passed".into(),
        Values::Switch(draws.iter().map(|d| d.passed).collect()),
    ));
    columns
}

/// One row for each of so many draws; empty where there is no number.
pub(crate) fn csv(columns: &[Column], draws: usize) -> String {
    let names: Vec<String> = columns.iter().map(|c| csv_field(&c.name)).collect();
    let mut text = names.join(",") + "\n";
    for row in 0..draws {
        let fields: Vec<String> = columns.iter().map(|c| c.values.field(row)).collect();
        text.push_str(&fields.join(","));
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_is_a_column_of_numbers_of_switches_or_of_texts() {
        let of = |values: &[Scalar]| {
            let values = Values::of_key(&values.iter().collect::<Vec<_>>());
            [values.field(0), values.field(1)]
        };
        assert_eq!(of(&[Scalar::Whole(3), Scalar::Number(2.5)]), ["3", "2.5"]);
        assert_eq!(of(&[Scalar::Switch(true), Scalar::Switch(false)]), ["true", "false"]);
        assert_eq!(of(&[Scalar::Text("a,b".into()), Scalar::Whole(1)]), ["\"a,b\"", "1"]);
    }
}
