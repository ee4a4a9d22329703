//! Writes the first corpus of the fuzz targets: the kept traces, whole, in parts and cut, and small inputs of every form that the tests of
//! hostile input write, in the form that each target takes.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use fillrate::num::Random;
use fillrate::trace::{Packing, Trace, write_zip};

#[path = "../../crates/shader/tests/shaders/differential.rs"]
#[allow(dead_code, reason = "programs are written here, not run")]
mod differential;
#[path = "../../tests/robust/forms/mod.rs"]
#[allow(dead_code, reason = "the tests take forms of larger sizes, too")]
mod forms;
#[path = "../../crates/shader/tests/shaders/generate/mod.rs"]
#[allow(dead_code, reason = "programs are written here, not run")]
mod generate;
#[path = "../../crates/gfxr/tests/hostile/sample.rs"]
mod gfxr_sample;
#[path = "../../crates/shader/tests/shaders/oracle/mod.rs"]
#[allow(dead_code, reason = "programs are written here, not run")]
mod oracle;
#[path = "../../crates/import/tests/import/recorder.rs"]
#[allow(dead_code, reason = "the seeds have few kinds of values")]
mod recorder;
#[path = "../../tests/robust/replays.rs"]
mod replays;
#[path = "../../crates/shader/tests/shaders/trees/mod.rs"]
#[allow(dead_code, reason = "trees are written here, not run")]
mod trees;

use recorder::Value::{Enum, Floats, Null, Pointer, Uint};
use recorder::{Value, Writer};

/// Sizes of the forms: one that hardly nests, and one that does.
const SIZES: [usize; 2] = [2, 14];

/// The corpus of a target.
struct Corpus(PathBuf);

impl Corpus {
    fn of(target: &str) -> io::Result<Corpus> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target);
        fs::create_dir_all(&folder)?;
        Ok(Corpus(folder))
    }

    /// Writes one input. Its name follows from its contents.
    fn add(&self, bytes: impl AsRef<[u8]>) -> io::Result<()> {
        fs::write(self.0.join(&fillrate::trace::hash_of(bytes.as_ref())[..16]), bytes)
    }

    /// Writes an input, and what is left of it where its end is missing.
    fn add_cut(&self, bytes: &[u8]) -> io::Result<()> {
        [1, 2, 3, 4].into_iter().try_for_each(|quarters| self.add(&bytes[..bytes.len() * quarters / 4]))
    }

    /// Writes the files below a folder with an extension, each after a byte if one is given.
    fn copy(&self, from: &Path, extension: &str, tag: Option<u8>) -> io::Result<()> {
        for entry in fs::read_dir(from)? {
            let path = entry?.path();
            if path.is_dir() {
                self.copy(&path, extension, tag)?;
            } else if path.extension().is_some_and(|found| found == extension) {
                self.add(tag.into_iter().chain(fs::read(&path)?).collect::<Vec<u8>>())?;
            }
        }
        Ok(())
    }

    /// Writes each form in its sizes, each after a byte.
    fn forms(&self, kinds: &[forms::TextForm], tag: &str) -> io::Result<()> {
        for (_, make) in kinds {
            for size in SIZES {
                self.add(format!("{tag}{}", make(size)))?;
            }
        }
        Ok(())
    }

    /// Writes choices for a generator.
    fn choices(&self, length: usize) -> io::Result<()> {
        for seed in 0..16 {
            let mut random = Random::new(seed);
            self.add((0..length).map(|_| random.bits() as u8).collect::<Vec<u8>>())?;
        }
        Ok(())
    }
}

/// What `trace_reader` reads: 0 before an archive, 1 before a text, 2 before the commands of a text.
fn traces(root: &Path) -> io::Result<()> {
    let corpus = Corpus::of("trace_reader")?;
    for entry in fs::read_dir(root.join("traces"))? {
        let path = entry?.path();
        let trace = Trace::open(&path).map_err(io::Error::other)?;
        // An archive is stored only where it is small, as a fuzzer gets nowhere in a megabyte.
        for packing in [Packing::Stored, Packing::Deflated] {
            let to = corpus.0.join("archive");
            write_zip(&trace, &to, packing).map_err(io::Error::other)?;
            let bytes = fs::read(&to)?;
            fs::remove_file(&to)?;
            if bytes.len() <= 64 << 10 {
                corpus.add_cut(&[&[0], &bytes[..]].concat())?;
            }
        }
        if path.is_dir() {
            let text = fs::read_to_string(path.join("trace.ron"))?;
            corpus.add_cut(format!("\u{1}{text}").as_bytes())?;
            if let Some((_, commands)) = text.split_once("commands: [") {
                let commands = commands.trim_end().trim_end_matches(')').trim_end().trim_end_matches("],");
                corpus.add(format!("\u{2}{commands}"))?;
            }
        }
    }
    // Small, since the target looks for the place of each command from the start.
    forms::binary::ARCHIVES.iter().try_for_each(|(_, make)| corpus.add([vec![0], make(60)].concat()))?;
    for &(_, before, behind) in forms::ron::NATIVE {
        for (_, make) in forms::ron::VALUES {
            corpus.add(format!("\u{1}{before}{}{behind}", make(5)))?;
        }
    }
    for (_, make) in forms::work::COMMANDS {
        let folder = corpus.0.join("recorded");
        make(3).save(&folder).map_err(io::Error::other)?;
        corpus.add([&[1], &fs::read(folder.join("trace.ron"))?[..]].concat())?;
        fs::remove_dir_all(folder)?;
    }
    Ok(())
}

/// Actions that wgpu wrote down and then refused, and commands that use what they should have made.
const FAILED: &[&str] = &[
    r#"[Init(desc: (features: (data: [0])), backend: "vulkan"), CreateBuffer(PointerId(16), (label: None, size: 64, usage: "COPY_DST", mapped_at_creation: false)), FailedCommands(commands: None, failed_at_submit: Some(1), error: "destroyed")]"#,
    r#"[CreateBuffer(PointerId(16), (label: None, size: 64, usage: "COPY_DST", mapped_at_creation: false)), Submit(1, [ClearBuffer(dst: PointerId(16), offset: 4, size: None)]), Submit(2, [ClearBuffer(dst: PointerId(16), offset: 8, size: None)]), FailedCommands(commands: None, failed_at_submit: Some(2), error: "destroyed")]"#,
    r#"[WriteBuffer(id: PointerId(16), data: "data1.bin", offset: 4294967296, size: 64, queued: true)]"#,
    r#"[CreateShaderModule(id: PointerId(3), desc: (label: None), data: File("data3.wgsl")), CreateComputePipeline(id: PointerId(4), desc: (label: None, layout: None, stage: (module: PointerId(3), entry_point: Some("no such entry"), constants: {}, zero_initialize_workgroup_memory: true)))]"#,
    r#"[ConfigureSurface(PointerId(1), (usage: "RENDER_ATTACHMENT", format: "rgba8unorm", width: 0, height: 6)), GetSurfaceTexture(id: PointerId(2), parent: PointerId(1)), DestroyTexture(PointerId(2)), Present(PointerId(1))]"#,
];

/// Programs of several contexts, windows and threads, as the calls of GLInterceptor's text.
const CONTEXTS: &[&str] = &[
    "wglCreateContext(1)=16\nwglCreateContext(1)=32\nwglShareLists(16,32)=1\nwglMakeCurrent(1,16)=1\nglEnable(GL_BLEND)\nwglMakeCurrent(2,32)=1\nglRectf(-1,-1,1,1)\nwglSwapBuffers(2)\nwglDeleteContext(16)=1\n",
    "glXCreateContextAttribsARB(1,2,0,1,0)=16\nglXMakeContextCurrent(1,3,4,16)=1\nglViewport(0,0,8,4)\nglClear(GL_COLOR_BUFFER_BIT)\nglXSwapBuffers(1,3)\nglXDestroyWindow(1,3)\nglXDestroyContext(1,16)\n",
    "wglMakeCurrent(1,1)=1\nglActiveTexture(GL_TEXTURE0)\nglGenTextures(1,{5})\nglBindTexture(GL_TEXTURE_2D,5)\nglTexImage2D(GL_TEXTURE_2D,0,GL_RGBA8,1,1,0,GL_RGBA,GL_UNSIGNED_BYTE,0)\nglBindFramebuffer(GL_FRAMEBUFFER,1)\nglFramebufferTexture2D(GL_FRAMEBUFFER,GL_COLOR_ATTACHMENT0,GL_TEXTURE_2D,5,0)\nglDeleteTextures(1,{5})\nglRectf(0,0,1,1)\nwglSwapBuffers(1)\n",
];

/// Calls that stand for themselves in assembly.
const ASSEMBLY: &[&str] = &[
    "MOV result.color, fragment.color;\nEND\n",
    "TEMP a, b;\nPARAM c[2] = { {1, 2, 3, 4}, state.matrix.mvp.row[0] };\nTEX a, fragment.texcoord[0], texture[0], 2D;\nMAD_SAT b.xyz, a, c[1].w, -a.wzyx;\nKIL b;\nMOV result.color, b;\nEND\n",
    "ATTRIB p = vertex.position;\nPARAM m[4] = { state.matrix.mvp };\nADDRESS A;\nARL A.x, p.x;\nDP4 result.position.x, m[0], p;\nMOV result.color, m[A.x + 1];\nEND\n",
];

/// A program of apitrace with a context of its own in each of two threads.
fn threads() -> Vec<u8> {
    let mut w = Writer::new(6);
    for (thread, context, window) in [(0, 16, 101), (1, 32, 102)] {
        let args = [Pointer(1), Pointer(2), Null, Uint(1)];
        w.call_in(thread, "glXCreateContextAttribsARB", &args, Some(Pointer(context)));
        w.call_in(thread, "glXMakeCurrent", &[Pointer(1), Uint(window), Pointer(context)], Some(Uint(1)));
        w.call_in(thread, "glViewport", &[0, 0, 8, 8].map(Uint), None);
    }
    for (thread, window) in [(0, 101), (1, 102), (0, 101)] {
        w.call_in(thread, "glColor4fv", &[Floats(vec![1.0, 0.5, 0.0, 1.0])], None);
        w.call_in(thread, "glEnable", &[Enum(0xb71)], None);
        w.call_in(thread, "glRectf", &[-1.0, -1.0, 1.0, 0.5].map(Value::Float), None);
        w.call_in(thread, "glXSwapBuffers", &[Pointer(1), Uint(window)], None);
    }
    w.bytes
}

fn recordings(root: &Path) -> io::Result<()> {
    let corpus = Corpus::of("wgpu_import")?;
    for name in ["all", "refused", "culling/trace", "deferred/trace", "formats/trace", "window/trace"] {
        corpus.add_cut(&fs::read(root.join("crates/import/tests/import").join(name).join("trace.ron"))?)?;
    }
    FAILED.iter().try_for_each(|text| corpus.add_cut(text.as_bytes()))?;
    for &(_, before, behind) in forms::ron::WGPU {
        for (_, make) in forms::ron::VALUES {
            corpus.add(format!("{before}{}{behind}", make(5)))?;
        }
    }

    let corpus = Corpus::of("pictures")?;
    forms::binary::PICTURES.iter().try_for_each(|(_, make)| corpus.add(make(400)))?;

    let corpus = Corpus::of("gl_import")?;
    for kinds in [forms::glsl::DEEP, forms::glsl::LONG, forms::glsl::LARGE] {
        corpus.forms(kinds, "f")?;
        corpus.forms(kinds, "v")?;
    }
    for text in ASSEMBLY {
        corpus.add(format!("V{text}"))?;
        corpus.add(format!("F{text}"))?;
    }
    CONTEXTS.iter().try_for_each(|calls| corpus.add_cut(format!("GLI0.t\n#! RES 8x8\n{calls}").as_bytes()))?;
    let stream = threads();
    (1..=8).try_for_each(|part| corpus.add([b"S", &stream[..stream.len() * part / 8]].concat()))?;
    forms::binary::RECORDINGS.iter().try_for_each(|(_, make)| corpus.add(make(400)))?;
    for (_, make) in [forms::calls::CALLS, forms::calls::LARGE].concat() {
        corpus.add_cut(make(5).as_bytes())?;
    }
    Corpus::of("gl_machine")?.choices(400)
}

fn shaders(root: &Path) -> io::Result<()> {
    let corpus = Corpus::of("shaders")?;
    corpus.copy(&root.join("crates/import/tests/import"), "wgsl", Some(b'W'))?;
    corpus.copy(&root.join("examples"), "wgsl", Some(b'W'))?;
    corpus.copy(&root.join("crates/render/tests/programs"), "spv", Some(b'S'))?;
    corpus.copy(&root.join("crates/import/tests/import/culling"), "ron", Some(b'N'))?;
    for kinds in forms::grammar::ALL {
        corpus.forms(kinds, "W")?;
    }
    for seed in 0..40 {
        corpus.add(format!("W{}", generate::generate(&mut generate::Random::seeded(seed)).source))?;
        corpus.add([b"S", &trees::spirv::write(&trees::program(seed))[..]].concat())?;
    }
    corpus.add([b"S", &trees::spirv::by_hand()[..]].concat())?;
    Corpus::of("programs")?.choices(2_000)
}

/// SPIR-V that naga makes of WGSL, behind a word that chooses a stage and all that a pipeline may say.
fn modules(root: &Path) -> io::Result<()> {
    let corpus = Corpus::of("spirv")?;
    let mut texts: Vec<String> = (0..20).map(|seed| generate::generate(&mut generate::Random::seeded(seed)).source).collect();
    for entry in fs::read_dir(root.join("crates/scenes/src"))? {
        let path = entry?.path();
        if path.extension().is_some_and(|extension| extension == "wgsl") {
            texts.push(fs::read_to_string(path)?);
        }
    }
    for text in texts {
        let Ok(mut module) = naga::front::wgsl::parse_str(&text) else { continue };
        let stages: Vec<naga::ShaderStage> = module.entry_points.iter().map(|entry| entry.stage).collect();
        module.entry_points.iter_mut().for_each(|entry| entry.name = "main".to_owned());
        let mut validator = naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::all());
        let Ok(info) = validator.validate(&module) else { continue };
        let Ok(words) = naga::back::spv::write_vec(&module, &info, &naga::back::spv::Options::default(), None) else {
            continue;
        };
        for stage in stages {
            let number = [naga::ShaderStage::Vertex, naga::ShaderStage::Fragment, naga::ShaderStage::Compute]
                .into_iter()
                .position(|known| known == stage);
            let Some(number) = number else { continue };
            let choice = number as u32 | 4 | 8 | 16 | 37 << 16;
            let bytes: Vec<u8> = std::iter::once(&choice).chain(&words).flat_map(|word| word.to_le_bytes()).collect();
            corpus.add(bytes)?;
        }
    }
    Ok(())
}

fn main() -> io::Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    traces(&root)?;
    recordings(&root)?;
    shaders(&root)?;
    modules(&root)?;
    Corpus::of("sequences")?.choices(300)?;
    let configs = Corpus::of("configs")?;
    configs.copy(&root.join("configs"), "ron", None)?;
    for setting in ["core.warps=8", "assembly.batch=9", "memory.channels=[1,2]", "sort=sort-last-image"] {
        configs.add(format!("--set {setting}"))?;
    }
    Corpus::of("experiments")?.copy(&root.join("configs/experiments"), "ron", None)?;
    let captures = Corpus::of("gfxr_reader")?;
    gfxr_sample::all().into_iter().try_for_each(|capture| captures.add(capture))?;
    Corpus::of("replays")?.add(replays::Small::new().text)
}
