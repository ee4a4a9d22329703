//! From the pipelines' frame buffers to one.

use super::Builder;
use unit::compose::{Compose, ComposePorts};

impl Builder<'_> {
    /// Composition in each pipeline, over the network that sorts.
    pub fn compose(&mut self) {
        let id = self.id.clone();
        let nodes = id.compose.len();
        let (senders, receivers) = self.sort_network(&id.compose, &id.compose);
        let (mut start, mut done) = std::mem::take(&mut self.open.compose);
        for (node, (sender, receiver)) in senders.into_iter().zip(receivers).enumerate() {
            let memory = self.port("compose", node, id.compose[node]);
            let ports = ComposePorts { start: start.take(node), done: done.take(node), sender, receiver, memory };
            self.made.compose.push(Compose::new(self.config.compose.clone(), node, nodes, ports));
        }
    }
}
