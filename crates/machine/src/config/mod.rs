//! A machine's configuration: as written, as checked, as text.
//!
//! Every knob is declared once, in the unit that it configures ([`knobs!`](knob::knobs)). A configuration is RON: nested sections
//! of `key: value`, with `extends: "NAME"` for the configuration that it changes. The baseline is complete and extends nothing.

mod knobs;
mod places;
mod read;
mod rules;
mod text;

pub use super::class::SortClass;
use super::class::Sorted;
pub use knobs::CardConfig;
pub use mem::{DramConfig, L2Config, MemoryKind, MemoryKnobs, TlbConfig};
pub use rules::Rule;
pub use text::documentation;

use knob::{Knob, Section, Setting};
use unit::{
    assembly::AssemblyConfig,
    bin::BinConfig,
    clip::ClipConfig,
    color::ColorConfig,
    command::{CommandConfig, CullChoice},
    compose::ComposeConfig,
    compute::ComputeConfig,
    constant::ConstantConfig,
    core::{CoreConfig, Instructions},
    depth::DepthConfig,
    dispatch::DispatchConfig,
    distribute::DistributeConfig,
    fetch::FetchConfig,
    interpolate::InterpolateConfig,
    network::NetworkConfig,
    resolve::ResolveConfig,
    route::RouteConfig,
    scanout::ScanoutConfig,
    setup::SetupConfig,
    sorting::{Keep, OrderConfig},
    texture::TextureConfig,
    traverse::TraverseConfig,
    warp::Execution,
};
use work::{Cull, CulledLate, RenderKey, Shade};

/// The configurations that are built in: name and text.
pub const BUILT_IN: &[(&str, &str)] = &[
    ("baseline", include_str!("../../configs/baseline.ron")),
    ("four-pipelines", include_str!("../../configs/four-pipelines.ron")),
    ("tiny", include_str!("../../configs/tiny.ron")),
    ("attila", include_str!("../../configs/attila.ron")),
    ("wide", include_str!("../../configs/wide.ron")),
    ("sort-first", include_str!("../../configs/sort-first.ron")),
    ("sort-middle", include_str!("../../configs/sort-middle.ron")),
    ("sort-middle-binned", include_str!("../../configs/sort-middle-binned.ron")),
    ("sort-last-fragment", include_str!("../../configs/sort-last-fragment.ron")),
    ("sort-last-image", include_str!("../../configs/sort-last-image.ron")),
    ("geforce2-ultra", include_str!("../../configs/geforce2-ultra.ron")),
    ("gtx-titan", include_str!("../../configs/gtx-titan.ron")),
    ("gtx-980", include_str!("../../configs/gtx-980.ron")),
    ("rx-5700-xt", include_str!("../../configs/rx-5700-xt.ron")),
    ("mali-g57-mc2", include_str!("../../configs/mali-g57-mc2.ron")),
    ("radeon-x700-xt", include_str!("../../configs/radeon-x700-xt.ron")),
];

/// What a message about a configuration that is not there ends with: the nearest name, and all names.
fn built_in_names(given: &str) -> String {
    let names: Vec<&str> = BUILT_IN.iter().map(|(name, _)| *name).collect();
    let nearest = num::nearest(names.iter().copied(), given).map_or(String::new(), |name| format!("; {name} is the nearest"));
    names.split_last().map_or(String::new(), |(last, rest)| format!("{nearest}; built in are {} and {last}", rest.join(", ")))
}

/// What is wrong with a configuration.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ConfigError {
    /// It is not RON, or not sections of keys and values.
    #[error("{file}: {message}")]
    Syntax {
        /// The file or name.
        file: String,
        /// What the reader found, with its place.
        message: String,
    },
    /// There is no such knob.
    #[error("{file}: there is no key {key}{hint}")]
    UnknownKey {
        /// The file or name, or `--set`.
        file: String,
        /// The key.
        key: String,
        /// The nearest that there is.
        hint: String,
    },
    /// A knob does not take this value.
    #[error("{file}: {key} is {value}, and must be {allowed}")]
    Value {
        /// The file or name, or `--set`.
        file: String,
        /// The key.
        key: String,
        /// What was written.
        value: String,
        /// What may be.
        allowed: String,
    },
    /// A configuration that extends nothing leaves knobs out.
    #[error("{file}: {key} is missing; a configuration that extends nothing must be complete (extends: \"baseline\" helps)")]
    Missing {
        /// The file or name.
        file: String,
        /// The first key that is missing.
        key: String,
    },
    /// The configuration that is extended is not there.
    #[error("{file}: there is no configuration {name}{}", built_in_names(name))]
    Unknown {
        /// The file or name that names it.
        file: String,
        /// What it names.
        name: String,
    },
    /// Knobs do not fit each other.
    #[error("{file}: {rule}")]
    Rule {
        /// The file or name.
        file: String,
        /// The rule.
        rule: Rule,
    },
}

macro_rules! config {
    ($($(#[$doc:meta])* $field:ident: $type:ty = $path:literal),* $(,)?) => {
        /// A complete configuration. Its values are allowed each by itself; [`Config::check`] looks at them together.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Config {
            /// Its name: that of the built-in one, or the file's.
            pub name: String,
            $($(#[$doc])* pub $field: $type,)*
        }

        impl Config {
            /// The sections, by path.
            pub fn sections(&self) -> Vec<(&'static str, &dyn Section)> {
                vec![$(($path, &self.$field as &dyn Section)),*]
            }

            fn sections_mut(&mut self) -> Vec<(&'static str, &mut dyn Section)> {
                vec![$(($path, &mut self.$field as &mut dyn Section)),*]
            }
        }
    };
}

config! {
    /// The card as a whole.
    card: CardConfig = "",
    /// The command processor.
    command: CommandConfig = "command",
    /// Index and attribute fetch.
    fetch: FetchConfig = "fetch",
    /// Primitive assembly.
    assembly: AssemblyConfig = "assembly",
    /// Clipping and culling.
    clip: ClipConfig = "clip",
    /// Distribution.
    distribute: DistributeConfig = "distribute",
    /// Pre-transformation and routing.
    route: RouteConfig = "route",
    /// Binning.
    bin: BinConfig = "bin",
    /// The sort network.
    network: NetworkConfig = "network",
    /// API order.
    order: OrderConfig = "order",
    /// Triangle setup.
    setup: SetupConfig = "setup",
    /// Traversal.
    traverse: TraverseConfig = "traverse",
    /// Depth and stencil.
    depth: DepthConfig = "depth",
    /// Interpolation.
    interpolate: InterpolateConfig = "interpolate",
    /// Fragment dispatch.
    dispatch: DispatchConfig = "dispatch",
    /// Shader cores.
    core: CoreConfig = "core",
    /// Texture units.
    texture: TextureConfig = "texture",
    /// Constant caches.
    constant: ConstantConfig = "constant",
    /// Colour ROPs.
    color: ColorConfig = "color",
    /// Composition.
    compose: ComposeConfig = "compose",
    /// Compute dispatch.
    compute: ComputeConfig = "compute",
    /// Resolve.
    resolve: ResolveConfig = "resolve",
    /// Scan-out.
    scanout: ScanoutConfig = "scanout",
    /// Memory.
    memory: MemoryKnobs = "memory",
    /// The second-level cache.
    l2: L2Config = "memory.l2",
    /// DRAM.
    dram: DramConfig = "memory.dram",
    /// Translation of addresses.
    tlb: TlbConfig = "memory.tlb",
}

impl Config {
    /// The time of `cycles` cycles at the card's clock, in seconds.
    pub fn seconds(&self, cycles: f64) -> f64 {
        cycles / (f64::from(self.card.clock_mhz) * 1e6)
    }

    /// A built-in configuration.
    ///
    /// # Errors
    /// If there is none of that name.
    pub fn built_in(name: &str) -> Result<Config, ConfigError> {
        match BUILT_IN.iter().find(|(known, _)| *known == name) {
            Some((_, text)) => Config::parse(name, text),
            None => Err(ConfigError::Unknown { file: "--config".to_owned(), name: name.to_owned() }),
        }
    }

    /// Reads a configuration from its text; `name` is what messages and reports call it. The base that it extends is a built-in
    /// one.
    ///
    /// # Errors
    /// What is wrong, with key, value and what is allowed.
    pub fn parse(name: &str, text: &str) -> Result<Config, ConfigError> {
        let config = read::parse(name, text, 0)?;
        config.check()?;
        Ok(config)
    }

    /// Changes one knob, as `--set path.to.key=value` does. Call [`Config::check`] after the last.
    ///
    /// # Errors
    /// If there is no such knob or it does not take the value.
    pub fn set(&mut self, assignment: &str) -> Result<(), ConfigError> {
        read::assign(self, assignment)
    }

    /// The path of a knob as sections have it: knobs of the card as a whole may be written with `card.` before them.
    pub fn path(written: &str) -> &str {
        let path = written.trim();
        path.strip_prefix("card.").unwrap_or(path)
    }

    /// The declarations of all knobs, by path.
    pub fn knobs(&self) -> impl Iterator<Item = (String, &'static Knob)> {
        let of =
            |(section, knobs): (&'static str, &dyn Section)| knobs.knobs().iter().map(move |knob| (knob.path(section), knob));
        self.sections().into_iter().flat_map(of)
    }

    /// The knob at a path, and its value.
    ///
    /// # Errors
    /// If there is none; the message names the nearest. `place` is where the path was written.
    pub fn knob(&self, place: &str, path: &str) -> Result<(&'static Knob, Setting), ConfigError> {
        read::find(self, place, Config::path(path))
    }

    /// Sets the knob at a path.
    ///
    /// # Errors
    /// If there is no such knob or it does not take the value. `place` is where it was written.
    pub fn put(&mut self, place: &str, path: &str, setting: &Setting) -> Result<(), ConfigError> {
        read::put(self, place, Config::path(path), setting)
    }

    /// Whether the knobs fit each other.
    ///
    /// # Errors
    /// The rule that they break.
    pub fn check(&self) -> Result<(), ConfigError> {
        rules::check(self).map_err(|rule| ConfigError::Rule { file: self.name.clone(), rule })
    }

    /// Whether every picture is that of API order: no pixel may differ from functional rendering.
    pub fn keeps_order(&self) -> bool {
        self.order.keep == Keep::Always && self.card.sort.class().sorted != Sorted::Images
    }

    /// Edge in pixels of the squares of the screen that one pipeline owns: `distribute.tile`, or `bin.tile` where that is larger and tiles are
    /// drawn from bins, since a pipeline draws a bin whole.
    pub fn owned_tile(&self) -> u32 {
        let bins = self.card.sort.class().one_place;
        if bins { self.distribute.tile.max(self.bin.tile) } else { self.distribute.tile }
    }

    /// What of a render this machine's work depends on: a machine whose early tests cannot see all earlier depths shades quads
    /// that they would have thrown away.
    pub fn render_key(&self) -> RenderKey {
        let class = self.card.sort.class();
        let shade = if self.order.keep == Keep::Never { Shade::Covered } else { class.shade };
        let signatures = (class.signatures)(self);
        let paths = self.core.execution != Execution::Longest;
        let vectors = self.core.instructions == Instructions::Vector;
        let needless = CulledLate {
            facing: !self.clip.cull_facing,
            frustum: !self.clip.cull_frustum,
            scissor: !self.clip.cull_scissor,
            no_sample: !self.clip.cull_no_sample,
            attributes: !self.fetch.skip_attributes,
            varyings: !self.interpolate.skip_varyings,
            levels: !self.texture.skip_levels,
        };
        let cull = match self.command.cull {
            CullChoice::None => Cull::None,
            CullChoice::Draws => Cull::Draws,
            CullChoice::Instances => Cull::Instances,
        };
        RenderKey { shade, early_z: self.depth.early, signatures, paths, vectors, needless, cull }
    }

    /// Segments of draws that the machine holds: those in flight, or in a machine that bins those in lists too.
    pub fn segments(&self) -> u32 {
        if self.card.sort.class().one_place { self.bin.segments } else { self.command.segments }
    }

    /// What is allowed but hardly meant: channels too short to carry their full width.
    pub fn warnings(&self) -> Vec<String> {
        rules::warnings(self)
    }

    /// Whether passes and copies overlap.
    pub fn overlaps(&self) -> bool {
        self.command.overlap && rules::no_overlap(self).is_none()
    }

    /// Why the knob at a path has no effect on this machine, whatever its value; none: it may have one.
    pub fn no_effect(&self, path: &str) -> Option<String> {
        rules::no_effect(self, path)
    }

    /// The whole configuration as RON, every knob with its meaning, unit, allowed values and source. Reading it gives this
    /// configuration again.
    pub fn resolved(&self) -> String {
        text::resolved(self)
    }
}

#[cfg(test)]
mod tests;
