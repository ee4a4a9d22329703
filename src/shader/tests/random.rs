//! Random programs against an evaluator that runs one invocation at a time.
//!
//! Every construct that the compiler treats in its own way occurs: variables written in branches, loops left from inside
//! branches and switches, values of the body used in the continuing block, early returns, pointer arguments, arrays indexed at
//! run time, loops that can be unrolled and loops that cannot.

use std::fmt::Write;

use super::*;

/// Variables of the function: `v0` to `v3`, and `a`, an array of five.
const VARS: usize = 4;

#[derive(Clone, Debug)]
enum Expr {
    Const(u32),
    X,
    Var(usize),
    Element(Box<Expr>),
    Op(u8, Box<Expr>, Box<Expr>),
}

#[derive(Clone, Debug)]
enum Stmt {
    Set(usize, Expr),
    SetElement(Expr, Expr),
    /// Calls `bump(&v, e)`, which returns early for even `e`.
    Bump(usize, Expr),
    If(Expr, Vec<Stmt>, Vec<Stmt>),
    /// `for` with this many rounds at most, and an addition in the continuing block of what `v` was when the round began.
    For(u32, bool, usize, Vec<Stmt>),
    Switch(Expr, Vec<Vec<Stmt>>),
    Break,
    Continue,
    Return(Expr),
}

struct Random(u32);

impl Random {
    fn below(&mut self, n: u32) -> u32 {
        self.0 = self.0.wrapping_mul(0x915f_77f5).wrapping_add(0x6d2b_79f5);
        let x = (self.0 ^ self.0 >> 15).wrapping_mul(0x2c1b_3c6d);
        (x ^ x >> 13) % n
    }

    fn expr(&mut self, depth: u32) -> Expr {
        match self.below(if depth == 0 { 4 } else { 8 }) {
            0 => Expr::Const(self.below(9)),
            1 => Expr::X,
            2 | 3 => Expr::Var(self.below(VARS as u32) as usize),
            4 => Expr::Element(Box::new(self.expr(depth - 1))),
            _ => {
                let op = self.below(8) as u8;
                Expr::Op(op, Box::new(self.expr(depth - 1)), Box::new(self.expr(depth - 1)))
            }
        }
    }

    /// A block; `inside` says whether `break` (1) and `continue` (2) are allowed.
    fn block(&mut self, depth: u32, inside: u32) -> Vec<Stmt> {
        let n = 1 + self.below(4);
        let mut out = Vec::new();
        for _ in 0..n {
            let s = match self.below(if depth == 0 { 5 } else { 12 }) {
                0..=2 => Stmt::Set(self.below(VARS as u32) as usize, self.expr(2)),
                3 => Stmt::SetElement(self.expr(1), self.expr(1)),
                4 => Stmt::Bump(self.below(VARS as u32) as usize, self.expr(1)),
                5..=7 => Stmt::If(self.expr(2), self.block(depth - 1, inside), self.block(depth - 1, inside)),
                8 | 9 => {
                    let v = self.below(VARS as u32) as usize;
                    Stmt::For(1 + self.below(6), self.below(2) == 0, v, self.block(depth - 1, 3))
                }
                _ => {
                    let n = 2 + self.below(3);
                    Stmt::Switch(self.expr(1), (0..n).map(|_| self.block(depth - 1, inside | 1)).collect())
                }
            };
            out.push(s);
        }
        match self.below(6) {
            0 if inside & 1 != 0 => out.push(Stmt::Break),
            1 if inside & 2 != 0 => out.push(Stmt::Continue),
            2 if depth < 2 => out.push(Stmt::Return(self.expr(1))),
            _ => {}
        }
        out
    }
}

fn show_expr(e: &Expr) -> String {
    match e {
        Expr::Const(c) => format!("{c}u"),
        Expr::X => "x".into(),
        Expr::Var(v) => format!("v{v}"),
        Expr::Element(i) => format!("a[{} % 5u]", show_expr(i)),
        Expr::Op(op, a, b) => {
            let (a, b) = (show_expr(a), show_expr(b));
            match op {
                0 => format!("({a} + {b})"),
                1 => format!("({a} - {b})"),
                2 => format!("({a} * {b})"),
                3 => format!("({a} ^ {b})"),
                4 => format!("({a} % max({b}, 1u))"),
                5 => format!("min({a}, {b})"),
                6 => format!("select(0u, 1u, {a} < {b})"),
                _ => format!("({a} >> ({b} & 7u))"),
            }
        }
    }
}

fn show(block: &[Stmt], out: &mut String, counter: &mut u32) {
    for s in block {
        match s {
            Stmt::Set(v, e) => writeln!(out, "v{v} = {};", show_expr(e)),
            Stmt::SetElement(i, e) => writeln!(out, "a[{} % 5u] = {};", show_expr(i), show_expr(e)),
            Stmt::Bump(v, e) => writeln!(out, "bump(&v{v}, {});", show_expr(e)),
            Stmt::If(c, t, e) => {
                writeln!(out, "if ({} % 3u == 0u) {{", show_expr(c)).expect("text");
                show(t, out, counter);
                out.push_str("} else {\n");
                show(e, out, counter);
                writeln!(out, "}}")
            }
            Stmt::For(n, fixed, v, body) => {
                *counter += 1;
                let k = *counter;
                // Without a fixed bound it depends on the invocation, and the loop cannot be unrolled.
                let bound = if *fixed { format!("{n}u") } else { format!("{n}u + (x & 1u)") };
                writeln!(out, "var k{k} = 0u; loop {{ if (k{k} >= {bound}) {{ break; }} let old{k} = v{v};").expect("text");
                show(body, out, counter);
                writeln!(out, "continuing {{ k{k} += 1u; v{v} += old{k} & 3u; }} }}")
            }
            Stmt::Switch(e, cases) => {
                writeln!(out, "switch ({} % {}u) {{", show_expr(e), cases.len() + 1).expect("text");
                for (i, c) in cases.iter().enumerate() {
                    let label = if i + 1 == cases.len() { "default:".into() } else { format!("case {i}u:") };
                    writeln!(out, "{label} {{").expect("text");
                    show(c, out, counter);
                    out.push_str("}\n");
                }
                writeln!(out, "}}")
            }
            Stmt::Break => writeln!(out, "break;"),
            Stmt::Continue => writeln!(out, "continue;"),
            Stmt::Return(e) => writeln!(out, "return {};", show_expr(e)),
        }
        .expect("text");
    }
}

struct State {
    x: u32,
    v: [u32; VARS],
    a: [u32; 5],
}

enum Flow {
    Next,
    Break,
    Continue,
    Return(u32),
}

impl State {
    fn eval(&self, e: &Expr) -> u32 {
        match e {
            Expr::Const(c) => *c,
            Expr::X => self.x,
            Expr::Var(v) => self.v[*v],
            Expr::Element(i) => self.a[(self.eval(i) % 5) as usize],
            Expr::Op(op, a, b) => {
                let (a, b) = (self.eval(a), self.eval(b));
                match op {
                    0 => a.wrapping_add(b),
                    1 => a.wrapping_sub(b),
                    2 => a.wrapping_mul(b),
                    3 => a ^ b,
                    4 => a % b.max(1),
                    5 => a.min(b),
                    6 => u32::from(a < b),
                    _ => a >> (b & 7),
                }
            }
        }
    }

    fn run(&mut self, block: &[Stmt]) -> Flow {
        for s in block {
            match s {
                Stmt::Set(v, e) => self.v[*v] = self.eval(e),
                Stmt::SetElement(i, e) => self.a[(self.eval(i) % 5) as usize] = self.eval(e),
                Stmt::Bump(v, e) => {
                    let e = self.eval(e);
                    let old = self.v[*v];
                    self.v[*v] = if e.is_multiple_of(2) { old.wrapping_add(1) } else { old.wrapping_mul(3).wrapping_add(e) };
                }
                Stmt::If(c, t, e) => {
                    let flow = if self.eval(c).is_multiple_of(3) { self.run(t) } else { self.run(e) };
                    if !matches!(flow, Flow::Next) {
                        return flow;
                    }
                }
                Stmt::For(n, fixed, v, body) => {
                    let mut k = 0;
                    while k < n + if *fixed { 0 } else { self.x & 1 } {
                        let old = self.v[*v];
                        match self.run(body) {
                            Flow::Break => break,
                            Flow::Return(r) => return Flow::Return(r),
                            _ => {}
                        }
                        k += 1;
                        self.v[*v] = self.v[*v].wrapping_add(old & 3);
                    }
                }
                Stmt::Switch(e, cases) => {
                    let n = cases.len();
                    let i = ((self.eval(e) % (n as u32 + 1)) as usize).min(n - 1);
                    match self.run(&cases[i]) {
                        Flow::Next | Flow::Break => {}
                        flow => return flow,
                    }
                }
                Stmt::Break => return Flow::Break,
                Stmt::Continue => return Flow::Continue,
                Stmt::Return(e) => return Flow::Return(self.eval(e)),
            }
        }
        Flow::Next
    }
}

/// A random program, and a function `f` that runs it, with what that calls.
fn functions(seed: u32) -> (Vec<Stmt>, String) {
    let mut random = Random(seed.wrapping_mul(0x9e37_79b9));
    let program = random.block(3, 0);
    let mut text = String::new();
    show(&program, &mut text, &mut 0);
    let functions = format!(
        "fn bump(p: ptr<function, u32>, e: u32) {{ if (e % 2u == 0u) {{ *p += 1u; return; }} *p = *p * 3u + e; }}
         fn f(x: u32) -> u32 {{
             var v0 = x; var v1 = 1u; var v2 = x * 7u; var v3 = 0u; var a = array<u32, 5>(x, 2u, 3u, x + 1u, 5u);
             {{\n{text}\n}}
             return v0 + v1 * 3u + v2 * 5u + v3 * 7u + a[0] + a[1] * 11u + a[2] + a[3] * 13u + a[4];
         }}"
    );
    (program, functions)
}

/// The text of a random function `f(x: u32) -> u32`, with what it calls.
pub(super) fn function(seed: u32) -> String {
    functions(seed).1
}

#[test]
fn random_programs_do_what_they_say() {
    let mut seen = 0;
    for seed in 0..300u32 {
        let (program, functions) = functions(seed);
        let source = format!(
            "@group(0) @binding(0) var<storage, read_write> result: array<u32>;
             @group(0) @binding(1) var<storage, read> input: array<u32>;
             {functions}
             @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {{ result[id.x] = f(input[id.x]); }}"
        );
        // A block that always leaves makes what follows it unreachable, which WGSL refuses.
        if Module::new("random", Source::Wgsl(&source)).is_err() {
            continue;
        }
        seen += 1;
        let got = each(&source, |i| i);
        for x in 0..64 {
            let mut s = State { x, v: [x, 1, x.wrapping_mul(7), 0], a: [x, 2, 3, x + 1, 5] };
            let want = match s.run(&program) {
                Flow::Return(r) => r,
                _ => {
                    let weights = [(s.v[0], 1), (s.v[1], 3), (s.v[2], 5), (s.v[3], 7)];
                    let list = [(s.a[0], 1), (s.a[1], 11), (s.a[2], 1), (s.a[3], 13), (s.a[4], 1)];
                    weights.iter().chain(&list).fold(0u32, |sum, &(v, w)| sum.wrapping_add(v.wrapping_mul(w)))
                }
            };
            assert_eq!(got[x as usize], want, "seed {seed}, invocation {x} of\n{source}");
        }
    }
    assert!(seen >= 150, "{seen} of 300 programs were valid");
}
