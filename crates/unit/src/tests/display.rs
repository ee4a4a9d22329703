//! A free-running display: tears, refreshes, bytes and dry lines by closed form.

use super::kit::{FREE, Sink, TokenSource, memory, port, settle};
use super::scenery::{card, surface};
use crate::Card;
use crate::card::Presented;
use crate::frame::{BlockState, Store};
use crate::scanout::{DisplayCounts, Scanout, ScanoutConfig, ScanoutMode, Swap};
use crate::token::{Ack, Kind, Piece};
use gfx::format::Format;
use mem::Ideal;
use num::{Cycle, Random};
use sim::{Circuit, One, Unit, Wiring};

sim::circuit! {
    struct DisplayCircuit for Card {
        source: One<TokenSource<Piece>>,
        scanout: One<Scanout>,
        sink: One<Sink<Ack>>,
        ideal: Option<Ideal>,
    }
}

/// Lines of the frames here, and bytes of each.
const LINES: u64 = 8;
const LINE_BYTES: u64 = 512;

fn config() -> ScanoutConfig {
    ScanoutConfig {
        compressed: false,
        enabled: true,
        misses: 32,
        mode: ScanoutMode::FreeRunning,
        line_cycles: 100,
        blank_lines: 4,
        buffers: 2,
        swap: Swap::Immediate,
        show_last: true,
        fifo: 1024,
        ..ScanoutConfig::default()
    }
}

/// What a display has shown of frames that come to it in these cycles, in each of which it hears of one; then none follows.
#[derive(Debug, PartialEq)]
struct Seen {
    counts: DisplayCounts,
    /// The first lines and the frames of the parts of each refresh.
    refreshes: Vec<Vec<(u32, u32)>>,
    tears: Vec<(u64, u32)>,
    dry: Vec<(u64, u32)>,
    bytes: u64,
    acks: Vec<Cycle>,
}

fn seen(config: &ScanoutConfig, times: &[Cycle]) -> Seen {
    seen_of(config, &times.iter().map(|&at| (at, 16)).collect::<Vec<_>>())
}

/// The same, of frames with a number of blocks next to each other.
fn seen_of(config: &ScanoutConfig, frames: &[(Cycle, u32)]) -> Seen {
    let times: Vec<Cycle> = frames.iter().map(|(at, _)| *at).collect();
    let run = || {
        let mut wiring = Wiring::new();
        let ids = ["source", "scanout", "sink"].map(|name| wiring.unit(name, 0));
        let mut plan = memory(&mut wiring);
        let (output, input) = wiring.channel("in", 0, FREE, ids[0], ids[1]);
        let (out, got) = wiring.channel("out", 0, FREE, ids[1], ids[2]);
        let mut card = card(1);
        for (frame, &(at, blocks)) in (0..).zip(frames) {
            let surface = surface(1, Format::Rgba8Unorm, blocks, 1);
            let bytes = vec![0; (LINES * LINE_BYTES * u64::from(blocks) / 16) as usize].into();
            card.presented.push_back(Presented {
                frame,
                surface,
                address: surface.address,
                bytes,
                at: at - 1,
                sprites: [].into(),
            });
        }
        let memory = port(&mut plan, &mut wiring, ids[1]);
        let ideal = plan.build(&mut wiring).ideal;
        let unit = One(Scanout::new(config.clone(), 64, input, out, memory));
        // What is sent in a cycle comes in the next.
        let last = times[times.len() - 1];
        let pieces = times.iter().map(|&at| (at - 1, Piece { slot: 0, kind: Kind::DATA }));
        let pieces = pieces.chain([(last, Piece { slot: 0, kind: Kind::END })]).collect();
        (DisplayCircuit::new(wiring, One(TokenSource::new(pieces, output)), unit, One(Sink::new(got)), ideal), card)
    };
    settle(
        run,
        |c, _| c.source.resident() == 0 && c.scanout.resident() == 0 && c.scanout.items() > 0 && c.wires().resident() == 0,
        |c, _| {
            let shown = c.scanout.shown();
            Seen {
                counts: c.scanout.display_counts().expect("it runs free"),
                refreshes: shown
                    .0
                    .iter()
                    .map(|refresh| refresh.parts.iter().map(|(line, f)| (*line, f.frame)).collect())
                    .collect(),
                tears: shown.1.to_vec(),
                dry: shown.2.to_vec(),
                bytes: c.ideal.as_ref().expect("ideal memory").counts()[0].read_bytes,
                acks: c.sink.times(),
            }
        },
    )
}

#[test]
fn a_compressed_frame_is_read_as_it_is_stored() {
    // Four blocks of 256 bytes: raw, cleared by flag, a quarter, half. And the same frame raw.
    let states = [BlockState::Stored(256), BlockState::Cleared, BlockState::Stored(64), BlockState::Stored(128)];
    for (compressed, bytes) in [(true, 256 + 64 + 128), (false, 4 * 256)] {
        let config = ScanoutConfig { enabled: true, misses: 2, compressed, ..ScanoutConfig::default() };
        let run = || {
            let mut wiring = Wiring::new();
            let ids = ["source", "scanout", "sink"].map(|name| wiring.unit(name, 0));
            let mut plan = memory(&mut wiring);
            let (output, input) = wiring.channel("in", 0, FREE, ids[0], ids[1]);
            let (out, got) = wiring.channel("out", 0, FREE, ids[1], ids[2]);
            let mut card = card(1);
            let mut store = Store::new(surface(1, Format::Rgba8Unorm, 4, 1));
            store.blocks.copy_from_slice(&states);
            card.frame.stores.push(store);
            let memory = port(&mut plan, &mut wiring, ids[1]);
            let ideal = plan.build(&mut wiring).ideal;
            let unit = One(Scanout::new(config.clone(), 64, input, out, memory));
            let pieces = vec![(0, Piece { slot: 0, kind: Kind::DATA }), (0, Piece { slot: 0, kind: Kind::DATA })];
            (DisplayCircuit::new(wiring, One(TokenSource::new(pieces, output)), unit, One(Sink::new(got)), ideal), card)
        };
        let read =
            settle(run, |c, _| c.sink.got.len() == 2, |c, _| c.ideal.as_ref().expect("ideal memory").counts()[0].read_bytes);
        assert_eq!(read, 2 * bytes, "{compressed}");
    }
}

/// Cycles of a refresh.
const P: Cycle = (LINES + 4) * 100;
/// The first frame comes in cycle 1; the first refresh begins behind the vertical blank.
const ORIGIN: Cycle = 1 + 4 * 100;

#[test]
fn a_swap_in_cycle_t_tears_line_t_mod_p_over_l() {
    let mut random = Random::new(3);
    let mut times: Vec<Cycle> =
        vec![ORIGIN, ORIGIN + 1, ORIGIN + 99, ORIGIN + 100, ORIGIN + LINES * 100 - 1, ORIGIN + LINES * 100];
    times.extend((0..60).map(|_| ORIGIN + u64::from(random.below(3 * P as u32))));
    for at in times {
        let seen = seen(&config(), &[1, at]);
        let t = at - ORIGIN;
        let (refresh, line) = (t / P, (t % P / 100) as u32);
        let torn = !t.is_multiple_of(P) && u64::from(line) < LINES;
        assert_eq!(seen.tears, if torn { vec![(refresh, line)] } else { vec![] }, "a swap in {t}");
        assert_eq!((seen.counts.tears, seen.counts.tear_lines), (torn.into(), if torn { line.into() } else { 0 }));
        // Lines above show the first frame, lines from there on the second.
        if torn && line > 0 {
            assert_eq!(seen.refreshes[refresh as usize], [(0, 0), (line, 1)]);
        }
        // The run ends with the first refresh that shows the last frame whole; each is read once, whatever is torn.
        let whole = if t.is_multiple_of(P) || torn && line == 0 { refresh } else { refresh + 1 };
        let n = seen.counts.refreshes;
        assert_eq!((n, seen.bytes), (whole + 1, n * LINES * LINE_BYTES), "a swap in {t}");
        assert_eq!(seen.refreshes[whole as usize], [(0, 1)]);
        assert_eq!(seen.counts.shown + seen.counts.dropped, 2);
        assert_eq!(seen.counts.dry_lines, 0);
    }
}

#[test]
fn with_vsync_frames_change_in_the_blank_and_none_is_torn() {
    // Frame 1 comes in the lines of refresh 1, frame 2 in the blank behind refresh 3: behind its beginning, so that it waits for the next.
    let vsync = ScanoutConfig { swap: Swap::Vsync, ..config() };
    let blank = |refresh: u64| ORIGIN + refresh * P + LINES * 100;
    let seen = seen(&vsync, &[1, ORIGIN + P + 350, blank(3) + 1]);
    let frames: Vec<_> = seen.refreshes.iter().map(|parts| parts[0].1).collect();
    assert_eq!(frames, [0, 0, 1, 1, 1, 2]);
    // The first is shown at once. Each other frame is heard of in the blank in which it is swapped in; a cycle on the way.
    assert_eq!(seen.acks, [1 + 1, blank(1) + 1, blank(4) + 1]);
    let wait = (ORIGIN) + (ORIGIN + 2 * P - (ORIGIN + P + 350) + 1) + (ORIGIN + 5 * P - blank(3));
    let expected =
        DisplayCounts { refreshes: 6, presented: 3, shown: 3, repeated: 3, present_to_line: wait, ..DisplayCounts::default() };
    assert_eq!(seen.counts, expected);
    assert_eq!(seen.bytes, 6 * LINES * LINE_BYTES);
}

#[test]
fn frames_that_no_line_shows_are_dropped() {
    // Three frames in one blank: only the last is shown. Two in one line: the second takes the line.
    let blank = ORIGIN + LINES * 100 + 7;
    let seen = seen(&config(), &[1, blank, blank + 10, blank + 20, ORIGIN + P + 210, ORIGIN + P + 250]);
    assert_eq!(seen.refreshes, [vec![(0, 0)], vec![(0, 3), (2, 5)], vec![(0, 5)]]);
    assert_eq!((seen.counts.presented, seen.counts.shown, seen.counts.dropped, seen.counts.repeated), (6, 3, 3, 0));
    assert_eq!(seen.tears, [(1, 2), (1, 2)]);
}

#[test]
fn a_fifo_that_memory_does_not_fill_in_time_runs_dry() {
    // A request of 256 bytes is asked for when the FIFO has room for it and takes 57 cycles; a line of 512 bytes takes L of them. With room
    // for two requests each is asked for when the one two before has left: L/2 cycles ahead. That is too late where L/2 < 57.
    let of = |line_cycles: u32, fifo| ScanoutConfig { line_cycles, fifo, blank_lines: 16, ..config() };
    let all = |config: &ScanoutConfig| seen(config, &[1]);
    let served = all(&of(2 * 58, 512));
    assert_eq!((served.counts.dry_lines, served.bytes), (0, LINES * LINE_BYTES));
    let starved = all(&of(100, 512));
    // The first line was read in the blank. All bytes are read all the same.
    assert_eq!(starved.dry, (1..LINES as u32).map(|line| (0, line)).collect::<Vec<_>>());
    assert_eq!((starved.counts.dry_lines, starved.bytes), (LINES - 1, LINES * LINE_BYTES));
    // Twice the room is twice the time.
    assert_eq!(all(&of(100, 1024)).counts.dry_lines, 0);
}

#[test]
fn memory_too_slow_for_a_display_falls_behind_by_a_refresh_at_most() {
    // One request of 256 bytes is under way at a time, for 57 cycles. A refresh has 16 requests, and takes 240 cycles.
    let config = ScanoutConfig { line_cycles: 20, blank_lines: 4, misses: 1, fifo: 4096, ..config() };
    let last = 1 + 10 * 240;
    let seen = seen(&config, &[1, last]);
    // The second frame comes in the blank, so that it is the eleventh picture, and the last.
    assert_eq!((seen.counts.refreshes, seen.counts.shown, seen.counts.repeated), (11, 2, 9));
    // In 240 cycles four or five requests come. In the blank one comes: the first half of the first line.
    let requests = (seen.bytes / 256) as f64 / 11.0;
    assert!((4.0..=5.0).contains(&requests), "{requests}");
    let all = (0..11).flat_map(|refresh| (0..LINES as u32).map(move |line| (refresh, line)));
    assert_eq!(seen.dry, all.collect::<Vec<_>>());
}

#[test]
fn a_frame_of_another_size_begins_a_mode_of_its_own() {
    // The second frame has lines of half the bytes. It comes in line 3 of refresh 1, which ends there: a blank follows, and its refresh.
    let (at, half) = (ORIGIN + P + 350, LINE_BYTES / 2);
    let seen = seen_of(&config(), &[(1, 16), (at, 8)]);
    assert_eq!(seen.refreshes, [vec![(0, 0)], vec![(0, 1)]]);
    let wait = ORIGIN - 1 + 400;
    let expected = DisplayCounts {
        refreshes: 2,
        presented: 2,
        shown: 2,
        modes: 1,
        // `at` of a frame is the cycle before that in which the display takes it.
        present_to_line: wait + 2,
        ..DisplayCounts::default()
    };
    assert_eq!((seen.counts, seen.tears, seen.dry), (expected, vec![], vec![]));
    // In 350 cycles three lines and a half have left the FIFO of two lines. The eleventh request of 256 bytes has room from then on: too late.
    assert_eq!(seen.bytes, LINES * LINE_BYTES + 10 * 256 + LINES * half);

    // With vsync the mode changes in the blank behind refresh 1, and begins with a blank; nothing is cut off.
    let seen = seen_of(&ScanoutConfig { swap: Swap::Vsync, ..config() }, &[(1, 16), (at, 8), (at + 1, 8)]);
    assert_eq!(seen.refreshes, [vec![(0, 0)], vec![(0, 0)], vec![(0, 1)], vec![(0, 2)]]);
    assert_eq!((seen.counts.modes, seen.bytes), (1, 2 * LINES * LINE_BYTES + 2 * LINES * half));
    let blank = |refresh: u64| ORIGIN + refresh * P + LINES * 100;
    assert_eq!(seen.acks, [1 + 1, blank(1) + 1, blank(2) + 1]);
    // A mode that no frame is shown in is dropped with its frame.
    let seen = seen_of(&config(), &[(1, 16), (ORIGIN - 100, 8), (ORIGIN - 50, 16)]);
    assert_eq!((seen.refreshes, seen.counts.modes, seen.counts.dropped), (vec![vec![(0, 2)]], 2, 2));
}

#[test]
fn a_display_that_need_not_show_the_last_frame_is_switched_off_behind_it() {
    let off = |last: Cycle| seen(&ScanoutConfig { show_last: false, ..config() }, &[10, last]);
    // The first line begins in 10 + 400. In 1010 six lines have left the FIFO, 3072 bytes, and there is room for the sixteenth request. That none
    // follows is heard in the cycle behind the last frame.
    let seen = off(1009);
    assert_eq!((seen.bytes, seen.refreshes.len(), seen.counts.refreshes, seen.counts.presented), (15 * 256, 0, 0, 2));
    assert_eq!(off(1010).bytes, 16 * 256);
    // A refresh that is over has been shown.
    let seen = off(1700);
    assert_eq!((seen.refreshes, seen.dry), (vec![vec![(0, 0)]], Vec::new()));
}
