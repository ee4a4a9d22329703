//! Places: the targets of pointers, as far as the compiler knows them.

use std::rc::Rc;

use naga::{Handle, TypeInner};

use super::{Lowerer, Result, Val, Var};
use crate::code::Code;
use crate::ir::V;
use crate::program::Space;
use crate::types::{Shape, Ty};

/// Where a place begins.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Root {
    Var(Var),
    Memory {
        space: Space,
        /// Whether nothing writes it while the program runs.
        constant: bool,
    },
}

/// A choice of a part at run time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Choice {
    /// Index, below `count`.
    pub index: V,
    pub count: u32,
    /// Components of a part.
    pub stride: u32,
}

/// A place in a variable or in memory.
#[derive(Clone, Debug)]
pub(crate) struct AccessPath {
    pub root: Root,
    pub ty: Ty,
    /// Constant offset: components in variables and workgroup memory, bytes in buffers.
    pub offset: u32,
    /// Run-time choices, in variables.
    pub choices: Vec<Choice>,
    /// Run-time byte offset, in memory.
    pub address: Option<V>,
    /// Element of a binding array.
    pub element: Option<V>,
}

impl AccessPath {
    pub fn new(root: Root, ty: Ty, offset: u32) -> AccessPath {
        AccessPath { root, ty, offset, choices: Vec::new(), address: None, element: None }
    }

    /// The layout of workgroup memory is the compiler's own: one word a component.
    pub fn is_shared(&self) -> bool {
        matches!(self.root, Root::Memory { space: Space::Shared, .. })
    }
}

impl<'a> Lowerer<'a> {
    fn binding_array(&self, ty: Ty) -> Option<Handle<naga::Type>> {
        let Ty::Named(h) = ty else { return None };
        match self.module.types[h].inner {
            TypeInner::BindingArray { base, .. } => Some(base),
            _ => None,
        }
    }

    /// Part of a place at a constant index.
    pub fn place_part(&mut self, place: &AccessPath, index: u32) -> Result<Val> {
        if let Some(base) = self.binding_array(place.ty) {
            let element = self.b.constant(index);
            return Ok(Val::Place(Rc::new(AccessPath { ty: Ty::Named(base), element: Some(element), ..place.clone() })));
        }
        // The members of a structure before this one are counted through.
        self.spend(if matches!(self.types.shape(place.ty), Shape::Struct(_)) { index as usize / 8 } else { 0 })?;
        let Some((ty, components, bytes)) = self.types.part(place.ty, index) else {
            return self.refuse(format!("index {index} is out of range"));
        };
        let step = match place.root {
            Root::Memory { .. } if place.is_shared() => components * 4,
            Root::Memory { .. } => bytes,
            Root::Var(_) => components,
        };
        let Some(offset) = place.offset.checked_add(step) else {
            return self.refuse(format!("index {index} is out of range"));
        };
        Ok(Val::Place(Rc::new(AccessPath { ty, offset, ..place.clone() })))
    }

    /// Part of a place at an index computed at run time. An index beyond the end of a sized array takes its last element.
    pub fn place_choice(&mut self, place: &AccessPath, index: V) -> Result<Val> {
        if let Some(base) = self.binding_array(place.ty) {
            return Ok(Val::Place(Rc::new(AccessPath { ty: Ty::Named(base), element: Some(index), ..place.clone() })));
        }
        let count = self.types.parts(place.ty);
        if let Some(k) = self.b.known(index) {
            let k = count.map_or(k, |n| k.min(n.saturating_sub(1)));
            if count.is_some() || k < 1 << 20 {
                return self.place_part(place, k);
            }
        }
        let index = match count {
            Some(n) => {
                let last = self.b.constant(n.saturating_sub(1));
                self.b.op(Code::UMin, &[index, last])
            }
            None => index,
        };
        let Some((ty, components, bytes)) = self.types.part(place.ty, 1) else {
            return self.refuse("this type cannot be indexed at run time");
        };
        let mut next = AccessPath { ty, ..place.clone() };
        match place.root {
            Root::Var(_) => {
                next.choices.push(Choice { index, count: count.unwrap_or(1), stride: components });
            }
            Root::Memory { .. } => {
                let stride = self.b.constant(if place.is_shared() { components * 4 } else { bytes });
                let step = self.b.op(Code::IMul, &[index, stride]);
                next.address = Some(match place.address {
                    Some(a) => self.b.op(Code::IAdd, &[a, step]),
                    None => step,
                });
            }
        }
        Ok(Val::Place(Rc::new(next)))
    }

    /// The place of a runtime-sized array's stride and offset.
    pub fn runtime_array(&self, ty: Ty) -> Option<(u32, u32)> {
        match self.types.shape(ty) {
            Shape::Array(_, None, stride) => Some((0, stride)),
            Shape::Struct(members) => {
                let last = members.last()?;
                let (offset, stride) = self.runtime_array(Ty::Named(last.ty))?;
                Some((offset + last.offset, stride))
            }
            _ => None,
        }
    }
}
