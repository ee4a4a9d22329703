//! Commands that move bytes: uploads, copies, clears, results of queries.

use std::sync::Arc;

use num::Words;
use trace::command::*;
use work::{Event, Transfer, TransferKind};

use super::execute::Renderer;
use super::fault::Fault;
use super::resources::View;
use super::state::StateError;
use super::transfer::{Region, clear_image, layers_of};

impl Renderer<'_, '_> {
    /// Counts bytes that are about to be moved; whether those of them that wait between reading and writing find room.
    fn moves(&mut self, bytes: u64, waiting: u64) -> Result<(), Fault> {
        self.ledger.bytes.charge(bytes)?;
        Ok(self.ledger.passing("a copy", waiting)?)
    }

    pub(super) fn transfer(&mut self, command: &Command) -> Result<(), Fault> {
        let mut moved =
            Transfer { kind: TransferKind::Copy, from: None, to: None, bytes: 0, reads: None, writes: None, surfaces: None };
        match command {
            &Command::WriteBuffer { id, offset, ref data } => {
                let bytes = self.trace.data(data)?;
                self.res.buffers.get(id.0)?.range(id, offset, Some(bytes.len() as u64))?;
                self.moves(bytes.len() as u64, 0)?;
                let buffer = self.res.buffers.get_mut(id.0)?;
                buffer.words.write(offset, &bytes);
                buffer.changed();
                moved = Transfer {
                    kind: TransferKind::Upload,
                    to: Some(buffer.address + offset),
                    bytes: bytes.len() as u64,
                    writes: Some(buffer.extent()),
                    ..moved
                };
            }
            Command::WriteTexture { to, data, layout, size } => {
                let bytes = self.trace.data(data)?;
                let (region, words, address) = self.texture_end(to, *size, true)?;
                self.moves(region.bytes(), 0)?;
                region.write_from(&words, &bytes, layout)?;
                let writes = Some(self.res.textures.get(to.texture.0)?.extent());
                moved = Transfer { kind: TransferKind::Upload, to: Some(address), bytes: region.bytes(), writes, ..moved };
            }
            &Command::CopyBufferToBuffer { from, from_offset, to, to_offset, size } => {
                self.res.buffers.get(from.0)?.range(from, from_offset, Some(size))?;
                self.res.buffers.get(to.0)?.range(to, to_offset, Some(size))?;
                self.moves(size, size)?;
                let mut bytes = vec![0; size as usize];
                let source = self.res.buffers.get(from.0)?;
                source.words.read(from_offset, &mut bytes);
                moved.from = Some(source.address + from_offset);
                moved.reads = Some(source.extent());
                let target = self.res.buffers.get_mut(to.0)?;
                target.words.write(to_offset, &bytes);
                target.changed();
                moved.to = Some(target.address + to_offset);
                moved.writes = Some(target.extent());
                moved.bytes = size;
            }
            Command::CopyBufferToTexture { from, layout, to, size } => {
                let source = self.res.buffers.get(from.0)?;
                moved.reads = Some(source.extent());
                let (source, address) = (source.words.clone(), source.address);
                let (region, words, to_address) = self.texture_end(to, *size, true)?;
                self.moves(region.bytes(), 0)?;
                region.write_from_buffer(&words, &source, layout)?;
                moved.from = Some(address + layout.offset);
                moved.to = Some(to_address);
                moved.writes = Some(self.res.textures.get(to.texture.0)?.extent());
                moved.bytes = region.bytes();
            }
            Command::CopyTextureToBuffer { from, to, layout, size } => {
                let (region, words, address) = self.texture_end(from, *size, false)?;
                self.res.buffers.get(to.0)?;
                self.moves(region.bytes(), 0)?;
                let target = self.res.buffers.get_mut(to.0)?;
                region.read_to_buffer(&words, &target.words, layout)?;
                target.changed();
                moved.from = Some(address);
                moved.to = Some(target.address + layout.offset);
                moved.writes = Some(target.extent());
                moved.reads = Some(self.res.textures.get(from.texture.0)?.extent());
                moved.bytes = region.bytes();
                self.copied = Some((from.texture, from.level, from.origin[2]));
            }
            Command::CopyTextureToTexture { from, to, size } => self.copy_texture(from, to, *size, &mut moved)?,
            &Command::ClearBuffer { buffer: id, offset, size } => {
                let (offset, size) = self.res.buffers.get(id.0)?.range(id, offset, size)?;
                self.moves(size, 0)?;
                let buffer = self.res.buffers.get_mut(id.0)?;
                fill_zero(&buffer.words, offset, size);
                buffer.changed();
                moved = Transfer {
                    kind: TransferKind::Clear,
                    to: Some(buffer.address + offset),
                    bytes: size,
                    writes: Some(buffer.extent()),
                    ..moved
                };
            }
            &Command::ClearTexture { texture: id, aspect, base_level, levels, base_layer, layers } => {
                let image = self.res.textures.get(id.0)?.image;
                let view = ViewDesc { base_level, levels, base_layer, layers, ..ViewDesc::default() };
                let view = View::new(id, &image, &view)?;
                for level in base_level..base_level + view.range.levels {
                    let layers = layers_of(&image, level, base_layer, view.range.layers).len() as u64;
                    self.moves(layers * image.layer_bytes(level), 0)?;
                }
                self.res.flushed(id)?;
                for level in base_level..base_level + view.range.levels {
                    for layer in layers_of(&image, level, base_layer, view.range.layers) {
                        clear_image(&image, &self.res.textures.get(id.0)?.words, level, layer, aspect);
                        self.res.overwritten(id, level, layer)?;
                        moved.bytes += image.layer_bytes(level);
                    }
                }
                moved.kind = TransferKind::Clear;
                let texture = self.res.textures.get(id.0)?;
                (moved.to, moved.writes) = (Some(texture.address), Some(texture.extent()));
            }
            &Command::WriteTimestamp { set, index } => return self.write_timestamp(set, index),
            &Command::ResolveQuerySet { set: id, first, count, to, to_offset } => {
                self.res.buffers.get(to.0)?;
                let set = self.res.query_sets.get_mut(id.0)?;
                let size = u64::from(count) * set.stride() as u64 * 8;
                self.ledger.bytes.charge(size)?;
                let target = self.res.buffers.get_mut(to.0)?;
                target.range(to, to_offset, Some(size))?;
                target.changed();
                let (words, address, writes) = (target.words.clone(), target.address, Some(target.extent()));
                for index in first..first.saturating_add(count) {
                    let at = to_offset + u64::from(index - first) * set.stride() as u64 * 8;
                    for (k, value) in set.slot(index)?.iter().enumerate() {
                        words.write(at + k as u64 * 8, &value.to_le_bytes());
                    }
                }
                moved = Transfer { kind: TransferKind::Other, to: Some(address + to_offset), bytes: size, writes, ..moved };
            }
            &Command::RestoreTexture { texture: id, level, layer, ref data } => {
                let bytes = self.trace.data(data)?;
                self.moves(bytes.len() as u64, 0)?;
                self.res.flushed(id)?;
                self.res.overwritten(id, level, layer)?;
                let texture = self.res.textures.get(id.0)?;
                texture.words.write(texture.image.offset(level, layer), &bytes);
                return Ok(());
            }
            Command::RestoreQueries { set: id, data } => {
                let bytes = self.trace.data(data)?;
                self.moves(bytes.len() as u64, 0)?;
                let (words, _) = bytes.as_chunks::<8>();
                let values = &mut self.res.query_sets.get_mut(id.0)?.values;
                values.iter_mut().zip(words).for_each(|(value, word)| *value = u64::from_le_bytes(*word));
                return Ok(());
            }
            &Command::SetSprite { index, view, x, y } => return Ok(self.sprites.set(index, view, [x, y])?),
            &Command::Present { texture } => {
                self.end_frame(Some((texture, 0, 0)))?;
                self.begin_frame();
                // Nobody asks for what comes after the last frame that is wanted.
                if self.options.frames.end() > self.frame {
                    return Ok(());
                }
                return Err(Fault::Stop);
            }
            command => return Err(StateError::WrongScope { name: command.name(), scope: "outside a pass" }.into()),
        }
        self.emit(Event::Transfer(moved))
    }

    fn copy_texture(&mut self, from: &TextureEnd, to: &TextureEnd, size: [u32; 3], moved: &mut Transfer) -> Result<(), Fault> {
        let (source, source_words, source_address) = self.texture_end(from, size, false)?;
        let (target, target_words, target_address) = self.texture_end(to, size, true)?;
        // A layer is read whole before it is written.
        self.moves(source.bytes(), source.bytes())?;
        source.copy_to(&source_words, &target, &target_words)?;
        moved.from = Some(source_address);
        moved.to = Some(target_address);
        moved.bytes = source.bytes();
        moved.reads = Some(self.res.textures.get(from.texture.0)?.extent());
        moved.writes = Some(self.res.textures.get(to.texture.0)?.extent());
        let surface = |end: &TextureEnd| {
            self.res.textures.get(end.texture.0).map(|texture| texture.surface(end.texture, end.level, end.origin[2]))
        };
        let (from, to) = (surface(from)?, surface(to)?);
        if source.is_whole_image() && target.is_whole_image() && self.res.holdings.can_copy(&from, &to) {
            self.claim_images(&to)?;
            moved.surfaces = Some((from, to));
        }
        Ok(())
    }

    /// One end of a copy: the box, the texture's bytes brought up to date, and the address of the image.
    fn texture_end(&mut self, end: &TextureEnd, size: [u32; 3], written: bool) -> Result<(Region, Arc<Words>, u64), Fault> {
        let region = Region::new(&self.res.textures.get(end.texture.0)?.image, end, size)?;
        self.res.flushed(end.texture)?;
        if written {
            for layer in region.layers() {
                self.res.overwritten(end.texture, end.level, layer)?;
            }
        }
        let texture = self.res.textures.get(end.texture.0)?;
        let address = texture.surface(end.texture, end.level, end.origin[2]).address;
        Ok((region, texture.words.clone(), address))
    }
}

fn fill_zero(words: &Words, offset: u64, size: u64) {
    const ZEROS: [u8; 4096] = [0; 4096];
    let mut at = 0;
    while at < size {
        let n = (size - at).min(ZEROS.len() as u64);
        words.write(offset + at, &ZEROS[..n as usize]);
        at += n;
    }
}
