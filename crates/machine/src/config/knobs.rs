//! Knobs of the card as a whole and of memory, and the rules between knobs.

use super::Config;
use crate::class::SortClass;
use mem::{CacheShape, DramConfig, IdealConfig, L2Config, MemoryConfig};
use knob::Allowed;
use unit::warp::MAX_WIDTH;

knob::choices! {
    /// What is behind the units' memory ports.
    pub enum MemoryKind {
        /// Second-level cache and DRAM.
        Dram "dram",
        /// A memory of fixed latency and bandwidth.
        Ideal "ideal",
    }
}

knob::knobs! {
    /// The card as a whole.
    pub struct CardConfig {
        /// Clock of the card, all units included; turns cycles into seconds.
        clock_mhz: u32 ["MHz", Allowed::Range(1, 10000), "1 GHz: a mid-range card of 2014 (GeForce GTX 960: 1,127)"],
        /// What is sorted, and where.
        sort: SortClass ["", Allowed::Choice(SortClass::NAMES), "Molnar et al. 1994; what desktop cards do"],
        /// Pipelines of rasteriser, fragment cores and ROPs, each owning part of the screen.
        pipelines: u32 ["pipelines", Allowed::Range(1, 64), "2 to 6 in mid-range cards since 2010; ATTILA 4"],
        /// Geometry units: clipping, culling and distribution.
        geometry_units: u32 ["units", Allowed::Range(1, 16), "one for each two pipelines"],
        /// Cycles in which units wake and none moves, one after another, after which the run is stopped as stuck. Waiting for a known
        /// cycle is not waking, however long it takes.
        watchdog: u32 ["cycles", Allowed::Range(1000, 1000000000), "none is ever needed: a guard against units that ask for ever"],
    }
}

knob::knobs! {
    /// The units' memory ports, and the ideal memory.
    pub struct MemoryKnobs {
        /// What is behind the ports.
        kind: MemoryKind ["", Allowed::Choice(MemoryKind::NAMES), "the ideal one isolates the units"],
        /// Bytes a cycle that each port takes and gives.
        port_width: u32 ["bytes/cycle", Allowed::Range(8, 4096), "ATTILA bGPU.ini bus widths = 64"],
        /// Cycles from a unit to the crossbar, and from the crossbar back.
        port_latency: u32 ["cycles", Allowed::Range(1, 1024), "an L2 hit takes 200 cycles in cards of 2014, half of them in the network"],
        /// Requests, and answers, under way on each port.
        port_queue: u32 ["requests", Allowed::Range(2, 4096), "more than the latency, so that the port carries its width"],
        /// Latency of the ideal memory.
        ideal_latency: u32 ["cycles", Allowed::Range(1, 65535), "about an unloaded miss"],
        /// Bytes a cycle of the ideal memory.
        ideal_bytes_per_cycle: u32 ["bytes/cycle", Allowed::Range(1, 65536), "far more than DRAM"],
    }
}

knob::knobs! {
    /// The second-level cache, in slices.
    pub struct L2Knobs {
        /// Slices; a multiple of the DRAM channels.
        slices: u32 ["slices", Allowed::Range(1, 64), "one or two a memory channel"],
        /// Bytes that stay together in a slice.
        interleave: u32 ["bytes", Allowed::PowerOfTwo(256, 65536), "ATTILA bGPU.ini V2ChannelInterleavingMask \"10 9 8\": 256"],
        /// Lines of a slice.
        lines: u32 ["lines", Allowed::PowerOfTwo(1, 1048576), "256 KB a slice: 1 MB in all, as the GeForce GTX 960"],
        /// Ways.
        ways: u32 ["ways", Allowed::PowerOfTwo(1, 64), "16 in cards since 2010"],
        /// Bytes of a line.
        line_bytes: u32 ["bytes", Allowed::PowerOfTwo(32, 256), "128 in cards since 2010"],
        /// Bytes of a sector, fetched and written by itself.
        sector_bytes: u32 ["bytes", Allowed::PowerOfTwo(16, 256), "32 in cards since 2010"],
        /// Lines looked up a cycle.
        lookups_per_cycle: u32 ["lines/cycle", Allowed::Range(1, 16), "one port"],
        /// Lines with sectors on their way.
        misses: u32 ["lines", Allowed::Range(1, 4096), "covers the latency of DRAM at full bandwidth"],
        /// Requests waiting for sectors.
        waiting: u32 ["requests", Allowed::Range(1, 4096), "two a missing line"],
        /// Requests between lookup and answer.
        entries: u32 ["requests", Allowed::Range(1, 4096), "two a missing line"],
        /// Bytes a cycle into a slice, and out of it.
        width: u32 ["bytes/cycle", Allowed::Range(8, 4096), "64 a slice (Jia et al. 2018)"],
        /// Cycles from the crossbar to a slice, and back.
        latency: u32 ["cycles", Allowed::Range(1, 1024), "the other half of a hit's 200 cycles"],
    }
}

knob::knobs! {
    /// DRAM. Times are in cycles of its command clock.
    pub struct DramKnobs {
        /// Channels.
        channels: u32 ["channels", Allowed::Range(1, 64), "128 bits of GDDR5 in channels of 32, as the GeForce GTX 960"],
        /// Cycles of the DRAM's command clock in `card_cycles` of the card.
        clock: u32 ["cycles", Allowed::Range(1, 10000), "1.5 GHz: GDDR5 of 6 Gbit/s a pin"],
        /// Cycles of the card in which the DRAM's clock ticks `clock` times.
        card_cycles: u32 ["cycles", Allowed::Range(1, 10000), "see clock"],
        /// Banks of a channel.
        banks: u32 ["banks", Allowed::Range(1, 64), "16 (GDDR5, JESD212)"],
        /// Bytes of a row.
        row_bytes: u32 ["bytes", Allowed::PowerOfTwo(256, 65536), "2 KB (GDDR5); ATTILA bGPU.ini V2MemoryRowSize = 2048"],
        /// Bytes of a burst.
        burst_bytes: u32 ["bytes", Allowed::PowerOfTwo(8, 256), "burst of 8 on 32 bits"],
        /// Cycles of a burst on the data bus.
        burst_cycles: u32 ["DRAM cycles", Allowed::Range(1, 64), "8 beats, 4 a command clock"],
        /// Activation to column access.
        t_rcd: u32 ["DRAM cycles", Allowed::Range(1, 1000), "12 ns (Hynix H5GQ1H24AFR)"],
        /// Precharge to activation.
        t_rp: u32 ["DRAM cycles", Allowed::Range(1, 1000), "12 ns"],
        /// Column read to its data.
        cl: u32 ["DRAM cycles", Allowed::Range(1, 1000), "12 ns"],
        /// Column write to its data.
        cwl: u32 ["DRAM cycles", Allowed::Range(1, 1000), "4 cycles"],
        /// Activation to precharge.
        t_ras: u32 ["DRAM cycles", Allowed::Range(1, 1000), "28 ns"],
        /// Activation to activation of another bank.
        t_rrd: u32 ["DRAM cycles", Allowed::Range(1, 1000), "6 ns"],
        /// A window with at most four activations.
        t_faw: u32 ["DRAM cycles", Allowed::Range(1, 1000), "23 ns"],
        /// Read to precharge.
        t_rtp: u32 ["DRAM cycles", Allowed::Range(1, 1000), "2 cycles"],
        /// End of write data to precharge.
        t_wr: u32 ["DRAM cycles", Allowed::Range(1, 1000), "12 ns"],
        /// End of write data to a read.
        t_wtr: u32 ["DRAM cycles", Allowed::Range(1, 1000), "5 ns"],
        /// End of read data to write data.
        t_rtw: u32 ["DRAM cycles", Allowed::Range(0, 1000), "turn of the bus"],
        /// Length of a refresh.
        t_rfc: u32 ["DRAM cycles", Allowed::Range(0, 10000), "65 ns"],
        /// Refresh to refresh; 0 for none.
        t_refi: u32 ["DRAM cycles", Allowed::Range(0, 1000000), "1.9 us"],
        /// Requests among which the scheduler chooses.
        window: u32 ["requests", Allowed::Range(1, 64), "ATTILA bGPU.ini V2MaxChannelTransactions = 64"],
        /// Writes in the window that make them go first.
        write_high: u32 ["requests", Allowed::Range(1, 64), "three quarters of the window"],
        /// Whether bank numbers are mixed with row bits.
        hash_banks: bool ["", Allowed::Switch, "permutation-based interleaving (Zhang et al. 2000)"],
    }
}

impl Config {
    /// The memory behind the ports.
    ///
    /// # Errors
    /// If its shape is none.
    pub fn memory(&self) -> Result<MemoryConfig, String> {
        let (memory, l2, dram) = (&self.memory, &self.l2, &self.dram);
        if memory.kind == MemoryKind::Ideal {
            let ideal = IdealConfig { latency: memory.ideal_latency, bytes_per_cycle: memory.ideal_bytes_per_cycle };
            return Ok(MemoryConfig::Ideal(ideal));
        }
        Ok(MemoryConfig::Dram {
            slices: l2.slices,
            interleave: l2.interleave,
            l2: L2Config {
                shape: CacheShape::new(l2.lines, l2.ways, l2.line_bytes, l2.sector_bytes)?,
                lookups_per_cycle: l2.lookups_per_cycle,
                misses: l2.misses,
                waiting: l2.waiting,
                entries: l2.entries,
            },
            slice_width: l2.width,
            slice_latency: l2.latency,
            channels: dram.channels,
            dram: DramConfig {
                clock: dram.clock,
                per_card_cycles: dram.card_cycles,
                banks: dram.banks,
                row_bytes: dram.row_bytes,
                burst_bytes: dram.burst_bytes,
                burst: dram.burst_cycles,
                t_rcd: dram.t_rcd,
                t_rp: dram.t_rp,
                cl: dram.cl,
                cwl: dram.cwl,
                t_ras: dram.t_ras,
                t_rrd: dram.t_rrd,
                t_faw: dram.t_faw,
                t_rtp: dram.t_rtp,
                t_wr: dram.t_wr,
                t_wtr: dram.t_wtr,
                t_rtw: dram.t_rtw,
                t_rfc: dram.t_rfc,
                t_refi: dram.t_refi,
                window: dram.window,
                write_high: dram.write_high,
                hash_banks: dram.hash_banks,
            },
        })
    }
}

/// Rules between knobs.
pub(super) fn check(config: &Config) -> Result<(), String> {
    let caches = [
        ("depth", config.depth.cache_blocks, config.depth.cache_ways),
        ("color", config.color.cache_blocks, config.color.cache_ways),
    ];
    for (section, blocks, ways) in caches {
        if ways > blocks {
            return Err(format!(
                "{section}.cache_ways is {ways}, and must be at most {section}.cache_blocks, which is {blocks}"
            ));
        }
    }
    let (lines, ways) = (config.texture.cache_lines, config.texture.cache_ways);
    if lines > ways && !lines.is_multiple_of(ways) {
        return Err(format!("texture.cache_lines is {lines}, and must be a multiple of texture.cache_ways, which is {ways}"));
    }
    if config.color.blends_per_cycle > config.color.quads_per_cycle {
        return Err(format!(
            "color.blends_per_cycle is {}, and must be at most color.quads_per_cycle, which is {}",
            config.color.blends_per_cycle, config.color.quads_per_cycle
        ));
    }
    let class = config.card.sort.class();
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
    if let MemoryConfig::Dram { dram, slices, channels, .. } = memory {
        dram.check().map_err(|message| format!("memory.dram: {message}"))?;
        if slices % channels != 0 {
            return Err(format!(
                "memory.l2.slices is {slices}, and must be a multiple of memory.dram.channels, which is {channels}"
            ));
        }
    }
    Ok(())
}

/// Channels that cannot carry their full width.
pub(super) fn warnings(config: &Config) -> Vec<String> {
    let group = |quads: u32| quads.div_ceil(4).max(1);
    // Key of the queue, its capacity, tokens that it should carry a cycle, latency.
    let channels = [
        ("fetch.queue", config.fetch.queue, 1, config.fetch.latency),
        ("assembly.queue", config.assembly.queue, 1, config.assembly.latency),
        ("clip.queue", config.clip.queue, 1, config.clip.latency),
        (
            "network.receive_queue",
            config.network.receive_queue,
            config.network.link_bytes.div_ceil(unit::token::bytes::TRIANGLE),
            config.network.link_latency,
        ),
        ("setup.queue", config.setup.queue, config.setup.triangles_per_cycle, config.setup.latency),
        ("traverse.queue", config.traverse.queue, group(config.traverse.quads_per_cycle), config.traverse.latency),
        ("traverse.hierarchical_queue", config.traverse.hierarchical_queue, 1, config.traverse.hierarchical_latency),
        ("depth.output_queue", config.depth.output_queue, group(config.depth.quads_per_cycle), config.depth.output_latency),
        ("interpolate.queue", config.interpolate.queue, group(config.interpolate.quads_per_cycle), config.interpolate.latency),
        ("dispatch.queue", config.dispatch.queue, 1, config.dispatch.latency),
        (
            "dispatch.output_queue",
            config.dispatch.output_queue,
            group(config.dispatch.output_quads),
            config.dispatch.output_latency,
        ),
        ("compute.queue", config.compute.queue, 1, config.compute.latency),
        ("memory.port_queue", config.memory.port_queue, 1, config.memory.port_latency),
    ];
    let short = channels.iter().filter(|&&(_, capacity, rate, latency)| capacity < rate * (latency + 1));
    short
        .map(|(key, capacity, rate, latency)| {
            format!(
                "{key} is {capacity}: a channel of latency {latency} that carries {rate} a cycle needs {} places to do so",
                rate * (latency + 1)
            )
        })
        .collect()
}
