//! Recorded calls that a check writes itself, and the pictures that they give.

use std::fmt::Write;
use std::path::Path;

use anyhow::{Context, Result, anyhow, ensure};

use import::Report;
use import::gl::import_bytes;
use machine::Config;
use run::picture::picture;
use run::replay::{Fidelity, Frame, Options, replay};
use trace::{Reading, Trace};

/// Edge of the window in pixels.
const EDGE: u32 = 8;

/// Calls of OpenGL in GLInterceptor's text, and the bytes that they point to. The window has 8x8 pixels.
#[derive(Clone, Debug, Default)]
pub struct Recording {
    calls: String,
    descriptors: Vec<u8>,
    regions: Vec<u8>,
    blobs: u32,
}

impl Recording {
    /// A recording without calls.
    pub fn new() -> Recording {
        Recording::default()
    }

    /// Appends calls, one per line.
    pub fn add(&mut self, calls: &str) -> &mut Recording {
        for call in calls.lines() {
            let _ = writeln!(self.calls, "{}", call.trim());
        }
        self
    }

    /// Ends a frame.
    pub fn end_frame(&mut self) -> &mut Recording {
        self.add("wglSwapBuffers(0)")
    }

    /// Keeps bytes; what an argument names them by.
    pub fn blob(&mut self, bytes: &[u8]) -> String {
        self.blobs += 1;
        let (id, size) = (self.blobs, bytes.len() as u32);
        self.descriptors.extend([id, 0, size, id].iter().flat_map(|word| word.to_le_bytes()));
        self.regions.extend([id, 0, size].iter().flat_map(|word| word.to_le_bytes()));
        self.regions.extend_from_slice(bytes);
        format!("*{id}")
    }

    /// A 2D texture of unit 0 with these bytes; nearest filters, edges clamped.
    pub fn texture(&mut self, internal: &str, [width, height]: [u32; 2], format: &str, bytes: &[u8]) -> &mut Recording {
        let blob = self.blob(bytes);
        self.add(&format!(
            "glPixelStorei(GL_UNPACK_ALIGNMENT,1)
             glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_NEAREST)
             glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MAG_FILTER,GL_NEAREST)
             glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_WRAP_S,GL_CLAMP_TO_EDGE)
             glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_WRAP_T,GL_CLAMP_TO_EDGE)
             glTexImage2D(GL_TEXTURE_2D,0,{internal},{width},{height},0,{format},GL_UNSIGNED_BYTE,{blob})"
        ))
    }

    /// Imports the calls.
    ///
    /// # Errors
    /// If they are damaged; what is not supported is in the report.
    pub fn import(&self) -> Result<(Trace, Report)> {
        let text = format!("GLI0.t\n#! RES {EDGE}x{EDGE}\n{}", self.calls);
        let name = Path::new("calls.txt");
        Ok(import_bytes(name, text.into_bytes(), [&self.descriptors, &self.regions], &Reading::default())?)
    }

    /// Red, green and blue of the pixel (4, 4) from the top left, of each frame, in 255ths.
    ///
    /// # Errors
    /// If a call is damaged, not supported, or raises an error.
    pub fn centers(&self) -> Result<Vec<[f64; 3]>> {
        let (trace, report) = self.import()?;
        if let Some(refusal) = report.refusal() {
            return Err(anyhow!("not supported: {refusal}"));
        }
        ensure!(report.errors.is_empty(), "calls with errors: {:?}", report.errors);
        let options = Options {
            frames: 0..report.frames as u32,
            ..Options::new(Config::built_in("four-pipelines")?, Fidelity::Functional)
        };
        let replayed = replay(&trace, &options, &|_| ())?;
        let center = |frame: &Frame| {
            let (surface, bytes) = frame.shown.as_ref().context("a frame has no picture")?;
            let picture = picture(surface, bytes).map_err(|reason| anyhow!(reason))?;
            let [r, g, b, _] = picture.get_pixel(EDGE / 2, EDGE / 2).0.map(f64::from);
            Ok([r, g, b])
        };
        replayed.frames.iter().map(center).collect()
    }
}
