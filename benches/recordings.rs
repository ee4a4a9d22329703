//! Bytes of calls a second: a recorded OpenGL program is read, and its calls are run by OpenGL's state machine, as `fillrate inspect` does.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use fillrate::import::open_reported;
use fillrate::trace::Reading;

/// Bytes of calls, about.
const BYTES: usize = 32 << 20;

/// An expanded stream of apitrace, version 5: each call is entered and left by one thread.
#[derive(Default)]
struct Stream {
    bytes: Vec<u8>,
    known: Vec<&'static str>,
    calls: u64,
}

fn uint(out: &mut Vec<u8>, mut value: u64) {
    while value > 0x7f {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

impl Stream {
    /// A call; `values` are its arguments as they are written.
    fn call(&mut self, name: &'static str, values: &[Vec<u8>]) {
        let known = self.known.iter().position(|known| *known == name);
        let out = &mut self.bytes;
        out.extend([0, 0]);
        uint(out, known.unwrap_or(self.known.len()) as u64);
        if known.is_none() {
            self.known.push(name);
            uint(out, name.len() as u64);
            out.extend(name.as_bytes());
            uint(out, values.len() as u64);
            for _ in values {
                out.extend([1, b'x']);
            }
        }
        for (k, value) in (0..).zip(values) {
            out.extend([1, k]);
            out.extend(value);
        }
        out.extend([0, 1]);
        uint(out, self.calls);
        out.push(0);
        self.calls += 1;
    }
}

fn float(value: f32) -> Vec<u8> {
    [&[5][..], &value.to_le_bytes()].concat()
}

fn whole(value: u64) -> Vec<u8> {
    let mut out = vec![4];
    uint(&mut out, value);
    out
}

/// An array of floats.
fn floats(values: [f32; 3]) -> Vec<u8> {
    [&[11, 3][..], &values.map(float).concat()].concat()
}

/// Frames of triangles with a normal, a colour and a position a vertex, half of them given one by one and half as arrays; every 300
/// vertices another matrix.
fn recording() -> (Vec<u8>, u64) {
    let mut stream = Stream::default();
    uint(&mut stream.bytes, 5);
    stream.call("glViewport", &[0, 0, 64, 64].map(whole));
    let mut angle = 0.0;
    while stream.bytes.len() < BYTES {
        stream.call("glClear", &[whole(16_640)]);
        for part in 0..8 {
            angle += 0.1;
            stream.call("glPushMatrix", &[]);
            stream.call("glRotatef", &[angle, 0.0, 1.0, 0.0].map(float));
            stream.call("glBegin", &[whole(4)]);
            for k in 0..300 {
                let at = [k as f32 / 300.0, angle, (k % 7) as f32];
                if part % 2 == 0 {
                    stream.call("glNormal3f", &at.map(float));
                    stream.call("glColor3f", &at.map(float));
                    stream.call("glVertex3f", &at.map(float));
                } else {
                    stream.call("glNormal3fv", &[floats(at)]);
                    stream.call("glColor3fv", &[floats(at)]);
                    stream.call("glVertex3fv", &[floats(at)]);
                }
            }
            stream.call("glEnd", &[]);
            stream.call("glPopMatrix", &[]);
        }
        stream.call("glXSwapBuffers", &[whole(1), whole(2)]);
    }
    let length = stream.bytes.len() as u64;
    let mut file = b"at".to_vec();
    for chunk in stream.bytes.chunks(1 << 20) {
        let packed = snap::raw::Encoder::new().compress_vec(chunk).expect("a chunk");
        file.extend((packed.len() as u32).to_le_bytes());
        file.extend(packed);
    }
    (file, length)
}

fn reading(c: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("calls.trace");
    let (file, length) = recording();
    std::fs::write(&path, file).expect("a file");
    // Commands are not kept, as those of a long recording are not.
    let reading = Reading { in_memory: Some(1 << 20), ..Reading::default() };
    let mut group = c.benchmark_group("recordings");
    group.throughput(Throughput::Bytes(length)).sample_size(10);
    group.bench_function("apitrace", |b| {
        b.iter(|| {
            let (_, report) = open_reported(black_box(&path), &reading).expect("a recording");
            report.expect("a report of a recorded program").calls
        })
    });
    group.finish();
}

criterion_group!(benches, reading);
criterion_main!(benches);
