//! From triangles that are set up to pixels in memory.

use super::{Builder, CONTROL, Ends, Shaded, quads};
use crate::sim::{In, Link, Out};
use crate::unit::color::ColorPorts;
use crate::unit::depth::{Depth, DepthPorts, TestPorts};
use crate::unit::dispatch::{Dispatch, DispatchPorts};
use crate::unit::interpolate::Interpolate;
use crate::unit::token::{Ack, GroupToken, TriangleToken, WarpToken};
use crate::unit::traverse::{Territory, Traverse};

impl Builder<'_> {
    /// Pipelines that own what they draw, from traversal to the colour buffer: early and late tests share a depth unit.
    pub fn pipelines_with_early_tests(&mut self, inputs: Vec<In<TriangleToken>>) {
        let config = self.config;
        let (t, d) = (&config.traverse, &config.depth);
        let (traverse, depth, interpolate) = (self.id.traverse.clone(), self.id.depth.clone(), self.id.interpolate.clone());
        let (color, dispatch) = (self.id.color.clone(), self.id.dispatch.clone());
        let tested = quads(d.output_queue, d.quads_per_cycle, d.output_latency);
        let updates = Link::items(t.hierarchical_queue, 1, t.hierarchical_latency);
        let (to_depth, early) = self.chain("rasterized", quads(t.queue, t.quads_per_cycle, t.latency), &traverse, &depth);
        let (to_traverse, bounds) = self.chain("depth_bounds", updates, &depth, &traverse);
        let (to_interpolate, interpolated) = self.chain("tested_early", tested, &depth, &interpolate);
        let (to_late, late) = self.chain("to_late_test", self.to_rop(), &dispatch, &depth);
        let (to_color, shaded) = self.chain("shaded", self.to_rop(), &dispatch, &color);
        let (tested_late, color_tested) = self.chain("tested_late", tested, &depth, &color);
        let (end, ended) = self.chain("pass_ends", CONTROL, &color, &depth);

        let traverses = inputs.into_iter().zip(bounds).zip(to_depth).enumerate();
        self.made.traverse = traverses
            .map(|(n, ((input, bounds), output))| {
                Traverse::new(t.clone(), n as u8, Territory::Tiles, input, Some(bounds), output)
            })
            .collect();
        let acks = std::mem::take(&mut self.made.depth_acks);
        let ends = early.into_iter().zip(to_interpolate).zip(late).zip(tested_late).zip(to_traverse).zip(ended).zip(acks);
        for (n, ((((((early, interpolate), late), color), bounds), end), ack)) in ends.enumerate() {
            let ports = DepthPorts {
                early: Some(TestPorts { input: early, output: interpolate }),
                late: Some(TestPorts { input: late, output: color }),
                updates: Some((bounds, t.hierarchical_update)),
                end,
                ack,
            };
            let memory = self.port("depth", n, depth[n]);
            self.made.depth.push(Depth::new(d.clone(), n as u8, ports, memory));
        }
        self.shade(interpolated, to_late.into_iter().zip(to_color).collect());
        let inputs = shaded.into_iter().zip(color_tested).map(|(color, late)| Shaded { late, color }).collect();
        self.colors(inputs, end);
    }

    /// Interpolation and dispatch to the cores.
    fn shade(&mut self, inputs: Vec<In<GroupToken>>, outputs: Vec<(Out<GroupToken>, Out<GroupToken>)>) {
        let config = self.config;
        let (i, p) = (&config.interpolate, &config.dispatch);
        let per_pipeline = config.core.per_pipeline as usize;
        let (interpolate, dispatch, core) = (self.id.interpolate.clone(), self.id.dispatch.clone(), self.id.core.clone());
        let (to_dispatch, interpolated) =
            self.chain("interpolated", quads(i.queue, i.quads_per_cycle, i.latency), &interpolate, &dispatch);
        let units = inputs.into_iter().zip(to_dispatch);
        self.made.interpolate = units.map(|(input, output)| Interpolate::new(i.clone(), input, output)).collect();

        let warps = Link::items(p.queue, 1, p.latency);
        let done = Link::items(config.core.output_queue, 1, 1);
        let of_core: Vec<_> = core.iter().enumerate().map(|(n, &core)| (dispatch[n / per_pipeline], core)).collect();
        let back: Vec<_> = of_core.iter().map(|&(dispatch, core)| (core, dispatch)).collect();
        let (to_cores, fragment_input): Ends<WarpToken> = self.join("fragment_warps", warps, of_core);
        let (fragment_output, from_cores): Ends<WarpToken> = self.join("fragments_shaded", done, back);
        self.made.fragment_ends = fragment_input.into_iter().zip(fragment_output).collect();
        let (mut to_cores, mut from_cores) = (to_cores.into_iter(), from_cores.into_iter());
        for (n, (input, (late, color))) in interpolated.into_iter().zip(outputs).enumerate() {
            let cores = to_cores.by_ref().take(per_pipeline).collect();
            let shaded = from_cores.by_ref().take(per_pipeline).collect();
            let ports = DispatchPorts { input, cores, shaded, late, color };
            self.made.dispatch.push(Dispatch::new(p.clone(), n as u8, config.core.warp_width, ports));
        }
    }

    /// What comes to the colour units, and the end of passes that they report.
    fn colors(&mut self, inputs: Vec<Shaded>, ends: Vec<Out<Ack>>) {
        let acks = std::mem::take(&mut self.made.color_acks);
        let ends = inputs.into_iter().zip(ends).zip(acks);
        let ports = ends.map(|((shaded, end), ack)| ColorPorts { shaded: shaded.color, tested: shaded.late, end, ack });
        self.made.color_ends = ports.collect();
    }
}
