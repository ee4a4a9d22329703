//! From configuration to text.

use std::fmt::Write;

use super::Config;
use knob::{Estimate, Knob, Section};

/// Longest line of a comment.
const WIDTH: usize = 120;

/// A comment, broken into lines.
fn comment(out: &mut String, indent: usize, text: &str) {
    let mut line = String::new();
    for word in text.split_whitespace() {
        if !line.is_empty() && indent + 4 + line.chars().count() + word.chars().count() > WIDTH {
            let _ = writeln!(out, "{:indent$}// {line}", "");
            line.clear();
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line.push_str(word);
    }
    let _ = writeln!(out, "{:indent$}// {line}", "");
}

/// One knob with its comment.
fn knob(out: &mut String, indent: usize, knob: &Knob, section: &dyn Section) {
    let unit = if knob.unit.is_empty() { String::new() } else { format!(" In {}.", knob.unit) };
    comment(out, indent, &format!("{}{unit} Allowed: {}. Source: {}.", knob.meaning, knob.allowed, knob.source));
    let value = section.get(knob.name).expect("every declared knob can be read");
    let _ = writeln!(out, "{:indent$}{}: {value},", "", knob.name);
}

/// The whole configuration.
pub fn resolved(config: &Config) -> String {
    let mut out = String::from("(\n");
    let sections = config.sections();
    for (path, section) in &sections {
        if path.contains('.') {
            continue;
        }
        let indent = if path.is_empty() { 4 } else { 8 };
        if !path.is_empty() {
            out.push('\n');
            comment(&mut out, 4, section.about());
            let _ = writeln!(out, "    {path}: (");
        }
        for declared in section.knobs() {
            knob(&mut out, indent, declared, *section);
        }
        for (child, section) in &sections {
            if let Some(name) = child.strip_prefix(&format!("{path}.")).filter(|_| !path.is_empty()) {
                out.push('\n');
                comment(&mut out, 8, section.about());
                let _ = writeln!(out, "        {name}: (");
                for declared in section.knobs() {
                    knob(&mut out, 12, declared, *section);
                }
                out.push_str("        ),\n");
            }
        }
        if !path.is_empty() {
            out.push_str("    ),\n");
        }
    }
    out.push_str(")\n");
    out
}

/// The values for which estimates hold.
fn estimated(estimate: Estimate) -> String {
    match estimate {
        Estimate::Used | Estimate::UsedBy(_) => "all".into(),
        Estimate::Ignored(reason) => format!("all: {reason}"),
        Estimate::RefusedUnless(values, _) => values.to_string(),
    }
}

/// The page of all knobs, in Markdown, with the values of the baseline.
pub fn documentation(baseline: &Config) -> String {
    let mut out = String::new();
    for (path, section) in baseline.sections() {
        let title = if path.is_empty() { "top level" } else { path };
        let _ = writeln!(out, "## `{title}`\n\n{}\n", section.about());
        let _ = writeln!(
            out,
            "| key | unit | baseline | allowed | meaning | source of the baseline's value | estimates hold for |"
        );
        let _ = writeln!(out, "|---|---|---|---|---|---|---|");
        for knob in section.knobs() {
            let value = section.get(knob.name).expect("every declared knob can be read");
            let cell = |text: &str| text.replace('|', "\\|");
            let _ = writeln!(
                out,
                "| `{}` | {} | {} | {} | {} | {} | {} |",
                knob.path(path),
                cell(knob.unit),
                value,
                cell(&knob.allowed.to_string()),
                cell(knob.meaning),
                cell(knob.source),
                cell(&estimated(knob.estimate))
            );
        }
        out.push('\n');
    }
    out
}
