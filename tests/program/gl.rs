//! Recorded OpenGL programs against reference images: Mesa's llvmpipe for apitrace's recordings, ATTILA for GLInterceptor's. They are not part
//! of the repository: `FILLRATE_PEERS` names the folder that holds `gl/` and `attila/`. Only short recordings are replayed here.

use std::path::{Path, PathBuf};

use fillrate::import;
use fillrate::machine::Config;
use fillrate::report::picture::picture;
use fillrate::run::replay::{Fidelity, Options, replay};

/// A recording, and the least PSNR in dB of its reference frames. What keeps one lower than the rest stands beside it.
const RECORDINGS: &[(&str, f64)] = &[
    ("gl/atlantis", 50.0),
    ("gl/atunnel", 55.0),
    ("gl/cube21", 65.0),
    // Surfaces that meet edge-on: which side a triangle of less than a pixel shows.
    ("gl/engine", 35.0),
    ("gl/flipflop", 55.0),
    ("gl/flurry", 70.0),
    ("gl/glhanoi", 80.0),
    ("gl/glmatrix", 80.0),
    ("gl/glsnake", 65.0),
    ("gl/glxgears", 90.0),
    ("gl/lavalite", 80.0),
    ("gl/moebius", 48.0),
    ("gl/noof", 55.0),
    ("gl/polyhedra", 55.0),
    ("gl/polytopes", 90.0),
    ("gl/quasicrystal", 48.0),
    ("gl/rss-busyspheres", 54.0),
    ("gl/rss-feedback", 50.0),
    ("gl/rss-lattice", 54.0),
    ("gl/rss-matrixview", 57.0),
    ("gl/rss-plasma", 80.0),
    ("gl/rss-spirographx", 60.0),
    ("gl/sproingies", 90.0),
    // Text of smooth lines with textures.
    ("gl/starwars", 32.0),
    ("gl/timetunnel", 60.0),
    ("gl/unicrud", 60.0),
    ("gl/unknownpleasures", 54.0),
    ("gl/winduprobot", 58.0),
    ("attila/micropolygon", 48.0),
    ("attila/simplefog", 45.0),
    ("attila/spaceship", 54.0),
    ("attila/spheremap", 49.0),
    // All edges pass through centres of pixels, and ATTILA settles such ties at the other edges than Mesa does.
    ("attila/triangle", 33.0),
];

/// Share of pixels that may be off by more than 8 of 255.
const OFF_MAX: f64 = 0.01;

/// The recording and its reference images, with the number of the frame that each shows.
fn files(folder: &Path) -> (PathBuf, Vec<(u32, PathBuf)>) {
    let entries = |folder: &Path| {
        let entries = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
        let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry of the folder").path()).collect();
        paths.sort();
        paths
    };
    let mut all = entries(folder);
    if folder.join("reference").is_dir() {
        all.extend(entries(&folder.join("reference")));
    }
    let number = |path: &PathBuf| {
        let name = path.file_name()?.to_str()?.strip_prefix("frame")?;
        if name.ends_with(".png") || name.ends_with(".ppm") { name.get(..4)?.parse().ok() } else { None }
    };
    let references = all.iter().filter_map(|path| Some((number(path)?, path.clone()))).collect();
    let recording = import::detect(folder).unwrap_or_else(|| panic!("no recording in {}", folder.display()));
    (recording.path, references)
}

/// Red, green and blue of an image; PPM is read here, since the library is built for PNG alone.
fn reference(path: &Path) -> (u32, u32, Vec<u8>) {
    if path.extension().is_some_and(|extension| extension == "png") {
        let image = image::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display())).to_rgb8();
        return (image.width(), image.height(), image.into_raw());
    }
    let bytes = std::fs::read(path).expect("the reference");
    let mut words = bytes.split(|byte| byte.is_ascii_whitespace());
    let mut number = || words.next().and_then(|word| std::str::from_utf8(word).ok()?.parse::<u32>().ok());
    assert!(bytes.starts_with(b"P6"), "{} is no PPM image", path.display());
    number();
    let (width, height) = (number().expect("a width"), number().expect("a height"));
    (width, height, bytes[bytes.len() - 3 * (width * height) as usize..].to_vec())
}

#[test]
fn recordings_look_as_their_references() {
    let Some(root) = std::env::var_os("FILLRATE_PEERS") else {
        return eprintln!("left out: FILLRATE_PEERS is not set, so there are no recorded OpenGL programs to replay");
    };
    let mut failures = Vec::new();
    for &(name, least) in RECORDINGS {
        let (recording, references) = files(&Path::new(&root).join(name));
        assert!(!references.is_empty(), "{name} has no references");
        let trace = import::open(&recording).unwrap_or_else(|error| panic!("{error}"));
        let last = references.iter().map(|&(frame, _)| frame).max().unwrap_or(0);
        let config = Config::built_in("baseline").expect("a built-in configuration");
        let options = Options { frames: 0..last + 1, ..Options::new(config, Fidelity::Functional) };
        let replayed = replay(&trace, &options, &|_| ()).unwrap_or_else(|error| panic!("{name}: {error:#}"));
        for (number, path) in references {
            let frame = replayed.frames.iter().find(|frame| frame.number == number).expect("the frame");
            let (surface, bytes) = frame.shown.as_ref().expect("a picture");
            let ours = picture(surface, bytes).unwrap_or_else(|error| panic!("{name}: {error}"));
            let (width, height, wanted) = reference(&path);
            assert_eq!(ours.dimensions(), (width, height), "{name}");
            let (mut off, mut squares) = (0_u32, 0_u64);
            for (p, q) in ours.pixels().zip(wanted.chunks_exact(3)) {
                let d: [u8; 3] = std::array::from_fn(|c| p.0[c].abs_diff(q[c]));
                off += u32::from(d.iter().any(|&d| d > 8));
                squares += d.iter().map(|&d| u64::from(d) * u64::from(d)).sum::<u64>();
            }
            let pixels = f64::from(width * height);
            let psnr = if squares == 0 { f64::INFINITY } else { 10.0 * (65_025.0 * 3.0 * pixels / squares as f64).log10() };
            let share = f64::from(off) / pixels;
            let line = format!("{name:<22} frame {number:>3}: PSNR {psnr:>6.2} dB, {:.3} % off by more than 8", 100.0 * share);
            println!("{line}");
            if psnr < least || share > OFF_MAX {
                failures.push(format!("{line}; at least {least} dB"));
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}
