//! Values that were made lately, by their keys.

use std::sync::{Mutex, PoisonError};

/// The values that were asked for last.
pub(super) struct Recent<K, V> {
    most: usize,
    kept: Mutex<Vec<(K, V)>>,
}

impl<K: PartialEq, V: Clone> Recent<K, V> {
    pub(super) fn new(most: usize) -> Self {
        Self {
            most,
            kept: Mutex::default(),
        }
    }

    /// The value of a key: kept, or made. Others who ask wait, since they mostly ask for the same.
    pub(super) fn get(&self, key: K, make: impl FnOnce() -> V) -> V {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let found = match kept.iter().position(|(k, _)| *k == key) {
            Some(at) => kept.remove(at),
            None => (key, make()),
        };
        if kept.len() >= self.most {
            kept.remove(0);
        }
        let value = found.1.clone();
        kept.push(found);
        value
    }
}
