//! Random trees: what their SPIR-V, their WGSL and they themselves leave must be the same.

use num::{Random, Words};
use rayon::prelude::*;
use shader::{BufferRange, Executor, Module, ModuleSource, Options, Resource, Resources, Stage, compile};

use super::{Expression, Run, Statement, initial, program, result, spirv, wgsl};

/// Programs of the suite; `FILLRATE_SHADER_TREES` says how many otherwise.
const PROGRAMS: u64 = 200;

fn words_of(data: &[u32]) -> Words {
    let words = Words::new(4 * data.len() as u64);
    data.iter().enumerate().for_each(|(i, &d)| words.store(i, d));
    words
}

/// Runs a module on 64 inputs.
pub fn run(source: ModuleSource<'_>, inputs: &[u32]) -> Result<Vec<u32>, String> {
    run_words(source, inputs, 64)
}

/// Runs a module whose result buffer has this number of words.
pub fn run_words(source: ModuleSource<'_>, inputs: &[u32], words: usize) -> Result<Vec<u32>, String> {
    let module = Module::new("tree", source).map_err(|e| e.to_string())?;
    let program = compile(&module, Stage::Compute, None, &Options::default()).map_err(|e| e.to_string())?;
    let (results, inputs) = (Words::new(4 * words as u64), words_of(inputs));
    let bindings: Vec<Vec<Resource<'_>>> = (program.interface().bindings.iter())
        .map(|binding| {
            let words = if binding.binding == 0 { &results } else { &inputs };
            vec![Resource::Buffer(BufferRange { words, offset: 0, size: words.len(), address: 0 })]
        })
        .collect();
    let resources = Resources { bindings: &bindings, ..Resources::default() };
    let uniforms = program.uniforms(&resources);
    let mut executor = Executor::new();
    executor.bind(&program, &resources, &uniforms).run_groups(0..1, [1, 1, 1], None).map_err(|e| e.to_string())?;
    Ok((0..words).map(|i| results.load(i)).collect())
}

fn check(tree: &[Statement], seed: u64) -> Result<(), String> {
    let mut random = Random::new(seed ^ 0x7ee5);
    let inputs: Vec<u32> = (0..64).map(|n| [n, random.bits(), random.bits() >> 27, !n][n as usize % 4]).collect();
    let expected: Vec<u32> = inputs
        .iter()
        .map(|&input| {
            let mut run = Run { input, variables: initial(input) };
            run.block(tree);
            result(&run.variables)
        })
        .collect();
    let text = wgsl::write(tree);
    let binary = spirv::write(tree);
    for (name, source) in [("WGSL", ModuleSource::Wgsl(&text)), ("SPIR-V", ModuleSource::SpirV(&binary))] {
        let got = run(source, &inputs).map_err(|error| format!("{name}: {error}"))?;
        if let Some(n) = (0..64).find(|&n| got[n] != expected[n]) {
            return Err(format!("{name}: of input {:#x}: {:#x}, expected {:#x}", inputs[n], got[n], expected[n]));
        }
    }
    Ok(())
}

#[test]
fn trees_leave_the_same_as_spirv_and_as_wgsl() {
    let number = |name: &str| std::env::var(name).ok().and_then(|n| n.parse::<u64>().ok());
    let programs = number("FILLRATE_SHADER_TREES").unwrap_or(PROGRAMS);
    let first = number("FILLRATE_SHADER_FIRST").unwrap_or(0);
    let wrong: Vec<(u64, String)> =
        (first..first + programs).into_par_iter().filter_map(|seed| Some((seed, check(&program(seed), seed).err()?))).collect();
    for (seed, what) in wrong.iter().take(20) {
        println!("seed {seed}: {what}");
    }
    if let Some((seed, what)) = wrong.first() {
        panic!("{} of {programs} trees are wrong; seed {seed}: {what}\n{:#?}", wrong.len(), shrink(program(*seed), *seed));
    }
}

/// Takes the statement of a number out, counted in the order of the text, or one of its values. False: there is no such statement.
fn without(block: &mut Vec<Statement>, number: &mut usize) -> bool {
    for n in 0..block.len() {
        if *number == 0 {
            block.remove(n);
            return true;
        }
        *number -= 1;
        let (value, inner): (Option<&mut Expression>, Vec<&mut Vec<Statement>>) = match &mut block[n] {
            Statement::Set(_, e) => (Some(e), vec![]),
            Statement::Exit(condition, ..) => (condition.as_mut().map(|(e, _)| e), vec![]),
            Statement::If(e, yes, no, _) => (Some(e), vec![yes, no]),
            Statement::Loop(it) => (None, vec![&mut it.body]),
            Statement::Switch(it) => (Some(&mut it.selector), it.cases.iter_mut().map(|case| &mut case.body).collect()),
        };
        if let Some(value) = value.filter(|value| !matches!(value, Expression::Input)) {
            if *number == 0 {
                *value = Expression::Input;
                return true;
            }
            *number -= 1;
        }
        for inner in inner {
            if without(inner, number) {
                return true;
            }
        }
    }
    false
}

/// The smallest tree found that is still wrong.
fn shrink(mut tree: Vec<Statement>, seed: u64) -> Vec<Statement> {
    let mut at = 0;
    loop {
        let mut smaller = tree.clone();
        if !without(&mut smaller, &mut at.clone()) {
            return tree;
        }
        if check(&smaller, seed).is_err() {
            tree = smaller;
        } else {
            at += 1;
        }
    }
}

/// Instructions that no random tree has, in modules written by hand: what naga alone reads otherwise.
#[test]
fn instructions_mean_what_their_codes_say() {
    // Vectors, and numbers that floating-point numbers do not hold; comparisons of what is no number.
    let inputs: Vec<u32> =
        (0..64).map(|n| [7, -7, i32::MIN, i32::MAX - 2, 123_456_789, -3][n as usize % 6] as u32 ^ n >> 4).collect();
    let got = run(ModuleSource::SpirV(&spirv::by_hand()), &inputs).unwrap_or_else(|error| panic!("{error}"));
    for (&input, got) in inputs.iter().zip(got) {
        let x = i64::from(input as i32);
        let rest = x.rem_euclid(3);
        let below = if rest == 0 { 0 } else { rest - 3 };
        // Of a NaN, "unordered or less" holds and "ordered and not equal" does not; of 1 and 2 both do.
        let expected = (rest + 100 * below + 1000 + 20_000 + 200_000) as u32;
        assert_eq!(got, expected, "{x}");
    }
}
