//! Loops in which variables die, left by `continue` on conditions of every kind: the engine against the oracle.
//!
//! These are few shapes in all their combinations, where generated programs are many shapes in some. A compiler that gives a
//! register of a loop away too early, or writes it for the wrong invocations, fails here in dozens of programs.

use crate::corners::{Engine, oracle};
use crate::oracle::Bindings;
use crate::oracle_tests::{bytes, module};

/// Words of an invocation in the buffer that the loop writes.
const OWN: usize = 32;

/// Conditions of `continue`: known to the compiler, from a register, an identity, memory that is read only, memory that is
/// written, one that holds for some in some turns.
const CONDITIONS: [&str; 7] =
    ["true", "s % 2u == 0u", "id % 2u == 0u", "c[id % 4u] == 0u", "c[1] == 0u", "b[o + 1u] == 0u", "b[o + 7u + i] > i + id"];

/// What a turn does before its `continue`.
const WORKS: [&str; 7] = [
    "s += i; b[o + 8u + i] = s;",
    "b[o + 8u + i] += i;",
    "let q = s * 3u + i; s = q; b[o + 8u + i] = q;",
    "var d = i * 5u; if d > 7u { d -= c[0]; } s ^= d; b[o + 8u + i] = d;",
    "a[i % 3u] += i + s; b[o + 8u + i] = a[(i + 1u) % 3u]; s = i;",
    "let old = s; s = b[o + i] + i; v = vec2u(v.y, old); b[o + 8u + i] = v.x + v.y;",
    "let q = same(s); s += i; b[o + 8u + i] = s; a[0] = q;",
];

/// What it does after it.
const AFTER: [&str; 3] = ["b[o + 5u] = 1u;", "s += 100u; b[o + 5u] += s;", "if s > 9u { break; } s += b[o + 9u];"];

/// What a continuing block does.
const NEXT: [&str; 3] = ["", "b[o + 3u] = b[o + 6u];", "let k = i * 2u; s += k; b[o + 3u] += k;"];

/// The loops. `W`, `C`, `A` and `N` are of the lists above.
const FORMS: [&str; 9] = [
    "for (i = 1u; i < 7u; i++) { W if C { continue; } A }",
    "for (var k = 1u; k < 7u; k++) { i = k; W if C { continue; } A }",
    "i = 0u; loop { i += 1u; if i > 6u { break; } W if C { continue; } A continuing { N } }",
    "i = 0u; loop { i += 1u; W if C { continue; } A continuing { N break if i >= 6u + c[2]; } }",
    "i = 0u; while i < 6u { i++; W if C { continue; } A }",
    "for (var j = 0u; j < 3u; j++) { i = j; loop { i += 1u; if i > 5u { break; } if C { continue; } W A continuing { N } } }",
    "i = 0u; loop { i += 1u; if i > 6u { break; } let t = same(s); s += i; W if C { continue; } A continuing { b[o + 4u] += t; N } }",
    "i = 0u; loop { i += 1u; if i > 6u { break; } let t = take(&s); W if C { continue; } A continuing { v.x += t; N } }",
    "i = 0u; loop { if i == 6u { break; } i += 1u; switch i % 3u { case 1u: { W if C { continue; } } default: { A } } N }",
];

/// The variables. Which is written last before the loop decides which register's life a mistake at the loop's begin cuts short.
const VARIABLES: [&str; 3] = [
    "var i = 0u; var v = vec2u(0u); var s = 0u;",
    "var s = 0u; var i = 0u; var v = vec2u(0u);",
    "var v = vec2u(0u); var s = 0u; var i = 0u;",
];

/// What comes after the loop: nothing that the loop's variables outlive, or their last values.
const LAST: [&str; 2] = ["", "b[o + 2u] = s + v.x + a[1];"];

fn program(variables: &str, form: &str, condition: &str, work: &str, after: &str, next: &str, last: &str) -> String {
    let turn = form.replace('W', work).replace('C', condition).replace('A', after).replace('N', next);
    format!(
        "@group(0) @binding(0) var<storage, read_write> b: array<u32>;
         @group(0) @binding(1) var<storage, read> c: array<u32, 4>;
         fn same(x: u32) -> u32 {{ return x; }}
         fn take(p: ptr<function, u32>) -> u32 {{ let x = *p; *p = x * 2u + 1u; return x; }}
         @compute @workgroup_size(8) fn main(@builtin(local_invocation_index) id: u32) {{
             let o = id * {OWN}u; {variables} var a = array<u32, 3>();
             {turn}
             {last}
         }}"
    )
}

/// What memory holds at each word, and what the first four words hold instead.
type Contents = (fn(usize) -> u32, [u32; 4]);

/// Compares all loops of some forms on three contents of memory, the variables in each order in turn. Gives up after some wrong
/// ones: loops that do not end take long.
fn all_of(forms: &[&str]) {
    let memories: [Contents; 3] =
        [(|_| 0, [0; 4]), (|i| (i as u32).wrapping_mul(0x9e37_79b9) >> 28, [1, 0, 0, 5]), (|i| (i % 3) as u32, [3, 1, 0, 0])];
    let mut programs = Vec::new();
    for form in forms {
        let nexts = if form.contains('N') { &NEXT[..] } else { &NEXT[..1] };
        for (condition, work) in CONDITIONS.iter().flat_map(|c| WORKS.iter().map(move |w| (c, w))) {
            for (after, next) in AFTER.iter().flat_map(|a| nexts.iter().map(move |n| (a, n))) {
                for last in LAST {
                    let variables = VARIABLES[(programs.len() + programs.len() / 6) % 3];
                    programs.push(program(variables, form, condition, work, after, next, last));
                }
            }
        }
    }
    let mut wrong = Vec::new();
    for source in &programs {
        let (engine, parsed) = (Engine::new(source), module(source));
        for (fill, c) in &memories {
            let mut bindings = Bindings::default();
            bindings.set_buffer(0, 0, bytes(&(0..8 * OWN).map(fill).collect::<Vec<u32>>()));
            bindings.set_buffer(0, 1, bytes(c));
            let (got, want) = (engine.run(&bindings), oracle(&parsed, bindings));
            assert!(want.is_ok(), "{want:?}\n{source}");
            if got != want && wrong.len() < 20 {
                wrong.push(source);
            }
        }
        if wrong.len() == 20 {
            break;
        }
    }
    assert!(wrong.is_empty(), "{} or more runs of {} loops are wrong, the first:\n{}", wrong.len(), programs.len(), wrong[0]);
}

#[test]
fn for_loops() {
    all_of(&FORMS[..2]);
}

#[test]
fn loops_with_continuing_blocks() {
    all_of(&FORMS[2..4]);
}

#[test]
fn while_loops_loops_in_loops_and_switches_in_loops() {
    all_of(&FORMS[4..]);
}
