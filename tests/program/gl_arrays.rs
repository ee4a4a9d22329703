//! Vertex arrays and packed attributes: their formats, from memory and from buffer objects, and the indices that select elements.

use fillrate::gfx::state::Topology;
use fillrate::trace::command::Command;
use fillrate::trace::{Reading, TraceError};

use super::gl_scenes::{
    BLACK, BLUE, GREEN, NEAREST_FILTERS, ORTHO, QUAD, RED, floats, imported_with, last_of, near, program, recorded, refused,
    shown, with_errors,
};

#[test]
fn kept_draws_are_those_of_the_program() {
    let corners = [[1, 1], [1, 15], [15, 1], [15, 15]];
    let kinds: [(&str, &[usize], Topology); 6] = [
        ("GL_TRIANGLES", &[0, 2, 1, 1, 2, 3], Topology::TriangleList),
        ("GL_TRIANGLE_STRIP", &[0, 2, 1, 3], Topology::TriangleStrip),
        ("GL_TRIANGLE_FAN", &[0, 2, 3, 1], Topology::TriangleFan),
        ("GL_QUADS", &[0, 2, 3, 1], Topology::QuadList),
        ("GL_QUAD_STRIP", &[1, 0, 3, 2], Topology::TriangleStrip),
        ("GL_POLYGON", &[0, 2, 3, 1], Topology::TriangleFan),
    ];
    for (kind, order, topology) in kinds {
        // The colours are not those of a plane: the picture shows the diagonal.
        let corner = |&k: &usize| {
            let [x, y] = corners[k];
            format!("glColor3f({},0.25,{})\nglVertex2f({x},{y})\n", [0.1, 0.9, 0.4, 0.2][k], [1.0, 0.5, 0.9, 0.7][k])
        };
        let vertices: String = order.iter().map(corner).collect();
        let calls = format!(
            "glOrtho(0,16,0,16,-1,1)\nglRotatef(0.5,0,0,1)\nglEnable(GL_CULL_FACE)\nglBegin({kind})\n{vertices}glEnd()\n"
        );
        let joined = shown(&calls, &[]);
        let (trace, _) = imported_with(&calls, &[], 0..u64::MAX, &Reading { keep_draws: true, ..Reading::default() });
        let kept = last_of(&trace);
        assert!(joined.0.iter().zip(&kept.0).all(|(&a, &b)| near(a, b)), "{kind}: the same picture");
        assert!(kept.lit().len() > 150, "{kind}");
        let (mut topologies, mut draws) = (Vec::new(), Vec::new());
        let seen: Result<(), TraceError> = trace.for_each_command(|_, command| {
            match command {
                Command::CreateRenderPipeline { desc, .. } => topologies.push(desc.primitive.topology),
                Command::Draw { vertices, .. } => draws.push(*vertices as usize),
                Command::DrawIndexed { .. } => panic!("{kind}: the program sends no indices"),
                _ => {}
            }
            Ok(())
        });
        seen.expect("a trace");
        assert_eq!((topologies, draws), (vec![topology], vec![order.len()]), "{kind}");
    }
}

#[test]
fn interleaved_arrays_have_their_parts_where_the_standard_says() {
    // Of each format: components and place of colours, whether these are bytes, and of positions; bytes of a vertex (OpenGL 1.5, table 2.5).
    type Format = (&'static str, Option<(usize, bool)>, (usize, usize), usize);
    const FORMATS: [Format; 14] = [
        ("GL_V2F", None, (2, 0), 8),
        ("GL_V3F", None, (3, 0), 12),
        ("GL_C4UB_V2F", Some((0, true)), (2, 4), 12),
        ("GL_C4UB_V3F", Some((0, true)), (3, 4), 16),
        ("GL_C3F_V3F", Some((0, false)), (3, 12), 24),
        ("GL_N3F_V3F", None, (3, 12), 24),
        ("GL_C4F_N3F_V3F", Some((0, false)), (3, 28), 40),
        ("GL_T2F_V3F", None, (3, 8), 20),
        ("GL_T4F_V4F", None, (4, 16), 32),
        ("GL_T2F_C4UB_V3F", Some((8, true)), (3, 12), 24),
        ("GL_T2F_C3F_V3F", Some((8, false)), (3, 20), 32),
        ("GL_T2F_N3F_V3F", None, (3, 20), 32),
        ("GL_T2F_C4F_N3F_V3F", Some((8, false)), (3, 36), 48),
        ("GL_T4F_C4F_N3F_V4F", Some((16, false)), (4, 44), 60),
    ];
    for (format, color, (components, position), vertex) in FORMATS {
        for gap in [0, 4] {
            // Behind four bytes that are skipped, the left half of the window in red, where there are colours.
            let stride = vertex + gap;
            let mut bytes = vec![0x55; 4 + 4 * stride];
            for (n, [x, y]) in [[-1.0_f32, -1.0], [0.0, -1.0], [0.0, 1.0], [-1.0, 1.0]].into_iter().enumerate() {
                let start = 4 + n * stride;
                for (k, value) in [x, y, 0.0, 1.0][..components].iter().enumerate() {
                    bytes[start + position + 4 * k..][..4].copy_from_slice(&value.to_le_bytes());
                }
                match color {
                    Some((at, true)) => bytes[start + at..][..4].copy_from_slice(&[255, 0, 0, 255]),
                    Some((at, false)) => {
                        for (k, value) in [1.0_f32, 0.0, 0.0].iter().enumerate() {
                            bytes[start + at + 4 * k..][..4].copy_from_slice(&value.to_le_bytes());
                        }
                    }
                    None => {}
                }
            }
            let given = if gap == 0 { 0 } else { stride };
            let draw = "glDrawArrays(GL_QUADS,0,4)";
            let memory = shown(&format!("glColor3f(0,1,0)\nglInterleavedArrays({format},{given},*1)\n{draw}"), &[&bytes[4..]]);
            let object = shown(
                &format!(
                    "glColor3f(0,1,0)\nglEnableClientState(GL_EDGE_FLAG_ARRAY)\nglBindBufferARB(34962,1)\n\
                     glBufferDataARB(34962,{},*1,35044)\nglInterleavedArrays({format},{given},4)\n{draw}",
                    bytes.len()
                ),
                &[&bytes],
            );
            let wanted = if color.is_some() { RED } else { GREEN };
            for (of, shown) in [("memory", memory), ("object", object)] {
                assert_eq!(
                    [shown.at(3, 3), shown.at(7, 12), shown.at(8, 12)],
                    [wanted, wanted, BLACK],
                    "{format}, {gap}, {of}"
                );
            }
        }
    }
}

#[test]
fn packed_attributes_are_sent_between_begin_and_end() {
    const UNSIGNED: u32 = 33640;
    const SIGNED: u32 = 36255;
    let word = |[x, y, z, w]: [u32; 4]| x & 1023 | (y & 1023) << 10 | (z & 1023) << 20 | w << 30;
    let corner = |kind: u32, x: u32, y: u32| format!("glVertexP2ui({kind},{})\n", word([x, y, 7, 1]));
    let triangle = |kind: u32| {
        let corners = [corner(kind, 0, 0), corner(kind, 16, 0), corner(kind, 0, 16)].concat();
        format!("glColorP3ui({UNSIGNED},{})\n{corners}", word([0, 1023, 0, 0]))
    };
    for kind in [UNSIGNED, SIGNED] {
        let begun = format!("glBegin(GL_TRIANGLES)\n{}glEnd()\n", triangle(kind));
        assert_eq!(shown(&format!("{ORTHO}{begun}"), &[]).at(2, 2), GREEN);
        let list = format!("{ORTHO}glNewList(1,GL_COMPILE)\n{begun}glEndList()\nglCallList(1)");
        assert_eq!(shown(&list, &[]).at(2, 2), GREEN, "in a list");
    }
    let colored = |call: String| shown(&format!("{call}\n{QUAD}"), &[]).at(8, 8);
    // Values measured in Mesa: 255 of 1023, and 255 of 511 with a sign.
    assert!(near(colored(format!("glColorP4ui({UNSIGNED},{})", word([255, 0, 512, 1]))), [64, 0, 128]));
    assert!(near(colored(format!("glColorP3ui({SIGNED},{})", word([255, 1023, 511, 0]))), [127, 0, 255]));
    assert_eq!(colored(format!("glColorP3uiv({UNSIGNED},{{{}}})", word([1023, 0, 0, 0]))), RED);
    let secondary =
        format!("glEnable(GL_COLOR_SUM)\nglColor3f(0,0,0)\nglSecondaryColorP3ui({UNSIGNED},{})", word([0, 0, 1023, 0]));
    assert_eq!(colored(secondary), BLUE);
    let lit = format!("glEnable(GL_LIGHTING)\nglEnable(GL_LIGHT0)\nglNormalP3ui({SIGNED},{})", word([0, 0, 511, 0]));
    assert_eq!(colored(lit.clone()), colored("glEnable(GL_LIGHTING)\nglEnable(GL_LIGHT0)\nglNormal3f(0,0,1)".into()));
    assert!(colored(lit)[0] > 100);
    // Three texels; the coordinate is not normalised.
    let texels = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255]].concat();
    for call in [format!("glTexCoordP1ui({UNSIGNED},2)"), format!("glMultiTexCoordP1ui(GL_TEXTURE0,{UNSIGNED},2)")] {
        let drawn = format!(
            "{NEAREST_FILTERS}glTexImage2D(3553,0,6408,3,1,0,6408,5121,*1)\nglMatrixMode(GL_TEXTURE)\nglScalef(0.25,1,1)\n{call}\n{QUAD}"
        );
        assert_eq!(shown(&drawn, &[&texels]).at(8, 8), GREEN, "{call}");
    }
    assert_eq!(with_errors(&format!("glColorP3ui(GL_FLOAT,3)\n{QUAD}"), &[]).1, 1);
    assert!(refused("glBegin(GL_POINTS)\nglVertexStream2fATI(0,1,1)\nglEnd()", &[]).starts_with("glVertexStream2fATI"));
}

#[test]
fn indices_end_primitives() {
    // Two strips of a column each, beside a corner that only a strip that goes on would reach.
    let corners = floats(&[0.0, 0.0, 2.0, 0.0, 0.0, 16.0, 2.0, 16.0, 8.0, 0.0, 10.0, 0.0, 8.0, 16.0, 10.0, 16.0]);
    let indices = [0_u8, 1, 2, 3, 255, 4, 5, 6, 7];
    let words: Vec<u8> = indices.iter().flat_map(|&index| [index, 0]).collect();
    let arrays = format!("{ORTHO}glEnableClientState(GL_VERTEX_ARRAY)\nglVertexPointer(2,GL_FLOAT,0,*1)\n");
    let columns = |calls: &str| {
        let image = shown(&format!("{arrays}{calls}"), &[&corners, &indices, &words]);
        (0..16).filter(|&x| image.at(x, 8) != BLACK).collect::<Vec<_>>()
    };
    let draw = "glDrawElements(GL_TRIANGLE_STRIP,9,GL_UNSIGNED_BYTE,*2)\n";
    let apart = [0, 1, 8, 9];
    assert_eq!(columns(&format!("glEnable(36765)\nglPrimitiveRestartIndex(255)\n{draw}")), apart);
    assert_eq!(columns(&format!("glEnable(36201)\n{draw}")), apart);
    assert_eq!(columns(&format!("glEnableClientState(34136)\nglPrimitiveRestartIndexNV(255)\n{draw}")), apart);
    let short = "glDrawElements(GL_TRIANGLE_STRIP,9,GL_UNSIGNED_SHORT,*3)\n";
    assert_eq!(columns(&format!("glEnable(36765)\nglPrimitiveRestartIndex(255)\n{short}")), apart);
    // In buffer objects, with a number that is added to the other indices only.
    let object = "glBindBufferARB(34963,2)\nglBufferDataARB(34963,9,*2,35044)\nglBindBufferARB(34962,1)\nglBufferDataARB(34962,64,*1,35044)\nglVertexPointer(2,GL_FLOAT,0,0)\n\
         glEnable(36765)\nglPrimitiveRestartIndex(255)\n";
    assert_eq!(columns(&format!("{object}glDrawElements(GL_TRIANGLE_STRIP,9,GL_UNSIGNED_BYTE,0)")), apart);
    let based = "glDrawElementsBaseVertex(GL_TRIANGLE_STRIP,5,GL_UNSIGNED_BYTE,0,4)";
    assert_eq!(columns(&format!("{object}{based}")), [8, 9]);
    // Elements that are sent one by one.
    let elements: String = indices.iter().map(|index| format!("glArrayElement({index})\n")).collect();
    let begun = format!("glBegin(GL_TRIANGLE_STRIP)\n{elements}glEnd()\n");
    assert_eq!(columns(&format!("{object}{begun}")), apart);
    for calls in [format!("glEnable(36201)\n{begun}"), format!("glNewList(1,GL_COMPILE)\n{begun}glEndList()\n")] {
        assert!(refused(&format!("{arrays}{object}{calls}"), &[&corners, &indices]).starts_with("glArrayElement"), "{calls}");
    }
}

#[test]
fn a_call_ends_a_primitive_and_begins_the_next() {
    let strip = |x: u32| format!("glVertex2i({x},0)\nglVertex2i({},0)\nglVertex2i({x},16)\nglVertex2i({},16)\n", x + 2, x + 2);
    let both = format!("glBegin(GL_TRIANGLE_STRIP)\n{}glPrimitiveRestartNV()\n{}glEnd()\n", strip(0), strip(8));
    let columns = |calls: &str| {
        let image = shown(&format!("{ORTHO}{calls}"), &[]);
        (0..16).filter(|&x| image.at(x, 8) != BLACK).collect::<Vec<_>>()
    };
    assert_eq!(columns(&both), [0, 1, 8, 9]);
    assert_eq!(columns(&format!("glNewList(1,GL_COMPILE)\n{both}glEndList()\nglCallList(1)")), [0, 1, 8, 9]);
    assert_eq!(with_errors("glPrimitiveRestartNV()", &[]).1, 1);
}

#[test]
fn elements_of_several_draws_have_indices_of_their_own() {
    let corners: Vec<u8> =
        [0.0_f32, 0.0, 4.0, 0.0, 0.0, 4.0, 8.0, 8.0, 12.0, 8.0, 8.0, 12.0].iter().flat_map(|v| v.to_le_bytes()).collect();
    let image = shown(
        &format!(
            "{ORTHO}glEnableClientState(GL_VERTEX_ARRAY)\nglVertexPointer(2,GL_FLOAT,0,*1)\nglBindBufferARB(34963,1)\nglBufferDataARB(34963,6,*2,35044)\n\
             glMultiDrawElements(GL_TRIANGLES,{{3,3}},GL_UNSIGNED_BYTE,{{0,3}},2)"
        ),
        &[&corners, &[0, 1, 2, 3, 4, 5]],
    );
    assert!(image.at(1, 1) != BLACK && image.at(9, 9) != BLACK && image.at(6, 6) == BLACK);
}

const DRAW: &str = "glDrawArrays(GL_TRIANGLE_STRIP,0,4)\n";

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

fn halves(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
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

/// `GL_INT_2_10_10_10_REV`.
const SIGNED: &str = "36255";

const UNSIGNED: &str = "GL_UNSIGNED_INT_2_10_10_10_REV";

/// A packed element.
fn packed(x: i32, y: i32, z: i32, w: i32) -> [u8; 4] {
    let part = |value: i32, bits: u32, at: u32| ((value as u32) & ((1 << bits) - 1)) << at;
    (part(x, 10, 0) | part(y, 10, 10) | part(z, 10, 20) | part(w, 2, 30)).to_le_bytes()
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

/// The upper half with a colour array of four equal elements, after positions in memory.
fn colored(pointer: &str, element: &[u8]) -> [u8; 3] {
    let corners = "glBegin(GL_TRIANGLE_STRIP)\nglArrayElement(0)\nglVertex2f(-1,0)\nglArrayElement(1)\nglVertex2f(1,0)\n\
                   glArrayElement(2)\nglVertex2f(-1,1)\nglArrayElement(3)\nglVertex2f(1,1)\nglEnd()\n";
    both("glEnableClientState(GL_COLOR_ARRAY)\n", pointer, &element.repeat(4), corners)
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

#[test]
fn arrays_are_enabled_as_capabilities_are() {
    let arrays = [floats(&[0.0, 0.0, 16.0, 0.0, 0.0, 16.0]), floats(&[0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0])];
    let draw = |calls: &str| {
        let calls = format!(
            "{ORTHO}glVertexPointer(2,GL_FLOAT,0,*1)\nglColorPointer(3,GL_FLOAT,0,*2)\nglColor3f(1,0,0)\n{calls}\nglDrawArrays(GL_TRIANGLES,0,3)"
        );
        shown(&calls, &[&arrays[0], &arrays[1]]).at(2, 2)
    };
    assert_eq!(draw("glEnable(GL_VERTEX_ARRAY)\nglEnable(GL_COLOR_ARRAY)"), GREEN);
    assert_eq!(
        draw("glEnableClientState(GL_VERTEX_ARRAY)\nglEnableClientState(GL_COLOR_ARRAY)\nglDisable(GL_COLOR_ARRAY)"),
        RED
    );
    // In a list, they are switched when it is called.
    assert_eq!(draw("glNewList(1,GL_COMPILE)\nglEnable(GL_VERTEX_ARRAY)\nglEndList()"), BLACK);
    assert_eq!(draw("glNewList(1,GL_COMPILE)\nglEnable(GL_VERTEX_ARRAY)\nglEndList()\nglCallList(1)"), RED);
}
