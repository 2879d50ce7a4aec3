//! How a command reads a layout that is named to it.

use std::path::Path;

use clap::Args;
use metalith::gds::{LayerNumber, ReadLimits};
use metalith::{Design, Layout, Progress, Result};

use super::Terminal;
use super::psf::layer;

/// Options of every command that reads pillars out of a layout of any program.
#[derive(Args, Clone)]
pub(crate) struct ReadingArgs {
    /// Layer and datatype of the pillars. If left out, those of the design, the rules or the set; else 1/0, or if that has no
    /// shapes, the only layer with shapes or with pillars on a lattice.
    #[arg(long, value_name = "LAYER/DATATYPE", value_parser = layer)]
    pub(crate) layer: Option<LayerNumber>,

    #[command(flatten)]
    pub(crate) file: FileArgs,
}

impl ReadingArgs {
    /// Layer of the pillars of a layout, where no other file says it.
    ///
    /// # Errors
    /// As [`Layout::pillar_layer`].
    pub(crate) fn pillar_layer(&self, layout: &Layout, terminal: &Terminal) -> Result<LayerNumber> {
        match self.layer {
            Some(layer) => Ok(layer),
            None => Ok(layout.pillar_layer(terminal)?),
        }
    }

    /// Look for the pillars of a design on the layer that is asked for.
    pub(crate) fn aim(&self, design: &mut Design) {
        if let Some(layer) = self.layer {
            let pillars = &mut design.layout.layers.pillars;
            (pillars.layer, pillars.datatype) = (layer.layer as i16, layer.datatype as i16);
        }
    }

    /// Open a layout, below the cell to start from.
    ///
    /// # Errors
    /// As [`FileArgs::open`].
    pub(crate) fn open(&self, path: &Path, terminal: &Terminal) -> Result<Layout> {
        self.file.open(path, terminal)
    }

    /// Variant of [`Self::open`] for an inventory.
    ///
    /// # Errors
    /// As [`FileArgs::open`].
    pub(crate) fn open_counted(&self, path: &Path, terminal: &Terminal) -> Result<Layout> {
        self.file.open_counted(path, terminal)
    }
}

/// Options of every command that reads a layout of any program.
#[derive(Args, Clone)]
pub(crate) struct FileArgs {
    /// Cell to start from; the top cell if there is only one.
    #[arg(long, value_name = "CELL")]
    pub(crate) top: Option<String>,

    /// Refuse a layout that departs from its format. If left out, records that other programs read with a warning are read
    /// with a warning, which says what was taken.
    #[arg(long)]
    strict: bool,
}

/// A way to open a layout.
type Open = fn(&Path, ReadLimits, &dyn Progress) -> metalith::gds::Result<Layout>;

impl FileArgs {
    /// Read from here on as asked.
    pub(crate) fn apply(&self, terminal: &Terminal) {
        terminal.set_strict(self.strict);
    }

    /// Open a layout, below the cell to start from.
    ///
    /// # Errors
    /// If it cannot be read, or has no such cell.
    pub(crate) fn open(&self, path: &Path, terminal: &Terminal) -> Result<Layout> {
        self.below_top(Layout::open_with, path, terminal)
    }

    /// Variant of [`Self::open`] for an inventory.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub(crate) fn open_counted(&self, path: &Path, terminal: &Terminal) -> Result<Layout> {
        self.below_top(Layout::open_counted, path, terminal)
    }

    fn below_top(&self, open: Open, path: &Path, terminal: &Terminal) -> Result<Layout> {
        self.apply(terminal);
        let layout = open(path, ReadLimits::default(), terminal)?;
        if self.strict {
            layout.no_dangling()?;
        }
        Ok(match &self.top {
            Some(top) => layout.below(top)?,
            None => layout,
        })
    }
}
