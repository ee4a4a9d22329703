//! Display lists: which state they keep from the time when they are made, and which buffers stay on the card.

use fillrate::trace::TraceError;
use fillrate::trace::command::{Command, Object};

use super::gl_scenes::{BLACK, BLUE, GREEN, ORTHO, QUAD, RED, Shown, floats, imported, last_of, refused, shown, tolerated};

#[test]
fn draws_of_instances_are_errors_in_lists() {
    let corners = floats(&[0.0, 0.0, 16.0, 0.0, 0.0, 16.0]);
    let arrays = "glEnableClientState(GL_VERTEX_ARRAY)\nglVertexPointer(2,GL_FLOAT,0,*1)\n";
    let (image, errors) = tolerated(
        &format!(
            "{ORTHO}{arrays}glNewList(1,GL_COMPILE_AND_EXECUTE)\nglDrawArraysInstanced(GL_TRIANGLES,0,3,1)\n\
             glDrawElementsInstancedBaseVertex(GL_TRIANGLES,2,GL_UNSIGNED_INT,U0x0,3,0)\nglEndList()\nglCallList(1)"
        ),
        &[&corners],
    );
    assert_eq!(image.lit(), []);
    let names = ["glDrawArraysInstanced", "glDrawElementsInstancedBaseVertex"];
    assert_eq!(errors, names.map(|name| format!("{name}: GL_INVALID_OPERATION")));
    // A recorder gives as many elements as there are vertices: the fourth instance has none.
    let few = "glEnableVertexAttribArray(3)\nglVertexAttribDivisor(3,1)\nglVertexAttribPointer(3,2,GL_FLOAT,0,0,*1)\n";
    let draw = |instances: u32| {
        refused(&format!("{ORTHO}{arrays}{few}glDrawArraysInstanced(GL_TRIANGLES,0,3,{instances})"), &[&corners])
    };
    assert_eq!(draw(3), "");
    assert!(draw(4).starts_with("elements of instances in memory"), "{}", draw(4));
}

#[test]
fn primitives_of_lists_between_begin_and_end_are_dropped() {
    let corners = floats(&[0.0, 0.0, 16.0, 0.0, 0.0, 16.0]);
    let whole = "glVertex2f(0,0)\nglVertex2f(16,0)\nglVertex2f(0,16)\n";
    let lists = format!(
        "{ORTHO}glEnableClientState(GL_VERTEX_ARRAY)\nglVertexPointer(2,GL_FLOAT,0,*1)\nglNewList(1,GL_COMPILE)\nglDrawArrays(GL_TRIANGLES,0,3)\nglEndList()\n\
         glNewList(2,GL_COMPILE)\nglBegin(GL_TRIANGLES)\nglColor3f(1,0,0)\n{whole}glEnd()\nglEndList()\n\
         glNewList(3,GL_COMPILE)\nglBegin(GL_TRIANGLES)\nglVertex2f(0,0)\nglColor3f(1,0,0)\nglVertex2f(16,0)\nglVertex2f(0,16)\nglEnd()\nglEndList()\n\
         glNewList(4,GL_COMPILE)\nglVertex2f(0,16)\nglEndList()\nglColor3f(0,1,0)\n"
    );
    for list in 1..4 {
        let (image, errors) = tolerated(&format!("{lists}glBegin(GL_TRIANGLES)\nglCallList({list})\nglEnd()"), &[&corners]);
        assert_eq!((image.lit(), errors.len()), (vec![], 1), "{list}");
        // The open primitive goes on.
        let around = format!(
            "{lists}glBegin(GL_TRIANGLES)\nglVertex2f(0,0)\nglVertex2f(16,0)\nglCallList({list})\nglCallList(4)\nglEnd()"
        );
        let (image, errors) = tolerated(&around, &[&corners]);
        assert_eq!((image.at(2, 2), errors), (GREEN, vec!["glBegin: GL_INVALID_OPERATION".to_owned()]), "{list}");
    }
}

/// 64 quadrilaterals of a pixel each, 8 per row, in one primitive; `first` comes before its first vertex.
fn field(first: &str) -> String {
    let mut calls = format!("glBegin(GL_QUADS)\n{first}");
    for k in 0..64 {
        let (x, y) = (k % 8, k / 8);
        for [dx, dy] in [[0, 0], [1, 0], [1, 1], [0, 1]] {
            calls += &format!("glVertex2f({},{})\n", x + dx, y + dy);
        }
    }
    calls + "glEnd()\n"
}

/// Four uses of a list: with another place, colour and shading each, with a change of state between them.
fn uses(run: &str) -> String {
    let at = |x: i32, y: i32, more: &str| format!("glPushMatrix()\nglTranslatef({x},{y},0)\n{more}\n{run}glPopMatrix()\n");
    [
        at(0, 0, "glColor3f(1,0,0)"),
        at(8, 0, "glColor3f(0,1,0)"),
        at(0, 8, "glEnable(GL_ALPHA_TEST)\nglAlphaFunc(GL_GREATER,0.5)\nglColor4f(0,0,1,1)"),
        at(8, 8, "glColor4f(0,0,1,0.25)"),
    ]
    .concat()
}

/// Buffers that lists keep on the card, and those that are freed.
fn kept(calls: &str) -> (usize, usize, Shown) {
    let (trace, _) = imported(calls, &[], 0..u64::MAX);
    let (mut made, mut freed) = (Vec::new(), 0);
    let seen: Result<(), TraceError> = trace.for_each_command(|_, command| {
        match command {
            Command::CreateBuffer { id, label: Some(label), .. } if label.starts_with("list") => made.push(*id),
            Command::Destroy(Object::Buffer(id)) if made.contains(id) => freed += 1,
            _ => {}
        }
        Ok(())
    });
    seen.expect("a trace");
    (made.len(), freed, last_of(&trace))
}

#[test]
fn a_large_primitive_stays_on_the_card_and_shows_what_it_shows_without_a_list() {
    let list = format!("{ORTHO}glNewList(1,GL_COMPILE)\n{}glEndList()\n", field(""));
    let (made, freed, image) = kept(&format!("{list}{}", uses("glCallList(1)\n")));
    assert_eq!((made, freed), (2, 0), "vertices and indices, once");
    let plain = shown(&format!("{ORTHO}{}", uses(&field(""))), &[]);
    assert!(image.0 == plain.0);
    assert_eq!([image.at(3, 3), image.at(12, 3), image.at(3, 12), image.at(12, 12)], [RED, GREEN, BLUE, BLACK]);
    // A list that is made anew has other vertices, and the old ones are freed.
    let again = "glDisable(GL_ALPHA_TEST)\nglNewList(1,GL_COMPILE)\nglRectf(2,2,4,4)\nglEndList()\nglClear(GL_COLOR_BUFFER_BIT)\nglCallList(1)";
    let (made, freed, image) = kept(&format!("{list}{}{again}", uses("glCallList(1)\n")));
    assert_eq!((made, freed, image.lit().len()), (2, 2, 4));
    let (_, freed, _) = kept(&format!("{list}{}glDeleteLists(1,1)", uses("glCallList(1)\n")));
    assert_eq!(freed, 2);
}

#[test]
fn attributes_that_a_list_does_not_give_are_those_at_hand_and_those_it_gives_stay_behind_it() {
    // The list's first primitive has the caller's colour, its second its own, and so has what follows.
    let list = format!(
        "{ORTHO}glNewList(1,GL_COMPILE)\nglBegin(GL_QUADS)\nglVertex2f(0,0)\nglVertex2f(4,0)\nglVertex2f(4,4)\nglVertex2f(0,4)\nglEnd()\n\
         glBegin(GL_QUADS)\nglColor3f(0,1,0)\nglVertex2f(4,0)\nglVertex2f(8,0)\nglVertex2f(8,4)\nglVertex2f(4,4)\nglEnd()\nglEndList()\n"
    );
    let image = shown(&format!("{list}glColor3f(1,0,0)\nglCallList(1)\nglRectf(8,0,12,4)"), &[]);
    assert_eq!([image.at(1, 1), image.at(5, 1), image.at(9, 1)], [RED, GREEN, GREEN]);
    // Where colours begin in the middle of a primitive, its first vertices have the caller's.
    let strip = "glNewList(2,GL_COMPILE)\nglShadeModel(GL_FLAT)\nglBegin(GL_TRIANGLES)\nglVertex2f(0,0)\nglVertex2f(8,0)\nglVertex2f(0,8)\n\
        glColor3f(0,0,1)\nglVertex2f(8,8)\nglVertex2f(16,8)\nglVertex2f(8,16)\nglEnd()\nglEndList()\n";
    let image = shown(&format!("{ORTHO}{strip}glColor3f(1,0,0)\nglCallList(2)"), &[]);
    assert_eq!([image.at(1, 1), image.at(9, 9)], [RED, BLUE]);
    // A list that is called where a primitive has begun goes on with it.
    let inside = "glNewList(3,GL_COMPILE)\nglColor3f(0,1,0)\nglVertex2f(8,0)\nglVertex2f(8,8)\nglVertex2f(0,8)\nglEndList()\n";
    let image = shown(
        &format!(
            "{ORTHO}{inside}glShadeModel(GL_FLAT)\nglBegin(GL_QUADS)\nglColor3f(1,0,0)\nglVertex2f(0,0)\nglCallList(3)\nglEnd()"
        ),
        &[],
    );
    assert_eq!((image.at(4, 4), image.lit().len()), (GREEN, 64));
}

#[test]
fn a_list_keeps_elements_of_arrays_as_they_were() {
    let corners: Vec<u8> = [0.0_f32, 0.0, 4.0, 0.0, 0.0, 4.0].iter().flat_map(|value| value.to_le_bytes()).collect();
    let moved: Vec<u8> = [8.0_f32, 8.0, 12.0, 8.0, 8.0, 12.0].iter().flat_map(|value| value.to_le_bytes()).collect();
    for (mode, wanted) in [("GL_COMPILE", vec![(1, 1)]), ("GL_COMPILE_AND_EXECUTE", vec![(1, 1), (13, 1)])] {
        let calls = format!(
            "{ORTHO}glPushMatrix()\nglTranslatef(12,0,0)\nglEnableClientState(GL_VERTEX_ARRAY)\nglVertexPointer(2,GL_FLOAT,0,*1)\nglNewList(1,{mode})\n\
             glBegin(GL_TRIANGLES)\nglArrayElement(0)\nglArrayElement(1)\nglArrayElement(2)\nglEnd()\nglEndList()\nglPopMatrix()\n\
             glVertexPointer(2,GL_FLOAT,0,*2)\nglCallList(1)"
        );
        let image = shown(&calls, &[&corners, &moved]);
        for (x, y) in [(1, 1), (13, 1), (9, 9)] {
            assert_eq!(image.at(x, y) != BLACK, wanted.contains(&(x, y)), "{mode}: {x}, {y}");
        }
    }
}

#[test]
fn attributes_between_primitives_of_a_list_do_not_part_them() {
    let quad = |x: i32| {
        format!(
            "glBegin(GL_QUADS)\nglVertex2f({x},0)\nglVertex2f({},0)\nglVertex2f({},4)\nglVertex2f({x},4)\nglEnd()\n",
            x + 4,
            x + 4
        )
    };
    let list = format!(
        "{ORTHO}glNewList(1,GL_COMPILE)\nglColor3f(1,0,0)\n{}glNormal3f(0,1,0)\nglColor3f(0,1,0)\n{}glColor3d(0,0,0.1)\nglColor3f(0,0,1)\n{}glEndList()\n",
        quad(0),
        quad(4),
        quad(8)
    );
    let (trace, _) =
        imported(&format!("{list}glCallList(1)\nglTranslatef(0,4,0)\nglCallList(1)\nglRectf(12,0,16,4)"), &[], 0..u64::MAX);
    let mut counts = Vec::new();
    let seen: Result<(), TraceError> = trace.for_each_command(|_, command| {
        if let Command::DrawIndexed { indices, .. } = command {
            counts.push(*indices);
        }
        Ok(())
    });
    seen.expect("a trace");
    assert_eq!(counts, [18, 18, 6]);
    let image = last_of(&trace);
    for y in [1, 5] {
        assert_eq!([image.at(1, y), image.at(5, y), image.at(9, y)], [RED, GREEN, BLUE]);
    }
    assert_eq!((image.at(13, 1), image.at(13, 5)), (BLACK, BLUE));
}

#[test]
fn a_primitive_with_materials_in_a_list_is_what_it_is_without() {
    let corner = |x: i32, y: i32| {
        let (a, b) = (f64::from(x) / 16.0, f64::from(y) / 16.0);
        format!(
            "glNormal3f({a},{b},1)\nglMaterialfv(GL_FRONT,GL_DIFFUSE,{{{a},{b},1,1}})\nglColor3f({b},1,{a})\nglTexCoord2f({a},{b})\nglVertex2f({x},{y})\n"
        )
    };
    let corners = [[0, 0], [8, 0], [8, 8], [0, 8], [8, 8], [16, 8], [16, 16], [8, 16]].map(|[x, y]| corner(x, y)).concat();
    let primitive = format!("glBegin(GL_QUADS)\n{corners}glEnd()\nglTranslatef(4,0,0)\nglRotatef(90,0,0,1)\n{QUAD}\n");
    let texture = "glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_NEAREST)\n\
        glTexImage2D(GL_TEXTURE_2D,0,GL_RGBA,2,1,0,GL_RGBA,GL_UNSIGNED_BYTE,*1)\nglEnable(GL_TEXTURE_2D)\n";
    for lit in ["", "glEnable(GL_LIGHTING)\nglEnable(GL_LIGHT0)\n"] {
        let of = |run: &str| shown(&format!("{ORTHO}{texture}{lit}{run}"), &[&[255, 255, 0, 255, 64, 255, 255, 255]]);
        let listed = of(&format!("glNewList(1,GL_COMPILE)\n{primitive}glEndList()\nglCallList(1)"));
        let plain = of(&primitive);
        assert!(listed.0 == plain.0, "{lit}");
        assert!(plain.lit().len() >= 128, "{lit}: {}", plain.lit().len());
    }
}
