//! Vertex arrays of half precision, of packed elements, and of colours with blue first: from memory and from buffer objects.

use fillrate::trace::Reading;

use super::gl_features::{BLACK, BLUE, GREEN, RED, last_of, near, recorded, shown};
use super::gl_later::program;

const DRAW: &str = "glDrawArrays(GL_TRIANGLE_STRIP,0,4)\n";
/// `GL_INT_2_10_10_10_REV`.
const SIGNED: &str = "36255";
const UNSIGNED: &str = "GL_UNSIGNED_INT_2_10_10_10_REV";

/// Draws with an array from memory, and the same from a buffer object. `pointer` has `@` where the address stands; `bytes` are its elements.
fn both(before: &str, pointer: &str, bytes: &[u8], draw: &str) -> [u8; 3] {
    let (memory, buffer) = (pointer.replace('@', "*1"), pointer.replace('@', "0"));
    let loaded = format!("glBindBufferARB(34962,1)\nglBufferDataARB(34962,{},*1,35044)\n", bytes.len());
    let [memory, buffer] =
        [memory, format!("{loaded}{buffer}")].map(|array| shown(&format!("{before}{array}\n{draw}"), &[bytes]));
    assert_eq!(memory.0, buffer.0, "{pointer}: a buffer object gives the picture of memory");
    assert_eq!(memory.at(8, 1), BLACK, "the lower half stays black");
    memory.at(8, 12)
}

/// The upper half with a colour array of four equal elements, after positions in memory.
fn colored(pointer: &str, element: &[u8]) -> [u8; 3] {
    let corners = "glBegin(GL_TRIANGLE_STRIP)\nglArrayElement(0)\nglVertex2f(-1,0)\nglArrayElement(1)\nglVertex2f(1,0)\n\
                   glArrayElement(2)\nglVertex2f(-1,1)\nglArrayElement(3)\nglVertex2f(1,1)\nglEnd()\n";
    both("glEnableClientState(GL_COLOR_ARRAY)\n", pointer, &element.repeat(4), corners)
}

fn halves(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// A packed element.
fn packed(x: i32, y: i32, z: i32, w: i32) -> [u8; 4] {
    let part = |value: i32, bits: u32, at: u32| ((value as u32) & ((1 << bits) - 1)) << at;
    (part(x, 10, 0) | part(y, 10, 10) | part(z, 10, 20) | part(w, 2, 30)).to_le_bytes()
}

#[test]
fn positions_in_half_precision() {
    let (one, minus, zero) = (0x3c00, 0xbc00, 0);
    let flat = halves(&[minus, zero, one, zero, minus, one, one, one]);
    let deep = halves(&[minus, zero, zero, one, zero, zero, minus, one, zero, one, one, zero]);
    let before = "glColor3f(0,0,1)\nglEnableClientState(GL_VERTEX_ARRAY)\n";
    assert_eq!(both(before, "glVertexPointer(2,GL_HALF_FLOAT,0,@)", &flat, DRAW), BLUE);
    assert_eq!(both(before, "glVertexPointer(3,GL_HALF_FLOAT,0,@)", &deep, DRAW), BLUE);
}

#[test]
fn packed_positions_are_whole_numbers_with_and_without_signs() {
    let corners = [[-1, 0], [1, 0], [-1, 1], [1, 1]].map(|[x, y]| packed(x, y, 0, 1)).concat();
    let before = "glColor3f(0,1,0)\nglEnableClientState(GL_VERTEX_ARRAY)\n";
    assert_eq!(both(before, &format!("glVertexPointer(4,{SIGNED},0,@)"), &corners, DRAW), GREEN);
    let corners = [[0, 2], [4, 2], [0, 4], [4, 4]].map(|[x, y]| packed(x, y, 0, 1)).concat();
    let before = format!("glTranslatef(-1,-1,0)\nglScalef(0.5,0.5,1)\n{before}");
    assert_eq!(both(&before, &format!("glVertexPointer(4,{UNSIGNED},0,@)"), &corners, DRAW), GREEN);
}

#[test]
fn colours_are_normalised_whatever_they_are_stored_in() {
    assert_eq!(colored("glColorPointer(GL_BGRA,GL_UNSIGNED_BYTE,0,@)", &[0, 0, 255, 255]), RED);
    assert_eq!(colored(&format!("glColorPointer(4,{UNSIGNED},0,@)"), &packed(1023, 0, 0, 3)), RED);
    assert_eq!(colored(&format!("glColorPointer(GL_BGRA,{UNSIGNED},0,@)"), &packed(1023, 0, 0, 3)), BLUE);
    assert!(near(colored(&format!("glColorPointer(4,{SIGNED},0,@)"), &packed(511, 256, -200, 1)), [255, 128, 0]));
    assert!(near(colored("glColorPointer(3,GL_HALF_FLOAT,0,@)", &halves(&[0x3800, 0x3c00, 0])), [128, 255, 0]));
}

#[test]
fn an_array_of_another_size_is_an_error() {
    // A packed element has four components, and texture coordinates no blue: these calls have no effect.
    let calls = "glEnableClientState(GL_VERTEX_ARRAY)\nglColor3f(1,0,0)\nglVertexPointer(2,GL_FLOAT,0,*1)\n";
    let bytes: Vec<u8> = [-1_f32, -1.0, 1.0, -1.0, -1.0, 1.0, 1.0, 1.0].iter().flat_map(|value| value.to_le_bytes()).collect();
    assert_eq!(shown(&format!("{calls}{DRAW}"), &[&bytes]).at(8, 8), RED);
    for wrong in [format!("glVertexPointer(3,{UNSIGNED},0,*1)"), "glVertexPointer(GL_BGRA,GL_UNSIGNED_BYTE,0,*1)".into()] {
        let calls = format!("{calls}{wrong}\n{DRAW}");
        let (trace, report) = recorded(&calls, &[&bytes], 0..u64::MAX, &Reading::default());
        assert_eq!((report.unsupported.len(), report.errors.len()), (0, 1), "{wrong}");
        assert_eq!(last_of(&trace).at(8, 8), RED);
    }
}

#[test]
fn counts_of_draws_come_from_buffer_objects() {
    // Three corners of the lower left half, then three of the upper right one.
    let corners = [-1_f32, -1.0, 1.0, -1.0, -1.0, 1.0, 1.0, 1.0, -1.0, 1.0, 1.0, -1.0].map(f32::to_le_bytes).concat();
    let words = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>();
    let halves = |counts: &[u32], draw: &str| {
        let calls = format!(
            "glEnableClientState(GL_VERTEX_ARRAY)\nglVertexPointer(2,GL_FLOAT,0,*1)\nglBindBufferARB(36671,1)\n\
             glBufferDataARB(36671,{},*2,35044)\nglBindBufferARB(34963,2)\nglBufferDataARB(34963,3,*3,35044)\n{draw}\n",
            4 * counts.len()
        );
        let image = shown(&calls, &[&corners, &words(counts), &[0, 1, 2]]);
        [image.at(3, 3) != BLACK, image.at(12, 12) != BLACK]
    };
    // Count, instances, first vertex, base instance.
    assert_eq!(halves(&[3, 1, 0, 0], "glDrawArraysIndirect(GL_TRIANGLES,0)"), [true, false]);
    assert_eq!(halves(&[9, 9, 9, 3, 1, 3, 0], "glDrawArraysIndirect(GL_TRIANGLES,12)"), [false, true]);
    assert_eq!(halves(&[3, 0, 0, 0], "glDrawArraysIndirect(GL_TRIANGLES,0)"), [false, false]);
    assert_eq!(halves(&[3, 1, 0, 0, 7, 3, 1, 3, 0, 7], "glMultiDrawArraysIndirect(GL_TRIANGLES,0,2,20)"), [true, true]);
    // Count, instances, first index, base vertex, base instance.
    assert_eq!(halves(&[3, 1, 0, 3, 0], "glDrawElementsIndirect(GL_TRIANGLES,GL_UNSIGNED_BYTE,0)"), [false, true]);
    let two = [3, 1, 0, 0, 0, 3, 1, 0, 3, 0];
    assert_eq!(halves(&two, "glMultiDrawElementsIndirect(GL_TRIANGLES,GL_UNSIGNED_BYTE,0,2,0)"), [true, true]);
    assert_eq!(halves(&two, "glMultiDrawElementsIndirect(GL_TRIANGLES,GL_UNSIGNED_BYTE,20,1,0)"), [false, true]);
    let based = "glMultiDrawElementsBaseVertex(GL_TRIANGLES,{3,3},GL_UNSIGNED_BYTE,{0,0},2,{3,3})";
    assert_eq!(halves(&[0], based), [false, true]);
}

#[test]
fn programs_draw_without_an_array_of_positions() {
    // Two triangles that cover the window, from an attribute that is not the first one.
    let corners = [-1.0_f32, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 1.0, 1.0, -1.0, 1.0];
    let corners: Vec<u8> = corners.iter().flat_map(|value| value.to_le_bytes()).collect();
    let array = "glVertexAttribPointer(3,2,GL_FLOAT,0,0,*1)\nglEnableVertexAttribArray(3)\n";
    let draw = "glDrawArrays(GL_TRIANGLES,0,6)\n";
    // The first attribute is the same for all vertices.
    let vertex = "attribute vec4 tint; attribute vec2 place; varying vec4 c; void main() { gl_Position = vec4(place, 0.0, 1.0); c = tint; }";
    let fragment = "varying vec4 c; void main() { gl_FragColor = c; }";
    let linked = program(10, vertex, fragment).replace(
        "glLinkProgram(12)",
        "glBindAttribLocation(12,0,\"tint\")\nglBindAttribLocation(12,3,\"place\")\nglLinkProgram(12)",
    );
    assert_eq!(shown(&format!("{linked}glVertexAttrib4f(0,0,1,0,1)\n{array}{draw}"), &[&corners]).lit().len(), 256);
    assert_eq!(shown(&format!("{linked}glVertexAttrib4f(0,0,1,0,1)\n{array}{draw}"), &[&corners]).at(8, 8), GREEN);
    let text = "!!ARBvp1.0\nMOV result.position, vertex.attrib[3];\nMOV result.color, {1,0,0,1};\nEND";
    let assembly = format!(
        "glEnable(GL_VERTEX_PROGRAM_ARB)\nglProgramStringARB(GL_VERTEX_PROGRAM_ARB,GL_PROGRAM_FORMAT_ASCII_ARB,{},\"{text}\")\n",
        text.len()
    );
    assert_eq!(shown(&format!("{assembly}{array}{draw}"), &[&corners]).at(8, 8), RED);
    // From no array at all.
    let alone = "void main() { gl_Position = vec4(0.0, 0.0, 0.0, 1.0); gl_FrontColor = vec4(0.0, 0.0, 1.0, 1.0); }";
    let point = format!(
        "{}glPointSize(4)\nglDrawArrays(GL_POINTS,0,1)\n",
        program(10, alone, "void main() { gl_FragColor = gl_Color; }")
    );
    assert_eq!(shown(&point, &[]).lit().len(), 16);
    // Fixed functions draw nothing.
    assert_eq!(shown(&format!("{array}{draw}"), &[&corners]).lit(), []);
}
