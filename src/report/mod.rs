//! Floor 7: what people and scripts read: pictures, text, JSON, CSV, comparisons, diagrams, generated pages.

pub mod beside;
pub mod compare;
pub mod counted;
pub mod diagram;
pub mod files;
pub mod folder;
pub mod groups;
pub mod html;
pub mod limits;
pub mod order;
pub mod owned;
pub mod pages;
pub mod peak;
pub mod pixel;
pub mod plots;
pub mod references;
pub mod rows;
pub mod sections;
pub mod shaders;
pub mod state;
pub mod summary;
pub mod terminal;
pub mod timeline;
pub mod verdict;
pub mod waits;
