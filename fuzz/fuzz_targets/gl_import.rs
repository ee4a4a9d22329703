//! Whatever bytes are given as a recorded OpenGL program, importing and checking it ends with a trace or a message. A first byte `S` stands for
//! the start of a file of apitrace, with the rest packed as one chunk, so that the fuzzer reaches the events behind the compression.
//! `V` and `F` stand for a recording that draws with a vertex or fragment program of the text that follows,
//! in assembly; `v` and `f` for one in GLSL.

#![no_main]

use std::path::Path;

use fillrate::import::gl::import_bytes;
use fillrate::trace::{Reading, check};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let bytes = match data.split_first() {
        Some((b'S', stream)) => {
            let Ok(packed) = snap::raw::Encoder::new().compress_vec(stream) else { return };
            [b"at".as_slice(), &(packed.len() as u32).to_le_bytes(), &packed].concat()
        }
        Some((stage @ (b'V' | b'F'), text)) => {
            // A quotation mark would end the text.
            let text = String::from_utf8_lossy(text).replace('"', "");
            let (target, header) = if *stage == b'V' { ("VERTEX", "!!ARBvp1.0") } else { ("FRAGMENT", "!!ARBfp1.0") };
            let target = format!("GL_{target}_PROGRAM_ARB");
            format!(
                "GLI0.t\n#! RES 8x8\nglProgramStringARB({target},GL_PROGRAM_FORMAT_ASCII_ARB,{},\"{header}\n{text}\")\n\
                 glEnable({target})\nglRectf(-1,-1,1,1)\nwglSwapBuffers(0)\n",
                header.len() + 1 + text.len()
            )
            .into_bytes()
        }
        Some((stage @ (b'v' | b'f'), text)) => {
            let text = String::from_utf8_lossy(text).replace('"', "");
            let stage = if *stage == b'v' { "VERTEX" } else { "FRAGMENT" };
            format!(
                "GLI0.t\n#! RES 8x8\nglCreateShader(GL_{stage}_SHADER)=1\nglShaderSource(1,1,\"{text}\",0)\nglCompileShader(1)\n\
                 glCreateProgram()=2\nglAttachShader(2,1)\nglLinkProgram(2)\nglUseProgram(2)\nglRectf(-1,-1,1,1)\nwglSwapBuffers(0)\n"
            )
            .into_bytes()
        }
        _ => data.to_vec(),
    };
    match import_bytes(Path::new("x.trace"), bytes, [&[], &[]], &Reading::default()) {
        Ok((trace, _)) => drop(check(&trace)),
        Err(error) => assert!(error.to_string().starts_with("x.trace"), "{error}"),
    }
});
