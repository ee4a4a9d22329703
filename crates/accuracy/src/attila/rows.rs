//! What is compared: for each counter of ATTILA what counts the same here.

use anyhow::{Context, Result};

use super::Counters;
use run::frame_sink::Frame;
use stats::Tree;
use unit::phase::PhaseKind;

/// How near two counters have to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bound {
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

impl Bound {
    /// The largest relative difference.
    pub fn allowed(self) -> Option<f64> {
        match self {
            Bound::Work | Bound::OfTriangles(_) => Some(0.01),
            Bound::Traffic => Some(0.15),
            Bound::Cycles => Some(0.20),
            Bound::None => None,
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
    pub bound: Bound,
}

impl Row {
    /// The relative difference; infinite where there should be nothing.
    pub fn difference(&self) -> f64 {
        let whole = if let Bound::OfTriangles(triangles) = self.bound { triangles as f64 } else { self.theirs };
        if self.ours == self.theirs { 0.0 } else { (self.ours - self.theirs) / whole }
    }

    /// Whether they are near enough.
    pub fn holds(&self) -> bool {
        self.bound.allowed().is_none_or(|allowed| self.difference().abs() <= allowed)
    }
}

/// Our counters of a frame.
struct Ours<'f>(&'f Tree);

impl Ours<'_> {
    fn one(&self, path: &str) -> Result<f64> {
        self.0.number(path).with_context(|| format!("the statistics have no {path}"))
    }

    /// The sum over all units of a bank.
    fn sum(&self, bank: &str, name: &str) -> Result<f64> {
        let mut sum = 0.0;
        self.0.leaves(&mut |path, leaf| {
            let of = path.strip_prefix(bank).and_then(|rest| rest.strip_prefix('[')).and_then(|rest| rest.split_once("]."));
            if of.is_some_and(|(_, rest)| rest == name) {
                sum += leaf.number().unwrap_or(0.0);
            }
        });
        Ok(sum)
    }

    fn client(&self, name: &str) -> Result<[f64; 2]> {
        Ok([self.one(&format!("memory.clients.{name}.read_bytes"))?, self.one(&format!("memory.clients.{name}.write_bytes"))?])
    }
}

/// All rows of a frame.
///
/// # Errors
/// If a counter is missing.
pub(super) fn rows(theirs: &Counters, frame: &Frame) -> Result<Vec<Row>> {
    let ours = Ours(&frame.tree);
    let batches = theirs.one("Batches_CP")?;
    let mut rows = Vec::new();
    let mut row = |what, ours, theirs, bound| rows.push(Row { what, ours, theirs, bound });

    // 1. Triangles. ATTILA counts the end of a batch as one, and drops what has an index twice before it counts.
    let dropped = theirs.one("Degenerated_PA")?;
    let triangles = theirs.one("Triangles_PA")? - batches + dropped;
    row("triangles", ours.one("funnel.primitives_in")?, triangles, Bound::Work);
    let of = Bound::OfTriangles(triangles as u64);
    let culled: f64 =
        ["culled_degenerate", "culled_backface"].iter().map(|name| ours.one(&format!("funnel.{name}"))).sum::<Result<f64>>()?;
    row("culled", culled, theirs.one("CulledTriangles_TS")? + dropped, of);
    row("back-facing", ours.sum("facing.distribute", "back")?, theirs.one("BackFacingTriangles_TS")?, of);

    // 2. Fragments, whole quads of them. A batch ends with one quad that carries its end, at each ROP with one.
    let end = 4.0 * batches;
    let ends = 4.0 * end;
    let covered = theirs.one("InputFragments_HZ")? - theirs.one("CulledOutsideFragments_HZ")? - end;
    let rasterized = 4.0 * ours.one("funnel.quads_rasterized")?;
    row("fragments", rasterized, covered, Bound::Work);
    let early = 4.0 * ours.sum("units.depth", "items")?;
    let tested = theirs.sum("TestedFragments_ZST")?;
    let passed = if early > 0.0 { ours.one("funnel.fragments_written")? } else { 0.0 };
    let left = if early > 0.0 { early } else { rasterized };
    row("fragments behind hierarchical Z", left, theirs.one("OutputFragments_HZ")? - end, Bound::Work);
    row("depth tested", early, tested, Bound::Work);
    row("depth passed", passed, theirs.sum("PassedFragments_ZST")?, Bound::Work);
    row("depth failed", early - passed, theirs.sum("FailedFragments_ZST")?, Bound::Work);
    row("shaded", 4.0 * ours.one("funnel.quads_shaded")?, theirs.sum("InputFragments_CW")? - ends, Bound::Work);
    row("blended", 4.0 * ours.sum("blending.color", "quads")?, theirs.sum("BlendedFragments_CW")?, Bound::Work);

    // 3. Requests and bytes.
    row("texture requests", ours.sum("shading.texture", "quads")?, theirs.sum("TextureRequests_TU")?, Bound::Traffic);
    for (what, client, read, write) in [
        ("texture bytes", "texture", "ReadBytesMemory_TU", None),
        ("depth bytes", "depth", "ReadBytes_ZST", Some("WriteBytes_ZST")),
        ("colour bytes", "color", "ReadBytes_CW", Some("WriteBytes_CW")),
    ] {
        let written = write.map_or(Ok(0.0), |name| theirs.sum(name))?;
        row(what, ours.client(client)?.iter().sum(), theirs.sum(read)? + written, Bound::Traffic);
    }
    row("vertex bytes", ours.client("vertex")?[0], theirs.one("ReadBytes_SL0")?, Bound::Traffic);
    row("index bytes", ours.client("index")?[0], theirs.one("ReadBytes_StF")?, Bound::Traffic);
    row("upload bytes", ours.client("command")?[1], theirs.one("BytesWritten_CP")?, Bound::Traffic);
    row("scan-out bytes", ours.client("scanout")?[0], theirs.one("DAC_ReadBytes_MC")?, Bound::Traffic);

    // 4. Time.
    let cycles: u64 = frame.phases.iter().filter(|phase| phase.phase.kind == PhaseKind::Pass).map(|phase| phase.cycles).sum();
    let drawing = theirs.one("Draw_CP")? + theirs.one("EndGeometry_CP")? + theirs.one("EndFragment_CP")?;
    row("cycles of drawing", cycles as f64, drawing, Bound::Cycles);

    // 5. What explains them.
    row("vertices shaded", ours.one("funnel.vertices_shaded")?, theirs.one("ShaderOutputs_StC")?, Bound::None);
    for (what, client, name, which) in [
        ("depth bytes read", "depth", "ReadBytes_ZST", 0),
        ("depth bytes written", "depth", "WriteBytes_ZST", 1),
        ("colour bytes read", "color", "ReadBytes_CW", 0),
        ("colour bytes written", "color", "WriteBytes_CW", 1),
    ] {
        row(what, ours.client(client)?[which], theirs.sum(name)?, Bound::None);
    }
    Ok(rows)
}
