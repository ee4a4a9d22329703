//! Elements of vertex arrays: how their components are stored, and what they are as floats.

use gl_shader::consts as e;

use crate::gl::call::Scalar;
use crate::gl::texels::image::from_half;

/// The scalar of a type, and its bytes.
pub fn scalar(kind: u32) -> Option<(Scalar, usize)> {
    let scalar = match kind {
        e::BYTE => Scalar::Byte,
        e::UNSIGNED_BYTE => Scalar::Ubyte,
        e::SHORT => Scalar::Short,
        e::UNSIGNED_SHORT => Scalar::Ushort,
        e::INT => Scalar::Int,
        e::UNSIGNED_INT => Scalar::Uint,
        e::FLOAT => Scalar::Float,
        e::DOUBLE => Scalar::Double,
        e::HALF_FLOAT | e::HALF_FLOAT_OES => Scalar::Half,
        e::UNSIGNED_INT_2_10_10_10_REV => Scalar::Packed,
        e::INT_2_10_10_10_REV => Scalar::PackedSigned,
        _ => return None,
    };
    Some((scalar, bytes_of(scalar)))
}

/// Converts bytes to a number; of packed ones it is the whole word.
pub fn read(scalar: Scalar, b: &[u8]) -> f64 {
    match scalar {
        Scalar::Byte => f64::from(b[0] as i8),
        Scalar::Ubyte => f64::from(b[0]),
        Scalar::Short => f64::from(i16::from_le_bytes([b[0], b[1]])),
        Scalar::Ushort => f64::from(u16::from_le_bytes([b[0], b[1]])),
        Scalar::Int => f64::from(i32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        Scalar::Uint | Scalar::Packed | Scalar::PackedSigned => f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        Scalar::Half => f64::from(from_half(u16::from_le_bytes([b[0], b[1]]).into())),
        Scalar::Float => f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]])),
        Scalar::Double => f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]),
    }
}

/// How the elements of an array are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Element {
    /// The type of its components.
    pub scalar: Scalar,
    /// Their number.
    pub size: usize,
    /// Whether blue comes first.
    pub blue_first: bool,
}

impl Element {
    /// Its bytes.
    pub fn bytes(self) -> usize {
        match self.scalar {
            Scalar::Packed | Scalar::PackedSigned => 4,
            scalar => self.size * bytes_of(scalar),
        }
    }

    /// Its components, unchanged and normalised; missing ones are 0, 0, 0, 1.
    #[inline(always)]
    pub fn components(self, element: &[u8]) -> ([f32; 4], [f32; 4]) {
        let mut plain = [0.0, 0.0, 0.0, 1.0];
        // Most arrays are of floats, which normalisation does not change.
        if self.scalar == Scalar::Float {
            for (value, bytes) in plain.iter_mut().zip(element.as_chunks().0) {
                *value = f32::from_le_bytes(*bytes);
            }
            return (plain, plain);
        }
        let mut normalized = plain;
        if matches!(self.scalar, Scalar::Packed | Scalar::PackedSigned) {
            (plain, normalized) = self.unpacked(element);
        } else if self.scalar == Scalar::Ubyte {
            // Colours.
            for ((plain, normalized), &byte) in plain.iter_mut().zip(&mut normalized).zip(element) {
                let value = f64::from(byte);
                (*plain, *normalized) = (value as f32, self.scalar.normalized(value));
            }
        } else {
            let bytes = bytes_of(self.scalar);
            for ((plain, normalized), bytes) in plain.iter_mut().zip(&mut normalized).zip(element.chunks_exact(bytes)) {
                let value = read(self.scalar, bytes);
                (*plain, *normalized) = (value as f32, self.scalar.normalized(value));
            }
        }
        if self.blue_first {
            plain.swap(0, 2);
            normalized.swap(0, 2);
        }
        (plain, normalized)
    }

    /// The components of a packed element. Those with signs are normalised by the rule of OpenGL 4.2, by which Mesa reads arrays.
    fn unpacked(self, element: &[u8]) -> ([f32; 4], [f32; 4]) {
        let word = element.first_chunk().map_or(0, |bytes| u32::from_le_bytes(*bytes));
        let (mut plain, mut normalized) = ([0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]);
        for (k, (plain, normalized)) in plain.iter_mut().zip(&mut normalized).enumerate().take(self.size) {
            let bits = if k == 3 { 2 } else { 10 };
            let top = word << (32 - bits - 10 * k as u32);
            if self.scalar == Scalar::Packed {
                *plain = (top >> (32 - bits)) as f32;
                *normalized = *plain / ((1 << bits) - 1) as f32;
            } else {
                *plain = (top as i32 >> (32 - bits)) as f32;
                *normalized = (*plain / ((1 << (bits - 1)) - 1) as f32).max(-1.0);
            }
        }
        (plain, normalized)
    }
}

/// The bytes of a number.
fn bytes_of(kind: Scalar) -> usize {
    match kind {
        Scalar::Byte | Scalar::Ubyte => 1,
        Scalar::Short | Scalar::Ushort | Scalar::Half => 2,
        Scalar::Int | Scalar::Uint | Scalar::Float | Scalar::Packed | Scalar::PackedSigned => 4,
        Scalar::Double => 8,
    }
}
