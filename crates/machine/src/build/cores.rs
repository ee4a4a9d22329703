//! The shader cores and their texture units.

use super::Builder;
use sim::Link;
use unit::core::{Core, CoreConfig, CorePorts};
use unit::texture::Texture;

/// The cores of a machine.
pub(super) struct Cores {
    pub core: Vec<Core>,
    pub texture: Vec<Texture>,
    pub vertex_core: Vec<Core>,
    pub vertex_texture: Vec<Texture>,
}

impl Builder<'_> {
    /// All cores, with the ends that the other stages have left for them.
    pub(super) fn cores(&mut self) -> Cores {
        let config = self.config;
        let pipelines = self.pipelines();
        let per_pipeline = config.core.per_pipeline as usize;
        let unified = config.core.unified;
        let (core, texture) = (self.id.core.clone(), self.id.texture.clone());
        let (vertex_core, vertex_texture) = (self.id.vertex_core.clone(), self.id.vertex_texture.clone());
        let asks = Link::items(config.texture.queue, 1, 1);
        let answers = Link::items(config.core.warps.max(2), 1, 1);
        let (ask, texture_input) = self.chain("texture_requests", asks, &core, &texture);
        let (texture_output, answer) = self.chain("texture_answers", answers, &texture, &core);
        let (vertex_ask, vertex_texture_input) = self.chain("vertex_texture_requests", asks, &vertex_core, &vertex_texture);
        let (vertex_texture_output, vertex_answer) =
            self.chain("vertex_texture_answers", answers, &vertex_texture, &vertex_core);

        let mut vertex_ends = std::mem::take(&mut self.made.vertex_ends);
        let fragment_ends = std::mem::take(&mut self.made.fragment_ends);
        let compute_ends = std::mem::take(&mut self.made.compute_ends);
        let ends = fragment_ends.into_iter().zip(compute_ends).zip(ask.into_iter().zip(answer)).enumerate();
        let cores = ends
            .map(|(n, ((fragment, compute), texture))| {
                let vertex = if unified { vertex_ends[n].take() } else { None };
                let ports = CorePorts { fragment: Some(fragment), vertex, compute: Some(compute), texture };
                Core::new(config.core.clone(), n / per_pipeline, ports)
            })
            .collect();
        let ends = texture_input.into_iter().zip(texture_output).enumerate();
        let textures = ends
            .map(|(n, (input, output))| {
                let memory = self.port("texture", n, texture[n]);
                Texture::new(config.texture.clone(), n / per_pipeline, input, output, memory)
            })
            .collect();
        let vertex_config =
            CoreConfig { warps: config.core.vertex_warps, issue: config.core.vertex_issue, ..config.core.clone() };
        let ends = vertex_ask.into_iter().zip(vertex_answer).enumerate();
        let vertex_cores = ends
            .map(|(n, texture)| {
                let ports = CorePorts { fragment: None, vertex: vertex_ends[n].take(), compute: None, texture };
                Core::new(vertex_config.clone(), pipelines, ports)
            })
            .collect();
        let ends = vertex_texture_input.into_iter().zip(vertex_texture_output).enumerate();
        let vertex_textures = ends
            .map(|(n, (input, output))| {
                let memory = self.port("texture", core.len() + n, vertex_texture[n]);
                Texture::new(config.texture.clone(), pipelines, input, output, memory)
            })
            .collect();
        Cores { core: cores, texture: textures, vertex_core: vertex_cores, vertex_texture: vertex_textures }
    }
}
