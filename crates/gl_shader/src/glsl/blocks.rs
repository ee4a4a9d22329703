//! Uniform blocks: their members become uniforms, whose values come from a buffer in the layout `std140` (OpenGL 4.5, section 7.6.2.2).
//! Mesa lays out the blocks that state no layout in the same way.

use naga::ScalarKind;

use super::access::{Layout, Member};

/// A uniform block.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Block {
    /// Its name.
    pub name: String,
    /// The binding that its declaration states.
    pub binding: Option<u32>,
}

/// A vector of uniforms that comes from a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Filled {
    /// The vector.
    pub slot: usize,
    /// The number of its block.
    pub block: usize,
    /// Its first byte in the buffer.
    pub offset: usize,
    /// Components of four bytes each.
    pub components: usize,
    /// Their kind.
    pub kind: ScalarKind,
}

/// Alignment of arrays, matrices and structures.
const WIDE: usize = 16;

/// The alignment and the size of a value.
fn extent(layout: &Layout) -> (usize, usize) {
    match layout {
        Layout::Vector(n, _) => ([4, 8, WIDE, WIDE][n - 1], 4 * n),
        Layout::Matrix(columns, _) => (WIDE, WIDE * columns),
        Layout::Array(element, count) => (WIDE, stride(element).saturating_mul(*count)),
        Layout::Struct(_, members) => {
            let end = members.iter().fold(0_usize, |at, member| place(&member.layout, at).1);
            (WIDE, end.next_multiple_of(WIDE))
        }
    }
}

/// Bytes from one element of an array to the next.
fn stride(element: &Layout) -> usize {
    extent(element).1.next_multiple_of(WIDE)
}

/// Where a value begins and ends that follows others up to `at`.
pub fn place(layout: &Layout, at: usize) -> (usize, usize) {
    let (align, size) = extent(layout);
    let start = at.next_multiple_of(align);
    (start, start.saturating_add(size))
}

/// Appends the vectors of a value that begins at `offset`, in the order of their slots, from `slot` on.
pub fn fill(layout: &Layout, block: usize, offset: usize, slot: &mut usize, out: &mut Vec<Filled>) {
    let mut one = |offset: usize, components: usize, kind: ScalarKind| {
        out.push(Filled { slot: *slot, block, offset, components, kind });
        *slot += 1;
    };
    match layout {
        Layout::Vector(n, kind) => one(offset, *n, *kind),
        Layout::Matrix(columns, rows) => (0..*columns).for_each(|k| one(offset + k * WIDE, *rows, ScalarKind::Float)),
        Layout::Array(element, count) => {
            (0..*count).for_each(|k| fill(element, block, offset + k * stride(element), slot, out));
        }
        Layout::Struct(_, members) => {
            let mut at = offset;
            for Member { layout, .. } in members {
                let (start, end) = place(layout, at);
                fill(layout, block, start, slot, out);
                at = end;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of the standard's section 7.6.2.2.
    #[test]
    fn members_lie_where_the_standard_says() {
        let float = |n| Layout::Vector(n, ScalarKind::Float);
        let array = |element: Layout, count| Layout::Array(Box::new(element), count);
        let member = |layout| Member { name: "m".into(), wgsl: "m".into(), layout };
        let structure = |members: Vec<Layout>| Layout::Struct("S".into(), members.into_iter().map(member).collect());
        let f = structure(vec![Layout::Vector(1, ScalarKind::Sint), Layout::Vector(2, ScalarKind::Bool)]);
        let o = structure(vec![
            Layout::Vector(3, ScalarKind::Uint),
            float(2),
            array(float(1), 2),
            float(2),
            array(Layout::Matrix(3, 3), 2),
        ]);
        let all = [float(1), float(2), float(3), f, float(1), array(float(1), 2), Layout::Matrix(2, 3), array(o, 2)];
        let (mut at, mut slot, mut filled) = (0, 0, Vec::new());
        for layout in &all {
            let (start, end) = place(layout, at);
            fill(layout, 0, start, &mut slot, &mut filled);
            at = end;
        }
        let offsets: Vec<usize> = filled.iter().map(|of| of.offset).collect();
        let first = [0, 8, 16, 32, 40, 48, 64, 80, 96, 112];
        let element = [0, 16, 32, 48, 64, 80, 96, 112, 128, 144, 160];
        let elements = element.iter().map(|at| 128 + at).chain(element.iter().map(|at| 304 + at));
        assert_eq!(offsets, first.into_iter().chain(elements).collect::<Vec<_>>());
        assert!(filled.iter().enumerate().all(|(k, of)| of.slot == k) && slot == filled.len());
    }
}
