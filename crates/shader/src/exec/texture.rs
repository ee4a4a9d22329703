//! Texture accesses.

use std::sync::atomic::Ordering::Relaxed;

use crate::program::{Level, NO_REG, Reg, TextureAction, TextureOp};
use crate::resources::{Resource, StorageImage};
use gfx::format::Format;
use gfx::simd::Simd;
use gfx::texel;
use gfx::texture::{Lod, Sample, View};
use gfx::tiling::Tiled;
use num::{LANES, Lanes, Mask};
use work::{LINE, RequestKind};

use super::kernels::{File, get, set};
use super::memory::atomic_value;
use super::record::Scratch;
use super::run::BatchState;

/// The value of a register that does not exist.
static ZEROS: Lanes = Lanes::ZERO;

/// A register, or zeros.
#[inline(always)]
fn operand(file: File<'_>, r: Reg) -> Lanes {
    if r == NO_REG { Lanes::ZERO } else { get(file, r) }
}

/// The lanes of `mask` that choose the same element of a binding array as its first lane, and that element.
fn same_element(elements: &Lanes, mask: Mask) -> (Mask, u32) {
    let first = elements.0[mask.trailing_zeros() as usize % LANES];
    let same = (0..LANES).filter(|&i| mask >> i & 1 != 0 && elements.0[i] == first).fold(0, |m, i| m | 1 << i);
    (same, first)
}

/// Runs a texture operation; binding arrays element by element. It is not inlined into the loop over operations. Registers that are copied, and
/// the requests of quads, pass in vectors.
#[inline(never)]
pub(super) fn access<const RECORD: bool, V: Simd>(
    simd: V,
    m: &BatchState<'_>,
    file: File<'_>,
    mask: Mask,
    entry: u32,
    recorder: &mut Scratch,
) {
    simd.vectorize(
        #[inline(always)]
        || access_here::<RECORD>(m, file, mask, entry, recorder),
    );
}

#[inline(always)]
fn access_here<const RECORD: bool>(m: &BatchState<'_>, file: File<'_>, mask: Mask, entry: u32, recorder: &mut Scratch) {
    let op = &m.body.textures[entry as usize];
    if op.texture_element == NO_REG && op.sampler_element == NO_REG {
        let texture = m.resources.get(op.texture, 0);
        let sampler = m.resources.get(op.sampler, 0);
        // Kept from one access to the next: to clear it took a hundredth of the instructions of textured frames.
        let mut out = recorder.texels.take().unwrap_or_default();
        one::<RECORD>(m, file, mask, op, texture, sampler, &mut out, recorder);
        write(file, op, &out);
        recorder.texels = Some(out);
        return;
    }
    each_element::<RECORD>(m, file, mask, op, recorder);
}

/// Runs a texture operation on binding arrays.
#[inline(never)]
fn each_element<const RECORD: bool>(m: &BatchState<'_>, file: File<'_>, mask: Mask, op: &TextureOp, recorder: &mut Scratch) {
    // Both arrays may be indexed: a pair of elements is one number.
    let (t, s) = (operand(file, op.texture_element), operand(file, op.sampler_element));
    let pairs = Lanes(std::array::from_fn(|i| t.0[i].min(0xffff) << 16 | s.0[i].min(0xffff)));
    // Results may have the registers of coordinates, and a level depends on the coordinates of a whole quad. So nothing is written
    // before all elements have been read.
    let mut all = [Lanes::ZERO; 4];
    let mut left = mask;
    while left != 0 {
        let (same, pair) = same_element(&pairs, left);
        let texture = m.resources.get(op.texture, pair >> 16);
        let sampler = m.resources.get(op.sampler, pair & 0xffff);
        let mut out = [Lanes::ZERO; 4];
        one::<RECORD>(m, file, same, op, texture, sampler, &mut out, recorder);
        for (all, out) in all.iter_mut().zip(&out) {
            each(same, |i| all.0[i] = out.0[i]);
        }
        left &= !same;
    }
    write(file, op, &all);
}

/// Writes results.
#[inline(always)]
fn write(file: File<'_>, op: &TextureOp, out: &[Lanes; 4]) {
    if matches!(op.action, TextureAction::Store | TextureAction::Atomic(_)) {
        return;
    }
    for (&r, value) in op.data.iter().zip(out) {
        if r != NO_REG {
            set(file, r, value);
        }
    }
}

/// Runs a texture operation on one texture; `out` receives zeros where it gives nothing.
#[inline(always)]
fn one<const RECORD: bool>(
    m: &BatchState<'_>,
    file: File<'_>,
    mask: Mask,
    op: &TextureOp,
    texture: Resource<'_>,
    sampler: Resource<'_>,
    out: &mut [Lanes; 4],
    recorder: &mut Scratch,
) {
    // What samples replaces all.
    if !matches!((op.action, texture, sampler), (TextureAction::Sample(_), Resource::Texture(_), Resource::Sampler(_))) {
        *out = [Lanes::ZERO; 4];
    }
    match (op.action, texture) {
        (TextureAction::Sample(_) | TextureAction::Gather(_), Resource::Texture(view)) => {
            let Resource::Sampler(sampler) = sampler else { return };
            let [mut u, mut v] = [operand(file, op.coordinate[0]), operand(file, op.coordinate[1])];
            if op.clamp_to_edge {
                clamp_to_edge(view, [&mut u, &mut v]);
            }
            // Only registers that exist are copied: a copy takes as long as a few instructions of the program.
            let (w, layer, level, reference);
            let w = if op.coordinate[2] == NO_REG {
                &ZEROS
            } else {
                w = get(file, op.coordinate[2]);
                &w
            };
            let layer = if op.layer == NO_REG {
                None
            } else {
                let given = get(file, op.layer);
                // The filters clamp signed numbers.
                layer = if op.unsigned_layer { Lanes(given.0.map(|l| l.min(i32::MAX as u32))) } else { given };
                Some(&layer)
            };
            let level = if op.level == NO_REG {
                &ZEROS
            } else {
                level = get(file, op.level);
                &level
            };
            let reference = if op.reference == NO_REG {
                None
            } else {
                reference = get(file, op.reference);
                Some(&reference)
            };
            let gradients = match op.action {
                TextureAction::Sample(Level::Gradient) => {
                    Some((op.gradient_x.map(|r| operand(file, r)), op.gradient_y.map(|r| operand(file, r))))
                }
                _ => None,
            };
            let lod = match (op.action, &gradients) {
                (TextureAction::Sample(Level::Auto), _) => Lod::Auto,
                (TextureAction::Sample(Level::Bias), _) => Lod::Bias(level),
                (TextureAction::Sample(Level::Exact), _) => Lod::Level(level),
                (_, Some((x, y))) => Lod::Gradient { dx: [&x[0], &x[1], &x[2]], dy: [&y[0], &y[1], &y[2]] },
                _ => Lod::Zero,
            };
            let args = Sample { coords: [&u, &v, w], layer, offset: op.offset.map(i32::from), lod, compare: reference };
            if let TextureAction::Gather(component) = op.action {
                view.gather(sampler, &args, u32::from(component), mask, out);
                if RECORD {
                    view.record_gather(sampler, &args, mask, &mut recorder.footprint);
                }
            } else if RECORD {
                view.sample_recorded(sampler, &args, mask, out, &mut recorder.footprint);
            } else {
                view.sample(sampler, &args, mask, out);
            }
            if RECORD {
                recorder.footprint_request(mask);
            }
        }
        (TextureAction::Load, Resource::Texture(view)) => {
            let coords = op.coordinate.map(|r| operand(file, r));
            let layer = (op.layer != NO_REG).then(|| get(file, op.layer));
            let level = operand(file, if op.sample != NO_REG { op.sample } else { op.level });
            let coords = [&coords[0], &coords[1], &coords[2]];
            view.load(coords, layer.as_ref(), &level, mask, out);
            if RECORD {
                view.record_load(coords, layer.as_ref(), &level, mask, &mut recorder.footprint);
                recorder.footprint_request(mask);
            }
        }
        (TextureAction::Load, Resource::Storage(image)) => {
            let places = places(file, op, &image);
            each(mask, |i| {
                if let Some(at) = places[i].and_then(|p| image.offset(p)) {
                    let texel = image.read(at);
                    for c in 0..4 {
                        out[c].0[i] = texel[c];
                    }
                }
            });
            if RECORD {
                record_storage(recorder, RequestKind::Load, mask, &image, &places);
            }
        }
        (TextureAction::Store, Resource::Storage(image)) => {
            let mask = mask & m.live;
            let places = places(file, op, &image);
            let data = op.data.map(|r| operand(file, r));
            each(mask, |i| {
                if let Some(at) = places[i].and_then(|p| image.offset(p)) {
                    image.write(at, data.each_ref().map(|d| d.0[i]));
                }
            });
            if RECORD {
                record_storage(recorder, RequestKind::Store, mask, &image, &places);
            }
        }
        (TextureAction::Atomic(atomic), Resource::Storage(image)) => {
            let mask = mask & m.live;
            let places = places(file, op, &image);
            let data = operand(file, op.data[0]);
            each(mask, |i| {
                let at = places[i].and_then(|p| image.offset(p));
                if let Some(word) = at.and_then(|at| image.words.words().get((at / 4) as usize)) {
                    let _ = word.fetch_update(Relaxed, Relaxed, |x| Some(atomic_value(atomic, x, data.0[i], 0)));
                }
            });
            if RECORD {
                record_storage(recorder, RequestKind::Atomic, mask, &image, &places);
            }
        }
        (TextureAction::Size, Resource::Texture(view)) => {
            let level = operand(file, op.level);
            for i in 0..LANES {
                let size = view.size(level.0[i]);
                for c in 0..3 {
                    out[c].0[i] = size[c];
                }
            }
        }
        (TextureAction::Size, Resource::Storage(image)) => {
            let size = image.desc.level_size(image.level);
            for c in 0..3 {
                out[c] = Lanes::splat(size[c]);
            }
        }
        (TextureAction::Levels, Resource::Texture(view)) => out[0] = Lanes::splat(view.levels()),
        (TextureAction::Layers, Resource::Texture(view)) => out[0] = Lanes::splat(view.layers()),
        (TextureAction::Layers, Resource::Storage(image)) => out[0] = Lanes::splat(image.layers),
        (TextureAction::Samples, Resource::Texture(view)) => out[0] = Lanes::splat(view.samples()),
        // Nothing is bound, or a resource of another kind: the access gives zeros and has no effect.
        _ => {
            if RECORD && !matches!(op.action, TextureAction::Size | TextureAction::Levels | TextureAction::Layers) {
                recorder.request(RequestKind::Texture, mask, 1, |_| None, 1);
            }
        }
    }
}

fn each(mask: Mask, mut f: impl FnMut(usize)) {
    let mut left = mask;
    while left != 0 {
        f(left.trailing_zeros() as usize);
        left &= left - 1;
    }
}

/// Coordinates half a texel inside the first level's edges.
fn clamp_to_edge(view: &View, coords: [&mut Lanes; 2]) {
    let size = view.size(0);
    for (c, coord) in coords.into_iter().enumerate() {
        let half = 0.5 / size[c].max(1) as f32;
        for x in coord.f32_mut() {
            *x = x.clamp(half, 1.0 - half);
        }
    }
}

/// Column, row, and slice or layer of the texture that each lane addresses; none outside of the view.
fn places(file: File<'_>, op: &TextureOp, image: &StorageImage<'_>) -> [Option<[u32; 3]>; LANES] {
    let coords = op.coordinate.map(|r| operand(file, r));
    let size = image.desc.level_size(image.level);
    let layer = (op.layer != NO_REG).then(|| get(file, op.layer));
    std::array::from_fn(|i| {
        let [x, y, z] = coords.each_ref().map(|c| c.0[i]);
        let z = match &layer {
            Some(l) if l.0[i] < image.layers => image.base_layer + l.0[i],
            Some(_) => return None,
            None if op.coordinate[2] != NO_REG => z,
            None => image.base_layer,
        };
        (x < size[0] && y < size[1] && z < size[2]).then_some([x, y, z])
    })
}

impl StorageImage<'_> {
    /// Byte offset of a texel.
    fn offset(&self, [x, y, z]: [u32; 3]) -> Option<u64> {
        let d = &self.desc;
        let at = d.offset(self.level, z) + u64::from(y) * d.row_bytes(self.level) + u64::from(x) * d.texel_bytes();
        (at + u64::from(d.format.block_bytes()) <= self.words.len()).then_some(at)
    }

    fn read(&self, at: u64) -> [u32; 4] {
        let mut bytes = [0; 16];
        let n = self.desc.format.block_bytes() as usize;
        self.words.read(at, &mut bytes[..n]);
        texel::decode(self.desc.format, &bytes[..n])
    }

    fn write(&self, at: u64, value: [u32; 4]) {
        // A 64-bit integer format has one component to a program; the second word is its upper half.
        let value = if self.desc.format == Format::R64Uint { [value[0], 0, 0, 0] } else { value };
        let bytes = texel::encode(self.desc.format, value);
        self.words.write(at, &bytes[..self.desc.format.block_bytes() as usize]);
    }
}

fn record_storage(
    recorder: &mut Scratch,
    kind: RequestKind,
    mask: Mask,
    image: &StorageImage<'_>,
    places: &[Option<[u32; 3]>; LANES],
) {
    let tiled = Tiled::new(&image.desc);
    let words = image.desc.format.block_bytes().div_ceil(4) as u8;
    let address = |i: usize| {
        let [x, y, z] = places[i]?;
        Some(image.address + LINE * u64::from(tiled.levels()[image.level as usize].line(x, y, z)))
    };
    recorder.request(kind, mask, words, address, 1);
}
