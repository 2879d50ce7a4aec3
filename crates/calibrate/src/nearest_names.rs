//! Unknown names, with the nearest known ones.

/// A suggestion differs from what was written by at most this share of its letters.
const FARTHEST: f64 = 0.4;

/// Names of effects that were changed: old, new.
pub const RENAMED: [(&str, &str); 2] = [("gap", "defocus"), ("gap_gradient", "defocus_gradient")];

/// A message on those of `wanted` that are not in `known`, each with the nearest known name; none if all are.
pub(crate) fn unknown_names(known: &[String], wanted: &[String]) -> Option<String> {
    let mut unknown: Vec<&String> = Vec::new();
    for name in wanted {
        if !known.contains(name) && !unknown.contains(&name) {
            unknown.push(name);
        }
    }
    if unknown.is_empty() {
        return None;
    }
    let renamed = |name: &str| {
        RENAMED
            .into_iter()
            .find(|(old, new)| *old == name && known.iter().any(|k| k == new))
    };
    let one = |name: &&String| match nearest(known, name) {
        _ if let Some((_, new)) = renamed(name) => format!("`{name}` (it is called `{new}` now)"),
        Some(near) => format!("`{name}` (did you mean `{near}`?)"),
        None => format!("`{name}`"),
    };
    let list: Vec<String> = unknown.iter().map(one).collect();
    Some(format!("no effect is called {}", list.join(", ")))
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
        let wanted = |names: &[&str]| -> Vec<String> { names.iter().map(|n| (*n).into()).collect() };
        assert_eq!(unknown_names(&known, &wanted(&["defocus", "tilt"])), None);
        assert_eq!(
            unknown_names(&known, &wanted(&["cd_bais", "gap", "coma", "cd_bais"])).unwrap(),
            "no effect is called `cd_bais` (did you mean `cd_bias`?), `gap` (it is called `defocus` now), `coma`"
        );
    }
}
