//! What composition sends between pipelines with frame buffers of their own.

use anyhow::Result;

use super::Counts;
use crate::harness::{config, figure, replay, wrong_pixels};
use crate::{Row, Section, Setting, Target};
use synthetic::Scene;

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
    let counts: &[u32] = setting.pick(
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
        for &nodes in counts {
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
                let report = replay(&config("baseline", &changes)?, &given)?;
                wrong += wrong_pixels(&report)?;
                let total = &report.total;
                let of = |leaf: &str| -> Result<Vec<f64>> {
                    (0..nodes).map(|node| figure(total, &format!("composition.compose[{node}].{leaf}"))).collect()
                };
                let (n, bytes_each) = (f64::from(nodes), f64::from(8 + number));
                let all = area * (n - 1.0);
                pixels.add(all, of("pixels_sent")?.iter().sum());
                bytes.add(all * bytes_each, of("bytes_sent")?.iter().sum());
                crossed.add(all * bytes_each, figure(total, "sort.network.link_bytes")?);
                sorted.add(n * area, figure(total, "sort.redistributed_items")?);
                left.add(all, figure(total, "sort.foreign_items")?);
                if scheme != "pipeline" && nodes.is_power_of_two() {
                    of("pixels_sent")?.into_iter().for_each(|sent| a_node.add(area - area / n, sent));
                }
                if scheme == "binary-swap" && nodes.is_power_of_two() {
                    of("rounds")?.into_iter().for_each(|taken| rounds.add(f64::from(nodes.ilog2()), taken));
                }
                if scheme == "direct-send" {
                    messages.add(n * (n - 1.0), of("messages")?.iter().sum());
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
