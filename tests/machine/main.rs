//! The whole machine: its laws, its images on every sort class, what each skip may and may not change, real cards, estimates of
//! cycles, and what the model's own shortcuts cost.

mod bins;
mod common;
mod culls;
mod display;
mod draw_culls;
mod estimates;
mod front_rates;
mod history;
mod ideal;
mod image;
mod knobs;
mod laws;
mod metamorphic;
mod overlap;
mod rendering_elimination;
mod runs;
mod shortcuts;
mod skips;
mod sort_classes;
mod sort_image;
mod sort_scaling;
mod sort_traces;
mod sprites;
mod unread;
