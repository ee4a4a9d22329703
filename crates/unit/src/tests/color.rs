//! Colour ROPs: rates of writing and blending, the colour cache, fast clear, order, the end of a pass.

use std::sync::Arc;

use super::kit::{FREE, Sink, TokenSource, memory, port, round_trip, settle, write_time};
use super::scenery::{attachment, begin_pass, card, draw_with, group, mark, pass, row_of_tiles, surface};
use crate::Card;
use crate::block_cache::BlockCounts;
use crate::block_sets::BlockSets;
use crate::color::{Color, ColorConfig, ColorPorts};
use crate::compression::Codec;
use crate::token::{Ack, GroupToken, Kind};
use gfx::format::Format;
use gfx::state::{Blend, BlendComponent, BlendFactor, BlendOp};
use mem::Ideal;
use num::Cycle;
use sim::{Circuit, One, Unit, Wiring};
use work::{Attachment, Target};

sim::circuit! {
    struct ColorCircuit for Card {
        shaded: One<TokenSource<GroupToken>>,
        tested: One<TokenSource<GroupToken>>,
        color: One<Color>,
        end: One<Sink<Ack>>,
        ack: One<Sink<Ack>>,
        ideal: Option<Ideal>,
    }
}

fn config() -> ColorConfig {
    ColorConfig {
        interval: 1,
        write_64: 2,
        write_128: 4,
        blend_packed: 2,
        blend_single: 2,
        blend_halves: 2,
        blend_pair: 4,
        blend_full: 8,
        samples: 4,
        codec: Codec::Planes,
        recompress: true,
        cache_sets: BlockSets::Hashed,
        masked_writes: false,
        quads_per_cycle: 4,
        blends_per_cycle: 2,
        cache_blocks: 64,
        cache_ways: 64,
        misses: 16,
        fifo: 64,
        latency: 6,
        compression: false,
        skip_reads: false,
        fast_clear: true,
        clears_per_cycle: 256,
        ..ColorConfig::default()
    }
}

/// A group in its order: its block and quads, whether it comes from the late test, and when.
#[derive(Clone, Copy)]
struct Quads {
    at: Cycle,
    block: u32,
    /// The first of its quads in the block.
    first: u32,
    quads: u8,
    late: bool,
}

const fn quads(block: u32, quads: u8) -> Quads {
    Quads { at: 0, block, first: 0, quads, late: false }
}

struct Scene {
    config: ColorConfig,
    cleared: bool,
    store: bool,
    blend: bool,
    targets: usize,
    /// The formats of targets, in turn, and samples of a pixel.
    formats: &'static [Format],
    samples: u32,
    groups: Vec<Quads>,
    /// The mark behind them.
    mark: Kind,
}

impl Default for Scene {
    fn default() -> Scene {
        Scene {
            config: config(),
            cleared: true,
            store: true,
            blend: false,
            targets: 1,
            formats: &[Format::Rgba8Unorm],
            samples: 1,
            groups: Vec::new(),
            mark: Kind::SEGMENT,
        }
    }
}

/// The results of the unit.
#[derive(Debug, PartialEq)]
struct Written {
    /// When the mark was reported.
    ack: Cycle,
    ends: usize,
    counts: BlockCounts,
    items: u64,
    fragments: u64,
    bytes: u64,
    /// The first texel of each block.
    colors: Vec<u32>,
}

/// A target whose colours begin at word 0 of a payload.
fn target(blend: bool, packed: bool) -> Target {
    let add = BlendComponent { src: BlendFactor::One, dst: BlendFactor::One, op: BlendOp::Add };
    let blend = blend.then_some(Blend { color: add, alpha: add });
    let words = if packed { 1 } else { 4 };
    Target { blend, logic: None, write_mask: 15, payload: Some(0), words, packed, second: None }
}

fn written(scene: &Scene) -> Written {
    settle(
        || {
            let mut wiring = Wiring::new();
            let ids = ["shaded", "tested", "color", "end", "ack"].map(|name| wiring.unit(name, 0));
            let mut plan = memory(&mut wiring);
            let (shade, from_cores) = wiring.channel("shaded", 0, FREE, ids[0], ids[2]);
            let (test, from_depth) = wiring.channel("tested", 0, FREE, ids[1], ids[2]);
            let (end, at_depth) = wiring.channel("end", 0, FREE, ids[2], ids[3]);
            let (ack, at_command) = wiring.channel("ack", 0, FREE, ids[2], ids[4]);
            let mut card = card(1);
            let attachments = (1..=scene.targets as u32).map(|texture| {
                let format = scene.formats[(texture as usize - 1) % scene.formats.len()];
                let to = attachment(surface(texture, format, 16, scene.samples));
                Some(Attachment { store: scene.store, ..to })
            });
            begin_pass(&mut card, pass(attachments.collect(), None), scene.cleared);
            let mut segment = row_of_tiles(1, 1, 16, 0);
            // A packed colour: 0x33 in every word. To be blended: 1.0 in every channel.
            let plain = !scene.blend && scene.formats == [Format::Rgba8Unorm];
            let word = if plain { 0x3333_3333 } else { 1.0_f32.to_bits() };
            segment.tiles[0].payload.fill(word);
            let packed = !scene.blend && scene.formats == [Format::Rgba8Unorm];
            let targets = vec![Some(target(scene.blend, packed)); scene.targets];
            card.install(0, Arc::new(segment), Arc::new(draw_with(|state| state.targets = targets)), 0);
            let (mut shaded, mut tested) = (Vec::new(), Vec::new());
            for (sequence, of) in scene.groups.iter().enumerate() {
                let token = GroupToken { sequence: sequence as u32, ..group(&mut card, 0, of.block, of.first, of.quads) };
                if of.late { &mut tested } else { &mut shaded }.push((of.at, token));
            }
            let last = scene.groups.len() as u32;
            let after = shaded.last().map_or(0, |&(at, _)| at);
            shaded.push((after, GroupToken { sequence: last, ..mark(scene.mark, 0) }));
            let memory = port(&mut plan, &mut wiring, ids[2]);
            let ideal = plan.build(&mut wiring).ideal;
            let ports = ColorPorts { shaded: from_cores, tested: from_depth, end, ack };
            let circuit = ColorCircuit::new(
                wiring,
                One(TokenSource::new(shaded, shade)),
                One(TokenSource::new(tested, test)),
                One(Color::new(scene.config.clone(), 0, ports, memory)),
                One(Sink::new(at_depth)),
                One(Sink::new(at_command)),
                ideal,
            );
            (circuit, card)
        },
        |c, _| c.ack.got.len() == 1 && c.color.resident() == 0 && c.wires().resident() == 0,
        |c, card| {
            assert!(card.groups[0].is_empty());
            let memory = c.ideal.as_ref().unwrap().counts()[0];
            assert_eq!(memory.read_bytes, u64::from(card.frame.stores[0].block_bytes()) * c.color.counts().fills);
            let counts = c.color.counts();
            assert_eq!(c.color.cache().misses, counts.fills + counts.cleared_fills + counts.overwritten);
            Written {
                ack: c.ack.got[0].0,
                ends: c.end.got.len(),
                counts,
                items: c.color.items(),
                fragments: card.funnel.total().fragments_written,
                bytes: memory.write_bytes,
                colors: (0..16).map(|block| card.frame.stores[0].block(block)[0]).collect(),
            }
        },
    )
}

#[test]
fn quads_are_written_at_one_rate_and_blended_at_another() {
    let groups: Vec<_> = (0..8).map(|block| quads(block, 4)).collect();
    // Group n is looked up in cycle 1 + n and written 6 later; the mark behind the last, taken in the cycle after it, goes as soon as
    // it has been in the unit as long, and is a cycle on the way.
    let got = written(&Scene { groups: groups.clone(), ..Scene::default() });
    assert_eq!((got.ack, got.items, got.fragments), (9 + 6 + 1, 32, 128));
    assert_eq!((got.counts.cleared_fills, got.counts.fills), (8, 0));
    assert_eq!(got.colors[..9], [[0x3333_3333; 8].as_slice(), &[0]].concat());
    // Blending takes 2 cycles per group: the last begins in 7 + 14, and the mark, which is there by then, goes with it.
    let got = written(&Scene { blend: true, groups: groups.clone(), ..Scene::default() });
    assert_eq!((got.ack, got.items, got.colors[7]), (7 + 2 * 7 + 1, 32, !0));
    let full = ColorConfig { blends_per_cycle: 4, ..config() };
    let got = written(&Scene { config: full, blend: true, groups: groups.clone(), ..Scene::default() });
    assert_eq!(got.ack, 9 + 6 + 1);
    // A quad per cycle: 4 cycles per group.
    let slow = ColorConfig { quads_per_cycle: 1, blends_per_cycle: 1, ..config() };
    let got = written(&Scene { config: slow, groups, ..Scene::default() });
    assert_eq!(got.ack, 7 + 4 * 7 + 1);
}

#[test]
fn each_target_is_written() {
    // Two targets: a group is looked up for one in a cycle and for the other in the next, and counts twice.
    let groups: Vec<_> = (0..4).map(|block| quads(block, 4)).collect();
    let got = written(&Scene { targets: 2, groups, ..Scene::default() });
    assert_eq!((got.ack, got.items, got.fragments, got.counts.cleared_fills), (9 + 6 + 1, 32, 64, 8));
    // Without any there is nothing to look up; the fragments count as written all the same.
    let got = written(&Scene { targets: 1, groups: vec![quads(0, 0)], ..Scene::default() });
    assert_eq!((got.items, got.fragments, got.counts.cleared_fills), (0, 0, 0));
}

#[test]
fn blocks_in_memory_are_waited_for_and_cleared_ones_are_not() {
    // Looked up in cycle 1, asked for in 2, blended when it is here; the next block 4 cycles later, as the port brings 64 bytes
    // per cycle. The mark goes with the last. (A block in memory is fetched even if all of it will be written.)
    let groups = vec![quads(0, 4), quads(0, 4), quads(1, 4)];
    for blend in [false, true] {
        let got = written(&Scene { cleared: false, blend, groups: groups.clone(), ..Scene::default() });
        assert_eq!((got.ack, got.counts.fills), (2 + round_trip(256) + 4 + 1, 2), "blend {blend}");
    }
    // One request at a time.
    let config = ColorConfig { misses: 1, ..config() };
    let got = written(&Scene { config, cleared: false, groups, ..Scene::default() });
    assert_eq!(got.ack, 2 + 2 * round_trip(256) + 1);
}

#[test]
fn groups_are_taken_in_order_wherever_they_come_from() {
    // The second comes from the late test in cycle 51; the third has waited for it. Taken in the same cycle as far as the rate goes:
    // 51 and 52, and the mark in 53.
    let late = Quads { at: 50, late: true, ..quads(1, 4) };
    let got = written(&Scene { groups: vec![quads(0, 4), late, quads(2, 4)], ..Scene::default() });
    assert_eq!(got.ack, 53 + 6 + 1);
    assert_eq!(got.colors[..4], [0x3333_3333, 0x3333_3333, 0x3333_3333, 0]);
    // One from the late test that is there before its turn waits for the first, which comes straight from the cores in 51.
    let (first, second) = (Quads { at: 50, ..quads(0, 4) }, Quads { late: true, ..quads(1, 4) });
    assert_eq!(written(&Scene { groups: vec![first, second], ..Scene::default() }).ack, 53 + 6 + 1);
}

#[test]
fn the_end_of_a_pass_writes_back_what_is_dirty() {
    // The mark is taken in cycle 9 and looked at in 15. From then on a block per cycle is put down for writing, and sent from the next
    // cycle on as the port takes 264 bytes each; the end is reported, to the depth unit as well, when the last is sent.
    let groups: Vec<_> = (0..8).map(|block| quads(block, 4)).collect();
    let scene = Scene { groups, mark: Kind::PASS, ..Scene::default() };
    let got = written(&scene);
    assert_eq!((got.ack, got.ends), (16 + write_time(7, 256) + 1, 1));
    assert_eq!((got.counts.write_backs, got.bytes), (8, 8 * 256));
    // Nothing is kept: 8 cycles of looking, one to find no more, and the report.
    let got = written(&Scene { store: false, ..scene });
    assert_eq!((got.ack, got.counts.write_backs, got.bytes), (15 + 8 + 1 + 1, 0, 0));
}

#[test]
fn a_block_that_is_one_colour_leaves_smaller() {
    let config = ColorConfig { compression: true, ..config() };
    // Sixteen quads of one colour fill a block. In memory it takes a line instead of four.
    let groups = (0..4).map(|n| Quads { first: 4 * n, ..quads(0, 4) }).collect();
    let got = written(&Scene { config, groups, mark: Kind::PASS, ..Scene::default() });
    assert_eq!((got.counts.write_backs, got.counts.compressed), (1, 1));
    assert_eq!(got.counts.bytes_saved + got.bytes, 256);
    assert!(got.bytes < 256, "{}", got.bytes);
}

#[test]
fn a_block_that_is_raw_stays_raw_where_nothing_compresses_again() {
    let visit = |again| {
        let config = ColorConfig { compression: true, codec: Codec::References, recompress: again, ..config() };
        let groups = (0..4).map(|n| Quads { first: 4 * n, ..quads(0, 4) }).collect();
        written(&Scene { config, cleared: false, groups, mark: Kind::PASS, ..Scene::default() })
    };
    // The surface was in memory, raw.
    let (again, raw) = (visit(true), visit(false));
    assert_eq!((again.counts.compressed, again.bytes), (1, 64));
    assert_eq!((raw.counts.compressed, raw.bytes), (0, 256));
    assert_eq!(raw.colors, again.colors);
    // What a flag clears is compressed the first time.
    let config = ColorConfig { compression: true, codec: Codec::References, recompress: false, ..config() };
    let groups = (0..4).map(|n| Quads { first: 4 * n, ..quads(0, 4) }).collect();
    let cleared = written(&Scene { config, groups, mark: Kind::PASS, ..Scene::default() });
    assert_eq!((cleared.counts.compressed, cleared.bytes), (1, 64));
}

#[test]
fn wide_pixels_take_as_long_as_the_card_says() {
    use Format::{
        R32Float, Rg11b10Ufloat, Rg16Float, Rg32Float, Rgb10a2Unorm, Rgba8Unorm, Rgba8UnormSrgb, Rgba16Float, Rgba32Float,
    };
    let groups: Vec<_> = (0..8).map(|block| quads(block, 4)).collect();
    let ack = |config: &ColorConfig, format: &'static [Format], samples, blend| {
        written(&Scene { config: config.clone(), formats: format, samples, blend, groups: groups.clone(), ..Scene::default() })
            .ack
    };
    // Four quads per cycle: a group per cycle, or as many cycles as its pixels take times as long. The first begins in 7; the mark is there
    // by the time of the last.
    let after = |times: Cycle| if times == 1 { 9 + 6 + 1 } else { 7 + 7 * times + 1 };
    let full = ColorConfig { blends_per_cycle: 4, ..config() };
    for (format, [write, blend]) in [
        (&[Rgba8Unorm], [1, 1]),
        (&[Rgba8UnormSrgb], [1, 1]),
        (&[Rgb10a2Unorm], [1, 2]),
        (&[Rg11b10Ufloat], [1, 2]),
        (&[Rg16Float], [1, 2]),
        (&[R32Float], [1, 2]),
        (&[Rgba16Float], [2, 2]),
        (&[Rg32Float], [2, 4]),
        (&[Rgba32Float], [4, 8]),
    ] {
        assert_eq!(ack(&full, format, 1, false), after(write), "{format:?} written");
        assert_eq!(ack(&full, format, 1, true), after(blend), "{format:?} blended");
    }
    // Two pixels per cycle: a quad in two.
    let half = ColorConfig { interval: 2, ..full.clone() };
    assert_eq!(ack(&half, &[Rgba8Unorm], 1, false), after(2));
    // Four samples cost nothing, or twice as much.
    assert_eq!(ack(&full, &[Rgba8Unorm], 4, false), after(1));
    assert_eq!(ack(&ColorConfig { samples: 2, ..full }, &[Rgba8Unorm], 4, false), after(2));
}

#[test]
fn wide_blocks_take_several_places() {
    // Four places. Two blocks of 64 bits fill them: the third is looked up when the first is written, in cycle 7. Of 128 bits one does.
    let config = ColorConfig { cache_blocks: 4, cache_ways: 4, ..config() };
    for (format, blocks, bytes) in [(&[Format::Rgba16Float], 3, 512), (&[Format::Rgba32Float], 2, 1024)] {
        let groups = (0..blocks).map(|block| quads(block, 4)).collect();
        let got = written(&Scene { config: config.clone(), formats: format, groups, ..Scene::default() });
        assert_eq!((got.ack, got.counts.write_backs, got.bytes), (8 + 6 + 1, 1, bytes), "{format:?}");
    }
    // With as many ways as a knob can have, all is there.
    let most = ColorConfig { cache_blocks: 65_536, cache_ways: 65_536, ..config.clone() };
    let got = written(&Scene { config: most, groups: vec![quads(0, 4)], ..Scene::default() });
    assert_eq!((got.ack, got.counts.write_backs), (2 + 6 + 1, 0));
    // Two targets, of one place and of two. The fourth block needs two places: block 0 of the first target goes in 7, when it is written, and
    // that of the second in 8, instead of which it comes. The mark is taken in 9.
    let formats = &[Format::Rgba8Unorm, Format::Rgba16Float];
    let groups = vec![quads(0, 4), quads(1, 4)];
    let got = written(&Scene { config, formats, targets: 2, groups, ..Scene::default() });
    assert_eq!((got.ack, got.counts.write_backs, got.bytes), (9 + 6 + 1, 2, 256 + 512));
}

#[test]
fn a_dirty_block_is_written_back_when_another_needs_its_place() {
    // Four places. The fifth block finds all in use until block 0 is written in cycle 7, takes its place and is written 6 later. The
    // mark, taken a cycle after it, goes 6 after that.
    let config = ColorConfig { cache_blocks: 4, cache_ways: 4, ..config() };
    let groups = (0..5).map(|block| quads(block, 4)).collect();
    let got = written(&Scene { config, groups, ..Scene::default() });
    assert_eq!((got.ack, got.counts.write_backs, got.bytes), (8 + 6 + 1, 1, 256));
}

#[test]
fn blocks_that_are_overwritten_whole_are_not_read() {
    let whole: Vec<_> = (0..4).map(|n| Quads { first: 4 * n, ..quads(0, 4) }).collect();
    let scene = Scene { cleared: false, groups: whole, mark: Kind::PASS, ..Scene::default() };
    let skip = |scene: Scene| written(&Scene { config: ColorConfig { skip_reads: true, ..scene.config }, ..scene });
    let (read, skipped) = (written(&scene), skip(Scene { groups: scene.groups.clone(), ..scene }));
    assert_eq!((read.counts.fills, read.counts.overwritten), (1, 0));
    assert_eq!((skipped.counts.fills, skipped.counts.overwritten), (0, 1));
    assert_eq!((skipped.colors, skipped.bytes), (read.colors, read.bytes));
    // It takes as long as where a flag says what the block holds.
    let groups: Vec<_> = (0..4).map(|n| Quads { first: 4 * n, ..quads(0, 4) }).collect();
    let scene = |cleared, blend, groups: &[Quads]| Scene {
        cleared,
        blend,
        groups: groups.to_vec(),
        mark: Kind::PASS,
        ..Scene::default()
    };
    assert_eq!(skipped.ack, skip(scene(true, false, &groups)).ack);
    assert_eq!(skip(scene(true, false, &groups)).counts.overwritten, 0);
    // What is left of a block is read before it is written back: asked for in cycle 12, when the mark has been in the unit as long as
    // the groups before it, and written when it is here.
    let some = skip(scene(false, false, &groups[..3]));
    assert_eq!((some.counts.fills, some.counts.overwritten, some.counts.write_backs, some.bytes), (1, 0, 1, 256));
    let kept = written(&scene(false, false, &groups[..3]));
    assert_eq!(some.colors, kept.colors);
    assert!(some.ack > kept.ack, "the read was put off in vain: {} and {}", some.ack, kept.ack);
    // Blending reads what was there.
    let blended = skip(scene(false, true, &groups));
    assert_eq!((blended.counts.fills, blended.counts.overwritten), (1, 0));
    // Nor is anything lost where a block that is not complete has to leave: four places, five blocks.
    let config = ColorConfig { skip_reads: true, cache_blocks: 4, cache_ways: 4, ..config() };
    let five: Vec<_> = (0..5).map(|block| quads(block, 4)).collect();
    let left = written(&Scene { config, ..scene(false, false, &five) });
    assert_eq!((left.counts.fills, left.counts.write_backs), (5, 5));
}
