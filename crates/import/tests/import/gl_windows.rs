//! Calls of window systems in any order, with any handles, from several threads: importing ends with a valid trace or a message.

use std::path::Path;

use import::gl::import_bytes;
use proptest::prelude::*;
use trace::{Reading, check};

use crate::recorder::{Value, Writer};

/// Functions of window systems, with the number of their arguments.
const SYSTEM: &[(&str, usize)] = &[
    ("glXCreateContext", 4),
    ("glXCreateNewContext", 5),
    ("eglCreateContext", 4),
    ("wglCreateContext", 1),
    ("CGLCreateContext", 3),
    ("glXMakeCurrent", 3),
    ("glXMakeContextCurrent", 4),
    ("eglMakeCurrent", 4),
    ("wglMakeCurrent", 2),
    ("CGLSetCurrentContext", 1),
    ("glXDestroyContext", 2),
    ("wglDeleteContext", 1),
    ("wglShareLists", 2),
    ("eglReleaseThread", 0),
    ("glXCreateWindow", 4),
    ("glXDestroyWindow", 2),
    ("eglCreatePbufferSurface", 3),
    ("wglCreatePbufferARB", 5),
    ("wglGetPbufferDCARB", 1),
    ("eglDestroySurface", 2),
    ("glXSwapBuffers", 2),
    ("wglSwapBuffers", 1),
    ("CGLFlushDrawable", 1),
    ("glXBindTexImageEXT", 4),
];

/// Calls of OpenGL.
const CALLS: &[(&str, &[u64])] = &[
    ("glViewport", &[0, 0, 8, 8]),
    ("glViewport", &[2, 0, 16, 4]),
    ("glClear", &[0x4000]),
    ("glRecti", &[0, 0, 1, 1]),
    ("glBegin", &[4]),
    ("glVertex2i", &[0, 1]),
    ("glEnd", &[]),
    ("glNewList", &[1, 0x1301]),
    ("glEndList", &[]),
    ("glCallList", &[1]),
    ("glBindTexture", &[0xde1, 1]),
    ("glCopyTexImage2D", &[0xde1, 0, 0x1908, 0, 0, 4, 4, 0]),
    ("glEnable", &[0xde1]),
    ("glBindFramebuffer", &[0x8d40, 1]),
    ("glBindFramebuffer", &[0x8d40, 0]),
    ("glFramebufferTexture2D", &[0x8d40, 0x8ce0, 0xde1, 1, 0]),
    ("glBlitFramebuffer", &[0, 0, 4, 4, 0, 0, 4, 4, 0x4000, 0x2600]),
    ("glDrawBuffer", &[0x404]),
    ("glDrawBuffer", &[0x405]),
    ("glReadBuffer", &[0x404]),
    ("glAccum", &[0x100, 1]),
    ("glPushAttrib", &[0xf_ffff]),
    ("glPopAttrib", &[]),
];

/// A value that a window system may pass: a handle, a number, an attribute list with a width and a height, or nothing.
fn value() -> impl Strategy<Value = Value> {
    prop_oneof![
        Just(Value::Null),
        (0_u64..4).prop_map(Value::Pointer),
        (0_u64..4).prop_map(Value::Uint),
        (0_u8..9).prop_map(|edge| Value::Floats(vec![12375.0, edge.into(), 12374.0, 4.0, 12344.0])),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn any_calls_of_window_systems_end_with_a_trace_or_a_message(
        calls in prop::collection::vec(
            (0_u64..3, any::<bool>(), any::<prop::sample::Index>(), prop::collection::vec(value(), 5), prop::option::of(value())),
            1..80,
        ),
        window in prop::option::weighted(0.2, 0_u32..3),
    ) {
        let mut w = Writer::new(6);
        for (thread, system, index, args, result) in calls {
            if system {
                let (name, count) = *index.get(SYSTEM);
                w.call_in(thread, name, &args[..count], result);
            } else {
                let (name, args) = *index.get(CALLS);
                w.call_in(thread, name, &args.iter().map(|&arg| Value::Uint(arg)).collect::<Vec<_>>(), None);
            }
        }
        let reading = Reading { window, lenient: true, ..Reading::default() };
        match import_bytes(Path::new("x.trace"), w.file(1 << 20), [&[], &[]], &reading) {
            Ok((trace, report)) => {
                check(&trace).unwrap_or_else(|error| panic!("{error}"));
                let swaps = report.windows.iter().enumerate().filter(|&(k, _)| window.is_none_or(|window| window as usize == k));
                prop_assert_eq!(swaps.map(|(_, of)| of.swaps).sum::<u64>(), report.frames);
            }
            Err(error) => prop_assert!(error.to_string().starts_with("x.trace: "), "{}", error),
        }
    }
}
