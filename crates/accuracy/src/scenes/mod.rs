//! The techniques of a graphics course, each as a small scene: a recording, a proof of its picture with arithmetic that is not the renderer's,
//! and what it costs on every sort class.
//!
//! A scene is a constant beside its recording and proof, one file a technique, and a place in [`SCENES`]. With [`Setting::inject_fault`] it spoils
//! its recording as its `fault` says, and its proof must fail.

mod abuffer;
mod acne;
mod adaptive;
mod axial;
mod cube_map;
mod cull;
mod cutout;
mod deferred;
mod detail;
mod edges;
mod fighting;
mod fountain;
mod gamma;
pub(crate) mod kit;
mod layers;
mod light;
mod lines;
mod magnified;
mod maps;
mod mirror;
mod nyquist;
mod omni;
mod over;
mod page;
mod painter;
mod pcf;
mod rooms;
mod shadow;
mod shapes;
mod stage;

use anyhow::{Context, Result, anyhow};

use super::harness::on_threads;
use super::{Setting, hint};

pub use page::{markdown, pictures, text};
pub use stage::{Answer, Image, Played, Price, SceneRun};

/// All scenes, in the order of the page.
pub const SCENES: &[&Scene] = &[
    &painter::PAINTER,
    &painter::BSP,
    &fighting::FIGHTING,
    &over::OVER_SCENE,
    &abuffer::ABUFFER,
    &abuffer::KBUFFER,
    &abuffer::WEIGHTED,
    &cutout::CUTOUT,
    &axial::AXIAL,
    &magnified::MAGNIFIED,
    &acne::ACNE,
    &pcf::PCF,
    &omni::OMNI,
    &shadow::FLAT,
    &shadow::VOLUMES,
    &mirror::MIRROR,
    &cube_map::CUBE_MAP,
    &cube_map::SPHERE_MAP,
    &cube_map::NEAR_MAP,
    &light::LIGHTS,
    &light::FOG,
    &maps::BUMP,
    &maps::QUATERNIONS,
    &maps::CYLINDER,
    &maps::ROOM,
    &light::LOBES,
    &light::SHADING,
    &deferred::DEFERRED,
    &fountain::FOUNTAIN,
    &layers::COMBINE,
    &gamma::GAMMA,
    &layers::PYRAMID,
    &layers::WHEEL,
    &maps::STEREO,
    &edges::EDGES,
    &adaptive::ADAPTIVE,
    &nyquist::NYQUIST,
    &lines::LINES,
    &lines::SOFTWARE,
    &cull::FRUSTUM,
    &rooms::PORTAL,
    &cull::OCCLUSION,
    &detail::DETAIL,
    &detail::LOD,
];

/// A technique.
#[derive(Debug)]
pub struct Scene {
    /// Its name.
    pub name: &'static str,
    /// What it belongs to.
    pub group: &'static str,
    /// What is drawn, and what is proven of it.
    pub what: &'static str,
    /// What is spoiled to see the proof fail.
    pub fault: &'static str,
    /// Records, proves and asks.
    pub play: fn(&mut SceneRun) -> Result<()>,
}

/// A scene that was played.
#[derive(Clone, Debug)]
pub struct SceneResult {
    /// Which one.
    pub scene: &'static Scene,
    /// What it left.
    pub played: Played,
}

impl SceneResult {
    /// Whether everything is as it must be; nothing measured is nothing shown.
    pub fn holds(&self) -> bool {
        !self.played.rows.is_empty() && self.played.rows.iter().all(super::Row::holds)
    }
}

impl Scene {
    /// Plays it.
    ///
    /// # Errors
    /// If its recording does not render, or a machine stops.
    pub fn run(&'static self, setting: &Setting) -> Result<SceneResult> {
        let mut stage = SceneRun::new(*setting);
        (self.play)(&mut stage).with_context(|| format!("scene {}", self.name))?;
        Ok(SceneResult { scene: self, played: stage.played })
    }
}

/// Plays scenes, as many at once as there are threads; what they come to is in the order of the scenes.
///
/// # Errors
/// The first scene's that does not run, or that a thread cannot be started.
pub fn run(scenes: &[&'static Scene], setting: &Setting) -> Result<Vec<SceneResult>> {
    on_threads(scenes.len(), "scene", &|at| scenes[at].run(setting))
}

/// The scene of that name.
///
/// # Errors
/// If there is none: the message names one that is near.
pub fn find(name: &str) -> Result<&'static Scene> {
    SCENES
        .iter()
        .copied()
        .find(|scene| scene.name == name)
        .ok_or_else(|| anyhow!("there is no scene {name}{}", hint(SCENES.iter().map(|scene| scene.name), name)))
}
