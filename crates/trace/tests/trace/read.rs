//! The trace reader: what it gives, how it streams, and what it says of broken input.

use std::fs;
use std::ops::ControlFlow;
use std::path::Path;

use num::BufferId;
use trace::command::{Command, Data};
use trace::{Builder, TextLocation, Trace, TraceError};

/// Writes a trace folder with these files and commands, hashes filled in.
fn folder(dir: &Path, files: &[(&str, &[u8])], commands: &str) {
    let mut listing = String::new();
    for (name, bytes) in files {
        fs::write(dir.join(name), bytes).unwrap();
        listing += &format!("        {name:?}: (size: {}, hash: \"{}\"),\n", bytes.len(), blake3::hash(bytes).to_hex());
    }
    let text = format!(
        "// A comment.\nTrace(\n    version: 1,\n    files: {{\n{listing}    }},\n    commands: [\n{commands}    ],\n)\n"
    );
    fs::write(dir.join("trace.ron"), text).unwrap();
}

fn commands(trace: &Trace) -> Result<Vec<Command>, TraceError> {
    let mut all = Vec::new();
    trace.for_each_command(|index, command| {
        assert_eq!(index, all.len() as u64);
        all.push(command.clone());
        Ok::<_, TraceError>(())
    })?;
    Ok(all)
}

fn error(trace: Result<Trace, TraceError>) -> String {
    match trace.and_then(|trace| commands(&trace).map(|_| ())) {
        Ok(()) => panic!("the trace is accepted"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn biases_are_whole_numbers_in_older_traces_and_any_numbers_now() {
    let dir = tempfile::tempdir().unwrap();
    let pipeline = |id: u32, bias: &str| {
        let state = format!("(format: Depth32Float, bias: {bias})");
        format!("CreateRenderPipeline(id: {id}, desc: (vertex: (shader: 0), depth_stencil: {state})),\n")
    };
    folder(dir.path(), &[], &[pipeline(0, "-2"), pipeline(1, "1.25")].concat());
    let biases = commands(&Trace::open(dir.path()).unwrap()).unwrap().into_iter().filter_map(|command| match command {
        Command::CreateRenderPipeline { desc, .. } => Some(desc.depth_stencil?.bias),
        _ => None,
    });
    assert_eq!(biases.collect::<Vec<_>>(), [-2.0, 1.25]);
}

#[test]
fn a_folder_gives_its_commands_and_blobs() {
    let dir = tempfile::tempdir().unwrap();
    folder(
        dir.path(),
        &[("a.bin", b"0123456789")],
        "        CreateBuffer(id: 3, size: 8), // the label is optional\n        /* next */ WriteBuffer(id: 3, data: (blob: \"a.bin\", offset: 2, size: 8)),\n        PushDebugGroup(\"x\"),\n",
    );
    for path in [dir.path().to_path_buf(), dir.path().join("trace.ron")] {
        let trace = Trace::open(path).unwrap();
        let data = Data { blob: "a.bin".into(), offset: 2, size: 8 };
        assert_eq!(
            commands(&trace).unwrap(),
            [
                Command::CreateBuffer { id: BufferId(3), size: 8, label: None },
                Command::WriteBuffer { id: BufferId(3), offset: 0, data: data.clone() },
                Command::PushDebugGroup("x".into()),
            ]
        );
        assert_eq!(*trace.data(&data).unwrap(), *b"23456789");
        assert_eq!(trace.place(0), Some(TextLocation { line: 8, column: 9 }));
        assert_eq!(trace.place(1), Some(TextLocation { line: 9, column: 20 }));
        assert_eq!(trace.place(2), Some(TextLocation { line: 10, column: 9 }));
        let past = trace.data(&Data { blob: "a.bin".into(), offset: 3, size: 8 }).unwrap_err().to_string();
        assert!(past.ends_with("bytes 3 + 8 of blob \"a.bin\" reach past its 10"), "{past}");
    }
}

#[test]
fn a_reader_can_stop_and_fail_anywhere() {
    let dir = tempfile::tempdir().unwrap();
    folder(dir.path(), &[], "PopDebugGroup, PopDebugGroup, PopDebugGroup");
    let trace = Trace::open(dir.path()).unwrap();
    let mut seen = 0;
    trace
        .try_for_each_command(|index, _| {
            seen += 1;
            Ok::<_, TraceError>(if index == 1 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
        })
        .unwrap();
    assert_eq!(seen, 2);
    let failed = trace.for_each_command(|index, _| Err(trace.error_at(index, "no"))).unwrap_err();
    assert_eq!(failed.to_string(), format!("{}:7:1: command 0: no", dir.path().join("trace.ron").display()));
}

#[test]
fn a_built_trace_uses_foreign_files_where_they_are() {
    let dir = tempfile::tempdir().unwrap();
    let foreign = dir.path().join("data0.bin");
    fs::write(&foreign, vec![7u8; 1 << 20]).unwrap();
    let mut builder = Builder::new("foreign.ron");
    builder.push(Command::PopDebugGroup);
    builder.push_at(Command::PopDebugGroup, TextLocation { line: 4, column: 2 });
    builder.push(Command::PopDebugGroup);
    builder.add_file("data0.bin", &foreign).unwrap();
    builder.add_blob("own.wgsl", b"text".to_vec()).unwrap();
    assert!(builder.add_blob("own.wgsl", Vec::new()).is_err());
    assert!(builder.add_blob("../x", Vec::new()).is_err());
    let trace = builder.finish();
    assert!(trace.blob("data0.bin").unwrap().is_mapped());
    assert_eq!(trace.blob("data0.bin").unwrap().len(), 1 << 20);
    assert_eq!(trace.text("own.wgsl").unwrap(), "text");
    assert_eq!(commands(&trace).unwrap().len(), 3);
    assert_eq!(trace.error_at(2, "no").to_string(), "foreign.ron:4:2: command 2: no");
}

#[test]
fn bad_text_is_refused_with_place_command_and_reason() {
    let cases = [
        ("CreateBuffer(id: 0, size: 8), CreateBufer(id: 1, size: 8)", ":7:", "command 1: there is no \"CreateBufer\""),
        ("CreateBuffer(id: 0, size: 8, colour: 3)", ":7:", "command 0: "),
        ("CreateBuffer(id: 0)", ":7:", "command 0: "),
        ("WriteBuffer(id: 0, data: (blob: \"a\", size: 1, sise: 2))", ":7:", "sise"),
        ("CreateBuffer(id: -1, size: 8)", ":7:", "command 0: "),
        ("PopDebugGroup, PopDebugGroup", ":7:", "command 2: the file ends too early"),
    ];
    for (index, (text, place, reason)) in cases.into_iter().enumerate() {
        let dir = tempfile::tempdir().unwrap();
        folder(dir.path(), &[], &format!("{text}\n"));
        if index + 1 == cases.len() {
            // Cut inside the list.
            let file = dir.path().join("trace.ron");
            let whole = fs::read_to_string(&file).unwrap();
            fs::write(&file, &whole[..whole.find("    ],\n)").unwrap()]).unwrap();
        }
        let message = error(Trace::open(dir.path()));
        println!("{message}");
        assert!(message.contains(place) && message.contains(reason), "{text}: {message}");
    }
}

#[test]
fn bad_headers_are_refused() {
    let entry = format!("(size: 0, hash: \"{}\")", blake3::hash(b"").to_hex());
    let cases = [
        ("Trace(version: 2, shape: \"new\")".to_owned(), "has format version 2, this program reads version 1"),
        ("Trace(files: {}, commands: [])".to_owned(), "starts with its version"),
        ("Trace(version: 1, commands: [])".to_owned(), "`files` must follow the version"),
        (format!("Trace(version: 1, files: {{\"a\": {entry}, \"a\": {entry}}}, commands: [])"), "\"a\" is listed twice"),
        (format!("Trace(version: 1, files: {{\"../a\": {entry}}}, commands: [])"), "must not start with a dot"),
        (format!("Trace(version: 1, files: {{\"b/a\": {entry}}}, commands: [])"), "may only contain"),
        (format!("Trace(version: 1, files: {{\"b\\\\a\": {entry}}}, commands: [])"), "may only contain"),
        (format!("Trace(version: 1, files: {{\"trace.ron\": {entry}}}, commands: [])"), "name of the command list"),
        ("Trace(version: 1, files: {\"a\": (size: 0, hash: \"12\")}, commands: [])".to_owned(), "64 hexadecimal digits"),
        ("Trace(version: 1, files: {}, commands: [], more: 1)".to_owned(), "more"),
        ("Trace(version: 1, files: {}, commands: []) x".to_owned(), "railing"),
        ("[1, 2]".to_owned(), "Trace"),
        (format!("Trace(version: 1, files: {{\"gone\": {entry}}}, commands: [])"), "gone: No such file"),
    ];
    for (text, reason) in cases {
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join("trace.ron"), &text).unwrap();
        let message = error(Trace::open(dir.path()));
        println!("{message}");
        assert!(message.contains(reason), "{text}: {message}");
    }
}

#[test]
fn damaged_blobs_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    folder(dir.path(), &[("a.bin", b"0123456789")], "");
    fs::write(dir.path().join("a.bin"), b"0123456780").unwrap();
    let trace = Trace::open(dir.path()).unwrap();
    let message = trace.blob("a.bin").unwrap_err().to_string();
    assert!(message.contains("a.bin: contents have hash") && message.ends_with("damaged"), "{message}");
    let message = trace.blob("b.bin").unwrap_err().to_string();
    assert!(message.ends_with("there is no blob \"b.bin\""), "{message}");
    fs::write(dir.path().join("a.bin"), b"01").unwrap();
    let message = error(Trace::open(dir.path()));
    assert!(message.ends_with("a.bin: is 2 bytes long, the trace says 10"), "{message}");
}
