//! The benchmarks of real cards: the cheap ones hold, with their faults they do not, and formulas follow any configuration.

use fillrate::accuracy::card::{self, Benchmark, FORMULA_ALLOWED};

fn quick() -> Vec<&'static Benchmark> {
    card::benchmarks().filter(|benchmark| benchmark.quick).collect()
}

#[test]
fn cheap_benchmarks_hold_and_find_their_faults() {
    let quick = quick();
    assert!(quick.len() >= 12, "{} benchmarks are cheap", quick.len());
    let outcomes = card::run(&quick, &[], false).expect("they run");
    assert!(outcomes.iter().all(card::BenchmarkResult::holds), "\n{}", card::text(&outcomes));
    let outcomes = card::run(&quick, &[], true).expect("they run with their faults");
    for outcome in &outcomes {
        assert!(!outcome.holds(), "{} does not find its fault\n{}", outcome.benchmark.name, card::text(&outcomes));
        // A wrong knob changes the card and the formula alike.
        let off = outcome.from_formula.unwrap_or(0.0);
        assert!(off.abs() <= FORMULA_ALLOWED, "{} is {off} off its formula", outcome.benchmark.name);
    }
}

#[test]
fn benchmarks_are_told_apart_and_sourced() {
    let all: Vec<&Benchmark> = card::benchmarks().collect();
    assert!(all.len() >= 50, "{} benchmarks", all.len());
    for (at, benchmark) in all.iter().enumerate() {
        let Benchmark { name, card, what, source, fault, published, because, .. } = benchmark;
        assert!(!all[..at].iter().any(|other| (other.name, other.card) == (name, card)), "{name} is on {card} twice");
        assert!(!name.is_empty() && !what.is_empty() && !source.text.is_empty(), "{name} on {card}");
        assert!(!fault.is_empty() && !published.is_empty(), "{name} on {card}");
        assert!(
            because.is_none_or(|because| because.off.abs() > benchmark.class.allowed()),
            "{name} on {card} needs no excuse"
        );
    }
    let error = card::find("lat-l3").expect_err("there is no third level").to_string();
    assert!(error.contains("is the nearest"), "{error}");
    assert!(card::find("gtx-980").expect("a card").len() > 30);
}

#[test]
fn the_page_has_every_benchmark() {
    let page = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/data/cards.md")).expect("docs/data/cards.md");
    for benchmark in card::benchmarks() {
        let row = format!("| {} | {} |", benchmark.name, benchmark.what);
        assert!(
            page.contains(&row),
            "{row} is not in docs/data/cards.md: `fillrate accuracy card --page docs/data` writes it anew"
        );
    }
}
