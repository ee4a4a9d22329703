//! The shader cores and their texture units.

use super::Builder;
use sim::Link;
use unit::core::{Core, CoreConfig, CorePorts};
use unit::texture::{Texture, TextureUser};

impl Builder<'_> {
    /// All cores, with the ends that the other stages have left for them.
    pub(super) fn cores(&mut self) {
        let (config, id) = (self.config, self.id.clone());
        let pipelines = self.pipelines();
        let per_pipeline = config.core.per_pipeline as usize;
        let unified = config.core.unified;
        let asks = Link::items(config.texture.queue, 1, 1);
        let answers = Link::items(config.core.warps.max(2), 1, 1);
        let (ask, texture_input) = self.chain("texture_requests", asks, &id.core, &id.texture);
        let (texture_output, answer) = self.chain("texture_answers", answers, &id.texture, &id.core);
        let (vertex_ask, vertex_texture_input) =
            self.chain("vertex_texture_requests", asks, &id.vertex_core, &id.vertex_texture);
        let (vertex_texture_output, vertex_answer) =
            self.chain("vertex_texture_answers", answers, &id.vertex_texture, &id.vertex_core);

        let mut vertex_ends = std::mem::take(&mut self.open.vertex);
        let fragment_ends = std::mem::take(&mut self.open.fragment);
        let compute_ends = std::mem::take(&mut self.open.compute);
        let ends = fragment_ends.into_iter().zip(compute_ends).zip(ask.into_iter().zip(answer)).enumerate();
        self.made.core = ends
            .map(|(n, ((fragment, compute), texture))| {
                let vertex = if unified { vertex_ends[n].take() } else { None };
                let ports = CorePorts { fragment: Some(fragment), vertex, compute: Some(compute), texture };
                Core::new(config.core.clone(), n / per_pipeline, ports)
            })
            .collect();
        let ends = texture_input.into_iter().zip(texture_output).enumerate();
        for (n, (input, output)) in ends {
            let memory = self.port("texture", n, id.texture[n]);
            let user = TextureUser { cluster: n / per_pipeline, number: n, vertices: false };
            self.made.texture.push(Texture::new(config.texture.clone(), user, input, output, memory));
        }
        let vertex_config =
            CoreConfig { warps: config.core.vertex_warps, issue: config.core.vertex_issue, ..config.core.clone() };
        let ends = vertex_ask.into_iter().zip(vertex_answer).enumerate();
        self.made.vertex_core = ends
            .map(|(n, texture)| {
                let ports = CorePorts { fragment: None, vertex: vertex_ends[n].take(), compute: None, texture };
                Core::new(vertex_config.clone(), pipelines, ports)
            })
            .collect();
        let ends = vertex_texture_input.into_iter().zip(vertex_texture_output).enumerate();
        for (n, (input, output)) in ends {
            let number = id.core.len() + n;
            let memory = self.port("texture", number, id.vertex_texture[n]);
            let user = TextureUser { cluster: pipelines, number, vertices: true };
            self.made.vertex_texture.push(Texture::new(config.texture.clone(), user, input, output, memory));
        }
    }
}
