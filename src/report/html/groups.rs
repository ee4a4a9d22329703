//! Debug groups: a tree that opens and closes, with sums over the draws.

use maud::{Markup, html};

use super::replay::Input;
use super::{bar, percent, readable, share};
use crate::report::groups::{DrawGroup, groups};
use crate::report::summary::bytes;

/// Groups that are shown at most, so that the page is bounded.
const MOST: usize = 2000;

/// The tree of a frame. None if no draw is in a group.
pub fn tree(input: &Input<'_>) -> Option<Markup> {
    let all = groups(input.statistics.frame())?;
    let mut left = MOST;
    Some(html! {
        p.note { "Sums over the draws in a group and in the groups inside it. Groups with one label in the same outer group are joined." }
        @for inside in &all.inside { (group(inside, &all, &mut left)) }
        @if left == 0 { p.note { "More groups are not shown: " code { "fillrate report DIR --groups" } " lists all." } }
    })
}

/// A group and those inside.
fn group(of: &DrawGroup, all: &DrawGroup, left: &mut usize) -> Markup {
    if *left == 0 {
        return html! {};
    }
    *left -= 1;
    let part = share(of.cycles, all.cycles);
    let line = html! {
        b { (of.label) } ": " (readable(of.draws as f64)) " draws, " (readable(of.cycles)) " cycles (" (percent(part)) "), "
        (readable(of.fragments as f64)) " fragments shaded" @if let Some(moved) = of.bytes { ", " (bytes(moved)) " of DRAM" }
        " " (bar("bar", &[("k-draw", part, percent(part))]))
    };
    html! {
        @if of.inside.is_empty() {
            div.group { (line) }
        } @else {
            details.group open { summary { (line) } @for inside in &of.inside { (group(inside, all, left)) } }
        }
    }
}
