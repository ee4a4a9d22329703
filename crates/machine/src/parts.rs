//! The units that a machine of any sort class can have.

use super::config::Config;
use mem::{Crossbar, Dram, Ideal, L2Slice, ReturnPath};
use sim::One;
use unit::assembly::Assembly;
use unit::bin::Bin;
use unit::card::Card;
use unit::clip::Clip;
use unit::color::Color;
use unit::command::Command;
use unit::compose::Compose;
use unit::compute::Compute;
use unit::constant::Constant;
use unit::core::Core;
use unit::deal::Deal;
use unit::depth::Depth;
use unit::dispatch::Dispatch;
use unit::distribute::Distribute;
use unit::early::Early;
use unit::fetch::Fetch;
use unit::gather::Gather;
use unit::hide::Hide;
use unit::interpolate::Interpolate;
use unit::network::{CreditReturn, Router};
use unit::order::Order;
use unit::resolve::Resolve;
use unit::route::Route;
use unit::scanout::Scanout;
use unit::setup::Setup;
use unit::texture::Texture;
use unit::tile_fetch::TileFetch;
use unit::traverse::Traverse;

/// The part of a pipeline that a bank belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PipelineSection {
    /// Geometry: in front of the network that sorts, and of no pipeline, or in each pipeline, as the sort class says.
    Geometry,
    /// Rasterisation and shading.
    Pixels,
    /// What owns the pixels.
    Rop,
}

/// A bank of one unit.
fn one(_: &Config) -> usize {
    1
}

/// The number of pipelines: the units of a bank with one unit per pipeline.
fn pipelines(config: &Config) -> usize {
    config.card.pipelines as usize
}

/// The number of cores of all pipelines.
fn cores(config: &Config) -> usize {
    pipelines(config) * config.core.per_pipeline as usize
}

/// The number of constant caches: one per core, if the machine has them.
fn constants(config: &Config) -> usize {
    if config.constant.enabled { cores(config) } else { 0 }
}

/// The number of cores for vertices alone.
fn vertex_cores(config: &Config) -> usize {
    if config.core.unified { 0 } else { config.core.vertex_cores as usize }
}

sim::circuit! {
    /// A machine: the units of all sort classes in data-flow order. After `=` stands how many units all classes have of a bank. Of the
    /// others a class has as many as its file says. Each class joins them.
    #[derive(Clone)]
    pub struct Parts for Card, sizes Shape of Config, numbers Ids, banks Banks, stages PipelineSection {
        /// Reads events, hands out draws, keeps passes apart.
        command: One<Command> = one,
        /// Deals batches of primitives to pipelines whose geometry is their own.
        deal: Vec<Deal>,
        /// Finds the bounds of primitives and sends them to the pipelines that own what they touch, where primitives are sorted.
        route: Vec<Route>,
        /// Restores their order there.
        gather: Vec<Gather> [Geometry],
        /// Reads indices, finds vertices to be shaded, fetches attributes.
        fetch: Vec<Fetch> [Geometry],
        /// Vertex cores, where shading is not unified.
        vertex_core: Vec<Core> = vertex_cores,
        /// Their texture units.
        vertex_texture: Vec<Texture> = vertex_cores,
        /// Makes primitives of shaded vertices, hands them to geometry units.
        assembly: Vec<Assembly> [Geometry],
        /// Clips and culls.
        clip: Vec<Clip> [Geometry],
        /// Sends each triangle to the rasterisers that own what it touches.
        distribute: Vec<Distribute> [Geometry],
        /// Sorts triangles into the lists of tiles.
        bin: Vec<Bin>,
        /// Reads the lists of tiles and their triangles, tile by tile.
        tile_fetch: Vec<TileFetch> [Pixels],
        /// Routers of the network that sorts.
        router: Vec<Router>,
        /// Returns the credits of the network that sorts.
        credit_return: Option<CreditReturn>,
        /// Restores API order, sets triangles up.
        setup: Vec<Setup> [Pixels] = pipelines,
        /// Finds blocks and quads, culls by hierarchical Z.
        traverse: Vec<Traverse> [Pixels] = pipelines,
        /// Early depth tests in pipelines that do not own the pixels they draw.
        early: Vec<Early> [Pixels],
        /// Early and late depth and stencil tests.
        depth: Vec<Depth> [Rop] = pipelines,
        /// Holds opaque quads of a tile back until it is known which are seen.
        hide: Vec<Hide> [Pixels],
        /// Interpolates attributes.
        interpolate: Vec<Interpolate> [Pixels] = pipelines,
        /// Packs quads into warps, restores their order after shading.
        dispatch: Vec<Dispatch> [Pixels] = pipelines,
        /// Restores API order at the ROPs, where quads are sorted.
        order: Vec<Order> [Rop],
        /// Makes warps of workgroups.
        compute: One<Compute> = one,
        /// Shader cores of all pipelines.
        core: Vec<Core> [Pixels] = cores,
        /// A texture unit for each core.
        texture: Vec<Texture> [Pixels] = cores,
        /// A constant cache for each core, where the card has them.
        constant: Vec<Constant> [Pixels] = constants,
        /// Blends into colour buffers.
        color: Vec<Color> [Rop] = pipelines,
        /// Composes the frame buffers of pipelines that draw apart from each other.
        compose: Vec<Compose>,
        /// Turns samples into pixels.
        resolve: Vec<Resolve> = pipelines,
        /// Shows frames.
        scanout: One<Scanout> = one,
        /// Carries requests from the units to the slices of the second-level cache.
        crossbar: Option<Crossbar>,
        /// Slices of the second-level cache.
        l2: Vec<L2Slice>,
        /// DRAM channels behind the slices.
        dram: Vec<Dram>,
        /// Carries answers from the slices back to the units.
        return_path: Option<ReturnPath>,
        /// An ideal memory, instead of crossbar, slices, DRAM and return path.
        ideal: Option<Ideal>,
    }
}
