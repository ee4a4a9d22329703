//! The rules between knobs, and what is allowed but hardly meant.

use super::{Config, MemoryKind};
use crate::class::Sorted;
use mem::{MemoryConfig, PagePolicy};
use unit::fetch::{Reuse, VertexDeal};
use unit::scanout::{ScanoutMode, Swap};
use unit::sorting::{EarlyTest, Keep};
use unit::traverse::Walk;
use unit::warp::MAX_WIDTH;

/// Rules between knobs.
pub(super) fn check(config: &Config) -> Result<(), String> {
    if config.traverse.triangles > 1 && config.traverse.walk != Walk::Blocks {
        return Err(format!(
            "traverse.triangles is {}, and must be 1 where traverse.walk is {}: single pixels are tested of one triangle at a time",
            config.traverse.triangles,
            config.traverse.walk.name()
        ));
    }
    let (lines, ways) = (config.texture.cache_lines, config.texture.cache_ways);
    if lines > ways && !lines.is_multiple_of(ways) {
        return Err(format!("texture.cache_lines is {lines}, and must be a multiple of texture.cache_ways, which is {ways}"));
    }
    if config.tlb.page_bytes > config.tlb.second_page_bytes {
        return Err(format!(
            "memory.tlb.page_bytes is {}, and must be at most memory.tlb.second_page_bytes, which is {}",
            config.tlb.page_bytes, config.tlb.second_page_bytes
        ));
    }
    if config.texture.sector_bytes > config.texture.line_bytes {
        return Err(format!(
            "texture.sector_bytes is {}, and must be at most texture.line_bytes, which is {}",
            config.texture.sector_bytes, config.texture.line_bytes
        ));
    }
    let constant = &config.constant;
    let (bytes, line) = (constant.second_bytes, constant.second_line_bytes);
    let lines = bytes / line;
    if !bytes.is_multiple_of(line) || lines > constant.second_ways && !lines.is_multiple_of(constant.second_ways) {
        return Err(format!(
            "constant.second_bytes is {bytes}, and must be a multiple of constant.second_line_bytes, which is {line}, times \
             constant.second_ways, which is {}, or of the former alone where it has fewer lines",
            constant.second_ways
        ));
    }
    if config.color.blends_per_cycle > config.color.quads_per_cycle {
        return Err(format!(
            "color.blends_per_cycle is {}, and must be at most color.quads_per_cycle, which is {}",
            config.color.blends_per_cycle, config.color.quads_per_cycle
        ));
    }
    let scanout = &config.scanout;
    if scanout.runs_free() {
        if scanout.compressed {
            return Err("scanout.compressed is true, and must be false where scanout.mode is free-running".into());
        }
        if scanout.swap == Swap::Copy && scanout.buffers == 1 {
            return Err(
                "scanout.buffers is 1, and must be at least 2 where scanout.swap is copy: a frame is copied to another".into(),
            );
        }
    }
    if config.fetch.reuse_until == Reuse::Assembled && config.fetch.reuse == 0 {
        return Err(
            "fetch.reuse is 0, and must be at least 1 where fetch.reuse_until is assembled: as many indices are on their way"
                .into(),
        );
    }
    let issue = [("core.issue", config.core.issue), ("core.vertex_issue", config.core.vertex_issue)];
    if let Some((name, issue)) = issue.into_iter().find(|&(_, issue)| issue > 1 && !config.core.overlap) {
        return Err(format!("{name} is {issue}, and must be 1 where core.overlap is false: an instruction keeps all lanes"));
    }
    if config.fetch.deal == VertexDeal::AfterFragments && !config.core.unified {
        return Err(
            "fetch.deal is after-fragments, and core.unified must be true: fragments go to other cores than vertices".into()
        );
    }
    let class = config.card.sort.class();
    let in_turn = [("command.drain", config.command.drain), ("traverse.gather", config.traverse.gather)];
    if let Some((name, _)) = in_turn.iter().find(|(_, on)| *on && (class.sorted != Sorted::Triangles || class.one_place)) {
        return Err(format!(
            "{name} is true, and must be false where sort is {}: only distribution of triangles to rasterisers keeps them in draws",
            config.card.sort.name()
        ));
    }
    if class.sorted.own_geometry() && config.fetch.deal == VertexDeal::AfterFragments {
        return Err(format!(
            "fetch.deal is after-fragments, and must be another where sort is {}: each pipeline shades its own vertices",
            config.card.sort.name()
        ));
    }
    if class.sorted.own_geometry() && config.fetch.reuse_until == Reuse::Assembled {
        return Err(format!(
            "fetch.reuse_until is assembled, and must be replaced where sort is {}: each pipeline gets its primitives in runs",
            config.card.sort.name()
        ));
    }
    if class.sorted.own_geometry() && !config.core.unified && !config.core.vertex_cores.is_multiple_of(config.card.pipelines) {
        return Err(format!(
            "core.vertex_cores is {}, and must be a multiple of pipelines, which is {}, where sort is {}: each pipeline shades its own vertices",
            config.core.vertex_cores,
            config.card.pipelines,
            config.card.sort.name()
        ));
    }
    class.refusals.iter().try_for_each(|refusal| refusal(config))?;
    debug_assert!(config.core.warp_width <= MAX_WIDTH);
    let memory = config.memory().map_err(|message| format!("memory.l2: {message}"))?;
    if let MemoryConfig::Dram { l2, dram } = memory {
        dram.check().map_err(|message| format!("memory.dram: {message}"))?;
        let (slices, channels) = (l2.slices, dram.channels);
        if slices % channels != 0 {
            return Err(format!(
                "memory.l2.slices is {slices}, and must be a multiple of memory.dram.channels, which is {channels}"
            ));
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
