use super::*;

/// `UPDATE_BASELINE=1 cargo test --lib config` writes the comments anew.
#[test]
fn the_baseline_is_its_own_resolved_text() {
    let baseline = Config::built_in("baseline").unwrap();
    let text = BUILT_IN[0].1;
    let head = &text[..text.find("(\n").expect("a head of comments, then the configuration")];
    let expected = format!("{head}{}", baseline.resolved());
    if std::env::var_os("UPDATE_BASELINE").is_some() {
        std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/configs/baseline.ron"), &expected).unwrap();
    } else {
        assert_eq!(text, expected, "configs/baseline.ron is stale: its comments come from the declarations");
    }
}

#[test]
fn every_built_in_configuration_is_sound_and_survives_its_text() {
    for (name, _) in BUILT_IN {
        let config = Config::built_in(name).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(Config::parse(name, &config.resolved()).unwrap(), config);
        assert_eq!(config.warnings(), Vec::<String>::new(), "{name}");
    }
}

fn message(text: &str) -> String {
    Config::parse("mine.ron", text).unwrap_err().to_string()
}

#[test]
fn wrong_values_are_refused_by_key_value_and_range() {
    let base = |rest: &str| format!("(extends: \"baseline\", {rest})");
    assert_eq!(message(&base("pipelines: 65")), "mine.ron: pipelines is 65, and must be a whole number from 1 to 64");
    assert_eq!(
        message(&base("core: (warp_width: 24)")),
        "mine.ron: core.warp_width is 24, and must be a power of two from 4 to 64"
    );
    assert_eq!(
        message(&base("distribute: (overlap: \"none\")")),
        "mine.ron: distribute.overlap is \"none\", and must be one of \"exact\", \"bounding-box\""
    );
    assert_eq!(message(&base("pipelines: -1")), "mine.ron: pipelines is -1, and must be a whole number from 1 to 64");
    assert_eq!(message(&base("scanout: (enabled: 1)")), "mine.ron: scanout.enabled is 1, and must be true or false");
    assert_eq!(
        message(&base("memory: (l2: (slices: 3))")),
        "mine.ron: memory.l2.slices is 3, and must be a multiple of memory.dram.channels, which is 4"
    );
}

#[test]
fn unknown_keys_are_errors_with_the_nearest_known_one() {
    assert_eq!(
        message("(extends: \"baseline\", core: (warp_with: 32))"),
        "mine.ron: there is no key core.warp_with; core.warp_width is the nearest"
    );
    assert_eq!(message("(extends: \"basline\")").split(';').next(), Some("mine.ron: there is no configuration basline"));
    assert!(message("(pipelines: 4)").contains("clock_mhz is missing"), "{}", message("(pipelines: 4)"));
    assert!(message("(extends: \"baseline\", pipelines: )").contains("mine.ron: 1:"), "the place is named");
}

#[test]
fn overrides_change_one_knob() {
    let mut config = Config::built_in("baseline").unwrap();
    config.set("core.warps=16").unwrap();
    config.set("distribute.overlap=bounding-box").unwrap();
    config.set("scanout.enabled=false").unwrap();
    assert_eq!((config.core.warps, config.scanout.enabled), (16, false));
    assert_eq!(
        config.set("core.warps=0").unwrap_err().to_string(),
        "--set: core.warps is 0, and must be a whole number from 1 to 64"
    );
    assert!(config.set("core.warps").is_err());
    let mut short = Config::built_in("baseline").unwrap();
    short.set("setup.queue=3").unwrap();
    assert_eq!(short.warnings().len(), 1, "{:?}", short.warnings());
}
