//! Where the pillars of a layout are, if not where its design says.

use std::path::{Path, PathBuf};

use metalith::gds::{LayerNumber, ReadLimits};
use metalith::layout::{LayoutFormat, convert};
use metalith::{Design, Error, Layout, Progress, Result};
use tempfile::TempDir;

/// Layer and top cell that are asked for.
pub struct Reading {
    pub layer: Option<(u16, u16)>,
    pub top: Option<String>,
}

/// A layout to read: the file that is named, or a copy of what is below its top cell, which is removed with this.
pub struct Below {
    pub path: PathBuf,
    _copy: Option<TempDir>,
}

impl Reading {
    /// The design, its pillars on the layer that is asked for.
    pub fn design(&self, design: &Design) -> Design {
        let mut design = design.clone();
        if let Some((layer, datatype)) = self.layer {
            let pillars = &mut design.layout.layers.pillars;
            (pillars.layer, pillars.datatype) = (layer as i16, datatype as i16);
        }
        design
    }

    /// The layout below the cell that is asked for.
    ///
    /// # Errors
    /// If it cannot be read or has no such cell, or there is no room for the copy.
    pub fn below(&self, path: &Path, progress: &dyn Progress) -> Result<Below> {
        let Some(top) = &self.top else {
            return Ok(Below {
                path: path.to_owned(),
                _copy: None,
            });
        };
        let layout = Layout::open_with(path, ReadLimits::default(), progress)?.below(top)?;
        let folder = TempDir::new().map_err(Error::io("create a folder in", &std::env::temp_dir()))?;
        let copy = folder.path().join(path.file_name().unwrap_or_default());
        convert(&layout, LayoutFormat::of_name(&copy), &copy, progress)?;
        Ok(Below {
            path: copy,
            _copy: Some(folder),
        })
    }

    /// Layer of the pillars of an open layout, for which there is no design.
    ///
    /// # Errors
    /// As [`Layout::pillar_layer`].
    pub fn pillar_layer(&self, layout: &Layout, progress: &dyn Progress) -> Result<LayerNumber> {
        match self.layer {
            Some((layer, datatype)) => Ok(LayerNumber::new(layer, datatype)),
            None => Ok(layout.pillar_layer(progress)?),
        }
    }
}
