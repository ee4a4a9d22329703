//! Passes, the surfaces that they draw into, and what is moved between them.

use std::sync::Arc;

use gfx::format::Format;

use super::BLOCK;
use super::held::Aspects;
use super::reach::{Extent, Reach};

/// Names one image of a texture: all samples of one layer (or slice) of one level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SurfaceKey {
    /// The texture's id in the trace.
    pub texture: u32,
    /// Mip level.
    pub level: u32,
    /// Layer, or slice of a 3D texture.
    pub layer: u32,
}

/// A surface: where it is and what its texels are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Surface {
    /// Its name.
    pub key: SurfaceKey,
    /// Format of the stored texels (sRGB-ness is the view's).
    pub format: Format,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Samples per pixel.
    pub samples: u32,
    /// Address of the first byte; blocks lie as in `gfx::tiling`.
    pub address: u64,
    /// Where it is shown, the display ignores its alpha.
    pub opaque: bool,
}

impl Surface {
    /// The memory in which it lies: whole blocks.
    pub fn extent(&self) -> Extent {
        let [width, height] = [self.width, self.height].map(|size| u64::from(size.next_multiple_of(BLOCK)));
        Extent::new(self.address, width * height * u64::from(self.samples) * u64::from(self.format.block_bytes()))
    }
}

/// Bytes of a surface: rows top to bottom, pixels left to right, samples in order, `block_bytes` each, tightly packed.
#[derive(Clone, Debug)]
pub struct Contents {
    /// Which surface.
    pub surface: Surface,
    /// Its bytes.
    pub bytes: Arc<[u8]>,
}

/// What an attachment holds when a pass begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Load {
    /// What it held before.
    Load,
    /// This value: the bits that `gfx::texel::encode` takes (f32, u32 or i32 bits by the format's kind); for a depth attachment
    /// [depth as f32 bits, stencil, 0, 0].
    Clear([u32; 4]),
}

/// One attachment of a pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attachment {
    /// Where it is.
    pub surface: Surface,
    /// What it holds at the beginning (colour, or depth).
    pub load: Load,
    /// Whether the result is written to memory (colour, or depth). That of an aspect that a pass only reads is not.
    pub store: bool,
    /// Stencil: what it holds at the beginning.
    pub stencil_load: Load,
    /// Stencil: whether the result is written to memory.
    pub stencil_store: bool,
    /// The aspects that have their contents after the pass, written or only read. The others are zeros then.
    pub keeps: Aspects,
    /// Where samples are resolved to at the end.
    pub resolve: Option<Surface>,
}

impl Attachment {
    /// The aspects that the pass begins with as they were.
    pub fn loads(&self) -> Aspects {
        let loads = Aspects { main: self.load == Load::Load, stencil: self.stencil_load == Load::Load };
        loads.and(Aspects::of(self.surface.format))
    }
}

/// A render pass.
#[derive(Clone, Debug)]
pub struct Pass {
    /// Number in its frame, from 0.
    pub number: u32,
    /// Label, or empty.
    pub label: String,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Samples per pixel.
    pub samples: u32,
    /// Colour attachments by location.
    pub color: Vec<Option<Attachment>>,
    /// Depth and stencil attachment.
    pub depth: Option<Attachment>,
}

impl Pass {
    /// All attachments: colours by location, then depth and stencil.
    pub fn attachments(&self) -> impl Iterator<Item = &Attachment> {
        self.color.iter().flatten().chain(&self.depth)
    }

    /// The memory of its attachments and of what they are resolved to, all of which it may write. A depth attachment that is only read is in it,
    /// since machines test in place.
    pub fn reach(&self) -> Reach {
        let mut reach = Reach::default();
        for attachment in self.attachments() {
            reach.writes.add(attachment.surface.extent());
            attachment.resolve.iter().for_each(|target| reach.writes.add(target.extent()));
        }
        reach
    }
}

/// What a transfer is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TransferKind {
    /// From the host.
    Upload,
    /// Inside the card's memory.
    Copy,
    /// A value is written.
    Clear,
    /// The image of a sprite, to the display.
    Sprite,
    /// Query results and the like.
    Other,
}

/// Memory that the command processor's copy engine moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Transfer {
    /// What it is.
    pub kind: TransferKind,
    /// First byte read, if the card's memory is read.
    pub from: Option<u64>,
    /// First byte written, if the card's memory is written.
    pub to: Option<u64>,
    /// Bytes.
    pub bytes: u64,
    /// The memory in which the bytes read lie: of a part of an image, the whole image.
    pub reads: Option<Extent>,
    /// The memory in which the bytes written lie.
    pub writes: Option<Extent>,
    /// Surfaces: this one becomes that one, whole (a texture copy that the machine must repeat in its own frame buffers).
    pub surfaces: Option<(Surface, Surface)>,
}

impl Transfer {
    /// The memory that it may touch.
    pub fn reach(&self) -> Reach {
        let mut reach = Reach::default();
        self.reads.iter().for_each(|&span| reach.reads.add(span));
        self.writes.iter().for_each(|&span| reach.writes.add(span));
        reach
    }
}

/// The end of a frame.
#[derive(Clone, Debug)]
pub struct EndFrame {
    /// The trace's own frame number, from 0.
    pub number: u32,
    /// What is shown; none: nothing can be (no colour target was ever written).
    pub shown: Option<Surface>,
    /// Its bytes in API order, as `render` has them, laid out as in [`Contents`].
    pub reference: Arc<[u8]>,
    /// Whether the frame's last writer of the shown surface was a draw, so that the machine's own bytes are the picture.
    pub drawn: bool,
    /// The sprites that the display lays over the picture, by index.
    pub sprites: Arc<[Sprite]>,
}

/// A small picture that the display lays over its lines, outside the frame buffer. Its texels are 4 bytes of 8 bits per channel, in the
/// order of the shown surface; where the last of them, alpha, is not 0, the texel replaces the pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sprite {
    /// Which of the display's: one of a lower index lies over others.
    pub index: u8,
    /// The pixel of the picture on which its upper left texel lies; parts outside of the picture are not shown.
    pub at: [i32; 2],
    /// Width and height in texels.
    pub size: [u32; 2],
    /// Its texels, rows from top to bottom.
    pub texels: Arc<[u8]>,
}
