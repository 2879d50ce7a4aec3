//! Names that were changed: an old one is refused, and the new one named.

/// Message on an old name, and its remedy: of keys, of words and of names in tables alike.
pub fn renamed(old: &str, new: &str) -> (String, String) {
    (format!("`{old}` is called `{new}` now"), format!("write `{new}`"))
}
