//! What to try: rules over the statistics, each with what was counted and the knob to change.

use maud::{Markup, html};
use serde_json::Value;

use super::data::CountedSpan;
use super::replay::{Input, command};
use super::{percent, readable, share};
use crate::knob::{Advice, Knob, Relax, Setting};
use crate::machine::{Config, SortOutcome};
use crate::mem::{CACHES, CacheCounts};
use crate::report::verdict::Cause;
use crate::unit::phase::PhaseKind;
use crate::work::{FUNNEL, Funnel};

/// Beginnings of the advice that a program can follow.
const IN_THE_FRAME: [&str; 4] = ["Draw meshes", "Test depth", "Draw from front", "Uploads and copies"];

/// One piece of advice.
struct Proposal {
    /// What to do.
    what: String,
    /// What was counted.
    evidence: String,
    /// Knobs to try; none where the scene must change.
    set: Vec<String>,
    /// Whether the program can do it in the frame. Else it is a change of the card.
    frame: bool,
    /// By which the list is ordered: the share of the frame that is at stake, by a rough measure.
    weight: f64,
}

/// The setting that gives a frame more of what a knob limits, as its declaration says. None if the knob has that value or does not take it.
fn setting(config: &Config, path: &str, knob: &Knob) -> Option<String> {
    let (_, now) = config.knob("advice", path).ok()?;
    let wanted = match (knob.relax, &now) {
        (Relax::Skip(values), _) => Setting::from(values.first()?.0),
        (Relax::Rate | Relax::Room | Relax::Cache, Setting::Number(value)) => Setting::Number(2 * value),
        (Relax::Interval | Relax::Latency | Relax::Parts(_), Setting::Number(value)) => Setting::Number(value.div_ceil(2)),
        _ => return None,
    };
    (wanted != now && knob.allowed.admits(&wanted)).then(|| format!("{path}={wanted}"))
}

/// The knobs whose declarations name some advice, with that advice.
fn declared(config: &Config) -> impl Iterator<Item = (Advice, String, &'static Knob)> {
    config.knobs().flat_map(|(path, knob)| knob.advice.iter().map(move |&advice| (advice, path.clone(), knob)))
}

/// Whether a machine with these settings keeps the rules between knobs.
fn holds(config: &Config, set: &[String]) -> bool {
    let mut changed = config.clone();
    set.iter().all(|setting| changed.set(setting).is_ok()) && changed.check().is_ok()
}

/// Advice from the gains that `why` has timed.
fn proven(why: &Value) -> Vec<Proposal> {
    let gains = why["changes"].as_array().map_or(&[][..], Vec::as_slice);
    let gain = |value: &Value| value["gain"].as_f64().unwrap_or(0.0);
    let worth = gains.iter().filter(|own| gain(own) >= 0.02).take(6);
    let advice = worth.map(|own| {
        let evidence = own["evidence"].as_str().unwrap_or("");
        let place = own["most_in"].as_str().map_or(String::new(), |phase| format!(", in {phase}"));
        let set = own["set"].as_object().into_iter().flatten();
        let frame = own["set"]
            .as_object()
            .into_iter()
            .flatten()
            .any(|(path, _)| Cause::ALL.iter().any(|cause| cause.knobs().contains(&path.as_str())));
        Proposal {
            frame,
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
fn counted(frame: &CountedSpan, config: Option<&Config>) -> Vec<Proposal> {
    let funnel: Funnel = FUNNEL.sum(&frame.counts);
    let sort = SortOutcome::read(&frame.counts);
    let mut all = Vec::new();
    let mut add = |what: &str, evidence: String, advice: Option<Advice>, weight: f64| {
        let knobs =
            config.into_iter().flat_map(|config| declared(config).map(move |(own, path, knob)| (config, own, path, knob)));
        let own = knobs.filter(|&(_, own, ..)| Some(own) == advice);
        let set: Vec<String> = own.filter_map(|(config, _, path, knob)| setting(config, &path, knob)).collect();
        let frame = IN_THE_FRAME.iter().any(|own| what.starts_with(own));
        let set = if config.is_some_and(|config| holds(config, &set)) { set } else { Vec::new() };
        all.push(Proposal { what: what.into(), evidence, set, frame, weight });
    };
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
            None,
            0.4 * share(helpers, helpers + shaded),
        );
    }
    if late_failed > 0.2 * shaded && shaded > 0.0 {
        let evidence =
            format!("{} of the shaded fragments fail the depth test after shading.", percent(share(late_failed, shaded)));
        add("Test depth before shading: no discard, no depth from shaders.", evidence, Some(Advice::LateFailures), 0.5);
    }
    if covered > 2.0 * pixels.max(1.0) && early == 0.0 {
        let evidence = format!(
            "{} fragments are covered, {} written, and none is hidden before shading.",
            readable(covered),
            readable(pixels)
        );
        add("Draw from front to back, with early tests.", evidence, Some(Advice::NothingHidden), 0.4);
    }
    for (advice, ..) in declared(config.unwrap_or(&Config::default())) {
        let Advice::Cache(cache) = advice else { continue };
        let CacheCounts { accesses, hits, .. } = CACHES.sum_of(&frame.counts, cache);
        let (lookups, hits) = (accesses as f64, hits as f64);
        if lookups > 0.005 * cycles && hits < 0.8 * lookups {
            let evidence = format!("{} of {} lookups hit.", percent(share(hits, lookups)), readable(lookups));
            add(&format!("Make the {cache} cache larger."), evidence, Some(advice), 0.2);
        }
    }
    if sort.load_imbalance > 1.15 {
        let evidence = format!("The busiest pipeline has {:.2} times the quads of the mean.", sort.load_imbalance);
        let weight = sort.load_imbalance - 1.0;
        add("Deal the screen to pipelines in smaller tiles.", evidence, Some(Advice::Imbalance), weight);
    }
    for (kind, advice, what) in [
        (
            PhaseKind::ScanOut,
            Advice::ScanOut,
            "Scan-out follows drawing and nothing overlaps it: leave it out to compare drawing alone.",
        ),
        (
            PhaseKind::Transfers,
            Advice::Transfers,
            "Uploads and copies precede drawing and nothing overlaps them: upload once, not in each frame.",
        ),
    ] {
        let own: f64 = frame.parts.iter().filter(|phase| phase.is(kind)).map(CountedSpan::cycles).sum();
        if own > 0.1 * cycles && cycles > 0.0 {
            let evidence = format!("{} takes {} of the cycles.", kind.name(), percent(share(own, cycles)));
            add(what, evidence, Some(advice), share(own, cycles));
        }
    }
    if sort.wrong_pixels > 0 {
        let evidence =
            format!("{} pixels differ from the picture in the order of the trace.", readable(sort.wrong_pixels as f64));
        add("This machine does not keep the order that a pass needs.", evidence, None, 2.0);
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
        @for (title, frame) in [("In the frame", true), ("On the card", false)] {
            @if all.iter().any(|advice| advice.frame == frame) {
                h3 { (title) }
                ol.advice { @for advice in all.iter().filter(|advice| advice.frame == frame) {
                    li {
                        b { (advice.what) }
                        @if !(advice.evidence.is_empty() && advice.set.is_empty()) {
                            details {
                                summary { "Evidence" }
                                @if !advice.evidence.is_empty() { p.note { (advice.evidence) } }
                                @if !advice.set.is_empty() { pre { (command(input.statistics, "replay", &advice.set)) } }
                            }
                        }
                    }
                } }
            }
        }
        @if input.why.is_none() {
            p.note { "These are rules over counters, not proof. Proof times the frame again: " code { (command(input.statistics, "why", &[])) } }
        }
    })
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn rules_name_the_knobs_that_declare_their_advice() {
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
        let mut expected: Vec<String> = declared(&config).map(|(_, path, _)| path).collect();
        expected.sort();
        assert_eq!(paths, expected);
        assert!(expected.len() >= 10 && expected.contains(&"distribute.tile".to_owned()));
    }

    #[test]
    fn the_sizes_of_counted_caches_belong_to_advice() {
        let config = Config::built_in("four-pipelines").expect("it is built in");
        let advised: Vec<&str> = declared(&config)
            .filter_map(|(advice, ..)| if let Advice::Cache(name) = advice { Some(name) } else { None })
            .collect();
        for name in ["texture", "vertex", "color", "depth"] {
            assert!(advised.contains(&name), "{name}");
        }
        for (_, path, knob) in declared(&config) {
            assert!(knob.relax != Relax::Never, "{path}: `why` cannot prove what advice says of it");
        }
    }
}
