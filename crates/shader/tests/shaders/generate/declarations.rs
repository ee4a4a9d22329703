//! Structures, bindings and private variables.

use std::fmt::Write;

use super::super::oracle::Resource;
use super::types::{Struct, Ty};
use super::{Generator, Item, STRIDE, Scalar};

/// Bytes up to the next multiple.
fn up(x: u32, align: u32) -> u32 {
    x.next_multiple_of(align)
}

impl Generator<'_, '_> {
    /// Alignment and bytes of a type in storage.
    pub fn layout(&self, ty: &Ty) -> (u32, u32) {
        let width = |s: Scalar| if s == Scalar::F16 { 2 } else { 4 };
        match ty {
            Ty::Scalar(s) => (width(*s), width(*s)),
            Ty::Vector(n, s) => (width(*s) * if *n == 2 { 2 } else { 4 }, width(*s) * n),
            Ty::Matrix(c, r, s) => {
                let (align, size) = self.layout(&Ty::Vector(*r, *s));
                (align, up(size, align) * c)
            }
            Ty::Array(base, n) => {
                let (align, size) = self.layout(base);
                (align, up(size, align) * n)
            }
            Ty::Struct(k) => {
                let (mut align, mut at) = (1, 0);
                for (_, ty) in &self.structs[*k].members {
                    let (a, size) = self.layout(ty);
                    align = align.max(a);
                    at = up(at, a) + size;
                }
                (align, up(at, align))
            }
        }
    }

    /// A type that memory can hold.
    pub fn host_type(&mut self) -> Ty {
        let scalars: Vec<Scalar> = self.style.scalars.iter().copied().filter(|s| *s != Scalar::Bool).collect();
        let s = *self.r.one(&scalars);
        let n = 2 + self.r.below(3);
        match self.r.below(8) {
            0..=2 => Ty::Vector(n, s),
            3 if s.is_float() => Ty::Matrix(n, 2 + self.r.below(3), s),
            4 => Ty::Array(Box::new(Ty::Scalar(s)), 2 + self.r.below(4)),
            5 => Ty::Array(Box::new(Ty::Vector(n, s)), 2 + self.r.below(2)),
            _ => Ty::Scalar(s),
        }
    }

    /// Structures: the first is the one in memory, and may hold one of the others.
    pub fn structures(&mut self) {
        if self.style.composite == 0 && self.style.memory == 0 {
            return;
        }
        let inner: Vec<_> = (0..1 + self.r.below(3)).map(|i| (format!("m{i}"), self.host_type())).collect();
        let outer: Vec<_> = (0..1 + self.r.below(5)).map(|i| (format!("m{i}"), self.host_type())).collect();
        self.structs.push(Struct { name: "Cell".into(), members: Vec::new() });
        self.structs.push(Struct { name: "Inner".into(), members: inner });
        let mut members = outer;
        if self.r.percent(60) {
            let inner = if self.r.percent(50) { Ty::Struct(1) } else { Ty::Array(Box::new(Ty::Struct(1)), 2) };
            let at = self.r.below(members.len() as u32 + 1) as usize;
            members.insert(at, ("inner".into(), inner));
        }
        self.structs[0].members = members;
        for k in [1, 0] {
            let members: Vec<String> =
                self.structs[k].members.iter().map(|(name, ty)| format!("{name}: {}", ty.text(&self.structs))).collect();
            let _ = writeln!(self.globals, "struct {} {{ {} }}", self.structs[k].name, members.join(", "));
        }
    }

    pub fn words(&mut self, n: u32) -> Vec<u8> {
        (0..n).flat_map(|_| self.r.datum().to_le_bytes()).collect()
    }

    /// The bytes of `n` structures of type 0. No part of them is NaN.
    pub fn cells(&mut self, n: u32) -> Vec<u8> {
        let (align, size) = self.layout(&Ty::Struct(0));
        let words = up(size, align).div_ceil(4) * n;
        // Two 16-bit numbers in a word: no exponent of all ones.
        let half = if self.style.half { 0xfbff_fbff } else { !0 };
        (0..words).flat_map(|_| (self.r.datum() & half).to_le_bytes()).collect()
    }

    pub fn declarations(&mut self, invocations: u32) {
        let mut text = String::from(
            "struct UniInner { v: vec3<f32>, w: u32, m: mat2x4<f32> }
struct Uni { n: vec4<u32>, i: vec4<i32>, f: vec4<f32>, m: mat3x3<f32>, a: array<vec4<u32>, 4>, s: UniInner }
@group(0) @binding(0) var<uniform> uni: Uni;
@group(0) @binding(1) var<storage, read> inp: array<u32>;
var<private> lane: u32;
var<private> base: u32;
fn bits_of(x: f32) -> u32 { return select(bitcast<u32>(x), 0x7fc00000u, x != x); }
fn number(x: f32) -> f32 { return select(x, 0.25f, x != x); }
",
        );
        let mut uni = Vec::new();
        for _ in 0..8 {
            uni.extend(self.r.below(8).to_le_bytes());
        }
        for k in 0..16 {
            let x = (self.r.below(64) as f32 - 24.0) * if k % 3 == 0 { 0.125 } else { 0.5 };
            uni.extend(x.to_bits().to_le_bytes());
        }
        uni.extend(self.words(16));
        for k in 0..12 {
            uni.extend(if k == 3 { self.r.below(9) } else { (self.r.below(40) as f32 * 0.25 - 3.0).to_bits() }.to_le_bytes());
        }
        self.bindings.set_buffer(0, 0, uni);
        let words = self.words(64);
        self.bindings.set_buffer(0, 1, words);
        if self.has.out {
            text += "@group(0) @binding(2) var<storage, read_write> out: array<u32>;
var<private> cursor: u32;
fn put(x: u32) {
let at = base + 8u + (cursor & 7u);
out[at] = out[at] * 31u + x;
cursor += 1u;
}
";
            let mut words = Vec::new();
            for _ in 0..invocations * STRIDE {
                words.extend(self.r.below(5).to_le_bytes());
            }
            self.bindings.set_buffer(0, 2, words);
        } else {
            text += "var<private> history: u32;\n";
        }
        if self.has.cells {
            text += "@group(0) @binding(3) var<storage, read> constant: array<Cell>;\n";
            let bytes = self.cells(5);
            self.bindings.set_buffer(0, 3, bytes);
            if self.has.out {
                text += "@group(0) @binding(4) var<storage, read_write> cells: array<Cell>;\n";
                let bytes = self.cells(invocations);
                self.bindings.set_buffer(0, 4, bytes);
            }
        }
        if self.has.many {
            let (space, element) = *self.r.one(&[("storage, read", "array<u32, 4>"), ("uniform", "vec4<u32>")]);
            let _ = writeln!(text, "struct Blob {{ v: {element} }}");
            let _ = writeln!(text, "@group(0) @binding(5) var<{space}> many: binding_array<Blob, 3>;");
            let blobs = (0..3).map(|_| Resource::Buffer(self.words(4))).collect();
            self.bindings.resources.insert((0, 5), blobs);
        }
        if self.has.many_long {
            text += "struct Long { n: u32, v: array<u32> }
@group(0) @binding(10) var<storage, read> long: binding_array<Long, 2>;
";
            let long = [4, 9].map(|n| Resource::Buffer(self.words(n))).to_vec();
            self.bindings.resources.insert((0, 10), long);
        }
        if self.has.immediates {
            text += "struct Imm { a: u32, v: vec2<u32>, w: array<u32, 4> }\nvar<immediate> imm: Imm;\n";
            self.bindings.immediates = (0..8).map(|_| self.r.datum()).collect();
        }
        if self.has.table {
            let values: Vec<String> = (0..9).map(|_| format!("{}u", self.r.datum())).collect();
            let _ = writeln!(text, "const TABLE = array<u32, 9>({});", values.join(", "));
        }
        if self.has.constants {
            text += "override SCALE: f32 = 0.5;\n@id(7) override EXTRA: u32;\noverride OVERRIDE: u32 = EXTRA * 2u + 1u;\n";
            self.constants.push(("7".into(), f64::from(self.r.below(9))));
            if self.r.percent(50) {
                self.constants.push(("SCALE".into(), 1.25));
            }
        }
        if self.has.atomics {
            text += "struct Own { pad: u32, v: atomic<i32> }
@group(0) @binding(6) var<storage, read_write> counts: array<atomic<u32>, 24>;
@group(0) @binding(7) var<storage, read_write> own_u: array<atomic<u32>>;
@group(0) @binding(8) var<storage, read_write> own_i: array<Own>;
@group(0) @binding(9) var<storage, read_write> own_f: array<atomic<f32>>;
";
            for (binding, n) in [(6, 24), (7, invocations), (8, 2 * invocations)] {
                let words = self.words(n);
                self.bindings.set_buffer(0, binding, words);
            }
            self.bindings.set_buffer(0, 9, vec![0; 4 * invocations as usize]);
        }
        if self.stage == naga::ShaderStage::Compute {
            text += "var<private> li: u32;\n";
            if self.has.atomics {
                text += "var<workgroup> shared_counts: array<atomic<u32>, 24>;\n";
            }
            if self.has.shared {
                let _ = writeln!(text, "var<workgroup> shared_cells: array<Cell, {}>;", self.size);
            }
            if self.style.barriers {
                let _ =
                    writeln!(text, "var<workgroup> shared_words: array<u32, {}>;\nvar<workgroup> shared_flag: u32;", self.size);
            }
        }
        let structs = std::mem::take(&mut self.globals);
        self.globals = structs + &text;
    }

    pub fn private_variable(&mut self) {
        let ty = self.any_type();
        let name = self.name('g');
        let initial = match &ty {
            Ty::Scalar(s) if self.r.percent(50) => format!(" = {}", self.literal(*s)),
            _ => String::new(),
        };
        let _ = writeln!(self.globals, "var<private> {name}: {}{initial};", ty.text(&self.structs));
        self.items.push(Item { text: name, ty, write: true, pointer: Some("private"), counter: false });
    }

    pub fn private_items(&self) -> Vec<Item> {
        self.items.iter().filter(|i| i.pointer == Some("private")).cloned().collect()
    }
}
