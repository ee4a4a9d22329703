//! Types of generated programs.

/// A scalar type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scalar {
    Bool,
    I32,
    U32,
    F32,
    F16,
}

impl Scalar {
    pub fn text(self) -> &'static str {
        match self {
            Scalar::Bool => "bool",
            Scalar::I32 => "i32",
            Scalar::U32 => "u32",
            Scalar::F32 => "f32",
            Scalar::F16 => "f16",
        }
    }

    pub fn is_float(self) -> bool {
        matches!(self, Scalar::F32 | Scalar::F16)
    }
}

/// A type.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ty {
    Scalar(Scalar),
    Vector(u32, Scalar),
    /// Columns, rows.
    Matrix(u32, u32, Scalar),
    Array(Box<Ty>, u32),
    /// By number.
    Struct(usize),
}

pub const BOOL: Ty = Ty::Scalar(Scalar::Bool);
pub const I32: Ty = Ty::Scalar(Scalar::I32);
pub const U32: Ty = Ty::Scalar(Scalar::U32);
pub const F32: Ty = Ty::Scalar(Scalar::F32);

/// A structure.
#[derive(Clone, Debug)]
pub struct Struct {
    pub name: String,
    pub members: Vec<(String, Ty)>,
}

impl Ty {
    pub fn text(&self, structs: &[Struct]) -> String {
        match self {
            Ty::Scalar(s) => s.text().to_owned(),
            Ty::Vector(n, s) => format!("vec{n}<{}>", s.text()),
            Ty::Matrix(c, r, s) => format!("mat{c}x{r}<{}>", s.text()),
            Ty::Array(base, n) => format!("array<{}, {n}>", base.text(structs)),
            Ty::Struct(k) => structs[*k].name.clone(),
        }
    }

    /// Whether a part of the type, or all of it, has type `want`.
    pub fn holds(&self, want: &Ty, structs: &[Struct]) -> bool {
        self == want
            || match self {
                Ty::Scalar(_) => false,
                Ty::Vector(_, s) => matches!(want, Ty::Scalar(w) | Ty::Vector(_, w) if w == s),
                Ty::Matrix(_, r, s) => Ty::Vector(*r, *s).holds(want, structs),
                Ty::Array(base, _) => base.holds(want, structs),
                Ty::Struct(k) => structs[*k].members.iter().any(|(_, ty)| ty.holds(want, structs)),
            }
    }

    /// Scalars in it.
    pub fn size(&self, structs: &[Struct]) -> u32 {
        match self {
            Ty::Scalar(_) => 1,
            Ty::Vector(n, _) => *n,
            Ty::Matrix(c, r, _) => c * r,
            Ty::Array(base, n) => base.size(structs) * n,
            Ty::Struct(k) => structs[*k].members.iter().map(|(_, ty)| ty.size(structs)).sum(),
        }
    }
}
