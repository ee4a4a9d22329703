//! Formats of pixels and their conversions.

pub mod image;
pub mod s3tc;
pub mod transfer;
pub mod unpack;
