//! Sprites of the display, from a recorded trace to the screen: on all classes and fidelities, with either display.

use crate::common::config;
use fillrate::gfx::format::Format;
use fillrate::machine::config::SortClass;
use fillrate::run::replay::{Fidelity, Frame, Options, Replay, replay};
use fillrate::run::sample::Sampling;
use fillrate::trace::Trace;
use fillrate::trace::record::{self, Recorder};

const SIZE: [u32; 2] = [96, 64];
const SPRITE: [u32; 2] = [16, 12];
const FRAMES: u32 = 8;

/// Where sprite `index` is in a frame: they cross each other, and leave the screen.
fn at(index: u32, frame: u32) -> [i32; 2] {
    let (index, frame) = (index as i32, frame as i32);
    [10 * index + (7 - 3 * index) * frame - 8, 50 - 9 * frame + 4 * index]
}

/// A texel of a sprite's image; its corners are transparent.
fn texel(index: u32, x: u32, y: u32) -> [u8; 4] {
    let edge = u32::min(x, SPRITE[0] - 1 - x) + u32::min(y, SPRITE[1] - 1 - y);
    [200, 40 * index as u8, (16 * x) as u8, if edge < 4 { 0 } else { 255 }]
}

/// Frames of one colour each, under three sprites; the last of these has an image that a pass draws anew in each frame. The second is not shown in
/// frames 4 and 5.
fn scene(sprites: bool, window: Format) -> Trace {
    let mut card = Recorder::new("sprites");
    let shown = card.create_texture("window", record::texture_2d(SIZE[0], SIZE[1], window));
    let target = card.create_view(shown);
    let images: Vec<_> = (0..3)
        .map(|index| {
            let image = card.create_texture("sprite", record::texture_2d(SPRITE[0], SPRITE[1], Format::Rgba8Unorm));
            let texels: Vec<u8> = (0..SPRITE[0] * SPRITE[1]).flat_map(|i| texel(index, i % SPRITE[0], i / SPRITE[0])).collect();
            card.write_level(image, 0, "texels", &texels);
            card.create_view(image)
        })
        .collect();
    for frame in 0..FRAMES {
        drop(card.begin_render_pass([record::clear(target, [f64::from(frame) / 8.0, 0.25, 0.5, 1.0])], None));
        if sprites {
            drop(card.begin_render_pass([record::clear(images[2], [0.0, f64::from(frame) / 8.0, 1.0, 1.0])], None));
            for index in 0..3 {
                let view = (index != 1 || !(4..6).contains(&frame)).then_some(images[index as usize]);
                card.set_sprite(2 * index, view, at(index, frame));
            }
        }
        card.present(shown);
    }
    card.finish()
}

/// The texel of a sprite's image in a frame.
fn now(index: u32, frame: u32, x: u32, y: u32) -> [u8; 4] {
    if index == 2 { [0, (255.0 * f64::from(frame) / 8.0).round() as u8, 255, 255] } else { texel(index, x, y) }
}

/// The sprites of a frame on a pixel, by index, with their texels: from the definition.
fn on(frame: u32, [x, y]: [i32; 2]) -> Vec<(u32, [u8; 4])> {
    let of = |index: u32| {
        let [u, v] = [x - at(index, frame)[0], y - at(index, frame)[1]];
        let inside = u >= 0 && v >= 0 && u < SPRITE[0] as i32 && v < SPRITE[1] as i32;
        let there = inside && (index != 1 || !(4..6).contains(&frame));
        there.then(|| (2 * index, now(index, frame, u as u32, v as u32))).filter(|(_, texel)| texel[3] != 0)
    };
    (0..3).filter_map(of).collect()
}

/// The picture of a frame with its sprites, over what the frame buffer has.
fn expected(frame: u32, below: &[u8], swapped: bool) -> Vec<u8> {
    let mut bytes = below.to_vec();
    for (pixel, bytes) in (0..).zip(bytes.chunks_exact_mut(4)) {
        if let Some(&(_, [r, g, b, a])) = on(frame, [(pixel % SIZE[0]) as i32, (pixel / SIZE[0]) as i32]).first() {
            bytes.copy_from_slice(&if swapped { [b, g, r, a] } else { [r, g, b, a] });
        }
    }
    bytes
}

/// The pairs that meet in a frame, each with its first line.
fn meetings(frame: u32) -> Vec<([u8; 2], u32)> {
    let mut found: Vec<([u8; 2], u32)> = Vec::new();
    for (y, x) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (y, x))) {
        let here: Vec<u8> = on(frame, [x as i32, y as i32]).iter().map(|(index, _)| *index as u8).collect();
        for (at, &low) in here.iter().enumerate() {
            for &high in &here[at + 1..] {
                if !found.iter().any(|(pair, _)| *pair == [low, high]) {
                    found.push(([low, high], y));
                }
            }
        }
    }
    found.sort();
    found
}

fn run(trace: &Trace, class: &str, fidelity: Fidelity, changes: &[&str]) -> Replay {
    replay(trace, &Options::new(config(class, changes), fidelity), &|_| ()).expect("a replay")
}

fn below(frame: &Frame) -> &[u8] {
    &frame.shown.as_ref().expect("a picture").1
}

#[test]
fn every_class_shows_them_over_the_picture_and_tells_which_meet() {
    assert!((0..FRAMES).any(|frame| meetings(frame).len() > 1), "some meet");
    for (format, swapped) in [(Format::Rgba8Unorm, false), (Format::Bgra8UnormSrgb, true)] {
        let (with, without) = (scene(true, format), scene(false, format));
        for class in SortClass::NAMES {
            let (told, plain) = (run(&with, class, Fidelity::Cycle, &[]), run(&without, class, Fidelity::Cycle, &[]));
            let (mut met, mut sprites) = (0, 0);
            for (frame, same) in told.frames.iter().zip(&plain.frames) {
                // The framebuffer does not contain them.
                assert_eq!(below(frame), below(same), "{class}: frame {}", frame.number);
                let [refresh] = &frame.display.refreshes[..] else { panic!("{class}: one picture a frame") };
                assert_eq!((refresh.number, refresh.parts.len()), (frame.number.into(), 1));
                assert!(
                    refresh.picture().1 == expected(frame.number, below(frame), swapped),
                    "{class}: frame {}",
                    frame.number
                );
                let mut found: Vec<_> = refresh.collisions().iter().map(|(_, found)| (found.pair, found.line)).collect();
                found.sort();
                assert_eq!(found, meetings(frame.number), "{class}: frame {}", frame.number);
                met += found.len();
                sprites += if (4..6).contains(&frame.number) { 2 } else { 3 };
                // Their images are read once per frame, by the command processor.
                let read = |frame: &Frame| frame.tree.number("memory.clients.command.read_bytes").expect("bytes");
                let images = f64::from(if (4..6).contains(&frame.number) { 2 } else { 3 } * 4 * SPRITE[0] * SPRITE[1]);
                assert_eq!(read(frame) - read(same), images, "{class}: frame {}", frame.number);
                assert!(same.display.refreshes.is_empty());
            }
            let total = |name: &str| told.total.number(name).expect("a counter") as usize;
            assert_eq!((total("sprites.shown"), total("sprites.collisions")), (sprites, met), "{class}");
        }
    }
}

#[test]
fn a_display_that_runs_free_shows_each_frame_with_its_own() {
    let trace = scene(true, Format::Rgba8Unorm);
    let free = ["scanout.mode=free-running", "scanout.blank_lines=4"];
    for (swap, line) in [("vsync", 20), ("immediate", 31), ("copy", 23)] {
        let changes = [free[0], free[1], &format!("scanout.swap={swap}"), &format!("scanout.line_cycles={line}")];
        let told = run(&trace, "sort-middle", Fidelity::Cycle, &changes);
        let refreshes: Vec<_> = told.frames.iter().flat_map(|frame| &frame.display.refreshes).collect();
        assert!(!refreshes.is_empty(), "{swap}");
        let (mut torn, row) = (0, 4 * SIZE[0] as usize);
        for refresh in refreshes {
            let (picture, ends) = (refresh.picture().1, refresh.parts.iter().skip(1).map(|part| part.0).chain([SIZE[1]]));
            for ((first, frame), end) in refresh.parts.iter().zip(ends) {
                let lines = *first as usize * row..end as usize * row;
                let whole = expected(frame.frame, &frame.bytes, false);
                assert!(picture[lines.clone()] == whole[lines], "{swap}: refresh {} from line {first}", refresh.number);
            }
            torn += u32::from(refresh.parts.len() > 1);
        }
        assert_eq!(torn > 0, swap != "vsync", "{swap}: {torn} pictures are torn");
    }
}

#[test]
fn runs_of_frames_and_samples_show_what_one_machine_shows() {
    let trace = scene(true, Format::Rgba8Unorm);
    let whole = run(&trace, "sort-middle", Fidelity::Cycle, &[]);
    let pictures = |replay: &Replay| -> Vec<(u32, Vec<u8>)> {
        let shown = replay.frames.iter().flat_map(|frame| &frame.display.refreshes);
        shown.map(|refresh| (refresh.number as u32, refresh.picture().1)).collect()
    };
    let all = pictures(&whole);
    let options =
        Options { frames_per_run: std::num::NonZeroU32::new(3), ..Options::new(config("sort-middle", &[]), Fidelity::Cycle) };
    assert!(pictures(&replay(&trace, &options, &|_| ()).expect("a replay")) == all);
    let sampling = Sampling { samples: 3, ..Sampling::default() };
    let some = pictures(&run(&trace, "sort-middle", Fidelity::Sampled(sampling), &[]));
    assert!(some.len() >= 3 && some.iter().all(|picture| all.contains(picture)), "{} pictures", some.len());
    // The estimates include the bytes that are read for them.
    let without = scene(false, Format::Rgba8Unorm);
    let read = |trace: &Trace| run(trace, "sort-middle", Fidelity::Bound, &[]).total.number("cycles").expect("cycles");
    assert!(read(&trace) > read(&without));
    // A renderer alone has no display.
    let plain = run(&trace, "sort-middle", Fidelity::Functional, &[]);
    assert!(pictures(&plain).is_empty() && plain.frames.iter().zip(&whole.frames).all(|(a, b)| below(a) == below(b)));
}
