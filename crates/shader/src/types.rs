//! Types as the compiler sees them: flat sequences of 32-bit components, and where each lies in memory.

use naga::proc::IndexableLength;
use naga::{Handle, Scalar, ScalarKind, TypeInner, VectorSize};

use super::program::Width;

/// A type: one of the module, or a part of one that the module need not name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Ty {
    Named(Handle<naga::Type>),
    Scalar(Scalar),
    Vector(VectorSize, Scalar),
}

/// A component in memory.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    pub offset: u32,
    pub width: Width,
}

/// The parts of a type that can be selected.
pub(super) enum Shape<'a> {
    Scalar(Scalar),
    Vector(u32, Scalar),
    Matrix(u32, VectorSize, Scalar),
    /// Element, number (none: as many as memory holds), stride in bytes.
    Array(Handle<naga::Type>, Option<u32>, u32),
    Struct(&'a [naga::StructMember]),
    Other,
}

/// A module's types.
#[derive(Clone, Copy)]
pub(super) struct Types<'a> {
    pub module: &'a naga::Module,
    /// Components of each type of the module: what [`component_counts`] gives.
    pub counts: &'a [u32],
}

/// Number of components of each type of a module; runtime arrays count none.
pub(super) fn component_counts(module: &naga::Module) -> Vec<u32> {
    let mut counts = Vec::with_capacity(module.types.len());
    // Types come after those that they are made of.
    for (_, ty) in module.types.iter() {
        let types = Types { module, counts: &counts };
        let count = match types.inner_shape(&ty.inner) {
            Shape::Scalar(_) => 1,
            Shape::Vector(n, _) => n,
            Shape::Matrix(c, r, _) => c * r as u32,
            Shape::Array(base, n, _) => counts[base.index()].saturating_mul(n.unwrap_or(0)),
            Shape::Struct(members) => members.iter().fold(0, |sum, m| u32::saturating_add(sum, counts[m.ty.index()])),
            Shape::Other => 0,
        };
        counts.push(count);
    }
    counts
}

/// Bytes from one column of a matrix to the next.
fn column_stride(rows: VectorSize, width: u32) -> u32 {
    width * if rows == VectorSize::Bi { 2 } else { 4 }
}

impl<'a> Types<'a> {
    pub fn shape(&self, ty: Ty) -> Shape<'a> {
        let handle = match ty {
            Ty::Scalar(s) => return Shape::Scalar(s),
            Ty::Vector(n, s) => return Shape::Vector(n as u32, s),
            Ty::Named(h) => h,
        };
        self.inner_shape(&self.module.types[handle].inner)
    }

    pub fn inner_shape(&self, inner: &'a TypeInner) -> Shape<'a> {
        match *inner {
            TypeInner::Scalar(s) | TypeInner::Atomic(s) => Shape::Scalar(s),
            TypeInner::Vector { size, scalar } => Shape::Vector(size as u32, scalar),
            TypeInner::Matrix { columns, rows, scalar } => Shape::Matrix(columns as u32, rows, scalar),
            TypeInner::Array { base, size, stride } => {
                let n = self.length(size);
                Shape::Array(base, n, stride)
            }
            TypeInner::Struct { ref members, .. } => Shape::Struct(members),
            _ => Shape::Other,
        }
    }

    /// Elements of an array; none: as many as memory holds. A length that is a pipeline constant is known by now.
    pub fn length(&self, size: naga::ArraySize) -> Option<u32> {
        match size.resolve(self.module.to_ctx()) {
            Ok(IndexableLength::Known(n)) => Some(n),
            _ => None,
        }
    }

    /// Number of components; runtime arrays count none.
    pub fn components(&self, ty: Ty) -> u32 {
        match ty {
            Ty::Scalar(_) => 1,
            Ty::Vector(n, _) => n as u32,
            Ty::Named(handle) => self.counts[handle.index()],
        }
    }

    /// Part `index` of a type: its type, first component, and byte offset in memory.
    pub fn part(&self, ty: Ty, index: u32) -> Option<(Ty, u32, u32)> {
        match self.shape(ty) {
            Shape::Vector(_, s) => Some((Ty::Scalar(s), index, index * u32::from(s.width))),
            Shape::Matrix(_, r, s) => Some((Ty::Vector(r, s), index * r as u32, index * column_stride(r, u32::from(s.width)))),
            Shape::Array(base, _, stride) => {
                let ty = Ty::Named(base);
                Some((ty, index.checked_mul(self.components(ty))?, index.checked_mul(stride)?))
            }
            Shape::Struct(members) => {
                let m = members.get(index as usize)?;
                let before = members[..index as usize].iter().map(|m| self.components(Ty::Named(m.ty))).sum();
                Some((Ty::Named(m.ty), before, m.offset))
            }
            _ => None,
        }
    }

    /// Number of parts of equal type that can be chosen at run time; none: unbounded.
    pub fn parts(&self, ty: Ty) -> Option<u32> {
        match self.shape(ty) {
            Shape::Vector(n, _) => Some(n),
            Shape::Matrix(c, _, _) => Some(c),
            Shape::Array(_, n, _) => n,
            Shape::Struct(members) => Some(members.len() as u32),
            _ => Some(1),
        }
    }

    /// Appends where the components of a type lie in memory, from byte `at`.
    pub fn cells(&self, ty: Ty, at: u32, out: &mut Vec<Cell>) {
        let scalar = |s: Scalar| if s.kind == ScalarKind::Float && s.width == 2 { Width::Half } else { Width::Word };
        match self.shape(ty) {
            Shape::Scalar(s) => out.push(Cell { offset: at, width: scalar(s) }),
            Shape::Vector(n, s) => {
                let width = if scalar(s) == Width::Half { 2 } else { 4 };
                out.extend((0..n).map(|i| Cell { offset: at + i * width, width: scalar(s) }));
            }
            Shape::Matrix(c, r, s) => {
                for i in 0..c {
                    self.cells(Ty::Vector(r, s), at + i * column_stride(r, u32::from(s.width)), out);
                }
            }
            Shape::Array(base, n, stride) => {
                for i in 0..n.unwrap_or(0) {
                    self.cells(Ty::Named(base), at + i * stride, out);
                }
            }
            Shape::Struct(members) => {
                for m in members {
                    self.cells(Ty::Named(m.ty), at + m.offset, out);
                }
            }
            Shape::Other => {}
        }
    }

    /// The scalar that a scalar, vector or matrix consists of.
    pub fn scalar(&self, inner: &TypeInner) -> Option<Scalar> {
        match *inner {
            TypeInner::Scalar(s)
            | TypeInner::Atomic(s)
            | TypeInner::Vector { scalar: s, .. }
            | TypeInner::Matrix { scalar: s, .. } => Some(s),
            _ => None,
        }
    }
}

/// Whether a scalar is a 16-bit float.
pub(super) fn is_half(s: Scalar) -> bool {
    s.kind == ScalarKind::Float && s.width == 2
}
