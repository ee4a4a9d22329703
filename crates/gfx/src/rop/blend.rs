//! Colour: blending, write masks, conversion to the target's format.

use super::channels::{
    blends_codes, distinct_run, floats, join, lanes, limit, names_second, pack, quantize, range, split, unpack, write_bits,
};
use super::equation::blend_channel;
use super::number::Number;
use super::pairs::Pairs;
use super::{ColorRefs, Colors, code_words, four, select_mask};
use crate::format::{Format, TexelKind};
use crate::simd::{dispatch, wide};
use crate::state::{BlendComponent, BlendFactor, BlendOp, ColorTarget, LogicOp};
use crate::texel::{Rgba8, decode_code, encode_code, f32_to_f16, unorm};
use num::{LANES, Lanes, QUADS};

/// What to do with a source colour; chosen once per draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Path {
    /// No channel is written.
    Nothing,
    /// Four 8-bit channels, the source replaces what is stored.
    Replace8(Rgba8),
    /// Four 8-bit channels, blended: in codes, or in linear light with sRGB.
    Blend8(Rgba8),
    /// Any format, the source replaces what is stored.
    Replace,
    /// One or two 8-bit channels, blended in codes.
    BlendCodes,
    /// Any format, blended.
    Blend,
    /// Any format, combined with what is stored bit by bit.
    Logic(LogicOp),
}

/// State of one colour target made ready.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColorState {
    format: Format,
    path: Path,
    color: BlendComponent,
    alpha: BlendComponent,
    /// Bits of a code that are written.
    bits: [u32; 4],
    whole: bool,
    /// Whether a factor names the second source.
    dual: bool,
    words: usize,
    constant: [f32; 4],
    /// The constant in 8-bit codes.
    constant_codes: [u16; 4],
    /// The state for two quads at a time: of four 8-bit channels, not sRGB.
    pairs: Option<Pairs>,
    /// Range that source colours and constants are clamped to before blending (fixed-point formats).
    clamp: [f32; 2],
}

impl ColorState {
    /// Prepares the state of a target with the blend constant. Integer targets ignore blending; so does a target with a logic operation.
    ///
    /// # Panics
    /// If the format is compressed or has depth or stencil: no pipeline check lets such a target through.
    pub fn new(target: &ColorTarget, constant: [f32; 4]) -> ColorState {
        let format = target.format;
        assert!(!format.is_compressed() && !format.is_depth_stencil(), "{} as a colour target", format.name());
        let keeps = target.logic == Some(LogicOp::NoOp);
        let bits = if keeps { [0; 4] } else { write_bits(format, target.write_mask) };
        let replaces = |c: BlendComponent| c.op == BlendOp::Add && c.src == BlendFactor::One && c.dst == BlendFactor::Zero;
        let blend = target.blend.filter(|b| format.kind() == TexelKind::Float && !(replaces(b.color) && replaces(b.alpha)));
        let logic = target.logic.filter(|&op| op != LogicOp::Copy);
        let blend = blend.filter(|_| target.logic.is_none());
        let path = match (logic, blend, Rgba8::of(format)) {
            _ if bits == [0; 4] => Path::Nothing,
            (Some(op), ..) => Path::Logic(op),
            (None, None, Some(layout)) => Path::Replace8(layout),
            (None, Some(_), Some(layout)) => Path::Blend8(layout),
            (None, None, None) => Path::Replace,
            (None, Some(_), None) if blends_codes(format) => Path::BlendCodes,
            (None, Some(_), None) => Path::Blend,
        };
        let blend = blend.unwrap_or_default();
        let clamp = range(format);
        let constant_codes = constant.map(|c| unorm(c, 255.0) as u16);
        let dual = [blend.color.src, blend.color.dst, blend.alpha.src, blend.alpha.dst].into_iter().any(names_second);
        let pairs = match path {
            Path::Replace8(Rgba8 { srgb: false, bgra }) => Some(Pairs::replace(bgra, bits[0])),
            Path::Blend8(Rgba8 { srgb: false, bgra }) => {
                Some(Pairs::blend([blend.color, blend.alpha], bgra, dual, constant_codes, bits[0]))
            }
            _ => None,
        };
        ColorState {
            format,
            path,
            color: blend.color,
            alpha: blend.alpha,
            bits,
            whole: bits == write_bits(format, 15),
            dual,
            words: code_words(format),
            constant: constant.map(|c| limit(c, clamp)),
            constant_codes,
            pairs,
            clamp,
        }
    }

    /// The target's format.
    pub fn format(&self) -> Format {
        self.format
    }

    /// Whether nothing is ever written.
    pub fn is_idle(&self) -> bool {
        self.path == Path::Nothing
    }

    /// Whether the source is combined with the stored colour by an equation; if not, it is converted and replaces it.
    pub fn blends(&self) -> bool {
        matches!(self.path, Path::Blend | Path::BlendCodes | Path::Blend8(_))
    }

    /// Whether the result depends on the stored colour: blending, or a logic operation that reads it.
    pub fn combines(&self) -> bool {
        self.blends() || matches!(self.path, Path::Logic(op) if op.reads())
    }

    /// Whether the stored colour is needed: it is combined with the source, or a write mask keeps some channels.
    pub fn reads(&self) -> bool {
        !self.is_idle() && (!self.whole || self.combines())
    }

    /// Whether a batch is written from the codes of all its pixels.
    fn puts_codes(&self) -> bool {
        self.format == Format::Rgba16Float || matches!(self.path, Path::Logic(_))
    }

    /// Whether a batch is written two quads at a time, so that to have its codes already saves nothing.
    #[inline(always)]
    pub fn takes_pairs(&self) -> bool {
        self.pairs.is_some()
    }

    /// Blends a quad into its stored codes (one run, see [`super`]).
    ///
    /// `src` and `src1` are the outputs of the fragment shader, channel by channel (bits of `f32`, or integers for integer
    /// formats); all covered samples of a pixel receive the same colour.
    ///
    /// # Panics
    /// If `run` is shorter than `samples` ask.
    pub fn blend_quad(&self, samples: usize, coverage: u16, src: &[[u32; 4]; 4], src1: &[[u32; 4]; 4], run: &mut [u32]) {
        let size = 4 * self.words;
        for s in 0..samples {
            let mask = (coverage >> (4 * s)) as u8 & 15;
            if mask == 0 {
                continue;
            }
            let stored = &mut run[s * size..(s + 1) * size];
            match self.path {
                Path::Nothing => {}
                Path::Replace8(_) | Path::Blend8(_) => {
                    let new = self.codes8::<4>(floats(src).each_ref(), floats(src1).each_ref(), &four(stored, 0));
                    self.put(mask, &new, stored);
                }
                Path::Replace | Path::BlendCodes | Path::Blend | Path::Logic(_) => {
                    for p in (0..4).filter(|p| mask >> p & 1 != 0) {
                        self.pixel(p, src.map(|c| c[p]), src1.map(|c| c[p]), stored);
                    }
                }
            }
        }
    }

    /// Whether quads of a block are blended together ([`ColorState::blend_group`]).
    #[inline(always)]
    pub fn groups(&self) -> bool {
        self.pairs.is_some() && self.blends()
    }

    /// Blends up to four quads at distinct places of a block, as [`ColorState::blend_quad`] one after the other: quad `q` is the `at[q]`-th of the
    /// block and pixel `4 q + p` of the colours. Quads without coverage are absent. For states of which [`ColorState::groups`] is true; others
    /// leave the block as it is.
    ///
    /// # Panics
    /// If a quad with coverage lies outside the block, or a pixel has neither one nor four samples.
    pub fn blend_group(
        &self,
        samples: usize,
        (at, coverage): (&[u8; 4], &[u16; 4]),
        src: &Colors<16>,
        src1: &Colors<16>,
        block: &mut [u32],
    ) {
        if let Some(pairs) = self.pairs.as_ref().filter(|_| self.groups()) {
            dispatch!(simd => pairs.group(simd, samples, (at, coverage), [src, src1], block));
        }
    }

    /// The codes that a colour has in the target's format, word by word: for targets that do not blend, what remains to be
    /// stored with [`ColorState::put_quad`]. Words beyond [`code_words`] are zero.
    pub fn pack_batch(&self, src: [&Lanes; 4], out: &mut [Lanes; 4]) {
        pack_batch(self, src, out);
    }

    #[inline(always)]
    fn pack_batch_body(&self, src: [&Lanes; 4], out: &mut [Lanes; 4]) {
        *out = [Lanes::ZERO; 4];
        if let Some(layout) = Rgba8::of(self.format) {
            pack(layout, lanes(src), &mut out[0].0);
        } else if self.format == Format::Rgba16Float {
            let src = lanes(src);
            for w in 0..2 {
                for i in 0..LANES {
                    out[w].0[i] = u32::from(f32_to_f16(src[2 * w][i])) | u32::from(f32_to_f16(src[2 * w + 1][i])) << 16;
                }
            }
        } else {
            for i in 0..LANES {
                let code = encode_code(self.format, std::array::from_fn(|c| src[c].0[i]));
                for w in 0..4 {
                    out[w].0[i] = code[w];
                }
            }
        }
    }

    /// Stores codes made by [`ColorState::pack_batch`] (words of four pixels, word after word) in a quad's covered samples, as
    /// far as the write mask lets, or what a logic operation makes of them.
    ///
    /// # Panics
    /// If `run` or `packed` is too short.
    #[inline(always)]
    pub fn put_quad(&self, samples: usize, coverage: u16, packed: &[u32], run: &mut [u32]) {
        let size = 4 * self.words;
        for s in 0..samples {
            let mask = (coverage >> (4 * s)) as u8 & 15;
            if mask == 0 {
                continue;
            }
            let stored = &mut run[s * size..(s + 1) * size];
            if let Path::Logic(op) = self.path {
                self.put_logic(op, mask, packed, stored);
            } else if self.words == 1 {
                self.put_word(mask, &four(packed, 0), stored);
            } else {
                self.put(mask, packed, stored);
            }
        }
    }

    /// Blends the quads of a batch in order into a tile, the codes of many quads one run after the other.
    ///
    /// `quads` of the 16 are present; quad `q` is the `at[q]`-th of the tile. `src1` is the second source of dual-source blending
    /// (any colours where the state does not use one). A quad that occurs twice in the batch is blended twice, in order.
    ///
    /// # Panics
    /// If a quad with coverage lies outside the tile, or a pixel has neither one nor four samples.
    pub fn blend_batch(
        &self,
        samples: usize,
        quads: usize,
        at: &[u32; QUADS],
        coverage: &[u16; QUADS],
        src: [&Lanes; 4],
        src1: [&Lanes; 4],
        tile: &mut [u32],
    ) {
        match &self.pairs {
            Some(pairs) => {
                dispatch!(simd => pairs.batch(simd, samples, quads, (at, coverage), [src, src1], tile));
            }
            None => blend_batch(self, samples, quads, at, coverage, src, src1, tile),
        }
    }

    #[inline(always)]
    fn blend_batch_body(
        &self,
        samples: usize,
        quads: usize,
        at: &[u32; QUADS],
        coverage: &[u16; QUADS],
        src: [&Lanes; 4],
        src1: [&Lanes; 4],
        tile: &mut [u32],
    ) {
        let quads = quads.min(QUADS);
        let size = 4 * self.words;
        match self.path {
            Path::Nothing => {}
            Path::Replace8(_) => {
                let new = self.codes8::<LANES>(lanes(src), lanes(src1), &[0; LANES]);
                for q in 0..quads {
                    let run = &mut tile[at[q] as usize * samples * 4..][..samples * 4];
                    for s in 0..samples {
                        let mask = (coverage[q] >> (4 * s)) as u8;
                        self.put_word(mask, &four(&new, 4 * q), &mut run[4 * s..4 * s + 4]);
                    }
                }
            }
            Path::Blend8(_) => {
                let mut first = 0;
                while first < quads {
                    let end = distinct_run(at, first, quads);
                    for s in 0..samples {
                        self.blend_run(s, samples, first..end, at, coverage, src, src1, tile);
                    }
                    first = end;
                }
            }
            // Logic operations are on codes, and accumulation and light are kept in 16-bit numbers: the codes of all pixels at once.
            Path::Logic(_) | Path::Replace if self.puts_codes() => {
                let mut codes = [Lanes::ZERO; 4];
                self.pack_batch_body(src, &mut codes);
                for q in (0..quads).filter(|q| coverage[*q] != 0) {
                    let packed = codes.each_ref().map(|codes| four(&codes.0, 4 * q));
                    let run = &mut tile[at[q] as usize * samples * size..][..samples * size];
                    self.put_quad(samples, coverage[q], packed.as_flattened(), run);
                }
            }
            Path::Replace | Path::BlendCodes | Path::Blend | Path::Logic(_) => {
                for q in (0..quads).filter(|q| coverage[*q] != 0) {
                    let run = &mut tile[at[q] as usize * samples * size..][..samples * size];
                    for s in 0..samples {
                        let mask = coverage[q] >> (4 * s) & 15;
                        for p in (0..4).filter(|p| mask >> p & 1 != 0) {
                            let lane = 4 * q + p;
                            let color = |src: [&Lanes; 4]| std::array::from_fn(|c| src[c].0[lane]);
                            self.pixel(p, color(src), color(src1), &mut run[s * size..(s + 1) * size]);
                        }
                    }
                }
            }
        }
    }

    /// Blends a run of quads at distinct places, four 8-bit channels: all are read before any is written.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "a kernel over register lanes takes as many operands as the operation has")]
    fn blend_run(
        &self,
        sample: usize,
        samples: usize,
        run: std::ops::Range<usize>,
        at: &[u32; QUADS],
        coverage: &[u16; QUADS],
        src: [&Lanes; 4],
        src1: [&Lanes; 4],
        tile: &mut [u32],
    ) {
        let mask = |q: usize| (coverage[q] >> (4 * sample)) as u8 & 15;
        let place = |q: usize| (at[q] as usize * samples + sample) * 4;
        let mut old = [0_u32; LANES];
        for q in run.clone() {
            if mask(q) != 0 {
                old[4 * q..4 * q + 4].copy_from_slice(&four(tile, place(q)));
            }
        }
        let new = self.codes8::<LANES>(lanes(src), lanes(src1), &old);
        for q in run {
            if mask(q) != 0 {
                self.put_word(mask(q), &four(&new, 4 * q), &mut tile[place(q)..place(q) + 4]);
            }
        }
    }

    /// Stores the masked pixels and bits of one sample of a quad.
    #[inline(always)]
    fn put(&self, mask: u8, new: &[u32], stored: &mut [u32]) {
        let selected = select_mask(mask);
        for w in 0..self.words {
            for p in 0..4 {
                let write = selected[p] & self.bits[w];
                let word = &mut stored[4 * w + p];
                *word = *word & !write | new[4 * w + p] & write;
            }
        }
    }

    /// [`ColorState::put`] of what a logic operation makes of new and stored codes.
    fn put_logic(&self, op: LogicOp, mask: u8, new: &[u32], stored: &mut [u32]) {
        let size = 4 * self.words;
        let mut codes = [0; 16];
        for ((code, new), old) in codes.iter_mut().zip(&new[..size]).zip(&*stored) {
            *code = op.apply(*new, *old);
        }
        self.put(mask, &codes, stored);
    }

    /// [`ColorState::put`] for codes of one word, without a branch: masks of triangles' edges are not predictable.
    #[inline(always)]
    fn put_word(&self, mask: u8, new: &[u32; 4], stored: &mut [u32]) {
        let selected = select_mask(mask);
        let old = four(stored, 0);
        for p in 0..4 {
            let write = selected[p] & self.bits[0];
            stored[p] = old[p] & !write | new[p] & write;
        }
    }

    /// The codes of `N` pixels of a format with four 8-bit channels; `old` matters to blending only.
    #[inline(always)]
    fn codes8<const N: usize>(&self, src: ColorRefs<'_, N>, src1: ColorRefs<'_, N>, old: &[u32; N]) -> [u32; N] {
        let mut out = [0_u32; N];
        match self.path {
            Path::Replace8(layout) => pack(layout, src, &mut out),
            Path::Blend8(layout) if !layout.srgb => {
                let (mut first, mut second) = ([[0; N]; 4], [[0; N]; 4]);
                quantize(src, &mut first);
                if self.dual {
                    quantize(src1, &mut second);
                }
                let result = self.blend_colors(&self.constant_codes, &first, &second, &split(layout.bgra, old));
                join(layout.bgra, &result, &mut out);
            }
            Path::Blend8(layout) => {
                let dst = unpack(layout, old);
                let (mut clamped, mut second) = ([[0.0; N]; 4], [[0.0; N]; 4]);
                for c in 0..4 {
                    for i in 0..N {
                        clamped[c][i] = limit(src[c][i], [0.0, 1.0]);
                    }
                }
                if self.dual {
                    for c in 0..4 {
                        for i in 0..N {
                            second[c][i] = limit(src1[c][i], [0.0, 1.0]);
                        }
                    }
                }
                let result = self.blend_colors(&self.constant, &clamped, &second, &dst);
                pack(layout, result.each_ref(), &mut out);
            }
            _ => {}
        }
        out
    }

    /// The blend equation for `N` pixels.
    #[inline(always)]
    fn blend_colors<T: Number, const N: usize>(
        &self,
        constant: &[T; 4],
        src: &Colors<N, T>,
        src1: &Colors<N, T>,
        dst: &Colors<N, T>,
    ) -> Colors<N, T> {
        let mut out = [[T::ZERO; N]; 4];
        for c in 0..4 {
            let blend = if c == 3 { self.alpha } else { self.color };
            blend_channel(c, blend, constant, src, src1, dst, &mut out[c]);
        }
        out
    }

    /// Pixel `p` of one sample of a quad, of any format.
    fn pixel(&self, p: usize, src: [u32; 4], src1: [u32; 4], stored: &mut [u32]) {
        let new = if self.path == Path::BlendCodes {
            let one = |t: [u32; 4]| t.map(|b| [unorm(f32::from_bits(b), 255.0) as u16]);
            // Channels that the format has not: blue is 0 and alpha 1, so that factors of the target's alpha are right.
            let dst = split(false, &[stored[p] & 0xffff | 0xff00_0000]);
            let result = self.blend_colors(&self.constant_codes, &one(src), &one(src1), &dst);
            let mut word = [0];
            join(false, &result, &mut word);
            [word[0], 0, 0, 0]
        } else if self.path == Path::Blend {
            let one = |t: [u32; 4]| t.map(|b| [limit(f32::from_bits(b), self.clamp)]);
            let mut code = [0; 4];
            for w in 0..self.words {
                code[w] = stored[4 * w + p];
            }
            let dst = decode_code(self.format, &code).map(|b| [f32::from_bits(b)]);
            let result = self.blend_colors(&self.constant, &one(src), &one(src1), &dst);
            encode_code(self.format, result.map(|c| c[0].to_bits()))
        } else {
            encode_code(self.format, src)
        };
        for w in 0..self.words {
            let word = &mut stored[4 * w + p];
            let new = if let Path::Logic(op) = self.path { op.apply(new[w], *word) } else { new[w] };
            *word = *word & !self.bits[w] | new & self.bits[w];
        }
    }
}

wide! {
    fn blend_batch(
        state: &ColorState,
        samples: usize,
        quads: usize,
        at: &[u32; QUADS],
        coverage: &[u16; QUADS],
        src: [&Lanes; 4],
        src1: [&Lanes; 4],
        tile: &mut [u32],
    ) = ColorState::blend_batch_body;
    fn pack_batch(state: &ColorState, src: [&Lanes; 4], out: &mut [Lanes; 4]) = ColorState::pack_batch_body;
}
