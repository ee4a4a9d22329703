//! Samplers, and the functions that read textures through them.

/// A sampler.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sampler {
    /// Its name.
    pub name: String,
    /// The target that it reads: an index of [`TARGETS`](crate::TARGETS).
    pub target: usize,
    /// Components of its coordinates without that of a comparison.
    pub dimensions: usize,
    /// Whether it compares depths.
    pub shadow: bool,
    /// The location that its declaration states.
    pub location: Option<u32>,
}

/// How a texture is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Read {
    /// At coordinates, perhaps with a bias.
    Plain,
    /// At coordinates that are divided by their last component.
    Projected,
    /// At a level of detail.
    Level,
    /// Both.
    ProjectedLevel,
    /// With derivatives.
    Gradient,
    /// One texel.
    Fetch,
    /// Its size.
    Size,
}

/// The target of a sampler's type, components of its coordinates, and whether it compares depths.
pub fn sampler(kind: &str) -> Option<(usize, usize, bool)> {
    Some(match kind {
        "sampler1D" => (0, 1, false),
        "sampler1DShadow" => (0, 1, true),
        "sampler2D" => (1, 2, false),
        "sampler2DShadow" => (1, 2, true),
        "sampler2DRect" => (2, 2, false),
        "sampler2DRectShadow" => (2, 2, true),
        "sampler3D" => (3, 3, false),
        "samplerCube" => (4, 3, false),
        _ => return None,
    })
}

/// How the function with this name reads a texture, and whether it returns a scalar when depths are compared.
pub fn read_of(name: &str) -> Option<(Read, bool)> {
    let name = ["ARB", "EXT"].iter().find_map(|end| name.strip_suffix(end)).unwrap_or(name);
    if name == "texelFetch" {
        return Some((Read::Fetch, false));
    }
    let stems = [
        "texture2DRect",
        "shadow2DRect",
        "texture1D",
        "texture2D",
        "texture3D",
        "textureCube",
        "shadow1D",
        "shadow2D",
        "texture",
    ];
    let stem = stems.iter().find(|&stem| name.starts_with(stem))?;
    let read = match &name[stem.len()..] {
        "" => Read::Plain,
        "Proj" => Read::Projected,
        "Lod" => Read::Level,
        "ProjLod" => Read::ProjectedLevel,
        "Grad" => Read::Gradient,
        "Size" => Read::Size,
        _ => return None,
    };
    Some((read, *stem == "texture"))
}

/// Writes stub functions for reads of a texture, one for each form of the arguments.
pub fn stubs(name: &str, sampler: &Sampler, read: Read, text: &mut String) {
    let vector = |n: usize| if n == 1 { "float".to_owned() } else { format!("vec{n}") };
    let whole = |n: usize| if n == 1 { "int".to_owned() } else { format!("ivec{n}") };
    let n = sampler.dimensions;
    let cube = sampler.target == 4;
    // The second component of a 1D comparison is not used.
    let plain = vector(if sampler.shadow { 3 } else { n });
    let projected = if sampler.shadow {
        vec![vector(4)]
    } else {
        match n {
            _ if cube => vec![],
            3 => vec![vector(4)],
            _ => vec![vector(n + 1), vector(4)],
        }
    };
    let mut forms: Vec<String> = Vec::new();
    match read {
        Read::Plain => forms.extend([plain.clone(), format!("{plain} p, float")]),
        Read::Projected => {
            forms.extend(projected.iter().flat_map(|kind| [kind.clone(), format!("{kind} p, float")]));
        }
        Read::Level => forms.push(format!("{plain} p, float")),
        Read::ProjectedLevel => forms.extend(projected.iter().map(|kind| format!("{kind} p, float"))),
        Read::Gradient => forms.push(format!("{plain} p, {0} x, {0}", vector(n))),
        Read::Fetch => {
            forms.push(format!("{} p, int", whole(n)));
            if sampler.target == 2 {
                forms.push(whole(n));
            }
        }
        Read::Size => forms.push(if sampler.target == 2 { String::new() } else { "int".into() }),
    }
    let (result, value) = match read {
        Read::Size => (whole(if cube { 2 } else { n }), "1"),
        _ if name.contains("One_") => ("float".into(), "0.0"),
        _ => ("vec4".into(), "0.0"),
    };
    for form in forms {
        let parameter = if form.is_empty() { String::new() } else { format!("{form} q") };
        text.push_str(&format!("{result} {name}({parameter}) {{ return {result}({value}); }}"));
    }
}
