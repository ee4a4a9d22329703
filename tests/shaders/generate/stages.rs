//! Whole programs: declarations, resources, entry points.

use std::fmt::Write;

use super::super::oracle::{Batch, Io, LANES, Resource};
use super::types::{BOOL, F32, Struct, U32};
use super::{Flow, Generator, Item, Program, STRIDE, Scalar, Ty};

/// Bytes up to the next multiple.
fn up(x: u32, align: u32) -> u32 {
    x.next_multiple_of(align)
}

impl Generator<'_, '_> {
    pub fn program(mut self) -> Program {
        use naga::ShaderStage as S;
        if self.stage == S::Vertex && self.r.percent(60) {
            // No effects but the outputs: of such a program the bounds of the outputs are asked too.
            self.style.subgroups = false;
            self.style.atomics = 0;
        } else {
            self.has.out = true;
        }
        if self.style.discards {
            // A quad of helpers alone does not run on: what it would say to the others of its subgroup is not defined.
            self.style.subgroups = false;
        }
        let many = self.style.memory > 0;
        self.has.cells = many && self.r.percent(80);
        self.has.shared = many && self.stage == S::Compute && self.r.percent(60);
        self.has.many = many && self.r.percent(40);
        self.has.immediates = self.r.percent(20);
        self.has.table = self.r.percent(25);
        self.has.constants = self.r.percent(20);
        self.has.atomics = self.style.atomics > 0 && self.has.out;
        let (sizes, groups, invocations) = self.shape();
        self.structures();
        self.declarations(invocations);
        if self.style.textures > 0 {
            self.declare_textures(invocations);
        }
        for _ in 0..self.r.below(3) {
            self.private_variable();
        }
        for _ in 0..self.style.functions {
            self.function();
        }
        self.work = 0;
        let batch = match self.stage {
            S::Compute => {
                self.compute(sizes);
                Batch::default()
            }
            S::Vertex => self.vertex(),
            _ => self.fragment(),
        };
        let source = format!("{}{}", self.globals, self.body);
        let enables: String = [
            ("enable f16;\n", self.style.half),
            ("enable wgpu_binding_array;\n", source.contains("binding_array<")),
            ("enable clip_distances;\n", source.contains("clip_distances")),
        ]
        .iter()
        .filter_map(|(text, used)| used.then_some(*text))
        .collect();
        let source = enables + &source;
        Program { source, stage: self.stage, constants: self.constants, bindings: self.bindings, groups, batch }
    }

    /// Size of a workgroup, groups, invocations in all.
    fn shape(&mut self) -> ([u32; 3], [u32; 3], u32) {
        if self.stage != naga::ShaderStage::Compute {
            return ([1; 3], [1; 3], LANES as u32);
        }
        let (size, groups) = *self.r.one(&[
            ([1, 1, 1], [5, 1, 1]),
            ([1, 1, 1], [1, 1, 1]),
            ([7, 1, 1], [3, 1, 1]),
            ([7, 1, 1], [1, 2, 1]),
            ([64, 1, 1], [1, 1, 1]),
            ([65, 1, 1], [1, 1, 1]),
            ([128, 1, 1], [1, 1, 1]),
            ([4, 2, 3], [2, 1, 2]),
            ([3, 5, 1], [1, 3, 1]),
        ]);
        self.size = size.iter().product();
        (size, groups, self.size * groups.iter().product::<u32>())
    }

    /// Alignment and bytes of a type in storage.
    fn layout(&self, ty: &Ty) -> (u32, u32) {
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
    fn host_type(&mut self) -> Ty {
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
    fn structures(&mut self) {
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

    fn words(&mut self, n: u32) -> Vec<u8> {
        (0..n).flat_map(|_| self.r.datum().to_le_bytes()).collect()
    }

    /// Bytes of so many structures of kind `k`; no part of them is NaN.
    fn cells(&mut self, n: u32) -> Vec<u8> {
        let (align, size) = self.layout(&Ty::Struct(0));
        let words = up(size, align).div_ceil(4) * n;
        // Two 16-bit numbers in a word: no exponent of all ones.
        let half = if self.style.half { 0xfbff_fbff } else { !0 };
        (0..words).flat_map(|_| (self.r.datum() & half).to_le_bytes()).collect()
    }

    fn declarations(&mut self, invocations: u32) {
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

    fn private_variable(&mut self) {
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

    /// The statements of an entry point; whether the last one leaves.
    fn main(&mut self, result: Option<Ty>) -> bool {
        let together = self.style.barriers || self.style.derivatives;
        let returns = self.style.returns && !together;
        let flow = Flow { uniform: together, turns: 1, depth: 1, can_return: returns.then_some(result), ..Flow::default() };
        self.counter_pool();
        for _ in 0..self.style.variables {
            self.variable();
        }
        let mut left = false;
        while self.budget > 0 && !left && self.work < super::WORK {
            left = self.statement(&Flow { can_return: None, ..flow.clone() });
            if flow.can_return.is_some() && self.r.percent(12) {
                left |= self.statement(&flow);
            }
        }
        if !left {
            for item in self.items.clone() {
                if self.r.percent(self.style.final_looks) {
                    self.look_at(&item);
                }
            }
        }
        left
    }

    fn compute(&mut self, [x, y, z]: [u32; 3]) {
        let mut parameters = vec![
            "@builtin(workgroup_id) wid: vec3<u32>",
            "@builtin(num_workgroups) nwg: vec3<u32>",
            "@builtin(local_invocation_index) index: u32",
        ];
        let mut more = vec![
            ("@builtin(global_invocation_id) gid: vec3<u32>", "gid", Ty::Vector(3, Scalar::U32)),
            ("@builtin(local_invocation_id) lid: vec3<u32>", "lid", Ty::Vector(3, Scalar::U32)),
        ];
        // naga has those of workgroups in one dimension only.
        if self.style.subgroups && y * z == 1 {
            more.push(("@builtin(subgroup_size) sgs: u32", "sgs", U32));
            more.push(("@builtin(subgroup_invocation_id) sgi: u32", "sgi", U32));
            more.push(("@builtin(subgroup_id) sgn: u32", "sgn", U32));
            more.push(("@builtin(num_subgroups) sgc: u32", "sgc", U32));
        }
        for (text, name, ty) in more {
            if self.r.percent(50) {
                parameters.push(text);
                self.declare(name.into(), ty, false, None);
            }
        }
        let size = self.size;
        self.line(format!("@compute @workgroup_size({x}, {y}, {z}) fn main({}) {{", parameters.join(", ")));
        self.line("li = index;");
        self.line(format!("lane = ((wid.z * nwg.y + wid.y) * nwg.x + wid.x) * {size}u + li;"));
        self.line(format!("base = lane * {STRIDE}u;"));
        self.main(None);
        self.line("}");
    }

    /// Values of an input of the batch.
    fn input(&mut self, batch: &mut Batch, io: Io, ty: &Ty) {
        let components = (0..ty.size(&self.structs))
            .map(|_| {
                let kind = self.r.below(4);
                let offset = self.r.below(9);
                std::array::from_fn(|i| {
                    let i = i as u32;
                    match ty {
                        Ty::Scalar(Scalar::Bool) => (i + offset) % 3 & 1,
                        Ty::Scalar(s) | Ty::Vector(_, s) if s.is_float() => match kind {
                            0 => ((i % 4) as f32 * 0.5 + (i / 4) as f32 * 0.25 - offset as f32).to_bits(),
                            1 => (i as f32 * 0.125).to_bits(),
                            2 => (offset as f32).to_bits(),
                            _ => ((i * i % 23) as f32 * 0.25 - 2.0).to_bits(),
                        },
                        _ => match kind {
                            0 => offset,
                            1 => i.wrapping_mul(0x9e37_79b9),
                            _ => (i + offset) % 11,
                        },
                    }
                })
            })
            .collect();
        batch.inputs.insert(io, components);
    }

    /// Parameters common to vertex and fragment stages.
    fn inputs(&mut self, builtins: &[(&str, naga::BuiltIn, Ty)]) -> (Vec<String>, Batch) {
        let all = *self.r.one(&[!0u64, !0, 0x1111_1111_1111_1111, 0x0000_ffff_0000_00ff, 0x7f, 1 << 63 | 5]);
        let quads = (all | all >> 1 | all >> 2 | all >> 3) & 0x1111_1111_1111_1111;
        let helpers = if self.stage == naga::ShaderStage::Fragment { quads * 15 & !all } else { 0 };
        let mut batch = Batch { active: all, helpers, ..Batch::default() };
        let mut parameters = vec!["@location(0) @interpolate(flat) id: u32".to_owned()];
        batch.inputs.insert(Io::location(0), vec![std::array::from_fn(|i| i as u32)]);
        for location in 1..1 + self.r.below(5) {
            let scalars: Vec<Scalar> = self.style.scalars.iter().copied().filter(|s| *s != Scalar::Bool).collect();
            let s = *self.r.one(&scalars);
            let ty = if self.r.percent(50) { Ty::Vector(2 + self.r.below(3), s) } else { Ty::Scalar(s) };
            let flat = if s.is_float() {
                *self.r.one(&["", "@interpolate(linear) ", "@interpolate(perspective, centroid) "])
            } else {
                "@interpolate(flat) "
            };
            let name = self.name('i');
            parameters.push(format!("@location({location}) {flat}{name}: {}", self.text(&ty)));
            self.input(&mut batch, Io::location(location), &ty);
            self.declare(name, ty, false, None);
        }
        for (text, builtin, ty) in builtins {
            if self.r.percent(35) {
                let name = self.name('b');
                parameters.push(format!("@builtin({text}) {name}: {}", self.text(ty)));
                self.input(&mut batch, Io::BuiltIn(*builtin), ty);
                self.declare(name, ty.clone(), false, None);
            }
        }
        (parameters, batch)
    }

    /// The output structure, whose variable `o` is returned.
    fn outputs(&mut self, fixed: &[(&str, &str, Ty)]) -> Ty {
        let mut members = Vec::new();
        let mut text = String::new();
        for (attribute, name, ty) in fixed {
            let _ = write!(text, "{attribute} {name}: {}, ", self.text(ty));
            members.push(((*name).to_owned(), ty.clone()));
        }
        for location in 1..1 + self.r.below(4) {
            let s = *self.r.one(&[Scalar::U32, Scalar::I32, Scalar::F32, Scalar::F32]);
            let s = if s == Scalar::F32 && self.style.half && self.r.percent(50) { Scalar::F16 } else { s };
            let ty = if self.r.percent(60) { Ty::Vector(2 + self.r.below(3), s) } else { Ty::Scalar(s) };
            let flat = if self.stage == naga::ShaderStage::Vertex && !s.is_float() { " @interpolate(flat)" } else { "" };
            let _ = write!(text, "@location({location}){flat} o{location}: {}, ", self.text(&ty));
            members.push((format!("o{location}"), ty));
        }
        let _ = writeln!(self.globals, "struct Out {{ {text}}}");
        self.structs.push(Struct { name: "Out".into(), members });
        Ty::Struct(self.structs.len() - 1)
    }

    fn body_with_outputs(&mut self, attribute: &str, parameters: &[String], out: Ty) {
        self.line(format!("{attribute} fn main({}) -> Out {{", parameters.join(", ")));
        self.line("lane = id;");
        self.line(format!("base = lane * {STRIDE}u;"));
        self.line("var o: Out;");
        let Ty::Struct(k) = out else { return };
        for (name, ty) in self.structs[k].members.clone() {
            if name == "h" {
                continue;
            }
            self.declare(format!("o.{name}"), ty.clone(), true, None);
            if self.r.percent(70) {
                let value = self.value(&ty);
                self.line(format!("o.{name} = {value};"));
            }
        }
        if !self.main(Some(out)) {
            if !self.has.out {
                self.line("o.h = history;");
            }
            self.line("return o;");
        }
        self.line("}");
    }

    fn vertex(&mut self) -> Batch {
        let f = Ty::Vector(4, Scalar::F32);
        let mut fixed = vec![("@builtin(position)", "position", f), ("@location(0) @interpolate(flat)", "h", U32)];
        if self.r.percent(10) {
            fixed.push(("@builtin(clip_distances)", "clip", Ty::Array(Box::new(F32), 3)));
        }
        let out = self.outputs(&fixed);
        let (parameters, batch) = self.inputs(&[
            ("vertex_index", naga::BuiltIn::VertexIndex, U32),
            ("instance_index", naga::BuiltIn::InstanceIndex, U32),
        ]);
        self.body_with_outputs("@vertex", &parameters, out);
        batch
    }

    fn fragment(&mut self) -> Batch {
        let mut fixed = vec![("@location(0)", "h", U32)];
        if self.r.percent(25) {
            fixed.push(("@builtin(frag_depth)", "depth", F32));
        }
        if self.r.percent(15) {
            fixed.push(("@builtin(sample_mask)", "mask", U32));
        }
        let out = self.outputs(&fixed);
        let (parameters, batch) = self.inputs(&[
            ("position", naga::BuiltIn::Position { invariant: false }, Ty::Vector(4, Scalar::F32)),
            ("front_facing", naga::BuiltIn::FrontFacing, BOOL),
            ("sample_index", naga::BuiltIn::SampleIndex, U32),
            ("sample_mask", naga::BuiltIn::SampleMask, U32),
        ]);
        self.body_with_outputs("@fragment", &parameters, out);
        batch
    }
}
