//! The rules of `docs/architecture.md` that packages do not enforce: modules of the program import only modules below them, and code that
//! computes pictures knows no cycles.

use std::fs;
use std::path::{Path, PathBuf};

/// Modules of the program's package and what each may import of it, beside itself. The packages below keep their floors by their
/// dependencies.
const TABLE: &[(&str, &[&str])] =
    &[("report", &[]), ("sweep", &["report"]), ("why", &["report"]), ("cli", &["report", "sweep", "why"])];

/// Source files below a folder, those of unit tests left out.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a source folder") {
        let path = entry.expect("an entry").path();
        let is_test = path.file_stem().is_some_and(|stem| stem == "tests" || stem == "bench");
        if is_test {
            continue;
        }
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// Crate modules that a line of code names.
fn named(line: &str) -> Vec<String> {
    let code = line.split("//").next().unwrap_or_default();
    let mut found = Vec::new();
    for (at, _) in code.match_indices("crate::") {
        let rest = &code[at + "crate::".len()..];
        let names: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
        // `$crate::module` inside macros counts too; `crate::{a, b}` is not written in this project.
        assert!(!rest.starts_with('{'), "write one `use crate::module` a line: {line}");
        found.push(names);
    }
    found
}

#[test]
fn modules_import_only_floors_below() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut wrong = Vec::new();
    let mut checked = 0;
    for (module, allowed) in TABLE {
        let mut files = Vec::new();
        sources(&root.join(module), &mut files);
        for file in files {
            let text = fs::read_to_string(&file).expect("source text");
            for (number, line) in text.lines().enumerate() {
                for name in named(line) {
                    let known = TABLE.iter().any(|(m, _)| *m == name);
                    checked += usize::from(known);
                    if known && name != *module && !allowed.contains(&name.as_str()) {
                        wrong.push(format!("{}:{}: {module} imports {name}", file.display(), number + 1));
                    }
                }
            }
        }
    }
    assert!(checked > 20, "only {checked} imports were found: the test looks at the wrong place");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// The sources of a package, or of a module of the program's package.
fn part(name: &str) -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let package = root.join("crates").join(name).join("src");
    let mut files = Vec::new();
    sources(&if package.is_dir() { package } else { root.join("src").join(name) }, &mut files);
    assert!(!files.is_empty(), "{name} has no sources");
    files
}

#[test]
fn what_and_when_stay_apart() {
    for name in ["gfx", "shader", "render", "trace", "gl_shader", "import"] {
        for file in part(name) {
            let text = fs::read_to_string(&file).expect("source text");
            assert!(!text.contains("Cycle"), "{} knows a cycle", file.display());
        }
    }
    for name in [
        "num",
        "gfx",
        "gfxr",
        "trace",
        "stats",
        "sim",
        "shader",
        "mem",
        "work",
        "gl_shader",
        "import",
        "render",
        "unit",
        "machine",
        "accuracy",
    ] {
        for file in part(name) {
            let text = fs::read_to_string(&file).expect("source text");
            for clock in ["Instant::now", "SystemTime"] {
                assert!(!text.contains(clock), "{} reads the wall clock", file.display());
            }
            assert!(!text.contains("println!"), "{} prints", file.display());
        }
    }
}

/// The first page of each package has an example, and tests run it.
#[test]
fn each_package_explains_itself_with_an_example() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let packages = fs::read_dir(root.join("crates")).expect("a folder").map(|entry| entry.expect("an entry").path());
    let mut wrong = Vec::new();
    for package in packages.chain([root.to_owned()]) {
        let manifest = fs::read_to_string(package.join("Cargo.toml")).expect("a manifest");
        let text = fs::read_to_string(package.join("src/lib.rs")).expect("source text");
        let page: Vec<&str> = text.lines().map_while(|line| line.strip_prefix("//!")).collect();
        // Drawings and formats stand in blocks of text. What ends a block looks like what begins an example.
        let fences = page.iter().filter(|line| line.trim() == "```").count();
        let blocks = page.iter().filter(|line| line.trim() == "```text").count();
        if fences < blocks + 2 || manifest.contains("doctest = false") {
            wrong.push(package.display().to_string());
        }
    }
    assert!(wrong.is_empty(), "without an example that tests run: {}", wrong.join(", "));
}
