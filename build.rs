//! Gives the program its version for `fillrate --version`: that of the package, with the commit where the sources are a git checkout.

use std::path::Path;
use std::process::Command;

/// The answer of git, without the end of its line. None if there is no git, or if it fails.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim_end().to_owned())
}

/// The commit of the checkout. None in an archive or a published package, even if it lies in the checkout of another project.
fn commit() -> Option<String> {
    // Cargo runs this program in the folder of the package. `.git` is a file in a work tree beside the first one.
    if !Path::new(".git").exists() {
        return None;
    }
    // `HEAD` changes when another branch is checked out, the branch's own file with its commits. Git may pack that file away. The log
    // of `HEAD` grows then, too.
    let branch = git(&["symbolic-ref", "--quiet", "HEAD"]);
    for name in ["HEAD", "logs/HEAD"].into_iter().chain(branch.as_deref()) {
        // Cargo would run this program in every build for a file that is not there.
        if let Some(path) = git(&["rev-parse", "--git-path", name]).filter(|path| Path::new(path).exists()) {
            println!("cargo:rerun-if-changed={path}");
        }
    }
    git(&["rev-parse", "--short=12", "HEAD"])
}

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    let commit = commit().map(|commit| format!(" ({commit})")).unwrap_or_default();
    println!("cargo:rustc-env=FILLRATE_VERSION={}{commit}", env!("CARGO_PKG_VERSION"));
}
