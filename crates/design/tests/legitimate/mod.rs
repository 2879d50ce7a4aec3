//! Reasons for wrong values of which nothing is said before a file is written.

/// Key, factor, and what catches it, or why it is legitimate.
pub const LEGITIMATE: &[(&str, &str, &str)] = &[];
