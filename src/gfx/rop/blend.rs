//! Colour: blending, write masks, conversion to the target's format.

use super::{code_words, four, select_mask};
use crate::gfx::format::{Format, TexelKind};
use crate::gfx::simd::wide;
use crate::gfx::state::{BlendComponent, BlendFactor, BlendOp, ColorTarget};
use crate::gfx::texel::{Rgba8, decode_code, encode_code, srgb_table, unorm};
use crate::num::{LANES, Lanes, QUADS};

/// Colours of `N` pixels, a channel after the other.
type Colors<const N: usize> = [[f32; N]; 4];

/// What to do with a source colour; chosen once a draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Path {
    /// No channel is written.
    Nothing,
    /// Four 8-bit channels, the source replaces what is stored.
    Replace8(Rgba8),
    /// Four 8-bit channels, blended.
    Blend8(Rgba8),
    /// Any format, the source replaces what is stored.
    Replace,
    /// Any format, blended.
    Blend,
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
    words: usize,
    constant: [f32; 4],
    /// Range that source colours and constants are clamped to before blending (fixed-point formats).
    clamp: [f32; 2],
}

impl ColorState {
    /// Prepares the state of a target with the blend constant. Integer targets ignore blending.
    ///
    /// # Panics
    /// If the format is compressed or has depth or stencil: no pipeline check lets such a target through.
    pub fn new(target: &ColorTarget, constant: [f32; 4]) -> ColorState {
        let format = target.format;
        assert!(!format.is_compressed() && !format.is_depth_stencil(), "{} as a colour target", format.name());
        let bits = write_bits(format, target.write_mask);
        let replaces = |c: BlendComponent| c.op == BlendOp::Add && c.src == BlendFactor::One && c.dst == BlendFactor::Zero;
        let blend = target.blend.filter(|b| format.kind() == TexelKind::Float && !(replaces(b.color) && replaces(b.alpha)));
        let path = match (blend, Rgba8::of(format)) {
            _ if bits == [0; 4] => Path::Nothing,
            (None, Some(layout)) => Path::Replace8(layout),
            (Some(_), Some(layout)) => Path::Blend8(layout),
            (None, None) => Path::Replace,
            (Some(_), None) => Path::Blend,
        };
        let blend = blend.unwrap_or_default();
        let clamp = range(format);
        ColorState {
            format,
            path,
            color: blend.color,
            alpha: blend.alpha,
            bits,
            whole: bits == write_bits(format, 15),
            words: code_words(format),
            constant: constant.map(|c| limit(c, clamp)),
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
        matches!(self.path, Path::Blend | Path::Blend8(_))
    }

    /// Whether the stored colour is needed: blending, or a write mask that keeps some channels.
    pub fn reads(&self) -> bool {
        !self.is_idle() && (!self.whole || matches!(self.path, Path::Blend | Path::Blend8(_)))
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
                    let new = self.codes8::<4>(&floats(src), &floats(src1), &four(stored, 0));
                    self.put(mask, &new, stored);
                }
                Path::Replace | Path::Blend => {
                    for p in (0..4).filter(|p| mask >> p & 1 != 0) {
                        self.pixel(p, src.map(|c| c[p]), src1.map(|c| c[p]), stored);
                    }
                }
            }
        }
    }

    /// The codes that a colour has in the target's format, word by word: for targets that do not blend, what remains to be
    /// stored with [`ColorState::put_quad`]. Words beyond [`code_words`] are zero.
    pub fn pack_batch(&self, src: &[Lanes; 4], out: &mut [Lanes; 4]) {
        pack_batch(self, src, out);
    }

    #[inline(always)]
    fn pack_batch_body(&self, src: &[Lanes; 4], out: &mut [Lanes; 4]) {
        *out = [Lanes::ZERO; 4];
        if let Some(layout) = Rgba8::of(self.format) {
            pack(layout, &lanes(src), &mut out[0].0);
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
    /// far as the write mask lets.
    ///
    /// # Panics
    /// If `run` or `packed` is too short.
    #[inline(always)]
    pub fn put_quad(&self, samples: usize, coverage: u16, packed: &[u32], run: &mut [u32]) {
        let size = 4 * self.words;
        for s in 0..samples {
            let mask = (coverage >> (4 * s)) as u8 & 15;
            if mask != 0 {
                self.put(mask, packed, &mut run[s * size..(s + 1) * size]);
            }
        }
    }

    /// Blends the quads of a batch in order into a tile, the codes of many quads one run after the other.
    ///
    /// `quads` of the 16 are present; quad `q` is the `at[q]`-th of the tile. `src1` is the second source of dual-source blending
    /// (any colours where the state does not use one). A quad that occurs twice in the batch is blended twice, in order.
    ///
    /// # Panics
    /// If a quad with coverage lies outside the tile.
    pub fn blend_batch(
        &self,
        samples: usize,
        quads: usize,
        at: &[u32; QUADS],
        coverage: &[u16; QUADS],
        src: &[Lanes; 4],
        src1: &[Lanes; 4],
        tile: &mut [u32],
    ) {
        blend_batch(self, samples, quads, at, coverage, src, src1, tile);
    }

    #[inline(always)]
    fn blend_batch_body(
        &self,
        samples: usize,
        quads: usize,
        at: &[u32; QUADS],
        coverage: &[u16; QUADS],
        src: &[Lanes; 4],
        src1: &[Lanes; 4],
        tile: &mut [u32],
    ) {
        let quads = quads.min(QUADS);
        let size = 4 * self.words;
        match self.path {
            Path::Nothing => {}
            Path::Replace8(_) => {
                let new = self.codes8::<LANES>(&lanes(src), &lanes(src1), &[0; LANES]);
                for q in (0..quads).filter(|q| coverage[*q] != 0) {
                    let run = &mut tile[at[q] as usize * samples * 4..][..samples * 4];
                    self.put_quad(samples, coverage[q], &four(&new, 4 * q), run);
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
            Path::Replace | Path::Blend => {
                for q in (0..quads).filter(|q| coverage[*q] != 0) {
                    let run = &mut tile[at[q] as usize * samples * size..][..samples * size];
                    for s in 0..samples {
                        let mask = coverage[q] >> (4 * s) & 15;
                        for p in (0..4).filter(|p| mask >> p & 1 != 0) {
                            let lane = 4 * q + p;
                            let color = |src: &[Lanes; 4]| std::array::from_fn(|c| src[c].0[lane]);
                            self.pixel(p, color(src), color(src1), &mut run[s * size..(s + 1) * size]);
                        }
                    }
                }
            }
        }
    }

    /// Blends a run of quads at distinct places, four 8-bit channels: all are read before any is written.
    #[inline(always)]
    fn blend_run(
        &self,
        sample: usize,
        samples: usize,
        run: std::ops::Range<usize>,
        at: &[u32; QUADS],
        coverage: &[u16; QUADS],
        src: &[Lanes; 4],
        src1: &[Lanes; 4],
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
        let new = self.codes8::<LANES>(&lanes(src), &lanes(src1), &old);
        for q in run {
            if mask(q) != 0 {
                self.put(mask(q), &four(&new, 4 * q), &mut tile[place(q)..place(q) + 4]);
            }
        }
    }

    /// Stores the masked pixels and bits of one sample of a quad.
    #[inline(always)]
    fn put(&self, mask: u8, new: &[u32], stored: &mut [u32]) {
        if mask == 15 && self.whole {
            stored.copy_from_slice(&new[..stored.len()]);
            return;
        }
        let selected = select_mask(mask);
        for w in 0..self.words {
            for p in 0..4 {
                let write = selected[p] & self.bits[w];
                let word = &mut stored[4 * w + p];
                *word = *word & !write | new[4 * w + p] & write;
            }
        }
    }

    /// The codes of `N` pixels of a format with four 8-bit channels; `old` matters to blending only.
    #[inline(always)]
    fn codes8<const N: usize>(&self, src: &Colors<N>, src1: &Colors<N>, old: &[u32; N]) -> [u32; N] {
        let mut out = [0_u32; N];
        match self.path {
            Path::Replace8(layout) => pack(layout, src, &mut out),
            Path::Blend8(layout) => {
                let dst = unpack(layout, old);
                let mut result = [[0.0_f32; N]; 4];
                let clamp = |x: &[f32; N]| x.map(|v| limit(v, [0.0, 1.0]));
                let (src, src1) = (src.each_ref().map(clamp), src1.each_ref().map(clamp));
                for c in 0..4 {
                    let blend = if c == 3 { self.alpha } else { self.color };
                    result[c] = self.blend_channel(c, blend, &src, &src1, &dst);
                }
                pack(layout, &result, &mut out);
            }
            _ => {}
        }
        out
    }

    /// One channel of the blend equation for `N` pixels.
    #[inline(always)]
    fn blend_channel<const N: usize>(
        &self,
        c: usize,
        blend: BlendComponent,
        src: &Colors<N>,
        src1: &Colors<N>,
        dst: &Colors<N>,
    ) -> [f32; N] {
        let (s, d) = (&src[c], &dst[c]);
        match blend.op {
            BlendOp::Min => std::array::from_fn(|i| if s[i] < d[i] { s[i] } else { d[i] }),
            BlendOp::Max => std::array::from_fn(|i| if s[i] > d[i] { s[i] } else { d[i] }),
            _ => {
                let a = self.weighted(blend.src, s, c, src, src1, dst);
                let b = self.weighted(blend.dst, d, c, src, src1, dst);
                match blend.op {
                    BlendOp::Subtract => std::array::from_fn(|i| a[i] - b[i]),
                    BlendOp::ReverseSubtract => std::array::from_fn(|i| b[i] - a[i]),
                    _ => std::array::from_fn(|i| a[i] + b[i]),
                }
            }
        }
    }

    /// A channel times its factor. Factors 0 and 1 are exact even for infinities and NaN, as if the term were absent or bare.
    #[inline(always)]
    fn weighted<const N: usize>(
        &self,
        factor: BlendFactor,
        x: &[f32; N],
        c: usize,
        src: &Colors<N>,
        src1: &Colors<N>,
        dst: &Colors<N>,
    ) -> [f32; N] {
        #[inline(always)]
        fn by<const N: usize>(x: &[f32; N], f: &[f32; N]) -> [f32; N] {
            std::array::from_fn(|i| x[i] * f[i])
        }
        #[inline(always)]
        fn by_rest<const N: usize>(x: &[f32; N], f: &[f32; N]) -> [f32; N] {
            std::array::from_fn(|i| x[i] * (1.0 - f[i]))
        }
        let k = self.constant[c];
        match factor {
            BlendFactor::Zero => [0.0; N],
            BlendFactor::One => *x,
            BlendFactor::Src => by(x, &src[c]),
            BlendFactor::OneMinusSrc => by_rest(x, &src[c]),
            BlendFactor::SrcAlpha => by(x, &src[3]),
            BlendFactor::OneMinusSrcAlpha => by_rest(x, &src[3]),
            BlendFactor::Dst => by(x, &dst[c]),
            BlendFactor::OneMinusDst => by_rest(x, &dst[c]),
            BlendFactor::DstAlpha => by(x, &dst[3]),
            BlendFactor::OneMinusDstAlpha => by_rest(x, &dst[3]),
            BlendFactor::SrcAlphaSaturated if c == 3 => *x,
            BlendFactor::SrcAlphaSaturated => std::array::from_fn(|i| {
                let (a, rest) = (src[3][i], 1.0 - dst[3][i]);
                x[i] * if a < rest { a } else { rest }
            }),
            BlendFactor::Constant => x.map(|v| v * k),
            BlendFactor::OneMinusConstant => x.map(|v| v * (1.0 - k)),
            BlendFactor::Src1 => by(x, &src1[c]),
            BlendFactor::OneMinusSrc1 => by_rest(x, &src1[c]),
            BlendFactor::Src1Alpha => by(x, &src1[3]),
            BlendFactor::OneMinusSrc1Alpha => by_rest(x, &src1[3]),
        }
    }

    /// Pixel `p` of one sample of a quad, of any format.
    fn pixel(&self, p: usize, src: [u32; 4], src1: [u32; 4], stored: &mut [u32]) {
        let new = if self.path == Path::Blend {
            let one = |t: [u32; 4]| t.map(|b| [limit(f32::from_bits(b), self.clamp)]);
            let mut code = [0; 4];
            for w in 0..self.words {
                code[w] = stored[4 * w + p];
            }
            let dst = decode_code(self.format, &code).map(|b| [f32::from_bits(b)]);
            let (src, src1) = (one(src), one(src1));
            let channel = |c: usize| {
                let blend = if c == 3 { self.alpha } else { self.color };
                self.blend_channel::<1>(c, blend, &src, &src1, &dst)[0].to_bits()
            };
            encode_code(self.format, [channel(0), channel(1), channel(2), channel(3)])
        } else {
            encode_code(self.format, src)
        };
        for w in 0..self.words {
            let word = &mut stored[4 * w + p];
            *word = *word & !self.bits[w] | new[w] & self.bits[w];
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
        src: &[Lanes; 4],
        src1: &[Lanes; 4],
        tile: &mut [u32],
    ) = ColorState::blend_batch_body;
    fn pack_batch(state: &ColorState, src: &[Lanes; 4], out: &mut [Lanes; 4]) = ColorState::pack_batch_body;
}

/// The range of a fixed-point format's numbers; all numbers for a floating-point one.
fn range(format: Format) -> [f32; 2] {
    let name = format.name();
    if name.contains("unorm") {
        [0.0, 1.0]
    } else if name.contains("snorm") {
        [-1.0, 1.0]
    } else {
        [f32::NEG_INFINITY, f32::INFINITY]
    }
}

/// Clamps to a finite range, NaN to 0; leaves numbers alone where the range is infinite.
#[inline(always)]
fn limit(x: f32, range: [f32; 2]) -> f32 {
    if range[1] == f32::INFINITY {
        return x;
    }
    let x = if x.is_nan() { 0.0 } else { x };
    let x = if x > range[0] { x } else { range[0] };
    if x < range[1] { x } else { range[1] }
}

/// The bits of a code that a channel mask writes.
fn write_bits(format: Format, mask: u8) -> [u32; 4] {
    let channels: [bool; 4] = std::array::from_fn(|c| mask >> c & 1 != 0);
    if format == Format::Rgb9e5Ufloat {
        // The exponent belongs to all channels: they are written together or not at all.
        return if mask & 7 == 0 { [0; 4] } else { [!0, 0, 0, 0] };
    }
    let widths: [u32; 4] = match format {
        Format::Rgb10a2Uint | Format::Rgb10a2Unorm => [10, 10, 10, 2],
        Format::Rg11b10Ufloat => [11, 11, 10, 0],
        Format::R64Uint => [64, 0, 0, 0],
        _ => {
            let width = format.block_bytes() * 8 / format.components();
            std::array::from_fn(|c| if (c as u32) < format.components() { width } else { 0 })
        }
    };
    // Blue is stored first in two formats.
    let order = if Rgba8::of(format).is_some_and(|layout| layout.bgra) { [2, 1, 0, 3] } else { [0, 1, 2, 3] };
    let mut bits = 0_u128;
    let mut at = 0;
    for place in 0..4 {
        let width = widths[place];
        if width > 0 && channels[order[place]] {
            bits |= ((1_u128 << width) - 1) << at;
        }
        at += width;
    }
    std::array::from_fn(|word| (bits >> (32 * word)) as u32)
}

/// The first quad after `first` whose place occurred before it in the run that starts at `first`.
#[inline(always)]
fn distinct_run(at: &[u32; QUADS], first: usize, quads: usize) -> usize {
    // A bloom filter of 64 bits: only a quad whose bit is taken is compared with the run.
    let mut seen = 0_u64;
    for q in first..quads {
        let bit = 1_u64 << (at[q] >> 1 & 63);
        if seen & bit != 0 && at[first..q].contains(&at[q]) {
            return q;
        }
        seen |= bit;
    }
    quads
}

/// Decodes codes of four 8-bit channels.
#[inline(always)]
fn unpack<const N: usize>(layout: Rgba8, codes: &[u32; N]) -> Colors<N> {
    let shift = if layout.bgra { [16, 8, 0, 24] } else { [0, 8, 16, 24] };
    let mut out = [[0.0; N]; 4];
    for c in 0..4 {
        if layout.srgb && c < 3 {
            let table = srgb_table();
            out[c] = codes.map(|code| table[(code >> shift[c] & 255) as usize]);
        } else {
            out[c] = codes.map(|code| (code >> shift[c] & 255) as i32 as f32 / 255.0);
        }
    }
    out
}

/// Encodes colours of four 8-bit channels.
#[inline(always)]
fn pack<const N: usize>(layout: Rgba8, color: &Colors<N>, out: &mut [u32; N]) {
    let (first, third) = if layout.bgra { (2, 0) } else { (0, 2) };
    let (a, b, c, d) = (&color[first], &color[1], &color[third], &color[3]);
    if layout.srgb {
        let encoder = crate::gfx::texel::SrgbEncoder::new();
        for i in 0..N {
            let low = u32::from(encoder.encode(a[i])) | u32::from(encoder.encode(b[i])) << 8;
            out[i] = low | u32::from(encoder.encode(c[i])) << 16 | unorm(d[i], 255.0) << 24;
        }
    } else {
        for i in 0..N {
            out[i] = unorm(a[i], 255.0) | unorm(b[i], 255.0) << 8 | unorm(c[i], 255.0) << 16 | unorm(d[i], 255.0) << 24;
        }
    }
}

#[inline(always)]
fn floats(bits: &[[u32; 4]; 4]) -> Colors<4> {
    bits.map(|c| c.map(f32::from_bits))
}

#[inline(always)]
fn lanes(color: &[Lanes; 4]) -> Colors<LANES> {
    [*color[0].f32(), *color[1].f32(), *color[2].f32(), *color[3].f32()]
}
