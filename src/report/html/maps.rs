//! Heat maps beside the picture: what each pixel cost, with a read-out under the pointer.

use image::RgbImage;
use maud::{Markup, html};
use serde_json::{Value, json};

use super::{inline, readable};
use crate::picture;
use crate::run::maps::{Map, MapKind, Maps, Surface};

/// The picture whose pixels are a map's numbers, 8 bits per channel, the largest first. It has no colour space: a browser hands the numbers on
/// as they are.
fn encoded(surface: &Surface, map: &Map) -> Vec<u8> {
    let bytes = map.values.iter().flat_map(|&value| value.min(0xFF_FFFF).to_be_bytes().into_iter().skip(1)).collect();
    // A picture without pixels is not made.
    RgbImage::from_raw(surface.columns, surface.rows, bytes).and_then(|image| picture::png(&image).ok()).unwrap_or_default()
}

/// The ends of a map's scale. Cells of value 0 have no colour of it.
#[derive(Debug, PartialEq, Eq)]
struct MapScale {
    /// The smallest value above 0.
    least: u32,
    /// The value that 99.5 % of the others stay below.
    scale: u32,
    /// The largest value.
    most: u32,
}

impl MapScale {
    fn new(map: &Map) -> MapScale {
        let mut some: Vec<u32> = map.values.iter().copied().filter(|&value| value > 0).collect();
        some.sort_unstable();
        let value = |at: usize| some.get(at.min(some.len().saturating_sub(1))).copied().unwrap_or(0);
        MapScale { least: value(0), scale: value(some.len() * 199 / 200).max(1), most: value(usize::MAX) }
    }
}

/// What the script needs to know of a surface's maps.
fn about(maps: &Maps, surface: &Surface) -> Value {
    let list: Vec<Value> = surface
        .maps
        .iter()
        .map(|map| {
            let MapScale { least, scale, most } = MapScale::new(map);
            let kind = map.kind;
            json!({ "name": kind.name(), "about": kind.about(), "unit": kind.unit(), "draws": kind.is_draw(), "least": least, "scale": scale, "most": most })
        })
        .collect();
    let draws: Vec<Value> = maps
        .draws
        .iter()
        .filter(|draw| surface.passes.contains(&draw.pass))
        .map(|draw| json!({ "number": draw.number, "label": draw.label, "pass": draw.pass }))
        .collect();
    json!({ "width": surface.columns, "height": surface.rows, "cell": surface.cell, "maps": list, "draws": draws })
}

/// Passes as a list of numbers, as far as a line goes.
fn numbers(passes: &[u32]) -> String {
    const MOST: usize = 8;
    let mut text = passes.iter().take(MOST).map(u32::to_string).collect::<Vec<_>>().join(", ");
    if passes.len() > MOST {
        text.push_str(&format!(" and {} more", passes.len() - MOST));
    }
    text
}

/// A picture that the pointer moves over, with a layer that shows the pixels of the selected draw.
fn heat(own: Markup) -> Markup {
    html! {
        div.heat tabindex="0" role="group" aria-label="Arrow keys move the pointer by a pixel, with Shift by 8. Enter selects the draw that is last there." {
            (own) canvas.chosen hidden {} div.cross {}
        }
    }
}

fn one(maps: &Maps, surface: &Surface, picture: Option<&str>) -> Markup {
    let value = about(maps, surface);
    let shown = if surface.shown { " (shown)" } else { "" };
    let s = if surface.passes.len() == 1 { "pass" } else { "passes" };
    html! {
        div.maps {
            h3 { (surface.name) (shown) ", " (surface.width) "\u{00d7}" (surface.height) ", " (s) " " (numbers(&surface.passes)) }
            div.tabs role="group" aria-label="Map" {
                @for map in &surface.maps { button type="button" aria-pressed="false" title=(map.kind.about()) { (map.kind.name()) } }
            }
            p.note.about {}
            div.two {
                @if let (Some(picture), true) = (picture, surface.shown) { (heat(html! { img src=(picture) alt="The picture"; })) }
                div {
                    (heat(html! { canvas.map role="img" aria-label="Heat map" {} }))
                    div.scale { span.low {} i {} span.high {} span { i.none {} "none" } }
                    div.readout role="status" aria-live="off" { "Point at a pixel. A click selects the draw that is last there." }
                }
            }
            @for map in &surface.maps {
                img.raw hidden alt="" src=(inline("image/png", &encoded(surface, map)));
            }
            script type="application/json" { (maud::PreEscaped(super::data::script(&value))) }
        }
    }
}

/// The maps of a frame; `picture` is the address of the picture, of the surface that is shown.
pub fn section(maps: &Maps, picture: Option<&str>) -> Markup {
    html! {
        @for surface in &maps.surfaces { (one(maps, surface, picture)) }
        @if maps.surfaces.is_empty() { p { "The frame draws nothing." } }
        @if maps.left_out > 0 { p.note { (readable(maps.left_out as f64)) " more surfaces are drawn to; those with most fragments are shown." } }
        p.note {
            "Overdraw to last draw are counted by pixel, in the order of the trace, from the work that every machine is given. "
            @if maps.surfaces.iter().any(|surface| surface.maps.len() > MapKind::COUNTED.len()) {
                "Rejects, texture misses and when are what this machine noted, by blocks of 8x8 pixels, in a run of this frame alone with empty caches."
            } @else { "Rejects, texture misses and when are known where a machine has drawn the frame: replay with " code { "--fidelity cycle" } "." }
        }
        noscript { p { "The maps need JavaScript." } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scale_begins_at_the_smallest_value() {
        let map = |values: Vec<u32>| MapScale::new(&Map { kind: MapKind::When, values });
        assert_eq!(map(vec![0, 700, 900, 800]), MapScale { least: 700, scale: 900, most: 900 });
        // One cell of 300 does not take the colours of all others.
        let values = (0..300).map(|at| if at == 7 { 1_000_000 } else { 5 + at % 2 }).collect();
        assert_eq!(map(values), MapScale { least: 5, scale: 6, most: 1_000_000 });
        assert_eq!(map(vec![0, 0]), MapScale { least: 0, scale: 1, most: 0 });
    }
}
