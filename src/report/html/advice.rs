//! What to try: rules over the statistics, each with what was counted and the knob to change.

use maud::{Markup, html};
use serde_json::Value;

use super::data::CountedSpan;
use super::replay::{Input, command};
use super::{percent, readable, share};
use crate::knob::Setting;
use crate::machine::{Config, SortOutcome};
use crate::mem::{CACHES, CacheCounts};
use crate::unit::phase::PhaseKind;
use crate::work::{FUNNEL, Funnel};

/// One piece of advice.
struct Advice {
    /// What to do.
    what: String,
    /// What was counted.
    evidence: String,
    /// Knobs to try; none where the scene must change.
    set: Vec<String>,
    /// By which the list is ordered: the share of the frame that is at stake, by a rough measure.
    weight: f64,
}

/// A number's knob at `times` its value, if it takes that.
fn times(config: &Config, path: &str, times: f64) -> Option<String> {
    let (knob, now) = config.knob("advice", path).ok()?;
    let Setting::Number(value) = now else { return None };
    let wanted = Setting::Number((value as f64 * times).round().max(1.0) as u64);
    (wanted != now && knob.allowed.admits(&wanted)).then(|| format!("{path}={wanted}"))
}

/// A switch that is off.
fn switch(config: &Config, path: &str) -> Option<String> {
    let (_, now) = config.knob("advice", path).ok()?;
    (now == Setting::Switch(false)).then(|| format!("{path}=true"))
}

/// Whether a machine with these settings keeps the rules between knobs.
fn holds(config: &Config, set: &[String]) -> bool {
    let mut changed = config.clone();
    set.iter().all(|setting| changed.set(setting).is_ok()) && changed.check().is_ok()
}

/// Advice from the gains that `why` has timed.
fn proven(why: &Value) -> Vec<Advice> {
    let gains = why["changes"].as_array().map_or(&[][..], Vec::as_slice);
    let gain = |value: &Value| value["gain"].as_f64().unwrap_or(0.0);
    let worth = gains.iter().filter(|own| gain(own) >= 0.02).take(6);
    let advice = worth.map(|own| {
        let evidence = own["evidence"].as_str().unwrap_or("");
        let place = own["most_in"].as_str().map_or(String::new(), |phase| format!(", in {phase}"));
        let set = own["set"].as_object().into_iter().flatten();
        Advice {
            what: format!("{}: {} fewer cycles, timed.", own["change"].as_str().unwrap_or(""), percent(gain(own))),
            evidence: if evidence.is_empty() { String::new() } else { format!("Without it{place}: {evidence}.") },
            set: set.map(|(path, value)| format!("{path}={}", value.as_str().unwrap_or("").trim_matches('"'))).collect(),
            weight: 1.0 + gain(own),
        }
    });
    advice.collect()
}

/// Paths of the knobs that `why` has changed.
fn timed(why: &Value) -> Vec<String> {
    let changes = why["changes"].as_array().into_iter().flatten();
    changes.filter_map(|own| own["set"].as_object()).flat_map(|set| set.keys().cloned()).collect()
}

/// Rules over the counters of a frame.
fn counted(frame: &CountedSpan, config: Option<&Config>) -> Vec<Advice> {
    let funnel: Funnel = FUNNEL.sum(&frame.counts);
    let sort = SortOutcome::read(&frame.counts);
    let mut all = Vec::new();
    let mut add = |what: &str, evidence: String, set: Vec<Option<String>>, weight: f64| {
        let set: Vec<String> = set.into_iter().flatten().collect();
        let set = if config.is_some_and(|config| holds(config, &set)) { set } else { Vec::new() };
        all.push(Advice { what: what.into(), evidence, set, weight });
    };
    let knob = |path: &str, by: f64| config.and_then(|config| times(config, path, by));
    let on = |path: &str| config.and_then(|config| switch(config, path));
    let [covered, shaded, helpers, late_failed, pixels, early] = [
        funnel.fragments_covered,
        funnel.fragments_shaded,
        funnel.helper_fragments,
        funnel.fragments_late_failed,
        funnel.fragments_written,
        funnel.quads_early_culled + 16 * funnel.tiles_hiz_culled,
    ]
    .map(|count| count as f64);
    let cycles = frame.cycles();
    if helpers > 0.5 * (helpers + shaded) && shaded > 0.0 {
        let evidence = format!(
            "{} of the invocations are helpers: {} for {} fragments. Triangles are small or thin.",
            percent(share(helpers, helpers + shaded)),
            readable(helpers),
            readable(shaded)
        );
        add(
            "Draw meshes with fewer triangles where they are far away.",
            evidence,
            Vec::new(),
            0.4 * share(helpers, helpers + shaded),
        );
    }
    if late_failed > 0.2 * shaded && shaded > 0.0 {
        let evidence =
            format!("{} of the shaded fragments fail the depth test after shading.", percent(share(late_failed, shaded)));
        add("Test depth before shading: no discard, no depth from shaders.", evidence, vec![on("depth.early")], 0.5);
    }
    if covered > 2.0 * pixels.max(1.0) && early == 0.0 {
        let evidence = format!(
            "{} fragments are covered, {} written, and none is hidden before shading.",
            readable(covered),
            readable(pixels)
        );
        add(
            "Draw from front to back, with early tests.",
            evidence,
            vec![on("depth.early"), on("traverse.hierarchical_z")],
            0.4,
        );
    }
    for (cache, path) in [
        ("texture", "texture.cache_lines"),
        ("vertex", "fetch.cache_lines"),
        ("color", "color.cache_blocks"),
        ("depth", "depth.cache_blocks"),
    ] {
        let CacheCounts { accesses, hits, .. } = CACHES.sum_of(&frame.counts, cache);
        let (lookups, hits) = (accesses as f64, hits as f64);
        if lookups > 0.005 * cycles && hits < 0.8 * lookups {
            let evidence = format!("{} of {} lookups hit.", percent(share(hits, lookups)), readable(lookups));
            add(&format!("Make the {cache} cache larger."), evidence, vec![knob(path, 2.0)], 0.2);
        }
    }
    if sort.load_imbalance > 1.15 {
        let evidence = format!("The busiest pipeline has {:.2} times the quads of the mean.", sort.load_imbalance);
        let set = vec![knob("distribute.tile", 0.5)];
        add("Deal the screen to pipelines in smaller tiles.", evidence, set, sort.load_imbalance - 1.0);
    }
    for (kind, set, what) in [
        (
            PhaseKind::ScanOut,
            Some("scanout.enabled=false".to_owned()),
            "Scan-out follows drawing and nothing overlaps it: leave it out to compare drawing alone.",
        ),
        (
            PhaseKind::Transfers,
            knob("memory.port_width", 2.0),
            "Uploads and copies precede drawing and nothing overlaps them: upload once, not in each frame.",
        ),
    ] {
        let own: f64 = frame.parts.iter().filter(|phase| phase.is(kind)).map(CountedSpan::cycles).sum();
        if own > 0.1 * cycles && cycles > 0.0 {
            let evidence = format!("{} takes {} of the cycles.", kind.name(), percent(share(own, cycles)));
            add(what, evidence, vec![set], share(own, cycles));
        }
    }
    if sort.wrong_pixels > 0 {
        let evidence =
            format!("{} pixels differ from the picture in the order of the trace.", readable(sort.wrong_pixels as f64));
        add("This machine does not keep the order that a pass needs.", evidence, Vec::new(), 2.0);
    }
    all
}

/// Advice, what is at stake most first.
pub fn section(input: &Input<'_>) -> Option<Markup> {
    let frame = input.statistics.frame();
    let mut all = input.why.map_or(Vec::new(), proven);
    // What was timed says more than a rule about the same knob, also where it gains nothing.
    let known: Vec<String> = input.why.map_or(Vec::new(), timed);
    let rules = counted(frame, input.config).into_iter();
    let path = |set: &str| set.split_once('=').map_or(set, |(path, _)| path).to_owned();
    all.extend(rules.filter(|advice| advice.set.is_empty() || !advice.set.iter().all(|set| known.contains(&path(set)))));
    all.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    Some(html! {
        @if all.is_empty() { p { "No rule applies to this frame." } }
        ol.advice { @for advice in &all {
            li {
                b { (advice.what) }
                @if !advice.evidence.is_empty() { p.note { (advice.evidence) } }
                @if !advice.set.is_empty() { pre { (command(input.statistics, "replay", &advice.set)) } }
            }
        } }
        @if input.why.is_none() {
            p.note { "These are rules over counters, not proof. Proof times the frame again: " code { (command(input.statistics, "why", &[])) } }
        }
    })
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::knob::Relax;

    #[test]
    fn rules_name_knobs_that_can_give_a_frame_more() {
        // All rules apply to this frame, and each early test is off.
        let cache = json!([{ "accesses": 1000, "hits": 10 }]);
        let frame = json!({
            "cycles": 1000,
            "funnel": { "fragments_shaded": 100, "helper_fragments": 900, "fragments_late_failed": 90, "fragments_covered": 100 },
            "caches": { "texture": cache, "vertex": cache, "color": cache, "depth": cache },
            "sort": { "load_imbalance": 2.0, "wrong_pixels": 1 },
            "phases": [{ "kind": "scan-out", "cycles": 300 }, { "kind": "transfers", "cycles": 300 }],
        });
        let mut config = Config::built_in("four-pipelines").expect("it is built in");
        for change in ["depth.early=false", "traverse.hierarchical_z=false"] {
            config.set(change).expect("a knob");
        }
        let advice = counted(&CountedSpan::frame(&frame), Some(&config));
        assert_eq!(advice.len(), 11);
        let mut paths: Vec<&str> =
            advice.iter().flat_map(|own| &own.set).map(|set| set.split('=').next().unwrap_or(set)).collect();
        paths.sort();
        let expected = [
            "color.cache_blocks",
            "depth.cache_blocks",
            "depth.early",
            "depth.early",
            "distribute.tile",
            "fetch.cache_lines",
            "memory.port_width",
            "scanout.enabled",
            "texture.cache_lines",
            "traverse.hierarchical_z",
        ];
        assert_eq!(paths, expected);
        for path in paths {
            let (knob, _) = config.knob("advice", path).expect("a knob");
            assert!(knob.relax != Relax::Never, "{path}: `why` cannot prove what advice says of it");
        }
    }
}
