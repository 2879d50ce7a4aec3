//! The number of a layer.

/// Layer number and datatype (texttype for texts, boxtype for boxes, nodetype for nodes).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
pub struct LayerNumber {
    pub layer: u16,
    pub datatype: u16,
}

impl LayerNumber {
    /// `LayerNumber::new(1, 0)` is written 1/0.
    pub const fn new(layer: u16, datatype: u16) -> Self {
        Self { layer, datatype }
    }
}

impl std::fmt::Display for LayerNumber {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}", self.layer, self.datatype)
    }
}
