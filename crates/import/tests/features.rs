//! A trace is opened by its importer. Without the importer it is refused, with the feature to turn on.

use import::TraceKind;

#[test]
fn a_trace_needs_the_feature_of_its_importer() {
    let folder = tempfile::tempdir().expect("a folder");
    let traces = [
        (TraceKind::Wgpu, "trace.ron", b"[\n]\n".as_slice(), cfg!(feature = "wgpu")),
        (TraceKind::Apitrace, "a.trace", b"at", cfg!(feature = "opengl")),
        (TraceKind::GlInterceptor, "a.txt", b"GLI0.", cfg!(feature = "opengl")),
        (TraceKind::Gfxr, "a.gfxr", b"GFXR", cfg!(feature = "vulkan")),
    ];
    for (kind, name, bytes, is_compiled) in traces {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).expect("a file");
        assert_eq!(import::detect(&path).expect("a trace").kind, kind);
        let message = import::open(&path).err().map(|error| error.to_string()).unwrap_or_default();
        let feature = kind.feature().expect("a feature");
        let refusal = format!("is a {kind} trace, which this build cannot read: build with the feature `{feature}`");
        assert_eq!(message.contains(&refusal), !is_compiled, "{message}");
    }
}
