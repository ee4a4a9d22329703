//! Networks in small circuits: sources, a network, sinks. What is expected is worked out from the topology's own formula, not read
//! off the tables that the network is built from.

mod kit;
mod laws;
mod pairs;
mod shapes;
mod shared;
mod throughput;
