//! Least squares on captures: data, nuisances, the fit, and how far a fit can be trusted.

pub mod capture_screening;
pub mod cross_validation;
pub mod defect_noise;
pub mod free_terms;
pub mod normal_equations;
pub mod nuisances;
pub mod null_test;
pub mod problem;
pub mod registration;
