//! Names of effects as users write them: unknown ones are refused, with the nearest known ones and what would make them known.

use metalith_core::{Error, Result};

/// A suggestion differs from what was written by at most this share of its letters.
const FARTHEST: f64 = 0.4;

/// Names of effects that were changed: old, new.
pub const RENAMED: [(&str, &str); 2] = [("gap", "defocus"), ("gap_gradient", "defocus_gradient")];

/// An effect that is tried only where a set states what it needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ConditionalEffect {
    /// Name, with a `*` for any part of it.
    pub name: &'static str,
    /// Requirement of it in `measurement.toml`, as a clause: "it needs ...".
    pub needs: &'static str,
}

impl ConditionalEffect {
    fn is_called(&self, name: &str) -> bool {
        match self.name.split_once('*') {
            Some((beginning, end)) => name.starts_with(beginning) && name.ends_with(end),
            None => self.name == name,
        }
    }
}

/// Refuse names that no effect of a set has. Effects of the list that this set cannot show are in `conditional`.
///
/// # Errors
/// With all unknown names at once, the nearest known names, what a set lacks for those that are conditional, and the list of
/// known names.
pub fn check_names(known: &[String], conditional: &[ConditionalEffect], wanted: &[String]) -> Result<()> {
    let mut unknown: Vec<&String> = wanted.iter().filter(|name| !known.contains(name)).collect();
    let mut seen = Vec::new();
    unknown.retain(|name| {
        !seen.contains(name) && {
            seen.push(*name);
            true
        }
    });
    if unknown.is_empty() {
        return Ok(());
    }
    let condition = |name: &str| conditional.iter().find(|c| c.is_called(name));
    let (lacking, unknown): (Vec<&String>, Vec<&String>) =
        unknown.into_iter().partition(|name| condition(name).is_some());
    let mut parts = Vec::new();
    if !unknown.is_empty() {
        let list: Vec<String> = unknown.iter().map(|name| described(known, name)).collect();
        parts.push(format!("no effect is called {}", list.join(", ")));
    }
    parts.extend(lacking.iter().filter_map(|name| {
        let needs = condition(name)?.needs;
        Some(format!(
            "this set cannot show `{name}`: it needs {needs} in measurement.toml"
        ))
    }));
    let hint = format!("known effects are {}", known.join(", "));
    Err(Error::refused("effects/unknown", parts.join("; "), hint))
}

/// An unknown name with what it may be meant for.
fn described(known: &[String], name: &str) -> String {
    let renamed = RENAMED
        .into_iter()
        .find(|(old, new)| *old == name && known.iter().any(|k| k == new));
    match nearest(known, name) {
        _ if let Some((_, new)) = renamed => format!("`{name}` (it is called `{new}` now)"),
        Some(near) => format!("`{name}` (did you mean `{near}`?)"),
        None => format!("`{name}`"),
    }
}

/// The known name with the fewest edits to `name`, if it is similar at all.
fn nearest<'a>(known: &'a [String], name: &str) -> Option<&'a str> {
    let near = known.iter().map(|k| (strsim::osa_distance(k, name), k));
    let (edits, best) = near.min_by_key(|(edits, _)| *edits)?;
    (edits as f64 <= FARTHEST * best.chars().count() as f64).then_some(best)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_names_come_all_at_once_with_the_nearest_known_ones() {
        let known = ["cd_bias", "defocus", "tilt"].map(String::from);
        let conditional = [
            ConditionalEffect {
                name: "stitching_x",
                needs: "`field_boundary_um` of `[writer]`",
            },
            ConditionalEffect {
                name: "led_centre_*",
                needs: "an `[[led]]` of this centre",
            },
        ];
        let checked = |names: &[&str]| {
            let wanted: Vec<String> = names.iter().map(|n| (*n).into()).collect();
            check_names(&known, &conditional, &wanted).map_err(|e| e.to_string())
        };
        assert_eq!(checked(&["defocus", "tilt"]), Ok(()));
        let error = checked(&["cd_bais", "gap", "coma", "cd_bais", "stitching_x", "led_centre_600"]).unwrap_err();
        insta::assert_snapshot!(error, @r"
        no effect is called `cd_bais` (did you mean `cd_bias`?), `gap` (it is called `defocus` now), `coma`; this set cannot show `stitching_x`: it needs `field_boundary_um` of `[writer]` in measurement.toml; this set cannot show `led_centre_600`: it needs an `[[led]]` of this centre in measurement.toml
          help: known effects are cd_bias, defocus, tilt
        ");
        insta::assert_snapshot!(checked(&["stitching_x"]).unwrap_err(), @r"
        this set cannot show `stitching_x`: it needs `field_boundary_um` of `[writer]` in measurement.toml
          help: known effects are cd_bias, defocus, tilt
        ");
    }
}
