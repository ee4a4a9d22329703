//! What an untrusted trace may ask for.
//!
//! A trace and its shaders are programs: they can ask for work without an end and for memory without a bound. Each limit here stops one such
//! request with an error that names the limit. Real programs stay far below all of them; `--limit NAME=VALUE` raises one.

use std::sync::OnceLock;

use sysinfo::{MemoryRefreshKind, RefreshKind, System};

/// One row of the table of limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LimitInfo {
    /// Its name, as `--limit` and messages have it.
    pub name: &'static str,
    /// What one of it is.
    pub unit: &'static str,
    /// What is limited, and how much real programs need.
    pub about: &'static str,
    /// Its default.
    pub default: u64,
}

/// Something asked for more than a limit allows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{asked} {unit}, more than the limit of {limit}; --limit {name}=N allows more", unit = .info.unit, name = .info.name)]
pub struct LimitExceeded {
    /// The limit.
    pub info: &'static LimitInfo,
    /// Its value in this run.
    pub limit: u64,
    /// What was asked for, in the limit's unit.
    pub asked: u64,
}

/// Work that was counted while it was done came to more than a limit allows. How much more says nothing: it was stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("more than {limit} {unit}, the limit; --limit {name}=N allows more", unit = .info.unit, name = .info.name)]
pub struct LimitOverrun {
    /// The limit.
    pub info: &'static LimitInfo,
    /// Its value in this run.
    pub limit: u64,
}

impl LimitOverrun {
    /// The error of work that came to more than this limit.
    pub fn of(limit: Limit) -> LimitOverrun {
        LimitOverrun { info: limit.info, limit: limit.value }
    }
}

macro_rules! limits {
    ($($(#[doc = $about:literal])+ $field:ident: $name:literal, $default:expr, $unit:literal;)+) => {
        /// The limits of one run. All are inclusive.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub struct Limits {
            $($(#[doc = $about])+ pub $field: Limit,)+
        }

        impl Default for Limits {
            fn default() -> Limits {
                let mut next = 0..;
                let mut row = || next.next().unwrap_or(0);
                let mut limits = Limits { $($field: { let k = row(); Limit { info: &TABLE[k], value: TABLE[k].default } },)+ };
                limits.memory_bytes.value = limits.memory_bytes.value.min(half_of_memory());
                limits
            }
        }

        impl Limits {
            fn all_mut(&mut self) -> impl Iterator<Item = &mut Limit> {
                [$(&mut self.$field),+].into_iter()
            }
        }

        /// All limits, in the order of the documentation.
        static TABLE: &[LimitInfo] = &[
            $(LimitInfo { name: $name, unit: $unit, about: concat!($($about),+), default: $default },)+
        ];
    };
}

/// One limit and its value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limit {
    info: &'static LimitInfo,
    value: u64,
}

impl Limit {
    /// The largest amount that is allowed.
    pub fn get(self) -> u64 {
        self.value
    }

    /// Its row in the table.
    pub fn info(self) -> &'static LimitInfo {
        self.info
    }

    /// Another value for this limit.
    pub fn with(self, value: u64) -> Limit {
        Limit { value, ..self }
    }

    /// Whether an amount is allowed.
    ///
    /// # Errors
    /// If it is larger than the limit.
    pub fn check(self, asked: u64) -> Result<(), LimitExceeded> {
        if asked > self.value { Err(LimitExceeded { info: self.info, limit: self.value, asked }) } else { Ok(()) }
    }
}

limits! {
    /// Bytes of the files of a trace, inflated: its commands and all that they name. Recorded traces have up to 3 MB.
    trace_bytes: "trace.bytes", 4 << 30, "bytes of the trace's files";
    /// How many times larger a packed trace may become where it becomes larger than 64 MiB: a small file must not take long to read. Recorded
    /// traces become up to 40 times larger.
    trace_expansion: "trace.expansion", 100, "times the size of the packed file";
    /// Files of a trace, or entries of its archive. Recorded traces have up to 43.
    trace_files: "trace.files", 1 << 16, "files of the trace";
    /// Pixels of one picture that is read: a PNG file of one colour has a thousandth of the bytes of its picture. Pictures of recorded traces have
    /// up to 2 million.
    picture_pixels: "picture.pixels", 1 << 26, "pixels of a picture";
    /// Length of the source of one shader: WGSL or naga IR text, or a SPIR-V binary. Recorded shaders have up to 25 kB.
    shader_source: "shader.source", 4 << 20, "bytes of shader source";
    /// Depth of nesting in a shader: brackets, operators, `else if`, and declarations that need each other. Recorded shaders have up to
    /// 31. naga's parser has a limit of its own beside, on brackets and blocks alone.
    shader_nesting: "shader.nesting", 4096, "levels of nesting in a shader";
    /// Declarations at the top of a shader: functions, variables, types, constants. Recorded shaders have up to 14.
    shader_declarations: "shader.declarations", 1 << 14, "declarations in a shader";
    /// Tokens of a shader's text, each constant counted with all that it stands for wherever it is used, and zero values of arrays with
    /// all of their elements where they are not stored as they are; where the shader is no text, expressions, and parts of types. Recorded
    /// shaders have up to 792.
    shader_constants: "shader.constants", 1 << 18, "tokens, parts or expressions of a shader with constants and types written out";
    /// Pairs of tokens that stand in one function, constants counted with all that they stand for, of all functions of a shader together;
    /// instructions where the shader is SPIR-V. For each expression, naga goes over those that the function has so far. Recorded shaders
    /// have up to 1 million.
    shader_pairs: "shader.pairs", 1 << 32, "pairs of tokens inside functions";
    /// Steps of compiling one entry point: statements, expressions and instructions, calls inlined and loops unrolled. Recorded shaders
    /// take up to 1,793.
    shader_instructions: "shader.instructions", 1 << 22, "steps of compiling an entry point with all calls inlined";
    /// Steps of compiling one entry point that may be spent on trying to unroll loops; after them loops stay loops, and nothing is refused.
    /// Recorded shaders take up to 1,350.
    shader_unrolling: "shader.unrolling", 1 << 20, "steps of unrolling loops";
    /// Components of one value, and of all variables together that an invocation has at one time. Recorded shaders have up to 46.
    shader_components: "shader.components", 1 << 16, "components of values or variables";
    /// Registers of an invocation for arrays that are indexed at run time. Recorded shaders have up to 12.
    shader_array_registers: "shader.array_registers", 1 << 14, "registers for arrays indexed at run time";
    /// Invocations of a workgroup. WebGPU guarantees 256; recorded shaders have up to 256.
    shader_invocations: "shader.invocations", 1 << 14, "invocations in a workgroup";
    /// Workgroup memory of an entry point. WebGPU guarantees 16 KiB; recorded shaders have up to 512 bytes.
    shader_workgroup: "shader.workgroup", 1 << 24, "bytes of workgroup memory";
    /// Commands that one rendering of a trace runs; those of bundles count each time, and so do the draws of indirect commands. Recorded
    /// traces have up to 11 thousand.
    work_commands: "work.commands", 10_000_000, "commands run";
    /// Vertices, or indices, times instances of all draws. Recorded traces have up to 24 million.
    work_vertices: "work.vertices", 2_500_000_000, "vertices drawn";
    /// Quads that triangles cover, plus one for every triangle in every screen tile of 64 x 64 pixels that it may touch. Recorded traces have
    /// up to 47 million.
    work_quads: "work.quads", 8_000_000_000, "quads rasterised";
    /// Workgroups of all dispatches. Recorded traces have up to 320.
    work_workgroups: "work.workgroups", 1 << 27, "workgroups run";
    /// What shaders do, and what is done around them. A step is one simple operation on up to 64 invocations at once; loads and stores of buffers are
    /// 24, those of arrays and constants 8, atomic and texture operations 64; a draw is 600, a vertex 4, a triangle that is clipped 64, a triangle in
    /// a screen tile 16, a block of 8x8 pixels of it 1, a quad 3, 24 more for each sample of it that is blended in a format other than four bytes, a
    /// workgroup 80. Recorded traces have up to 602 million.
    work_steps: "work.shader_steps", 3_000_000_000, "shader steps";
    /// Turns of one loop between its entry and its end: a program that needs more hangs a card.
    work_loop_turns: "work.loop_turns", 1 << 20, "turns of a loop";
    /// Bytes that creations, copies, clears, loads of attachments and presents touch. Recorded traces have up to 1.9 GB.
    work_bytes: "work.bytes", 1 << 34, "bytes created, copied and cleared";
    /// What the units of one machine do: a cycle in which a unit is busy is a step, an item that goes through a channel is 8, a step of a program
    /// that a warp begins is 16, and a frame's report is 48 for each unit and channel. A step takes 25 to 50 ns. Recorded traces take up to 1,300
    /// million on the baseline, and nearly three times as many on the smallest machine.
    work_machine: "work.machine_steps", 6_000_000_000, "steps of a machine's units";
    /// Cycles of one machine, in which its units may wait. Recorded traces take up to 20 million on the baseline.
    work_cycles: "work.cycles", 100_000_000_000, "cycles of a machine";
    /// Bytes of shader source that are compiled: once for a module, and once for every pipeline stage made of it. Recorded traces have up
    /// to 18 kB.
    work_sources: "work.shader_source", 1 << 28, "bytes of shader source compiled";
    /// Bytes of everything that a trace makes alive at one time, with all that is recorded of one draw or workgroup. The default is half of the
    /// machine's memory, or of what its control group may use, where that is less. Recorded traces have up to 82 MB.
    memory_bytes: "memory.bytes", 2 << 30, "bytes of memory";
}

/// Half of the memory of the machine, or of what the process may use of it, in bytes; 4 GiB where the system does not say.
fn half_of_memory() -> u64 {
    static HALF: OnceLock<u64> = OnceLock::new();
    *HALF.get_or_init(|| {
        let refresh = RefreshKind::nothing().with_memory(MemoryRefreshKind::nothing().with_ram());
        let memory = |system: System| {
            let group = system.cgroup_limits().map_or(u64::MAX, |group| group.total_memory);
            system.total_memory().min(group).min(address_space())
        };
        match System::new_with_specifics(refresh).map_or(0, memory) {
            0 => 4 << 30,
            bytes => bytes / 2,
        }
    })
}

/// Bytes of address space that the process may have (`ulimit -v`), where the system tells.
fn address_space() -> u64 {
    let limits = std::fs::read_to_string("/proc/self/limits").unwrap_or_default();
    let bytes = limits.lines().find_map(|line| line.strip_prefix("Max address space")?.split_whitespace().next()?.parse().ok());
    bytes.unwrap_or(u64::MAX)
}

/// The bytes of a trace, as its files are, for which the defaults of the limits of work are made.
const WORK_OF: u64 = 1 << 20;

/// Bytes that a packed trace may become, however small it is.
const FREE_EXPANSION: u64 = 64 << 20;

impl Limits {
    /// The limits of a trace whose files have this many bytes together: of a trace larger than 1 MiB, limits of work (`work.*`) are as many times
    /// larger. A long recording of a real program may do as much in each of its frames as a short one.
    pub fn for_files(mut self, bytes: u64) -> Limits {
        let times = bytes.div_ceil(WORK_OF).max(1);
        for limit in self.all_mut().filter(|limit| limit.info.name.starts_with("work.") && limit.info.name != "work.loop_turns")
        {
            limit.value = limit.value.saturating_mul(times);
        }
        self
    }

    /// Checks that `packed` bytes may become `expanded` bytes.
    ///
    /// # Errors
    /// If they become more than the limit allows.
    pub fn check_expansion(&self, packed: u64, expanded: u64) -> Result<(), LimitExceeded> {
        if expanded <= FREE_EXPANSION { Ok(()) } else { self.trace_expansion.check(expanded.div_ceil(packed.max(1))) }
    }

    /// The rows of the table.
    pub fn table() -> &'static [LimitInfo] {
        TABLE
    }

    /// Sets a limit by `NAME=VALUE`.
    ///
    /// # Errors
    /// If there is no such limit, or the value is no whole number.
    pub fn set(&mut self, assignment: &str) -> Result<(), String> {
        let (name, text) = assignment.split_once('=').ok_or_else(|| format!("`{assignment}`: write a limit as NAME=VALUE"))?;
        let (name, text) = (name.trim(), text.trim());
        let value = text.replace('_', "").parse().map_err(|_| format!("{name}: `{text}` is not a whole number"))?;
        let Some(limit) = self.all_mut().find(|limit| limit.info.name == name) else {
            let names: Vec<&str> = TABLE.iter().map(|row| row.name).collect();
            return Err(format!("there is no limit {name}; there are {}", names.join(", ")));
        };
        limit.value = value;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_limit_is_set_by_its_name() {
        for (k, row) in TABLE.iter().enumerate() {
            let mut limits = Limits::default();
            let default: Vec<u64> = limits.all_mut().map(|limit| limit.get()).collect();
            // Half of the memory of a small machine is the one that no table has.
            assert!(default[k] == row.default || row.name == "memory.bytes" && (1 << 20..row.default).contains(&default[k]));
            limits.set(&format!("{} = 1_234", row.name)).expect("a limit");
            let set: Vec<u64> = limits.all_mut().map(|limit| limit.get()).collect();
            let wanted: Vec<u64> = default.iter().enumerate().map(|(i, &d)| if i == k { 1234 } else { d }).collect();
            assert_eq!(set, wanted, "{}", row.name);
        }
    }

    #[test]
    fn larger_traces_may_do_more() {
        let limits = Limits::default();
        assert_eq!(limits.for_files(0), limits);
        assert_eq!(limits.for_files(1 << 20), limits);
        let larger = limits.for_files((5 << 20) + 1);
        assert_eq!(larger.work_steps.get(), 6 * limits.work_steps.get());
        assert_eq!(larger.work_bytes.get(), 6 * limits.work_bytes.get());
        // What hangs a card hangs it in every trace, and memory is what the machine has.
        assert_eq!(larger.work_loop_turns, limits.work_loop_turns);
        assert_eq!(larger.memory_bytes, limits.memory_bytes);
        assert_eq!(larger.shader_source, limits.shader_source);
    }

    #[test]
    fn what_exceeds_a_limit_names_it() {
        let limit = Limits::default().shader_nesting.with(10);
        assert_eq!(limit.check(10), Ok(()));
        let text = limit.check(11).expect_err("more than ten").to_string();
        assert_eq!(text, "11 levels of nesting in a shader, more than the limit of 10; --limit shader.nesting=N allows more");
    }

    #[test]
    fn large_expansions_are_refused() {
        let limits = Limits::default();
        assert_eq!(limits.check_expansion(1, 64 << 20), Ok(()));
        assert_eq!(limits.check_expansion(1 << 20, 100 << 20), Ok(()));
        let error = limits.check_expansion(1 << 20, (100 << 20) + 1).expect_err("more than a hundred times").to_string();
        assert!(error.starts_with("101 times") && error.ends_with("--limit trace.expansion=N allows more"), "{error}");
        assert!(limits.check_expansion(0, 1 << 30).is_err());
    }

    #[test]
    fn unknown_limits_and_values_are_refused() {
        let mut limits = Limits::default();
        assert!(limits.set("shader.nestng=4").is_err_and(|e| e.contains("shader.nesting")));
        assert!(limits.set("shader.nesting=many").is_err_and(|e| e.contains("many")));
        assert!(limits.set("shader.nesting").is_err());
    }
}
