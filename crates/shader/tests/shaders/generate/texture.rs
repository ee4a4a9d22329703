//! Textures: declarations and accesses.

use std::fmt::Write;

use gfx::format::Format;
use gfx::image::ImageDesc;
use gfx::state::{AddressMode, Aspect, Compare, FilterMode, SamplerDesc, TextureDimension, ViewDimension};
use gfx::texture::ViewRange;

use super::super::oracle::{Resource, Texture};
use super::types::{F32, I32, U32};
use super::{Flow, Generator, Scalar, Ty};

/// What texels are to a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TexelType {
    Float,
    Uint,
    Sint,
    Depth,
    /// Storage: its format and access.
    Storage(&'static str, &'static str),
}

/// A texture of the program.
#[derive(Clone, Debug)]
pub struct GeneratedTexture {
    name: String,
    view: ViewDimension,
    kind: TexelType,
    levels: u32,
    samples: u32,
    /// Elements of a binding array.
    elements: u32,
}

/// View, kind, levels, samples, format.
const SORTS: [(ViewDimension, TexelType, u32, u32, Format); 22] = {
    use Format as F;
    use TexelType as K;
    use ViewDimension as V;
    [
        (V::D2, K::Float, 3, 1, F::Rgba8Unorm),
        (V::D2, K::Float, 1, 1, F::Rgba8UnormSrgb),
        (V::D2, K::Float, 2, 1, F::R8Snorm),
        (V::D1, K::Float, 1, 1, F::Rgba8Unorm),
        (V::D2Array, K::Float, 2, 1, F::Rg8Unorm),
        (V::D3, K::Float, 2, 1, F::Rgba8Unorm),
        (V::Cube, K::Float, 2, 1, F::Rgba8Unorm),
        (V::CubeArray, K::Float, 1, 1, F::Rgba8Unorm),
        (V::D2, K::Float, 1, 4, F::Rgba8Unorm),
        (V::D2, K::Uint, 2, 1, F::Rgba8Uint),
        (V::D2, K::Sint, 1, 1, F::Rgba16Sint),
        (V::D2Array, K::Uint, 1, 1, F::R32Uint),
        (V::D2, K::Depth, 2, 1, F::Depth16Unorm),
        (V::D2Array, K::Depth, 1, 1, F::Depth16Unorm),
        (V::Cube, K::Depth, 1, 1, F::Depth16Unorm),
        (V::D2, K::Depth, 1, 4, F::Depth16Unorm),
        (V::D2, K::Storage("rgba8unorm", "write"), 1, 1, F::Rgba8Unorm),
        (V::D2, K::Storage("r32uint", "read_write"), 1, 1, F::R32Uint),
        (V::D2, K::Storage("rgba16sint", "read"), 1, 1, F::Rgba16Sint),
        (V::D2, K::Storage("r32uint", "atomic"), 1, 1, F::R32Uint),
        (V::D2Array, K::Storage("r32sint", "read_write"), 1, 1, F::R32Sint),
        (V::D3, K::Storage("rgba8snorm", "write"), 1, 1, F::Rgba8Snorm),
    ]
};

/// The size of textures: room for every invocation's own texel.
fn size_of(view: ViewDimension) -> (TextureDimension, [u32; 3]) {
    match view {
        ViewDimension::D1 => (TextureDimension::D1, [16, 1, 1]),
        ViewDimension::D2 => (TextureDimension::D2, [16, 8, 1]),
        ViewDimension::D2Array => (TextureDimension::D2, [16, 8, 3]),
        ViewDimension::D3 => (TextureDimension::D3, [16, 8, 4]),
        ViewDimension::Cube => (TextureDimension::D2, [8, 8, 6]),
        ViewDimension::CubeArray => (TextureDimension::D2, [4, 4, 12]),
    }
}

impl Generator<'_, '_> {
    /// Declares some textures and the samplers.
    pub fn declare_textures(&mut self, invocations: u32) {
        assert!(invocations <= 16 * 8, "every invocation needs a texel of its own");
        let n = 1 + self.r.below(5);
        for k in 0..n {
            let (view, kind, levels, samples, format) = *self.r.one(&SORTS);
            if !self.has.out && matches!(kind, TexelType::Storage(_, access) if access != "read") {
                continue;
            }
            let name = format!("tex{k}");
            let shape = match view {
                ViewDimension::D1 => "1d",
                ViewDimension::D2 => "2d",
                ViewDimension::D2Array => "2d_array",
                ViewDimension::D3 => "3d",
                ViewDimension::Cube => "cube",
                ViewDimension::CubeArray => "cube_array",
            };
            let many = if samples > 1 { "multisampled_" } else { "" };
            let ty = match kind {
                TexelType::Float => format!("texture_{many}{shape}<f32>"),
                TexelType::Uint => format!("texture_{shape}<u32>"),
                TexelType::Sint => format!("texture_{shape}<i32>"),
                TexelType::Depth => format!("texture_depth_{many}{shape}"),
                TexelType::Storage(format, access) => format!("texture_storage_{shape}<{format}, {access}>"),
            };
            let elements = if !matches!(kind, TexelType::Depth) && self.r.percent(30) { 2 } else { 1 };
            let ty = if elements > 1 { format!("binding_array<{ty}, 2>") } else { ty };
            let _ = writeln!(self.globals, "@group(1) @binding({k}) var {name}: {ty};");
            let (dimension, size) = size_of(view);
            let desc = ImageDesc { dimension, size, levels, samples, format };
            let storage = matches!(kind, TexelType::Storage(..));
            let range = ViewRange {
                dimension: view,
                format,
                aspect: if kind == TexelType::Depth { Aspect::DepthOnly } else { Aspect::All },
                base_level: 0,
                levels: if storage { 1 } else { levels },
                base_layer: 0,
                layers: if dimension == TextureDimension::D2 { size[2] } else { 1 },
            };
            let all = (0..elements)
                .map(|_| {
                    let bytes = (0..desc.bytes()).map(|_| self.r.word() as u8).collect();
                    Resource::Texture(Texture { desc, range, bytes })
                })
                .collect();
            self.bindings.resources.insert((1, k), all);
            self.textures.push(GeneratedTexture { name, view, kind, levels, samples, elements });
        }
        self.globals += "@group(2) @binding(0) var sam: sampler;\n@group(2) @binding(1) var sac: sampler_comparison;\n";
        for compare in [None, Some(*self.r.one(&[Compare::Less, Compare::GreaterEqual, Compare::Equal]))] {
            let mode = *self.r.one(&[AddressMode::ClampToEdge, AddressMode::Repeat, AddressMode::MirrorRepeat]);
            let filter = *self.r.one(&[FilterMode::Nearest, FilterMode::Linear]);
            let mipmap = *self.r.one(&[FilterMode::Nearest, FilterMode::Linear]);
            let desc = SamplerDesc { address: [mode; 3], mag: filter, min: filter, mipmap, compare, ..SamplerDesc::default() };
            self.bindings.resources.insert((2, u32::from(compare.is_some())), vec![Resource::Sampler(desc)]);
        }
    }

    fn coordinates(&mut self, view: ViewDimension) -> String {
        let n = match view {
            ViewDimension::D1 => 1,
            ViewDimension::D2 | ViewDimension::D2Array => 2,
            _ => 3,
        };
        // Where a coordinate is huge, no texture unit agrees with another: the range is that of programs.
        let mut one = || format!("({} * {}f - 0.75f)", self.smooth(), ["0.25", "0.031", "0.5"][self.r.below(3) as usize]);
        let parts: Vec<String> = (0..n).map(|_| one()).collect();
        if n == 1 { parts[0].clone() } else { format!("vec{n}<f32>({})", parts.join(", ")) }
    }

    /// A small number in floating point.
    fn smooth(&mut self) -> String {
        match self.r.below(4) {
            0 => "f32(lane & 15u)".into(),
            1 => "f32(lane >> 3u)".into(),
            2 => format!("f32({} & 15u)", self.live(&U32)),
            _ => format!("clamp(number({}), -9.0f, 9.0f)", self.live(&F32)),
        }
    }

    /// A texture access, or a query.
    pub fn touch_texture(&mut self, flow: &Flow) {
        if self.textures.is_empty() {
            return self.look();
        }
        let mut t = self.r.one(&self.textures).clone();
        if t.elements > 1 {
            t.name = match self.r.below(3) {
                0 => format!("{}[1]", t.name),
                1 => format!("{}[uni.n[{}] & 1u]", t.name, self.r.below(4)),
                _ => format!("{}[lane & 3u]", t.name),
            };
        }
        if self.r.percent(15) {
            return self.query(&t);
        }
        match t.kind {
            TexelType::Storage(format, access) => self.storage(&t, format, access),
            TexelType::Float | TexelType::Depth if t.samples == 1 && self.r.percent(75) => self.sample(&t, flow),
            _ => self.load_texel(&t),
        }
    }

    fn bind(&mut self, text: String, ty: Ty) {
        let name = self.name('t');
        self.line(format!("let {name} = {text};"));
        self.declare(name, ty, false, None);
    }

    fn query(&mut self, t: &GeneratedTexture) {
        let n = match t.view {
            ViewDimension::D1 => 1,
            ViewDimension::D3 => 3,
            _ => 2,
        };
        let ty = if n == 1 { U32 } else { Ty::Vector(n, Scalar::U32) };
        let storage = matches!(t.kind, TexelType::Storage(..));
        let arrayed = matches!(t.view, ViewDimension::D2Array | ViewDimension::CubeArray);
        match self.r.below(4) {
            0 if !storage && t.samples == 1 => self.bind(format!("textureNumLevels({})", t.name), U32),
            1 if arrayed => self.bind(format!("textureNumLayers({})", t.name), U32),
            1 if t.samples > 1 => self.bind(format!("textureNumSamples({})", t.name), U32),
            2 if !storage && t.samples == 1 => {
                let level = self.r.below(t.levels);
                self.bind(format!("textureDimensions({}, {level})", t.name), ty);
            }
            3 if !storage && t.samples == 1 => {
                let level = self.live(&U32);
                self.bind(format!("textureDimensions({}, {level} % {}u)", t.name, t.levels), ty);
            }
            _ => self.bind(format!("textureDimensions({})", t.name), ty),
        }
    }

    /// Whole coordinates, at times out of bounds.
    fn texel(&mut self, t: &GeneratedTexture) -> String {
        let (_, size) = size_of(t.view);
        let wild = self.r.percent(30);
        let mut part = |n: u32| {
            let e = self.live(&U32);
            if wild { format!("({e} & 31u)") } else { format!("({e} % {n}u)") }
        };
        let (x, y, z) = (part(size[0]), part(size[1]), part(size[2]));
        match t.view {
            ViewDimension::D1 => x,
            ViewDimension::D3 => format!("vec3<u32>({x}, {y}, {z})"),
            ViewDimension::D2Array => format!("vec2<u32>({x}, {y}), {z}"),
            _ => format!("vec2<i32>(vec2<u32>({x}, {y}))"),
        }
    }

    fn load_texel(&mut self, t: &GeneratedTexture) {
        if matches!(t.view, ViewDimension::Cube | ViewDimension::CubeArray) {
            return self.query(t);
        }
        let at = self.texel(t);
        let level = if t.samples > 1 || self.r.percent(50) {
            self.r.below(t.levels.max(t.samples)).to_string()
        } else {
            format!("({} & 3u)", self.live(&U32))
        };
        let ty = match t.kind {
            TexelType::Depth => F32,
            TexelType::Uint => Ty::Vector(4, Scalar::U32),
            TexelType::Sint => Ty::Vector(4, Scalar::I32),
            _ => Ty::Vector(4, Scalar::F32),
        };
        self.bind(format!("textureLoad({}, {at}, {level})", t.name), ty);
    }

    fn sample(&mut self, t: &GeneratedTexture, flow: &Flow) {
        let depth = t.kind == TexelType::Depth;
        let c = self.coordinates(t.view);
        let arrayed = matches!(t.view, ViewDimension::D2Array | ViewDimension::CubeArray);
        let layer = if arrayed { format!(", ({} & 3u)", self.live(&U32)) } else { String::new() };
        let base = format!("{}, sam, {c}{layer}", t.name);
        let flat = !matches!(t.view, ViewDimension::Cube | ViewDimension::CubeArray | ViewDimension::D1);
        let offset = match t.view {
            ViewDimension::D2 | ViewDimension::D2Array if self.r.percent(25) => ", vec2<i32>(1, -2)",
            ViewDimension::D3 if self.r.percent(25) => ", vec3<i32>(1, -2, 0)",
            _ => "",
        };
        let implicit = flow.uniform && self.style.derivatives && self.stage == naga::ShaderStage::Fragment;
        let colour = Ty::Vector(4, Scalar::F32);
        let line = t.view == ViewDimension::D1;
        if depth {
            let reference = format!("({} * 0.0625f)", self.smooth());
            let compared = format!("{}, sac, {c}{layer}, {reference}{offset}", t.name);
            return match self.r.below(6) {
                0 if implicit => self.bind(format!("textureSampleCompare({compared})"), F32),
                1 => self.bind(format!("textureGatherCompare({compared})"), colour),
                2 => {
                    let level = self.r.below(2);
                    self.bind(format!("textureSampleLevel({base}, {level}{offset})"), F32);
                }
                3 => self.bind(format!("textureGather({base}{offset})"), colour),
                4 if implicit => self.bind(format!("textureSample({base}{offset})"), F32),
                _ => self.bind(format!("textureSampleCompareLevel({compared})"), F32),
            };
        }
        match self.r.below(7) {
            0 if implicit => self.bind(format!("textureSample({base}{offset})"), colour),
            1 if implicit && !line => {
                let bias = format!("({} * 0.25f)", self.smooth());
                self.bind(format!("textureSampleBias({base}, {bias}{offset})"), colour);
            }
            2 if !line => {
                let n = if flat && t.view != ViewDimension::D3 { 2 } else { 3 };
                let mut gradient = || {
                    let parts: Vec<String> = (0..n).map(|_| format!("({} * 0.02f)", self.smooth())).collect();
                    format!("vec{n}<f32>({})", parts.join(", "))
                };
                let (x, y) = (gradient(), gradient());
                self.bind(format!("textureSampleGrad({base}, {x}, {y}{offset})"), colour);
            }
            3 if !line && t.view != ViewDimension::D3 => {
                let component = self.r.below(4);
                self.bind(format!("textureGather({component}, {base}{offset})"), colour);
            }
            4 if t.view == ViewDimension::D2 => {
                self.bind(format!("textureSampleBaseClampToEdge({}, sam, {c})", t.name), colour);
            }
            _ if !line => {
                let level =
                    if self.r.percent(50) { format!("{}.5", self.r.below(3)) } else { format!("({} * 0.3f)", self.smooth()) };
                self.bind(format!("textureSampleLevel({base}, {level}{offset})"), colour);
            }
            _ if implicit => self.bind(format!("textureSample({base})"), colour),
            _ => self.load_texel(t),
        }
    }

    /// Loads, stores and atomics of storage textures, an invocation in its own texel.
    fn storage(&mut self, t: &GeneratedTexture, format: &str, access: &str) {
        let own = match t.view {
            ViewDimension::D2 => "vec2<u32>(lane & 15u, lane >> 4u)".to_owned(),
            ViewDimension::D3 => format!("vec3<u32>(lane & 15u, lane >> 4u, {}u)", self.r.below(5)),
            _ => format!("vec2<u32>(lane & 15u, lane >> 4u), {}", self.r.below(4)),
        };
        let s = match format {
            "r32uint" => Scalar::U32,
            "r32sint" | "rgba16sint" => Scalar::I32,
            _ => Scalar::F32,
        };
        let ty = Ty::Vector(4, s);
        match access {
            "atomic" => {
                const ANY_ORDER: [&str; 6] = [
                    "textureAtomicAdd",
                    "textureAtomicAnd",
                    "textureAtomicOr",
                    "textureAtomicXor",
                    "textureAtomicMin",
                    "textureAtomicMax",
                ];
                // One operation per row: those commute.
                let k = self.r.below(6) as usize;
                let (x, value) = (self.live(&U32), self.value(&U32));
                self.line(format!("{}({}, vec2<u32>({x} & 31u, {k}u), {value});", ANY_ORDER[k], t.name));
            }
            "read" => {
                let at = self.texel(t);
                self.bind(format!("textureLoad({}, {at})", t.name), ty);
            }
            _ if access == "read_write" && self.r.percent(40) => self.bind(format!("textureLoad({}, {own})", t.name), ty),
            _ => {
                let value = if s == Scalar::F32 {
                    let parts: Vec<String> = (0..4).map(|_| format!("number({})", self.live(&F32))).collect();
                    format!("vec4<f32>({})", parts.join(", "))
                } else {
                    let first = if s == Scalar::I32 { self.value(&I32) } else { self.value(&U32) };
                    format!("vec4<{}>({first})", s.text())
                };
                self.line(format!("textureStore({}, {own}, {value});", t.name));
            }
        }
    }
}
