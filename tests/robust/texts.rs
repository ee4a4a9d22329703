//! Recordings of GLInterceptor that are long, and packed files that become large.

use std::io::Write;

use tempfile::TempDir;

use super::process::{Output, below_mib, done, fillrate, refused};

/// Runs `inspect` on a file of this name.
fn inspect(name: &str, bytes: &[u8], limits: &[&str]) -> Output {
    let folder = TempDir::new().expect("a folder");
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).expect("a file");
    let run = fillrate(["inspect".as_ref(), path.as_os_str()]);
    limits.iter().fold(run, |run, limit| run.arg("--limit").arg(limit)).run()
}

#[test]
fn a_text_of_many_lines_takes_time_in_proportion() {
    // Each line was once read again for each line after it: 4 * 10^10 bytes.
    let output = inspect("t.txt", format!("GLI0.t\nglShaderSource(1,1,\"{}", "\n".repeat(200_000)).as_bytes(), &[]);
    done(&output);
    assert!(output.stderr.contains("the end of the recording is missing: call 0"), "{output:?}");
    let program = format!("!!ARBfp1.0\n{}MOV result.color, fragment.color;\nEND\n", "# a comment\n".repeat(30_000));
    let calls = format!("GLI0.t\nglProgramStringARB(34820,34933,{},\"{program}\")\nwglSwapBuffers(1)\n", program.len());
    let output = inspect("t.txt", calls.as_bytes(), &[]);
    assert!(!output.timed_out && matches!(output.status.code(), Some(0..=2)), "{output:?}");
}

/// Bytes that are packed to a thousandth.
fn blanks(mib: usize) -> Vec<u8> {
    vec![b' '; mib << 20]
}

fn archive(entries: &[(&str, &[u8])]) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Deflated);
    for (name, bytes) in entries {
        archive.start_file(*name, options).expect("an entry");
        archive.write_all(bytes).expect("an entry");
    }
    archive.finish().expect("an archive").into_inner()
}

#[test]
fn small_files_that_become_large_are_refused() {
    let trace = "Trace(version: 1, files: {}, commands: [])";
    let large = blanks(70);
    let packed = archive(&[("trace.ron", trace.as_bytes()), ("other", &large)]);
    assert!(packed.len() < 200_000);
    let output = inspect("t.zip", &packed, &[]);
    refused(&output, &["t.zip", "times the size of the packed file", "--limit trace.expansion=N allows more"]);
    below_mib(&output, 60);
    done(&inspect("t.zip", &packed, &["trace.expansion=2000"]));
    // Up to 64 MiB, every archive may become what it says.
    let small = archive(&[("trace.ron", trace.as_bytes()), ("other", &large[..60 << 20])]);
    done(&inspect("t.zip", &small, &[]));
}
