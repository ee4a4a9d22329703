//! The rules that hold for any bytes.

use gfxr::{Body, Cause, Contents, Header, Limits, Reader, Writer};

/// Bytes that a block may have.
const LIMITS: Limits = Limits { block: 1 << 22, data: 1 << 22 };

/// Reads bytes as a capture. What is read is shown, and written and reads back the same; what is not has its place.
pub fn read_everything(data: &[u8]) {
    let Ok(reader) = Reader::new(data) else { return };
    let mut reader = reader.with_limits(LIMITS);
    let header = *reader.header();
    let mut blocks = Vec::new();
    for block in reader.by_ref() {
        match block {
            Ok(block) => blocks.push(block),
            Err(error) => assert!(error.block.is_some() && !error.to_string().is_empty()),
        }
    }
    let mut writer = Writer::new(Vec::new(), Header { compression: gfxr::Compression::None, ..header }).expect("memory");
    blocks.retain(|block| match writer.block(block.thread, &block.body) {
        Ok(()) => true,
        // What is no UTF-8 takes more bytes once it was replaced.
        Err(error) => {
            assert!(matches!((&block.body, error.cause), (Body::ExeFile(_) | Body::Driver(_), Cause::Value(_))));
            false
        }
    });
    let bytes = writer.finish().expect("memory");
    let again: Vec<_> = Reader::new(&bytes[..]).expect("a header").map(|block| block.expect("a block")).collect();
    assert_eq!(again.len(), blocks.len());
    for (block, again) in blocks.iter().zip(&again) {
        assert_eq!((block.thread, &block.body), (again.thread, &again.body));
        if let Body::Call(call) = &block.body {
            assert!(call.to_string().starts_with(call.name));
        }
    }
    let contents = Contents::read(&mut Reader::new(data).expect("a header").with_limits(LIMITS));
    assert!(contents.blocks >= blocks.len() as u64);
}
