//! A texture that is drawn into, read, and written by copies, by turns: tiles and bytes of an image are two copies of it, of which each must
//! know what happened to the other.

use super::common::*;
use gfx::format::Format;
use gfx::state::{Aspect, Rect};
use num::TextureId;
use trace::command::*;
use trace::record;

const SHADER: &str = "
    @group(0) @binding(0) var<uniform> color: vec4<f32>;
    @vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4<f32> {
        return vec4(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.5, 1.0);
    }
    @fragment fn fill() -> @location(0) vec4<f32> { return color; }
    @group(0) @binding(0) var image: texture_2d<f32>;
    @fragment fn show(@builtin(position) p: vec4<f32>) -> @location(0) vec4<f32> {
        return textureLoad(image, vec2<u32>(p.xy), 0);
    }";

const SIZE: [u32; 2] = [150, 100];

/// Where a texture is copied to or from.
fn end(texture: TextureId, at: [u32; 2]) -> TextureEnd {
    TextureEnd { texture, level: 0, origin: [at[0], at[1], 0], aspect: Aspect::All }
}

#[test]
fn an_image_that_is_drawn_read_and_written_by_turns_has_the_last_of_all() {
    let mut lab = Lab::new();
    let mut next = unit_noise(3);
    let mut below = |n: u32| (next() * n as f32) as u32;
    let create = |lab: &mut Lab| lab.card.create_texture("", record::texture_2d(SIZE[0], SIZE[1], Format::Rgba8Unorm));
    let [image, shown, other] = [(); 3].map(|()| create(&mut lab));
    let [image_view, shown_view] = [image, shown].map(|texture| lab.card.create_view(texture));
    let shader = lab.card.create_shader("program", SHADER);
    let mut pipeline = |entry: &str| {
        let mut desc = record::render_pipeline(shader, Format::Rgba8Unorm);
        desc.vertex.entry = Some("vs".into());
        desc.fragment.as_mut().expect("a stage").entry = Some(entry.into());
        lab.card.create_render_pipeline("", desc)
    };
    let [fill, show] = ["fill", "show"].map(&mut pipeline);
    let color = lab.card.create_buffer("color", 16);
    let filled = lab.group(AnyPipeline::Render(fill), 0, [record::whole(color)]);
    let read = lab.group(AnyPipeline::Render(show), 0, [BoundResource::View(image_view)]);

    let mut model = vec![0_u32; (SIZE[0] * SIZE[1]) as usize];
    let mut wanted = Vec::new();
    for step in 0..90 {
        let code = 0x0101_0101 * (step + 1);
        let size = SIZE.map(|extent| 1 + below(extent));
        let at: [u32; 2] = std::array::from_fn(|k| below(SIZE[k] - size[k] + 1));
        let rect = Rect { x: at[0], y: at[1], width: size[0], height: size[1] };
        let texels = vec![code; (size[0] * size[1]) as usize];
        match below(4) {
            0 => {
                let layout = LinearLayout { offset: 0, bytes_per_row: Some(4 * size[0]), rows_per_image: None };
                lab.card.write_texture(end(image, at), layout, [size[0], size[1], 1], "texels", &bytes(&texels));
            }
            1 => {
                let layout = LinearLayout { offset: 0, bytes_per_row: Some(4 * size[0]), rows_per_image: None };
                lab.card.write_texture(end(other, at), layout, [size[0], size[1], 1], "texels", &bytes(&texels));
                lab.card.copy_texture_to_texture(end(other, at), end(image, at), [size[0], size[1], 1]);
            }
            kind => {
                let shade = [(step + 1) as f32 / 255.0; 4];
                lab.card.write_buffer(color, 0, "color", bytes(&bits(&shade)));
                // A clear of the whole image now and then.
                let clears = kind == 3 && below(3) == 0;
                if clears {
                    model.fill(0);
                }
                let attachment = if clears { record::clear(image_view, [0.0; 4]) } else { record::load(image_view) };
                let mut pass = lab.card.begin_render_pass([attachment], None);
                pass.set_pipeline(fill);
                pass.set_bind_group(0, filled);
                pass.set_scissor(rect);
                pass.draw(3, 1);
            }
        }
        for y in at[1]..at[1] + size[1] {
            let row = (y * SIZE[0] + at[0]) as usize;
            model[row..row + size[0] as usize].fill(code);
        }
        // Not after each step, so that some follow each other unread.
        if below(3) > 0 {
            let mut pass = lab.card.begin_render_pass([record::clear(shown_view, [0.0; 4])], None);
            pass.set_pipeline(show);
            pass.set_bind_group(0, read);
            pass.draw(3, 1);
            drop(pass);
            lab.card.present(shown);
            wanted.push((step, bytes(&model)));
        }
    }
    let frames = lab.frames().expect("all of it runs");
    assert_eq!(frames.len(), wanted.len());
    for (frame, (step, model)) in frames.iter().zip(&wanted) {
        assert!(frame == model, "the picture after step {step}");
    }
}
