//! Floor 2: the scenes that are built in.
//!
//! Each scene is a program that records a trace. Everything in it is deterministic on every host: hashes instead of random numbers, `libm`
//! instead of the C library. `examples/record_scenes.rs` writes all of them into `traces/`, and a test compares the bytes.
//!
//! ```
//! let scene = scenes::named("triangle").expect("it is built in");
//! let trace = scene.open(&num::Limits::default())?;
//! assert_eq!(trace::check(&trace)?.draws, 1);
//! # Ok::<(), trace::TraceError>(())
//! ```

mod corridor;
mod cube;
mod flight;
mod knot;
mod layers;
mod maths;
mod msaa;
mod panel;
mod particles;
mod pixels;
mod shadow;
mod solids;
mod sprites;
mod torus;
mod town;
mod triangle;
mod viewer;

use std::io::Cursor;
use std::path::{Path, PathBuf};

use num::Limits;
use trace::record::Recorder;
use trace::{Packing, Trace, TraceError};

/// A scene.
pub struct Scene {
    /// Its name, which is that of its folder in `traces/`, or of its archive without the extension.
    pub name: &'static str,
    /// What it shows, as part of a sentence.
    pub about: &'static str,
    record: fn() -> Recorder,
    /// Whether it is kept as an archive.
    zip: bool,
}

impl Scene {
    /// The file or folder of the scene among those that are kept in `folder`.
    pub fn path(&self, folder: &Path) -> PathBuf {
        folder.join(if self.zip { format!("{}.zip", self.name) } else { self.name.to_owned() })
    }

    /// Records the scene and writes it into a folder.
    ///
    /// # Errors
    /// If the folder or a file cannot be written.
    pub fn save(&self, folder: &Path) -> Result<(), TraceError> {
        std::fs::create_dir_all(folder).map_err(|error| TraceError::new(folder, error))?;
        let path = self.path(folder);
        if self.zip { (self.record)().save_zip(path, Packing::Stored) } else { (self.record)().save(path) }
    }

    /// The bytes of the scene as an archive, the same on every host.
    ///
    /// # Errors
    /// If the archive cannot be made.
    pub fn archive(&self) -> Result<Vec<u8>, TraceError> {
        let mut bytes = Cursor::new(Vec::new());
        trace::write_archive(&(self.record)().finish(), Path::new(&self.title()), &mut bytes, Packing::Stored)?;
        Ok(bytes.into_inner())
    }

    /// Records the scene and opens it within these limits, without a file.
    ///
    /// # Errors
    /// If the scene asks for more than the limits allow.
    pub fn open(&self, limits: &Limits) -> Result<Trace, TraceError> {
        Trace::open_archive_with(Path::new(&self.title()), self.archive()?.into(), limits)
    }

    /// What messages call the scene: `@` and its name.
    fn title(&self) -> String {
        format!("@{}", self.name)
    }
}

/// The scene with this name. None if there is none.
pub fn named(name: &str) -> Option<&'static Scene> {
    ALL.iter().find(|scene| scene.name == name)
}

/// All scenes, those for a first look first.
pub const ALL: &[Scene] = &[
    Scene { name: "triangle", about: "vertex colours", record: triangle::record, zip: false },
    Scene {
        name: "cube",
        about: "a trilinear texture with mip levels, a depth test, instances",
        record: cube::record,
        zip: false,
    },
    Scene {
        name: "torus-knot",
        about: "70,000 triangles from 16-bit codes, Blinn-Phong lighting per pixel",
        record: knot::record,
        zip: true,
    },
    Scene {
        name: "town",
        about: "398 small draws without culling, two thirds of them out of view, and instances",
        record: town::record,
        zip: true,
    },
    Scene {
        name: "viewer",
        about: "a depth pass, one vertex layout for all draws, a scissor rectangle, rows of textured balls",
        record: viewer::record,
        zip: true,
    },
    Scene {
        name: "shadow",
        about: "a depth-only pass with bias, then nine comparisons per pixel",
        record: shadow::record,
        zip: false,
    },
    Scene {
        name: "sprites",
        about: "premultiplied and additive blending, an atlas, strips, instances",
        record: sprites::record,
        zip: false,
    },
    Scene { name: "spokes-msaa", about: "four samples per pixel, resolved", record: msaa::record, zip: false },
    Scene {
        name: "particles",
        about: "four frames of compute (workgroup memory, barriers, an atomic), an indirect draw, immediates",
        record: particles::record,
        zip: false,
    },
    Scene {
        name: "panel",
        about: "four frames of a user interface of which little changes, with passes that draw nothing",
        record: panel::record,
        zip: true,
    },
    Scene {
        name: "flight",
        about: "600 frames whose load rises and falls: a camera flies among globes",
        record: flight::record,
        zip: true,
    },
    Scene {
        name: "corridor",
        about: "a texture array at every ratio of texels to pixels",
        record: corridor::record,
        zip: false,
    },
    Scene {
        name: "layers",
        about: "ten layers in a random order for each cell: 2.929 of ten fragments are expected to pass",
        record: layers::record,
        zip: false,
    },
    Scene {
        name: "layers-front-first",
        about: "a smaller picture of layers, the nearest first",
        record: layers::front_first,
        zip: true,
    },
    Scene { name: "layers-random", about: "the same layers in a random order", record: layers::random, zip: true },
    Scene { name: "layers-back-first", about: "the same layers, the farthest first", record: layers::back_first, zip: true },
    Scene {
        name: "torus-bands",
        about: "a mesh whose indices go by bands of six squares, so that a cache of 16 keeps their vertices",
        record: torus::bands,
        zip: true,
    },
    Scene { name: "torus-rows", about: "the same mesh, row by row", record: torus::rows, zip: true },
    Scene { name: "torus-random", about: "the same mesh, its triangles in a random order", record: torus::random, zip: true },
];
