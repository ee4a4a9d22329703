//! Names, and small patterns of tokens.

use super::sampler::sampler;
use super::tokens::{Token, parts};

/// Words that are plain names in an old dialect and reserved in version 4.50.
pub const RESERVED: [&str; 27] = [
    "sample",
    "buffer",
    "shared",
    "patch",
    "restrict",
    "readonly",
    "writeonly",
    "sampler",
    "texture2D",
    "texture3D",
    "texture1D",
    "image2D",
    "image3D",
    "image1D",
    "samplerShadow",
    "textureCube",
    "double",
    "dvec2",
    "dvec3",
    "dvec4",
    "precise",
    "coherent",
    "volatile",
    "subroutine",
    "atomic_uint",
    "textureCubeArray",
    "texture2DArray",
];

/// The same for versions before 1.30.
pub const LATER: [&str; 8] = ["smooth", "flat", "noperspective", "switch", "case", "default", "layout", "uint"];

/// The number in brackets with which these tokens begin.
pub fn number_in_brackets(tokens: &[Token]) -> Option<usize> {
    match tokens.get(..3)? {
        [open, number, close] if open.is("[") && close.is("]") => number.text.trim_end_matches(['u', 'U']).parse().ok(),
        _ => None,
    }
}

/// The number of a component of this name.
pub fn component(name: &str) -> Option<&'static str> {
    let at = ["xyzw", "rgba", "stpq"].iter().find_map(|names| names.find(name).filter(|_| name.len() == 1))?;
    Some(["0", "1", "2", "3"][at])
}

/// The name of a function and the types of its parameters. Parameter names may be missing.
pub fn signature(name: &Token, parameters: &[Token]) -> String {
    let mut out = name.text.clone();
    for parameter in parts(parameters) {
        let qualifiers = ["const", "in", "out", "inout", "highp", "mediump", "lowp"];
        let mut kind = parameter.iter().filter(|token| !qualifiers.contains(&token.text.as_str()));
        let brackets: String = parameter.iter().skip_while(|token| !token.is("[")).map(|token| token.text.as_str()).collect();
        let first = kind.next().map_or("", |token| token.text.as_str());
        out += &format!(",{}{brackets}", if first == "void" { "" } else { first });
    }
    if out.ends_with(',') {
        out.pop();
    }
    out
}

/// Whether this is the name of a type that the language has.
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
