//! Words of the language.

use super::sampler::sampler;
use super::tokens::Dialect;

/// Words that are plain names in an old dialect and reserved in version 4.50.
const RESERVED: &str = "sample buffer shared patch restrict readonly writeonly sampler texture2D texture3D texture1D image2D image3D image1D \
    samplerShadow textureCube double dvec2 dvec3 dvec4 precise coherent volatile subroutine atomic_uint textureCubeArray texture2DArray";

/// The same for versions before 1.30.
const LATER: &str = "smooth flat noperspective switch case default layout uint";

/// A name of a shader as a name of version 4.50.
pub fn renamed(name: &str, dialect: Dialect) -> String {
    let is_one = |of: &str| of.split(' ').any(|word| word == name);
    // `mat2x3` is a type since version 1.20.
    let matrix = dialect.version < 120 && !dialect.embedded && name.starts_with("mat") && name.contains('x') && is_type(name);
    let later = dialect.version < 130 && is_one(LATER) || matrix;
    if later || is_one(RESERVED) { format!("{name}_") } else { name.to_owned() }
}

/// Returns true if this is the name of a type that the language has.
pub fn is_type(name: &str) -> bool {
    let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
    let end = &name[stem.len()..];
    match stem {
        "void" | "bool" | "int" | "uint" | "float" => end.is_empty(),
        "vec" | "ivec" | "uvec" | "bvec" | "mat" => matches!(end, "2" | "3" | "4"),
        // `mat2x3`
        _ => matches!(stem, "mat2x" | "mat3x" | "mat4x") && matches!(end, "2" | "3" | "4") || sampler(name).is_some(),
    }
}
