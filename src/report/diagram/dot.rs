//! A diagram in the language of Graphviz.

use super::{Diagram, shape, times};

fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', " "))
}

/// The whole file.
pub(super) fn draw(diagram: &Diagram) -> String {
    let mut text = String::from("digraph machine {\n");
    text.push_str("    rankdir=LR; labelloc=t; fontname=\"sans-serif\";\n");
    text.push_str("    node [shape=box, fontname=\"sans-serif\"]; edge [fontname=\"sans-serif\", fontsize=10];\n");
    text.push_str(&format!("    label={};\n", quoted(&diagram.title)));
    let node = |bank: usize| {
        let bank = &diagram.banks[bank];
        let shape = if bank.count > 1 { ", shape=box3d" } else { "" };
        format!("{} [label={}{shape}];\n", bank.name, quoted(&times(bank.name, bank.count)))
    };
    let (memory, others): (Vec<_>, Vec<_>) = (0..diagram.banks.len()).partition(|&bank| diagram.is_memory(bank));
    for bank in others {
        text.push_str(&format!("    {}", node(bank)));
    }
    text.push_str("    subgraph cluster_memory {\n        label=\"memory\"; style=dashed;\n");
    for bank in memory {
        text.push_str(&format!("        {}", node(bank)));
    }
    text.push_str("    }\n");
    for cable in &diagram.cables {
        let (from, to) = (diagram.banks[cable.from].name, diagram.banks[cable.to].name);
        let label = quoted(&times(cable.name, cable.count));
        let sorts = if cable.sorts { ", color=\"#c05000\", penwidth=2" } else { "" };
        // What goes back in the data flow, or to memory, is not to push boxes about.
        let free = cable.from > cable.to || diagram.is_memory(cable.from) != diagram.is_memory(cable.to);
        let free = if free { ", constraint=false" } else { "" };
        let tip = quoted(&shape(&cable.link));
        text.push_str(&format!("    {from} -> {to} [label={label}, tooltip={tip}{sorts}{free}];\n"));
    }
    text.push_str("}\n");
    text
}
