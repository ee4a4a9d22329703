//! The shader cores, their texture units and constant caches.

use super::Builder;
use gfx::stage::Stage;
use sim::Link;
use unit::constant::Constant;
use unit::core::{Core, CoreConfig, CorePorts};
use unit::texture::{Texture, TextureUser};
use work::Service;

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
        let asks_constants = Link::items(config.constant.queue, 1, 1);
        let (constant_ask, constant_input) = self.chain("constant_requests", asks_constants, &id.core, &id.constant);
        let (constant_output, constant_answer) = self.chain("constant_answers", answers, &id.constant, &id.core);
        let (vertex_ask, vertex_texture_input) =
            self.chain("vertex_texture_requests", asks, &id.vertex_core, &id.vertex_texture);
        let (vertex_texture_output, vertex_answer) =
            self.chain("vertex_texture_answers", answers, &id.vertex_texture, &id.vertex_core);

        let mut constants = constant_ask.into_iter().zip(constant_answer);
        let mut vertex_ends = std::mem::take(&mut self.open.vertex);
        let fragment_ends = std::mem::take(&mut self.open.fragment);
        let compute_ends = std::mem::take(&mut self.open.compute);
        let ends = fragment_ends.into_iter().zip(compute_ends).zip(ask.into_iter().zip(answer)).enumerate();
        self.made.core = ends
            .map(|(n, ((fragment, compute), texture))| {
                let vertex = if unified { vertex_ends[n].take() } else { None };
                let stages = [(Stage::Vertex, vertex), (Stage::Fragment, Some(fragment)), (Stage::Compute, Some(compute))];
                let services = [(Service::Texture, Some(texture)), (Service::Constant, constants.next())];
                let ports = CorePorts::new(stages, services);
                Core::new(config.core.clone(), n / per_pipeline, ports)
            })
            .collect();
        let ends = texture_input.into_iter().zip(texture_output).enumerate();
        for (n, (input, output)) in ends {
            let memory = self.port("texture", n, id.texture[n]);
            let user =
                TextureUser { cluster: n / per_pipeline, number: n, vertices: false, constants: !config.constant.enabled };
            self.made.texture.push(Texture::new(config.texture.clone(), user, input, output, memory));
        }
        for (n, (input, output)) in constant_input.into_iter().zip(constant_output).enumerate() {
            let memory = self.port("constant", n, id.constant[n]);
            let unit = Constant::new(config.constant.clone(), n / per_pipeline, input, output, memory);
            self.made.constant.push(unit);
        }
        let vertex_config =
            CoreConfig { warps: config.core.vertex_warps, issue: config.core.vertex_issue, ..config.core.clone() };
        let ends = vertex_ask.into_iter().zip(vertex_answer).enumerate();
        self.made.vertex_core = ends
            .map(|(n, texture)| {
                let ports = CorePorts::new([(Stage::Vertex, vertex_ends[n].take())], [(Service::Texture, Some(texture))]);
                Core::new(vertex_config.clone(), pipelines, ports)
            })
            .collect();
        let ends = vertex_texture_input.into_iter().zip(vertex_texture_output).enumerate();
        for (n, (input, output)) in ends {
            let number = id.core.len() + n;
            let memory = self.port("texture", number, id.vertex_texture[n]);
            let user = TextureUser { cluster: pipelines, number, vertices: true, constants: true };
            self.made.vertex_texture.push(Texture::new(config.texture.clone(), user, input, output, memory));
        }
    }
}
