//! Floor 8: experiments: one question asked of many machines, whose traces are rendered once for all of them.
//!
//! An [`experiment`] is planned ([`plan`]): its machines are numbered, and each is made from its number alone. A shard runs its machines
//! ([`timing`]) and adds each result to a journal as it ends ([`folder`]), so that a sweep that was killed goes on, if its [`inputs`] are the same. When all shards have
//! ended, the [`tables`] and the page ([`report`]) are made from their files alone, in the order of traces and machines: the same bytes
//! for any number of threads, shards and interruptions.

pub mod answer;
pub mod area;
pub mod entry;
pub mod experiment;
pub mod folder;
pub mod html;
pub mod inputs;
pub mod link;
pub mod outcome;
pub mod plan;
pub mod report;
pub mod search;
pub mod table;
pub mod tables;
pub mod timing;
pub mod values;
