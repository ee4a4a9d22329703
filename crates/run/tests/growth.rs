//! Memory does not grow with the frames of a sequence, in any fidelity.
#![allow(unsafe_code, reason = "an allocator that counts")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::num::NonZeroU32;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use gfx::format::Format;
use machine::Config;
use run::replay::{Fidelity, Options, replay_to};
use run::sample::Sampling;
use trace::command::Command;
use trace::record::{self, Recorder};
use trace::{Packing, Trace};

/// Counts the bytes that are alive, and the most that were.
struct Counting;

static ALIVE: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call goes to the system allocator as it is.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let alive = ALIVE.fetch_add(layout.size(), Relaxed) + layout.size();
        MOST.fetch_max(alive, Relaxed);
        // SAFETY: the caller's promise, passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        ALIVE.fetch_sub(layout.size(), Relaxed);
        // SAFETY: the caller's promise, passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

/// A sequence of small frames, each of which loads what the one before has left. Their commands are long, as those of real frames are.
fn sequence(frames: u32) -> Trace {
    const SOURCE: &str = "
        var<immediate> frame: u32;
        @vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
            let size = 0.2 + f32(frame % 7u) * 0.1;
            return vec4f(f32(i & 1u) * size - 0.5, f32(i >> 1u) * size - 0.5, 0.5, 1.0);
        }
        @fragment fn fs() -> @location(0) vec4f { return vec4f(f32(frame & 255u) / 255.0); }";
    let mut card = Recorder::new("sequence");
    let shader = card.create_shader("program", SOURCE);
    let format = Format::Rgba8Unorm;
    let mut desc = record::render_pipeline(shader, format);
    (desc.vertex, desc.fragment) = (record::stage_entry(shader, "vs"), Some(record::stage_entry(shader, "fs")));
    let pipeline = card.create_render_pipeline("", desc);
    let window = card.create_texture("window", record::texture_2d(16, 16, format));
    let view = card.create_view(window);
    for frame in 0..frames {
        let color = if frame == 0 { record::clear(view, [0.0; 4]) } else { record::load(view) };
        card.push(Command::PushDebugGroup("a frame with a long name ".repeat(20)));
        card.push(Command::PopDebugGroup);
        let mut pass = card.begin_render_pass([color], None);
        pass.set_pipeline(pipeline);
        pass.set_immediates(0, &[frame]);
        pass.draw(3, 1);
        drop(pass);
        card.present(window);
    }
    card.finish()
}

/// The most bytes that are alive while a file is replayed, beyond those that were before.
fn most(path: &std::path::Path, options: &Options) -> usize {
    let before = ALIVE.load(Relaxed);
    MOST.store(before, Relaxed);
    let trace = Trace::open(path).expect("it opens");
    let mut frames = 0;
    let mut taker = |_| {
        frames += 1;
        Ok(())
    };
    replay_to(&trace, options, &|_| (), &mut taker).expect("it is replayed");
    assert!(frames > 0);
    MOST.load(Relaxed) - before
}

#[test]
fn four_times_the_frames_take_no_more_memory() {
    const FRAMES: u32 = 600;
    // A few bytes of each frame may stay: 36. Where machines run side by side more waits sometimes, as the host has it.
    const SPARE: usize = 64 << 10;
    const BESIDE: usize = 512 << 10;
    let folder = tempfile::tempdir().expect("a folder");
    let [short, long] = [FRAMES, 4 * FRAMES].map(|frames| {
        let path = folder.path().join(format!("{frames}.zip"));
        trace::write_zip(&sequence(frames), &path, Packing::Deflated).expect("written");
        path
    });
    let sampling = Sampling { samples: 4, ..Sampling::default() };
    let fidelities = [
        (Fidelity::Functional, None),
        (Fidelity::Bound, None),
        (Fidelity::BoundSampled(sampling), None),
        (Fidelity::Sampled(sampling), None),
        (Fidelity::Cycle, None),
        (Fidelity::Cycle, NonZeroU32::new(4)),
    ];
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        for (fidelity, frames_per_run) in fidelities {
            let config = Config::built_in("tiny").expect("it is built in");
            let options = Options { frames_per_run, pictures: false, ..Options::new(config, fidelity) };
            // The first replay makes what the process keeps.
            pool.install(|| most(&short, &options));
            let spare = if threads == 1 { SPARE } else { BESIDE };
            // A busy host can hold one thread back, so that the results of others wait for it. What grows with the frames does so in each
            // replay.
            let grows = |_| {
                let [short, long] = [&short, &long].map(|path| pool.install(|| most(path, &options)));
                (long > short + spare).then_some([short, long])
            };
            let grown: Option<Vec<_>> = (0..3).map(grows).collect();
            assert!(
                grown.is_none(),
                "{fidelity:?}, {frames_per_run:?}, {threads} threads: bytes of few and of many frames: {grown:?}"
            );
        }
    }
}
