//! Estimates of cycles, by the whole frame, by pieces of one, and what the model's own shortcuts cost.

mod draws;
mod estimates;
mod shortcuts;
