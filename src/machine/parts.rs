//! The units that a machine of any sort class can have.

use crate::mem::{Crossbar, Dram, Ideal, L2Slice, ReturnPath};
use crate::sim::One;
use crate::unit::assembly::Assembly;
use crate::unit::bin::Bin;
use crate::unit::card::Card;
use crate::unit::clip::Clip;
use crate::unit::color::Color;
use crate::unit::command::Command;
use crate::unit::compose::Compose;
use crate::unit::compute::Compute;
use crate::unit::core::Core;
use crate::unit::deal::Deal;
use crate::unit::depth::Depth;
use crate::unit::dispatch::Dispatch;
use crate::unit::distribute::Distribute;
use crate::unit::early::Early;
use crate::unit::fetch::Fetch;
use crate::unit::gather::Gather;
use crate::unit::hide::Hide;
use crate::unit::interpolate::Interpolate;
use crate::unit::network::{CreditReturn, Router};
use crate::unit::order::Order;
use crate::unit::resolve::Resolve;
use crate::unit::route::Route;
use crate::unit::scanout::Scanout;
use crate::unit::setup::Setup;
use crate::unit::texture::Texture;
use crate::unit::tile_fetch::TileFetch;
use crate::unit::traverse::Traverse;

crate::circuit! {
    /// A machine: the units of all sort classes in data-flow order. A class has of each as many as its file says, and joins them.
    pub struct Parts for Card {
        /// Reads events, hands out draws, keeps passes apart.
        command: One<Command>,
        /// Deals batches of primitives to pipelines whose geometry is their own.
        deal: Vec<Deal>,
        /// Finds the bounds of primitives and sends them to the pipelines that own what they touch, where primitives are sorted.
        route: Vec<Route>,
        /// Restores their order there.
        gather: Vec<Gather>,
        /// Reads indices, finds vertices to be shaded, fetches attributes.
        fetch: Vec<Fetch>,
        /// Vertex cores, where shading is not unified.
        vertex_core: Vec<Core>,
        /// Their texture units.
        vertex_texture: Vec<Texture>,
        /// Makes primitives of shaded vertices, hands them to geometry units.
        assembly: Vec<Assembly>,
        /// Clips and culls.
        clip: Vec<Clip>,
        /// Sends each triangle to the rasterisers that own what it touches.
        distribute: Vec<Distribute>,
        /// Sorts triangles into the lists of tiles,
        bin: Vec<Bin>,
        /// which are read again, tile by tile.
        tile_fetch: Vec<TileFetch>,
        /// Routers of the network that sorts,
        router: Vec<Router>,
        /// and the way back of its credits.
        credit_return: Option<CreditReturn>,
        /// Restores API order, sets triangles up.
        setup: Vec<Setup>,
        /// Finds blocks and quads, culls by hierarchical Z.
        traverse: Vec<Traverse>,
        /// Early depth tests in pipelines that do not own the pixels they draw.
        early: Vec<Early>,
        /// Early and late depth and stencil tests.
        depth: Vec<Depth>,
        /// Holds opaque quads of a tile back until it is known which are seen.
        hide: Vec<Hide>,
        /// Interpolates attributes.
        interpolate: Vec<Interpolate>,
        /// Packs quads into warps, restores their order after shading.
        dispatch: Vec<Dispatch>,
        /// Restores API order at the ROPs, where quads are sorted.
        order: Vec<Order>,
        /// Makes warps of workgroups.
        compute: One<Compute>,
        /// Shader cores of all pipelines.
        core: Vec<Core>,
        /// A texture unit for each core.
        texture: Vec<Texture>,
        /// Blends into colour buffers.
        color: Vec<Color>,
        /// Composes the frame buffers of pipelines that draw apart from each other.
        compose: Vec<Compose>,
        /// Turns samples into pixels.
        resolve: One<Resolve>,
        /// Shows frames.
        scanout: One<Scanout>,
        /// Memory: from the units to the slices of the second-level cache,
        crossbar: Option<Crossbar>,
        /// the slices,
        l2: Vec<L2Slice>,
        /// the DRAM channels behind them,
        dram: Vec<Dram>,
        /// and the way back to the units;
        return_path: Option<ReturnPath>,
        /// or an ideal memory instead of all these.
        ideal: Option<Ideal>,
    }
}
