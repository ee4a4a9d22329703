//! The shaders of a frame: listings with the instructions of each line.

use maud::{Markup, html};

use super::{bar, percent, readable, share};
use crate::report::shaders::ShaderListing;

/// Shaders that a page lists: those with most instructions.
const SHADERS: usize = 12;

/// Lines that a page has of a shader.
const LINES: usize = 600;

/// The listings. None if nothing was shaded.
pub fn section(listings: &[ShaderListing]) -> Option<Markup> {
    let all: u64 = listings.iter().map(|listing| listing.cost.instructions).sum();
    (all > 0).then(|| {
        html! {
            p.note { "Instructions that each line executes, summed over all invocations of the frame, helpers included: those of a machine whose instructions work on one component." }
            @for listing in listings.iter().take(SHADERS) { (shader(listing, all)) }
            @if listings.len() > SHADERS { p.note { (readable((listings.len() - SHADERS) as f64)) " more shaders cost less: " code { "fillrate shaders TRACE" } " lists all." } }
        }
    })
}

fn shader(listing: &ShaderListing, all: u64) -> Markup {
    let own = listing.cost.instructions;
    let most = listing.cost.lines.values().copied().max().unwrap_or(0);
    let lines = listing.lines();
    html! {
        details {
            summary {
                b { (listing.name()) } ": " (readable(own as f64)) " instructions (" (percent(share(own as f64, all as f64))) ") in "
                (readable(listing.cost.invocations as f64)) " invocations"
            }
            div.scroll.tall { table {
                thead { tr { th.n scope="col" { "line" } th.n scope="col" { "instructions" } th scope="col" { "" } th scope="col" { "source" } } }
                tbody {
                    @if let Some(&shared) = listing.cost.lines.get(&0) {
                        tr { td.n {} td.n { (readable(shared as f64)) } td { (bar("bar", &[("k-draw", share(shared as f64, most as f64), percent(share(shared as f64, own as f64)))])) } td { "(what belongs to no line, such as values that all invocations share)" } }
                    }
                    @for (line, cost, text) in lines.iter().take(LINES) {
                        tr {
                            td.n { (line) }
                            td.n { @if *cost > 0 { (readable(*cost as f64)) } }
                            td { @if *cost > 0 { (bar("bar", &[("k-draw", share(*cost as f64, most as f64), percent(share(*cost as f64, own as f64)))])) } }
                            td { code { (text) } }
                        }
                    }
                }
            } }
            @if lines.len() > LINES { p.note { (readable((lines.len() - LINES) as f64)) " more lines are not shown." } }
        }
    }
}
