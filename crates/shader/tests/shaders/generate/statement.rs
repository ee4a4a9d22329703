//! Statements.

use std::fmt::Write;

use super::types::U32;
use super::{Flow, Generator, Item, Scalar, Ty};

impl Generator<'_, '_> {
    pub fn line(&mut self, text: impl AsRef<str>) {
        self.body.push_str(text.as_ref());
        self.body.push('\n');
    }

    pub fn name(&mut self, letter: char) -> String {
        self.fresh += 1;
        format!("{letter}{}", self.fresh)
    }

    pub fn declare(&mut self, text: String, ty: Ty, write: bool, pointer: Option<&'static str>) {
        self.items.push(Item { text, ty, write, pointer, counter: false });
    }

    /// A type that the style likes.
    pub fn any_type(&mut self) -> Ty {
        let s = *self.r.one(&self.style.scalars.clone());
        if !self.r.percent(self.style.composite) {
            return Ty::Scalar(s);
        }
        let n = 2 + self.r.below(3);
        match self.r.below(9) {
            0..=3 => Ty::Vector(n, s),
            4 if s.is_float() => Ty::Matrix(n, 2 + self.r.below(3), s),
            5 | 6 => {
                let base = if self.r.percent(30) { Ty::Vector(n, s) } else { Ty::Scalar(s) };
                Ty::Array(Box::new(base), 2 + self.r.below(4))
            }
            7 if !self.structs.is_empty() => Ty::Struct(self.r.below(self.structs.len() as u32) as usize),
            8 if !self.structs.is_empty() && self.r.percent(50) => {
                Ty::Array(Box::new(Ty::Struct(self.r.below(self.structs.len() as u32) as usize)), 2)
            }
            _ => Ty::Scalar(s),
        }
    }

    /// A new variable.
    pub fn variable(&mut self) {
        let ty = self.any_type();
        let name = self.name('v');
        let text = self.text(&ty);
        match self.r.below(4) {
            0 => self.line(format!("var {name}: {text};")),
            1 if matches!(ty, Ty::Scalar(_)) => {
                let Ty::Scalar(s) = ty else { return };
                let value = self.literal(s);
                self.line(format!("var {name}: {text} = {value};"));
            }
            _ => {
                let value = self.value(&ty);
                self.line(format!("var {name}: {text} = {value};"));
            }
        }
        self.declare(name, ty, true, Some("function"));
    }

    /// Counters that are declared before everything else: what is declared last is then another variable, or none.
    pub fn counter_pool(&mut self) {
        self.counters.clear();
        let most = if self.style.tight { 2 } else { 4 };
        for _ in 0..self.r.below(most) {
            let name = self.name('k');
            self.line(format!("var {name} = 0u;"));
            self.counters.push(name);
        }
    }

    /// Statements in a scope of their own; whether the last one leaves.
    pub fn block(&mut self, flow: &Flow, most: u32) -> bool {
        let mark = self.items.len();
        let n = 1 + self.r.below(most);
        let mut left = false;
        for _ in 0..n {
            if self.statement(flow) {
                left = true;
                break;
            }
        }
        self.items.truncate(mark);
        left
    }

    /// One statement; whether it leaves.
    pub fn statement(&mut self, flow: &Flow) -> bool {
        if !self.affords(flow) {
            return false;
        }
        self.turns = flow.turns;
        let nested = flow.depth < 5;
        let s = self.style.clone();
        let mut pick = self.r.below(100 + s.loops + s.ifs + s.switches + s.memory + s.atomics + s.textures) as i32;
        let mut chosen = |share: u32| {
            pick -= share as i32;
            pick < 0
        };
        if chosen(s.loops) {
            if nested {
                self.a_loop(flow);
            }
        } else if chosen(s.ifs) {
            if nested {
                return self.an_if(flow);
            }
        } else if chosen(s.switches) {
            if nested {
                self.a_switch(flow);
            }
        } else if chosen(s.memory) {
            self.touch_memory(flow);
        } else if chosen(s.atomics) {
            self.an_atomic();
        } else if chosen(s.textures) {
            self.touch_texture(flow);
        } else if chosen(8) {
            return self.leave(flow, false);
        } else if chosen(18) {
            self.look();
        } else if chosen(6) {
            self.variable();
        } else if chosen(if s.tight || s.broad { 18 } else { 7 }) {
            self.a_let();
        } else if chosen(if s.broad { 20 } else { 6 }) {
            if flow.uniform || s.subgroups {
                self.meet(flow);
            }
        } else if chosen(5) {
            self.call_statement();
        } else if chosen(2) && nested {
            self.line("{");
            let left = self.block(&Flow { depth: flow.depth + 1, ..flow.clone() }, 3);
            self.line("}");
            return left;
        } else {
            self.assign();
        }
        false
    }

    fn call_statement(&mut self) {
        let Some(call) = self.call(None) else { return self.look() };
        // A result that is not used needs a place that takes anything.
        let name = call.split('(').next().unwrap_or_default();
        let result = self.functions.iter().find(|f| f.name == name).and_then(|f| f.result.clone());
        self.line(if result.is_some() { format!("_ = {call};") } else { format!("{call};") });
    }

    pub fn a_let(&mut self) {
        let ty = self.any_type();
        if self.r.percent(20) {
            // A pointer to a variable, or to a part of one chosen now.
            let places: Vec<Item> =
                self.items.iter().filter(|i| i.write && i.pointer.is_some() && !i.counter).cloned().collect();
            if let Some(item) = (!places.is_empty()).then(|| self.r.one(&places).clone()) {
                let name = self.name('p');
                let (mut text, mut ty) = (item.text, item.ty);
                while let Ty::Array(base, n) = ty.clone() {
                    text = format!("{text}[{}]", self.index(n));
                    ty = *base;
                }
                self.line(format!("let {name} = &{text};"));
                self.declare(format!("(*{name})"), ty, true, None);
                return;
            }
        }
        let name = self.name('t');
        if self.r.percent(40) && self.functions.iter().any(|f| f.result.is_some()) {
            // What a function hands back, of whatever type.
            let results: Vec<Ty> = self.functions.iter().filter_map(|f| f.result.clone()).collect();
            let ty = self.r.one(&results).clone();
            if let Some(call) = self.call(Some(&ty)) {
                self.line(format!("let {name} = {call};"));
                return self.declare(name, ty, false, None);
            }
        }
        let value = self.value(&ty);
        self.line(format!("let {name} = {value};"));
        self.declare(name, ty, false, None);
    }

    pub fn assign(&mut self) {
        let targets: Vec<Item> = self.items.iter().filter(|i| i.write).cloned().collect();
        if targets.is_empty() {
            return self.look();
        }
        let item = self.r.one(&targets).clone();
        if item.counter {
            let step = self.live(&U32);
            let ty = self.text(&item.ty);
            return self.line(format!("{} += {ty}({step} & 1u);", item.text));
        }
        // All of it, or a part.
        let mut wanted = item.ty.clone();
        while self.r.percent(60) {
            wanted = match wanted {
                Ty::Scalar(_) => break,
                Ty::Vector(_, s) => Ty::Scalar(s),
                Ty::Matrix(_, r, s) => Ty::Vector(r, s),
                Ty::Array(base, _) => *base,
                Ty::Struct(k) => self.r.one(&self.structs[k].members).1.clone(),
            };
        }
        let Some(place) = self.reach(item.text, item.ty, &wanted, true) else { return };
        self.assign_to(&place, &wanted);
    }

    pub fn assign_to(&mut self, place: &str, ty: &Ty) {
        let scalar = match ty {
            Ty::Scalar(s) | Ty::Vector(_, s) if *s != Scalar::Bool => Some(*s),
            _ => None,
        };
        match (scalar, self.r.below(10)) {
            (Some(Scalar::U32 | Scalar::I32), 0) if matches!(ty, Ty::Scalar(_)) => {
                let op = *self.r.one(&["++", "--"]);
                self.line(format!("{place}{op};"));
            }
            (Some(s), 1..=4) => {
                let ops: &[&str] =
                    if s.is_float() { &["+=", "-=", "*="] } else { &["+=", "-=", "*=", "^=", "|=", "&=", "%=", "/="] };
                let op = *self.r.one(ops);
                let value = self.value(ty);
                self.line(format!("{place} {op} {value};"));
            }
            _ => {
                let value = self.value(ty);
                self.line(format!("{place} = {value};"));
            }
        }
    }

    /// Shows a variable: what it holds goes into memory (or into the history that is an output).
    pub fn look(&mut self) {
        let n = self.items.len() as u32;
        if n == 0 {
            return;
        }
        let item = self.items[self.r.below(n).max(self.r.below(n)) as usize].clone();
        self.look_at(&item);
    }

    pub fn look_at(&mut self, item: &Item) {
        let mut ty = item.ty.clone();
        loop {
            ty = match ty {
                Ty::Scalar(_) => break,
                Ty::Vector(_, s) | Ty::Matrix(_, _, s) => Ty::Scalar(s),
                Ty::Array(base, _) => *base,
                Ty::Struct(k) => self.r.one(&self.structs[k].members).1.clone(),
            };
        }
        let (Ty::Scalar(s), Some(text)) = (ty.clone(), self.reach(item.text.clone(), item.ty.clone(), &ty, false)) else {
            return;
        };
        let word = self.word_of(&text, s);
        self.show(&word);
    }

    /// Stores a word where it will be compared.
    pub fn show(&mut self, word: &str) {
        let k = self.r.below(8);
        if !self.has.out {
            return self.line(format!("history = history * 31u + {word};"));
        }
        match self.r.below(10) {
            _ if self.r.percent(self.style.puts) => self.line(format!("put({word});")),
            0..=3 => self.line(format!("out[base + {k}u] = {word};")),
            4 => {
                let at = self.live(&U32);
                self.line(format!("out[base + ({at} & 7u)] = {word};"));
            }
            _ => self.line(format!("out[base + {k}u] = out[base + {k}u] * 31u + {word};")),
        }
    }

    /// A function that later ones and the entry point may call.
    pub fn function(&mut self) {
        let outer = (std::mem::take(&mut self.items), std::mem::take(&mut self.body), self.work);
        self.items = self.private_items();
        self.work = 0;
        let name = self.name('q');
        let mut parameters = Vec::new();
        let mut texts = Vec::new();
        for _ in 0..self.r.below(4) {
            let ty = self.any_type();
            let p = self.name('a');
            let text = self.text(&ty);
            if self.r.percent(45) {
                let space = if self.r.percent(85) { "function" } else { "private" };
                texts.push(format!("{p}: ptr<{space}, {text}>"));
                self.declare(format!("(*{p})"), ty.clone(), true, None);
                parameters.push((ty, Some(space)));
            } else {
                texts.push(format!("{p}: {text}"));
                self.declare(p, ty.clone(), false, None);
                parameters.push((ty, None));
            }
        }
        let result = self.r.percent(75).then(|| self.any_type());
        let arrow = result.as_ref().map(|ty| format!(" -> {}", self.text(ty))).unwrap_or_default();
        self.line(format!("fn {name}({}){arrow} {{", texts.join(", ")));
        // A function that only hands on what it is given is the one whose result is the caller's own variable.
        let short = self.style.tight || self.r.percent(40);
        let early = !short && self.r.percent(70);
        let flow = Flow { turns: 1, depth: 2, can_return: early.then(|| result.clone()), ..Flow::default() };
        let kept = self.budget;
        self.budget = if short { self.r.below(2) } else { 3 + self.r.below(14) };
        self.counter_pool();
        if !short {
            for _ in 0..self.r.below(3) {
                self.variable();
            }
        }
        let mut left = false;
        for _ in 0..1 + self.r.below(5) {
            left = self.statement(&flow);
            if left {
                break;
            }
        }
        if let (false, Some(ty)) = (left, &result) {
            let value = if short || self.r.percent(30) { self.live(ty) } else { self.value(ty) };
            self.line(format!("return {value};"));
        }
        self.line("}");
        self.budget = kept;
        let text = std::mem::take(&mut self.body);
        let _ = write!(self.globals, "{text}");
        let cost = self.work + 1;
        (self.items, self.body, self.work) = outer;
        self.functions.push(super::Function { name, parameters, result, cost });
    }
}
