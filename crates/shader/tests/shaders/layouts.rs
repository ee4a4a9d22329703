//! Random structures with `@align` and `@size`, in each other and in arrays: where WGSL says that their members are, and where the engine
//! reads and writes them.
//!
//! What is computed here follows the specification's section "Structure Member Layout", and shares no code with the engine or naga.

use std::fmt::Write;

use num::Random;
use rayon::prelude::*;
use shader::{Module, ModuleSource};

use crate::trees::run_words;

/// Programs of the suite; `FILLRATE_SHADER_LAYOUTS` says how many otherwise.
const PROGRAMS: u64 = 300;

/// Members of numbers that a structure has in all.
const LEAVES: usize = 60;

#[derive(Clone, Debug)]
enum Type {
    /// Components; 1: a scalar.
    Numbers(u32),
    Struct(usize),
    Array(Box<Type>, u32),
}

#[derive(Clone, Debug)]
struct Member {
    ty: Type,
    align: Option<u32>,
    /// Bytes beyond the size of the type.
    more: Option<u32>,
}

/// Structures; each has only those before it.
type Structs = Vec<Vec<Member>>;

fn align_of(structs: &Structs, ty: &Type) -> u32 {
    match ty {
        Type::Numbers(n) => [4, 8, 16, 16][*n as usize - 1],
        Type::Struct(s) => structs[*s].iter().map(|m| m.align.unwrap_or_else(|| align_of(structs, &m.ty))).max().unwrap_or(1),
        Type::Array(inner, _) => align_of(structs, inner),
    }
}

fn size_of(structs: &Structs, ty: &Type) -> u32 {
    match ty {
        Type::Numbers(n) => 4 * n,
        Type::Struct(s) => {
            let members = &structs[*s];
            let last = offsets(structs, *s).pop().unwrap_or(0);
            let end = last + members.last().map_or(0, |m| member_size(structs, m));
            end.next_multiple_of(align_of(structs, ty))
        }
        Type::Array(inner, n) => n * stride(structs, inner),
    }
}

fn stride(structs: &Structs, inner: &Type) -> u32 {
    size_of(structs, inner).next_multiple_of(align_of(structs, inner))
}

fn member_size(structs: &Structs, member: &Member) -> u32 {
    size_of(structs, &member.ty) + member.more.unwrap_or(0)
}

/// Where the members of a structure begin.
fn offsets(structs: &Structs, s: usize) -> Vec<u32> {
    let mut at = 0;
    structs[s]
        .iter()
        .map(|member| {
            let begin = u32::next_multiple_of(at, member.align.unwrap_or_else(|| align_of(structs, &member.ty)));
            at = begin + member_size(structs, member);
            begin
        })
        .collect()
}

/// The numbers in a value: how a text names them, and the bytes at which they are.
fn leaves(structs: &Structs, ty: &Type, name: &str, at: u32, out: &mut Vec<(String, u32)>) {
    match ty {
        Type::Numbers(1) => out.push((name.to_owned(), at)),
        Type::Numbers(n) => out.extend((0..*n).map(|k| (format!("{name}[{k}]"), at + 4 * k))),
        Type::Struct(s) => {
            for (n, (member, offset)) in structs[*s].iter().zip(offsets(structs, *s)).enumerate() {
                leaves(structs, &member.ty, &format!("{name}.m{n}"), at + offset, out);
            }
        }
        Type::Array(inner, n) => {
            (0..*n).for_each(|k| leaves(structs, inner, &format!("{name}[{k}]"), at + k * stride(structs, inner), out));
        }
    }
}

/// Whether a type may be that of a uniform buffer: section "Address Space Layout Constraints".
fn is_uniform(structs: &Structs, ty: &Type) -> bool {
    match ty {
        Type::Numbers(_) => true,
        Type::Array(inner, _) => stride(structs, inner).is_multiple_of(16) && is_uniform(structs, inner),
        Type::Struct(s) => {
            let offsets = offsets(structs, *s);
            structs[*s].iter().enumerate().all(|(n, member)| {
                let required = match member.ty {
                    Type::Numbers(_) => align_of(structs, &member.ty),
                    _ => align_of(structs, &member.ty).next_multiple_of(16),
                };
                let room = match (&member.ty, offsets.get(n + 1)) {
                    (Type::Struct(_), Some(next)) => next - offsets[n] >= size_of(structs, &member.ty).next_multiple_of(16),
                    _ => true,
                };
                offsets[n].is_multiple_of(required) && room && is_uniform(structs, &member.ty)
            })
        }
    }
}

struct Maker(Random);

impl Maker {
    fn ty(&mut self, structs: &Structs, depth: u32) -> Type {
        match self.0.below(if depth == 0 { 3 } else { 6 }) {
            3 | 4 if !structs.is_empty() => Type::Struct(self.0.below(structs.len() as u32) as usize),
            5 => Type::Array(Box::new(self.ty(structs, depth - 1)), 1 + self.0.below(3)),
            _ => Type::Numbers(1 + self.0.below(4)),
        }
    }

    fn structs(&mut self) -> Structs {
        let mut structs: Structs = Vec::new();
        for _ in 0..2 + self.0.below(3) {
            let members = (0..1 + self.0.below(4)).map(|_| {
                let ty = self.ty(&structs, 2);
                let least = align_of(&structs, &ty);
                let align = (self.0.below(3) == 0).then(|| least << self.0.below(3)).filter(|&align| align <= 128);
                Member { ty, align, more: (self.0.below(4) == 0).then(|| 4 * self.0.below(8)) }
            });
            structs.push(members.collect());
        }
        structs
    }

    fn text(&mut self, structs: &Structs) -> String {
        let mut out = "const SIXTEEN = 16;\nconst EIGHT: u32 = 8;\n".to_owned();
        for (s, members) in structs.iter().enumerate() {
            write!(out, "struct S{s} {{ ").expect("text");
            for (n, member) in members.iter().enumerate() {
                let lost = align_of(structs, &member.ty) > plain(structs, &member.ty);
                if let Some(align) = member.align {
                    // Where the type's own alignment has to be compared with it, it stands as a number.
                    let named = !lost && self.0.below(3) == 0 && !is_inside(structs, s);
                    match align {
                        16 if named => out.push_str("@align(SIXTEEN) "),
                        8 if named => out.push_str("@align(EIGHT) "),
                        64 => out.push_str("@align(0x40u) "),
                        _ => write!(out, "@align({align}) ").expect("text"),
                    }
                }
                if let Some(more) = member.more {
                    write!(out, "@size({}) ", size_of(structs, &member.ty) + more).expect("text");
                }
                write!(out, "m{n}: {}, ", self.name(&member.ty)).expect("text");
            }
            writeln!(out, "}} alias A{s} = S{s};").expect("text");
        }
        out
    }

    fn name(&mut self, ty: &Type) -> String {
        match ty {
            Type::Numbers(1) => "u32".to_owned(),
            Type::Numbers(n) if self.0.below(2) == 0 => format!("vec{n}u"),
            Type::Numbers(n) => format!("vec{n}<u32>"),
            Type::Struct(s) => format!("{}{s}", if self.0.below(2) == 0 { "S" } else { "A" }),
            Type::Array(inner, n) => format!("array<{}, {n}>", self.name(inner)),
        }
    }
}

/// Whether a structure is in another one that has attributes, which then are compared.
fn is_inside(structs: &Structs, s: usize) -> bool {
    fn has(ty: &Type, s: usize) -> bool {
        match ty {
            Type::Numbers(_) => false,
            Type::Struct(own) => *own == s,
            Type::Array(inner, _) => has(inner, s),
        }
    }
    structs.iter().flatten().any(|member| member.align.is_some() && has(&member.ty, s))
        || structs
            .iter()
            .enumerate()
            .any(|(n, members)| n > s && members.iter().any(|m| has(&m.ty, s)) && is_inside(structs, n))
}

/// The alignment of a type without attributes.
fn plain(structs: &Structs, ty: &Type) -> u32 {
    match ty {
        Type::Numbers(_) => align_of(structs, ty),
        Type::Struct(s) => structs[*s].iter().map(|m| plain(structs, &m.ty)).max().unwrap_or(1),
        Type::Array(inner, _) => plain(structs, inner),
    }
}

fn check(seed: u64) -> Result<bool, String> {
    let mut maker = Maker(Random::new(seed));
    let structs = maker.structs();
    let ty = Type::Struct(structs.len() - 1);
    let mut places = Vec::new();
    leaves(&structs, &ty, "data", 0, &mut places);
    places.truncate(LEAVES);
    let bytes = size_of(&structs, &ty);
    let declared = maker.text(&structs);
    let name = maker.name(&ty);
    let main = |body: &str| format!("@compute @workgroup_size(1) fn main() {{ {body} }}");
    let results = "@group(0) @binding(0) var<storage, read_write> results: array<u32>;";
    let numbers: Vec<u32> = (0..bytes / 4).collect();

    // Each number is read by its name, directly and from a copy, and is the number of its word.
    let read = |space: &str| {
        let body: String = places.iter().enumerate().map(|(n, (name, _))| format!("results[{n}] = {name}; ")).collect();
        let body = body + "let data = data; results[60] = " + &places[places.len() - 1].0 + ";";
        format!("{declared}{results}\n@group(0) @binding(1) var<{space}> data: {name};\n{}", main(&body))
    };
    let compare = |text: &str| {
        let got = run_words(ModuleSource::Wgsl(text), &numbers, 64).map_err(|error| format!("{error}\n{text}"))?;
        match places.iter().enumerate().find(|(n, (_, at))| got[*n] != at / 4) {
            Some((n, (name, at))) => Err(format!("{name} is at {}, expected {at}\n{text}", 4 * got[n])),
            None if got[60] != places[places.len() - 1].1 / 4 => Err(format!("a copy differs\n{text}")),
            None => Ok(()),
        }
    };
    compare(&read("storage, read"))?;

    // Each number is written by its name.
    let body: String = places.iter().enumerate().map(|(n, (name, _))| format!("{name} = {}u; ", n + 1)).collect();
    let text = format!("{declared}@group(0) @binding(0) var<storage, read_write> data: {name};\n{}", main(&body));
    let got = run_words(ModuleSource::Wgsl(&text), &numbers, bytes as usize / 4).map_err(|error| format!("{error}\n{text}"))?;
    let mut wanted = vec![0; bytes as usize / 4];
    places.iter().enumerate().for_each(|(n, (_, at))| wanted[*at as usize / 4] = n as u32 + 1);
    if got != wanted {
        return Err(format!("what was written is {got:?}, expected {wanted:?}\n{text}"));
    }

    let text = read("uniform");
    let uniform = is_uniform(&structs, &ty);
    if uniform {
        compare(&text)?;
    } else if Module::new("layout", ModuleSource::Wgsl(&text)).is_ok() {
        return Err(format!("no uniform buffer may have this layout\n{text}"));
    }
    Ok(uniform)
}

#[test]
fn structures_are_laid_out_as_the_specification_says() {
    let number = |name: &str| std::env::var(name).ok().and_then(|n| n.parse::<u64>().ok());
    let programs = number("FILLRATE_SHADER_LAYOUTS").unwrap_or(PROGRAMS);
    let first = number("FILLRATE_SHADER_FIRST").unwrap_or(0);
    let all: Vec<(u64, Result<bool, String>)> =
        (first..first + programs).into_par_iter().map(|seed| (seed, check(seed))).collect();
    let wrong: Vec<_> = all.iter().filter_map(|(seed, found)| Some((seed, found.as_ref().err()?))).collect();
    let uniform = all.iter().filter(|(_, found)| *found == Ok(true)).count() as u64;
    println!("{programs} layouts, {uniform} of them uniform");
    if let Some((seed, what)) = wrong.first() {
        panic!("{} of {programs} layouts are wrong; seed {seed}: {what}", wrong.len());
    }
    assert!(programs < 100 || uniform > programs / 20, "{uniform} of {programs} are uniform");
}
