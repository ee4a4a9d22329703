//! The shader cores, their texture units and constant caches.

use super::Builder;
use gfx::stage::Stage;
use sim::Link;
use unit::constant::Constant;
use unit::core::{Core, CorePorts};
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
        let (mut ask, mut texture_input) = self.chain("texture_requests", asks, &id.core, &id.texture);
        let (mut texture_output, mut answer) = self.chain("texture_answers", answers, &id.texture, &id.core);
        let asks_constants = Link::items(config.constant.queue, 1, 1);
        let asking: &[_] = if id.constant.is_empty() { &[] } else { &id.core };
        let (mut constant_ask, mut constant_input) = self.chain("constant_requests", asks_constants, asking, &id.constant);
        let (mut constant_output, mut constant_answer) = self.chain("constant_answers", answers, &id.constant, asking);
        let (mut vertex_ask, mut vertex_texture_input) =
            self.chain("vertex_texture_requests", asks, &id.vertex_core, &id.vertex_texture);
        let (mut vertex_texture_output, mut vertex_answer) =
            self.chain("vertex_texture_answers", answers, &id.vertex_texture, &id.vertex_core);

        let (mut vertex, mut vertex_done) = std::mem::take(&mut self.open.vertex);
        let (mut fragment, mut fragment_done) = std::mem::take(&mut self.open.fragment);
        let (mut compute, mut compute_done) = std::mem::take(&mut self.open.compute);
        for n in 0..id.core.len() {
            let stages = [
                (Stage::Vertex, unified.then(|| (vertex.take(n), vertex_done.take(n)))),
                (Stage::Fragment, Some((fragment.take(n), fragment_done.take(n)))),
                (Stage::Compute, Some((compute.take(n), compute_done.take(n)))),
            ];
            let services = [
                (Service::Texture, Some((ask.take(n), answer.take(n)))),
                (Service::Constant, constant_ask.take_if_any(n).zip(constant_answer.take_if_any(n))),
            ];
            self.made.core.push(Core::new(config.core.clone(), n / per_pipeline, CorePorts::new(stages, services)));
        }
        for n in 0..id.texture.len() {
            let (input, output) = (texture_input.take(n), texture_output.take(n));
            let memory = self.port("texture", n, id.texture[n]);
            let user =
                TextureUser { cluster: n / per_pipeline, number: n, vertices: false, constants: !config.constant.enabled };
            self.made.texture.push(Texture::new(config.texture.clone(), user, input, output, memory));
        }
        for n in 0..id.constant.len() {
            let (input, output) = (constant_input.take(n), constant_output.take(n));
            let memory = self.port("constant", n, id.constant[n]);
            let unit = Constant::new(config.constant.clone(), n / per_pipeline, input, output, memory);
            self.made.constant.push(unit);
        }
        let vertex_config = config.core.of_vertices();
        for n in 0..id.vertex_core.len() {
            let stages = [(Stage::Vertex, Some((vertex.take(n), vertex_done.take(n))))];
            let services = [(Service::Texture, Some((vertex_ask.take(n), vertex_answer.take(n))))];
            self.made.vertex_core.push(Core::new(vertex_config.clone(), pipelines, CorePorts::new(stages, services)));
        }
        for n in 0..id.vertex_texture.len() {
            let (input, output) = (vertex_texture_input.take(n), vertex_texture_output.take(n));
            let number = id.core.len() + n;
            let memory = self.port("texture", number, id.vertex_texture[n]);
            let user = TextureUser { cluster: pipelines, number, vertices: true, constants: true };
            self.made.vertex_texture.push(Texture::new(config.texture.clone(), user, input, output, memory));
        }
    }
}
