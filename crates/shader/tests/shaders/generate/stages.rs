//! Whole programs: declarations, resources, entry points.

use std::fmt::Write;

use super::super::oracle::{Batch, Io, LANES};
use super::types::{BOOL, F32, Struct, U32};
use super::{Flow, Generator, Program, STRIDE, Scalar, Ty};

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
        self.has.many_long = many && self.r.percent(40);
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
        // What is not bound reads as zero.
        if self.r.percent(5) {
            let most = [(0, 3), (0, 4), (0, 5), (0, 6), (0, 7), (0, 10), (1, 0), (1, 1), (1, 2)];
            let key = *self.r.one(&most);
            self.bindings.resources.remove(&key);
        }
        let source = format!("{}{}", self.globals, self.body);
        let enables: String = [
            ("enable f16;\n", self.style.half),
            ("enable wgpu_binding_array;\n", source.contains("binding_array<")),
            ("enable clip_distances;\n", source.contains("clip_distances")),
            ("enable primitive_index;\n", source.contains("@builtin(primitive_index)")),
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
                *self.r.one(&[
                    "",
                    "@interpolate(linear) ",
                    "@interpolate(perspective, centroid) ",
                    "@interpolate(linear, sample) ",
                ])
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
            ("primitive_index", naga::BuiltIn::PrimitiveIndex, U32),
        ]);
        let early =
            ["", "@early_depth_test(less_equal) ", "@early_depth_test(greater_equal) ", "@early_depth_test(unchanged) "];
        let attribute = match self.r.below(20) {
            k @ 1..=3 => format!("{}@fragment", early[k as usize]),
            4 => "@early_depth_test(force) @fragment".to_owned(),
            _ => "@fragment".to_owned(),
        };
        self.body_with_outputs(&attribute, &parameters, out);
        batch
    }
}
