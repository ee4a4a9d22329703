//! What the model's shortcuts cost: the exact ways run, agree in pictures, and differ where they must.

use std::path::Path;

use fillrate::accuracy::shortcuts::{SHORTCUTS, ShortcutResult, UNMEASURED, diverging, json, shortcuts, table};
use fillrate::machine::Config;
use fillrate::trace::Trace;

fn taken(trace: &Trace) -> Vec<ShortcutResult> {
    shortcuts(trace, &Config::built_in("four-pipelines").expect("it is built in")).expect("all run")
}

fn of<'a>(taken: &'a [ShortcutResult], name: &str) -> &'a ShortcutResult {
    taken.iter().find(|taken| taken.shortcut.name == name).unwrap_or_else(|| panic!("there is no shortcut {name}"))
}

#[test]
fn shortcuts_are_measured_against_the_exact_way() {
    let cube = Trace::open(Path::new(env!("CARGO_MANIFEST_DIR")).join("traces/cube")).expect("a trace of the repository");
    let found = [("cube".to_owned(), taken(&cube)), ("diverging".to_owned(), taken(&diverging(64)))];
    for (name, taken) in &found {
        assert_eq!(taken.len(), SHORTCUTS.len());
        for taken in taken {
            assert!(taken.same_pictures, "{name}: {}", taken.shortcut.name);
            assert!(taken.cycles[0] > 0.0 && taken.cycles[1] > 0.0);
        }
        // Without requests in branches the exact way executes at least what the shortcut does, and the same in any order.
        assert!(of(taken, "divergence").work_error() <= 0.0, "{name}");
        assert_eq!(of(taken, "order of issue").work_error(), 0.0, "{name}");
        assert_eq!(of(taken, "idle cycles").error(), 0.0, "{name}");
        assert!(of(taken, "composed blocks").work_error() > 0.0, "{name}");
    }
    // Programs without branches have nothing to be off by.
    let [(_, cube), (_, diverging)] = &found;
    assert_eq!(of(cube, "divergence").error(), 0.0);
    // A branch with two sides: only one is counted.
    let worst = of(diverging, "divergence");
    assert!((-0.6..-0.2).contains(&worst.work_error()), "{}", worst.work_error());
    assert!(worst.error() < -0.1, "{}", worst.error());

    let table = table(&found);
    let json = json(&found);
    for (at, shortcut) in SHORTCUTS.iter().enumerate() {
        assert!(table.contains(&format!("| {}: cycles |", shortcut.name)), "{table}");
        assert_eq!(json[1]["shortcuts"][at]["shortcut"], shortcut.name);
    }
    assert_eq!(json[1]["shortcuts"][0]["cycles"]["error"], worst.error());
}

/// Everything that docs/architecture.md calls a deviation, and docs/fidelity.md says what it costs.
#[test]
fn every_shortcut_is_in_the_page() {
    let page =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/fidelity.md")).expect("the page is there");
    for name in SHORTCUTS.iter().map(|shortcut| shortcut.name).chain(UNMEASURED.iter().map(|&(name, _)| name)) {
        assert!(page.contains(name), "{name} is not in docs/fidelity.md");
    }
}
