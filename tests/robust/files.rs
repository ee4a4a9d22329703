//! Files of a trace that are not files, links that lead out of it, archives that become more than they say, and disks that are full.

use std::io::{Cursor, Write};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;

use tempfile::TempDir;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use crate::forms::binary::png_without_pixels;
use crate::process::{below_mib, done, fillrate, refused};

const REPOSITORY: &str = env!("CARGO_MANIFEST_DIR");

/// A copy of a recorded trace that nothing else uses, as `trace` in a folder of its own.
fn copied(from: &str) -> (TempDir, PathBuf) {
    let home = tempfile::tempdir().expect("a folder");
    let trace = home.path().join("trace");
    std::fs::create_dir(&trace).expect("a folder");
    for entry in std::fs::read_dir(Path::new(REPOSITORY).join(from)).expect("a trace") {
        let path = entry.expect("an entry").path();
        std::fs::copy(&path, trace.join(path.file_name().expect("a name"))).expect("copied");
    }
    (home, trace)
}

/// A native trace, and one of its files that a replay reads.
fn native() -> (TempDir, PathBuf, PathBuf) {
    let (home, trace) = copied("traces/triangle");
    let blob = file_of(&trace, "bin");
    (home, trace, blob)
}

/// A foreign trace, and one of its files.
fn foreign() -> (TempDir, PathBuf, PathBuf) {
    let (home, trace) = copied("crates/import/tests/import/window/trace");
    let blob = file_of(&trace, "bin");
    (home, trace, blob)
}

fn file_of(folder: &Path, extension: &str) -> PathBuf {
    let mut found: Vec<PathBuf> = std::fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").path()).collect();
    found.retain(|path| path.extension().is_some_and(|e| e == extension));
    found.sort();
    found.into_iter().next().unwrap_or_else(|| panic!("no {extension} in {}", folder.display()))
}

fn name(path: &Path) -> &str {
    path.file_name().and_then(|name| name.to_str()).expect("a plain name")
}

fn fifo(path: &Path) {
    assert!(Command::new("mkfifo").arg(path).status().expect("mkfifo runs").success());
}

/// A run that reads all of a trace.
fn inspect(path: &Path) -> crate::process::Run {
    fillrate(["inspect".as_ref(), path.as_os_str()]).wall_seconds(10)
}

fn replay(path: &Path, out: &Path) -> crate::process::Run {
    let out = out.as_os_str();
    fillrate(["replay".as_ref(), path.as_os_str(), "--fidelity".as_ref(), "functional".as_ref(), "--out".as_ref(), out])
}

#[test]
fn only_regular_files_are_read() {
    for (_home, trace, blob) in [native(), foreign()] {
        for victim in [blob, trace.join("trace.ron")] {
            let contents = std::fs::read(&victim).expect("a file");
            type Make = fn(&Path);
            let kinds: [(&str, Make); 4] = [
                ("a FIFO", fifo),
                ("a folder", |path| std::fs::create_dir(path).expect("a folder")),
                ("a socket", |path| drop(std::os::unix::net::UnixListener::bind(path).expect("a socket"))),
                ("a symbolic link", |path| symlink("/dev/zero", path).expect("a link")),
            ];
            for (kind, make) in kinds {
                std::fs::remove_file(&victim).expect("removed");
                make(&victim);
                refused(&inspect(&trace).run(), &[name(&victim), kind]);
                if victim.is_dir() { std::fs::remove_dir(&victim) } else { std::fs::remove_file(&victim) }.expect("removed");
                std::fs::write(&victim, &contents).expect("written");
            }
            // The link is followed, and what it leads to is a device all the same.
            std::fs::remove_file(&victim).expect("removed");
            symlink("/dev/zero", &victim).expect("a link");
            refused(&inspect(&trace).arg("--follow-links").run(), &[name(&victim), "a device"]);
            std::fs::remove_file(&victim).expect("removed");
            std::fs::write(&victim, &contents).expect("written");
        }
        done(&inspect(&trace).run());
    }
    // A FIFO has the length that this trace states.
    let (_home, trace, blob) = native();
    let text = std::fs::read_to_string(trace.join("trace.ron")).expect("a text");
    let size = std::fs::metadata(&blob).expect("there").len();
    std::fs::write(trace.join("trace.ron"), text.replacen(&format!("size: {size}"), "size: 0", 1)).expect("written");
    std::fs::remove_file(&blob).expect("removed");
    fifo(&blob);
    for links in [&[][..], &["--follow-links"]] {
        let run = fillrate(["replay".as_ref(), trace.as_os_str()]).wall_seconds(10);
        refused(&links.iter().fold(run, |run, link| run.arg(link)).run(), &[name(&blob), "a FIFO"]);
    }
}

#[test]
fn links_are_followed_only_where_that_is_asked_for() {
    for (home, trace, blob) in [native(), foreign()] {
        let outside = home.path().join("outside");
        let chain = home.path().join("chain");
        for victim in [blob, trace.join("trace.ron")] {
            std::fs::rename(&victim, &outside).expect("moved");
            symlink(&outside, &chain).expect("a link");
            // Out of the folder, over another link, and within it.
            let inside = trace.join("inside.dat");
            std::fs::copy(&outside, &inside).expect("copied");
            for target in [outside.as_path(), &chain, Path::new("inside.dat")] {
                symlink(target, &victim).expect("a link");
                refused(&inspect(&trace).run(), &[name(&victim), "symbolic link", "--follow-links"]);
                done(&inspect(&trace).arg("--follow-links").run());
                std::fs::remove_file(&victim).expect("removed");
            }
            // In a circle, and to nowhere.
            for target in [victim.as_path(), Path::new("/nowhere")] {
                symlink(target, &victim).expect("a link");
                refused(&inspect(&trace).run(), &[name(&victim), "symbolic link"]);
                refused(&inspect(&trace).arg("--follow-links").run(), &[name(&victim)]);
                std::fs::remove_file(&victim).expect("removed");
            }
            std::fs::remove_file(&inside).expect("removed");
            std::fs::remove_file(&chain).expect("removed");
            std::fs::rename(&outside, &victim).expect("moved");
        }
        // The user's own path may be a link; a folder inside may not.
        let own = home.path().join("own");
        symlink(&trace, &own).expect("a link");
        done(&inspect(&own).run());
        let above = home.path().join("above");
        std::fs::create_dir(&above).expect("a folder");
        symlink(&trace, above.join("trace")).expect("a link");
        refused(&inspect(&above).run(), &["above/trace", "symbolic link", "--follow-links"]);
        done(&inspect(&above).arg("--follow-links").run());
    }
}

#[test]
fn configurations_and_compared_files_are_regular_too() {
    let home = tempfile::tempdir().expect("a folder");
    let pipe = home.path().join("pipe.json");
    fifo(&pipe);
    let pipe = pipe.as_os_str();
    let soon = |run: crate::process::Run| run.wall_seconds(10).run();
    refused(&soon(fillrate(["configs".as_ref(), pipe])), &["pipe.json", "a FIFO"]);
    refused(&soon(fillrate(["configs", "/dev/zero"])), &["/dev/zero", "a device"]);
    refused(&soon(fillrate(["compare".as_ref(), pipe, pipe])), &["pipe.json", "a FIFO"]);
    refused(&soon(fillrate(["compare", "/dev/zero", "/dev/zero"])), &["/dev/zero", "a device"]);
    for command in ["inspect", "replay"] {
        refused(&soon(fillrate([command.as_ref(), pipe])), &["pipe.json", "a FIFO"]);
        refused(&soon(fillrate([command, "/dev/zero"])), &["/dev/zero", "a device"]);
    }
    let config = home.path().join("large.ron");
    std::fs::write(&config, format!("(extends: \"tiny\", {})", "a:1,".repeat(65_000))).expect("written");
    let output = fillrate(["configs".as_ref(), config.as_os_str()]).run();
    refused(&output, &["large.ron"]);
    std::fs::File::create(&config).and_then(|file| file.set_len(8 << 30)).expect("a sparse file");
    refused(&fillrate(["configs".as_ref(), config.as_os_str()]).run(), &["large.ron", "8589934592 bytes", "at most"]);
}

#[test]
fn pictures_of_too_many_pixels_are_not_read() {
    let home = tempfile::tempdir().expect("a folder");
    let large = home.path().join("large.png");
    std::fs::write(&large, png_without_pixels(30_000)).expect("written");
    let compare = fillrate(["compare".as_ref(), large.as_os_str(), large.as_os_str()]);
    let output = compare.clone().run();
    refused(&output, &["large.png", "30000 x 30000", "900000000 pixels of a picture", "--limit picture.pixels=N allows more"]);
    below_mib(&output, 200);
    // A row of this one is larger than all that is allowed.
    std::fs::write(&large, png_without_pixels(i32::MAX as u32)).expect("written");
    refused(&compare.clone().run(), &["large.png", "67108864 pixels; --limit picture.pixels=N allows more"]);
    std::fs::write(&large, png_without_pixels(30_000)).expect("written");
    // With more it is damaged.
    let output = compare.clone().arg("--limit").arg("picture.pixels=900_000_000").memory_mib(16_000).run();
    refused(&output, &["large.png"]);
    assert!(!output.stderr.contains("--limit"), "{output:?}");
    refused(&compare.arg("--limit").arg("picture.pixel=1").run(), &["there is no limit picture.pixel;"]);
    // What a replay has left is read again, too.
    let out = home.path().join("out");
    done(
        &fillrate(["replay".as_ref(), "traces/triangle".as_ref(), "--out".as_ref(), out.as_os_str()])
            .current_dir(REPOSITORY)
            .run(),
    );
    std::fs::write(out.join("frame-0000.png"), png_without_pixels(30_000)).expect("written");
    let output = fillrate(["report".as_ref(), out.as_os_str()]).current_dir(REPOSITORY).run();
    refused(&output, &["frame-0000.png", "30000 x 30000", "--limit picture.pixels=N allows more"]);
}

#[test]
fn file_names_that_lead_out_are_refused() {
    let (_home, trace, _) = native();
    let text = std::fs::read_to_string(trace.join("trace.ron")).expect("a text");
    let blob = name(&file_of(&trace, "bin")).to_owned();
    let long = "a".repeat(5000);
    let names = [
        "../outside.bin",
        "/etc/passwd",
        "a/b.bin",
        "a\\\\b.bin",
        "nul\\u{0}.bin",
        "new\\nline.bin",
        "..",
        "",
        ".hidden",
        &long,
    ];
    for bad in names {
        std::fs::write(trace.join("trace.ron"), text.replace(&blob, bad)).expect("written");
        refused(&inspect(&trace).run(), &["trace.ron:", "blob name"]);
    }
    let (_home, trace, blob) = foreign();
    let text = std::fs::read_to_string(trace.join("trace.ron")).expect("a text");
    for bad in names {
        std::fs::write(trace.join("trace.ron"), text.replace(name(&blob), bad)).expect("written");
        refused(&inspect(&trace).run(), &["trace.ron:", "name"]);
    }
}

#[test]
fn large_files_are_counted_before_they_are_read() {
    let (_home, trace, blob) = native();
    let text = std::fs::read_to_string(trace.join("trace.ron")).expect("a text");
    let size = std::fs::metadata(&blob).expect("there").len();
    std::fs::File::options().write(true).open(&blob).and_then(|file| file.set_len(1 << 40)).expect("a sparse file");
    std::fs::write(trace.join("trace.ron"), text.replacen(&format!("size: {size}"), &format!("size: {}", 1u64 << 40), 1))
        .expect("written");
    let output = inspect(&trace).run();
    refused(&output, &["trace.ron", "trace.bytes", "--limit"]);
    std::fs::File::options().write(true).open(trace.join("trace.ron")).and_then(|f| f.set_len(1 << 40)).expect("a sparse file");
    let output = inspect(&trace).run();
    refused(&output, &["trace.ron", "trace.bytes", "--limit"]);
    below_mib(&output, 200);
    let output = inspect(Path::new(REPOSITORY).join("traces/triangle").as_path()).arg("--limit").arg("trace.files=1").run();
    refused(&output, &["trace.ron", "2 files of the trace", "--limit trace.files=N"]);
}

#[test]
fn deep_and_endless_text_is_refused() {
    let (_home, trace, _) = native();
    let ron = trace.join("trace.ron");
    let wgpu = format!("[{}", "Action(".repeat(100_000));
    let native = |text: String| format!("Trace(version: 1, files: {{}}, commands: [{text}");
    let texts = [
        native("[".repeat(300_000)),
        native("Draw(".repeat(300_000)),
        native("/*".repeat(300_000)),
        native(format!("InsertDebugMarker(\"{}\"), 7", "x".repeat(5_000_000))),
        native("9".repeat(5_000_000)),
        native("Z".repeat(5_000_000)),
        "(".repeat(300_000),
        wgpu,
        "[".repeat(300_000),
        format!("[{}", "9".repeat(5_000_000)),
        format!("[CreateBuffer({}", "(label: Some(".repeat(200_000)),
    ];
    for text in texts {
        std::fs::write(&ron, &text).expect("written");
        let output = inspect(&trace).cpu_seconds(10).run();
        refused(&output, &["trace.ron:1:"]);
        assert!(output.stderr.len() < 20_000, "a message of {} bytes", output.stderr.len());
    }
    let config = trace.join("deep.ron");
    for text in ["(a:".repeat(50_000), "[".repeat(200_000), "Some(".repeat(50_000)] {
        std::fs::write(&config, text).expect("written");
        refused(&fillrate(["configs".as_ref(), config.as_os_str()]).run(), &["deep.ron"]);
    }
}

/// The recorded triangle as an archive, with the sizes that its entries become.
fn archive(method: CompressionMethod, change: impl Fn(&str, Vec<u8>) -> Vec<u8>) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(method);
    let folder = Path::new(REPOSITORY).join("traces/triangle");
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder).expect("a trace").map(|e| e.expect("an entry").path()).collect();
    paths.sort();
    for path in paths {
        zip.start_file(name(&path), options).expect("an entry");
        zip.write_all(&change(name(&path), std::fs::read(&path).expect("a file"))).expect("written");
    }
    zip.finish().expect("an archive").into_inner()
}

/// Changes bytes in both headers of an entry: at `local` of the one before its data, at `central` of the one in the directory.
fn patch(archive: &mut [u8], entry: &str, local: usize, central: usize, bytes: &[u8]) {
    let mut found = 0;
    for at in 0..archive.len() - 46 {
        let (name_at, field) = match &archive[at..at + 4] {
            b"PK\x03\x04" => (at + 30, at + local),
            b"PK\x01\x02" => (at + 46, at + central),
            _ => continue,
        };
        if archive[name_at..].starts_with(entry.as_bytes()) {
            archive[field..field + bytes.len()].copy_from_slice(bytes);
            found += 1;
        }
    }
    assert_eq!(found, 2, "headers of {entry}");
}

fn opened(bytes: &[u8]) -> crate::process::Output {
    let home = tempfile::tempdir().expect("a folder");
    let path = home.path().join("bad.zip");
    std::fs::write(&path, bytes).expect("written");
    replay(&path, &home.path().join("out")).memory_mib(1024).run()
}

#[test]
fn archives_become_what_they_say() {
    let deflated = || archive(CompressionMethod::Deflated, |_, bytes| bytes);
    done(&opened(&deflated()));
    done(&opened(&archive(CompressionMethod::Stored, |_, bytes| bytes)));
    let blob = file_of(&Path::new(REPOSITORY).join("traces/triangle"), "bin");
    let blob = name(&blob);
    for entry in [blob, "trace.ron"] {
        // Half a gigabyte that claims to be what the trace says.
        let mut bomb =
            archive(CompressionMethod::Deflated, |at, bytes| if at == entry { vec![b' '; 512 << 20] } else { bytes });
        let size = std::fs::metadata(Path::new(REPOSITORY).join("traces/triangle").join(entry)).expect("there").len() as u32;
        patch(&mut bomb, entry, 22, 24, &size.to_le_bytes());
        let output = opened(&bomb);
        refused(&output, &["bad.zip", entry, "larger than its declared"]);
        below_mib(&output, 200);
        // A header that says more than there is.
        let mut empty = deflated();
        patch(&mut empty, entry, 22, 24, &0x7fff_ffffu32.to_le_bytes());
        refused(&opened(&empty), &["bad.zip", entry, "2147483647"]);
        // Encrypted, packed otherwise, damaged.
        let mut secret = deflated();
        patch(&mut secret, entry, 6, 8, &[1, 0]);
        refused(&opened(&secret), &["bad.zip", entry, "encrypted"]);
        let mut other = deflated();
        patch(&mut other, entry, 8, 10, &[12, 0]);
        refused(&opened(&other), &["bad.zip", entry, "only deflate"]);
        for method in [CompressionMethod::Deflated, CompressionMethod::Stored] {
            let mut damaged = archive(method, |_, bytes| bytes);
            patch(&mut damaged, entry, 14, 16, &[1, 2, 3, 4]);
            let output = opened(&damaged);
            // Contents of a stored blob are compared with the trace's own hash, which is stronger.
            if entry == "trace.ron" || method == CompressionMethod::Deflated {
                refused(&output, &["bad.zip", entry]);
            } else {
                done(&output);
            }
        }
    }
    // Text that says what it becomes, and is too large.
    let honest = archive(CompressionMethod::Deflated, |at, mut bytes| {
        bytes.resize(bytes.len() + if at == "trace.ron" { 64 << 20 } else { 0 }, b' ');
        bytes
    });
    let home = tempfile::tempdir().expect("a folder");
    let path = home.path().join("honest.zip");
    std::fs::write(&path, &honest).expect("written");
    refused(&inspect(&path).run(), &["honest.zip", "trace.expansion=N"]);
    let inspect = || inspect(&path).arg("--limit").arg("trace.expansion=2000");
    done(&inspect().run());
    refused(&inspect().arg("--limit").arg("trace.bytes=1_000_000").run(), &["honest.zip", "trace.ron", "trace.bytes=N"]);
    // As large as the limit allows, and there is no memory for it.
    refused(&inspect().memory_mib(100).run(), &["honest.zip", "memory"]);
}

#[test]
fn directories_of_archives_are_bounded() {
    let good = archive(CompressionMethod::Stored, |_, bytes| bytes);
    let directory = good.windows(4).position(|four| four == b"PK\x01\x02").expect("a directory");
    let end = good.windows(4).position(|four| four == b"PK\x05\x06").expect("an end");
    let last = |entries: u16, size: u32, start: u32| {
        let mut record = good[end..].to_vec();
        record[8..10].copy_from_slice(&entries.to_le_bytes());
        record[10..12].copy_from_slice(&entries.to_le_bytes());
        record[12..16].copy_from_slice(&size.to_le_bytes());
        record[16..20].copy_from_slice(&start.to_le_bytes());
        record
    };
    // A million entries, really there.
    let mut many = good[..directory].to_vec();
    for number in 0..1_000_000u32 {
        let mut header = good[directory..directory + 46].to_vec();
        header[28..34].copy_from_slice(&[8, 0, 0, 0, 0, 0]);
        many.extend(header);
        many.extend(format!("{number:08x}").bytes());
    }
    let large_at = many.len() as u64;
    let size = large_at - directory as u64;
    let large = |entries: u64| {
        let mut record = b"PK\x06\x06".to_vec();
        record.extend(44u64.to_le_bytes());
        record.extend([45, 0, 45, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
        for value in [entries, entries, size, directory as u64] {
            record.extend(value.to_le_bytes());
        }
        record.extend(b"PK\x06\x07\0\0\0\0");
        record.extend(large_at.to_le_bytes());
        record.extend(1u32.to_le_bytes());
        record
    };
    for stated in [1_000_000, u64::from(u32::MAX), u64::MAX] {
        let archive = [many.clone(), large(stated), last(u16::MAX, u32::MAX, u32::MAX)].concat();
        let output = opened(&archive);
        refused(&output, &["bad.zip", &stated.to_string(), "--limit trace.files=N"]);
        below_mib(&output, 300);
    }
    // Two directories: which one counts must not matter.
    let archive = [many.clone(), large(u64::MAX), last(u16::MAX, u32::MAX, u32::MAX), good[end..].to_vec()].concat();
    refused(&opened(&archive), &["bad.zip", "trace.files"]);
    // An entry named twice, and two entries over the same bytes.
    let entries: Vec<usize> = (directory..end).filter(|&at| good[at..].starts_with(b"PK\x01\x02")).chain([end]).collect();
    let all = &good[directory..end];
    let first = &good[entries[0]..entries[1]];
    let number = entries.len() as u16;
    let twice = [&good[..directory], all, first, &last(number, (all.len() + first.len()) as u32, directory as u32)].concat();
    refused(&opened(&twice), &["bad.zip", "two entries of one name"]);
    let mut second = first.to_vec();
    second[46] ^= 1;
    let over = [&good[..directory], all, &second, &last(number, (all.len() + second.len()) as u32, directory as u32)].concat();
    refused(&opened(&over), &["bad.zip", "overlap"]);
}
