//! Expressions of a wanted type.

use super::types::{BOOL, F32, I32, U32};
use super::{Flow, Generator, Scalar, Ty};

impl Generator<'_, '_> {
    pub fn text(&self, ty: &Ty) -> String {
        ty.text(&self.structs)
    }

    /// An index of something with `n` parts: known, or computed, then mostly in range.
    pub fn index(&mut self, n: u32) -> String {
        // An index is made of what may be indexed itself: two deep at most.
        if self.nesting > 1 || self.r.percent(35) {
            return format!("{}", self.r.below(n));
        }
        let signed = self.style.scalars.contains(&Scalar::I32) && self.r.percent(30);
        let ty = if signed { I32 } else { U32 };
        self.nesting += 1;
        let e = self.live(&ty);
        self.nesting -= 1;
        if self.r.percent(self.style.wild) {
            return e;
        }
        if signed { format!("(({e} & 0xffffi) % {n}i)") } else { format!("({e} % {n}u)") }
    }

    /// A place or value in scope of type `want`: a variable or a part of one.
    pub fn find(&mut self, want: &Ty, write: bool) -> Option<String> {
        let fits = |i: &super::Item| (!write || i.write && !i.counter) && i.ty.holds(want, &self.structs);
        let all: Vec<usize> = (0..self.items.len()).filter(|&k| fits(&self.items[k])).collect();
        if all.is_empty() {
            return None;
        }
        // What was declared last is used most: it dies soonest.
        let k = self.r.below(all.len() as u32).max(self.r.below(all.len() as u32));
        let item = self.items[all[k as usize]].clone();
        self.reach(item.text, item.ty, want, write)
    }

    /// A part of type `want` of what `text` names.
    pub fn reach(&mut self, mut text: String, mut ty: Ty, want: &Ty, write: bool) -> Option<String> {
        while ty != *want {
            match ty.clone() {
                Ty::Scalar(_) => return None,
                Ty::Vector(n, s) => {
                    if let Ty::Vector(m, _) = want {
                        if write {
                            return None;
                        }
                        let names: String = (0..*m).map(|_| "xyzw".as_bytes()[self.r.below(n) as usize] as char).collect();
                        return Some(format!("{text}.{names}"));
                    }
                    if self.r.percent(60) {
                        text = format!("{text}.{}", &"xyzw"[self.r.below(n) as usize..][..1]);
                    } else {
                        text = format!("{text}[{}]", self.index(n));
                    }
                    ty = Ty::Scalar(s);
                }
                Ty::Matrix(c, rows, s) => {
                    text = format!("{text}[{}]", self.index(c));
                    ty = Ty::Vector(rows, s);
                }
                Ty::Array(base, n) => {
                    text = format!("{text}[{}]", self.index(n));
                    ty = *base;
                }
                Ty::Struct(k) => {
                    let members = &self.structs[k].members;
                    let fitting: Vec<_> = members.iter().filter(|(_, t)| t.holds(want, &self.structs)).cloned().collect();
                    let (name, member) = self.r.one(&fitting).clone();
                    text = format!("{text}.{name}");
                    ty = member;
                }
            }
        }
        Some(text)
    }

    pub fn literal(&mut self, s: Scalar) -> String {
        let n = self.r.below(9);
        match s {
            Scalar::Bool => (n & 1 == 0).to_string(),
            Scalar::U32 => format!("{n}u"),
            Scalar::I32 if n > 5 => format!("(-{n}i)"),
            Scalar::I32 => format!("{n}i"),
            Scalar::F32 => format!("{}f", self.r.one(&["0.0", "1.0", "0.5", "2.0", "3.25", "0.1", "1e9", "1e-3", "7.0"])),
            Scalar::F16 => format!("{}h", self.r.one(&["0.0", "1.0", "0.5", "2.0", "3.25", "0.1", "100.0", "7.0"])),
        }
    }

    /// A value that naga does not know while it reads the program.
    pub fn live(&mut self, ty: &Ty) -> String {
        if self.r.percent(75)
            && let Some(text) = self.find(ty, false)
        {
            return text;
        }
        match ty {
            Ty::Scalar(Scalar::U32) => self.memory_word(),
            Ty::Scalar(Scalar::I32) => match self.r.below(3) {
                0 => format!("uni.i[{}]", self.index(4)),
                _ => format!("bitcast<i32>({})", self.memory_word()),
            },
            Ty::Scalar(Scalar::Bool) => format!("({} < {}u)", self.memory_word(), self.r.below(6)),
            Ty::Scalar(Scalar::F32) => match self.r.below(4) {
                0 => format!("uni.f[{}]", self.index(4)),
                1 => format!("uni.m[{}][{}]", self.index(3), self.index(3)),
                _ => format!("f32({})", self.memory_word()),
            },
            Ty::Scalar(Scalar::F16) => format!("f16(f32({}) * 0.25f)", self.memory_word()),
            Ty::Vector(n, s) => format!("vec{n}<{}>({})", s.text(), self.live(&Ty::Scalar(*s))),
            _ => self.construct(ty, 0),
        }
    }

    /// The shortest expressions.
    fn leaf(&mut self, ty: &Ty) -> String {
        match ty {
            Ty::Scalar(s) if self.r.percent(25) => self.literal(*s),
            Ty::Vector(n, s) if self.r.percent(15) => format!("vec{n}<{}>({})", s.text(), self.literal(*s)),
            _ => self.live(ty),
        }
    }

    /// A value of its parts.
    fn construct(&mut self, ty: &Ty, depth: u32) -> String {
        let text = self.text(ty);
        let parts: Vec<Ty> = match ty {
            Ty::Scalar(_) => return self.live(ty),
            Ty::Vector(4, s) if self.r.percent(40) => vec![Ty::Vector(2, *s), Ty::Scalar(*s), Ty::Scalar(*s)],
            Ty::Vector(n, s) => vec![Ty::Scalar(*s); *n as usize],
            Ty::Matrix(c, r, s) => vec![Ty::Vector(*r, *s); *c as usize],
            Ty::Array(base, n) => vec![(**base).clone(); *n as usize],
            Ty::Struct(k) => self.structs[*k].members.iter().map(|(_, ty)| ty.clone()).collect(),
        };
        let parts: Vec<String> = parts.iter().map(|part| self.live_at(part, depth.saturating_sub(1))).collect();
        format!("{text}({})", parts.join(", "))
    }

    fn live_at(&mut self, ty: &Ty, depth: u32) -> String {
        if depth == 0 { self.live(ty) } else { self.operation(ty, depth) }
    }

    /// An expression of a type.
    pub fn expr(&mut self, ty: &Ty, depth: u32) -> String {
        if depth == 0 || self.r.percent(20) { self.leaf(ty) } else { self.operation(ty, depth) }
    }

    /// An expression as deep as the style wants.
    pub fn value(&mut self, ty: &Ty) -> String {
        let depth = self.r.below(self.style.depth + 1);
        self.live_at(ty, depth)
    }

    fn operation(&mut self, ty: &Ty, depth: u32) -> String {
        let d = depth - 1;
        if self.r.percent(6)
            && let Some(text) = self.call(Some(ty))
        {
            return text;
        }
        if self.r.percent(7) {
            let (a, b, c) = (self.live_at(ty, d), self.expr(ty, d), self.condition(d));
            if matches!(ty, Ty::Scalar(_) | Ty::Vector(..)) {
                return format!("select({a}, {b}, {c})");
            }
        }
        match ty {
            Ty::Scalar(Scalar::Bool) => self.condition(depth),
            Ty::Vector(n, Scalar::Bool) => {
                let s = *self.r.one(&self.style.scalars.clone());
                let v = Ty::Vector(*n, if s == Scalar::Bool { Scalar::U32 } else { s });
                let (a, b) = (self.live_at(&v, d), self.expr(&v, d));
                match self.r.below(6) {
                    0 => format!("(!{})", self.live_at(ty, d)),
                    1 => format!("({} & {})", self.live_at(ty, d), self.expr(ty, d)),
                    2 => format!("({} | {})", self.live_at(ty, d), self.expr(ty, d)),
                    _ => format!("({a} {} {b})", self.r.one(&["<", "<=", ">", ">=", "==", "!="])),
                }
            }
            Ty::Scalar(s) | Ty::Vector(_, s) => {
                if self.r.percent(self.style.builtins) {
                    return self.builtin(ty, d);
                }
                self.arithmetic(ty, *s, d)
            }
            Ty::Matrix(c, r, s) => {
                let a = self.live_at(ty, d);
                match self.r.below(6) {
                    0 => format!("({a} + {})", self.live(ty)),
                    1 => format!("({a} - {})", self.live(ty)),
                    2 => format!("({a} * {})", self.expr(&Ty::Scalar(*s), d)),
                    3 => format!("({a} * {})", self.live(&Ty::Matrix(*c, *c, *s))),
                    4 => format!("transpose({})", self.live(&Ty::Matrix(*r, *c, *s))),
                    _ => self.construct(ty, depth),
                }
            }
            Ty::Array(..) | Ty::Struct(_) => {
                if self.r.percent(50) {
                    self.live(ty)
                } else {
                    self.construct(ty, depth)
                }
            }
        }
    }

    fn arithmetic(&mut self, ty: &Ty, s: Scalar, d: u32) -> String {
        if self.r.percent(8) && matches!(ty, Ty::Vector(..)) {
            return self.construct(ty, d + 1);
        }
        if self.r.percent(10) {
            return self.conversion(ty, s, d);
        }
        let a = self.live_at(ty, d);
        if s.is_float() {
            if let Ty::Vector(n, _) = ty
                && self.r.percent(10)
            {
                let k = 2 + self.r.below(3);
                let v = self.live(&Ty::Vector(k, s));
                return match self.r.below(2) {
                    0 => format!("({} * {v})", self.live(&Ty::Matrix(k, *n, s))),
                    _ => format!("({v} * {})", self.live(&Ty::Matrix(*n, k, s))),
                };
            }
            // A scalar is repeated for each component.
            let other = if self.r.percent(20) { Ty::Scalar(s) } else { ty.clone() };
            let b = self.expr(&other, d);
            return match self.r.below(10) {
                0..=2 => format!("({a} + {b})"),
                3 | 4 => format!("({a} - {b})"),
                5..=7 => format!("({a} * {b})"),
                8 if self.r.percent(30) => format!("({a} % {})", self.live(&other)),
                8 => format!("({a} / {})", self.live(&other)),
                _ => format!("(-{a})"),
            };
        }
        let b = self.expr(ty, d);
        match self.r.below(14) {
            0..=2 => format!("({a} + {b})"),
            3 => format!("({a} - {b})"),
            4 | 5 => format!("({a} * {b})"),
            6 => format!("({a} ^ {b})"),
            7 => format!("({a} & {b})"),
            8 => format!("({a} | {b})"),
            9 => format!("({a} / {})", self.live(ty)),
            10 => format!("({a} % {})", self.live(ty)),
            11 | 12 => {
                let amount = match ty {
                    Ty::Vector(n, _) => format!("({} & vec{n}<u32>(31u))", self.live(&Ty::Vector(*n, Scalar::U32))),
                    _ => format!("({} & 31u)", self.expr(&U32, d)),
                };
                format!("({a} {} {amount})", if self.r.percent(50) { "<<" } else { ">>" })
            }
            _ if s == Scalar::I32 => format!("(-{a})"),
            _ => format!("(~{a})"),
        }
    }

    /// A value of another type, converted, or its bits.
    fn conversion(&mut self, ty: &Ty, s: Scalar, d: u32) -> String {
        let mut others = vec![Scalar::U32, Scalar::I32, Scalar::F32, Scalar::Bool];
        if self.style.half {
            others.push(Scalar::F16);
        }
        let from = *self.r.one(&others);
        let other = match ty {
            Ty::Vector(n, _) => Ty::Vector(*n, from),
            _ => Ty::Scalar(from),
        };
        let e = self.live_at(&other, d);
        let words = |s: Scalar| matches!(s, Scalar::U32 | Scalar::I32);
        if self.r.percent(40) && words(from) && (words(s) || s == Scalar::F32) {
            return format!("bitcast<{}>({e})", self.text(ty));
        }
        format!("{}({e})", self.text(ty))
    }

    /// A condition: from registers, uniforms, memory or ids.
    pub fn condition(&mut self, depth: u32) -> String {
        if depth > 0 {
            let d = depth - 1;
            match self.r.below(10) {
                0 | 1 => return format!("({} && {})", self.condition(d), self.condition(d)),
                2 => return format!("({} || {})", self.condition(d), self.condition(d)),
                3 => return format!("(!{})", self.condition(d)),
                6 if self.style.builtins > 10 => {
                    let ty = *self.r.one(&[Scalar::U32, Scalar::I32, Scalar::F32]);
                    return format!("bool({})", self.live_at(&Ty::Scalar(ty), d));
                }
                4 if self.style.builtins > 10 => {
                    let n = 2 + self.r.below(3);
                    let v = self.live_at(&Ty::Vector(n, Scalar::Bool), d);
                    return format!("{}({v})", self.r.one(&["all", "any"]));
                }
                5 if self.style.scalars.contains(&Scalar::Bool) => {
                    let (a, b) = (self.live(&BOOL), self.live(&BOOL));
                    return format!("({a} {} {b})", self.r.one(&["==", "!=", "&", "|"]));
                }
                _ => {}
            }
        }
        match self.r.below(8) {
            0 => format!("(({} & {}u) == 0u)", self.memory_word(), 1 + self.r.below(3)),
            1 => format!("(lane {} {}u)", self.r.one(&["<", ">=", "==", "!="]), self.r.below(40)),
            2 => format!("((lane & {}u) == 0u)", 1 << self.r.below(4)),
            3 => self.uniform_condition(),
            4 if self.style.scalars.contains(&Scalar::Bool) => self.live(&BOOL),
            5 if self.style.scalars.contains(&Scalar::F32) => {
                format!("({} {} {})", self.live(&F32), self.r.one(&["<", "<=", ">", ">=", "==", "!="]), self.expr(&F32, 0))
            }
            6 if self.style.scalars.contains(&Scalar::I32) => {
                format!("({} {} {})", self.live(&I32), self.r.one(&["<", "<=", ">", ">=", "==", "!="]), self.expr(&I32, 0))
            }
            _ => {
                let e = self.live(&U32);
                match self.r.below(3) {
                    0 => format!("({e} % 3u == {}u)", self.r.below(3)),
                    1 => format!("({e} {} {}u)", self.r.one(&["<", ">=", "==", "!="]), self.r.below(7)),
                    _ => format!("(({e} & {}u) != 0u)", 1 + self.r.below(4)),
                }
            }
        }
    }

    /// A condition that is the same for all invocations, and that naga sees to be.
    pub fn uniform_condition(&mut self) -> String {
        let k = self.r.below(4);
        match self.r.below(3) {
            0 => format!("(uni.n[{k}] > {}u)", self.r.below(6)),
            1 => format!("(uni.i[{k}] < {}i)", self.r.below(6)),
            _ => format!("((uni.n[{k}] & 1u) == {}u)", self.r.below(2)),
        }
    }

    /// The bits of a scalar as an integer in which every NaN is the same.
    pub fn word_of(&self, text: &str, s: Scalar) -> String {
        match s {
            Scalar::Bool => format!("select(5u, 9u, {text})"),
            Scalar::U32 => text.to_owned(),
            Scalar::I32 => format!("bitcast<u32>({text})"),
            Scalar::F32 => format!("bits_of({text})"),
            Scalar::F16 => format!("bits_of(f32({text}))"),
        }
    }

    /// A call of a function with a result of this type, or of any if there is none wanted.
    pub fn call(&mut self, want: Option<&Ty>) -> Option<String> {
        let fits = |f: &super::Function| want.is_none_or(|w| f.result.as_ref() == Some(w));
        let all: Vec<usize> = (0..self.functions.len()).filter(|&k| fits(&self.functions[k])).collect();
        if all.is_empty() {
            return None;
        }
        let f = self.functions[all[self.r.below(all.len() as u32) as usize]].clone();
        if self.work + f.cost * self.turns > super::WORK {
            return None;
        }
        let mut arguments = Vec::new();
        for (ty, space) in &f.parameters {
            let Some(space) = space else {
                arguments.push(self.live(ty));
                continue;
            };
            let places: Vec<String> = self
                .items
                .iter()
                .filter(|i| i.pointer == Some(*space) && i.ty == *ty && i.write && !i.counter)
                .map(|i| i.text.clone())
                .collect();
            let free: Vec<&String> = places.iter().filter(|p| !arguments.contains(&format!("&{p}"))).collect();
            if free.is_empty() {
                return None;
            }
            let place = (*self.r.one(&free)).clone();
            arguments.push(format!("&{place}"));
        }
        self.work += f.cost * self.turns;
        Some(format!("{}({})", f.name, arguments.join(", ")))
    }

    /// Whether one more statement may stand at a place.
    pub fn affords(&mut self, flow: &Flow) -> bool {
        if self.budget == 0 || self.work + flow.turns > super::WORK {
            return false;
        }
        self.budget -= 1;
        self.work += flow.turns;
        true
    }
}
