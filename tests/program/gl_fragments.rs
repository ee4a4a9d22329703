//! Operations on fragments: tests, blending, accumulation, queries.

use fillrate::trace::TraceError;
use fillrate::trace::command::Command;

use super::gl_scenes::{BLACK, PASS_POSITION, QUAD, RED, imported, near, program_of, refused_with_errors, shown};

#[test]
fn accumulation_adds_scales_and_returns() {
    let clear = |color: &str| format!("glClearColor({color},1)\nglClear(GL_COLOR_BUFFER_BIT)\n");
    let image = shown(
        &format!(
            "{}glAccum(GL_LOAD,0.5)\n{}glAccum(GL_ACCUM,0.25)\n{}glAccum(GL_MULT,0.5)\nglAccum(GL_RETURN,2)",
            clear("1,0,0"),
            clear("0,1,1"),
            clear("0,0,0")
        ),
        &[],
    );
    assert!(near(image.at(3, 3), [128, 64, 64]), "{:?}", image.at(3, 3));
    let image =
        shown("glClearAccum(0.2,0.4,0,0)\nglClear(GL_ACCUM_BUFFER_BIT)\nglAccum(GL_ADD,0.2)\nglAccum(GL_RETURN,1)", &[]);
    assert!(near(image.at(3, 3), [102, 153, 51]), "{:?}", image.at(3, 3));
}

#[test]
fn occlusion_queries_are_carried() {
    let (trace, report) = imported(
        "glBeginQueryARB(GL_SAMPLES_PASSED_ARB,1)\nglRectf(-1,-1,0,0)\nglEndQueryARB(GL_SAMPLES_PASSED_ARB)\nglColor3f(1,0,0)\nglRectf(0,0,1,1)\n\
         glBeginQueryARB(GL_SAMPLES_PASSED_ARB,2)\nglRectf(0,0,1,1)\nglEndQueryARB(GL_SAMPLES_PASSED_ARB)",
        &[],
        0..u64::MAX,
    );
    let (mut open, mut counted) = (false, Vec::new());
    let seen: Result<(), TraceError> = trace.for_each_command(|_, command| {
        match command {
            Command::BeginOcclusionQuery { .. } => open = true,
            Command::EndOcclusionQuery => open = false,
            Command::DrawIndexed { .. } => counted.push(open),
            _ => {}
        }
        Ok(())
    });
    seen.expect("commands in memory");
    assert_eq!((report.queries, counted), (2, vec![true, false, true]));
}

#[test]
fn blend_factors_are_the_colour_and_the_alpha_of_the_constant() {
    let draw = |source: u32, destination: u32| {
        let calls = format!(
            "glClearColor(1,0.5,0.25,1)\nglClear(16384)\nglEnable(GL_BLEND)\nglBlendColor(0.8,0.6,0.2,0.4)\nglBlendFunc({source},{destination})\n\
             glColor3f(0.5,0.5,1.5)\n{QUAD}"
        );
        shown(&calls, &[]).at(8, 8)
    };
    let (color, other_color, alpha, other_alpha) = (32769, 32770, 32771, 32772);
    let factor = |of: u32, k: usize| {
        let constant = [0.8_f32, 0.6, 0.2][k];
        [constant, 1.0 - constant, 0.4, 0.6][of as usize - 32769]
    };
    for (source, destination) in [(color, other_alpha), (other_color, alpha), (alpha, color), (other_alpha, other_color)] {
        let wanted: [f32; 3] = std::array::from_fn(|k| {
            let (new, old) = ([0.5, 0.5, 1.0][k], [1.0, 0.5, 0.25][k]);
            (255.0 * (new * factor(source, k) + old * factor(destination, k))).min(255.0)
        });
        let found = draw(source, destination);
        assert!((0..3).all(|k| (f32::from(found[k]) - wanted[k]).abs() <= 2.0), "{found:?} {wanted:?}");
    }
}

#[test]
fn stencil_references_and_masks_differ_between_faces() {
    // Two triangles beside each other: the left one shows its front, the right one its back. Each writes its own reference.
    let faces = "glBegin(GL_TRIANGLES)\nglVertex2f(-1,-1)\nglVertex2f(0,-1)\nglVertex2f(-1,1)\nglVertex2f(0,-1)\nglVertex2f(0,1)\nglVertex2f(1,-1)\nglEnd()\n";
    let draw = |reference: u32| {
        shown(
            &format!(
                "glEnable(GL_STENCIL_TEST)\nglColorMask(0,0,0,0)\nglStencilFuncSeparate(GL_FRONT,GL_ALWAYS,5,255)\n\
                 glStencilFuncSeparate(GL_BACK,GL_ALWAYS,7,255)\nglStencilMaskSeparate(GL_BACK,6)\nglStencilOp(GL_KEEP,GL_KEEP,GL_REPLACE)\n{faces}\
                 glColorMask(1,1,1,1)\nglStencilFunc(GL_EQUAL,{reference},255)\nglStencilOp(GL_KEEP,GL_KEEP,GL_KEEP)\n{QUAD}"
            ),
            &[],
        )
    };
    let (front, back) = (draw(5), draw(6));
    assert!(front.at(1, 2) != BLACK && front.at(9, 2) == BLACK);
    assert!(back.at(1, 2) == BLACK && back.at(9, 2) != BLACK);
    // ATI's function has a comparison of each face and one reference.
    let image = shown(&format!("glEnable(GL_STENCIL_TEST)\nglStencilFuncSeparateATI(GL_ALWAYS,GL_NEVER,3,255)\n{faces}"), &[]);
    assert!(image.at(1, 2) != BLACK && image.at(9, 2) == BLACK);
}

#[test]
fn colours_are_blended_with_a_second_source() {
    let stated = "#version 330\nlayout(location = 0, index = 0) out vec4 a; layout(location = 0, index = 1) out vec4 b; \
                  void main() { a = vec4(0.2, 0.0, 0.0, 1.0); b = vec4(0.5, 0.25, 1.0, 1.0); }";
    let bound = stated.replace("layout(location = 0, index = 0) ", "").replace("layout(location = 0, index = 1) ", "");
    let names = "glBindFragDataLocationIndexed(3,0,0,\"a\")\nglBindFragDataLocationIndexed(3,0,1,\"b\")\nglLinkProgram(3)\n";
    for (fragment, names) in [(stated, ""), (&bound, names)] {
        let draw = |factors: &str| {
            format!(
                "glClearColor(0.2,0.4,0.8,1)\nglClear(GL_COLOR_BUFFER_BIT)\n{}{names}glEnable(GL_BLEND)\nglBlendFunc({factors})\n{QUAD}",
                program_of(PASS_POSITION, fragment)
            )
        };
        // GL_ONE, GL_SRC1_COLOR; then GL_ZERO, GL_ONE_MINUS_SRC1_COLOR; then without the second source.
        assert!(near(shown(&draw("1,35065"), &[]).at(8, 8), [77, 26, 204]));
        assert!(near(shown(&draw("0,35066"), &[]).at(8, 8), [26, 77, 0]));
        assert!(near(shown(&draw("1,0"), &[]).at(8, 8), [51, 0, 0]));
    }
    let (why, _) = refused_with_errors(&format!("glEnable(GL_BLEND)\nglBlendFunc(1,35065)\n{QUAD}"), &[]);
    assert!(why.starts_with("blending with a second source that no fragment shader writes"), "{why}");
}

#[test]
fn alpha_is_compared_in_eight_bits() {
    let drawn = |function: &str, alpha: u8| {
        shown(&format!("glEnable(GL_ALPHA_TEST)\nglAlphaFunc({function},0.5)\nglColor4ub(255,0,0,{alpha})\n{QUAD}"), &[])
            .at(8, 8)
            == RED
    };
    let of = |function: &str| [127, 128, 129].map(|alpha| drawn(function, alpha));
    assert_eq!(of("GL_GREATER"), [false, false, true]);
    assert_eq!(of("GL_GEQUAL"), [false, true, true]);
    assert_eq!(of("GL_EQUAL"), [false, true, false]);
    assert_eq!(of("GL_NOTEQUAL"), [true, false, true]);
    assert_eq!(of("GL_LEQUAL"), [true, true, false]);
    assert_eq!(of("GL_LESS"), [true, false, false]);
}
