//! Pipeline logs: read back, each item goes from stage to stage without a gap, and there are as many as the statistics count.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use crate::cli::{refused, run};
use crate::report::json_of;

/// A stage of an item.
#[derive(Clone, Debug, PartialEq)]
struct LogStage {
    lane: u32,
    name: String,
    begin: u64,
    end: u64,
}

/// An item of a log.
#[derive(Clone, Debug, Default)]
struct LogItem {
    label: String,
    begin: u64,
    stages: Vec<LogStage>,
    /// Stages that have not ended, by lane.
    open: BTreeMap<u32, (String, u64)>,
    /// The cycle in which it ended, and whether it was thrown away.
    end: Option<(u64, bool)>,
    /// The items that it waits for.
    waits: Vec<usize>,
}

impl LogItem {
    fn is(&self, kind: &str) -> bool {
        self.label.starts_with(&format!("{kind} "))
    }

    /// The names of its stages in lane 0.
    fn path(&self) -> Vec<&str> {
        self.stages.iter().filter(|stage| stage.lane == 0).map(|stage| stage.name.as_str()).collect()
    }
}

/// Reads a log, and checks that it keeps the rules of the format.
fn read(text: &str) -> Vec<LogItem> {
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("Kanata\t0004"));
    let (mut items, mut cycle): (Vec<LogItem>, Option<u64>) = (Vec::new(), None);
    for line in lines {
        let words: Vec<&str> = line.split('\t').collect();
        let number = |at: usize| words[at].parse::<u64>().unwrap_or_else(|_| panic!("{line}"));
        let now = cycle.unwrap_or(0);
        match words[0] {
            "C=" => assert_eq!(cycle.replace(number(1)), None, "{line}"),
            "C" => {
                assert!(number(1) > 0, "{line}");
                cycle = Some(now + number(1));
            }
            "I" => {
                assert_eq!(number(1), items.len() as u64, "{line}: each item begins once, in order");
                items.push(LogItem { begin: cycle.expect("a cycle"), ..LogItem::default() });
            }
            command => {
                let id = number(1) as usize;
                assert!(items[id].end.is_none(), "{line}: the item has ended");
                match command {
                    "L" if words[2] == "0" => items[id].label.push_str(words[3]),
                    "L" => assert_eq!(words[2..], ["1", "fillrate"], "{line}"),
                    "S" => {
                        let lane = number(2) as u32;
                        let before = items[id].open.insert(lane, (words[3].to_owned(), now));
                        assert_eq!(before, None, "{line}: a stage begins before the one before it has ended");
                    }
                    "E" => {
                        let lane = number(2) as u32;
                        let (name, begin) = items[id].open.remove(&lane).unwrap_or_else(|| panic!("{line}"));
                        assert_eq!(name, words[3], "{line}");
                        items[id].stages.push(LogStage { lane, name, begin, end: now });
                    }
                    "W" => {
                        assert!((number(2) as usize) < items.len(), "{line}");
                        items[id].waits.push(number(2) as usize);
                    }
                    "R" => {
                        assert!(items[id].open.is_empty(), "{line}: {:?}", items[id]);
                        items[id].end = Some((now, words[3] == "1"));
                    }
                    _ => panic!("{line}"),
                }
            }
        }
    }
    for item in &items {
        let (end, _) = item.end.unwrap_or_else(|| panic!("neither retired nor flushed: {item:?}"));
        let mut at = item.begin;
        for stage in item.stages.iter().filter(|stage| stage.lane == 0) {
            assert_eq!(stage.begin, at, "a gap: {item:?}");
            at = stage.end;
        }
        assert_eq!(at, end, "{item:?}");
        for lane in 1..3 {
            let own: Vec<&LogStage> = item.stages.iter().filter(|stage| stage.lane == lane).collect();
            assert!(own.windows(2).all(|pair| pair[0].end <= pair[1].begin), "{item:?}");
        }
    }
    items
}

/// Replays with a log. The log, and the folder of the statistics.
fn logged(arguments: &[&str]) -> (String, tempfile::TempDir) {
    let out = tempfile::tempdir().expect("a folder");
    let file = |name: &str| out.path().join(name).display().to_string();
    let (code, said, message) =
        run(&[&["replay"], arguments, &["--pipeline", &file("log"), "--out", &file("out"), "--images", "none"]].concat());
    assert_eq!(code, 0, "{message}");
    assert!(said.contains("the pipeline log: "), "{said}");
    (fs::read_to_string(file("log")).expect("a log"), out)
}

#[test]
fn items_of_a_log_are_those_that_are_counted() {
    let (text, out) = logged(&["traces/triangle", "--config", "tiny"]);
    let items = read(&text);
    let statistics = json_of(&out.path().join("out/stats.json"));
    let funnel = |name: &str| statistics["total"]["funnel"][name].as_u64().expect("a counter");
    let count = |kind: &str| items.iter().filter(|item| item.is(kind)).count() as u64;
    assert_eq!(count("vertex"), funnel("vertices_shaded"));
    assert_eq!(count("primitive"), funnel("primitives_in"));
    assert_eq!(count("triangle"), funnel("triangles_setup"));
    assert_eq!(count("quad"), funnel("quads_rasterized") - funnel("quads_hiz_culled"));
    assert!(count("quad") > 100 && count("warp") > 10, "{} quads, {} warps", count("quad"), count("warp"));
    let of_warps = |item: &LogItem| item.waits.iter().filter(|&&at| items[at].label.contains("quads, ")).count() as u64;
    assert_eq!(items.iter().filter(|item| item.is("quad")).map(of_warps).sum::<u64>(), funnel("quads_shaded"));
    for item in &items {
        let (_, flushed) = item.end.expect("an end");
        let path = item.path();
        let (first, last) = (path.first().copied(), path.last().copied());
        if item.is("quad") {
            assert_eq!((first, flushed), (Some("rasterized"), last != Some("color")), "{item:?}");
            assert!(item.waits.iter().any(|&at| items[at].is("triangle")), "{item:?}");
        } else if item.is("vertex") {
            assert_eq!(path, ["vertex_batches", "vertex_warps", "core", "vertices_shaded"], "{item:?}");
            assert!(!flushed, "{item:?}");
        } else if item.is("primitive") {
            assert_eq!(path, ["primitives"], "{item:?}");
        } else if item.is("triangle") {
            assert_eq!(path[..3.min(path.len())], ["triangles", "sorted", "set_up"][..3.min(path.len())], "{item:?}");
        } else {
            assert!(path.contains(&"core"), "{item:?}");
        }
    }
    // Nothing depends on the clock or on the number of threads, and a log changes no statistic.
    for more in [&["--clock", "every-cycle"][..], &["--threads", "1"]] {
        let (again, folder) = logged(&[&["traces/triangle", "--config", "tiny"], more].concat());
        assert!(again == text, "{more:?}");
        let read = |folder: &Path| fs::read(folder.join("out/stats.csv")).expect("statistics");
        assert!(read(folder.path()) == read(out.path()), "{more:?}");
    }
    let plain = crate::report::replayed("traces/triangle", &["--config", "tiny"]);
    let read = |folder: &Path| fs::read(folder.join("stats.csv")).expect("statistics");
    assert!(read(plain.path()) == read(&out.path().join("out")), "a log changes the statistics");
}

#[test]
fn a_range_of_cycles_or_draws_bounds_a_log() {
    let (text, _) = logged(&["traces/triangle", "--config", "tiny", "--pipeline-cycles", "600..700"]);
    let items = read(&text);
    assert!(items.len() > 50, "{}", items.len());
    assert!(items.iter().all(|item| (600..700).contains(&item.begin)), "{items:?}");
    let (all, _) = logged(&["traces/triangle", "--config", "tiny", "--pipeline-cycles", "500..800"]);
    let all = read(&all);
    let inside = all.iter().filter(|item| (600..700).contains(&item.begin)).map(|item| &item.label).collect::<Vec<_>>();
    let found = items.iter().map(|item| &item.label).collect::<Vec<_>>();
    assert_eq!(found, inside, "the items are those of a longer log that begin in these cycles");

    let (text, out) = logged(&["traces/viewer.zip", "--config", "baseline", "--pipeline-draws", "1", "--per-draw"]);
    let items = read(&text);
    assert!(!items.is_empty() && items.iter().all(|item| item.label.ends_with(", draw 1")), "{items:?}");
    let statistics = json_of(&out.path().join("out/stats.json"));
    let phases = statistics["frames"][0]["phases"].as_array().expect("phases");
    let draws = phases.iter().flat_map(|phase| phase["draws"].as_array().into_iter().flatten());
    let draw = draws.into_iter().find(|draw| draw["number"] == 1).expect("draw 1");
    let primitives = items.iter().filter(|item| item.is("primitive")).count() as u64;
    assert_eq!(Some(primitives), draw["funnel"]["primitives_in"].as_u64(), "{draw}");
}

#[test]
fn logs_that_cannot_be_are_refused() {
    let out = tempfile::tempdir().expect("a folder");
    let file = |name: &str| out.path().join(name).display().to_string();
    let log = file("log");
    for (more, said) in [
        (&["--config", "sort-first"][..], "the pipeline log follows items through a machine whose sort is sort-middle"),
        (&["--fidelity", "bound"], "--pipeline applies to --fidelity cycle only"),
        (&["--timeline", &file("timeline")], "give one of them at a time"),
        (&["--frames-per-run", "2"], "use --frames-per-run all"),
        (&["--pipeline-cycles", "7"], "write it as A..B"),
        (&["--pipeline-cycles", "7..7"], "it holds no cycle"),
    ] {
        let message = refused(&[&["replay", "traces/triangle", "--pipeline", &log], more].concat());
        assert!(message.contains(said), "{message}");
        assert!(!Path::new(&log).exists());
    }
    fs::write(&log, "Kanata\t0004\nC=\t0\n").expect("a file");
    assert!(refused(&["replay", "traces/triangle", "--pipeline", &log]).contains("fillrate has not written it"));
}
