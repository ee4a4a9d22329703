//! Pages that open from a disk: one file each, with its style, its script, its pictures and its numbers in it.
//!
//! Templates are Rust (`maud`): every text that is put into one is escaped, in elements and in attributes, and in the finished page so is every
//! character that changes the direction of text or has no width. What is put in without that is
//! written here or drawn by [`plots`](super::plots) and [`diagram`](super::diagram), which escape by themselves. Numbers stand in the page
//! twice: in tables, each with the path of the statistic in `data-path`, and as the JSON that they are from.

mod advice;
pub mod beside;
pub mod data;
mod groups;
mod machine;
pub mod maps;
pub mod passes;
pub mod plots;
pub mod replay;
pub mod series;
mod shaders;
mod state;
mod tables;
mod targets;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use serde_json::Value;

use super::summary::{bytes, grouped};
use crate::host::printable;
use crate::stats::Key;
use data::CountedSpan;

const STYLE: &str = concat!(include_str!("page.css"), include_str!("groups.css"));
/// Tables, then the selection of draws, then what follows it.
const SCRIPT: &str = concat!(
    include_str!("page.js"),
    include_str!("draws.js"),
    include_str!("maps.js"),
    include_str!("series.js"),
    include_str!("state.js")
);

/// What tells a page from other files.
pub const MARK: &[u8] = br#"<meta name="generator" content="fillrate">"#;

/// A section of a page.
pub struct PageSection {
    /// Its name in links.
    pub id: &'static str,
    /// Its heading.
    pub title: String,
    /// What is in it.
    pub body: Markup,
}

/// A sentence with code between backticks.
pub fn sentence(text: &str) -> Markup {
    html! { @for (at, piece) in text.split('`').enumerate() { @if at % 2 == 1 { code { (piece) } } @else { (piece) } } }
}

/// A part; none where there is nothing to show.
pub fn part(id: &'static str, title: impl Into<String>, body: Option<Markup>) -> Option<PageSection> {
    body.map(|body| PageSection { id, title: title.into(), body })
}

/// A whole page. `values` are embedded by their ids.
pub fn page(title: &str, head: &Markup, parts: &[PageSection], values: &[(&str, &Value)]) -> String {
    let markup = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                // `MARK` is this element as it is written.
                meta name="generator" content="fillrate";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (title) }
                // Without an icon a browser asks for one.
                link rel="icon" href="data:,";
                style { (PreEscaped(STYLE)) }
            }
            body {
                header.top { (head) }
                nav.index aria-label="Sections" { @for part in parts { a href=(format!("#{}", part.id)) { (part.title) } } }
                main {
                    @for part in parts {
                        section.long id=(part.id) { h2 { (part.title) } (part.body) }
                    }
                }
                footer { p { "Written by fillrate " (env!("CARGO_PKG_VERSION")) ". This file needs no network." } }
                @for (id, value) in values {
                    script type="application/json" id=(id) { (PreEscaped(data::script(value))) }
                }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    };
    // Labels of a trace may hold characters that turn the direction of the text behind them, or that have no width.
    printable(&markup.into_string()).into_owned()
}

/// Bytes as a part of the page itself.
pub fn inline(kind: &str, bytes: &[u8]) -> String {
    format!("data:{kind};base64,{}", STANDARD.encode(bytes))
}

/// A number for readers: whole ones in groups of three digits, others with three digits behind the point.
pub fn readable(value: f64) -> String {
    let whole = value.fract() == 0.0 && value.abs() < 9e15;
    match (whole, value < 0.0) {
        (true, false) => grouped(value as u64),
        (true, true) => format!("\u{2212}{}", grouped(-value as u64)),
        (false, _) => format!("{value:.3}"),
    }
}

/// A share as a percentage.
pub fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

/// A part by the whole; 0 where there is no whole.
pub fn share(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { part / whole } else { 0.0 }
}

/// The cell of a table that holds a statistic of a frame, a phase or a draw; empty where it has none. `base` is its path.
pub fn cell(from: &CountedSpan, base: &str, key: &Key) -> Markup {
    cell_as(from, base, key, readable)
}

/// As [`cell`], with bytes in a readable unit.
pub fn cell_bytes(from: &CountedSpan, base: &str, key: &Key) -> Markup {
    cell_as(from, base, key, bytes)
}

fn cell_as(from: &CountedSpan, base: &str, key: &Key, text: impl Fn(f64) -> String) -> Markup {
    cell_of(key.sum(&from.counts), &format!("{base}.{}", key.path(from.units)), text)
}

/// The cell of a table with a value of the file, which stands there at a path; empty where there is none.
pub fn cell_of(value: Option<f64>, path: &str, text: impl Fn(f64) -> String) -> Markup {
    html! {
        @match value {
            Some(value) => td.n data-path=(path) data-value=(value) { (text(value)) },
            None => td.n data-value="" { "\u{2013}" },
        }
    }
}

/// As [`cell_of`] with a number, in front of a bar that is as long as the number's share of the largest in the column.
pub fn cell_behind(value: Option<f64>, path: &str, share: f64) -> Markup {
    html! {
        @match value {
            Some(value) => td.n.behind data-path=(path) data-value=(value) style=(format!("--part:{:.1}%", 100.0 * share)) { (readable(value)) },
            None => td.n data-value="" { "\u{2013}" },
        }
    }
}

/// The cell of a table with a share, which is computed.
pub fn cell_share(value: f64) -> Markup {
    html! { td.n data-value=(value) { (percent(value)) } }
}

/// The head of a column: its name, whether it holds numbers, and what it means.
pub struct Column<'c>(pub &'c str, pub bool, pub &'c str);

/// The heads of a table that can be sorted by each column.
pub fn heads(columns: &[Column<'_>]) -> Markup {
    html! {
        thead { tr {
            @for Column(name, numbers, meaning) in columns {
                th.n[*numbers] scope="col" title=[(!meaning.is_empty()).then_some(meaning)] { button type="button" { (name) } }
            }
        } }
    }
}

/// A bar of shares of a whole, each with its class and its name.
pub fn bar(class: &str, shares: &[(&str, f64, String)]) -> Markup {
    html! {
        div class=(class) role="img" aria-label=(shares.iter().map(|(_, _, name)| name.as_str()).collect::<Vec<_>>().join(", ")) {
            @for (class, share, name) in shares {
                @if *share > 0.0 { i class=(class) style=(format!("width:{:.3}%", 100.0 * share)) title=(name) {} }
            }
        }
    }
}

/// The key of a bar.
pub fn key(entries: &[(&str, &str)]) -> Markup {
    html! { div.key { @for (class, name) in entries { span { i class=(class) {} (name) } } } }
}

/// A text as one word of a shell.
pub fn word(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "_-./=:,+%@".contains(c);
    if !text.is_empty() && text.chars().all(plain) { text.to_owned() } else { format!("'{}'", text.replace('\'', "'\\''")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_in_groups() {
        assert_eq!([0.0, 1234567.0, 0.5, -2000.0].map(readable), ["0", "1,234,567", "0.500", "\u{2212}2,000"]);
        assert_eq!([word("traces/a.zip"), word("it's"), word("")], ["traces/a.zip", "'it'\\''s'", "''"]);
    }

    #[test]
    fn a_page_is_whole_and_asks_for_nothing() {
        let body = html! { p { "<b> & \"" } };
        let text = page(
            "a </title><script>",
            &html! { h1 { "x\u{202e}y" } },
            &[PageSection { id: "one", title: "One".into(), body }],
            &[],
        );
        assert!(text.starts_with("<!DOCTYPE html>") && text.ends_with("</html>"));
        assert!(text.as_bytes().windows(MARK.len()).take(1024).any(|bytes| bytes == MARK), "{text}");
        assert!(text.contains("a &lt;/title&gt;&lt;script&gt;") && text.contains("&lt;b&gt; &amp; &quot;"), "{text}");
        assert!(text.contains("<h1>x\\u{202e}y</h1>"), "{text}");
        for asked in ["http://", "https://", "src=\"/", "@import", "url("] {
            assert!(!text.contains(asked), "{asked}");
        }
    }
}
