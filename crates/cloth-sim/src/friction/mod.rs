//! Friction as scenes and scripts say it: a law by name with its parameters, and published coefficients of pairs.

pub mod pairs;
mod table;

pub use table::{FrictionTable, LawName, TableError};
