//! Every target of the accuracy suite at its small size: it holds, and with its fault it does not.

use fillrate::accuracy::{self, Setting, Size, Target};

fn small(target: &'static Target, inject_fault: bool) -> accuracy::Outcome {
    let setting = Setting { seed: 1, size: Size::Small, inject_fault };
    target.run(&setting).unwrap_or_else(|error| panic!("{}: {error:#}", target.id))
}

#[test]
fn every_target_holds() {
    for target in accuracy::targets() {
        let outcome = small(target, false);
        assert!(outcome.holds(), "\n{}{}", accuracy::header(), accuracy::lines(&outcome));
    }
}

#[test]
fn no_target_holds_with_its_fault() {
    for target in accuracy::targets() {
        let outcome = small(target, true);
        assert!(!outcome.holds(), "{} was not found\n{}{}", target.fault, accuracy::header(), accuracy::lines(&outcome));
    }
}

#[test]
fn an_unknown_target_is_named_with_the_nearest() {
    let error = accuracy::find("fil-rule").unwrap_err().to_string();
    assert_eq!(error, "there is no target fil-rule; fill-rules is the nearest, and --list names all");
}

#[test]
fn the_first_word_of_names_means_all_of_them() {
    let group: Vec<&str> = accuracy::find_all("gl").expect("targets").iter().map(|target| target.id).collect();
    assert_eq!(group, ["gl-light", "gl-environment", "gl-combine", "gl-generation", "gl-fog", "gl-blend"]);
    assert_eq!(accuracy::find_all("harmonic").expect("a target").len(), 1);
    assert!(accuracy::find_all("g").is_err());
}

#[test]
fn the_page_has_every_target_and_no_failure() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/data/accuracy.md");
    let page = std::fs::read_to_string(path).expect("the page is there");
    let page = page.split_whitespace().collect::<Vec<_>>().join(" ");
    for target in accuracy::targets() {
        let about = format!("### {} {}. Bound: {}. The fault", target.id, target.what, target.bound);
        assert!(
            page.contains(&about),
            "{} is not in docs/data/accuracy.md as it is now: the page says how to write it anew",
            target.id
        );
    }
    assert!(!page.contains("**fail**"));
}
