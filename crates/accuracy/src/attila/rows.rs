//! What is compared: for each counter of ATTILA what counts the same here.

use anyhow::Result;

use super::Counters;
use crate::harness::{counts, funnel, items};
use mem::{CLIENTS, ClientCounts};
use run::frame_sink::Frame;
use unit::color::{BLENDING, BlendCounts};
use unit::distribute::{FACING, FacingCounts};
use unit::phase::PhaseKind;
use unit::texture::{TEXTURES, TextureCounts};

/// How near two counters have to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tolerance {
    /// Work: 1 %.
    Work,
    /// What is left out: 1 % of the triangles.
    OfTriangles(u64),
    /// Requests and bytes of a client of memory: 15 %.
    Traffic,
    /// Cycles of drawing: 20 %, and 10 % in the geometric mean.
    Cycles,
    /// None: to explain others.
    None,
}

impl Tolerance {
    /// The largest relative difference.
    pub fn allowed(self) -> Option<f64> {
        match self {
            Tolerance::Work | Tolerance::OfTriangles(_) => Some(0.01),
            Tolerance::Traffic => Some(0.15),
            Tolerance::Cycles => Some(0.20),
            Tolerance::None => None,
        }
    }
}

/// One thing that both count.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// What it is.
    pub what: &'static str,
    /// What this simulator counts.
    pub ours: f64,
    /// What ATTILA counts.
    pub theirs: f64,
    /// How near they have to be.
    pub bound: Tolerance,
}

impl Row {
    /// The relative difference; infinite where there should be nothing.
    pub fn difference(&self) -> f64 {
        let whole = if let Tolerance::OfTriangles(triangles) = self.bound { triangles as f64 } else { self.theirs };
        if self.ours == self.theirs { 0.0 } else { (self.ours - self.theirs) / whole }
    }

    /// Whether they are near enough.
    pub fn holds(&self) -> bool {
        self.bound.allowed().is_none_or(|allowed| self.difference().abs() <= allowed)
    }
}

/// All rows of a frame.
///
/// # Errors
/// If a counter is missing.
pub(super) fn rows(theirs: &Counters, frame: &Frame) -> Result<Vec<Row>> {
    let tree = &frame.tree;
    let funnel = funnel(tree)?;
    let client = |name| -> Result<[f64; 2]> {
        let counts: ClientCounts = counts(tree, CLIENTS.named(name))?;
        Ok([counts.read_bytes, counts.write_bytes].map(|bytes| bytes as f64))
    };
    let batches = theirs.one("Batches_CP")?;
    let mut rows = Vec::new();
    let mut row = |what, ours, theirs, bound| rows.push(Row { what, ours, theirs, bound });

    // 1. Triangles. ATTILA counts the end of a batch as one, and drops what has an index twice before it counts.
    let dropped = theirs.one("Degenerated_PA")?;
    let triangles = theirs.one("Triangles_PA")? - batches + dropped;
    row("triangles", funnel.primitives_in as f64, triangles, Tolerance::Work);
    let of = Tolerance::OfTriangles(triangles as u64);
    let culled = funnel.culled_degenerate + funnel.culled_backface;
    row("culled", culled as f64, theirs.one("CulledTriangles_TS")? + dropped, of);
    row("back-facing", counts::<FacingCounts>(tree, FACING)?.back as f64, theirs.one("BackFacingTriangles_TS")?, of);

    // 2. Fragments, whole quads of them. A batch ends with one quad that carries its end, at each ROP with one.
    let end = 4.0 * batches;
    let ends = 4.0 * end;
    let covered = theirs.one("InputFragments_HZ")? - theirs.one("CulledOutsideFragments_HZ")? - end;
    let rasterized = 4.0 * funnel.quads_rasterized as f64;
    row("fragments", rasterized, covered, Tolerance::Work);
    let early = 4.0 * items(tree, "depth")?;
    let tested = theirs.sum("TestedFragments_ZST")?;
    let passed = if early > 0.0 { funnel.fragments_written as f64 } else { 0.0 };
    let left = if early > 0.0 { early } else { rasterized };
    row("fragments behind hierarchical Z", left, theirs.one("OutputFragments_HZ")? - end, Tolerance::Work);
    row("depth tested", early, tested, Tolerance::Work);
    row("depth passed", passed, theirs.sum("PassedFragments_ZST")?, Tolerance::Work);
    row("depth failed", early - passed, theirs.sum("FailedFragments_ZST")?, Tolerance::Work);
    row("shaded", 4.0 * funnel.quads_shaded as f64, theirs.sum("InputFragments_CW")? - ends, Tolerance::Work);
    row(
        "blended",
        4.0 * counts::<BlendCounts>(tree, BLENDING)?.quads as f64,
        theirs.sum("BlendedFragments_CW")?,
        Tolerance::Work,
    );

    // 3. Requests and bytes.
    row(
        "texture requests",
        counts::<TextureCounts>(tree, TEXTURES)?.quads as f64,
        theirs.sum("TextureRequests_TU")?,
        Tolerance::Traffic,
    );
    for (what, name, read, write) in [
        ("texture bytes", "texture", "ReadBytesMemory_TU", None),
        ("depth bytes", "depth", "ReadBytes_ZST", Some("WriteBytes_ZST")),
        ("colour bytes", "color", "ReadBytes_CW", Some("WriteBytes_CW")),
    ] {
        let written = write.map_or(Ok(0.0), |counter| theirs.sum(counter))?;
        row(what, client(name)?.iter().sum(), theirs.sum(read)? + written, Tolerance::Traffic);
    }
    row("vertex bytes", client("vertex")?[0], theirs.one("ReadBytes_SL0")?, Tolerance::Traffic);
    row("index bytes", client("index")?[0], theirs.one("ReadBytes_StF")?, Tolerance::Traffic);
    // Copies read as much as they write. They are the Blitter's there, which is a part of the DAC.
    let [copied, written] = client("command")?;
    row("upload bytes", written - copied, theirs.one("BytesWritten_CP")?, Tolerance::Traffic);
    row("scan-out bytes", client("scanout")?[0] + copied, theirs.one("DAC_ReadBytes_MC")?, Tolerance::Traffic);

    // 4. Time. Drawing ends there when the last fragment is in the colour cache, which is written back at the swap.
    let passes = frame.phases.iter().filter(|phase| phase.phase.kind == PhaseKind::Pass);
    let cycles: u64 = passes.flat_map(|pass| &pass.draws).filter(|draw| draw.number.is_some()).map(|draw| draw.cycles).sum();
    let drawing = theirs.one("Draw_CP")? + theirs.one("EndGeometry_CP")? + theirs.one("EndFragment_CP")?;
    row("cycles of drawing", cycles as f64, drawing, Tolerance::Cycles);

    // 5. What explains them.
    row("vertices shaded", funnel.vertices_shaded as f64, theirs.one("ShaderOutputs_StC")?, Tolerance::None);
    for (what, of, name, which) in [
        ("depth bytes read", "depth", "ReadBytes_ZST", 0),
        ("depth bytes written", "depth", "WriteBytes_ZST", 1),
        ("colour bytes read", "color", "ReadBytes_CW", 0),
        ("colour bytes written", "color", "WriteBytes_CW", 1),
    ] {
        row(what, client(of)?[which], theirs.sum(name)?, Tolerance::None);
    }
    Ok(rows)
}
