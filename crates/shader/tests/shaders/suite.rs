//! Two thousand generated programs; many more where `FILLRATE_SHADER_PROGRAMS` says how many.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use rayon::prelude::*;
use shader::{Fault, Module, ModuleSource, Optimisations, Options, compile};

use super::differential::{Setting, Verdict, check, check_against, expect, shrink};
use super::generate::{Program, Random, generate};

/// Programs of the suite.
const PROGRAMS: u64 = 2000;

/// Programs that naga may refuse, in a thousand.
const REFUSED: usize = 30;

fn program(seed: u64) -> Program {
    generate(&mut Random::seeded(seed))
}

fn first_seed() -> u64 {
    std::env::var("FILLRATE_SHADER_FIRST").ok().and_then(|n| n.parse().ok()).unwrap_or(0)
}

#[test]
fn generated_programs_do_what_the_oracle_does() {
    let programs = std::env::var("FILLRATE_SHADER_PROGRAMS").map_or(PROGRAMS, |n| n.parse().expect("a number of programs"));
    let refused = AtomicUsize::new(0);
    let wrong: Vec<(u64, Option<Setting>, String)> = (first_seed()..first_seed() + programs)
        .into_par_iter()
        .filter_map(|seed| {
            let settings = Setting::of(seed);
            let verdict = catch_unwind(AssertUnwindSafe(|| check(&program(seed), &settings))).unwrap_or_else(|panic| {
                let text = panic.downcast_ref::<String>().cloned();
                let text = text.or_else(|| panic.downcast_ref::<&str>().map(|s| (*s).to_owned())).unwrap_or_default();
                Verdict::Different { setting: None, what: format!("a panic: {text}") }
            });
            match verdict {
                Verdict::Same => None,
                Verdict::Refused(why) => {
                    refused.fetch_add(1, Relaxed);
                    if std::env::var_os("FILLRATE_SHADER_REFUSED").is_some() {
                        println!("seed {seed}: {why}");
                    }
                    None
                }
                Verdict::Different { setting, what } => Some((seed, setting, what)),
            }
        })
        .collect();
    let refused = refused.into_inner();
    println!("{programs} programs, {refused} refused");
    if let Some((seed, setting, what)) = wrong.first() {
        for (seed, setting, what) in wrong.iter().take(30) {
            println!("seed {seed}: {what}; {setting:?}");
        }
        let settings: Vec<Setting> = setting.iter().copied().collect();
        let found = program(*seed);
        let small = if settings.is_empty() { found } else { shrink(&found, &settings) };
        panic!("{} of {programs} programs are wrong; seed {seed} {setting:?}: {what}\n{}", wrong.len(), small.source);
    }
    assert!(refused * 1000 <= REFUSED * programs as usize, "{refused} of {programs} programs are refused");
}

/// An optimisation's name, and what switches it off.
type Switch = (&'static str, fn(&mut Optimisations));

#[test]
fn every_optimisation_changes_some_programs() {
    let switches: [Switch; 8] = [
        ("fold", |o| o.fold = false),
        ("unroll", |o| o.unroll = false),
        ("hoist", |o| o.hoist = false),
        ("share", |o| o.share = false),
        ("flatten", |o| o.flatten = false),
        ("fuse", |o| o.fuse = false),
        ("drop_dead", |o| o.drop_dead = false),
        ("drop_empty", |o| o.drop_empty = false),
    ];
    let mut changed = [0; 8];
    for seed in 0..120 {
        let program = program(seed);
        let Ok(module) = Module::new("generated", ModuleSource::Wgsl(&program.source)) else { continue };
        let operations = |optimisations| {
            let options = Options { constants: &program.constants, optimisations, ..Options::default() };
            let (stage, name) = module.entry_points().next().expect("an entry point");
            compile(&module, stage, Some(name), &options).expect("it compiles").operations()
        };
        let usual = operations(Optimisations::ALL);
        for (changed, (_, switch)) in changed.iter_mut().zip(&switches) {
            let mut optimisations = Optimisations::ALL;
            switch(&mut optimisations);
            *changed += u32::from(operations(optimisations) != usual);
        }
    }
    for (changed, (name, _)) in changed.iter().zip(&switches) {
        assert!(*changed >= 3, "leaving out `{name}` changed {changed} of 120 programs");
    }
}

#[test]
#[ignore = "prints the program that FILLRATE_SHADER_FIRST names"]
fn show_a_program() {
    println!("{}", program(first_seed()).source);
}

#[test]
fn the_fault_of_loops_is_found_when_it_is_put_back() {
    let usual = Setting { fault: Some(Fault::LoopsBeginEarly), ..Setting::USUAL };
    let finds = |&seed: &u64| {
        let program = program(seed);
        let Ok(expected) = expect(&program) else { return false };
        matches!(check_against(&program, &expected, &[usual]), Verdict::Different { .. })
    };
    // A loop that the fault makes endless takes a while to be stopped: a dozen programs that find it are proof enough.
    let all = std::env::var_os("FILLRATE_SHADER_PROGRAMS").is_some();
    let (mut found, mut tried) = (0, 0);
    while tried < PROGRAMS && (all || found < 12) {
        found += (tried..tried + 100).into_par_iter().filter(finds).count();
        tried += 100;
    }
    println!("{found} of {tried} programs find it");
    assert!(found >= 12, "{found} of {tried} programs find the fault");
}
