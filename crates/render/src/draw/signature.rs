//! Signatures: 128 bits of everything that the pixels of a draw depend on, so that a machine can tell that it would draw a tile as it has
//! drawn it before. Equal signatures mean equal pixels as far as BLAKE3 has no collisions.

use std::io::Write;

use work::{Primitive, Signature};

use super::vertex::Vertices;

/// Gathers what is signed.
#[derive(Default)]
pub struct Signer(blake3::Hasher);

impl Signer {
    /// Adds bytes, whose number counts.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.0.update(&(bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
    }

    /// Adds words, whose number counts.
    pub fn words(&mut self, words: &[u32]) {
        self.bytes(bytemuck::cast_slice(words));
    }

    /// Adds a value by all that its debug text says, which has every field, also those that come to be.
    pub fn value(&mut self, value: &impl std::fmt::Debug) {
        // Hashing cannot fail; the text ends with a byte that is in none.
        let _ = write!(self.0, "{value:?}\0");
    }

    /// The signature of all that was added.
    pub fn finish(&self) -> Signature {
        let hash = self.0.finalize();
        Signature::from_le_bytes(hash.as_bytes()[..16].try_into().expect("a hash has 32 bytes"))
    }
}

/// Signatures of shaded vertices: of positions, varyings and clip distances.
pub fn vertices(vertices: &Vertices) -> Vec<Signature> {
    let part = |words: &[u32], stride: usize, vertex: usize, signer: &mut Signer| {
        signer.words(&words[vertex * stride..][..stride]);
    };
    let distances: &[u32] = bytemuck::cast_slice(&vertices.distances);
    let signature = |(vertex, position): (usize, &[f32; 4])| {
        let mut signer = Signer::default();
        signer.words(&position.map(f32::to_bits));
        part(&vertices.varyings, vertices.varying_stride, vertex, &mut signer);
        part(distances, vertices.distance_stride, vertex, &mut signer);
        signer.finish()
    };
    vertices.clip.iter().enumerate().map(signature).collect()
}

/// Signatures of primitives: of their vertices in order.
pub fn primitives(primitives: &[Primitive], vertices: &[Signature]) -> Vec<Signature> {
    let signature = |primitive: &Primitive| {
        let mut signer = Signer::default();
        for vertex in primitive.vertices {
            signer.bytes(&vertices[vertex as usize].to_le_bytes());
        }
        signer.finish()
    };
    primitives.iter().map(signature).collect()
}
