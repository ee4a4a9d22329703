//! Exact-cycle circuits and closed forms for each piece of memory.

mod addresses;
mod caches;
mod client;
mod dram;
mod order;
mod slices;
mod translations;
