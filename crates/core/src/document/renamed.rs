//! Names that were changed: an old one is refused, and the new one named.

/// What is wrong with an old name, and what to do: of keys, of words and of names in tables alike.
pub fn renamed(old: &str, new: &str) -> (String, String) {
    (format!("`{old}` is called `{new}` now"), format!("write `{new}`"))
}
