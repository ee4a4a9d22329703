//! Coverage and interpolation, case by case.

mod common;
mod coverage;
mod numbers;
