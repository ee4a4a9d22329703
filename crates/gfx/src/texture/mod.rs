//! Textures as shaders see them: sampling with every mode, gathering, loading, and what it costs the card.
//!
//! A [`View`] holds the texels of a texture view in a form that filters read directly, built once for each content of the
//! texture. Sampling works on whole batches of 64 lanes, 16 quads; the level of detail is that of a quad. There are two samplers with the
//! same bits: [`general`] is the definition, a lane at a time, and [`fast`] samples flat textures, all lanes at a time.
//!
//! The rules are Vulkan's ("Image Operations"), where that leaves freedom: exact scale factors, unrounded level weights, sRGB
//! decoded before filtering, seamless cubes with the missing corner texel's weight given to the other three, comparison of each
//! texel before filtering, anisotropy by elliptical weighted averages ([`ellipse`]; on cubes, where an ellipse could leave its
//! face, by equally spaced probes along the major axis). Four 8-bit channels are filtered in fixed point ([`general::is_fixed`]).

mod cube;
mod ellipse;
mod fast;
mod general;
mod lod;
mod read;
mod record;
mod sampler;
mod squares;
mod taps;
mod view;

#[cfg(test)]
mod tests;

pub use record::Footprint;
pub use sampler::Sampler;
pub use view::{Each, View, ViewError, ViewRange};

use num::{Lanes, Mask};

/// How the level of detail is found.
#[derive(Clone, Copy, Debug)]
pub enum Lod<'a> {
    /// From the differences of coordinates in a quad.
    Auto,
    /// As `Auto`, plus a number.
    Bias(&'a Lanes),
    /// Given.
    Level(&'a Lanes),
    /// The first level (comparison at a given level, gathering).
    Zero,
    /// From given derivatives of the coordinates.
    Gradient {
        /// Along x.
        dx: [&'a Lanes; 3],
        /// Along y.
        dy: [&'a Lanes; 3],
    },
}

/// The operands of a sample or gather.
#[derive(Clone, Copy, Debug)]
pub struct Sample<'a> {
    /// Coordinates in [0, 1] over the texture, or a direction for cubes. Those that the dimension has not are not read.
    pub coords: [&'a Lanes; 3],
    /// Array layer (of a cube array: which cube) as an `i32`, clamped to those there are.
    pub layer: Option<&'a Lanes>,
    /// Texels to add to the coordinates; not for cubes.
    pub offset: [i32; 3],
    /// Level of detail; gathering reads the first level in any case.
    pub lod: Lod<'a>,
    /// Reference value of a comparison.
    pub compare: Option<&'a Lanes>,
}

impl View {
    /// Samples the lanes of `mask`. `out` receives the bits of four `f32`; a comparison gives its result in the first. Lanes
    /// outside the mask are written too, with what they would read or zeros. Implicit levels of detail read the coordinates of all lanes of a quad, masked or not.
    pub fn sample(&self, sampler: &Sampler, args: &Sample<'_>, mask: Mask, out: &mut [Lanes; 4]) {
        self.sample_finding(sampler, args, mask, &mut None, out);
    }

    /// Samples, and records what is read. Both need the levels, which are looked for once.
    pub fn sample_recorded(
        &self,
        sampler: &Sampler,
        args: &Sample<'_>,
        mask: Mask,
        out: &mut [Lanes; 4],
        footprint: &mut Footprint,
    ) {
        let mut found = None;
        self.sample_finding(sampler, args, mask, &mut found, out);
        footprint.sample(self, sampler, args, found.as_ref(), mask);
    }

    #[inline(always)]
    fn sample_finding(
        &self,
        sampler: &Sampler,
        args: &Sample<'_>,
        mask: Mask,
        found: &mut Option<fast::QuadLevels>,
        out: &mut [Lanes; 4],
    ) {
        if !fast::sample(self, sampler, args, mask, found, out) {
            general::sample(self, sampler, args, mask, out);
        }
    }

    /// Gathers one component (0 to 3) of the four texels that a bilinear filter would read, in WGSL's order: out 0 is (left,
    /// bottom), 1 (right, bottom), 2 (right, top), 3 (left, top), where v runs down. With a comparison, the results of comparing.
    pub fn gather(&self, sampler: &Sampler, args: &Sample<'_>, component: u32, mask: Mask, out: &mut [Lanes; 4]) {
        general::gather(self, sampler, args, component, mask, out);
    }

    /// Loads texels by unsigned coordinates, layer, and level (of a multisampled view: sample). What does not exist reads as
    /// zeros. `out` receives bits as [`View::kind`] says.
    pub fn load(&self, coords: [&Lanes; 3], layer: Option<&Lanes>, level: &Lanes, mask: Mask, out: &mut [Lanes; 4]) {
        general::load(self, coords, layer, level, mask, out);
    }

    /// Records what [`View::sample`] with the same operands reads.
    pub fn record_sample(&self, sampler: &Sampler, args: &Sample<'_>, mask: Mask, footprint: &mut Footprint) {
        footprint.sample(self, sampler, args, None, mask);
    }

    /// Records what [`View::gather`] with the same operands reads.
    pub fn record_gather(&self, sampler: &Sampler, args: &Sample<'_>, mask: Mask, footprint: &mut Footprint) {
        footprint.gather(self, sampler, args, mask);
    }

    /// Records what [`View::load`] with the same operands reads.
    pub fn record_load(
        &self,
        coords: [&Lanes; 3],
        layer: Option<&Lanes>,
        level: &Lanes,
        mask: Mask,
        footprint: &mut Footprint,
    ) {
        footprint.load(self, coords, layer, level, mask);
    }
}
