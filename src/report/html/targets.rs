//! Small pictures of what each pass leaves in its attachments.

use maud::{Markup, html};

use super::inline;
use crate::picture;
use crate::run::targets::{TargetPicture, TargetPictures};

/// The attachment and the surface in words.
fn name(of: &TargetPicture) -> String {
    let key = of.surface.key;
    let attachment = of.location.map_or("depth".to_owned(), |location| format!("colour {location}"));
    let level = if key.level > 0 { format!(", level {}", key.level) } else { String::new() };
    let layer = if key.layer > 0 { format!(", layer {}", key.layer) } else { String::new() };
    format!("{attachment}: texture {}{level}{layer}", key.texture)
}

/// What the picture shows.
fn about(of: &TargetPicture) -> String {
    let surface = &of.surface;
    let mut text = format!("{}\u{d7}{}, {}", surface.width, surface.height, surface.format.name());
    if surface.samples > 1 {
        text.push_str(&format!(", the first of {} samples", surface.samples));
    }
    if let Some([least, most]) = of.depths {
        text.push_str(&format!(", {least:.4} (black) to {most:.4}"));
    }
    if !of.kept {
        text.push_str(", not kept after the pass");
    }
    text
}

/// The pictures in the order in which passes end.
pub fn section(targets: &TargetPictures) -> Option<Markup> {
    let picture = |of: &TargetPicture| picture::png(&of.image).ok().map(|png| inline("image/png", &png));
    let shown: Vec<(&TargetPicture, String)> = targets.pictures.iter().filter_map(|of| Some((of, picture(of)?))).collect();
    (!shown.is_empty()).then(|| {
        html! {
            h3 { "Attachments at the end of their pass" }
            div.targets {
                @for (of, address) in &shown {
                    figure {
                        img src=(address) width=(of.image.width()) height=(of.image.height()) alt=(format!("pass {}, {}", of.pass, name(of)));
                        figcaption { b { "pass " (of.pass) } ", " (name(of)) br; (about(of)) }
                    }
                }
            }
            @if targets.left_out > 0 { p.note { (targets.left_out) " more attachments have no picture: those behind the first 64, and those of formats that cannot be shown." } }
        }
    })
}
