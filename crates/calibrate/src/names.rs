//! Unknown names, with the nearest known ones.

/// A suggestion differs from what was written by at most this share of its letters.
const FARTHEST: f64 = 0.4;

/// A message on those of `wanted` that are not in `known`, each with the nearest known name; none if all are.
pub fn unknown_names(known: &[String], wanted: &[String]) -> Option<String> {
    let mut unknown: Vec<&String> = Vec::new();
    for name in wanted {
        if !known.contains(name) && !unknown.contains(&name) {
            unknown.push(name);
        }
    }
    if unknown.is_empty() {
        return None;
    }
    let one = |name: &&String| match nearest(known, name) {
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
        let known = ["cd_bias", "gap", "tilt"].map(String::from);
        let wanted = |names: &[&str]| -> Vec<String> { names.iter().map(|n| (*n).into()).collect() };
        assert_eq!(unknown_names(&known, &wanted(&["gap", "tilt"])), None);
        assert_eq!(
            unknown_names(&known, &wanted(&["cd_bais", "gap", "defocus", "cd_bais"])).unwrap(),
            "no effect is called `cd_bais` (did you mean `cd_bias`?), `defocus`"
        );
    }
}
