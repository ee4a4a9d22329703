//! Matrices whose layout WGSL does not have: rows one after the other, and columns at other distances than their own size.
//!
//! In memory each becomes an array of its vectors. Structures and arrays that hold such matrices get a second type for memory, and keep their
//! own for values: a load takes the parts from memory and builds the value, a store does the reverse. naga transposes loads of square matrices
//! alone, and neither stores nor loads of whole structures.

use std::collections::{HashMap, HashSet};

use grammar::{Decoration as D, Op, StorageClass};

use crate::Refusal;
use crate::words::{Decoration, Inst, Parts, Type};

/// Instructions that loads and stores of whole structures may become: more than any program has.
const PARTS: usize = 1 << 18;

/// Levels of structures and arrays around a matrix.
const LEVELS: u32 = 64;

/// A type of memory that differs from that of its values.
#[derive(Clone, Debug)]
enum Memory {
    /// Members: their types in memory.
    Struct { value: u32, members: Vec<u32> },
    /// The type of elements, and their number; none: known at run time.
    Array { value: u32, of: u32, length: Option<u32> },
    /// An array of vectors that stands for a matrix.
    Matrix { value: u32, column: u32, scalar: u32, columns: u32, rows: u32, by_rows: bool },
}

/// A pointer into memory of such a type.
#[derive(Clone, Copy, Debug)]
enum Pointer {
    /// To memory of this type.
    To(u32),
    /// To a column of a matrix by rows: the pointer to the matrix, its type, and the column's number.
    Column { matrix: u32, ty: u32, column: u32 },
}

/// Rewrites the matrices of buffers.
///
/// # Errors
/// If one is used in a manner that has no form by vectors.
pub fn rewrite(parts: &mut Parts) -> Result<(), Refusal> {
    let decorations = parts.decorations();
    let unsigned = if decorations.values().flatten().any(|d| d.kind == D::MatrixStride as u32) {
        parts.hoist(Op::TypeInt, &[32, 0])
    } else {
        return Ok(());
    };
    let mut layout = Layout {
        types: parts.types(),
        constants: parts.constants(),
        decorations,
        changed: HashMap::new(),
        memory: HashMap::new(),
        levels: HashMap::new(),
        unsigned,
        decorated: Vec::new(),
        out: Vec::new(),
    };
    layout.globals(parts)?;
    if layout.memory.is_empty() {
        return Ok(());
    }
    let mut access = Access {
        constants: layout.constants,
        memory: layout.memory,
        unsigned,
        pointers: HashMap::new(),
        classes: HashMap::new(),
        written: 0,
        out: Vec::new(),
        parts,
    };
    access.variables();
    for function in std::mem::take(&mut access.parts.functions) {
        for inst in function {
            access.instruction(inst)?;
        }
        let out = std::mem::take(&mut access.out);
        access.parts.functions.push(out);
    }
    Ok(())
}

/// Types of memory, as they are declared.
struct Layout {
    types: HashMap<u32, Type>,
    constants: HashMap<u32, u32>,
    decorations: HashMap<u32, Vec<Decoration>>,
    /// Types of memory, by structures and arrays of them.
    changed: HashMap<u32, u32>,
    memory: HashMap<u32, Memory>,
    /// Levels of structures and arrays in types of memory.
    levels: HashMap<u32, u32>,
    unsigned: u32,
    decorated: Vec<Inst>,
    out: Vec<Inst>,
}

impl Layout {
    /// Declares a type of memory that is made of these.
    fn declare(&mut self, inst: &Inst, id: u32, of: &[u32], memory: Memory) -> Result<(), Refusal> {
        let levels = of.iter().filter_map(|of| self.levels.get(of)).max().map_or(1, |levels| levels + 1);
        if levels > LEVELS {
            return Err(inst.refuse(format!("a matrix lies in more than {LEVELS} levels of structures and arrays")));
        }
        self.levels.insert(id, levels);
        self.memory.insert(id, memory);
        Ok(())
    }

    fn globals(&mut self, parts: &mut Parts) -> Result<(), Refusal> {
        let globals = std::mem::take(&mut parts.globals);
        for inst in globals {
            match inst.op {
                Op::TypeStruct => {
                    self.out.push(inst.clone());
                    self.structure(parts, &inst)?;
                }
                Op::TypeArray | Op::TypeRuntimeArray => {
                    self.out.push(inst.clone());
                    if let Some(&of) = self.changed.get(&inst.operand(1)) {
                        let id = parts.fresh();
                        let mut second = inst.clone();
                        second.operands[..2].copy_from_slice(&[id, of]);
                        self.copy_decorations(&inst, id, &HashSet::new());
                        let length = self.constants.get(&inst.operand(2)).copied();
                        self.changed.insert(inst.operand(0), id);
                        self.declare(&inst, id, &[of], Memory::Array { value: inst.operand(0), of, length })?;
                        self.out.push(second);
                    }
                }
                Op::Variable if is_laid_out(inst.operand(2)) => {
                    let to = match self.types.get(&inst.operand(0)) {
                        Some(&Type::Pointer { to, .. }) => self.changed.get(&to).copied(),
                        _ => None,
                    };
                    let mut inst = inst;
                    if let Some(to) = to {
                        let pointer = parts.fresh();
                        self.out.push(Inst { at: inst.at, op: Op::TypePointer, operands: vec![pointer, inst.operand(2), to] });
                        inst.operands[0] = pointer;
                    }
                    self.out.push(inst);
                }
                _ => self.out.push(inst),
            }
        }
        parts.globals = std::mem::take(&mut self.out);
        // The types of values have no such layout.
        parts.globals.retain(|inst| {
            let of_matrix = [D::MatrixStride, D::RowMajor].map(|kind| kind as u32).contains(&inst.operand(2));
            !(inst.op == Op::MemberDecorate && of_matrix && self.changed.contains_key(&inst.operand(0)))
        });
        let at = parts.first_type();
        parts.globals.splice(at..at, std::mem::take(&mut self.decorated));
        Ok(())
    }

    /// Copies the decorations of a type to its type of memory, but for those of these members that are about matrices.
    fn copy_decorations(&mut self, inst: &Inst, id: u32, matrices: &HashSet<u32>) {
        for decoration in self.decorations.get(&inst.operand(0)).into_iter().flatten() {
            let about_matrices = [D::MatrixStride, D::RowMajor, D::ColMajor].iter().any(|&kind| kind as u32 == decoration.kind);
            if about_matrices && decoration.member.is_some_and(|member| matrices.contains(&member)) {
                continue;
            }
            // Of those that types have, these have an operand.
            let has_value = [D::Offset, D::ArrayStride, D::MatrixStride, D::BuiltIn, D::Location]
                .iter()
                .any(|&kind| kind as u32 == decoration.kind);
            let operands = [Some(id), decoration.member, Some(decoration.kind), has_value.then_some(decoration.value)];
            let op = if decoration.member.is_some() { Op::MemberDecorate } else { Op::Decorate };
            self.decorated.push(Inst { at: inst.at, op, operands: operands.into_iter().flatten().collect() });
        }
    }

    fn structure(&mut self, parts: &mut Parts, inst: &Inst) -> Result<(), Refusal> {
        let id = inst.operand(0);
        let mut matrices = HashSet::new();
        let mut members = Vec::new();
        // The stride of each member's matrices, and whether they are stored by rows.
        let mut strides: HashMap<u32, u32> = HashMap::new();
        let mut rows: HashSet<u32> = HashSet::new();
        for decoration in self.decorations.get(&id).into_iter().flatten() {
            let Some(member) = decoration.member else { continue };
            if decoration.kind == D::MatrixStride as u32 {
                strides.insert(member, decoration.value);
            } else if decoration.kind == D::RowMajor as u32 {
                rows.insert(member);
            }
        }
        for (n, &ty) in (0..).zip(inst.from(1)) {
            let mut memory = self.changed.get(&ty).copied();
            if let Some(&stride) = strides.get(&n)
                && let Some(own) = self.matrices(parts, inst, ty, stride, rows.contains(&n), 0)?
            {
                memory = Some(own);
                matrices.insert(n);
            }
            members.push(memory.unwrap_or(ty));
        }
        if members != inst.from(1) {
            let second = parts.fresh();
            self.copy_decorations(inst, second, &matrices);
            self.out.push(Inst {
                at: inst.at,
                op: Op::TypeStruct,
                operands: std::iter::once(second).chain(members.iter().copied()).collect(),
            });
            self.changed.insert(id, second);
            self.declare(inst, second, &members.clone(), Memory::Struct { value: id, members })?;
        }
        Ok(())
    }

    /// The type of memory of a matrix or of arrays of matrices; none where it is that of the values.
    fn matrices(
        &mut self,
        parts: &mut Parts,
        inst: &Inst,
        ty: u32,
        stride: u32,
        by_rows: bool,
        depth: u32,
    ) -> Result<Option<u32>, Refusal> {
        match self.types.get(&ty) {
            Some(&Type::Matrix { column, count: columns }) => {
                let Some(&Type::Vector { of: scalar, count: rows }) = self.types.get(&column) else { return Ok(None) };
                let Some(&Type::Float { bits }) = self.types.get(&scalar) else { return Ok(None) };
                let own = if rows == 2 { 2 } else { 4 } * (bits / 8);
                if !by_rows && stride == own {
                    return Ok(None);
                }
                if !(2..=4).contains(&columns) || !(2..=4).contains(&rows) {
                    return Err(inst.refuse("a matrix has 2 to 4 columns and rows"));
                }
                let mut vector = column;
                if by_rows {
                    vector = parts.fresh();
                    self.out.push(Inst { at: inst.at, op: Op::TypeVector, operands: vec![vector, scalar, columns] });
                }
                let (length, id) = (parts.fresh(), parts.fresh());
                let count = if by_rows { rows } else { columns };
                self.out.push(Inst { at: inst.at, op: Op::Constant, operands: vec![self.unsigned, length, count] });
                self.out.push(Inst { at: inst.at, op: Op::TypeArray, operands: vec![id, vector, length] });
                self.decorated.push(Inst { at: inst.at, op: Op::Decorate, operands: vec![id, D::ArrayStride as u32, stride] });
                self.declare(inst, id, &[], Memory::Matrix { value: ty, column, scalar, columns, rows, by_rows })?;
                Ok(Some(id))
            }
            Some(&(Type::Array { of, .. } | Type::RuntimeArray { of })) if depth < 8 => {
                let length = match self.types.get(&ty) {
                    Some(&Type::Array { length, .. }) => Some(length),
                    _ => None,
                };
                let Some(of) = self.matrices(parts, inst, of, stride, by_rows, depth + 1)? else { return Ok(None) };
                let id = parts.fresh();
                let op = if length.is_some() { Op::TypeArray } else { Op::TypeRuntimeArray };
                let operands = [Some(id), Some(of), length].into_iter().flatten().collect();
                self.out.push(Inst { at: inst.at, op, operands });
                let declared = Inst { at: inst.at, op, operands: vec![ty] };
                self.copy_decorations(&declared, id, &HashSet::new());
                let length = length.and_then(|length| self.constants.get(&length).copied());
                self.declare(inst, id, &[of], Memory::Array { value: ty, of, length })?;
                Ok(Some(id))
            }
            _ => Ok(None),
        }
    }
}

/// Whether variables of a storage class have a layout in memory.
fn is_laid_out(class: u32) -> bool {
    [StorageClass::Uniform, StorageClass::StorageBuffer, StorageClass::PushConstant].iter().any(|&known| known as u32 == class)
}

struct Access<'p> {
    constants: HashMap<u32, u32>,
    memory: HashMap<u32, Memory>,
    unsigned: u32,
    pointers: HashMap<u32, Pointer>,
    /// The storage class of each of these pointers.
    classes: HashMap<u32, u32>,
    /// Instructions that loads and stores have become.
    written: usize,
    out: Vec<Inst>,
    parts: &'p mut Parts,
}

impl Access<'_> {
    fn variables(&mut self) {
        let types = self.parts.types();
        for inst in self.parts.globals.iter().filter(|inst| inst.op == Op::Variable) {
            let Some(&Type::Pointer { class, to }) = types.get(&inst.operand(0)) else { continue };
            if self.memory.contains_key(&to) {
                self.pointers.insert(inst.operand(1), Pointer::To(to));
                self.classes.insert(inst.operand(1), class);
            }
        }
    }

    fn instruction(&mut self, inst: Inst) -> Result<(), Refusal> {
        let pointer = |n: usize| self.pointers.get(&inst.operand(n)).copied();
        match inst.op {
            Op::AccessChain | Op::InBoundsAccessChain => {
                if let Some(base) = pointer(2) {
                    return self.chain(&inst, base);
                }
            }
            Op::CopyObject => {
                if let Some(base) = pointer(2) {
                    let class = self.classes.get(&inst.operand(2)).copied().unwrap_or(0);
                    self.pointers.insert(inst.operand(1), base);
                    self.classes.insert(inst.operand(1), class);
                    if let Pointer::To(ty) = base {
                        let mut inst = inst;
                        inst.operands[0] = self.parts.declared(Op::TypePointer, &[class, ty]);
                        self.out.push(inst);
                    }
                    return Ok(());
                }
            }
            Op::Load => {
                if let Some(base) = pointer(2) {
                    let before = self.out.len();
                    let class = self.classes.get(&inst.operand(2)).copied().unwrap_or(0);
                    let value = match base {
                        Pointer::To(ty) => self.load(&inst, inst.operand(2), class, ty)?,
                        Pointer::Column { matrix, ty, column } => self.load_column(&inst, matrix, class, ty, column)?,
                    };
                    self.count(&inst, before)?;
                    self.out.push(Inst {
                        at: inst.at,
                        op: Op::CopyObject,
                        operands: vec![inst.operand(0), inst.operand(1), value],
                    });
                    return Ok(());
                }
            }
            Op::Store => {
                if let Some(base) = pointer(0) {
                    let before = self.out.len();
                    let class = self.classes.get(&inst.operand(0)).copied().unwrap_or(0);
                    match base {
                        Pointer::To(ty) => self.store(&inst, inst.operand(0), class, ty, inst.operand(1))?,
                        Pointer::Column { matrix, ty, column } => self.store_column(&inst, matrix, class, ty, column)?,
                    }
                    return self.count(&inst, before);
                }
            }
            Op::CopyMemory | Op::FunctionCall | Op::Phi | Op::Select
                if inst.operands.iter().any(|id| self.pointers.contains_key(id)) =>
            {
                return Err(
                    inst.refuse("matrices by rows or with distant columns are passed by pointer, which is not supported")
                );
            }
            _ => {}
        }
        self.out.push(inst);
        Ok(())
    }

    /// Counts what was written, as a load of a large array becomes many instructions.
    fn count(&mut self, inst: &Inst, before: usize) -> Result<(), Refusal> {
        self.written += self.out.len() - before;
        if self.written > PARTS { Err(self.too_large(inst)) } else { Ok(()) }
    }

    fn too_large(&self, inst: &Inst) -> Refusal {
        inst.refuse("structures with matrices by rows or with distant columns are loaded or stored as a whole, with more parts than are supported")
    }

    fn value(&mut self, at: u32, op: Op, ty: u32, operands: &[u32]) -> u32 {
        let id = self.parts.fresh();
        self.out.push(Inst { at, op, operands: [ty, id].iter().chain(operands).copied().collect() });
        id
    }

    fn index(&mut self, number: u32) -> u32 {
        self.parts.constant(self.unsigned, number)
    }

    /// A pointer to a part of memory.
    fn part(&mut self, at: u32, class: u32, ty: u32, base: u32, path: &[u32]) -> u32 {
        let pointer = self.parts.declared(Op::TypePointer, &[class, ty]);
        let operands: Vec<u32> = std::iter::once(base).chain(path.iter().copied()).collect();
        self.value(at, Op::AccessChain, pointer, &operands)
    }

    fn chain(&mut self, inst: &Inst, base: Pointer) -> Result<(), Refusal> {
        let class = self.classes.get(&inst.operand(2)).copied().unwrap_or(0);
        let mut from = inst.operand(2);
        let mut ty = match base {
            Pointer::To(ty) => ty,
            Pointer::Column { matrix, ty, column } => {
                let [row] = inst.from(3) else { return Err(inst.refuse("a column has elements and nothing in them")) };
                let Some(&Memory::Matrix { .. }) = self.memory.get(&ty) else { return Err(inst.refuse("no matrix")) };
                let operands = vec![inst.operand(0), inst.operand(1), matrix, *row, column];
                self.out.push(Inst { at: inst.at, op: inst.op, operands });
                return Ok(());
            }
        };
        let mut path: Vec<u32> = Vec::new();
        let mut rest = inst.from(3);
        while let [index, behind @ ..] = rest {
            let wrong = || inst.refuse("the index of a member is no constant of the structure");
            ty = match self.memory.get(&ty) {
                Some(Memory::Struct { members, .. }) => {
                    let number = self.constants.get(index).ok_or_else(wrong)?;
                    *members.get(*number as usize).ok_or_else(wrong)?
                }
                Some(&Memory::Array { of, .. }) => of,
                Some(Memory::Matrix { by_rows: false, .. }) | None => {
                    // All that lies in it is as it was.
                    path.extend(rest);
                    let operands = [inst.operand(0), inst.operand(1), from].iter().chain(&path).copied().collect();
                    self.out.push(Inst { at: inst.at, op: inst.op, operands });
                    return Ok(());
                }
                Some(Memory::Matrix { by_rows: true, .. }) => {
                    let matrix = if path.is_empty() { from } else { self.part(inst.at, class, ty, from, &path) };
                    self.classes.insert(inst.operand(1), class);
                    match behind {
                        [] => {
                            self.pointers.insert(inst.operand(1), Pointer::Column { matrix, ty, column: *index });
                        }
                        [row] => {
                            let operands = vec![inst.operand(0), inst.operand(1), matrix, *row, *index];
                            self.out.push(Inst { at: inst.at, op: inst.op, operands });
                        }
                        _ => return Err(inst.refuse("a matrix has columns and rows and nothing in them")),
                    }
                    return Ok(());
                }
            };
            path.push(*index);
            rest = behind;
        }
        let mut pointer = inst.operand(0);
        if self.memory.contains_key(&ty) {
            pointer = self.parts.declared(Op::TypePointer, &[class, ty]);
            self.pointers.insert(inst.operand(1), Pointer::To(ty));
            self.classes.insert(inst.operand(1), class);
        }
        from = inst.operand(2);
        let operands = [pointer, inst.operand(1), from].iter().chain(&path).copied().collect();
        self.out.push(Inst { at: inst.at, op: inst.op, operands });
        Ok(())
    }

    /// The type of values of memory.
    fn value_type(&self, ty: u32) -> u32 {
        match self.memory.get(&ty) {
            Some(&(Memory::Struct { value, .. } | Memory::Array { value, .. } | Memory::Matrix { value, .. })) => value,
            None => ty,
        }
    }

    /// The types in memory of the parts of memory.
    fn parts_of(&self, inst: &Inst, ty: u32) -> Result<Vec<u32>, Refusal> {
        match self.memory.get(&ty) {
            Some(Memory::Struct { members, .. }) => Ok(members.clone()),
            Some(&Memory::Array { of, length: Some(length), .. }) if (length as usize) < PARTS => Ok(vec![of; length as usize]),
            _ => Err(self.too_large(inst)),
        }
    }

    fn load(&mut self, inst: &Inst, pointer: u32, class: u32, ty: u32) -> Result<u32, Refusal> {
        let at = inst.at;
        if self.out.len() > PARTS {
            return Err(self.too_large(inst));
        }
        match self.memory.get(&ty).cloned() {
            None => Ok(self.value(at, Op::Load, ty, &[pointer])),
            Some(Memory::Matrix { value, column, scalar, columns, rows, by_rows }) => {
                let vectors = self.value(at, Op::Load, ty, &[pointer]);
                let mut all = Vec::new();
                for c in 0..columns {
                    all.push(if by_rows {
                        let parts: Vec<u32> =
                            (0..rows).map(|r| self.value(at, Op::CompositeExtract, scalar, &[vectors, r, c])).collect();
                        self.value(at, Op::CompositeConstruct, column, &parts)
                    } else {
                        self.value(at, Op::CompositeExtract, column, &[vectors, c])
                    });
                }
                Ok(self.value(at, Op::CompositeConstruct, value, &all))
            }
            Some(_) => {
                let mut all = Vec::new();
                for (n, of) in (0..).zip(self.parts_of(inst, ty)?) {
                    let index = self.index(n);
                    let part = self.part(at, class, of, pointer, &[index]);
                    all.push(self.load(inst, part, class, of)?);
                }
                let ty = self.value_type(ty);
                Ok(self.value(at, Op::CompositeConstruct, ty, &all))
            }
        }
    }

    fn store(&mut self, inst: &Inst, pointer: u32, class: u32, ty: u32, value: u32) -> Result<(), Refusal> {
        let at = inst.at;
        if self.out.len() > PARTS {
            return Err(self.too_large(inst));
        }
        match self.memory.get(&ty).cloned() {
            None => self.out.push(Inst { at, op: Op::Store, operands: vec![pointer, value] }),
            Some(Memory::Matrix { column, scalar, columns, rows, by_rows, .. }) => {
                for c in 0..columns {
                    if by_rows {
                        for r in 0..rows {
                            let element = self.value(at, Op::CompositeExtract, scalar, &[value, c, r]);
                            let path = [self.index(r), self.index(c)];
                            let place = self.part(at, class, scalar, pointer, &path);
                            self.out.push(Inst { at, op: Op::Store, operands: vec![place, element] });
                        }
                    } else {
                        let vector = self.value(at, Op::CompositeExtract, column, &[value, c]);
                        let path = [self.index(c)];
                        let place = self.part(at, class, column, pointer, &path);
                        self.out.push(Inst { at, op: Op::Store, operands: vec![place, vector] });
                    }
                }
            }
            Some(_) => {
                for (n, of) in (0..).zip(self.parts_of(inst, ty)?) {
                    let own = self.value_type(of);
                    let part = self.value(at, Op::CompositeExtract, own, &[value, n]);
                    let index = self.index(n);
                    let place = self.part(at, class, of, pointer, &[index]);
                    self.store(inst, place, class, of, part)?;
                }
            }
        }
        Ok(())
    }

    fn load_column(&mut self, inst: &Inst, matrix: u32, class: u32, ty: u32, column: u32) -> Result<u32, Refusal> {
        let Some(&Memory::Matrix { column: vector, scalar, rows, .. }) = self.memory.get(&ty) else {
            return Err(inst.refuse("no matrix"));
        };
        let mut elements = Vec::new();
        for row in 0..rows {
            let path = [self.index(row), column];
            let place = self.part(inst.at, class, scalar, matrix, &path);
            elements.push(self.value(inst.at, Op::Load, scalar, &[place]));
        }
        Ok(self.value(inst.at, Op::CompositeConstruct, vector, &elements))
    }

    fn store_column(&mut self, inst: &Inst, matrix: u32, class: u32, ty: u32, column: u32) -> Result<(), Refusal> {
        let Some(&Memory::Matrix { scalar, rows, .. }) = self.memory.get(&ty) else { return Err(inst.refuse("no matrix")) };
        for row in 0..rows {
            let element = self.value(inst.at, Op::CompositeExtract, scalar, &[inst.operand(1), row]);
            let path = [self.index(row), column];
            let place = self.part(inst.at, class, scalar, matrix, &path);
            self.out.push(Inst { at: inst.at, op: Op::Store, operands: vec![place, element] });
        }
        Ok(())
    }
}
