//! The history of a pixel, as text and as JSON.

use serde_json::{Value, json};

use crate::host::one_line;
use crate::report::summary::grouped;
use crate::run::pixel::{Change, Fragment, History, PixelEvent, Texel, Touch, surface_name, texel_text};
use crate::work::SurfaceKey;

/// The part of a history that is text in every answer: its subject, and what the numbers are.
fn head(history: &History, at: [u32; 2], frame: u32) -> String {
    let surface = &history.surface;
    let samples = if surface.samples > 1 { format!(", {} samples", surface.samples) } else { String::new() };
    let shown = if history.shown { ", shown" } else { "" };
    format!(
        "pixel {},{} of {} ({}, {} x {}{samples}{shown}) in frame {frame}",
        at[0],
        at[1],
        surface_name(surface.key),
        surface.format.name(),
        surface.width,
        surface.height
    )
}

/// The values of a pixel's samples: one if they are equal.
fn values(change: &Change, texels: &[Texel]) -> String {
    let text = |texel: &Texel| texel_text(change.surface.format, *texel);
    match texels.split_first() {
        Some((first, rest)) if rest.iter().all(|texel| texel == first) => text(first),
        _ => texels.iter().map(text).collect::<Vec<_>>().join(" | "),
    }
}

/// How a fragment ends, by its samples.
fn ends(fragment: &Fragment, changes: &[Change]) -> String {
    let when = if fragment.early { "early" } else { "late" };
    let all = fragment.covered.count_ones();
    let of = |mask: u8| {
        let some = mask.count_ones();
        if some < all { format!(" in {some} of {all} samples") } else { String::new() }
    };
    let mut parts = Vec::new();
    if fragment.stencil_failed != 0 {
        parts.push(format!("{when} stencil test fails{}", of(fragment.stencil_failed)));
    }
    if fragment.depth_failed != 0 {
        parts.push(format!("{when} depth test fails{}", of(fragment.depth_failed)));
    }
    if fragment.discarded != 0 {
        parts.push(format!("discarded by the shader{}", of(fragment.discarded)));
    }
    if fragment.passed != 0 {
        let colors = changes.iter().any(|change| !change.surface.format.is_depth_stencil());
        let how = if changes.iter().all(|change| change.before == change.after) {
            "passes, changes nothing"
        } else if changes.iter().any(|change| change.blended) {
            "blended"
        } else if colors {
            "written"
        } else {
            "depth written"
        };
        parts.push(format!("{how}{}", of(fragment.passed)));
    }
    parts.join("; ")
}

/// What an event is, in a few words.
fn what(event: &PixelEvent) -> String {
    match &event.touch {
        Touch::Found => "found: no draw of the frame wrote it".into(),
        Touch::Cleared => "cleared".into(),
        Touch::Fragment(fragment) => ends(fragment, &event.changes),
        Touch::Resolved(from) => format!("resolved from {}", surface_name(*from)),
        Touch::Copied(from) => format!("copied from {}", surface_name(*from)),
        Touch::NotKept => "not kept by the pass: zeros".into(),
    }
}

/// The change of a surface by an event, or of the first one that leads there.
fn own(event: &PixelEvent, key: SurfaceKey) -> Option<&Change> {
    event.changes.iter().find(|change| change.surface.key == key).or(event.changes.first())
}

/// The names of a draw: its debug group and the label of its pipeline.
fn names(fragment: &Fragment) -> String {
    let names = [fragment.draw.group(), &fragment.draw.label].into_iter().filter(|name| !name.is_empty());
    names.map(one_line).collect::<Vec<_>>().join(" / ")
}

/// The last fragment that passed all tests.
fn last(history: &History) -> Option<&Fragment> {
    history.events.iter().rev().find_map(|event| match &event.touch {
        Touch::Fragment(fragment) if fragment.passed != 0 => Some(&**fragment),
        _ => None,
    })
}

/// A history as text: a line for each event, and the last writer.
pub fn text(history: &History, at: [u32; 2], frame: u32) -> String {
    let key = history.surface.key;
    let titles = ["pass", "draw", "made by", "primitive", "how it ends", "instructions", "depth", "before", "after"];
    let mut rows = vec![titles.map(str::to_owned)];
    for event in &history.events {
        let mut row: [String; 9] = Default::default();
        row[0] = event.pass.as_ref().map_or(String::new(), |pass| pass.number.to_string());
        row[4] = what(event);
        if let Some(change) = own(event, key) {
            [row[7], row[8]] = [values(change, &change.before), values(change, &change.after)];
        }
        if let Touch::Fragment(fragment) = &event.touch {
            row[1] = fragment.draw.number.to_string();
            row[2] = fragment.draw.site.to_string();
            row[3] = grouped(fragment.primitive);
            row[5] = grouped(fragment.instructions.iter().sum::<u32>().into());
            row[6] = fragment.depth.map_or(String::new(), |depth| format!("{depth:.6}"));
            if row[7] == row[8] {
                row[8] = "same".to_owned();
            }
        }
        rows.push(row);
    }
    let widths: [usize; 9] =
        std::array::from_fn(|column| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0));
    let mut text = format!("{}\n", head(history, at, frame));
    if history.left_out > 0 {
        text.push_str(&format!("  {} earlier events are left out\n", grouped(history.left_out)));
    }
    for (number, row) in rows.iter().enumerate() {
        let mut line = String::new();
        for (column, (cell, width)) in row.iter().zip(widths).enumerate() {
            // Numbers stand at the right, texts at the left.
            let cell = if matches!(column, 2 | 4 | 7 | 8) { format!("{cell:<width$}") } else { format!("{cell:>width$}") };
            line.push_str("  ");
            line.push_str(&cell);
        }
        let event = number.checked_sub(1).and_then(|at| history.events.get(at));
        if let Some(PixelEvent { touch: Touch::Fragment(fragment), .. }) = event {
            line.push_str(&format!("  {}", names(fragment)));
        }
        text.push_str(line.trim_end());
        text.push('\n');
    }
    match last(history) {
        Some(fragment) => {
            let name = names(fragment);
            let name = if name.is_empty() { name } else { format!(", {name}") };
            let draw = &fragment.draw;
            text.push_str(&format!(
                "The last draw that passed all tests here is draw {}{name}, made by {}.\n",
                draw.number, draw.site
            ));
        }
        None => text.push_str("No draw of the frame has written it.\n"),
    }
    if let Some(sprite) = history.sprite {
        text.push_str(&format!("In the picture, sprite {sprite} of the display covers it.\n"));
    }
    text.push_str(
        "Pixels are computed in the order of the trace and no machine is simulated: a card's hierarchical Z may reject what the early test rejects here.\n",
    );
    text
}

fn surface_json(key: SurfaceKey) -> Value {
    json!({"texture": key.texture, "level": key.level, "layer": key.layer})
}

fn change_json(change: &Change) -> Value {
    let texts = |texels: &[Texel]| texels.iter().map(|texel| texel_text(change.surface.format, *texel)).collect::<Vec<_>>();
    let mut json = surface_json(change.surface.key);
    json["format"] = change.surface.format.name().into();
    json["blended"] = change.blended.into();
    json["before"] = texts(&change.before).into();
    json["after"] = texts(&change.after).into();
    json
}

fn event_json(event: &PixelEvent) -> Value {
    let kind = match &event.touch {
        Touch::Found => "found",
        Touch::Cleared => "cleared",
        Touch::Fragment(_) => "fragment",
        Touch::Resolved(_) => "resolved",
        Touch::Copied(_) => "copied",
        Touch::NotKept => "not-kept",
    };
    let mut json =
        json!({"kind": kind, "what": what(event), "changes": event.changes.iter().map(change_json).collect::<Vec<_>>()});
    if let Some(pass) = &event.pass {
        json["pass"] = pass.number.into();
    }
    match &event.touch {
        Touch::Resolved(from) | Touch::Copied(from) => json["from"] = surface_json(*from),
        Touch::Fragment(fragment) => {
            let Fragment { draw, primitive, back, early, depth, covered, .. } = &**fragment;
            json["draw"] = draw.number.into();
            json["label"] = draw.label.clone().into();
            json["site"] = draw.site.to_string().into();
            json["groups"] = draw.groups.iter().map(|label| &**label).collect::<Vec<_>>().into();
            json["primitive"] = (*primitive).into();
            json["back"] = (*back).into();
            json["early"] = (*early).into();
            json["depth"] = (*depth).into();
            json["samples"] = json!({
                "covered": covered,
                "stencil_failed": fragment.stencil_failed,
                "depth_failed": fragment.depth_failed,
                "discarded": fragment.discarded,
                "passed": fragment.passed,
            });
            json["instructions"] = fragment.instructions.iter().sum::<u32>().into();
            json["requests"] = fragment.requests.into();
        }
        Touch::Found | Touch::Cleared | Touch::NotKept => {}
    }
    json
}

/// A history as JSON. Masks of samples have a bit for each sample, the first one in bit 0.
pub fn json(history: &History, at: [u32; 2], frame: u32) -> Value {
    let mut surface = surface_json(history.surface.key);
    surface["format"] = history.surface.format.name().into();
    surface["width"] = history.surface.width.into();
    surface["height"] = history.surface.height.into();
    surface["samples"] = history.surface.samples.into();
    let texts: Vec<String> = history.last.iter().map(|texel| texel_text(history.surface.format, *texel)).collect();
    json!({
        "frame": frame,
        "pixel": at,
        "surface": surface,
        "shown": history.shown,
        "sprite": history.sprite,
        "fidelity": "functional",
        "left_out": history.left_out,
        "events": history.events.iter().map(event_json).collect::<Vec<_>>(),
        "last_draw": last(history).map(|fragment| fragment.draw.number),
        "values": texts,
    })
}
