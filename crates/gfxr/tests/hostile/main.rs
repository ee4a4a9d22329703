//! Damaged captures. The fuzz target `gfxr_reader` does the same without an end.

mod oracle;
mod sample;

use gfxr::{Compression, Contents, Header, Reader, version_text};
use proptest::prelude::*;
use std::sync::LazyLock;

static SAMPLES: LazyLock<Vec<Vec<u8>>> = LazyLock::new(sample::all);

#[test]
fn samples_are_read() {
    SAMPLES.iter().for_each(|sample| oracle::read_everything(sample));
}

#[test]
fn contents_are_those_of_the_samples() {
    let read = |bytes: &[u8]| Contents::read(&mut Reader::new(bytes).expect("a header"));
    let header = Header { compression: Compression::Zstd, ..Header::default() };
    let contents = read(&sample::triangle(header));
    assert_eq!((contents.blocks, contents.all_calls(), contents.frames), (15, 15, 3));
    assert_eq!(contents.applications[0].name, "triangle");
    assert_eq!(version_text(contents.applications[0].api_version), "1.3.0");
    assert_eq!(
        (&contents.instance_extensions[..], &contents.device_extensions[..]),
        (&["VK_KHR_surface".to_owned()][..], &["VK_KHR_swapchain".to_owned()][..])
    );
    assert_eq!((contents.windows[0].surface, contents.windows[0].swapchains[0].0), (4, [320, 240]));
    assert_eq!((contents.shaders, contents.shader_bytes, contents.first_frame), (1, 20, None));
    // Presents end no frames in version 0.1: its markers do.
    assert_eq!(read(&sample::triangle(Header { minor: 1, ..header })).frames, 0);
    let contents = read(&sample::blocks(Header { minor: 1, ..header }));
    assert_eq!((contents.blocks, contents.all_calls(), contents.frames, contents.first_frame), (21, 1, 1, Some(3)));
    assert_eq!((contents.data_bytes, &*contents.devices[0].name), (920, "card"));
    assert_eq!((contents.others["InitImage"], contents.others["state marker"], contents.unknown[&0x1_ffff]), (1, 2, 1));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_samples_are_refused_or_read(
        sample in any::<prop::sample::Index>(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), prop_oneof![any::<u8>(), Just(0), Just(0xff)]), 1..5),
        end in any::<prop::sample::Index>(),
        cut in any::<bool>(),
    ) {
        let mut bytes = sample.get(&SAMPLES).clone();
        for (place, byte) in changes {
            let place = place.index(bytes.len());
            bytes[place] = byte;
        }
        if cut {
            bytes.truncate(end.index(bytes.len()));
        }
        oracle::read_everything(&bytes);
    }
}
