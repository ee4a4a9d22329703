//! The history of a pixel: the draws that touch it in a frame, in the order of the trace, and how each of their fragments ends.
//!
//! The pixel is followed through the work of a rendering: the quads that cover it go through the tests and blends of the ROPs, one after the
//! other. No machine is simulated. So hierarchical Z is not told apart from the early test, which rejects the same fragments.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use anyhow::{Result, anyhow, bail};

use super::rendering::{Consumer, Rendering, Work};
use gfx::format::Format;
use gfx::rop::{self, ColorState, DepthStencilState};
use gfx::state::{ColorTarget, Compare, DepthStencil};
use gfx::texel;
use num::OUR_FAULT;
use render::{self, ConsumerMemory, FrameSet};
use trace::Trace;
use unit::depths::sample_depths;
use work::{
    Aspects, Attachment, BLOCK, Class, Draw, EndFrame, Event, Load, Pass, QUAD_SHADED, Quad, RenderKey, Segment, Surface,
    SurfaceKey, Target, TileWork, Transfer,
};

/// Events that are kept of a pixel: the last ones.
const EVENTS: usize = 1 << 16;

/// A stored texel in little-endian words. A texel of up to 4 bytes has one word, the others are 0.
pub type Texel = [u32; 4];

/// The pixel of which the history is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelQuery {
    /// The frame, from 0.
    pub frame: u32,
    /// Column and row from the upper left corner, from 0.
    pub at: [u32; 2],
    /// The surface. None: the one that the frame shows.
    pub target: Option<SurfaceKey>,
}

/// How a surface changes at the pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// The surface, in the format in which it is written.
    pub surface: Surface,
    /// The stored texel of each sample before.
    pub before: Vec<Texel>,
    /// The stored texel of each sample after.
    pub after: Vec<Texel>,
    /// Whether the new value was computed from the one before.
    pub blended: bool,
}

/// A fragment at the pixel. Its masks have a bit for each sample, the first one in bit 0.
#[derive(Clone, Debug)]
pub struct Fragment {
    /// The draw.
    pub draw: Arc<Draw>,
    /// Number of the primitive in its draw, from 0.
    pub primitive: u64,
    /// Whether the primitive faces away.
    pub back: bool,
    /// Whether depth and stencil are tested before shading.
    pub early: bool,
    /// Depth of the first sample that the primitive covers, from 0 to 1; none if nothing tests or stores depths.
    pub depth: Option<f32>,
    /// Samples that the primitive covers.
    pub covered: u8,
    /// Samples that fail the stencil test.
    pub stencil_failed: u8,
    /// Samples that pass the stencil test and fail the depth test.
    pub depth_failed: u8,
    /// Samples that the shader discards, by itself, its sample mask or alpha to coverage.
    pub discarded: u8,
    /// Samples that pass all tests.
    pub passed: u8,
    /// Instructions of the invocation by [`Class`]; zeros if the fragment is not shaded.
    pub instructions: [u32; Class::COUNT],
    /// Requests to textures and memory that the invocation's quad makes.
    pub requests: u32,
}

/// What touches the pixel.
#[derive(Clone, Debug)]
pub enum Touch {
    /// No draw of this frame has written the value: an upload, a copy of a part, a compute shader, or an earlier frame.
    Found,
    /// A pass clears the surface as it begins.
    Cleared,
    /// A fragment of a draw.
    Fragment(Box<Fragment>),
    /// The samples of another surface are resolved to this one.
    Resolved(SurfaceKey),
    /// Another surface is copied to this one.
    Copied(SurfaceKey),
    /// A pass ends that does not keep the surface, which becomes zeros.
    NotKept,
}

/// Something that touches the pixel.
#[derive(Clone, Debug)]
pub struct PixelEvent {
    /// The pass in which it happens; none between passes.
    pub pass: Option<Arc<Pass>>,
    /// What it is.
    pub touch: Touch,
    /// Surfaces that it writes, or that a fragment would have written if it had passed its tests.
    pub changes: Vec<Change>,
}

/// The history of a pixel in a frame.
#[derive(Clone, Debug)]
pub struct History {
    /// The surface.
    pub surface: Surface,
    /// Whether the frame shows this surface.
    pub shown: bool,
    /// The display's sprite that covers the pixel in the picture, if there is one.
    pub sprite: Option<u8>,
    /// What touches the pixel of the surface, or of those that are resolved or copied to it afterwards, in the order of the trace.
    pub events: Vec<PixelEvent>,
    /// Earlier events that are left out, because there are too many.
    pub left_out: u64,
    /// The stored texel of each sample at the end of the frame.
    pub last: Vec<Texel>,
}

/// Follows a pixel through a frame.
///
/// # Errors
/// If the trace cannot be rendered, or has no such frame, surface or pixel.
pub fn history(trace: &Trace, query: &PixelQuery) -> Result<History> {
    let frames = FrameSet::from(query.frame..query.frame.saturating_add(1));
    let mut found = None;
    let mut rendering = Rendering::new(trace, render::Options { frames, ..render::Options::default() });
    let out = &mut found;
    let run = move |work: Work| {
        let mut follower = Follower::new(query.at);
        for event in work {
            if let Event::EndFrame(end) = &event {
                *out = Some(std::mem::replace(&mut follower, Follower::new(query.at)).end(end, query)?);
            } else {
                follower.event(&event)?;
            }
        }
        Ok(())
    };
    let consumer = Consumer { memory: ConsumerMemory::default(), recorded: true, stored: false, run: Box::new(run) };
    rendering.consume(RenderKey::default(), consumer);
    rendering.run()?;
    match found {
        Some(history) => Ok(history),
        None => bail!("the trace has {}", super::replay::no_frames(trace, &(query.frame..query.frame.saturating_add(1)))?),
    }
}

/// The name of a surface: its texture, with level and layer where they are not 0.
pub fn surface_name(SurfaceKey { texture, level, layer }: SurfaceKey) -> String {
    let mut name = format!("texture {texture}");
    for (what, number) in [("level", level), ("layer", layer)] {
        if number > 0 {
            name.push_str(&format!(", {what} {number}"));
        }
    }
    name
}

/// A surface at the quad that has the pixel.
struct Followed {
    surface: Surface,
    /// The codes of the quad, in the order of [`rop`].
    codes: Vec<u32>,
}

impl Followed {
    fn new(surface: Surface) -> Followed {
        let words = 4 * surface.samples as usize * rop::code_words(surface.format);
        Followed { surface, codes: vec![0; words] }
    }

    fn words(&self) -> usize {
        rop::code_words(self.surface.format)
    }

    /// The texels of the samples of one of the quad's pixels.
    fn texels(&self, pixel: usize) -> Vec<Texel> {
        let samples = self.codes.chunks_exact(4 * self.words());
        let texel = |codes: &[u32]| {
            let mut texel = [0; 4];
            texel.iter_mut().zip(codes.chunks_exact(4)).for_each(|(word, pixels)| *word = pixels[pixel]);
            texel
        };
        samples.map(texel).collect()
    }

    /// Sets the bits of all texels that `mask` selects.
    fn set(&mut self, value: Texel, mask: Texel) {
        let words = self.words();
        for (at, run) in self.codes.chunks_exact_mut(4).enumerate() {
            let word = at % words;
            run.iter_mut().for_each(|code| *code = *code & !mask[word] | value[word] & mask[word]);
        }
    }

    /// Sets the texels of one of the quad's pixels.
    fn put(&mut self, pixel: usize, texels: &[Texel]) {
        let words = self.words();
        for (codes, texel) in self.codes.chunks_exact_mut(4 * words).zip(texels) {
            codes.chunks_exact_mut(4).zip(texel).for_each(|(pixels, &word)| pixels[pixel] = word);
        }
    }
}

/// The texels of a pixel's samples in bytes laid out as in [`Contents`](work::Contents); none if the bytes are too few.
fn texels_of(surface: &Surface, bytes: &[u8], [x, y]: [u32; 2]) -> Option<Vec<Texel>> {
    let size = surface.format.block_bytes() as usize;
    let pixel = size * surface.samples as usize;
    let first = (y as usize * surface.width as usize + x as usize) * pixel;
    let texel = |bytes: &[u8]| {
        let mut texel = [[0; 4]; 4];
        texel.as_flattened_mut()[..size].copy_from_slice(bytes);
        texel.map(u32::from_le_bytes)
    };
    Some(bytes.get(first..first + pixel)?.chunks_exact(size).map(texel).collect())
}

/// Follows a pixel through the events of a frame.
struct Follower {
    at: [u32; 2],
    /// The surfaces that have such a pixel.
    surfaces: BTreeMap<SurfaceKey, Followed>,
    /// Surfaces of passes that are too small to have it.
    smaller: BTreeMap<SurfaceKey, Surface>,
    pass: Option<Arc<Pass>>,
    draw: Option<Arc<Draw>>,
    /// Primitives of the draw in the segments before this one.
    primitives: u64,
    events: VecDeque<PixelEvent>,
    left_out: u64,
}

impl Follower {
    fn new(at: [u32; 2]) -> Follower {
        Follower {
            at,
            surfaces: BTreeMap::new(),
            smaller: BTreeMap::new(),
            pass: None,
            draw: None,
            primitives: 0,
            events: VecDeque::new(),
            left_out: 0,
        }
    }

    /// The pixel's number in its quad.
    fn pixel(&self) -> usize {
        (self.at[1] % 2 * 2 + self.at[0] % 2) as usize
    }

    fn note(&mut self, touch: Touch, changes: Vec<Change>) {
        if self.events.len() == EVENTS {
            self.events.pop_front();
            self.left_out += 1;
        }
        self.events.push_back(PixelEvent { pass: self.pass.clone(), touch, changes });
    }

    /// The surface where it has the pixel; of zeros if it is new or has changed its shape.
    fn followed(&mut self, surface: &Surface) -> Option<&mut Followed> {
        if self.at[0] >= surface.width || self.at[1] >= surface.height {
            self.smaller.insert(surface.key, *surface);
            return None;
        }
        let followed = self.surfaces.entry(surface.key).or_insert_with(|| Followed::new(*surface));
        if followed.surface.store_shape() != surface.store_shape() {
            *followed = Followed::new(*surface);
        }
        followed.surface = *surface;
        Some(followed)
    }

    /// Changes a surface, and notes what has done so.
    fn change(&mut self, surface: &Surface, touch: Touch, change: impl FnOnce(&mut Followed)) {
        let pixel = self.pixel();
        let Some(followed) = self.followed(surface) else { return };
        let before = followed.texels(pixel);
        change(followed);
        let after = followed.texels(pixel);
        self.note(touch, vec![Change { surface: *surface, before, after, blended: false }]);
    }

    fn event(&mut self, event: &Event) -> Result<()> {
        match event {
            Event::Contents(contents) => {
                let (pixel, surface) = (self.pixel(), &contents.surface);
                if self.followed(surface).is_some() {
                    let texels = texels_of(surface, &contents.bytes, self.at)
                        .ok_or_else(|| anyhow!("the contents of a surface are too few bytes. {OUR_FAULT}"))?;
                    self.change(surface, Touch::Found, |followed| followed.put(pixel, &texels));
                }
            }
            Event::BeginPass(pass) => {
                self.pass = Some(pass.clone());
                for attachment in pass.attachments() {
                    self.begin(attachment);
                }
            }
            Event::Draw(draw) => (self.draw, self.primitives) = (Some(draw.clone()), 0),
            Event::Segment(segment) => self.segment(segment)?,
            Event::EndPass(_) => {
                if let Some(pass) = self.pass.clone() {
                    pass.attachments().for_each(|attachment| self.finish(attachment));
                }
                (self.pass, self.draw) = (None, None);
            }
            Event::Transfer(Transfer { surfaces: Some((from, to)), .. }) => {
                let pixel = self.pixel();
                if let Some(texels) = self.surfaces.get(&from.key).map(|followed| followed.texels(pixel)) {
                    self.change(to, Touch::Copied(from.key), |followed| followed.put(pixel, &texels));
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Clears what a pass clears of an attachment.
    fn begin(&mut self, attachment: &Attachment) {
        let format = attachment.surface.format;
        let value = |load: Load| if let Load::Clear(value) = load { Some(value) } else { None };
        let (code, mask) = if format.is_depth_stencil() {
            let depth = value(attachment.load).map(|value| f32::from_bits(value[0]));
            texel::depth_stencil_code(format, depth, value(attachment.stencil_load).map(|value| value[1]))
        } else {
            value(attachment.load).map_or(([0; 4], [0; 4]), |value| (texel::encode_code(format, value), [u32::MAX; 4]))
        };
        if mask == [0; 4] {
            self.followed(&attachment.surface);
        } else {
            self.change(&attachment.surface, Touch::Cleared, |followed| followed.set(code, mask));
        }
    }

    /// Resolves an attachment at the end of a pass, and forgets what is not kept of it.
    fn finish(&mut self, attachment: &Attachment) {
        let (pixel, surface) = (self.pixel(), &attachment.surface);
        let Some(followed) = self.surfaces.get(&surface.key) else { return };
        if let Some(to) = attachment.resolve {
            let words = followed.words();
            let samples: Vec<u32> = followed.texels(pixel).iter().flat_map(|texel| &texel[..words]).copied().collect();
            let mut resolved = [0; 4];
            rop::resolve(surface.format, &samples, &mut resolved[..words]);
            self.change(&to, Touch::Resolved(surface.key), |followed| followed.put(pixel, &[resolved]));
        }
        let (main, stencil) = match surface.format.is_depth_stencil() {
            true => texel::aspect_masks(surface.format),
            false => ([u32::MAX; 4], [0; 4]),
        };
        let lost = Aspects::of(surface.format).without(attachment.keeps);
        let bits = |lost: bool, mask: Texel| if lost { mask } else { [0; 4] };
        let (main, stencil) = (bits(lost.main, main), bits(lost.stencil, stencil));
        if lost.any() {
            let mask = std::array::from_fn(|w| main[w] | stencil[w]);
            self.change(surface, Touch::NotKept, |followed| followed.set([0; 4], mask));
        }
    }

    fn segment(&mut self, segment: &Segment) -> Result<()> {
        let (Some(pass), Some(draw)) = (self.pass.clone(), self.draw.clone()) else { return Ok(()) };
        if self.at[0] < pass.width && self.at[1] < pass.height {
            let [x, y] = self.at.map(|at| (at / BLOCK) as u16);
            let position = (self.at[1] % BLOCK / 2 * 4 + self.at[0] % BLOCK / 2) as u8;
            let bits = 0x1111 << self.pixel();
            for triangle in &segment.triangles {
                for visit in &segment.visits[triangle.first_visit as usize..][..triangle.visits as usize] {
                    let tile = &segment.tiles[visit.tile as usize];
                    let blocks = &tile.blocks[visit.first_block as usize..][..visit.blocks as usize];
                    for block in blocks.iter().filter(|block| (block.x, block.y) == (x, y)) {
                        let quads = &tile.quads[block.first_quad as usize..][..usize::from(block.quads)];
                        for quad in quads.iter().filter(|quad| quad.position == position && quad.coverage & bits != 0) {
                            self.fragment(&pass, &draw, triangle, (tile, quad))?;
                        }
                    }
                }
            }
        }
        self.primitives += segment.primitives.len() as u64;
        Ok(())
    }

    /// Takes the pixel's fragment of a quad through its tests and blends.
    fn fragment(
        &mut self,
        pass: &Pass,
        draw: &Arc<Draw>,
        triangle: &work::Triangle,
        (tile, quad): (&TileWork, &Quad),
    ) -> Result<()> {
        let pixel = self.pixel();
        let shaded = draw.shades();
        let covered = quad.coverage & 0x1111 << pixel;
        let mut live = covered;
        let mut fragment = Fragment {
            draw: draw.clone(),
            primitive: self.primitives + u64::from(triangle.primitive),
            back: triangle.back,
            early: draw.early || !shaded,
            depth: None,
            covered: samples(covered, pixel),
            stencil_failed: 0,
            depth_failed: 0,
            discarded: 0,
            passed: 0,
            instructions: [0; Class::COUNT],
            requests: 0,
        };
        // Each surface that the draw may write, before.
        let mut changes = Vec::new();
        let depth = pass.depth.as_ref().zip(draw.depth_stencil.as_ref());
        let outputs: Vec<(&Attachment, &Target)> = pass
            .color
            .iter()
            .zip(&draw.targets)
            .filter_map(|(attachment, target)| attachment.as_ref().zip(target.as_ref()))
            .collect();
        for (attachment, blended) in outputs
            .iter()
            .map(|(attachment, target)| (*attachment, color_state(attachment, target, draw).combines()))
            .chain(depth.iter().map(|(attachment, _)| (*attachment, false)))
        {
            if let Some(followed) = self.surfaces.get(&attachment.surface.key) {
                let (before, after) = (followed.texels(pixel), Vec::new());
                changes.push(Change { surface: attachment.surface, before, after, blended });
            }
        }
        if fragment.early {
            live = self.test(depth, triangle, (tile, quad), live, &mut fragment);
        }
        if shaded && live != 0 {
            if quad.flags & QUAD_SHADED == 0 {
                bail!("a quad of draw {} is visible and was not shaded. {OUR_FAULT}", draw.number);
            }
            let cost = &tile.invocations.costs[quad.cost];
            (fragment.instructions, fragment.requests) = (cost.instructions(), cost.requests() as u32);
            fragment.discarded = samples(live & !quad.kept, pixel);
            live &= quad.kept;
        }
        if !fragment.early {
            live = self.test(depth, triangle, (tile, quad), live, &mut fragment);
        }
        fragment.passed = samples(live, pixel);
        if shaded && live != 0 {
            for (attachment, target) in outputs {
                self.write(attachment, target, draw, (tile, quad), live);
            }
        }
        for change in &mut changes {
            change.after = self.surfaces[&change.surface.key].texels(pixel);
        }
        self.note(Touch::Fragment(Box::new(fragment)), changes);
        Ok(())
    }

    /// Tests depth and stencil, and writes what passes; gives the samples that are still alive.
    fn test(
        &mut self,
        depth: Option<(&Attachment, &DepthStencil)>,
        triangle: &work::Triangle,
        (tile, quad): (&TileWork, &Quad),
        live: u16,
        fragment: &mut Fragment,
    ) -> u16 {
        let (pixel, at) = (self.pixel(), self.at);
        let Some((attachment, state)) = depth.filter(|_| live != 0) else { return live };
        let Some(followed) = self.surfaces.get_mut(&attachment.surface.key) else { return live };
        let draw = &fragment.draw;
        let (references, format) = (draw.stencil_references.map(u32::from), attachment.surface.format);
        let tests = DepthStencilState::new(state, references, draw.depth_range);
        let count = attachment.surface.samples as usize;
        let mut codes = [[0_u32; 4]; 4];
        if !fragment.early && draw.depth_words > 0 {
            let words = &tile.payload[quad.payload as usize..];
            for (codes, words) in codes[..count].iter_mut().zip(words.chunks_exact(4)) {
                *codes = tests.code_quad(std::array::from_fn(|p| f32::from_bits(words[p])));
            }
        } else {
            let [x, y] = at.map(|at| (at & !1) as i32);
            sample_depths(&tests, triangle, x, y, count, &mut codes);
        }
        if format.has_depth() {
            let first = live.trailing_zeros() as usize / 4;
            fragment.depth = Some(texel::depth_value(format, codes[first][pixel]));
        }
        // The stencil test alone says which of the two tests a sample fails.
        let alone = DepthStencil { depth_compare: Compare::Always, depth_write: false, ..*state };
        let alone = DepthStencilState::new(&alone, references, draw.depth_range);
        let stencil = alone.test_quad(count, triangle.back, live, &codes, &mut followed.codes.clone());
        let passed = tests.test_quad(count, triangle.back, live, &codes, &mut followed.codes);
        fragment.stencil_failed = samples(live & !stencil, pixel);
        fragment.depth_failed = samples(stencil & !passed, pixel);
        passed
    }

    /// Blends the fragment into a colour target.
    fn write(&mut self, attachment: &Attachment, target: &Target, draw: &Draw, (tile, quad): (&TileWork, &Quad), live: u16) {
        let state = color_state(attachment, target, draw);
        let Some(followed) = self.surfaces.get_mut(&attachment.surface.key) else { return };
        let Some(first) = target.payload.filter(|_| !state.is_idle()) else { return };
        let words = |first: u8| &tile.payload[quad.payload as usize + usize::from(first)..];
        let count = attachment.surface.samples as usize;
        if target.packed {
            state.put_quad(count, live, words(first), &mut followed.codes);
            return;
        }
        let colors = |words: &[u32]| -> [[u32; 4]; 4] {
            let has = usize::from(target.words).min(4);
            std::array::from_fn(|c| if c < has { std::array::from_fn(|p| words[4 * c + p]) } else { [0; 4] })
        };
        let second = target.second.map_or([[0; 4]; 4], |second| colors(words(second)));
        state.blend_quad(count, live, &colors(words(first)), &second, &mut followed.codes);
    }

    /// The history, when the frame ends.
    fn end(mut self, end: &EndFrame, query: &PixelQuery) -> Result<History> {
        let pixel = self.pixel();
        let key = match query.target.or(end.shown.map(|shown| shown.key)) {
            Some(key) => key,
            None => bail!(
                "frame {} shows nothing: name a texture that it draws to, as in {},{}@0",
                end.number,
                self.at[0],
                self.at[1]
            ),
        };
        let shown = end.shown.filter(|shown| shown.key == key);
        let size = |surface: &Surface| {
            anyhow!(
                "{} has {} x {} pixels: it has none at {},{}",
                surface_name(key),
                surface.width,
                surface.height,
                self.at[0],
                self.at[1]
            )
        };
        let mut sprite = None;
        if let Some(surface) = shown {
            if self.at[0] >= surface.width || self.at[1] >= surface.height {
                return Err(size(&surface));
            }
            let texels = texels_of(&surface, &end.reference, self.at);
            let texels = texels.ok_or_else(|| anyhow!("the picture of frame {} has too few bytes. {OUR_FAULT}", end.number))?;
            match self.surfaces.get(&key).map(|followed| followed.texels(pixel)) {
                Some(own) if own == texels => {}
                Some(own) if end.drawn => bail!(
                    "the pixel ends with {own:08x?}, and the picture of frame {} has {texels:08x?} there. {OUR_FAULT}",
                    end.number
                ),
                _ => self.change(&surface, Touch::Found, |followed| followed.put(pixel, &texels)),
            }
            sprite = end.sprites.iter().find(|sprite| covers(sprite, self.at)).map(|sprite| sprite.index);
        } else if let Some(surface) = self.smaller.get(&key).filter(|_| !self.surfaces.contains_key(&key)) {
            return Err(size(surface));
        }
        let Some(followed) = self.surfaces.get(&key) else {
            let drawn: Vec<String> = self.surfaces.keys().chain(self.smaller.keys()).map(|&key| surface_name(key)).collect();
            bail!(
                "frame {} does not draw to {}: it draws to {}",
                end.number,
                surface_name(key),
                if drawn.is_empty() { "no texture".to_owned() } else { drawn.join("; ") }
            );
        };
        let (surface, last) = (followed.surface, followed.texels(pixel));
        Ok(History {
            surface,
            shown: shown.is_some(),
            sprite,
            events: leading(self.events, key),
            left_out: self.left_out,
            last,
        })
    }
}

/// The events that lead to what a surface holds at the end: its own, and before it is a copy or is resolved those of the other.
fn leading(events: VecDeque<PixelEvent>, key: SurfaceKey) -> Vec<PixelEvent> {
    let mut keys = BTreeSet::from([key]);
    let mut chosen: Vec<PixelEvent> = Vec::new();
    for mut event in events.into_iter().rev() {
        event.changes.retain(|change| keys.contains(&change.surface.key) || matches!(event.touch, Touch::Fragment(_)));
        if !event.changes.iter().any(|change| keys.contains(&change.surface.key)) {
            continue;
        }
        if let Touch::Resolved(from) | Touch::Copied(from) = event.touch {
            keys.insert(from);
        }
        chosen.push(event);
    }
    chosen.reverse();
    chosen
}

/// The samples of a pixel in a quad's mask, the first one in bit 0.
fn samples(mask: u16, pixel: usize) -> u8 {
    (0..4).map(|s| ((mask >> (4 * s + pixel) & 1) as u8) << s).sum()
}

/// How a target is written.
fn color_state(attachment: &Attachment, target: &Target, draw: &Draw) -> ColorState {
    let &Target { blend, logic, write_mask, .. } = target;
    let state = ColorTarget { format: attachment.surface.format, blend, logic, write_mask };
    ColorState::new(&state, draw.blend_constant)
}

/// Whether an opaque texel of a sprite lies on the pixel.
fn covers(sprite: &work::Sprite, at: [u32; 2]) -> bool {
    let [x, y] = [0, 1].map(|axis| i64::from(at[axis]) - i64::from(sprite.at[axis]));
    let inside = (0..i64::from(sprite.size[0])).contains(&x) && (0..i64::from(sprite.size[1])).contains(&y);
    inside && sprite.texels.get(4 * (y * i64::from(sprite.size[0]) + x) as usize + 3).is_some_and(|&alpha| alpha != 0)
}

/// The values of a stored texel as text: components of a colour, or depth and stencil.
pub fn texel_text(format: Format, code: Texel) -> String {
    use gfx::format::TexelKind;
    let texel = texel::decode_code(format, &code);
    let components = &texel[..format.components() as usize];
    let number = |bits: u32| match format.kind() {
        TexelKind::Uint => bits.to_string(),
        TexelKind::Sint => (bits as i32).to_string(),
        TexelKind::Float | TexelKind::Depth => format!("{:.4}", f32::from_bits(bits)),
    };
    if !format.is_depth_stencil() {
        return components.iter().map(|&bits| number(bits)).collect::<Vec<_>>().join(" ");
    }
    let mut parts = Vec::new();
    if format.has_depth() {
        parts.push(format!("{:.6}", f32::from_bits(texel[0])));
    }
    if format.has_stencil() {
        let bytes: Vec<u8> = code.iter().flat_map(|word| word.to_le_bytes()).collect();
        parts.push(format!("stencil {}", texel::stencil_value(format, &bytes)));
    }
    parts.join(" ")
}
