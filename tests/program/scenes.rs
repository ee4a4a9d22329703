//! The techniques: every scene holds, none holds with its fault, and the page has them all.

use fillrate::accuracy::scenes::{self, SCENES};
use fillrate::accuracy::{Row, Setting, Size};
use fillrate::machine::config::SortClass;

fn play(inject_fault: bool) -> Vec<scenes::SceneResult> {
    scenes::run(SCENES, &Setting { seed: 1, size: Size::Small, inject_fault }).unwrap_or_else(|error| panic!("{error:#}"))
}

#[test]
fn every_scene_holds_on_every_class() {
    for outcome in play(false) {
        assert!(outcome.holds(), "{}", scenes::text(&outcome));
        assert_eq!(outcome.played.prices.len(), SortClass::ALL.len(), "{}", outcome.scene.name);
        // Only sort-last-image may name passes whose order it does not keep.
        let unordered =
            outcome.played.prices.iter().filter(|price| price.disordered > 0 && price.class != SortClass::LastImage);
        assert_eq!(unordered.count(), 0, "{}", outcome.scene.name);
    }
}

#[test]
fn no_scene_holds_with_its_fault() {
    for outcome in play(true) {
        assert!(
            outcome.played.rows.iter().any(|row| !Row::holds(row)),
            "{}: {} was not found",
            outcome.scene.name,
            outcome.scene.fault
        );
    }
}

#[test]
fn an_unknown_scene_is_named_with_the_nearest() {
    let error = scenes::find("paintr").unwrap_err().to_string();
    assert_eq!(error, "there is no scene paintr; painter is the nearest, and --list names all");
}

#[test]
fn the_page_has_every_scene_and_its_picture() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/data");
    let page = std::fs::read_to_string(folder.join("techniques.md")).expect("the page is there");
    for scene in SCENES {
        let about =
            format!("| scene | {} |\n| fault | {} |\n", scene.what.replace('|', "\\|"), scene.fault.replace('|', "\\|"));
        assert!(
            page.contains(&about),
            "{} is not on the page as it is now: docs/README.md says how to write it anew",
            scene.name
        );
        assert!(folder.join("techniques").join(format!("{}.png", scene.name)).is_file(), "{} has no picture", scene.name);
    }
    assert!(!page.contains("FAIL"));
}
