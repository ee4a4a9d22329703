//! Branches, switches, loops, and leaving them.

use super::types::{I32, U32};
use super::{Flow, Generator, Item, Scalar};

impl Generator<'_, '_> {
    /// Leaves what encloses this place, now or under a condition.
    pub fn leave(&mut self, flow: &Flow, always: bool) -> bool {
        let mut ways: Vec<String> = Vec::new();
        if flow.can_break {
            ways.push("break;".into());
        }
        if flow.can_continue {
            ways.extend(["continue;".into(), "continue;".into()]);
        }
        if self.style.discards && self.stage == naga::ShaderStage::Fragment && self.r.percent(30) {
            ways.push("discard;".into());
        }
        match &flow.can_return {
            Some(None) if self.r.percent(40) => ways.push("return;".into()),
            Some(Some(ty)) if self.r.percent(40) => {
                let value = self.value(&ty.clone());
                ways.push(format!("return {value};"));
            }
            _ => {}
        }
        if ways.is_empty() {
            self.assign();
            return false;
        }
        let way = self.r.one(&ways).clone();
        // Loops end by their counters; a plain leave at the top of a block is rare, or little would run.
        if always || flow.depth > 2 && self.r.percent(15) {
            self.line(&way);
            return way != "discard;";
        }
        let depth = self.r.below(2);
        let c = self.condition(depth);
        self.line(format!("if ({c}) {{"));
        if self.r.percent(40) {
            let inner = Flow {
                uniform: false,
                depth: flow.depth + 1,
                can_break: false,
                can_continue: false,
                can_return: None,
                ..flow.clone()
            };
            self.block(&inner, 2);
        }
        self.line(&way);
        self.line("}");
        false
    }

    pub fn an_if(&mut self, flow: &Flow) -> bool {
        let same = flow.uniform && self.r.percent(50);
        let depth = self.r.below(3);
        let c = if same { self.uniform_condition() } else { self.condition(depth) };
        let mut inner = Flow { uniform: same, depth: flow.depth + 1, ..flow.clone() };
        if flow.uniform && !same {
            // An invocation that leaves here would take part in no meeting after it.
            inner = self.apart(inner);
        }
        self.line(format!("if ({c}) {{"));
        let mut left = self.arm(&inner);
        if self.r.percent(25) {
            let c = if same { self.uniform_condition() } else { self.condition(1) };
            self.line(format!("}} else if ({c}) {{"));
            left &= self.arm(&inner);
        }
        if self.r.percent(45) {
            self.line("} else {");
            left &= self.arm(&inner);
        } else {
            left = false;
        }
        self.line("}");
        left
    }

    /// What a branch of uniform flow may do where only some invocations are.
    pub fn apart(&self, flow: Flow) -> Flow {
        Flow { uniform: false, can_break: false, can_continue: false, can_return: None, ..flow }
    }

    pub fn arm(&mut self, flow: &Flow) -> bool {
        if self.r.percent(self.style.leaves / 2) && (flow.can_break || flow.can_continue || flow.can_return.is_some()) {
            let mark = self.items.len();
            if self.r.percent(60) && self.affords(flow) {
                self.turns = flow.turns;
                if self.r.percent(60) { self.assign() } else { self.look() }
            }
            let left = self.leave(flow, true);
            self.items.truncate(mark);
            return left;
        }
        self.block(flow, 4)
    }

    pub fn a_switch(&mut self, flow: &Flow) {
        let signed = self.style.scalars.contains(&Scalar::I32) && self.r.percent(30);
        let s = if signed { "i" } else { "u" };
        let n = 1 + self.r.below(5);
        let value = self.value(if signed { &I32 } else { &U32 });
        let same = flow.uniform && self.r.percent(30);
        let mut inner = Flow { uniform: same, depth: flow.depth + 1, ..flow.clone() };
        if flow.uniform && !same {
            inner = self.apart(inner);
        }
        inner.can_break = !same;
        if same {
            inner.can_continue = false;
            let k = self.r.below(4);
            self.line(format!("switch (uni.{}[{k}]) {{", if signed { "i" } else { "n" }));
        } else if self.r.percent(80) {
            self.line(format!("switch ({value} % {}{s}) {{", n + 1));
        } else {
            self.line(format!("switch ({value}) {{"));
        }
        let default = self.r.below(n);
        let mut next = 0;
        for k in 0..n {
            let mut selectors: Vec<String> = Vec::new();
            for _ in 0..1 + self.r.below(2) {
                selectors.push(format!("{next}{s}"));
                next += 1;
            }
            if k == default {
                if self.r.percent(50) {
                    selectors = vec!["default".into()];
                } else {
                    selectors.insert(self.r.below(2) as usize, "default".into());
                }
            }
            let head = if selectors == ["default"] { "default".to_owned() } else { format!("case {}", selectors.join(", ")) };
            self.line(format!("{head}: {{"));
            if self.r.percent(85) {
                self.arm(&inner);
            }
            self.line("}");
        }
        self.line("}");
    }

    /// The bound of a loop's counter: its text and the most it can be.
    pub fn bound(&mut self, same: bool, most: u32) -> (String, u32) {
        let n = (2 + self.r.below(most)).min(most);
        if self.r.percent(self.style.known_bounds) {
            return (format!("{n}u"), n);
        }
        let rest = n.next_power_of_two() / 2;
        let least = n - rest.min(n);
        if same {
            return (format!("((uni.n[{}] & {}u) + {least}u)", self.r.below(4), rest.max(1) - 1), n);
        }
        let e = match self.r.below(3) {
            0 => "lane".to_owned(),
            1 => self.memory_word(),
            _ => self.live(&U32),
        };
        (format!("(({e} & {}u) + {least}u)", rest.max(1) - 1), n)
    }

    pub fn a_loop(&mut self, flow: &Flow) {
        let most = (super::WORK / 3 / (flow.turns * 4)).min(7);
        if most == 0 || self.budget < 4 {
            return self.look();
        }
        let same = flow.uniform && self.r.percent(50);
        let (bound, n) = self.bound(same, most);
        let pooled = if self.r.percent(70) { self.counters.pop() } else { None };
        let k = pooled.clone().unwrap_or_else(|| self.name('k'));
        let mark = self.items.len();
        let turns = flow.turns * n;
        let mut inner = Flow {
            can_break: !same,
            can_continue: !same,
            uniform: same,
            turns,
            depth: flow.depth + 1,
            can_return: if flow.uniform { None } else { flow.can_return.clone() },
        };
        let signed = pooled.is_none() && self.r.percent(15);
        let (ty, one, zero) = if signed { (I32, "1i", "0i") } else { (U32, "1u", "0u") };
        let bound = if signed { format!("i32({bound})") } else { bound };
        let outside = pooled.is_some() || self.r.percent(40);
        let counter = Item { text: k.clone(), ty, write: !same, pointer: None, counter: true };
        let form = self.r.below(7);
        if form != 0 || outside {
            self.line(format!("{}{k} = {zero};", if pooled.is_some() { "" } else { "var " }));
            self.items.push(counter.clone());
        }
        match form {
            0 => {
                let first = if outside { format!("{k} = {zero}") } else { format!("var {k} = {zero}") };
                let step = if self.r.percent(50) { format!("{k}++") } else { format!("{k} += {one}") };
                self.line(format!("for ({first}; {k} < {bound}; {step}) {{"));
                self.items.push(counter);
                self.loop_body(&inner);
                self.line("}");
            }
            1 => {
                self.line(format!("while ({k} < {bound}) {{"));
                self.line(format!("{k} += {one};"));
                self.loop_body(&inner);
                self.line("}");
            }
            2 | 3 => {
                self.line("loop {");
                if form == 2 {
                    self.line(format!("if ({k} >= {bound}) {{ break; }}"));
                } else {
                    self.line(format!("{k} += {one};"));
                    self.line(format!("if ({k} > {bound}) {{ break; }}"));
                }
                let seen = self.loop_body(&inner);
                if form == 2 || self.r.percent(80) {
                    let step = (form == 2).then(|| format!("{k} += {one};"));
                    self.continuing(&mut inner, seen, step, None);
                }
                self.line("}");
            }
            4 | 5 => {
                self.line("loop {");
                let seen = self.loop_body(&inner);
                let until = if self.r.percent(60) || same {
                    format!("{k} >= {bound}")
                } else {
                    let c = self.condition(0);
                    format!("{k} >= {bound} || {c}")
                };
                self.continuing(&mut inner, seen, Some(format!("{k} += {one};")), Some(until));
                self.line("}");
            }
            _ => {
                self.line(format!("for (; {k} < {bound}; ) {{"));
                self.line(format!("{k} += {one};"));
                self.loop_body(&inner);
                self.line("}");
            }
        }
        self.items.truncate(mark);
        self.counters.extend(pooled);
    }

    /// The body of a loop; the names of the body's first declarations, which its continuing block may use.
    pub fn loop_body(&mut self, flow: &Flow) -> Vec<Item> {
        let mark = self.items.len();
        for _ in 0..self.r.below(4) {
            if self.affords(flow) {
                self.turns = flow.turns;
                match self.r.below(10) {
                    0..=6 => self.a_let(),
                    7 | 8 => self.variable(),
                    _ => self.touch_memory(flow),
                }
            }
        }
        let seen: Vec<Item> = self.items[mark..].to_vec();
        let mut left = false;
        for _ in 0..1 + self.r.below(6) {
            if self.affords(flow) {
                self.turns = flow.turns;
                match self.r.below(10) {
                    0..=2 => self.look(),
                    3..=6 => self.assign(),
                    _ => left = self.statement(flow),
                }
            }
            if left {
                break;
            }
            if flow.can_continue && self.r.percent(self.style.leaves / 2) && self.leave(flow, false) {
                left = true;
                break;
            }
        }
        if !left && flow.can_continue && self.r.percent(10) {
            self.line("continue;");
        }
        self.items.truncate(mark);
        seen
    }

    pub fn continuing(&mut self, flow: &mut Flow, seen: Vec<Item>, step: Option<String>, until: Option<String>) {
        let mark = self.items.len();
        self.items.extend(seen.clone());
        self.line("continuing {");
        let first = self.r.percent(50);
        if first && let Some(step) = &step {
            self.line(step);
        }
        // What is declared in the body may be used here; nothing may leave, but by the condition at the end.
        let inside = Flow { can_break: false, can_continue: false, can_return: None, ..flow.clone() };
        for _ in 0..self.r.below(4) {
            if self.affords(&inside) {
                self.turns = inside.turns;
                if !seen.is_empty() && self.r.percent(40) {
                    let item = self.r.one(&seen).clone();
                    self.look_at(&item);
                    continue;
                }
                match self.r.below(10) {
                    0..=2 => self.look(),
                    3..=7 => self.assign(),
                    8 => self.a_let(),
                    _ => {
                        self.statement(&inside);
                    }
                }
            }
        }
        if !first && let Some(step) = &step {
            self.line(step);
        }
        if let Some(until) = until {
            self.line(format!("break if {until};"));
        }
        self.line("}");
        self.items.truncate(mark);
    }
}
