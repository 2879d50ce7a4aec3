//! Solvers: exchange of single rings and of blocks, Adam; where they start and how they are interrupted.

pub(crate) mod adam;
pub(crate) mod blocks;
pub(crate) mod chain;
pub(crate) mod checkpoint;
pub(crate) mod exchange;
pub(crate) mod score;
pub(crate) mod solve;
pub(crate) mod start;
