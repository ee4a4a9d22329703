//! Hostile files that are no text: pictures, archives and recordings of apitrace.

use std::io::Write;

use fillrate::num::Random;

/// The name of a form, and a function that writes a file of it of a given size.
pub type File = (&'static str, fn(usize) -> Vec<u8>);

/// A chunk of a PNG file.
fn chunk(kind: &[u8; 4], data: &[u8]) -> Vec<u8> {
    let typed = [kind, data].concat();
    let check = crc32fast::hash(&typed).to_be_bytes();
    [&(data.len() as u32).to_be_bytes()[..], &typed, &check].concat()
}

/// A deflated stream in the wrapping of zlib.
fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut out = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
    out.write_all(bytes).expect("memory");
    out.finish().expect("memory")
}

/// A PNG file of this size, kind of colour and interlacing, with these chunks behind the header.
fn png(size: u32, bits: u8, color: u8, interlaced: bool, chunks: &[u8]) -> Vec<u8> {
    let header = [&size.to_be_bytes()[..], &size.to_be_bytes(), &[bits, color, 0, 0, u8::from(interlaced)]].concat();
    [b"\x89PNG\r\n\x1a\n", &chunk(b"IHDR", &header)[..], chunks, &chunk(b"IEND", &[])].concat()
}

/// A row of pixels of zeros for each line of a picture, packed.
fn black(size: u32, pixel: usize) -> Vec<u8> {
    chunk(b"IDAT", &zlib(&vec![0; (pixel * size as usize + 1) * size as usize]))
}

fn grey(size: u32) -> Vec<u8> {
    black(size, 1)
}

/// A PNG file whose header says this size, and which has no pixels.
pub fn png_without_pixels(size: u32) -> Vec<u8> {
    png(size, 8, 6, false, &chunk(b"IDAT", &zlib(&[])))
}

/// The size of a picture of the most bytes for a pixel, of which about `n` bytes of a file are enough; at most as large as is allowed.
fn allowed(n: usize) -> u32 {
    (((1000 * n / 8) as f64).sqrt() as u32).min(1 << 13)
}

fn noise(n: usize) -> Vec<u8> {
    let mut random = Random::new(n as u64);
    (0..n).map(|_| random.bits() as u8).collect()
}

/// Pictures of about `n` bytes.
pub const PICTURES: &[File] = &[
    ("texts", |n| png(1, 8, 0, false, &[chunk(b"tEXt", b"a\0b").repeat(n / 15), grey(1)].concat())),
    ("long text", |n| png(1, 8, 0, false, &[chunk(b"tEXt", &vec![b'a'; n]), grey(1)].concat())),
    ("packed text", |n| {
        png(1, 8, 0, false, &[chunk(b"zTXt", &[b"a\0\0", &zlib(&vec![b'a'; 1000 * n])[..]].concat()), grey(1)].concat())
    }),
    ("packed texts", |n| {
        png(
            1,
            8,
            0,
            false,
            &[chunk(b"zTXt", &[b"a\0\0", &zlib(&vec![b'a'; 1 << 20])[..]].concat()).repeat(n / 1050), grey(1)].concat(),
        )
    }),
    ("profile", |n| {
        png(1, 8, 0, false, &[chunk(b"iCCP", &[b"a\0\0", &zlib(&vec![b'a'; 1000 * n])[..]].concat()), grey(1)].concat())
    }),
    ("unknown chunks", |n| png(1, 8, 0, false, &[chunk(b"aaAa", b"").repeat(n / 12), grey(1)].concat())),
    ("empty data", |n| png(1, 8, 0, false, &[chunk(b"IDAT", b"").repeat(n / 12), grey(1)].concat())),
    ("data in bytes", |n| {
        let data = zlib(&noise(n / 13));
        png(64, 8, 0, false, &data.chunks(1).flat_map(|byte| chunk(b"IDAT", byte)).collect::<Vec<u8>>())
    }),
    ("large and packed", |n| png(((1000 * n) as f64).sqrt() as u32, 8, 0, false, &grey(((1000 * n) as f64).sqrt() as u32))),
    ("large and interlaced", |n| png(((1000 * n) as f64).sqrt() as u32, 8, 0, true, &grey(((1000 * n) as f64).sqrt() as u32))),
    ("as large as allowed", |n| png(allowed(n), 16, 6, false, &black(allowed(n), 8))),
    ("as large as allowed and interlaced", |n| png(allowed(n), 16, 6, true, &black(allowed(n) + 1, 8))),
    ("larger than its data", |n| png(30_000, 8, 6, false, &chunk(b"IDAT", &zlib(&noise(n))))),
    ("larger than any", |n| png(0x7fff_ffff, 16, 6, false, &chunk(b"IDAT", &zlib(&noise(n))))),
    ("more data than pixels", |n| png(1, 8, 0, false, &chunk(b"IDAT", &zlib(&vec![0; 1000 * n])))),
    ("palettes", |n| png(1, 8, 3, false, &[chunk(b"PLTE", &[0; 768]).repeat(n / 780), grey(1)].concat())),
    ("noise", |n| [&b"\x89PNG\r\n\x1a\n"[..], &noise(n)].concat()),
    ("plain text picture", |n| [&b"P2\n100 100\n255\n"[..], &b"1 ".repeat(n / 2)].concat()),
    ("plain text picture of comments", |n| [&b"P2\n"[..], &b"# a\n".repeat(n / 4)].concat()),
    ("digits of a plain text picture", |n| [&b"P2\n"[..], &b"1".repeat(n)].concat()),
    ("large plain picture", |n| [&b"P6\n60000 60000\n255\n"[..], &noise(n)].concat()),
];

fn archive(entries: usize, entry: impl Fn(usize) -> (String, Vec<u8>)) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Deflated);
    let trace = ("trace.ron".to_owned(), b"Trace(version: 1, files: {}, commands: [])".to_vec());
    for (name, bytes) in std::iter::once(trace).chain((0..entries).map(entry)) {
        archive.start_file(name, options).expect("an entry");
        archive.write_all(&bytes).expect("an entry");
    }
    archive.finish().expect("an archive").into_inner()
}

/// Archives of about `n` bytes.
pub const ARCHIVES: &[File] = &[
    ("entries", |n| archive(n / 110, |k| (format!("a{k}"), vec![]))),
    ("long names", |n| archive(n / 350, |k| (format!("{k}{}", "a".repeat(100)), vec![]))),
    ("folders", |n| archive(n / 250, |k| (format!("{k}{}", "/a".repeat(40)), vec![]))),
    ("packed entries", |n| archive(n / 1_200, |k| (format!("a{k}"), vec![b' '; 1 << 20]))),
    ("one packed entry", |n| archive(1, |_| ("a".to_owned(), vec![b' '; 1000 * n]))),
    ("a packed trace", |n| {
        let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Deflated);
        archive.start_file("trace.ron", options).expect("an entry");
        archive.write_all(&vec![b' '; (1000 * n).min(63 << 20)]).expect("an entry");
        archive.write_all(b"Trace(version: 1, files: {}, commands: [])").expect("an entry");
        archive.finish().expect("an archive").into_inner()
    }),
    ("a packed trace of commands", |n| {
        let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Deflated);
        archive.start_file("trace.ron", options).expect("an entry");
        let command = b"EndRenderPass,";
        let commands = command.repeat(((1000 * n).min(63 << 20) / command.len()).max(1));
        archive.write_all(&[&b"Trace(version: 1, files: {}, commands: ["[..], &commands, b"])"].concat()).expect("an entry");
        archive.finish().expect("an archive").into_inner()
    }),
    ("comment", |n| {
        let mut bytes = archive(1, |k| (format!("a{k}"), vec![]));
        let at = bytes.len() - 2;
        bytes[at..].copy_from_slice(&(n.min(65_535) as u16).to_le_bytes());
        bytes.extend(vec![b'P'; n.min(65_535)]);
        bytes
    }),
    ("ends of archives", |n| [archive(1, |k| (format!("a{k}"), vec![])), b"PK\x05\x06".repeat(n / 4)].concat()),
    ("noise", |n| [&b"PK\x03\x04"[..], &noise(n)].concat()),
];

/// A chunk of apitrace's container.
fn packed(piece: &[u8]) -> Vec<u8> {
    let packed = snap::raw::Encoder::new().compress_vec(piece).expect("a small piece");
    [&(packed.len() as u32).to_le_bytes()[..], &packed].concat()
}

/// A recording: the stream in chunks of this size.
fn recording(stream: &[u8], chunk: usize) -> Vec<u8> {
    std::iter::once(b"at".to_vec()).chain(stream.chunks(chunk).map(packed)).collect::<Vec<_>>().concat()
}

fn uint(mut value: u64) -> Vec<u8> {
    let mut out = Vec::new();
    while value > 0x7f {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
    out
}

/// The start of a call of a function that has not been named before, with one argument.
fn call(number: u64, name: &str) -> Vec<u8> {
    [&[0][..], &uint(number), &uint(name.len() as u64), name.as_bytes(), &[1, 1, b'a', 1, 0]].concat()
}

/// Recordings of apitrace of version 3, without threads; packed, most are much smaller than `n` bytes.
pub const RECORDINGS: &[File] = &[
    ("arrays in arrays", |n| recording(&[&[3][..], &call(0, "glLoadMatrixf"), &[11, 1].repeat(n / 2)].concat(), 1 << 20)),
    ("structures in structures", |n| {
        let inner: Vec<u8> = (0..n / 8).flat_map(|k| [&[12][..], &uint(k as u64), &[1, b's', 1, 1, b'm']].concat()).collect();
        recording(&[&[3][..], &call(0, "glLoadMatrixf"), &inner].concat(), 1 << 20)
    }),
    ("elements", |n| {
        recording(&[&[3][..], &call(0, "glLoadMatrixf"), &[11], &uint(n as u64), &[0].repeat(n)].concat(), 1 << 20)
    }),
    ("elements that are missing", |n| {
        recording(&[&[3][..], &call(0, "glLoadMatrixf"), &[11], &uint(1 << 40), &[0].repeat(n)].concat(), 1 << 20)
    }),
    ("bytes that are missing", |n| {
        recording(&[&[3][..], &call(0, "glLoadMatrixf"), &[8], &uint(1 << 40), &[0].repeat(n)].concat(), 1 << 20)
    }),
    ("texts", |n| recording(&[&[3][..], &call(0, "glShaderSource"), &[7], &uint(n as u64), &b"a".repeat(n)].concat(), 1 << 20)),
    ("functions", |n| {
        let calls: Vec<u8> =
            (0..n as u64 / 24).flat_map(|k| [call(k, &format!("glF{k}")), vec![0, 0, 1], uint(k), vec![0]].concat()).collect();
        recording(&[&[3][..], &calls].concat(), 1 << 20)
    }),
    ("arguments", |n| {
        let names = "\u{1}a".repeat(n / 2);
        recording(&[&[3, 0, 0, 3, b'g', b'l', b'A'][..], &uint(n as u64 / 2), names.as_bytes(), &[0]].concat(), 1 << 20)
    }),
    ("calls that do not end", |n| {
        recording(&[&[3][..], &call(0, "glFlush"), &[0], &[0, 0, 0].repeat(n / 3)].concat(), 1 << 20)
    }),
    ("chunks of a byte", |n| recording(&[&[3][..], &[0].repeat(n / 7)].concat(), 1)),
    ("empty chunks", |n| [&b"at"[..], &packed(&[]).repeat(n / 5)].concat()),
    ("chunks that expand", |n| [&b"at"[..], &packed(&vec![0; 1 << 20]).repeat(n / 50_000 + 1)].concat()),
    ("a chunk that says too much", |n| {
        [&b"at"[..], &(n as u32).to_le_bytes(), &[0xff, 0xff, 0xff, 0xff, 0x0f], &noise(n)].concat()
    }),
    ("signatures of enumerants", |n| {
        let values: Vec<u8> = (0..n / 4).flat_map(|_| [1, b'E', 4, 1]).collect();
        recording(&[&[3][..], &call(0, "glEnable"), &[9, 0], &uint(n as u64 / 4), &values].concat(), 1 << 20)
    }),
    ("gzip", |n| {
        let mut out = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
        out.write_all(&[&b"GLI0.t\n"[..], &vec![b'\n'; 1000 * n]].concat()).expect("memory");
        out.finish().expect("memory")
    }),
    ("noise", |n| recording(&[&[6][..], &noise(n)].concat(), 1 << 20)),
];
