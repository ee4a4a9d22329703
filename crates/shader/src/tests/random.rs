//! Random functions on integers, for the bounds: variables written in branches, loops left from inside branches and switches,
//! values of the body used in the continuing block, early returns, pointer arguments, arrays indexed at run time, loops that
//! can be unrolled and loops that cannot. `tests/shaders` checks that programs compute the right values.

use std::fmt::Write;

use num::Random;

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

/// Writes random programs.
struct Writer(Random);

impl Writer {
    fn below(&mut self, n: u32) -> u32 {
        self.0.below(n)
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

/// The text of a random function `f(x: u32) -> u32`, with what it calls.
pub(super) fn function(seed: u32) -> String {
    let mut random = Writer(Random::new(seed.into()));
    let program = random.block(3, 0);
    let mut text = String::new();
    show(&program, &mut text, &mut 0);
    format!(
        "fn bump(p: ptr<function, u32>, e: u32) {{ if (e % 2u == 0u) {{ *p += 1u; return; }} *p = *p * 3u + e; }}
         fn f(x: u32) -> u32 {{
             var v0 = x; var v1 = 1u; var v2 = x * 7u; var v3 = 0u; var a = array<u32, 5>(x, 2u, 3u, x + 1u, 5u);
             {{\n{text}\n}}
             return v0 + v1 * 3u + v2 * 5u + v3 * 7u + a[0] + a[1] * 11u + a[2] + a[3] * 13u + a[4];
         }}"
    )
}
