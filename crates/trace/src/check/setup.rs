//! Rules of the setup of a trace that was cut out of a longer one.

use super::*;

impl Checker<'_> {
    pub(super) fn begin_setup(&mut self) -> CheckResult {
        ensure!(self.next == 1, "a setup begins a trace");
        self.setup = true;
        Ok(())
    }

    /// Refuses what is not allowed inside a setup.
    pub(super) fn inside_setup(&self, command: &Command) -> CheckResult {
        use Command::*;
        let restores = matches!(
            command,
            Destroy(_)
                | WriteBuffer { .. }
                | SetSprite { .. }
                | PushDebugGroup(_)
                | SetCallSite(_)
                | SkipAddresses { .. }
                | RestoreTexture { .. }
                | RestoreQueries { .. }
                | EndSetup { .. }
        );
        let in_bundle = matches!(self.scope, Scope::Bundle(_));
        ensure!(restores || in_bundle || command.creates().is_some(), "not allowed inside a setup");
        Ok(())
    }

    pub(super) fn setup(&mut self, command: &Command) -> CheckResult {
        ensure!(self.setup, "only allowed inside a setup");
        if let Some(open) = self.scope.name() {
            return Err(format!("not allowed inside a {open}").into());
        }
        match command {
            Command::RestoreTexture { texture, level, layer, data } => {
                self.use_data(data)?;
                let desc = self.textures.get(texture.0)?;
                ensure!(*level < desc.levels, "level {level} is not in the {} of {texture}", desc.levels);
                let [width, height, layers] = desc.level_size(*level);
                ensure!(*layer < layers, "layer {layer} is not in the {layers} of level {level} of {texture}");
                let dim = desc.format.block_dim();
                let blocks = u64::from(width.div_ceil(dim)) * u64::from(height.div_ceil(dim));
                let bytes = blocks * u64::from(desc.format.block_bytes()) * u64::from(desc.samples);
                ensure!(data.size == bytes, "{} bytes for an image of {bytes}", data.size);
                self.summary.written_bytes += data.size;
            }
            Command::RestoreQueries { set, data } => {
                self.use_data(data)?;
                let (kind, count) = *self.query_sets.get(set.0)?;
                let bytes = 8 * u64::from(count) * u64::from(kind.results());
                ensure!(data.size == bytes, "{} bytes for {bytes} of results", data.size);
            }
            Command::EndSetup { .. } => self.setup = false,
            _ => {}
        }
        Ok(())
    }
}
