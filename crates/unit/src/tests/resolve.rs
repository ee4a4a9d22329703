//! Resolve and scan-out: what streams through memory at the end of a pass and of a frame.

use super::kit::{FREE, Sink, TokenSource, memory, port, round_trip, settle, write_time};
use super::scenery::{attachment, begin_pass, card, card_of_tiles, pass, surface};
use crate::Card;
use crate::compression::{Codec, Compression};
use crate::frame::BlockState;
use crate::resolve::{Resolve, ResolveConfig};
use crate::scanout::{Scanout, ScanoutConfig};
use crate::token::{Ack, Kind, Piece};
use gfx::format::Format;
use mem::{ClientCounts, Ideal};
use num::Cycle;
use sim::{Circuit, One, Unit, Wiring};
use work::Attachment;

sim::circuit! {
    struct ResolveCircuit for Card {
        source: One<TokenSource<Piece>>,
        resolve: One<Resolve>,
        sink: One<Sink<Ack>>,
        ideal: Option<Ideal>,
    }
}

const PIECE: Piece = Piece { slot: 0, kind: Kind::DATA };

/// The cycle in which an attachment of four samples is resolved, and the traffic. `blocks` are the states of its blocks in memory.
fn resolved(config: &ResolveConfig, blocks: &[BlockState]) -> (Cycle, ClientCounts) {
    resolved_by(config, (1, 0), false, blocks)
}

/// The same by pipeline `pipeline` of `pipelines`. `enabled` is whether blocks may be compressed.
fn resolved_by(
    config: &ResolveConfig,
    (pipelines, pipeline): (usize, u8),
    enabled: bool,
    blocks: &[BlockState],
) -> (Cycle, ClientCounts) {
    settle(
        || {
            let mut wiring = Wiring::new();
            let ids = ["source", "resolve", "sink"].map(|name| wiring.unit(name, 0));
            let mut plan = memory(&mut wiring);
            let (output, input) = wiring.channel("in", 0, FREE, ids[0], ids[1]);
            let (out, got) = wiring.channel("out", 0, FREE, ids[1], ids[2]);
            let count = blocks.len() as u32;
            let mut card = card_of_tiles(pipelines, 8);
            let resolve = Some(surface(2, Format::Rgba8Unorm, count, 1));
            let samples = Attachment { resolve, ..attachment(surface(1, Format::Rgba8Unorm, count, 4)) };
            begin_pass(&mut card, pass(vec![Some(samples)], None), false);
            card.frame.stores[0].blocks.copy_from_slice(blocks);
            card.frame.stores[0].clear([0x0102_0304, 0, 0, 0]);
            let memory = port(&mut plan, &mut wiring, ids[1]);
            let ideal = plan.build(&mut wiring).ideal;
            let compression = Compression { enabled, codec: Codec::Planes, again: true };
            let unit = One(Resolve::new(config.clone(), pipeline, compression, input, out, memory));
            let source = One(TokenSource::new(vec![(0, PIECE)], output));
            (ResolveCircuit::new(wiring, source, unit, One(Sink::new(got)), ideal), card)
        },
        |c, _| c.sink.got.len() == 1 && c.wires().resident() == 0,
        |c, card| {
            let own: Vec<_> = (0..blocks.len()).filter(|&n| card.interleave.owner(n as u32, 0) == pipeline).collect();
            assert_eq!((c.resolve.items(), c.resolve.resident()), (own.len() as u64, 0));
            let target = &card.frame.stores[1];
            let written = if enabled { 64 } else { 256 };
            for n in 0..blocks.len() {
                let own = own.contains(&n);
                let pixel = if own { 0x0102_0304 } else { 0 };
                assert!(target.block(n as u32).iter().all(|&code| code == pixel), "four equal samples are their pixel");
                assert_eq!(target.blocks[n], BlockState::Stored(if own { written } else { 256 }));
            }
            (c.sink.got[0].0, c.ideal.as_ref().unwrap().counts()[0])
        },
    )
}

fn config(block_cycles: u32, misses: u32) -> ResolveConfig {
    ResolveConfig { block_cycles, misses, ..ResolveConfig::default() }
}

/// A block of four samples of four bytes.
const RAW: BlockState = BlockState::Stored(1024);

#[test]
fn blocks_are_resolved_as_their_samples_come() {
    // Four requests of 256 bytes per block, the first sent in cycle 2; the port brings one in 4 cycles. With the last one the block is
    // resolved; it is written in the next cycle, in which the end is reported, a cycle on the way.
    let many = config(4, 64);
    for count in [1, 2, 5] {
        let here = 2 + round_trip(256) + 4 * (4 * count - 1);
        let (at, moved) = resolved(&many, &vec![RAW; count as usize]);
        assert_eq!(at, here + 1 + 1, "{count} blocks");
        assert_eq!((moved.read_bytes, moved.write_bytes), (1024 * count, 256 * count));
    }
    // One request, and one block, at a time: the second block is asked for when the first is resolved, before its write.
    let one = config(4, 1);
    let first = 2 + 4 * round_trip(256);
    let second = first + 1 + 4 * round_trip(256);
    assert_eq!(resolved(&one, &[RAW; 2]).0, second + 1 + 1);
}

#[test]
fn cleared_blocks_take_the_units_own_time_or_that_of_their_writes() {
    // From cycle 2 on one in eight cycles; in four cycles they come faster than the port writes them.
    let slow = config(8, 64);
    let (at, moved) = resolved(&slow, &[BlockState::Cleared; 9]);
    assert_eq!((at, moved.read_bytes), (2 + 8 * 8 + 1 + 1, 0));
    let fast = config(4, 64);
    assert_eq!(resolved(&fast, &[BlockState::Cleared; 9]).0, 3 + write_time(8, 256) + 1);
}

#[test]
fn reads_are_not_held_up_by_writes() {
    // Blocks whose samples are equal come in one request of 64 bytes, and are written in 256 bytes, which take the port most of the time:
    // the last write is sent as late as writes that follow each other allow, and a block's reading adds nothing.
    let many = config(1, 64);
    let blocks = [BlockState::Stored(64); 40];
    let (at, moved) = resolved(&many, &blocks);
    assert_eq!((moved.read_bytes, moved.write_bytes), (64 * 40, 256 * 40));
    let first = 2 + round_trip(64) + 1;
    // A request to read weighs 8 bytes on the port.
    let busy = (40 * (256 + 8) + 40 * 8) / 64;
    assert!((first + busy - 12..=first + busy + 4).contains(&at), "{at}: {first} and {busy}");
}

#[test]
fn each_pipeline_resolves_its_own_blocks() {
    // Every fourth of twelve blocks: as long as three of a single pipeline.
    let many = config(4, 64);
    let three = resolved(&many, &[RAW; 3]);
    for pipeline in 0..4 {
        assert_eq!(resolved_by(&many, (4, pipeline), false, &[RAW; 12]), three);
    }
    // A pipeline without any reports at once.
    assert_eq!(resolved_by(&many, (4, 3), false, &[RAW; 3]), (1 + 1, ClientCounts::default()));
}

#[test]
fn pixels_are_written_as_small_as_the_colour_unit_writes_them() {
    let (at, moved) = resolved_by(&config(4, 64), (1, 0), true, &[RAW; 5]);
    assert_eq!((at, moved.write_bytes), (resolved(&config(4, 64), &[RAW; 5]).0, 64 * 5));
}

#[test]
fn a_block_does_not_wait_for_the_one_behind_it() {
    // The first block, compressed, is one request; the second is four, two of which can be on their way. The first is resolved as it
    // comes, and by the time that the unit, which takes 200 cycles for a block, is free again the second is there.
    let config = config(200, 2);
    assert_eq!(resolved(&config, &[BlockState::Stored(64), RAW]).0, 2 + round_trip(64) + 200 + 1 + 1);
}

sim::circuit! {
    struct ScanoutCircuit for Card {
        source: One<TokenSource<Piece>>,
        scanout: One<Scanout>,
        sink: One<Sink<Ack>>,
        ideal: Option<Ideal>,
    }
}

#[test]
fn scan_out_reads_the_surface_as_fast_as_the_port_brings_it() {
    // Sixteen requests of 256 bytes from cycle 1 on; the port takes eight per cycle and brings one in 4. A cycle on the way.
    for (misses, last) in [(32, 1 + round_trip(256) + 4 * 15), (1, 1 + 16 * round_trip(256))] {
        let (at, read) = settle(
            || {
                let mut wiring = Wiring::new();
                let ids = ["source", "scanout", "sink"].map(|name| wiring.unit(name, 0));
                let mut plan = memory(&mut wiring);
                let (output, input) = wiring.channel("in", 0, FREE, ids[0], ids[1]);
                let (out, got) = wiring.channel("out", 0, FREE, ids[1], ids[2]);
                let mut card = card(1);
                card.frame.surface(&surface(1, Format::Rgba8Unorm, 16, 1));
                let memory = port(&mut plan, &mut wiring, ids[1]);
                let ideal = plan.build(&mut wiring).ideal;
                let unit = One(Scanout::new(
                    ScanoutConfig { enabled: true, misses, ..ScanoutConfig::default() },
                    64,
                    input,
                    out,
                    memory,
                ));
                let source = One(TokenSource::new(vec![(0, PIECE)], output));
                (ScanoutCircuit::new(wiring, source, unit, One(Sink::new(got)), ideal), card)
            },
            |c, _| c.sink.got.len() == 1,
            |c, _| (c.sink.got[0].0, c.ideal.as_ref().unwrap().counts()[0].read_bytes),
        );
        assert_eq!((at, read), (last + 1, 16 * 256), "{misses} misses");
    }
}
