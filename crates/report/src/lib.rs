//! Reports: one HTML file that needs no network and no script, in light, dark and print.
//!
//! A [`Page`] takes text, [`Table`]s and figures in the order in which they are to be read. Every figure
//! is a small builder that turns into a [`Figure`] (an SVG with title, description and caption):
//!
//! | builder | for |
//! | --- | --- |
//! | [`Chart`] | lines, points with error bars, histograms, bands, limits; linear or log [`Axis`] |
//! | [`Ranking`] | horizontal bars with an interval and a remark each |
//! | [`HeatMap`] | a matrix over two axes, with colour bar; sequential, logarithmic, diverging or cyclic |
//! | [`ImageGrid`] | images on one common scale, such as PSFs designed beside extracted |
//! | [`PhotoRow`] | pictures in colour, side by side |
//! | [`Matrix`] | shares of named rows by named columns, such as what was taken for what |
//! | [`Plan`] | shapes of a layout to scale: circles, rectangles, polygons, crosses |
//! | [`PillarZoom`] | real pillars of a [`PillarMap`](metalith_pillars::PillarMap), to scale |
//!
//! Everything is deterministic: no dates, fixed number formats, palettes of our own that are safe for
//! colour-blind readers. Pass and fail are words, never colour alone. Numbers in a page are rounded for
//! reading; the same numbers in full go to `report.json` beside it, through [`write_json`], under keys
//! that carry their units (`strehl`, `width_rms_nm`).
//!
//! ```
//! use metalith_report::{Axis, Cell, Chart, Column, Page, Table, Verdict};
//!
//! let mut page = Page::new("A lens", "60 um across, F/2.4");
//! page.verdict(Verdict::Pass, "All 2 limits hold.");
//! page.facts(&[("Pillars", "23,080".into()), ("Distinct widths", "94".into())]);
//! page.section("Focus");
//! page.paragraph("Made with `metalith run lens.toml`.");
//! let mut table = Table::new([Column::text("Limit"), Column::number("Reached", "nm"), Column::verdict()]);
//! table.row([Cell::from("rms width error"), Cell::sig(0.4312, 3), Cell::from(Verdict::Pass)]);
//! page.table(table);
//! let mut chart = Chart::new("MTF", Axis::linear("spatial frequency", "1/mm"), Axis::linear("MTF", "").range(0.0, 1.0));
//! chart.line("designed", [(0.0, 1.0), (42.7, 0.61), (85.3, 0.33)]);
//! chart.line("extracted", [(0.0, 1.0), (42.7, 0.60), (85.3, 0.32)]);
//! page.figure(chart.caption("Through the focus, at 550 nm."));
//! let html = page.html();
//! assert!(html.contains("All 2 limits hold."));
//! ```

mod axis;
mod bitmap;
mod chart;
mod colour;
mod figure;
mod heat_map;
mod images;
mod json;
mod matrix;
mod number;
mod page;
mod photo;
mod plan;
mod ranking;
mod raster;
mod table;
mod zoom;

pub use axis::Axis;
pub use chart::Chart;
pub use colour::{ColourMap, SERIES};
pub use figure::Figure;
pub use heat_map::HeatMap;
pub use images::ImageGrid;
pub use json::{effect_words, number_words, write_json, write_plain_json};
pub use matrix::Matrix;
pub use number::{count, counted, exact, fixed, sig};
pub use page::Page;
pub use photo::PhotoRow;
pub use plan::{Plan, PlanLayer};
pub use ranking::Ranking;
pub use table::{Cell, Column, Table, Verdict};
pub use zoom::PillarZoom;
