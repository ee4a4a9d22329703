//! Estimates of cycles, and what the model's own shortcuts cost.

mod estimates;
mod shortcuts;
