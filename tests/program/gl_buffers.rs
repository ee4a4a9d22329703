//! Draws from buffer objects: what stays on the card, what is uploaded again, and that pictures are those of arrays in memory.

use fillrate::num::BufferId;
use fillrate::trace::command::{Command, Object};
use fillrate::trace::{Reading, Trace, TraceError};

use super::gl_scenes::{
    BLACK, BLUE, GREEN, ORTHO, RED, Shown, floats, imported, imported_with, last_of, recorded, shown, with_errors,
};

const POSITIONS: &str =
    "glMatrixMode(GL_PROJECTION)\nglOrtho(0,16,0,16,-1,1)\nglMatrixMode(GL_MODELVIEW)\nglEnableClientState(GL_VERTEX_ARRAY)\n";
const SWAP: &str = "wglSwapBuffers(1)\nglClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT)\n";
const DRAW: &str = "glDrawArrays(GL_TRIANGLE_STRIP,0,4)\n";
const TARGET: u32 = 34_962;

/// Copies of buffer objects in a trace.
#[derive(Debug, Default, PartialEq, Eq)]
struct Copies {
    made: Vec<(BufferId, u64)>,
    /// Conversions of buffer objects; they are among the copies.
    converted: usize,
    freed: usize,
    /// Offset and size of each upload.
    uploads: Vec<(u64, u64)>,
    /// The most bytes of copies at any time.
    most: u64,
    /// Draws that read a copy as vertices.
    draws: usize,
    /// Buffers with vertices of single passes.
    others: usize,
}

fn copies(trace: &Trace) -> Copies {
    let (mut copies, mut live, mut from_copy) = (Copies::default(), Vec::new(), false);
    let seen: Result<(), TraceError> = trace.for_each_command(|_, command| {
        let known = |id: &BufferId| copies.made.iter().any(|(known, _)| known == id);
        match command {
            Command::CreateBuffer { id, size, label } if matches!(label.as_deref(), Some("buffer" | "converted")) => {
                copies.converted += usize::from(label.as_deref() == Some("converted"));
                copies.made.push((*id, *size));
                live.push((*id, *size));
            }
            Command::CreateBuffer { label, .. } if label.as_deref() == Some("vertices") => copies.others += 1,
            Command::WriteBuffer { id, offset, data } if known(id) => copies.uploads.push((*offset, data.size)),
            Command::Destroy(Object::Buffer(id)) if known(id) => {
                copies.freed += 1;
                live.retain(|(known, _)| known != id);
            }
            Command::SetVertexBuffer { buffer: Some(id), .. } => from_copy = known(id),
            Command::Draw { .. } | Command::DrawIndexed { .. } => copies.draws += usize::from(from_copy),
            _ => {}
        }
        copies.most = copies.most.max(live.iter().map(|(_, size)| size).sum());
        Ok(())
    });
    seen.expect("a trace");
    copies
}

/// Corners of a rectangle for a triangle strip.
fn corners(x: f32, y: f32) -> Vec<u8> {
    floats(&[x, y, x + 4.0, y, x, y + 4.0, x + 4.0, y + 4.0])
}

/// Makes a buffer object of four corners from `*source`.
fn object(name: u32, source: u32) -> String {
    format!("glBindBufferARB({TARGET},{name})\nglBufferDataARB({TARGET},32,*{source},35044)\nglVertexPointer(2,GL_FLOAT,0,0)\n")
}

#[test]
fn a_buffer_object_that_does_not_change_is_uploaded_once() {
    let calls = format!("{POSITIONS}{}{DRAW}{SWAP}{DRAW}{SWAP}glColor3f(0,1,0)\n{DRAW}", object(1, 1));
    let (trace, _) = imported(&calls, &[&corners(2.0, 2.0)], 0..u64::MAX);
    let Copies { made, freed, uploads, draws, others, .. } = copies(&trace);
    assert_eq!((made.len(), freed, uploads, draws, others), (1, 0, vec![(0, 32)], 3, 0));
    let image = last_of(&trace);
    assert_eq!([image.at(3, 3), image.at(7, 3)], [GREEN, BLACK]);
    assert_eq!(image.lit().len(), 16);
    // The upload of a frame that is left out is there for those that are drawn: the last one, and the one whose contents it begins with.
    let (trace, _) = imported(&calls, &[&corners(2.0, 2.0)], 2..3);
    let Copies { made, uploads, draws, .. } = copies(&trace);
    assert_eq!((made.len(), uploads, draws), (1, vec![(0, 32)], 2));
    assert!(last_of(&trace).0 == image.0);
}

#[test]
fn of_a_changed_buffer_object_only_the_change_is_uploaded() {
    let change = format!("glBufferSubDataARB({TARGET},16,16,*2)\n");
    let calls = format!("{POSITIONS}{}{DRAW}{SWAP}{change}{DRAW}", object(1, 1));
    let (trace, _) = imported(&calls, &[&corners(2.0, 2.0), &corners(2.0, 6.0)[16..]], 0..u64::MAX);
    let Copies { made, uploads, draws, .. } = copies(&trace);
    assert_eq!((made.len(), uploads, draws), (1, vec![(0, 32), (16, 16)], 2));
    assert_eq!(last_of(&trace).lit().len(), 32, "a rectangle of 4 x 8");
    // What was changed in a frame that is left out is not uploaded in the first one that is drawn.
    let (trace, _) = imported(&format!("{calls}{SWAP}{DRAW}"), &[&corners(2.0, 2.0), &corners(2.0, 6.0)[16..]], 2..3);
    let mut last = String::new();
    let seen: Result<(), TraceError> = trace.for_each_command(|_, command| {
        match command {
            Command::Present { .. } => last.push('|'),
            Command::WriteBuffer { data, .. } if data.size == 16 => last.push('w'),
            _ => {}
        }
        Ok(())
    });
    seen.expect("a trace");
    assert_eq!((last.as_str(), last_of(&trace).lit().len()), ("|w||", 32));
}

#[test]
fn draws_before_a_change_keep_the_vertices_that_they_had() {
    let (first, second, third) = (corners(0.0, 0.0), corners(8.0, 0.0), corners(8.0, 8.0));
    let colors = ["glColor3f(1,0,0)\n", "glColor3f(0,1,0)\n", "glColor3f(0,0,1)\n"];
    let sub = |k: u32| format!("glBufferSubDataARB({TARGET},0,32,*{k})\n");
    let all = |k: u32| format!("glBufferDataARB({TARGET},32,*{k},35044)\n");
    let part = |k: u32| format!("glBufferSubDataARB({TARGET},0,16,*{k})\nglBufferSubDataARB({TARGET},16,16,*{})\n", k + 3);
    for (change, copied) in [(&sub as &dyn Fn(u32) -> String, 3), (&all, 3), (&part, 3)] {
        let [a, b, c] = colors;
        let calls = format!("{POSITIONS}{}{a}{DRAW}{}{b}{DRAW}{}{c}{DRAW}", object(1, 1), change(2), change(3));
        let sources = [&first[..], &second, &third, &first[16..], &second[16..], &third[16..]];
        let (trace, _) = imported(&calls, &sources, 0..u64::MAX);
        let image = last_of(&trace);
        assert_eq!([image.at(1, 1), image.at(9, 1), image.at(9, 9), image.at(1, 9)], [RED, GREEN, BLUE, BLACK]);
        let Copies { made, freed, .. } = copies(&trace);
        assert_eq!((made.len(), freed), (copied, copied - 1));
    }
    // A change of other bytes than those that were drawn needs no second copy.
    let both = [first, second].concat();
    let calls = format!(
        "{POSITIONS}glBindBufferARB({TARGET},1)\nglBufferDataARB({TARGET},64,U0x0,35044)\nglVertexPointer(2,GL_FLOAT,0,0)\n\
         glBufferSubDataARB({TARGET},0,32,*1)\nglColor3f(1,0,0)\n{DRAW}glBufferSubDataARB({TARGET},32,32,*2)\nglColor3f(0,1,0)\n\
         glDrawArrays(GL_TRIANGLE_STRIP,4,4)"
    );
    let (trace, _) = imported(&calls, &[&both[..32], &both[32..]], 0..u64::MAX);
    let Copies { made, uploads, draws, .. } = copies(&trace);
    assert_eq!((made.len(), uploads, draws), (1, vec![(0, 32), (32, 32)], 2));
    assert_eq!([last_of(&trace).at(1, 1), last_of(&trace).at(9, 1)], [RED, GREEN]);
    // A change of a part that was drawn: the next draw takes its vertices along, and the copy follows in the next frame.
    let calls = format!(
        "{POSITIONS}{}glColor3f(1,0,0)\n{DRAW}glBufferSubDataARB({TARGET},16,16,*2)\nglColor3f(0,1,0)\nglTranslatef(8,0,0)\n{DRAW}",
        object(1, 1)
    );
    let sources = [&both[..32], &corners(0.0, 8.0)[16..]];
    let (trace, _) = imported(&calls, &sources, 0..u64::MAX);
    let image = last_of(&trace);
    assert_eq!([image.at(1, 3), image.at(1, 5), image.at(9, 11)], [RED, BLACK, GREEN]);
    let Copies { made, uploads, draws, others, .. } = copies(&trace);
    assert_eq!((made.len(), uploads, draws, others), (1, vec![(0, 32)], 1, 1));
    let (trace, _) = imported(&format!("{calls}{SWAP}{DRAW}"), &sources, 0..u64::MAX);
    assert_eq!(copies(&trace).uploads, [(0, 32), (16, 16)]);
    assert_eq!(last_of(&trace).at(9, 11), GREEN);
}

#[test]
fn a_deleted_buffer_object_leaves_the_card_and_its_name_can_be_given_again() {
    let calls = format!("{POSITIONS}{}glColor3f(1,0,0)\n{DRAW}glDeleteBuffersARB(1,{{1}})\n", object(1, 1));
    let again = format!("{}glColor3f(0,1,0)\n{DRAW}", object(1, 2));
    let (trace, _) = imported(&format!("{calls}{again}"), &[&corners(0.0, 0.0), &corners(8.0, 8.0)], 0..u64::MAX);
    let image = last_of(&trace);
    assert_eq!([image.at(1, 1), image.at(9, 9)], [RED, GREEN]);
    let Copies { made, freed, uploads, .. } = copies(&trace);
    assert_eq!((made.len(), freed, uploads), (2, 1, vec![(0, 32); 2]));
}

#[test]
fn buffer_objects_that_change_in_each_frame_do_not_pile_up() {
    let sources = [corners(0.0, 0.0), corners(8.0, 8.0)];
    let sources = [&sources[0][..], &sources[1]];
    let frame = |k: u32, size: u32| {
        format!("glBufferDataARB({TARGET},{size},U0x0,35040)\nglBufferSubDataARB({TARGET},0,32,*{})\n{DRAW}{SWAP}", k % 2 + 1)
    };
    for frames in [0..u64::MAX, 99..100] {
        let calls: String = (0..100).map(|k| frame(k, 32 + k)).collect();
        let (trace, _) = imported(&format!("{POSITIONS}{}{calls}{DRAW}", object(1, 1)), &sources, frames.clone());
        let Copies { most, made, freed, .. } = copies(&trace);
        assert!(most <= 4 * 132, "{most} bytes of copies in frames {frames:?}");
        assert!(made.len() - freed <= 2);
        // The whole contents anew, several times per frame.
        let anew = |k: u32| {
            format!("glBufferDataARB({TARGET},32,*{},35040)\n{DRAW}{}", k % 2 + 1, if k.is_multiple_of(4) { SWAP } else { "" })
        };
        let calls: String = (0..400).map(anew).collect();
        let (trace, _) = imported(&format!("{POSITIONS}{}{calls}", object(1, 1)), &sources, frames.clone());
        let Copies { most, made, freed, .. } = copies(&trace);
        assert!(most <= 5 * 32, "{most} bytes of copies in frames {frames:?}");
        assert!(made.len() - freed <= 2);
    }
    // A frame in which more is replaced than may wait for one pass: first many small copies, then few large ones.
    let anew: String = (0..3000).map(|k| format!("glBufferDataARB({TARGET},32,*{},35040)\n{DRAW}", k % 2 + 1)).collect();
    let (trace, _) = imported(&format!("{POSITIONS}{}{anew}", object(1, 1)), &sources, 0..u64::MAX);
    let Copies { most, draws, .. } = copies(&trace);
    assert!(most <= 1100 * 32 && draws == 3000, "{most} bytes of copies, {draws} draws");
    let size = 3 << 20;
    let big = vec![0; size];
    let anew = format!("glBufferDataARB({TARGET},{size},*1,35040)\n{DRAW}").repeat(40);
    let (trace, _) = imported(&format!("{POSITIONS}{}{anew}", object(1, 2)), &[&big, sources[0]], 0..u64::MAX);
    let most = copies(&trace).most;
    assert!(most <= 68 << 20, "{most} bytes of copies");
}

/// A type of numbers, and the bytes of one.
type NumberType<T> = (&'static str, fn(T) -> Vec<u8>);

/// The calls that give an array: from a buffer object of its own, or from memory.
struct ArraySource {
    buffers: Vec<Vec<u8>>,
    calls: String,
    resident: bool,
}

impl ArraySource {
    /// Gives the bytes from `offset` on to a function of arrays.
    fn array(&mut self, call: &str, bytes: &[u8], offset: usize) {
        let name = self.buffers.len() + 1;
        let at = if self.resident {
            self.calls +=
                &format!("glBindBufferARB({TARGET},{name})\nglBufferDataARB({TARGET},{},*{name},35044)\n", bytes.len());
            self.buffers.push(bytes.to_vec());
            offset.to_string()
        } else {
            self.buffers.push(bytes[offset..].to_vec());
            format!("*{name}")
        };
        self.calls += &format!("{})\n", call.replace('@', &at));
    }

    /// The pictures of the calls, with draws joined and as the program called them.
    fn shown(&self, calls: &str) -> ([Shown; 2], Copies) {
        let sources: Vec<&[u8]> = self.buffers.iter().map(|bytes| &bytes[..]).collect();
        let calls = format!("{POSITIONS}glEnable(GL_DEPTH_TEST)\n{}{calls}", self.calls);
        let (trace, _) = imported(&calls, &sources, 0..u64::MAX);
        let kept = imported_with(&calls, &sources, 0..u64::MAX, &Reading { keep_draws: true, ..Reading::default() }).0;
        ([last_of(&trace), last_of(&kept)], copies(&trace))
    }
}

#[test]
fn arrays_of_all_types_show_what_they_show_from_memory() {
    // Corners around the window's middle, at whole numbers, so that integers can hold them, each in its own colour. The last four are those
    // of an upright rectangle.
    let around = [[1, 1], [14, 2], [13, 8], [15, 13], [8, 15], [3, 14], [2, 9], [6, 5]];
    let places = [&around[..], &[[9, 2], [3, 1], [3, 15], [8, 13]], &[[0, 0], [15, 0], [15, 7], [0, 7]]].concat();
    let colors =
        [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 0], [0, 255, 255], [255, 0, 255], [255, 255, 255], [128, 64, 32]];
    let positions: [NumberType<i32>; 4] = [
        ("GL_FLOAT", |v| (v as f32).to_le_bytes().to_vec()),
        ("GL_DOUBLE", |v| f64::from(v).to_le_bytes().to_vec()),
        ("GL_SHORT", |v| (v as i16).to_le_bytes().to_vec()),
        ("GL_INT", |v| v.to_le_bytes().to_vec()),
    ];
    let shades: [NumberType<u8>; 5] = [
        ("GL_FLOAT", |v| (f32::from(v) / 255.0).to_le_bytes().to_vec()),
        ("GL_UNSIGNED_BYTE", |v| vec![v]),
        ("GL_UNSIGNED_SHORT", |v| (257 * u16::from(v)).to_le_bytes().to_vec()),
        ("GL_BYTE", |v| vec![v / 2]),
        ("GL_DOUBLE", |v| (f64::from(v) / 255.0).to_le_bytes().to_vec()),
    ];
    let draws = [
        "glDrawArrays(GL_TRIANGLES,1,6)",
        "glDrawArrays(GL_TRIANGLE_STRIP,0,8)",
        "glDrawArrays(GL_TRIANGLE_FAN,1,7)",
        "glDrawArrays(GL_QUADS,0,8)",
        "glDrawArrays(GL_QUADS,8,8)",
        "glRotatef(1,0,0,1)\nglDrawArrays(GL_QUADS,0,8)",
        "glDrawArrays(GL_QUAD_STRIP,0,8)",
        "glDrawArrays(GL_POLYGON,0,7)",
        "glDrawArrays(GL_LINES,0,8)",
        "glDrawArrays(GL_LINE_STRIP,0,8)",
        "glDrawArrays(GL_LINE_LOOP,0,8)",
        "glDrawArrays(GL_POINTS,1,7)",
        "glPointSize(3)\nglDrawArrays(GL_POINTS,1,7)",
        "glPolygonMode(GL_FRONT_AND_BACK,GL_LINE)\nglDrawArrays(GL_TRIANGLES,1,6)",
        "glEnable(GL_CULL_FACE)\nglDrawArrays(GL_TRIANGLE_STRIP,0,8)",
    ];
    let (mut resident, mut converted) = (0, 0);
    for (number, draw) in draws.into_iter().enumerate() {
        for flat in ["", "glShadeModel(GL_FLAT)\n"] {
            for (k, (kind, position)) in positions.into_iter().enumerate() {
                for (j, (shade_kind, shade)) in shades.into_iter().enumerate() {
                    // All pairs of types with one mode, and each type with each mode.
                    if number > 0 && j != (k + number) % shades.len() {
                        continue;
                    }
                    let opaque = (number + j) % 2 == 0;
                    let mut vertices = vec![7; 5];
                    let mut stride = 0;
                    for (place, color) in places.iter().zip(colors.into_iter().cycle()) {
                        let start = vertices.len();
                        vertices.extend(color.into_iter().chain((!opaque).then_some(255)).flat_map(shade));
                        vertices.extend([9; 3]);
                        vertices.extend(place.iter().flat_map(|&v| position(v)));
                        stride = vertices.len() - start;
                    }
                    let size = if opaque { 3 } else { 4 };
                    let shade_bytes = size * shade(0).len() + 3;
                    let images: Vec<_> = [true, false]
                        .into_iter()
                        .map(|resident| {
                            let mut source = ArraySource {
                                buffers: Vec::new(),
                                calls: "glEnableClientState(GL_COLOR_ARRAY)\n".into(),
                                resident,
                            };
                            source.array(&format!("glColorPointer({size},{shade_kind},{stride},@"), &vertices, 5);
                            source.array(&format!("glVertexPointer(2,{kind},{stride},@"), &vertices, 5 + shade_bytes);
                            // What the card does not read in its own format is kept when it is drawn again.
                            let before = format!("glPushMatrix()\n{draw}\nglPopMatrix()\n").repeat(2);
                            source.shown(&format!("{flat}{before}{SWAP}{draw}"))
                        })
                        .collect();
                    let [(from_card, copies), (from_memory, _)] = &images[..] else { unreachable!("two sources") };
                    for (a, b) in from_card.iter().zip(from_memory) {
                        assert!(a.0 == b.0 && !a.lit().is_empty(), "{draw} {flat} {kind} {size} x {shade_kind}");
                    }
                    (resident, converted) = (resident + copies.draws, converted + copies.converted);
                }
            }
        }
    }
    assert!(resident > 150 && converted > 100, "{resident} draws from the card's memory, {converted} conversions");
}

#[test]
fn interleaved_arrays_share_a_vertex_buffer_and_others_have_their_own() {
    // Colours of four bytes before positions; the same positions again behind all vertices.
    let vertices: Vec<u8> = corners(2.0, 2.0).chunks(8).flat_map(|place| [&[0, 255, 0, 255], place].concat()).collect();
    let both = [&vertices[..], &corners(2.0, 2.0)].concat();
    let setup = format!(
        "{POSITIONS}glEnableClientState(GL_COLOR_ARRAY)\nglBindBufferARB({TARGET},1)\nglBufferDataARB({TARGET},80,*1,35044)\n\
         glColorPointer(4,GL_UNSIGNED_BYTE,12,0)\n"
    );
    for (positions, slots) in [("glVertexPointer(2,GL_FLOAT,12,4)", vec![0]), ("glVertexPointer(2,GL_FLOAT,0,48)", vec![0, 1])]
    {
        let (trace, _) = imported(&format!("{setup}{positions}\n{DRAW}{DRAW}"), &[&both], 0..u64::MAX);
        let mut bound = Vec::new();
        let seen: Result<(), TraceError> = trace.for_each_command(|_, command| {
            if let Command::SetVertexBuffer { slot, .. } = command {
                bound.push(*slot);
            }
            Ok(())
        });
        seen.expect("a trace");
        let Copies { uploads, draws, .. } = copies(&trace);
        assert_eq!((bound, uploads, draws), (slots, vec![(0, 80)], 2), "{positions}");
        assert_eq!((last_of(&trace).at(3, 3), last_of(&trace).lit().len()), (GREEN, 16));
    }
}

#[test]
fn indices_of_all_types_select_the_vertices_that_they_select_from_memory() {
    let corners = floats(&[0.0, 0.0, 9.0, 9.0, 1.0, 1.0, 7.0, 2.0, 2.0, 8.0, 9.0, 9.0, 15.0, 3.0, 14.0, 14.0]);
    let indices = [2_u32, 3, 4, 5, 6, 7];
    let kinds: [NumberType<u32>; 3] = [
        ("GL_UNSIGNED_BYTE", |v| vec![v as u8]),
        ("GL_UNSIGNED_SHORT", |v| (v as u16).to_le_bytes().to_vec()),
        ("GL_UNSIGNED_INT", |v| v.to_le_bytes().to_vec()),
    ];
    for mode in ["GL_TRIANGLES", "GL_TRIANGLE_STRIP", "GL_TRIANGLE_FAN", "GL_QUAD_STRIP", "GL_LINES", "GL_POINTS"] {
        let plain = {
            let mut source = ArraySource { buffers: Vec::new(), calls: String::new(), resident: false };
            source.array("glVertexPointer(2,GL_FLOAT,0,@", &corners, 0);
            source.shown(&format!("glDrawArrays({mode},2,6)")).0
        };
        for (kind, bytes) in kinds {
            let size = bytes(0).len();
            // The first index is behind others that are not drawn; `added` is the draw's base.
            for (elements, added) in [(true, 0), (true, 2), (false, 0)] {
                let mut given = vec![0; 4 * size];
                given.extend(indices.into_iter().flat_map(|index| bytes(index - added)));
                let mut source = ArraySource { buffers: Vec::new(), calls: String::new(), resident: true };
                source.array("glVertexPointer(2,GL_FLOAT,0,@", &corners, 0);
                let calls = if elements {
                    source.buffers.push(given.clone());
                    let at = 4 * size;
                    let draw = format!("glDrawElementsBaseVertex({mode},6,{kind},{at},{added})");
                    format!("glBindBufferARB(34963,8)\nglBufferDataARB(34963,{},*2,35044)\n{draw}", given.len())
                } else {
                    source.buffers.push(given[4 * size..].to_vec());
                    format!("glDrawElements({mode},6,{kind},*2)")
                };
                let (images, copies) = source.shown(&calls);
                for (a, b) in images.iter().zip(&plain) {
                    assert!(a.0 == b.0 && !a.lit().is_empty(), "{mode} {kind} {elements} {added}");
                }
                assert_eq!(copies.draws, 1);
                let native = elements && size > 1 && mode != "GL_QUAD_STRIP";
                assert_eq!(copies.made.len(), 1 + usize::from(native), "{mode} {kind}");
            }
        }
    }
}

#[test]
fn a_conversion_is_made_once_and_freed_when_its_buffer_object_changes() {
    let shorts = |x: i16| -> Vec<u8> { [x, 0, x + 4, 0, x + 4, 4, x, 4].iter().flat_map(|v| v.to_le_bytes()).collect() };
    let (left, right) = (shorts(0), shorts(8));
    let setup = format!(
        "{POSITIONS}glBindBufferARB({TARGET},1)\nglBufferDataARB({TARGET},16,*1,35044)\nglVertexPointer(2,GL_SHORT,0,0)\nglRotatef(1,0,0,1)\n"
    );
    let frame = format!("glDrawArrays(GL_QUADS,0,4)\n{SWAP}");
    let change = format!("glBufferSubDataARB({TARGET},0,16,*2)\n");
    let of = |calls: &str| {
        let (trace, _) = imported(&format!("{setup}{calls}glDrawArrays(GL_QUADS,0,4)"), &[&left, &right], 0..u64::MAX);
        (copies(&trace), last_of(&trace))
    };
    // Vertices from the first draw on, indices from the second one on.
    let (Copies { made, converted, freed, draws, others, .. }, image) = of(&frame.repeat(5));
    assert_eq!((made.len(), converted, freed, draws, others), (2, 2, 0, 6, 0));
    assert_eq!([image.at(2, 2), image.at(10, 2)], [[255; 3], BLACK]);
    let (Copies { made, freed, draws, .. }, image) = of(&format!("{}{change}{}", frame.repeat(2), frame.repeat(2)));
    assert_eq!((made.len(), freed, draws), (4, 2, 5));
    assert_eq!([image.at(2, 2), image.at(10, 2)], [BLACK, [255; 3]]);
    // Where contents change with each draw, no more than the last ones are kept.
    let (Copies { made, most, freed, .. }, _) = of(&format!("{change}{frame}").repeat(30));
    assert!(most <= 64 && made.len() - freed <= 2, "{most} bytes, {} of {}", made.len() - freed, made.len());
    let (Copies { made, freed, .. }, _) =
        of(&format!("{frame}{frame}glDeleteBuffersARB(1,{{1}})\nglVertexPointer(2,GL_SHORT,0,*1)\n"));
    assert_eq!((made.len(), freed), (2, 2));
    // A large buffer object of which little is drawn is not converted.
    let big = vec![0; 16_384];
    let calls = format!(
        "{POSITIONS}glBindBufferARB({TARGET},1)\nglBufferDataARB({TARGET},16384,*1,35044)\nglVertexPointer(2,GL_SHORT,0,0)\n"
    );
    let (trace, _) = imported(&format!("{calls}{}", format!("{change}{frame}").repeat(30)), &[&big, &right], 0..u64::MAX);
    assert_eq!(copies(&trace).made, []);
}

#[test]
fn elements_behind_the_end_of_a_buffer_object_are_zeros() {
    let mut source = ArraySource { buffers: Vec::new(), calls: String::new(), resident: true };
    source.array("glVertexPointer(2,GL_FLOAT,0,@", &floats(&[8.0, 0.0, 0.0, 8.0]), 0);
    source.buffers.push(vec![0, 0, 1, 0, 200, 0]);
    let ([image, _], copies) = source.shown(
        "glBindBufferARB(34963,8)\nglBufferDataARB(34963,6,*2,35044)\nglDrawElements(GL_TRIANGLES,3,GL_UNSIGNED_SHORT,0)",
    );
    assert_eq!(([image.at(1, 1), image.at(9, 9)], copies.draws), ([[255; 3], BLACK], 1));
    // Consecutive vertices are checked when a trace is read.
    let calls = format!("{POSITIONS}{}glDrawArrays(GL_TRIANGLES,2,3)", object(1, 1));
    assert_eq!(shown(&calls, &[&corners(8.0, 0.0)]).at(6, 2), [255; 3]);
}

#[test]
fn buffer_objects_into_which_pixels_were_read_are_not_drawn_from() {
    let read = "glBindBuffer(GL_PIXEL_PACK_BUFFER,7)\nglBufferData(GL_PIXEL_PACK_BUFFER,4,*1,GL_STREAM_READ)\n\
        glReadPixels(0,0,1,1,GL_RGBA,GL_UNSIGNED_BYTE,U0x0)\nglBindBuffer(GL_PIXEL_PACK_BUFFER,0)\n";
    let drawn = "glBindBuffer(GL_PIXEL_UNPACK_BUFFER,7)\nglWindowPos2i(2,2)\nglDrawPixels(1,1,GL_RGBA,GL_UNSIGNED_BYTE,0)\n";
    let refusal = |calls: &str| recorded(calls, &[&[0, 255, 0, 255]], 0..u64::MAX, &Reading::default()).1.refusal();
    assert_eq!(refusal(read), None);
    let what = refusal(&format!("{read}{drawn}"));
    assert!(
        what.as_ref().is_some_and(|what| what.starts_with("reading of a buffer object into which pixels were read back")),
        "{what:?}"
    );
    // Unless its contents are given anew.
    let again = "glBindBuffer(GL_PIXEL_UNPACK_BUFFER,7)\nglBufferSubData(GL_PIXEL_UNPACK_BUFFER,0,4,*1)\n";
    assert_eq!(refusal(&format!("{read}{again}{drawn}")), None);
}

#[test]
fn buffer_objects_are_copied_in_parts() {
    let corners = floats(&[0.0, 0.0, 16.0, 0.0, 0.0, 16.0]);
    let calls = format!(
        "{ORTHO}glEnableClientState(GL_VERTEX_ARRAY)\nglBindBufferARB(36662,1)\nglBufferStorage(36662,24,*1,0)\nglBindBufferARB(34962,2)\n\
         glBufferDataARB(34962,32,*2,35044)\nglVertexPointer(2,GL_FLOAT,0,8)\n"
    );
    let copy = "glCopyBufferSubData(36662,34962,0,8,24)\n";
    let image = |more: &str| {
        let (image, errors) = with_errors(&format!("{calls}{more}glDrawArrays(GL_TRIANGLES,0,3)"), &[&corners, &[0; 32]]);
        (image.lit().len(), errors)
    };
    assert_eq!(image(""), (0, 0));
    let (lit, errors) = image(copy);
    assert!(lit > 100 && errors == 0);
    // Beyond the end, of overlapping parts, and of negative places; storage stays as it is.
    let wrong = "glCopyBufferSubData(36662,34962,1,8,24)\nglCopyBufferSubData(34962,34962,0,8,16)\nglCopyBufferSubData(36662,34962,-4,8,4)\n\
        glBufferDataARB(36662,24,*2,35044)\nglBufferStorage(36662,0,*2,0)\nglBufferSubDataARB(36662,0,8,*2)\n";
    assert_eq!(image(&format!("{wrong}{copy}")), (lit, 6));
    let written =
        calls.replace("*1,0)", "*1,256)") + "glBufferSubDataARB(36662,0,24,*2)\n" + copy + "glDrawArrays(GL_TRIANGLES,0,3)";
    let (image, errors) = with_errors(&written, &[&corners, &[0; 32]]);
    assert_eq!((image.lit().len(), errors), (0, 0), "storage that may be written");
}
