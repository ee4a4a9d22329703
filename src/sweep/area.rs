//! An area model: a relative measure of the size of machines, in bytes of SRAM.
//!
//! Stores count their bytes. Arithmetic counts the bytes of SRAM that would take its area. Both follow from the configuration and from the
//! machine that is built of it: its units and channels. Wires, clocks, pads, analogue parts and DRAM are left out, and no synthesis
//! confirms the sum. So the model compares machines of one experiment, and is no prediction of square millimetres.

use std::collections::HashMap;
use std::fmt::Write;

use crate::machine::{Config, ConfigError, Machine};
use crate::report::summary::grouped;

/// The area of something, in bytes of SRAM.
#[derive(Clone, Copy, Debug)]
struct Constant {
    what: &'static str,
    bytes: f64,
    source: &'static str,
}

/// Square micrometres of a byte of SRAM: eight cells, in arrays of which cells take one half.
const BYTE: f64 = 8.0 * 0.242 * 2.0;

const fn constant(what: &'static str, bytes: f64, source: &'static str) -> Constant {
    Constant { what, bytes, source }
}

const SUM: Constant =
    constant("sum or comparison of two 32-bit integers", 137.0 / BYTE, "137 um2 at 45 nm (Horowitz 2014, Dally 2015)");
const PRODUCT: Constant = constant("product of two 32-bit integers", 3495.0 / BYTE, "3,495 um2 at 45 nm (Dally 2015)");
const FLOAT: Constant = constant(
    "product of two 32-bit floating-point numbers with a sum",
    (7700.0 + 4184.0) / BYTE,
    "7,700 and 4,184 um2 at 45 nm (Dally 2015)",
);
const INTEGER: Constant =
    constant("integer lane", 5.0 * 137.0 / BYTE, "assumed: an adder, a shifter and logic, together five adders");
const BILINEAR: Constant = constant(
    "bilinear filter operation",
    12.0 * (282.0 + 67.0) / BYTE,
    "assumed: of each of four components three 8-bit products with 16-bit sums, of 282 and 67 um2 (Dally 2015)",
);
const BLEND: Constant = constant(
    "quad blended per cycle",
    16.0 * (2.0 * 282.0 + 36.0) / BYTE,
    "assumed: of each of 16 components two 8-bit products and a sum, of 282 and 36 um2 (Dally 2015)",
);
const TAG: Constant =
    constant("tag of a line of a cache", 4.0, "assumed: an address of 40 bits less those of line and set, and state");
const PORT: Constant = constant(
    "further lookup per cycle, of each byte of a cache",
    0.125,
    "assumed: caches have banks, which a small crossbar joins",
);
const TOKEN: Constant = constant("item of a channel, a request, an entry of a list", 16.0, "the size of a token");
const QUAD: Constant = constant("quad or group of quads in a FIFO", 64.0, "assumed: four invocations of four words");
const WARP: Constant = constant("warp that a core holds", 64.0, "assumed: program counter, masks, scoreboard");
const STATE: Constant = constant("state of draws in flight", 1024.0, "assumed: 256 registers of 32 bits");
const CROSSPOINT: Constant =
    constant("byte per cycle of each pair of ends of the crossbar", 2.0, "assumed: a multiplexer of 8 bits, of 1 um2 each");

/// All of them, in the order of the page.
const CONSTANTS: [Constant; 13] =
    [SUM, PRODUCT, FLOAT, INTEGER, BILINEAR, BLEND, TAG, PORT, TOKEN, QUAD, WARP, STATE, CROSSPOINT];

/// The area of the units of one bank, or of all channels.
#[derive(Clone, Debug, PartialEq)]
pub struct AreaPart {
    /// What the bank is called.
    pub name: &'static str,
    /// Its units.
    pub count: usize,
    /// Bytes of its stores.
    pub stores: f64,
    /// Bytes of SRAM with the area of its arithmetic.
    pub arithmetic: f64,
}

/// The area of a cache.
fn cache(lines: u32, line_bytes: u32, lookups: u32) -> f64 {
    let banks = 1.0 + PORT.bytes * f64::from(lookups.max(1) - 1);
    f64::from(lines) * (f64::from(line_bytes) * banks + TAG.bytes)
}

/// Stores and arithmetic of one unit of a bank.
fn unit(name: &str, config: &Config) -> (f64, f64) {
    let f = f64::from;
    let (tokens, quads) = (|entries: u32| f(entries) * TOKEN.bytes, |entries: u32| f(entries) * QUAD.bytes);
    let lines = |blocks: u32| cache(blocks, 256, 1);
    match name {
        "command" => {
            let own = &config.command;
            (tokens(own.segments) + f(own.states) * STATE.bytes + tokens(own.copy_misses), 0.0)
        }
        "route" => {
            let own = &config.route;
            let stores = cache(own.cache_lines, 64, 1) + tokens(own.fifo + own.reuse + own.misses);
            (stores, 16.0 * f(own.vertices_per_cycle) * FLOAT.bytes)
        }
        "fetch" => {
            let own = &config.fetch;
            let stores = cache(own.cache_lines, own.line_bytes, own.lookups_per_cycle) + cache(own.index_lines, 64, 1);
            (stores + tokens(own.reuse + own.runs + own.batches + own.announced + own.misses), 0.0)
        }
        "clip" => (0.0, 18.0 * f(config.clip.primitives_per_cycle) / f(config.clip.interval) * SUM.bytes),
        "bin" => (tokens(config.bin.segments), 0.0),
        "tile_fetch" => {
            let own = &config.bin;
            let tile = f(own.tile) * f(own.tile) * 8.0;
            (cache(own.cache_lines, 64, 1) + quads(own.fifo) + tokens(own.misses) + tile, 0.0)
        }
        "hide" => (quads((config.bin.tile / 2).pow(2)), 0.0),
        "setup" => (0.0, 30.0 * f(config.setup.triangles_per_cycle) / f(config.setup.interval) * FLOAT.bytes),
        "traverse" => {
            let own = &config.traverse;
            let tests = f(own.tests_per_cycle) + 64.0 * f(own.blocks_per_cycle);
            (f(own.hierarchical_lines) * 64.0, 3.0 * tests * SUM.bytes)
        }
        "early" => (quads(config.order.early_queue), 0.0),
        "depth" => {
            let own = &config.depth;
            let stores = lines(own.cache_blocks) + 2.0 * quads(own.fifo) + tokens(own.misses);
            (stores, 4.0 * f(own.quads_per_cycle) * SUM.bytes)
        }
        "interpolate" => {
            let own = &config.interpolate;
            let words = 4.0 * f(own.quads_per_cycle) * f(own.words_per_cycle) / f(own.interval);
            (0.0, 2.0 * words * FLOAT.bytes)
        }
        "dispatch" => (16.0 * f(config.core.warp_width) * f(config.dispatch.reorder), 0.0),
        "core" | "vertex_core" => {
            let own = &config.core;
            let warps = if name == "core" { own.warps } else { own.vertex_warps };
            let stores = 4.0 * f(own.registers) + f(own.shared_bytes) + f(warps) * WARP.bytes;
            let float = (f(own.float_lanes) + f(own.special_lanes)) * FLOAT.bytes;
            let integer = f(own.integer_lanes) * INTEGER.bytes + f(own.multiply_lanes) * (PRODUCT.bytes + SUM.bytes);
            (stores, float + integer + f(own.control_lanes) * SUM.bytes)
        }
        "texture" | "vertex_texture" => {
            let own = &config.texture;
            let stores = cache(own.cache_lines, own.line_bytes, own.lookups_per_cycle) + quads(own.fifo) + tokens(own.misses);
            (stores, f(own.filters_per_cycle) * BILINEAR.bytes + 8.0 * f(own.quads_per_cycle) * FLOAT.bytes)
        }
        "constant" => {
            let own = &config.constant;
            let level = |bytes: u32, line: u32| cache(bytes / line.max(1), line, 1);
            let stores = level(own.bytes, own.line_bytes) + level(own.second_bytes, own.second_line_bytes);
            (stores + tokens(own.misses + own.fifo), 0.0)
        }
        "color" => {
            let own = &config.color;
            let stores = lines(own.cache_blocks) + quads(own.fifo) + tokens(own.misses);
            (stores, f(own.blends_per_cycle) / f(own.interval) * BLEND.bytes)
        }
        "compose" => (tokens(config.compose.misses), f(config.compose.samples_per_cycle) * SUM.bytes),
        "resolve" => (tokens(config.resolve.misses), 0.0),
        "scanout" => (f(config.scanout.fifo) + tokens(config.scanout.misses), 0.0),
        "l2" => {
            let own = &config.l2;
            let stores = if own.cached { cache(own.lines, own.line_bytes, own.lookups_per_cycle) } else { 0.0 };
            (stores + tokens(own.misses + own.waiting) + f(own.entries) * (TOKEN.bytes + f(own.sector_bytes)), 0.0)
        }
        "dram" => (f(config.dram.window + config.dram.write_queue) * (TOKEN.bytes + f(config.l2.line_bytes)), 0.0),
        // What else there is holds hardly more than its channels.
        _ => (0.0, 0.0),
    }
}

/// The area of a machine by its banks, in the order of the data flow, and then of its channels.
///
/// # Errors
/// If knobs do not fit each other.
pub fn parts(config: &Config) -> Result<Vec<AreaPart>, ConfigError> {
    let machine = Machine::new(config)?;
    let names: Vec<&'static str> = machine.units().map(|unit| unit.0).collect();
    let mut parts: Vec<AreaPart> = Vec::new();
    let mut places: HashMap<&str, usize> = HashMap::new();
    for &name in &names {
        let at = *places.entry(name).or_insert_with(|| {
            parts.push(AreaPart { name, count: 0, stores: 0.0, arithmetic: 0.0 });
            parts.len() - 1
        });
        let (stores, arithmetic) = unit(name, config);
        parts[at].count += 1;
        parts[at].stores += stores;
        parts[at].arithmetic += arithmetic;
    }
    let mut channels = AreaPart { name: "channels", count: 0, stores: 0.0, arithmetic: 0.0 };
    // The ends of the crossbar: units on the one side, slices on the other.
    let (mut units, mut slices) = (0, 0);
    for wire in machine.wires() {
        channels.count += 1;
        channels.stores += f64::from(wire.link.capacity) * TOKEN.bytes;
        units += usize::from(names[wire.to] == "crossbar");
        slices += usize::from(names[wire.from] == "crossbar" && names[wire.to] == "l2");
    }
    if let Some(&at) = places.get("crossbar") {
        // There and back.
        let pairs = 2.0 * units as f64 * slices as f64;
        parts[at].arithmetic += pairs * f64::from(config.l2.width) * CROSSPOINT.bytes;
        let translations = units as f64 * f64::from(config.tlb.entries + config.tlb.queue);
        let second = if config.tlb.entries > 0 { config.tlb.second_entries } else { 0 };
        parts[at].stores += (if config.tlb.entries > 0 { translations } else { 0.0 } + f64::from(second)) * TOKEN.bytes;
    }
    parts.push(channels);
    Ok(parts)
}

/// The area of a machine in bytes of SRAM, rounded.
///
/// # Errors
/// If knobs do not fit each other.
pub fn area(config: &Config) -> Result<u64, ConfigError> {
    let sum: f64 = parts(config)?.iter().map(|part| part.stores + part.arithmetic).sum();
    Ok(sum.round() as u64)
}

/// The page of the model: its constants, and the baseline's area by unit.
///
/// # Errors
/// If the baseline is unsound.
pub fn page() -> Result<String, ConfigError> {
    let mut out = "# Area\n\n\
         Generated from the code; `cargo test --test program pages` checks it.\n\n\
         `fillrate sweep --cost area` compares machines by bytes of SRAM: stores as they are, arithmetic as the SRAM that takes as much. Wires,\n\
         clocks and pads are left out. A byte is eight cells of 0.242 um2 at 45 nm (Cheng et al. 2007, IEDM), and as much again around them (assumed).\n\n\
         | what | bytes | source |\n|---|--:|---|\n"
        .to_owned();
    for Constant { what, bytes, source } in CONSTANTS {
        let digits = if bytes.fract() == 0.0 { 0 } else { 3 };
        let _ = writeln!(out, "| {what} | {bytes:.digits$} | {source} |");
    }
    out.push_str("\n## The baseline\n\n| units | count | stores | arithmetic |\n|---|--:|--:|--:|\n");
    let parts = parts(&Config::built_in("baseline")?)?;
    let row = |name: &str, count: usize, stores: f64, arithmetic: f64| {
        let [stores, arithmetic] = [stores, arithmetic].map(|bytes| grouped(bytes.round() as u64));
        format!("| {name} | {count} | {stores} | {arithmetic} |\n")
    };
    let has_area = |part: &&AreaPart| part.stores + part.arithmetic > 0.0;
    for part in parts.iter().filter(has_area) {
        out.push_str(&row(part.name, part.count, part.stores, part.arithmetic));
    }
    let sum = |of: fn(&AreaPart) -> f64| parts.iter().map(of).sum::<f64>();
    let units = parts.iter().filter(|part| part.name != "channels").map(|part| part.count).sum();
    out.push_str(&row("all", units, sum(|part| part.stores), sum(|part| part.arithmetic)));
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(changes: &[&str]) -> f64 {
        let mut config = Config::built_in("baseline").expect("it is built in");
        changes.iter().for_each(|change| config.set(change).expect("a knob"));
        area(&config).expect("sound") as f64
    }

    #[test]
    fn area_grows_by_what_is_added() {
        let base = of(&[]);
        // 16 texture units: 384 lines more of 128 bytes, each with a tag, and banks for 8 lookups per cycle.
        let more = of(&["texture.cache_lines=768"]) - base;
        assert!((more - 16.0 * 384.0 * (128.0 * (1.0 + 7.0 / 8.0) + 4.0)).abs() <= 1.0, "{more}");
        // 16 cores: 4 bytes for each further register.
        let more = of(&["core.registers=131072"]) - base;
        assert!((more - 16.0 * 65536.0 * 4.0).abs() <= 1.0, "{more}");
        // A channel's room: tokens.
        let deep = of(&["setup.queue=33"]) - base;
        assert!((deep - 4.0 * TOKEN.bytes).abs() <= 1.0, "{deep}");
        // Latencies and clocks take no room.
        assert_eq!(of(&["texture.latency=100", "clock_mhz=500", "memory.dram.t_rcd=30"]), base);
        // Twice the pipelines are less than twice the card: it has one command processor and the same second level.
        let twice = of(&["pipelines=8"]) / base;
        assert!((1.5..2.0).contains(&twice), "{twice}");
    }

    #[test]
    fn every_class_has_an_area_of_its_own_units() {
        let has = |sort: &str, name: &str| {
            let mut config = Config::built_in("baseline").expect("it is built in");
            config.set(&format!("sort={sort}")).expect("a knob");
            parts(&config).expect("sound").iter().any(|part| part.name == name && part.stores > 0.0)
        };
        assert!(has("sort-middle-binned", "tile_fetch") && !has("sort-middle", "tile_fetch"));
        assert!(has("sort-first", "route") && has("sort-last-image", "compose"));
    }
}
