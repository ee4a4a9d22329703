//! The history of a pixel ends with what the picture has there, and says how each fragment ended.

use gfx::format::{Format, TexelKind};
use gfx::state::*;
use num::{Random, TextureId};
use run::pixel::{Fragment, History, PixelQuery, Texel, Touch, history};
use run::replay::Fidelity;
use trace::Trace;
use trace::command::*;
use trace::record::{self, Recorder};
use work::SurfaceKey;

use super::sequence::{Sequence, instance, shader};
use super::{of_seed, replayed};

/// The history of a pixel of a texture; none: of what the frame shows.
fn told(trace: &Trace, frame: u32, at: [u32; 2], texture: Option<TextureId>) -> History {
    let target = texture.map(|texture| SurfaceKey { texture: texture.0, level: 0, layer: 0 });
    history(trace, &PixelQuery { frame, at, target }).unwrap_or_else(|error| panic!("frame {frame}, {at:?}: {error:#}"))
}

/// What the last event leaves on the surface of a history.
fn left(history: &History) -> Option<&[Texel]> {
    let changes = history.events.iter().rev().flat_map(|event| &event.changes);
    changes.into_iter().find(|change| change.surface.key == history.surface.key).map(|change| &*change.after)
}

#[test]
fn histories_of_random_sequences_end_with_the_pixel_of_the_picture() {
    let (mut fragments, mut others) = (0, 0);
    for seed in 0..24 {
        let Sequence { trace, .. } = of_seed(seed);
        let mut random = Random::nth(59, seed);
        for (frame, picture) in (0..).zip(replayed(&trace, Fidelity::Functional, None)) {
            let surface = told(&trace, frame, [0, 0], None).surface;
            let at = [random.below(surface.width), random.below(surface.height)];
            let told = told(&trace, frame, at, None);
            let size = surface.format.block_bytes() as usize;
            let first = (at[1] * surface.width + at[0]) as usize * size;
            let bytes: Vec<u8> = told.last[0].iter().flat_map(|word| word.to_le_bytes()).take(size).collect();
            assert!(told.shown && bytes == picture[first..first + size], "seed {seed}, frame {frame}, {at:?}: {told:?}");
            assert_eq!(left(&told), Some(&*told.last), "seed {seed}, frame {frame}, {at:?}: the last event leaves it");
            for event in &told.events {
                match event.touch {
                    Touch::Fragment(_) => fragments += 1,
                    _ => others += 1,
                }
            }
        }
    }
    assert!(fragments > 100 && others > 100, "{fragments} fragments and {others} other events");
}

/// Two frames: the first draws into four samples, the second loads them and draws nothing.
struct Samples {
    trace: Trace,
    color: TextureId,
    depth: TextureId,
}

const SIZE: [u32; 2] = [20, 12];

fn samples() -> Samples {
    let mut card = Recorder::new("samples");
    let (format, depth_format) = (Format::Rgba8Unorm, Format::Depth24PlusStencil8);
    let make = |card: &mut Recorder, format, samples| {
        let texture = card.create_texture("image", record::texture_multisampled(SIZE[0], SIZE[1], samples, format));
        (texture, card.create_view(texture))
    };
    let (color, color_view) = make(&mut card, format, 4);
    let (depth, depth_view) = make(&mut card, depth_format, 4);
    let (shown, shown_view) = make(&mut card, format, 1);
    let face = StencilFace { compare: Compare::NotEqual, pass_op: StencilOp::Replace, ..StencilFace::default() };
    let mut pipeline = |discards, blend, stencil: bool| {
        let module = card.create_shader("draw", &shader(&[Some(TexelKind::Float)], discards));
        let faces = if stencil { face } else { StencilFace::default() };
        let desc = RenderPipelineDesc {
            depth_stencil: Some(DepthStencil {
                depth_write: true,
                depth_compare: Compare::Less,
                stencil_front: faces,
                stencil_back: faces,
                ..record::depth_less(depth_format)
            }),
            multisample: Multisample { count: 4, ..Multisample::default() },
            targets: vec![Some(ColorTarget { format, blend, logic: None, write_mask: 15 })],
            ..record::render_pipeline(module, format)
        };
        card.create_render_pipeline("draw", desc)
    };
    let half = BlendComponent { op: BlendOp::Add, src: BlendFactor::SrcAlpha, dst: BlendFactor::OneMinusSrcAlpha };
    let pipelines = [
        pipeline(false, None, false),
        pipeline(true, None, false),
        pipeline(false, Some(Blend { color: half, alpha: half }), false),
        pipeline(false, None, true),
    ];
    let resolved = |clear| ColorAttachment { resolve: Some(shown_view), clear, ..record::load(color_view) };
    {
        let cleared = DepthAttachment { depth_clear: Some(1.0), stencil_clear: Some(7), ..record::load_depth(depth_view) };
        let mut pass = card.begin_render_pass([resolved(Some([0.5, 0.25, 0.125, 1.0]))], Some(cleared));
        let mut draw = |pipeline: usize, [low, high]: [[u32; 2]; 2], depth, color, reference| {
            pass.set_pipeline(pipelines[pipeline]);
            pass.push(Command::SetStencilReference(reference));
            pass.draw_from(6, 1, 0, instance(low, high, depth, color));
        };
        draw(0, [[1, 1], [6, 7]], 4, 0x0_1234, 0);
        draw(0, [[0, 0], [8, 8]], 6, 0x0_0666, 0);
        draw(1, [[0, 2], [8, 5]], 3, 0x0_0f0f, 0);
        draw(2, [[3, 0], [8, 8]], 2, 0x2_0505, 0);
        draw(3, [[0, 0], [4, 8]], 1, 0x0_0a5a, 7);
        draw(3, [[2, 0], [7, 8]], 1, 0x0_0733, 9);
    }
    card.present(shown);
    drop(card.begin_render_pass([resolved(None)], Some(record::load_depth(depth_view))));
    card.present(shown);
    Samples { trace: card.finish(), color, depth }
}

#[test]
fn all_samples_are_followed() {
    let Samples { trace, color, depth } = samples();
    let (mut partly, mut ends) = (0, [0; 5]);
    for at in (0..SIZE[1]).step_by(3).flat_map(|y| (0..SIZE[0]).step_by(2).map(move |x| [x, y])) {
        for texture in [color, depth] {
            let (first, second) = (told(&trace, 0, at, Some(texture)), told(&trace, 1, at, Some(texture)));
            assert_eq!(first.last.len(), 4);
            // The renderer hands over what the second frame loads, all samples of it.
            assert!(matches!(second.events[0].touch, Touch::Found), "{at:?}: {:?}", second.events);
            assert_eq!(second.events[0].changes[0].after, first.last, "{texture:?} {at:?}: {:#?}", first.events);
            assert_eq!(second.last, first.last);
            for event in &first.events {
                let Touch::Fragment(fragment) = &event.touch else { continue };
                let Fragment { covered, stencil_failed, depth_failed, discarded, passed, .. } = **fragment;
                let parts = [stencil_failed, depth_failed, discarded, passed];
                assert_eq!(parts.iter().map(|mask| mask.count_ones()).sum::<u32>(), covered.count_ones(), "{fragment:?}");
                assert_eq!(parts.iter().fold(0, |all, mask| all | mask), covered, "{fragment:?}");
                partly += u32::from(covered != 15);
                let blended = event.changes.iter().any(|change| change.blended);
                let kinds = [stencil_failed != 0, depth_failed != 0, discarded != 0, passed != 0, blended && passed != 0];
                ends.iter_mut().zip(kinds).for_each(|(count, is)| *count += u32::from(is));
            }
        }
    }
    assert!(partly > 0 && ends.iter().all(|&count| count > 0), "{partly} {ends:?}");
}

#[test]
fn a_history_has_what_was_resolved_and_nothing_of_other_surfaces() {
    let Samples { trace, color, .. } = samples();
    let at = [7, 5];
    let shown = told(&trace, 0, at, None);
    let (drawn, resolved) = shown.events.split_at(shown.events.len() - 1);
    assert!(matches!(resolved[0].touch, Touch::Resolved(key) if key.texture == color.0), "{resolved:?}");
    let own = told(&trace, 0, at, Some(color));
    assert_eq!(format!("{drawn:?}"), format!("{:?}", own.events));
    let numbers: Vec<u32> = drawn
        .iter()
        .filter_map(|event| match &event.touch {
            Touch::Fragment(fragment) => Some(fragment.draw.number),
            _ => None,
        })
        .collect();
    assert_eq!(numbers, [0, 1, 2, 3, 4, 5], "in the order of the trace");
}

#[test]
fn what_is_not_there_is_named() {
    let Samples { trace, color, .. } = samples();
    let wrong = |frame, at, texture: u32| {
        let target = Some(SurfaceKey { texture, level: 0, layer: 0 });
        format!("{:#}", history(&trace, &PixelQuery { frame, at, target }).unwrap_err())
    };
    assert_eq!(wrong(0, [20, 0], color.0), "texture 0 has 20 x 12 pixels: it has none at 20,0");
    assert_eq!(wrong(0, [0, 0], 9), "frame 0 does not draw to texture 9: it draws to texture 0; texture 1; texture 2");
    assert_eq!(wrong(5, [0, 0], 0), "the trace has no frame 5; it has 2, numbered from 0");
}
