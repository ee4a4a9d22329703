use super::*;
use knob::{Allowed, Knob, Relax, Setting};

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

#[test]
fn a_class_has_a_configuration_of_its_name_that_is_the_baseline_otherwise() {
    for class in SortClass::NAMES {
        let config = Config::built_in(class).unwrap_or_else(|error| panic!("{error}"));
        let mut baseline = Config::built_in("baseline").unwrap();
        baseline.set(&format!("sort={class}")).unwrap();
        assert_eq!(config, Config { name: (*class).to_owned(), ..baseline });
        assert_eq!(config.card.pipelines, 4);
    }
}

#[test]
fn a_name_that_is_none_is_told_what_there_is() {
    let message = Config::built_in("sort-nothing").unwrap_err().to_string();
    for (name, _) in BUILT_IN {
        assert!(message.contains(name), "{name} in {message}");
    }
}

fn message(text: &str) -> String {
    Config::parse("mine.ron", text).unwrap_err().to_string()
}

#[test]
fn wrong_values_are_refused_by_key_value_and_range() {
    let base = |rest: &str| format!("(extends: \"baseline\", {rest})");
    assert_eq!(message(&base("pipelines: 65")), "mine.ron:1:23: pipelines is 65, and must be a whole number from 1 to 64");
    assert_eq!(
        message(&base("core: (warp_width: 24)")),
        "mine.ron:1:30: core.warp_width is 24, and must be a power of two from 4 to 64"
    );
    assert_eq!(
        message(&base("distribute: (overlap: \"none\")")),
        "mine.ron:1:36: distribute.overlap is \"none\", and must be one of \"exact\", \"bounding-box\""
    );
    assert_eq!(message(&base("pipelines: -1")), "mine.ron:1:23: pipelines is -1, and must be a whole number from 1 to 64");
    assert_eq!(message(&base("scanout: (enabled: 1)")), "mine.ron:1:33: scanout.enabled is 1, and must be true or false");
    assert_eq!(
        message(&base("memory: (l2: (slices: 3))")),
        "mine.ron: memory.l2.slices is 3, and must be a multiple of memory.dram.channels, which is 8"
    );
    assert_eq!(
        message(&base("texture: (cache_lines: 257)")),
        "mine.ron: texture.cache_lines is 257, and must be a multiple of texture.cache_ways, which is 16"
    );
    // 24 KB, and any number of lines where all are in one set.
    for texture in ["cache_lines: 384", "cache_lines: 257, cache_ways: 512", "cache_lines: 1"] {
        assert!(Config::parse("mine.ron", &base(&format!("texture: ({texture})"))).is_ok(), "{texture}");
    }
}

#[test]
fn unknown_keys_are_errors_with_the_nearest_known_one() {
    assert_eq!(
        message("(extends: \"baseline\", core: (warp_with: 32))"),
        "mine.ron:1:30: there is no key core.warp_with; core.warp_width is the nearest"
    );
    let unknown = message("(extends: \"basline\")");
    assert!(
        unknown.starts_with("mine.ron: there is no configuration basline; baseline is the nearest; built in are "),
        "{unknown}"
    );
    assert!(message("(extends: \"mine\")").starts_with("mine.ron: there is no configuration mine; built in are "));
    let twice = "(extends: \"baseline\",\n  core: (warps: 4, warps: 8))";
    assert_eq!(message(twice), "mine.ron:2:20: core.warps is given twice");
    assert!(message("(pipelines: 4)").contains("clock_mhz is missing"), "{}", message("(pipelines: 4)"));
    assert!(message("(extends: \"baseline\", pipelines: )").starts_with("mine.ron:1:3"), "the place is named");
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

/// All knobs with their paths.
fn all() -> Vec<(String, Knob)> {
    Config::default().knobs().map(|(path, knob)| (path, *knob)).collect()
}

/// A configuration that changes one knob of the baseline.
fn changing(path: &str, value: &str) -> String {
    let mut text = value.to_owned();
    for step in path.rsplit('.') {
        text = format!("({step}: {text})");
    }
    format!("(extends: \"baseline\", {}", &text[1..])
}

/// Values at the ends of what a knob takes, and beyond them, as they are written.
fn ends(allowed: Allowed) -> (Vec<String>, Vec<String>) {
    let numbers = |list: &[u64]| list.iter().map(u64::to_string).collect::<Vec<_>>();
    let words = |list: &[&str]| list.iter().map(|&word| word.to_owned()).collect::<Vec<_>>();
    match allowed {
        Allowed::Range(low, high) => {
            let below = low.checked_sub(1).map_or("-1".to_owned(), |below| below.to_string());
            let beyond = [vec![below], numbers(&[high + 1, 1 << 32, u64::MAX >> 12]), words(&["1.5", "true", "\"many\""])];
            (numbers(&[low, high]), beyond.concat())
        }
        Allowed::PowerOfTwo(low, high) => {
            // Below the least, above the greatest, and between the powers.
            let beyond = [numbers(&[low / 2, high * 2, high + 1, 3 * high / 4]), words(&["-1", "false", "\"big\""])];
            (numbers(&[low, high]), beyond.concat())
        }
        Allowed::Switch => (words(&["true", "false"]), words(&["0", "1", "\"yes\""])),
        Allowed::Choice(names) => {
            (names.iter().map(|name| format!("\"{name}\"")).collect(), words(&["0", "true", "\"\"", "\"another\""]))
        }
    }
}

#[test]
fn every_knob_takes_its_ends_and_refuses_what_is_beyond_by_key_value_and_range() {
    // Read once: a configuration is a long text.
    let baseline = Config::built_in("baseline").unwrap();
    let mut refused = 0;
    for (path, knob) in all() {
        let (taken, beyond) = ends(knob.allowed);
        for value in taken {
            // Rules between knobs may still forbid it; they are another matter.
            let assignment = format!("{path}={value}");
            let mut config = baseline.clone();
            config.set(&assignment).unwrap_or_else(|error| panic!("{assignment}: {error}"));
            let (section, _) = path.rsplit_once('.').unwrap_or(("", &path));
            let (_, section) = config.sections().into_iter().find(|(known, _)| *known == section).unwrap();
            assert_eq!(section.get(knob.name).unwrap().to_string(), value, "{path}");
            match Config::parse("mine.ron", &changing(&path, &value)) {
                Ok(parsed) => assert_eq!(parsed, Config { name: "mine.ron".into(), ..config }, "{path}"),
                Err(error) => assert!(matches!(error, ConfigError::Rule { .. }), "{path} is {value}: {error}"),
            }
        }
        for value in beyond {
            let text = value.starts_with('"') && !matches!(knob.allowed, Allowed::Choice(_));
            let told = if text { format!("the text {value}") } else { value.clone() };
            let rest = format!("{path} is {told}, and must be {}", knob.allowed);
            let mut config = baseline.clone();
            let error = config.set(&format!("{path}={value}")).unwrap_err().to_string();
            assert_eq!(error, format!("--set: {rest}"));
            assert_eq!(config, baseline, "{path} has changed all the same");
            let text = changing(&path, &value);
            let column = text.rfind(path.rsplit('.').next().unwrap_or(&path)).expect("the key") + 1;
            assert_eq!(message(&text), format!("mine.ron:1:{column}: {rest}"));
            refused += 1;
        }
    }
    assert!(refused > 600, "{refused}");
}

#[test]
fn the_ends_of_a_knob_are_where_its_declaration_says() {
    // What the test before calls beyond is beyond, and what is within is within: the declaration and the check are one.
    assert!(Allowed::Range(1, 8).admits(&Setting::Number(8)) && !Allowed::Range(1, 8).admits(&Setting::Number(9)));
    assert!(
        Allowed::PowerOfTwo(4, 64).admits(&Setting::Number(64)) && !Allowed::PowerOfTwo(4, 64).admits(&Setting::Number(48))
    );
    // The baseline is within, and so is what it is made of.
    let baseline = Config::built_in("baseline").unwrap();
    for (section, knobs) in baseline.sections() {
        for knob in knobs.knobs() {
            let value = knobs.get(knob.name).unwrap();
            assert!(knob.allowed.admits(&value), "{} is {value}", knob.path(section));
        }
    }
}

#[test]
fn what_a_knob_counts_and_how_it_is_relaxed_agree() {
    for (path, knob) in all() {
        let is_number = matches!(knob.allowed, Allowed::Range(..) | Allowed::PowerOfTwo(..));
        let per_cycle = knob.unit.ends_with("/cycle") || knob.unit == "lanes";
        let fits = match knob.relax {
            Relax::Never => !per_cycle,
            Relax::Rate => is_number && per_cycle,
            Relax::Bandwidth => is_number,
            Relax::Room | Relax::Cache | Relax::Units(_) | Relax::Parts(_) => is_number && !per_cycle,
            Relax::Interval | Relax::Latency | Relax::Wait(_) => is_number && knob.unit.contains("cycles"),
            Relax::Each(_) => matches!(knob.allowed, Allowed::Choice(_)),
            Relax::Skip(values) => {
                !values.is_empty() && values.iter().all(|&(value, _)| knob.allowed.admits(&Setting::from(value)))
            }
        };
        assert!(fits, "{path} is {}, in {:?}, and declared as {:?}", knob.allowed, knob.unit, knob.relax);
    }
}

#[test]
fn a_queue_too_short_for_its_latency_is_warned_of() {
    // A place for each cycle on the way and one more, for each that is to be carried per cycle.
    for (queue, latency, rate) in [
        ("fetch.queue", "fetch.latency", 1),
        ("assembly.queue", "assembly.latency", 4),
        ("clip.queue", "clip.latency", 2),
        ("network.receive_queue", "network.link_latency", 1),
        ("setup.queue", "setup.latency", 1),
        ("traverse.queue", "traverse.latency", 2),
        ("traverse.hierarchical_queue", "traverse.hierarchical_latency", 1),
        ("depth.output_queue", "depth.output_latency", 2),
        ("interpolate.queue", "interpolate.latency", 1),
        ("dispatch.queue", "dispatch.latency", 1),
        ("dispatch.output_queue", "dispatch.output_latency", 1),
        ("compute.queue", "compute.latency", 1),
        ("memory.port_queue", "memory.port_latency", 1),
    ] {
        for (places, warned) in [(rate * 11, false), (rate * 11 - 1, true)] {
            let mut config = Config::built_in("four-pipelines").unwrap();
            config.set(&format!("{latency}=10")).unwrap();
            config.set(&format!("{queue}={places}")).unwrap();
            let expected = format!(
                "{queue} is {places}: a channel of latency 10 that carries {rate} a cycle needs {} places to do so",
                rate * 11
            );
            assert_eq!(config.warnings(), if warned { vec![expected] } else { Vec::new() }, "{queue}");
        }
    }
    let mut config = Config::built_in("four-pipelines").unwrap();
    for change in ["setup.triangles_per_cycle=3", "setup.latency=10", "setup.queue=32"] {
        config.set(change).unwrap();
    }
    let expected = "setup.queue is 32: a channel of latency 10 that carries 3 a cycle needs 33 places to do so";
    assert_eq!(config.warnings(), [expected]);
}
