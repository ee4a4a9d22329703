//! Memory that programs read and write, and meetings of invocations.

use super::types::{F32, I32, U32};
use super::{Flow, Generator, Item, STRIDE, Scalar, Ty};

/// What of memory is declared.
#[derive(Clone, Copy, Debug, Default)]
pub struct Has {
    /// Words that every invocation writes; without them what is shown becomes an output.
    pub out: bool,
    /// Structures in read-only and writable storage, and in workgroup memory; a binding array.
    pub cells: bool,
    pub shared: bool,
    pub many: bool,
    /// A binding array of structures with runtime-sized arrays.
    pub many_long: bool,
    pub immediates: bool,
    pub table: bool,
    pub constants: bool,
    pub atomics: bool,
}

impl Generator<'_, '_> {
    /// A word from memory, an id, or another thing that the compiler does not know.
    pub fn memory_word(&mut self) -> String {
        let k = self.r.below(8);
        for _ in 0..4 {
            return match self.r.below(16) {
                0 | 1 => "lane".into(),
                2 | 3 => format!("inp[(lane + {k}u) & 63u]"),
                4 if self.r.percent(40) => {
                    let e = self.find(&U32, false).unwrap_or_else(|| "lane".into());
                    format!("inp[{e} & {}u]", self.r.one(&[7, 63, 127]))
                }
                5 | 6 => format!("uni.n[{}]", k % 4),
                7 => format!("uni.a[{k} & 3].{}", &"xyzw"[k as usize % 4..][..1]),
                8..=11 if self.has.out => format!("out[base + {k}u]"),
                12 if self.has.many => format!("many[{}].v[{}]", self.r.one(&["lane % 3u", "1", "uni.n.x"]), k % 4),
                13 if self.has.immediates => format!("imm.{}", self.r.one(&["a", "v.x", "v.y", "w[1]", "w[lane & 3u]"])),
                14 if self.has.table => format!("TABLE[(lane + {k}u) % {}u]", self.r.one(&[8, 9])),
                15 if self.has.constants => "(lane + OVERRIDE)".into(),
                _ => continue,
            };
        }
        "lane".into()
    }

    /// A read or a write of a structure in memory.
    pub fn touch_memory(&mut self, flow: &Flow) {
        let cell = Ty::Struct(0);
        let place = |text: &str, write| Item { text: text.into(), ty: cell.clone(), write, pointer: None, counter: false };
        let compute = self.stage == naga::ShaderStage::Compute;
        let mut places = Vec::new();
        if self.has.cells {
            let index = self.live(&U32);
            places.push(place(&format!("constant[{index} & 7u]"), false));
            places.push(place(&format!("constant[{index} & 3u]"), false));
            if self.has.out {
                places.extend(vec![place("cells[lane]", true); 3]);
            }
        }
        if self.has.shared && compute {
            places.extend(vec![place("shared_cells[li]", true); 2]);
        }
        if places.is_empty() || self.r.percent(20) {
            return self.read_words();
        }
        let item = self.r.one(&places).clone();
        let mut wanted = cell;
        loop {
            wanted = match wanted {
                Ty::Struct(k) if self.r.percent(95) => self.r.one(&self.structs[k].members).1.clone(),
                Ty::Array(base, _) if self.r.percent(80) => *base,
                Ty::Matrix(_, r, s) if self.r.percent(50) => Ty::Vector(r, s),
                Ty::Vector(_, s) if self.r.percent(50) => Ty::Scalar(s),
                _ => break,
            };
        }
        let _ = flow;
        let Some(text) = self.reach(item.text.clone(), item.ty.clone(), &wanted, item.write) else { return };
        match self.r.below(10) {
            0..=5 if item.write => self.assign_to(&text, &wanted),
            6 if item.write => {
                let name = self.name('p');
                // A pointer to a component of a vector is none.
                let Some(text) = self.reach(item.text, item.ty, &wanted, true) else { return };
                if !text.ends_with(['x', 'y', 'z', 'w']) && !matches!(wanted, Ty::Scalar(_)) {
                    self.line(format!("let {name} = &{text};"));
                    self.declare(format!("(*{name})"), wanted, true, None);
                }
            }
            _ => {
                let name = self.name('t');
                self.line(format!("let {name} = {text};"));
                self.declare(name, wanted, false, None);
            }
        }
    }

    /// Lengths, and places out of the bounds of runtime-sized arrays.
    fn read_words(&mut self) {
        let name = self.name('t');
        let e = self.live(&U32);
        match self.r.below(4) {
            0 if self.has.cells && self.has.out => self.line(format!("let {name} = arrayLength(&cells) + arrayLength(&out);")),
            0 if self.has.many_long => {
                self.line(format!("let {name} = arrayLength(&long[{e} & 3u].v) + long[{e} & 1u].v[{e} & 7u] + long[1].n;"));
            }
            1 => self.line(format!("let {name} = arrayLength(&inp);")),
            2 if self.has.out => {
                self.line(format!("out[({e} & 0xffffu) + 0x100000u] = {e};"));
                self.line(format!("let {name} = out[({e} & 0xffffu) + 0x100000u];"));
            }
            _ if self.has.many => {
                let k = self.r.below(4);
                self.line(format!("let {name} = many[{e} & 7u].v[{k}];"));
            }
            _ => self.line(format!("let {name} = inp[{e} & 0xffffu];")),
        }
        self.declare(name, U32, false, None);
    }

    /// An atomic: on what all share one that commutes and whose result is dropped, on one's own any.
    pub fn an_atomic(&mut self) {
        if !self.has.atomics {
            return self.assign();
        }
        const ANY_ORDER: [&str; 6] = ["atomicAdd", "atomicAnd", "atomicOr", "atomicXor", "atomicMin", "atomicMax"];
        let value = self.value(&U32);
        let compute = self.stage == naga::ShaderStage::Compute;
        match self.r.below(9) {
            0..=2 => {
                let k = self.r.below(6) as usize;
                let at = self.live(&U32);
                let array = if compute && self.r.percent(50) { "shared_counts" } else { "counts" };
                let op = if k == 0 && self.r.percent(30) { "atomicSub" } else { ANY_ORDER[k] };
                self.line(format!("{op}(&{array}[({at} & 3u) * 6u + {k}u], {value});"));
            }
            3 => {
                let name = self.name('t');
                let old = self.live(&U32);
                self.line(format!("let {name} = atomicCompareExchangeWeak(&own_u[lane], {old} & 3u, {value} & 3u);"));
                self.declare(format!("{name}.old_value"), U32, false, None);
                self.declare(format!("{name}.exchanged"), super::types::BOOL, false, None);
            }
            4 => self.line(format!("atomicStore(&own_u[lane], {value});")),
            5 if self.style.scalars.contains(&Scalar::F32) => {
                let name = self.name('t');
                let x = self.value(&F32);
                let op = *self.r.one(&["atomicAdd", "atomicSub", "atomicExchange"]);
                self.line(format!("let {name} = {op}(&own_f[lane], {x});"));
                self.declare(name, F32, false, None);
            }
            6 => {
                let name = self.name('t');
                let x = self.live(&I32);
                let op = *self.r.one(&["atomicMin", "atomicMax", "atomicSub", "atomicAdd", "atomicAnd"]);
                self.line(format!("let {name} = {op}(&own_i[lane].v, {x});"));
                self.declare(name, I32, false, None);
            }
            7 => {
                let name = self.name('t');
                self.line(format!("let {name} = atomicLoad(&own_u[lane]);"));
                self.declare(name, U32, false, None);
            }
            _ => {
                let name = self.name('t');
                let op = *self.r.one(&["atomicExchange", "atomicAdd", "atomicSub", "atomicMax", "atomicMin", "atomicXor"]);
                self.line(format!("let {name} = {op}(&own_u[lane], {value});"));
                self.declare(name, U32, false, None);
            }
        }
    }

    /// What invocations do together: barriers with an exchange, subgroup operations, derivatives.
    pub fn meet(&mut self, flow: &Flow) {
        let compute = self.stage == naga::ShaderStage::Compute;
        if self.style.barriers && flow.uniform && compute && self.r.percent(70) {
            return self.exchange(flow);
        }
        if self.style.derivatives && flow.uniform && self.r.percent(70) {
            return self.derivative();
        }
        if self.style.subgroups {
            return self.subgroup();
        }
        self.look();
    }

    fn derivative(&mut self) {
        let ty = if self.r.percent(40) { Ty::Vector(2 + self.r.below(3), Scalar::F32) } else { F32 };
        let f = *self.r.one(&[
            "dpdx",
            "dpdy",
            "fwidth",
            "dpdxFine",
            "dpdyFine",
            "fwidthFine",
            "dpdxCoarse",
            "dpdyCoarse",
            "fwidthCoarse",
        ]);
        let e = self.value(&ty);
        let name = self.name('t');
        self.line(format!("let {name} = {f}({e});"));
        self.declare(name, ty, false, None);
    }

    fn exchange(&mut self, flow: &Flow) {
        let (n, k) = (self.size, self.r.below(self.size));
        let name = self.name('t');
        let value = self.value(&U32);
        match self.r.below(6) {
            0 => {
                let barrier = *self.r.one(&["workgroupBarrier();", "storageBarrier();", "textureBarrier();"]);
                return self.line(barrier);
            }
            1 => {
                self.line(format!("shared_words[li] = {value};"));
                self.line("workgroupBarrier();");
                self.line(format!("let {name} = shared_words[(li + {k}u) % {n}u];"));
                self.line("workgroupBarrier();");
            }
            2 if self.has.atomics => {
                self.line("workgroupBarrier();");
                let at = self.r.below(24);
                self.line(format!("let {name} = atomicLoad(&shared_counts[{at}]);"));
                self.line("workgroupBarrier();");
            }
            3 => {
                self.line("storageBarrier();");
                let at = self.r.below(8);
                self.line(format!("let {name} = out[(lane - li + (li + {k}u) % {n}u) * {STRIDE}u + {at}u];"));
                self.line("storageBarrier();");
            }
            _ => {
                self.line("if (li == 0u) {");
                self.line(format!("shared_flag = {value};"));
                self.line("}");
                self.line(format!("let {name} = workgroupUniformLoad(&shared_flag);"));
                if self.r.percent(50) {
                    self.line(format!("if (({name} & 1u) == 0u) {{"));
                    self.block(&Flow { depth: flow.depth + 1, ..flow.clone() }, 3);
                    self.line("}");
                }
            }
        }
        self.declare(name, U32, false, None);
    }

    fn subgroup(&mut self) {
        let s = *self.r.one(&self.style.scalars.iter().copied().filter(|s| *s != Scalar::Bool).collect::<Vec<_>>());
        let ty = if self.r.percent(25) { Ty::Vector(2, s) } else { Ty::Scalar(s) };
        let name = self.name('t');
        let value = self.value(&ty);
        let index = self.live(&U32);
        let k = self.r.below(10);
        const SUMS: [&str; 8] = [
            "subgroupAdd",
            "subgroupMul",
            "subgroupMin",
            "subgroupMax",
            "subgroupInclusiveAdd",
            "subgroupInclusiveMul",
            "subgroupExclusiveAdd",
            "subgroupExclusiveMul",
        ];
        let (text, ty) = match self.r.below(12) {
            0..=2 => (format!("{}({value})", self.r.one(&SUMS)), ty),
            3 if !s.is_float() => (format!("{}({value})", self.r.one(&["subgroupAnd", "subgroupOr", "subgroupXor"])), ty),
            4 => (format!("{}({})", self.r.one(&["subgroupAll", "subgroupAny"]), self.condition(1)), super::types::BOOL),
            5 if k < 5 => ("subgroupBallot()".into(), Ty::Vector(4, Scalar::U32)),
            5 => (format!("subgroupBallot({})", self.condition(1)), Ty::Vector(4, Scalar::U32)),
            6 => (format!("subgroupBroadcast({value}, {k}u)"), ty),
            7 => (format!("subgroupBroadcastFirst({value})"), ty),
            8 => (format!("subgroupShuffle({value}, {index} & 63u)"), ty),
            9 => {
                let f = *self.r.one(&["subgroupShuffleDown", "subgroupShuffleUp", "subgroupShuffleXor"]);
                (format!("{f}({value}, {index} & 7u)"), ty)
            }
            10 => (format!("quadBroadcast({value}, {}u)", k % 4), ty),
            _ => (format!("{}({value})", self.r.one(&["quadSwapX", "quadSwapY", "quadSwapDiagonal"])), ty),
        };
        self.line(format!("let {name} = {text};"));
        self.declare(name, ty, false, None);
    }
}
