//! Fits and tables of the cell.

mod fit;
mod interpolation;
mod table;
