//! The rules between knobs, and what is allowed but hardly meant.

use std::fmt::Display;

use super::{Config, MemoryKind};
use crate::class::{BuildError, SortClass, Sorted};
use mem::{DramError, MemoryConfig, PagePolicy, ShapeError};
use unit::fetch::{Reuse, VertexDeal};
use unit::scanout::{ScanoutMode, Swap};
use unit::sorting::{EarlyTest, Keep};
use unit::traverse::Walk;
use unit::warp::MAX_WIDTH;

/// A rule between knobs that a configuration breaks.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the message explains each variant")]
pub enum Rule {
    #[error("{knob} is {value}, and must be {must}")]
    Must { knob: &'static str, value: String, must: String },
    #[error("order.keep is {}, which a machine whose sort is {} does not do", .keep.name(), .sort.name())]
    Order { keep: Keep, sort: SortClass },
    #[error("fetch.deal is after-fragments, and core.unified must be true: fragments go to other cores than vertices")]
    NotUnified,
    #[error("memory.l2: {0}")]
    Slice(#[from] ShapeError),
    #[error("memory.dram: {0}")]
    Channel(#[from] DramError),
    #[error(transparent)]
    Build(#[from] BuildError),
}

impl Rule {
    /// A knob that must have another value.
    pub(crate) fn must(knob: &'static str, value: impl Display, must: impl Into<String>) -> Rule {
        Rule::Must { knob, value: value.to_string(), must: must.into() }
    }
}

/// Rules between knobs.
pub(super) fn check(config: &Config) -> Result<(), Rule> {
    if config.traverse.triangles > 1 && config.traverse.walk != Walk::Blocks {
        let walk = config.traverse.walk.name();
        let must = format!("1 where traverse.walk is {walk}: single pixels are tested of one triangle at a time");
        return Err(Rule::must("traverse.triangles", config.traverse.triangles, must));
    }
    let (lines, ways) = (config.texture.cache_lines, config.texture.cache_ways);
    if lines > ways && !lines.is_multiple_of(ways) {
        return Err(Rule::must("texture.cache_lines", lines, format!("a multiple of texture.cache_ways, which is {ways}")));
    }
    if config.tlb.page_bytes > config.tlb.second_page_bytes {
        let must = format!("at most memory.tlb.second_page_bytes, which is {}", config.tlb.second_page_bytes);
        return Err(Rule::must("memory.tlb.page_bytes", config.tlb.page_bytes, must));
    }
    if config.texture.sector_bytes > config.texture.line_bytes {
        let must = format!("at most texture.line_bytes, which is {}", config.texture.line_bytes);
        return Err(Rule::must("texture.sector_bytes", config.texture.sector_bytes, must));
    }
    let constant = &config.constant;
    let (bytes, line) = (constant.second_bytes, constant.second_line_bytes);
    let lines = bytes / line;
    if !bytes.is_multiple_of(line) || lines > constant.second_ways && !lines.is_multiple_of(constant.second_ways) {
        let must = format!(
            "a multiple of constant.second_line_bytes, which is {line}, times constant.second_ways, which is {}, or of the former alone \
             where it has fewer lines",
            constant.second_ways
        );
        return Err(Rule::must("constant.second_bytes", bytes, must));
    }
    if config.color.blends_per_cycle > config.color.quads_per_cycle {
        let must = format!("at most color.quads_per_cycle, which is {}", config.color.quads_per_cycle);
        return Err(Rule::must("color.blends_per_cycle", config.color.blends_per_cycle, must));
    }
    let scanout = &config.scanout;
    if scanout.runs_free() {
        if scanout.compressed {
            return Err(Rule::must("scanout.compressed", true, "false where scanout.mode is free-running"));
        }
        if scanout.swap == Swap::Copy && scanout.buffers == 1 {
            let must = "at least 2 where scanout.swap is copy: a frame is copied to another";
            return Err(Rule::must("scanout.buffers", 1, must));
        }
    }
    if config.fetch.reuse_until == Reuse::Assembled && config.fetch.reuse == 0 {
        let must = "at least 1 where fetch.reuse_until is assembled: as many indices are on their way";
        return Err(Rule::must("fetch.reuse", 0, must));
    }
    let issue = [("core.issue", config.core.issue), ("core.vertex_issue", config.core.vertex_issue)];
    if let Some((name, issue)) = issue.into_iter().find(|&(_, issue)| issue > 1 && !config.core.overlap) {
        return Err(Rule::must(name, issue, "1 where core.overlap is false: an instruction keeps all lanes"));
    }
    if config.fetch.deal == VertexDeal::AfterFragments && !config.core.unified {
        return Err(Rule::NotUnified);
    }
    let (sort, class) = (config.card.sort.name(), config.card.sort.class());
    let in_turn = [("command.drain", config.command.drain), ("traverse.gather", config.traverse.gather)];
    if let Some((name, _)) = in_turn.iter().find(|(_, on)| *on && (class.sorted != Sorted::Triangles || class.one_place)) {
        let must = format!("false where sort is {sort}: only distribution of triangles to rasterisers keeps them in draws");
        return Err(Rule::must(name, true, must));
    }
    if class.sorted.own_geometry() && config.fetch.deal == VertexDeal::AfterFragments {
        let must = format!("another where sort is {sort}: each pipeline shades its own vertices");
        return Err(Rule::must("fetch.deal", "after-fragments", must));
    }
    if class.sorted.own_geometry() && config.fetch.reuse_until == Reuse::Assembled {
        let must = format!("replaced where sort is {sort}: each pipeline gets its primitives in runs");
        return Err(Rule::must("fetch.reuse_until", "assembled", must));
    }
    if class.sorted.own_geometry() && !config.core.unified && !config.core.vertex_cores.is_multiple_of(config.card.pipelines) {
        let pipelines = config.card.pipelines;
        let must = format!(
            "a multiple of pipelines, which is {pipelines}, where sort is {sort}: each pipeline shades its own vertices"
        );
        return Err(Rule::must("core.vertex_cores", config.core.vertex_cores, must));
    }
    class.refusals.iter().try_for_each(|refusal| refusal(config))?;
    debug_assert!(config.core.warp_width <= MAX_WIDTH);
    let memory = config.memory()?;
    if let MemoryConfig::Dram { l2, dram } = memory {
        dram.check()?;
        let (slices, channels) = (l2.slices, dram.channels);
        if slices % channels != 0 {
            let must = format!("a multiple of memory.dram.channels, which is {channels}");
            return Err(Rule::must("memory.l2.slices", slices, must));
        }
    }
    Ok(())
}

/// A channel by the field of its queue: the queue's key, its capacity, the tokens that the channel should carry per cycle, its latency.
macro_rules! channel {
    ($config:ident.$section:ident.$queue:ident, $rate:expr, $latency:expr) => {
        (concat!(stringify!($section), ".", stringify!($queue)), $config.$section.$queue, $rate, $latency)
    };
}

/// Channels that cannot carry their full width.
pub(super) fn warnings(config: &Config) -> Vec<String> {
    let group = |quads: u32| quads.div_ceil(4).max(1);
    let channels = [
        channel!(config.fetch.queue, 1, config.fetch.latency),
        channel!(config.assembly.queue, config.assembly.primitives_per_cycle.div_ceil(2), config.assembly.latency),
        channel!(config.clip.queue, 2, config.clip.latency),
        channel!(
            config.network.receive_queue,
            config.network.link_bytes.div_ceil(unit::token::bytes::TRIANGLE),
            config.network.link_latency
        ),
        channel!(config.setup.queue, config.setup.triangles_per_cycle, config.setup.latency),
        channel!(
            config.traverse.queue,
            group(config.traverse.quads_per_cycle.max(config.traverse.depth_quads_per_cycle)),
            config.traverse.latency
        ),
        channel!(config.traverse.hierarchical_queue, 1, config.traverse.hierarchical_latency),
        channel!(config.depth.output_queue, group(config.depth.quads_per_cycle), config.depth.output_latency),
        channel!(config.interpolate.queue, group(config.interpolate.quads_per_cycle), config.interpolate.latency),
        channel!(config.dispatch.queue, 1, config.dispatch.latency),
        channel!(config.dispatch.output_queue, group(config.dispatch.output_quads), config.dispatch.output_latency),
        channel!(config.compute.queue, 1, config.compute.latency),
        channel!(config.memory.port_queue, 1, config.memory.port_latency.max(config.memory.rop_latency)),
    ];
    let short = channels.iter().filter(|&&(_, capacity, rate, latency)| capacity < rate * (latency + 1));
    let short = short.map(|(key, capacity, rate, latency)| {
        format!(
            "{key} is {capacity}: a channel of latency {latency} that carries {rate} a cycle needs {} places to do so",
            rate * (latency + 1)
        )
    });
    short.chain(without_effect(config)).collect()
}

/// Why no two passes overlap on this machine, whatever `command.overlap` is; none: they may.
pub(super) fn no_overlap(config: &Config) -> Option<String> {
    let sort = config.card.sort;
    let class = sort.class();
    if class.one_place || class.sorted == Sorted::Images {
        return Some(format!("a machine whose sort is {} draws or composes one pass at a time", sort.name()));
    }
    if config.order.keep != Keep::Always {
        return Some(format!("order.keep is {}, and quads of two passes would mix", config.order.keep.name()));
    }
    if config.order.early != EarlyTest::None {
        return Some(format!("order.early is {}, and owners answer for one pass", config.order.early.name()));
    }
    let pattern = config.distribute.pattern;
    pattern.is_of_pass().then(|| format!("distribute.pattern is {}, which parts each pass by its size", pattern.name()))
}

/// Why a knob has no effect on this machine, whatever its value; none: it may have one.
pub(super) fn no_effect(config: &Config, path: &str) -> Option<String> {
    let sort = config.card.sort;
    let class = sort.class();
    let (section, name) = path.rsplit_once('.').unwrap_or(("", path));
    let display = ["line_cycles", "blank_lines", "buffers", "swap", "show_last", "fifo"];
    let without = |what: &str| Some(format!("a machine whose sort is {} {what}", sort.name()));
    match section {
        "" if name == "geometry_units" && class.sorted != Sorted::Triangles => {
            without("has the geometry units of its pipelines")
        }
        "command" if name == "overlap" => no_overlap(config),
        "bin" if !class.one_place => without("has no bins"),
        "fetch" if name == "batch_indices" && config.fetch.reuse_until != Reuse::Batch => {
            Some(format!("fetch.reuse_until is {}", config.fetch.reuse_until.name()))
        }
        "constant" if name != "enabled" && !config.constant.enabled => Some("constant.enabled is false".to_owned()),
        "compose" if class.sorted != Sorted::Images => without("composes no frame buffers"),
        "route" if class.sorted != Sorted::Primitives => without("routes no primitives"),
        "order" if name.starts_with("early_") && config.order.early == EarlyTest::None => {
            Some("order.early is none".to_owned())
        }
        "memory.l2" | "memory.dram" | "memory.tlb" if config.memory.kind == MemoryKind::Ideal => {
            Some("memory.kind is ideal".to_owned())
        }
        "memory.tlb" if name != "entries" && config.tlb.entries == 0 => Some("memory.tlb.entries is 0".to_owned()),
        "memory.dram" if name == "page_idle" && config.dram.page != PagePolicy::Idle => {
            Some(format!("memory.dram.page is {}", config.dram.page.name()))
        }
        "memory.dram" if name == "t_ccd_l" && config.dram.bank_groups == 1 => Some("memory.dram.bank_groups is 1".to_owned()),
        "memory" if name.starts_with("ideal_") && config.memory.kind != MemoryKind::Ideal => {
            Some(format!("memory.kind is {}", config.memory.kind.name()))
        }
        "traverse" if name.starts_with("hierarchical_") && name != "hierarchical_z" && !config.traverse.hierarchical_z => {
            Some("traverse.hierarchical_z is false".to_owned())
        }
        "core" if name.starts_with("vertex_") && config.core.unified => Some("core.unified is true".to_owned()),
        "scanout" if name != "enabled" && !config.scanout.enabled => Some("scanout.enabled is false".to_owned()),
        "scanout" if display.contains(&name) && config.scanout.mode != ScanoutMode::FreeRunning => {
            Some(format!("scanout.mode is {}", config.scanout.mode.name()))
        }
        _ => None,
    }
}

/// Knobs that another one switches off.
fn without_effect(config: &Config) -> Vec<String> {
    let mut out = Vec::new();
    if !config.depth.early && config.traverse.hierarchical_z {
        out.push("depth.early=false also switches hierarchical Z off: nothing is rejected before shading".to_owned());
    }
    if config.bin.hide && !config.card.sort.class().one_place {
        out.push("bin.hide has no effect: only sort-middle-binned has bins".to_owned());
    }
    if config.color.masked_writes && !config.color.skip_reads {
        out.push("color.masked_writes has no effect: color.skip_reads is false, and every block is read".to_owned());
    }
    out
}
