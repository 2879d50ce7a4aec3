//! A table of keys as a JSON schema.

use metalith_core::document::{Forms, Key, KeyTable, OtherKeys, Scalar};
use serde_json::{Map, Value, json};

use super::guide::Guide;

/// Numbers of this size and beyond are no limits.
const NO_LIMIT: f64 = 1e300;

/// Schema of the section at a path.
pub(super) fn of_table(table: &KeyTable, section: &str, guide: &Guide) -> Value {
    let mut properties = Map::new();
    for (name, key) in table.keys() {
        properties.insert(name.to_owned(), of_key(key, section, name, guide));
    }
    let required: Vec<&str> = table
        .keys()
        .map(|(name, _)| name)
        .filter(|name| table.requires(name))
        .collect();
    let others = match (table.others(), table.key(KeyTable::OF_THE_USER)) {
        (OtherKeys::Refused, _) => json!(false),
        (OtherKeys::Named, Some(key)) => of_key(key, section, KeyTable::OF_THE_USER, guide),
        (OtherKeys::Named, None) | (OtherKeys::Ignored, _) => json!(true),
    };
    let mut schema = json!({ "type": "object", "properties": properties, "additionalProperties": others });
    if !required.is_empty() {
        schema["required"] = required.into();
    }
    schema
}

fn of_key(key: &Key, section: &str, name: &str, guide: &Guide) -> Value {
    let path = match section {
        "" => name.to_owned(),
        _ => format!("{section}.{name}"),
    };
    let mut schema = of_forms(&key.forms, &|| of_table(&key.table, &path, guide));
    if let Some(row) = guide.row(section, name) {
        schema["title"] = row.meaning.clone().into();
        schema["description"] = row.description().into();
    }
    if let [unit] = key.forms.units_of_items() {
        schema["x-unit"] = (*unit).into();
    }
    match key.default() {
        Some(Scalar::Number(v)) if v.abs() < NO_LIMIT => schema["default"] = number(*v),
        Some(Scalar::Whole(v)) => schema["default"] = (*v).into(),
        Some(Scalar::Text(v)) => schema["default"] = v.as_str().into(),
        Some(Scalar::Switch(v)) => schema["default"] = (*v).into(),
        Some(Scalar::Number(_)) | None => {}
    }
    schema
}

/// Schema of a value of these forms; `table` is the one of a section.
fn of_forms(forms: &Forms, table: &dyn Fn() -> Value) -> Value {
    let mut any: Vec<Value> = Vec::new();
    if forms.text {
        any.push(json!({ "type": "string" }));
    } else if !forms.words.is_empty() {
        any.push(json!({ "type": "string", "enum": forms.words }));
    }
    if let Some(range) = forms.number {
        any.push(of_number(range));
    } else if let Some([low, high]) = forms.integer {
        any.push(of_integer(low, high));
    }
    if forms.switch {
        any.push(json!({ "type": "boolean" }));
    }
    if let Some(list) = &forms.list {
        let mut schema = json!({ "type": "array", "items": of_forms(&list.items, &|| json!({})) });
        if let Some(length) = list.length {
            schema["minItems"] = length.into();
            schema["maxItems"] = length.into();
        }
        any.push(schema);
    }
    if forms.section {
        any.push(table());
    }
    if forms.sections {
        any.push(json!({ "type": "array", "items": table() }));
    }
    match any.len() {
        0 => json!({}),
        1 => any.remove(0),
        _ => json!({ "anyOf": any }),
    }
}

fn of_number([low, high]: [f64; 2]) -> Value {
    let mut schema = json!({ "type": "number" });
    if low == f64::MIN_POSITIVE {
        schema["exclusiveMinimum"] = 0.into();
    } else if low > -NO_LIMIT {
        schema["minimum"] = number(low);
    }
    if high < NO_LIMIT {
        schema["maximum"] = number(high);
    }
    schema
}

fn of_integer(low: i64, high: i64) -> Value {
    if low == high {
        return json!({ "const": low });
    }
    let mut schema = json!({ "type": "integer" });
    if low > i64::MIN {
        schema["minimum"] = low.into();
    }
    if high < i64::MAX {
        schema["maximum"] = high.into();
    }
    schema
}

/// A whole number without a decimal point.
fn number(value: f64) -> Value {
    /// Whole numbers up to it are exact.
    const EXACT: f64 = 9e15;
    if value.fract() == 0.0 && value.abs() < EXACT {
        (value as i64).into()
    } else {
        value.into()
    }
}
