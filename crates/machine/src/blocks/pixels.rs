//! From triangles that are set up to pixels in memory.

use super::{Both, Builder, CONTROL, Ends, quads};
use sim::{In, Link, Out, StallProbe};
use unit::block_cache::BlockCache;
use unit::color::ColorPorts;
use unit::compression::Compression;
use unit::depth::{Depth, DepthConfig, DepthPorts, QuestionPorts, TestPorts};
use unit::dispatch::{Dispatch, DispatchPorts, Outlet};
use unit::early::{DepthSource, Early, EarlyRate};
use unit::hide::Hide;
use unit::interpolate::Interpolate;
use unit::order::Order;
use unit::sorting::EarlyTest;
use unit::token::{Ack, GroupToken, TriangleToken, WarpToken};
use unit::traverse::{Territory, Traverse, TraverseConfig};
use work::BLOCK;

impl Builder<'_> {
    /// Pipelines that own what they draw, from traversal to the colour buffer: early and late tests share a depth unit.
    pub fn pipelines_with_early_tests(&mut self, mut inputs: Ends<In<TriangleToken>>, territory: Territory) {
        let (config, id) = (self.config, self.id.clone());
        // A tile's buffer on the chip has a place for each of its blocks, wherever it lies.
        let on_chip = matches!(territory, Territory::Bins(_));
        let depth_ways = if on_chip { config.depth.cache_blocks } else { config.depth.cache_ways };
        self.open.color_ways = if on_chip { config.color.cache_blocks } else { config.color.cache_ways };
        let (t, d) = (&config.traverse, &DepthConfig { cache_ways: depth_ways, ..config.depth.clone() });
        let tested = quads(d.output_queue, d.quads_per_cycle, d.output_latency);
        let updates = Link::items(t.hierarchical_queue, 1, t.hierarchical_latency);
        let (mut to_depth, mut early) = self.chain("rasterized", rasterized(t), &id.traverse, &id.depth);
        let (mut to_traverse, mut bounds) = self.chain("depth_bounds", updates, &id.depth, &id.traverse);
        let (mut to_interpolate, interpolated) = self.chain("tested_early", tested, &id.depth, &id.interpolate);
        let (rate, side) = (d.quads_per_cycle, config.bin.tile / BLOCK);
        let interpolated = self.splice(&id.hide, "seen", tested, interpolated, |made, n, input, output| {
            made.hide.push(Hide::new(n as u8, side, rate, input, output));
        });
        let (mut to_late, mut late) = self.chain("to_late_test", self.to_rop(), &id.dispatch, &id.depth);
        let (mut to_color, shaded) = self.chain("shaded", self.to_rop(), &id.dispatch, &id.color);
        let (mut tested_late, color_tested) = self.chain("tested_late", tested, &id.depth, &id.color);
        let (end, mut ended) = self.chain("pass_ends", CONTROL, &id.color, &id.depth);

        for n in 0..id.traverse.len() {
            let unit = Traverse::new(t.clone(), n as u8, territory, inputs.take(n), Some(bounds.take(n)), to_depth.take(n));
            let gathers = t.gather;
            self.made.traverse.push(if gathers {
                unit.gathering(config.distribute.overlap, config.card.pipelines as usize)
            } else {
                unit
            });
        }
        let mut acks = std::mem::take(&mut self.open.depth_acks);
        for n in 0..id.depth.len() {
            let ports = DepthPorts {
                early: Some(TestPorts { input: early.take(n), output: to_interpolate.take(n) }),
                late: Some(TestPorts { input: late.take(n), output: tested_late.take(n) }),
                questions: None,
                updates: Some((to_traverse.take(n), t.hierarchical_update)),
                end: ended.take(n),
                ack: acks.take(n),
            };
            let memory = self.rop_port("depth", n, id.depth[n]);
            self.made.depth.push(Depth::new(d.clone(), n as u8, ports, memory));
        }
        let outlets = (0..id.dispatch.len()).map(|n| Outlet::Own { late: to_late.take(n), color: to_color.take(n) });
        self.shade(interpolated, outlets.collect());
        self.colors(shaded, color_tested, end);
    }

    /// Pipelines that draw anywhere and send what they have shaded to the ROPs that own the pixels, where it is tested and blended
    /// in order.
    pub fn pipelines_sorting_fragments(&mut self, mut inputs: Ends<In<TriangleToken>>) {
        let (config, id) = (self.config, self.id.clone());
        let (t, d) = (&config.traverse, &config.depth);
        let tested = quads(d.output_queue, d.quads_per_cycle, d.output_latency);
        let link = rasterized(t);
        let (mut from_traverse, rasterized, questions) = if id.early.is_empty() {
            let (outputs, rasterized) = self.chain("rasterized", link, &id.traverse, &id.interpolate);
            (outputs, rasterized, Vec::new())
        } else {
            let (outputs, inputs) = self.chain("rasterized", link, &id.traverse, &id.early);
            let (tested, rasterized) = self.chain("tested_early", tested, &id.early, &id.interpolate);
            (outputs, rasterized, self.early_tests(inputs, tested))
        };
        let (mut to_late, mut late) = self.chain("to_late_test", self.to_rop(), &id.order, &id.depth);
        let (mut to_color, shaded) = self.chain("shaded", self.to_rop(), &id.order, &id.color);
        let (mut tested_late, color_tested) = self.chain("tested_late", tested, &id.depth, &id.color);
        let (end, mut ended) = self.chain("pass_ends", CONTROL, &id.color, &id.depth);
        let (senders, receivers) = self.sort_network(&id.dispatch, &id.order);
        self.open.color_ways = config.color.cache_ways;

        // Hierarchical Z would have to know what other pipelines have drawn.
        let blind = TraverseConfig { hierarchical_z: false, ..t.clone() };
        for n in 0..id.traverse.len() {
            let (input, output) = (inputs.take(n), from_traverse.take(n));
            self.made.traverse.push(Traverse::new(blind.clone(), n as u8, Territory::Screen, input, None, output));
        }
        self.shade(rasterized, senders.into_iter().map(Outlet::Owners).collect());
        let rate = config.dispatch.output_quads;
        for (n, input) in receivers.into_iter().enumerate() {
            let probe = self.probe(n, false, true);
            let (late, color) = (to_late.take(n), to_color.take(n));
            self.made.order.push(Order::new(n as u8, rate, config.order.keep, probe, input, late, color));
        }
        let mut acks = std::mem::take(&mut self.open.depth_acks);
        let mut questions = questions.into_iter();
        for n in 0..id.depth.len() {
            let ports = DepthPorts {
                early: None,
                late: Some(TestPorts { input: late.take(n), output: tested_late.take(n) }),
                questions: questions.next(),
                updates: None,
                end: ended.take(n),
                ack: acks.take(n),
            };
            let memory = self.rop_port("depth", n, id.depth[n]);
            self.made.depth.push(Depth::new(d.clone(), n as u8, ports, memory));
        }
        self.colors(shaded, color_tested, end);
    }

    /// Early tests of quads whose pixels have other owners; gives for each of these the ways of questions, if they are asked.
    fn early_tests(&mut self, mut inputs: Ends<In<GroupToken>>, mut outputs: Ends<Out<GroupToken>>) -> Vec<QuestionPorts> {
        let (o, d) = (&self.config.order, &self.config.depth);
        let id = self.id.clone();
        let rate = EarlyRate { quads_per_cycle: d.quads_per_cycle, queue: o.early_queue, latency: d.latency };
        let (known, ports) = if o.early == EarlyTest::Remote {
            // A way holds what is on it, and a little that waits at its end.
            let link = Link::bytes(o.early_queue.min(o.early_latency + 8), o.early_bytes, o.early_latency);
            let pairs: Vec<_> = id.early.iter().flat_map(|&early| id.depth.iter().map(move |&depth| (early, depth))).collect();
            let back: Vec<_> = id.depth.iter().flat_map(|&depth| id.early.iter().map(move |&early| (depth, early))).collect();
            let (ask, questions) = self.join("depth_questions", link, pairs);
            let (answer, answers) = self.join("depth_answers", link, back);
            let known = by_first(ask.all(), id.early.len()).zip(by_second(answers.all(), id.early.len()));
            let known: Vec<_> = known.map(|(questions, answers)| DepthSource::Owners { questions, answers }).collect();
            let ports = by_second(questions.all(), id.depth.len()).zip(by_first(answer.all(), id.depth.len()));
            (known, ports.map(|(questions, answers)| QuestionPorts { questions, answers }).collect())
        } else {
            let copy = |n: usize| {
                let compression = Compression { enabled: d.compression, codec: d.codec, again: d.recompress };
                let memory = self.port("early", n, id.early[n]);
                DepthSource::Copy(Box::new(BlockCache::new(d.cache_blocks, d.cache_ways, d.misses, compression, memory)))
            };
            ((0..id.early.len()).map(copy).collect(), Vec::new())
        };
        for (n, known) in known.into_iter().enumerate() {
            self.made.early.push(Early::new(n as u8, rate, inputs.take(n), outputs.take(n), known));
        }
        ports
    }

    /// Interpolation and dispatch to the cores.
    fn shade(&mut self, mut inputs: Ends<In<GroupToken>>, outputs: Vec<Outlet>) {
        let (config, id) = (self.config, self.id.clone());
        let (i, p) = (&config.interpolate, &config.dispatch);
        let per_pipeline = config.core.per_pipeline as usize;
        let (mut to_dispatch, mut interpolated) =
            self.chain("interpolated", quads(i.queue, i.quads_per_cycle, i.latency), &id.interpolate, &id.dispatch);
        for n in 0..id.interpolate.len() {
            self.made.interpolate.push(Interpolate::new(i.clone(), inputs.take(n), to_dispatch.take(n)));
        }

        let warps = Link::items(p.queue, 1, p.latency);
        let done = Link::items(config.core.output_queue, 1, 1);
        let of_core: Vec<_> = id.core.iter().enumerate().map(|(n, &core)| (id.dispatch[n / per_pipeline], core)).collect();
        let back: Vec<_> = of_core.iter().map(|&(dispatch, core)| (core, dispatch)).collect();
        let (mut to_cores, fragment_input): Both<WarpToken> = self.join("fragment_warps", warps, of_core);
        let (fragment_output, mut from_cores): Both<WarpToken> = self.join("fragments_shaded", done, back);
        self.open.fragment = (fragment_input, fragment_output);
        let mut begun = std::mem::take(&mut self.open.begun);
        for (n, output) in outputs.into_iter().enumerate() {
            let own = n * per_pipeline..(n + 1) * per_pipeline;
            let (cores, shaded) = (to_cores.take_all(own.clone()), from_cores.take_all(own));
            let probe = if matches!(output, Outlet::Owners(_)) { self.probe(n, true, false) } else { StallProbe::default() };
            let (input, begun) = (interpolated.take(n), begun.take_if_any(n));
            let ports = DispatchPorts { input, cores, shaded, output, begun, probe };
            self.made.dispatch.push(Dispatch::new(p.clone(), n as u8, config.core.warp_width, ports));
        }
    }

    /// What comes to the colour units, from shading or from late tests, and the end of passes that they report.
    fn colors(&mut self, mut shaded: Ends<In<GroupToken>>, mut tested: Ends<In<GroupToken>>, mut ends: Ends<Out<Ack>>) {
        let mut acks = std::mem::take(&mut self.open.color_acks);
        let ports = |n| ColorPorts { shaded: shaded.take(n), tested: tested.take(n), end: ends.take(n), ack: acks.take(n) };
        self.open.color = (0..self.id.color.len()).map(ports).collect();
    }
}

/// The link behind traversal.
fn rasterized(config: &TraverseConfig) -> Link {
    quads(config.queue, config.quads_per_cycle.max(config.depth_quads_per_cycle), config.latency)
}

/// Of the ends of a square of ways, row after row, each row.
fn by_first<T>(ends: Vec<T>, count: usize) -> impl Iterator<Item = Vec<T>> {
    let mut ends = ends.into_iter();
    (0..count).map(move |_| ends.by_ref().take(count).collect())
}

/// Of the ends of a square of ways, row after row, each column.
fn by_second<T>(ends: Vec<T>, count: usize) -> impl Iterator<Item = Vec<T>> {
    let mut columns: Vec<Vec<T>> = (0..count).map(|_| Vec::with_capacity(count)).collect();
    ends.into_iter().enumerate().for_each(|(n, end)| columns[n % count].push(end));
    columns.into_iter()
}
