//! Hostile RON: values that are nested, long or repeated, in each place where a trace, a recording of wgpu or a configuration has one.

use super::{TextForm, lines, nested};

/// Values, and what only looks like one.
pub const VALUES: &[TextForm] = &[
    ("round brackets", |n| nested("(", "1", ")", n)),
    ("round brackets not closed", |n| "(".repeat(n)),
    ("lists", |n| nested("[", "1", "]", n)),
    ("lists not closed", |n| "[".repeat(n)),
    ("options", |n| nested("Some(", "1", ")", n)),
    ("maps", |n| nested("{1:", "1", "}", n)),
    ("structures", |n| nested("(a: ", "1", ")", n)),
    ("structures with names", |n| nested("Name(a: ", "1", ")", n)),
    ("elements", |n| format!("[{}]", "1,".repeat(n))),
    ("elements of structures", |n| format!("[{}]", "(a: 1),".repeat(n))),
    ("elements of names", |n| format!("[{}]", "Name,".repeat(n))),
    ("tuples", |n| format!("({})", "1,".repeat(n))),
    ("entries", |n| format!("{{{}}}", lines(n, |k| format!("{k}: {k},")))),
    ("entries of texts", |n| format!("{{{}}}", lines(n, |k| format!("\"{k}\": {k},")))),
    ("the same entries", |n| format!("{{{}}}", "\"a\": 1,".repeat(n))),
    ("keys", |n| format!("({})", lines(n, |k| format!("key{k}: {k},")))),
    ("the same keys", |n| format!("({})", "id: 1,".repeat(n))),
    ("texts", |n| format!("[{}]", "\"a\",".repeat(n))),
    ("long text", |n| format!("\"{}\"", "a".repeat(n))),
    ("lines in a text", |n| format!("\"{}\"", "\n".repeat(n))),
    ("escapes", |n| format!("\"{}\"", "\\n".repeat(n))),
    ("escapes of code points", |n| format!("\"{}\"", "\\u{41}".repeat(n))),
    ("long escapes", |n| format!("\"\\u{{{}41}}\"", "0".repeat(n))),
    ("text not closed", |n| format!("\"{}", "a".repeat(n))),
    ("raw texts", |n| "r\"a\" ".repeat(n)),
    ("marks of a raw text", |n| format!("r{}\"a\"{}", "#".repeat(n), "#".repeat(n))),
    ("marks of a raw text not closed", |n| format!("r{}\"a", "#".repeat(n))),
    ("ends of a raw text that are too short", |n| format!("r##\"{}\"##", "\"#a".repeat(n))),
    ("bytes", |n| format!("b\"{}\"", "\\xff".repeat(n))),
    ("characters", |n| format!("[{}]", "'a',".repeat(n))),
    ("character not closed", |n| format!("'{}", "a".repeat(n))),
    ("digits", |n| "1".repeat(n)),
    ("digits of other bases", |n| format!("0x{}", "f".repeat(n))),
    ("digits of a fraction", |n| format!("0.{}", "1".repeat(n))),
    ("digits of an exponent", |n| format!("1e{}", "9".repeat(n))),
    ("underscores", |n| format!("1{}1", "_".repeat(n))),
    ("signs", |n| format!("{}1", "-".repeat(n))),
    ("long name", |n| "a".repeat(n)),
    ("long raw name", |n| format!("r#{}", "a".repeat(n))),
    ("letters of other scripts", |n| "é".repeat(n)),
    ("line comments", |n| format!("{}1", "// a\n".repeat(n))),
    ("block comments", |n| format!("{}1", "/* a */".repeat(n))),
    ("nested comments", |n| format!("{}1", nested("/*", "", "*/", n))),
    ("comments not closed", |n| "/*".repeat(n)),
    ("comments between elements", |n| format!("[{}]", "1/**/,//\n".repeat(n))),
    ("blanks", |n| format!("{}1", " \n\t".repeat(n))),
    ("commas", |n| format!("[{}]", ",".repeat(n))),
    ("colons", |n| format!("({})", ":".repeat(n))),
    ("attributes", |n| format!("{}1", "#![enable(implicit_some)]\n".repeat(n))),
    ("values behind the end", |n| "1 ".repeat(n)),
    ("closing brackets", |n| ")".repeat(n)),
    ("zero bytes", |n| "\0".repeat(n)),
];

/// A kind of file: its name, what stands before the value and what behind it.
pub type FileTemplate = (&'static str, &'static str, &'static str);

/// Where a native trace has values.
pub const NATIVE: &[FileTemplate] = &[
    ("whole", "", ""),
    ("key", "Trace(version: 1, unknown: ", ")"),
    ("version", "Trace(version: ", ", files: {}, commands: [])"),
    ("files", "Trace(version: 1, files: ", ", commands: [])"),
    ("file", "Trace(version: 1, files: { \"a\": ", "}, commands: [])"),
    ("commands", "Trace(version: 1, files: {}, commands: ", ")"),
    ("command", "Trace(version: 1, files: {}, commands: [", "])"),
    ("number", "Trace(version: 1, files: {}, commands: [CreateBuffer(id: 0, size: ", ")])"),
    ("label", "Trace(version: 1, files: {}, commands: [CreateBuffer(id: 0, size: 4, label: ", ")])"),
    ("list", "Trace(version: 1, files: {}, commands: [BeginRenderPass(color: ", ")])"),
];

/// Where a recording of wgpu has values.
pub const WGPU: &[FileTemplate] = &[
    ("actions", "", ""),
    ("action", "[", "]"),
    ("start", "[Init(desc: ", ", backend: \"vulkan\")]"),
    ("description", "[CreateBuffer(PointerId(16), ", ")]"),
    ("label", "[CreateBuffer(PointerId(16), (label: ", ", size: 64, usage: \"\", mapped_at_creation: false))]"),
    ("commands", "[Submit(1, ", ")]"),
    (
        "constants",
        "[CreateComputePipeline(id: PointerId(4), desc: (label: None, layout: None, stage: (module: PointerId(3), constants: ",
        ")))]",
    ),
    ("unknown action", "[NoSuchAction(", ")]"),
];

/// Where a configuration has values.
pub const CONFIGURATION: &[FileTemplate] = &[
    ("whole", "", ""),
    ("section", "(core: ", ")"),
    ("unknown section", "(no_such: ", ")"),
    ("knob", "(core: (warps: ", "))"),
    ("base", "(extends: ", ")"),
];

/// Where an experiment has values.
pub const EXPERIMENT: &[FileTemplate] = &[
    ("whole", "", ""),
    ("traces", "(question: \"q\", traces: ", ", vary: [\"core.warps=1..4\"])"),
    ("question", "(question: ", ", traces: [\"traces/cube\"], vary: [\"core.warps=1..4\"])"),
    ("vary", "(question: \"q\", traces: [\"traces/cube\"], vary: ", ")"),
];
