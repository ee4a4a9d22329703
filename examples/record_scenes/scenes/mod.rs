//! The scenes, one a file.

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

use std::path::{Path, PathBuf};

use fillrate::trace::record::Recorder;
use fillrate::trace::{Packing, TraceError};

/// A scene.
pub struct Scene {
    /// Name of its folder, or of its archive without the extension.
    pub name: &'static str,
    pub record: fn() -> Recorder,
    /// Whether it is kept as an archive.
    pub zip: bool,
}

impl Scene {
    /// Where it is kept.
    pub fn path(&self, folder: &Path) -> PathBuf {
        folder.join(if self.zip { format!("{}.zip", self.name) } else { self.name.to_owned() })
    }

    /// Records it and writes it into a folder.
    pub fn save(&self, folder: &Path) -> Result<(), TraceError> {
        std::fs::create_dir_all(folder).map_err(|error| TraceError::new(folder, error))?;
        let path = self.path(folder);
        if self.zip { (self.record)().save_zip(path, Packing::Stored) } else { (self.record)().save(path) }
    }
}

/// All scenes.
pub const ALL: &[Scene] = &[
    Scene { name: "triangle", record: triangle::record, zip: false },
    Scene { name: "cube", record: cube::record, zip: false },
    Scene { name: "torus-knot", record: knot::record, zip: true },
    Scene { name: "corridor", record: corridor::record, zip: false },
    Scene { name: "layers", record: layers::record, zip: false },
    Scene { name: "sprites", record: sprites::record, zip: false },
    Scene { name: "shadow", record: shadow::record, zip: false },
    Scene { name: "particles", record: particles::record, zip: false },
    Scene { name: "spokes-msaa", record: msaa::record, zip: false },
    Scene { name: "panel", record: panel::record, zip: true },
    Scene { name: "flight", record: flight::record, zip: true },
    Scene { name: "town", record: town::record, zip: true },
    Scene { name: "viewer", record: viewer::record, zip: true },
    Scene { name: "layers-front-first", record: layers::front_first, zip: true },
    Scene { name: "layers-random", record: layers::random, zip: true },
    Scene { name: "layers-back-first", record: layers::back_first, zip: true },
    Scene { name: "torus-bands", record: torus::bands, zip: true },
    Scene { name: "torus-rows", record: torus::rows, zip: true },
    Scene { name: "torus-random", record: torus::random, zip: true },
];
