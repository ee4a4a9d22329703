//! Bytes of calls per second: a recorded OpenGL program is read, and its calls are run by OpenGL's state machine, as `fillrate inspect` does.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use fillrate::import::open_reported;
use fillrate::trace::Reading;

#[path = "../crates/import/tests/import/recorder.rs"]
mod recorder;

use recorder::Value::{Float, Floats, Uint};
use recorder::Writer;

/// Bytes of calls, about.
const BYTES: usize = 32 << 20;

/// Frames of triangles with a normal, a colour and a position a vertex, half of them given one by one and half as arrays; every 300
/// vertices another matrix.
fn recording() -> (Vec<u8>, u64) {
    let mut stream = Writer::new(5);
    stream.call("glViewport", &[0, 0, 64, 64].map(Uint));
    let mut angle = 0.0;
    while stream.bytes.len() < BYTES {
        stream.call("glClear", &[Uint(16_640)]);
        for part in 0..8 {
            angle += 0.1;
            stream.call("glPushMatrix", &[]);
            stream.call("glRotatef", &[angle, 0.0, 1.0, 0.0].map(Float));
            stream.call("glBegin", &[Uint(4)]);
            for k in 0..300 {
                let at = [k as f32 / 300.0, angle, (k % 7) as f32];
                if part % 2 == 0 {
                    stream.call("glNormal3f", &at.map(Float));
                    stream.call("glColor3f", &at.map(Float));
                    stream.call("glVertex3f", &at.map(Float));
                } else {
                    let at = [Floats(at.to_vec())];
                    stream.call("glNormal3fv", &at);
                    stream.call("glColor3fv", &at);
                    stream.call("glVertex3fv", &at);
                }
            }
            stream.call("glEnd", &[]);
            stream.call("glPopMatrix", &[]);
        }
        stream.call("glXSwapBuffers", &[Uint(1), Uint(2)]);
    }
    (stream.file(1 << 20), stream.bytes.len() as u64)
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
