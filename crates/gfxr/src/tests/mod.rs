//! Captures that were written are read back, and damaged ones are refused with the place.

mod random;

use crate::layout::layout;
use crate::*;
use proptest::prelude::*;
use random::{Random, chainable};
use std::io::Read;

const COMPRESSIONS: [Compression; 4] = [Compression::None, Compression::Lz4, Compression::Zlib, Compression::Zstd];

fn write(header: Header, bodies: &[Body]) -> Vec<u8> {
    let mut writer = Writer::new(Vec::new(), header).unwrap();
    for body in bodies {
        writer.block(1, body).unwrap_or_else(|error| panic!("{error}\n{body:?}"));
    }
    writer.finish().unwrap()
}

fn read(bytes: &[u8]) -> Vec<Body> {
    let mut reader = Reader::new(bytes).unwrap();
    let bodies = reader.by_ref().map(|block| block.unwrap_or_else(|error| panic!("{error}")).body).collect();
    assert_eq!(reader.cut(), None);
    bodies
}

#[test]
fn every_call_is_read_as_written() {
    let mut refused = Vec::new();
    for of in call_names().filter_map(|name| layout().call_of_name(name)) {
        let calls: Vec<_> =
            (0..4).filter_map(|seed| Random(seed + u64::from(of.number) * 7).call(of)).map(Body::Call).collect();
        if calls.is_empty() {
            refused.push(of.name);
        }
        assert_eq!(read(&write(Header::default(), &calls)), calls, "{}", of.name);
    }
    assert_eq!(refused, [""; 0]);
}

#[test]
fn every_structure_is_read_as_written() {
    let mut refused = Vec::new();
    for of in layout().structs.iter().filter(|of| of.tag.is_some() && chainable(of)) {
        let Some(next) = Random(of.tag.unwrap().into()).structure(of, 0) else {
            refused.push(of.name);
            continue;
        };
        let info = Struct::new("VkBufferCreateInfo").chain(next.clone());
        let call = Body::Call(Call::new("vkCreateBuffer").with("pCreateInfo", info));
        let bodies = read(&write(Header::default(), std::slice::from_ref(&call)));
        assert_eq!(bodies, [call]);
        let Body::Call(call) = &bodies[0] else { panic!() };
        assert_eq!(call.get("pCreateInfo").structure().unwrap().chained(of.name), Some(&next));
    }
    // Their unions have forms that no description says.
    let expected = [
        "VkClusterAccelerationStructureInputInfoNV",
        "VkClusterAccelerationStructureCommandsInfoNV",
        "VkIndirectExecutionSetCreateInfoEXT",
        "VkIndirectCommandsLayoutTokenEXT",
        "VkDescriptorGetInfoEXT",
        "VkResourceDescriptorInfoEXT",
        "VkDescriptorSetAndBindingMappingEXT",
    ];
    assert_eq!(refused, expected);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn what_is_written_is_read_back(seed in any::<u64>(), minor in 0u32..2, compression in 0usize..4) {
        let mut random = Random(seed);
        let header = Header { minor, compression: COMPRESSIONS[compression], ..Header::default() };
        let bodies: Vec<_> = (0..30).map(|_| random.body()).collect();
        let bytes = write(header, &bodies);
        let reader = Reader::new(&bytes[..]).unwrap();
        prop_assert_eq!(reader.header(), &header);
        prop_assert_eq!(read(&bytes), bodies);
    }

    /// Changed bytes give values or errors, and the blocks before them as they were.
    #[test]
    fn damage_is_an_error_at_most(seed in any::<u64>(), compression in 0usize..4) {
        let mut random = Random(seed);
        let header = Header { compression: COMPRESSIONS[compression], ..Header::default() };
        let bodies: Vec<_> = (0..6).map(|_| random.body()).collect();
        let whole = write(header, &bodies);
        let starts: Vec<_> = Reader::new(&whole[..]).unwrap().map(|block| block.unwrap().offset).collect();
        let ends: Vec<_> = starts.into_iter().skip(1).chain([whole.len() as u64]).collect();
        for _ in 0..40 {
            let mut bytes = whole.clone();
            let at = random.below(bytes.len() as u64) as usize;
            bytes[at] ^= 1 << random.below(8);
            let Ok(reader) = Reader::new(&bytes[..]) else { continue };
            let blocks: Vec<_> = reader.with_limits(Limits { block: 1 << 20, data: 1 << 20 }).collect();
            prop_assert!(blocks.iter().all(|block| block.as_ref().map_or_else(|error| error.block.is_some(), |_| true)));
            let before = ends.iter().filter(|end| at >= 24 && **end <= at as u64).count();
            for (block, body) in blocks[..before].iter().zip(&bodies) {
                prop_assert_eq!(&block.as_ref().unwrap().body, body);
            }
        }
    }
}

/// The stack of a thread of a test holds the longest chain that is read.
#[test]
fn long_chains_are_read_as_written() {
    let mut info = Struct::new("VkBufferCreateInfo");
    for size in 0..511u64 {
        let mut link = Struct::new("VkBufferCreateInfo").with("size", size);
        link.members[1].1 = std::mem::replace(&mut info.members[1].1, Value::Null);
        info.members[1].1 = Value::Struct(link);
    }
    let call = Body::Call(Call::new("vkCreateBuffer").with("pCreateInfo", info));
    let bodies = read(&write(Header::default(), std::slice::from_ref(&call)));
    assert_eq!(bodies, [call]);
    let Body::Call(call) = &bodies[0] else { panic!() };
    let info = call.get("pCreateInfo").value().structure().unwrap();
    assert_eq!(info.next().count(), 511);
    assert_eq!(info.next().last().unwrap().get("size").u64(), Ok(0));
}

/// A capture of three frames as a program would make it.
fn small(header: Header) -> Vec<u8> {
    let extensions = Value::from(vec!["VK_KHR_swapchain"]);
    let mut bodies = vec![
        Body::Call(Call::new("vkCreateInstance").with("pInstance", 1u64)),
        Body::Call(Call::new("vkCreateDevice").with("physicalDevice", 2u64).with(
            "pCreateInfo",
            Struct::new("VkDeviceCreateInfo").with("ppEnabledExtensionNames", extensions).with("enabledExtensionCount", 1),
        )),
        Body::FillMemory { memory: 9, offset: 0, data: vec![7; 3000] },
    ];
    for _ in 0..3 {
        bodies.push(Body::Call(Call::new("vkQueuePresentKHR").with("queue", 3u64)));
    }
    write(header, &bodies)
}

#[test]
fn a_capture_that_ends_early_gives_its_whole_blocks() {
    for compression in COMPRESSIONS {
        let bytes = small(Header { compression, ..Header::default() });
        let blocks: Vec<_> = Reader::new(&bytes[..]).unwrap().map(|block| block.unwrap()).collect();
        for end in 24..bytes.len() {
            let mut reader = Reader::new(&bytes[..end]).unwrap();
            let found: Vec<_> = reader.by_ref().map(|block| block.unwrap()).collect();
            let whole = blocks
                .iter()
                .skip(1)
                .map(|block| block.offset)
                .chain([bytes.len() as u64])
                .filter(|next| *next <= end as u64)
                .count();
            assert_eq!(found[..], blocks[..whole]);
            let begin = blocks[whole].offset;
            let cut = (begin < end as u64).then_some(Cut { offset: begin, found: end as u64 - begin });
            assert_eq!(reader.cut(), cut);
            assert!(reader.next_block().unwrap().is_none());
        }
        for end in 0..24 {
            let error = Reader::new(&bytes[..end]).unwrap_err();
            assert!(matches!(error.cause, Cause::Magic | Cause::Header), "{error}");
        }
    }
}

/// Gives the bytes of a capture again and again, and counts them.
struct Endless {
    head: Vec<u8>,
    block: Vec<u8>,
    given: usize,
}

impl Read for Endless {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let from = if self.given < self.head.len() {
            &self.head[self.given..]
        } else {
            &self.block[(self.given - self.head.len()) % self.block.len()..]
        };
        let count = from.len().min(buffer.len());
        buffer[..count].copy_from_slice(&from[..count]);
        self.given += count;
        Ok(count)
    }
}

#[test]
fn a_reader_takes_no_more_than_it_gives() {
    let head = write(Header::default(), &[]);
    let block =
        write(Header::default(), &[Body::FillMemory { memory: 1, offset: 0, data: vec![1; 100_000] }])[head.len()..].to_vec();
    let length = block.len();
    let mut reader = Reader::new(Endless { head, block, given: 0 }).unwrap();
    for count in 1..=20 {
        assert!(reader.next_block().unwrap().is_some());
        assert!(reader.position() <= (count * length + 24) as u64);
        let (input, held) = reader.state();
        assert!(input.given <= count * length + (1 << 17), "block {count}: {} bytes are read", input.given);
        assert!(held <= 2 * length, "{held} bytes are held");
    }
}

/// The error of the only block of a capture whose call has these bytes as parameters.
fn error_of(name: &str, parameters: &[u8]) -> String {
    let number = layout().call_of_name(name).unwrap().number;
    let body = [&number.to_le_bytes()[..], &1u64.to_le_bytes(), parameters].concat();
    let bytes = [&write(Header::default(), &[])[..], &(body.len() as u64).to_le_bytes(), &4u32.to_le_bytes(), &body].concat();
    Reader::new(&bytes[..]).unwrap().next_block().unwrap_err().to_string()
}

#[test]
fn errors_name_block_call_and_member() {
    let words = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<_>>();
    assert_eq!(error_of("vkCmdDraw", &[0; 22]), "block 0 at byte 24, vkCmdDraw, firstInstance: the data end here");
    assert_eq!(error_of("vkCmdDraw", &[0; 25]), "block 0 at byte 24, vkCmdDraw: 1 bytes are left after the last value");
    assert_eq!(
        error_of("vkQueueSubmit", &words(&[1, 0, 1, 0xa4, u32::MAX, u32::MAX])),
        "block 0 at byte 24, vkQueueSubmit, pSubmits: a length of 18446744073709551615 exceeds the data"
    );
    assert_eq!(
        error_of("vkQueueSubmit", &words(&[1, 0, 1, 0xa4, 1, 0, 4, 0xa2, 123_456_789, 0])),
        "block 0 at byte 24, vkQueueSubmit, pSubmits[0].pNext[0]: structure type 123456789 is not known"
    );
    assert_eq!(
        error_of("vkQueueSubmit", &words(&[1, 0, 1, 0x88, 1, 0])),
        "block 0 at byte 24, vkQueueSubmit, pSubmits: the attributes 0x88 do not fit the type"
    );
    let deep = [words(&[1, 0, 0xa2]), words(&[12, 0xa2]).repeat(5000)].concat();
    let error = error_of("vkCreateBuffer", &deep);
    assert!(error.ends_with(": values are nested more than 512 deep"), "{error}");
    assert!(error.len() < 300, "{error}");
}

#[test]
fn headers_and_limits_are_checked() {
    let header = |words: [u32; 5]| [&MAGIC[..], &words.map(u32::to_le_bytes).concat()].concat();
    let error = |bytes: &[u8]| Reader::new(bytes).unwrap_err().to_string();
    assert_eq!(error(b"PK\x03\x04"), "byte 4: this is no capture by GFXReconstruct");
    assert_eq!(error(&header([0, 2, 1, 1, 0])), "byte 16: version 0.2 of the format is not supported, only 0.0 and 0.1");
    assert_eq!(error(&header([0, 0, 65, 1, 0])), "byte 16: the header has 65 options");
    assert_eq!(error(&header([0, 0, 1, 1, 9])), "byte 24: compression 9 is not known");
    assert_eq!(error(&header([0, 0, 1, 1, 0])[..19]), "byte 16: the file ends in its header");

    let first = |bytes: &[u8], limits: Limits| {
        Reader::new(bytes).unwrap().with_limits(limits).next_block().map(drop).map_err(|error| error.to_string())
    };
    let limits = Limits { block: 2000, data: 2000 };
    let fill = [Body::FillMemory { memory: 1, offset: 0, data: vec![3; 3000] }];
    assert_eq!(
        first(&write(Header::default(), &fill), limits).unwrap_err(),
        "block 0 at byte 24: 3036 bytes exceed the limit of 2000"
    );
    for compression in &COMPRESSIONS[1..] {
        let mut bytes = write(Header { compression: *compression, ..Header::default() }, &fill);
        assert_eq!(first(&bytes, limits).unwrap_err(), "block 0 at byte 24, FillMemory: 3000 bytes exceed the limit of 2000");
        // A block that says that it is larger than it is.
        bytes[64..72].copy_from_slice(&(1u64 << 30).to_le_bytes());
        first(&bytes, Limits::default()).unwrap_err();
    }
    // A compressed block in a file without compression.
    let mut bytes = write(Header { compression: Compression::Zlib, ..Header::default() }, &fill);
    bytes[20] = 0;
    let error = first(&bytes, Limits::default()).unwrap_err();
    assert_eq!(error, "block 0 at byte 24, FillMemory: the block is compressed, and the header names no compression");
}

#[test]
fn accessors_name_the_member() {
    let call = Call::new("vkCmdDraw").with("vertexCount", 3);
    assert_eq!(call.get("vertexCount").u32(), Ok(3));
    let error = call.get("vertexCount").structure().unwrap_err().to_string();
    assert_eq!(error, "vkCmdDraw::vertexCount: a number without a sign where a structure is expected");
    let info = Struct::new("VkSubmitInfo").with("pWaitDstStageMask", vec![1u32, 2]);
    assert_eq!(info.get("pWaitDstStageMask").words(), Ok(&[1, 2][..]));
    assert!(info.get("pWaitSemaphores").is_null());
    assert_eq!(info.get("pWaitSemaphores").handles(), Ok(vec![]));
    let usage = "VK_BUFFER_USAGE_VERTEX_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT";
    let info = Struct::new("VkBufferCreateInfo").with("usage", usage).with("sharingMode", "VK_SHARING_MODE_CONCURRENT");
    assert_eq!(info.get("usage").u32(), Ok(0x82));
    assert_eq!(info.get("sharingMode").constant().unwrap().name(), Some("VK_SHARING_MODE_CONCURRENT"));
}
