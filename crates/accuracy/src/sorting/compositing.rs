//! What composition sends between pipelines with frame buffers of their own.

use anyhow::{Context, Result};

use super::Counts;
use crate::harness::{config, counts, each, replay, wrong_pixels};
use crate::{Row, Section, Setting, Target};
use machine::{SORTING, SortOutcome};
use synthetic::Scene;
use unit::compose::{COMPOSITION, ComposeCounts};
use unit::sorting::SortCounts;

pub(super) const COMPOSITING: Target = Target {
    id: "compositing",
    section: Section::Sorting,
    what: "N pipelines with frame buffers of A pixels send A(N - 1) in all, whatever the scheme; binary swap in log2 N rounds and \
           A(1 - 1/N) a node, direct send in N(N - 1) messages of A/N; sort-last full sorts N x pixels, of which (N - 1)/N leave",
    bound: "exact; the picture is that of API order",
    fault: "the machine's frame is eight pixels narrower",
    check,
};

fn check(setting: &Setting) -> Result<Vec<Row>> {
    let numbers: &[u32] = setting.pick(
        &[2, 4, 5, 16],
        &[2, 3, 4, 5, 7, 8, 13, 16, 32, 33, 64],
        &[2, 3, 4, 5, 6, 7, 8, 9, 11, 13, 16, 17, 21, 27, 32, 33, 48, 57, 64],
    );
    let (width, height) = setting.pick((128, 64), (256, 128), (512, 256));
    let scene =
        Scene { width, height, triangles: 12, draws: 1, size: 30.0, textures: 0, seed: setting.seed, ..Scene::default() };
    let area = f64::from(width * height);
    let given = Scene { width: if setting.inject_fault { width - 8 } else { width }, ..scene };
    let mut rows = Vec::new();
    for scheme in ["binary-swap", "direct-send", "pipeline"] {
        let [mut pixels, mut bytes, mut crossed, mut sorted, mut left] = [(); 5].map(|()| Counts::default());
        let [mut rounds, mut a_node, mut messages] = [(); 3].map(|()| Counts::default());
        let mut wrong = 0;
        for &nodes in numbers {
            // A pixel is a colour and a depth, and where asked for the number of its primitive.
            let numbers: &[u32] = if nodes <= 5 { &[0, 4] } else { &[0] };
            for &number in numbers {
                let changes = [
                    "sort=sort-last-image",
                    "memory.kind=ideal",
                    "network.topology=point-to-point",
                    &format!("pipelines={nodes}"),
                    &format!("compose.scheme={scheme}"),
                    &format!("compose.number_bytes={number}"),
                ];
                let report = replay(&config("four-pipelines", &changes)?, &given)?;
                wrong += wrong_pixels(&report)?;
                let total = &report.total;
                let of_nodes: Vec<ComposeCounts> = each(total, COMPOSITION)?;
                let composed: ComposeCounts = of_nodes.iter().copied().sum();
                let sorting: SortCounts = counts(total, SORTING)?;
                let network = SortOutcome::network(total).context("the machine has no network that sorts")?;
                let (n, bytes_each) = (f64::from(nodes), f64::from(8 + number));
                let all = area * (n - 1.0);
                pixels.add(all, composed.pixels_sent as f64);
                bytes.add(all * bytes_each, composed.bytes_sent as f64);
                crossed.add(all * bytes_each, network.carried.link_bytes as f64);
                sorted.add(n * area, sorting.redistributed_items as f64);
                left.add(all, sorting.foreign_items as f64);
                if scheme != "pipeline" && nodes.is_power_of_two() {
                    of_nodes.iter().for_each(|node| a_node.add(area - area / n, node.pixels_sent as f64));
                }
                if scheme == "binary-swap" && nodes.is_power_of_two() {
                    of_nodes.iter().for_each(|node| rounds.add(f64::from(nodes.ilog2()), node.rounds as f64));
                }
                if scheme == "direct-send" {
                    messages.add(n * (n - 1.0), composed.messages as f64);
                }
            }
        }
        rows.push(pixels.row(format!("{scheme}: pixels sent, all N")));
        rows.push(bytes.row(format!("{scheme}: bytes sent, all N")));
        rows.push(crossed.row(format!("{scheme}: bytes that crossed the network, all N")));
        rows.push(sorted.row(format!("{scheme}: pixels sorted, all N")));
        rows.push(left.row(format!("{scheme}: of them those that left, all N")));
        if scheme != "pipeline" {
            rows.push(a_node.row(format!("{scheme}: pixels sent by every node, N = 2^k")));
        }
        if scheme == "binary-swap" {
            rows.push(rounds.row("binary-swap: rounds of every node, N = 2^k"));
        }
        if scheme == "direct-send" {
            rows.push(messages.row("direct-send: messages, all N"));
        }
        rows.push(Row::none(format!("{scheme}: pixels not those of API order"), wrong));
    }
    Ok(rows)
}
