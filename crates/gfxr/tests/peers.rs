//! Recorded programs. They are not part of the repository: set `FILLRATE_PEERS` to the folder that holds `vulkan/`.

use gfxr::{Body, Compression, Header, Marker, Reader, Value, Writer};
use serde_json::Value as Json;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The folder of captures, and the captures.
fn peers() -> Option<(PathBuf, Vec<PathBuf>)> {
    let Some(root) = std::env::var_os("FILLRATE_PEERS") else {
        eprintln!("left out: FILLRATE_PEERS is not set, so there are no captures of Vulkan programs to read");
        return None;
    };
    let root = Path::new(&root).join("vulkan");
    let entries = std::fs::read_dir(&root).expect("the folder of captures").map(|entry| entry.expect("an entry").path());
    let mut files: Vec<PathBuf> = entries
        .filter(|path| path.is_dir())
        .map(|path| path.join(path.file_name().expect("a name")).with_extension("gfxr"))
        .collect();
    files.sort();
    assert!(!files.is_empty(), "no captures in FILLRATE_PEERS/vulkan");
    Some((root, files))
}

fn open(path: &Path) -> Reader<File> {
    Reader::new(File::open(path).expect("a capture")).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The blocks are those that were counted when the captures were made, and a capture that is written again reads the same.
#[test]
fn every_capture_is_read_and_written() {
    for path in peers().into_iter().flat_map(|(_, files)| files) {
        let counted = std::fs::read_to_string(path.with_file_name("features.json")).expect("counts");
        let counted: Json = serde_json::from_str(&counted).expect("JSON");
        let counted: BTreeMap<String, u64> = serde_json::from_value(counted["calls"].clone()).expect("counts of calls");
        let mut reader = open(&path);
        let header = *reader.header();
        let (mut counts, mut blocks) = (BTreeMap::new(), Vec::new());
        for block in reader.by_ref() {
            let block = block.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
            let name = match &block.body {
                Body::Call(call) => call.name.to_owned(),
                Body::Annotation { label, .. } => format!("annotation {label}"),
                Body::State { marker: Marker::Begin, .. } => "state begin".to_owned(),
                Body::State { marker: Marker::End, .. } => "state end".to_owned(),
                body => format!("meta {}", body.name()),
            };
            *counts.entry(name).or_insert(0) += 1;
            blocks.push(block);
        }
        assert_eq!(reader.cut(), None);
        assert_eq!(counts, counted, "{}", path.display());

        let size = std::fs::metadata(&path).expect("a file").len();
        for compression in [header.compression, Compression::None] {
            let mut writer = Writer::new(Vec::new(), Header { compression, ..header }).expect("a header");
            for block in &blocks {
                writer.block(block.thread, &block.body).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
            }
            let bytes = writer.finish().expect("memory");
            if compression == header.compression && compression == Compression::None {
                assert_eq!(bytes.len() as u64, size, "{}", path.display());
            }
            let mut again = Reader::new(&bytes[..]).expect("a capture");
            for block in &blocks {
                let found = again.next_block().unwrap_or_else(|error| panic!("{}: {error}", path.display())).expect("a block");
                assert!(found.body == block.body && found.thread == block.thread, "{}, block {}", path.display(), block.index);
            }
            assert!(again.next_block().expect("the end").is_none());
        }
    }
}

/// All values are those that the Python reader beside the captures gives. Bytes are compared by their checksum.
#[test]
#[ignore = "it runs Python for about two minutes"]
fn values_are_those_of_the_python_reader() {
    const SCRIPT: &str = "
import sys, struct, zlib
sys.path.insert(0, sys.argv[1])
import read_gfxr as reader
plain = reader.plain
def exact(v):
    if isinstance(v, (bytes, bytearray)): return '%08x' % zlib.crc32(v)
    if isinstance(v, float): return struct.pack('>d', v).hex()
    return plain(v)
reader.plain = exact
sys.argv = ['read_gfxr.py', '--json', sys.argv[2]]
reader.main()
";
    let (mut calls, mut values) = (0, 0);
    for (root, path) in peers().into_iter().flat_map(|(root, files)| files.into_iter().map(move |file| (root.clone(), file))) {
        let mut python = Command::new("python3");
        let mut python = python.args(["-c", SCRIPT]).arg(&root).arg(&path).stdout(Stdio::piped()).spawn().expect("Python");
        let mut lines = BufReader::new(python.stdout.take().expect("a pipe")).lines();
        for block in open(&path) {
            let block = block.expect("a block");
            let json: Json = serde_json::from_str(&lines.next().expect("a line").expect("text")).expect("JSON");
            let place = format!("{}, block {}, {}", path.display(), block.index, block.body.name());
            assert_eq!(json["index"], block.index, "{place}");
            let args = json["args"].as_object().expect("an object");
            match &block.body {
                Body::Call(call) => {
                    calls += 1;
                    assert_eq!(json["name"], call.name, "{place}");
                    values += call.result.as_ref().map_or(0, |result| same(result, &json["result"], &place));
                    assert_eq!(args.len(), call.parameters.len(), "{place}");
                    for ((name, value), (key, json)) in call.parameters.iter().zip(args) {
                        assert_eq!(name, key, "{place}");
                        values += same(value, json, &format!("{place}, {name}"));
                    }
                }
                body => values += same_fields(body, args, &place),
            }
        }
        assert!(lines.next().is_none(), "{}", path.display());
        assert!(python.wait().expect("Python").success());
    }
    eprintln!("{calls} calls and {values} values agree");
}

/// Compares a value, and gives how many numbers, strings and arrays of bytes it holds.
fn same(value: &Value, json: &Json, place: &str) -> u64 {
    let number = |number: i128| {
        let found = json.as_i64().map(i128::from).or(json.as_u64().map(i128::from));
        assert_eq!(found, Some(number), "{place}");
        1
    };
    let checksum = |bytes: &[u8]| {
        assert_eq!(json.as_str(), Some(&*format!("{:08x}", crc32fast::hash(bytes))), "{place}");
        1
    };
    let list = |values: &[Value]| match json {
        Json::Array(list) => {
            assert_eq!(values.len(), list.len(), "{place}");
            values
                .iter()
                .zip(list)
                .enumerate()
                .map(|(index, (value, json))| same(value, json, &format!("{place}[{index}]")))
                .sum()
        }
        // An array that is stored as a single value.
        single => {
            assert_eq!(values.len(), 1, "{place}");
            same(&values[0], single, place)
        }
    };
    match value {
        Value::Null => assert!(json.is_null(), "{place}: {json}"),
        Value::Omitted(count) => {
            assert!(json[0].as_str().is_some_and(|text| text.starts_with("no ")) && json[1] == *count, "{place}: {json}")
        }
        Value::U8(value) => return number((*value).into()),
        Value::U16(value) => return number((*value).into()),
        Value::U32(value) => return number((*value).into()),
        Value::I32(value) => return number((*value).into()),
        Value::U64(value) | Value::Handle(value) => return number((*value).into()),
        Value::I64(value) => return number((*value).into()),
        Value::F32(value) => assert_eq!(json.as_str(), Some(&*format!("{:016x}", f64::from(*value).to_bits())), "{place}"),
        Value::F64(value) => assert_eq!(json.as_str(), Some(&*format!("{:016x}", value.to_bits())), "{place}"),
        Value::Enum(value) => match value.name() {
            Some(name) => assert_eq!(json, name, "{place}"),
            None => return number(value.value.into()),
        },
        Value::Bytes(bytes) => return checksum(bytes),
        Value::Words(words) if json.is_array() => return list(&words.iter().map(|word| Value::U32(*word)).collect::<Vec<_>>()),
        Value::Words(words) => return checksum(&words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<_>>()),
        Value::Str(text) => assert_eq!(json, text, "{place}"),
        Value::Array(values) => return list(values),
        Value::Struct(structure) => {
            let object = json.as_object().unwrap_or_else(|| panic!("{place}: {json}"));
            if structure.name == "UpdateTemplateData" {
                let names = ["images", "buffers", "texel_views"];
                assert_eq!(object.len(), names.len());
                let members = structure.members.iter().zip(names);
                return members.map(|((_, value), name)| same(value, &object[name], place)).sum();
            }
            assert_eq!(object.len(), structure.members.len(), "{place}");
            let members = structure.members.iter().zip(object);
            return members
                .map(|((name, value), (key, json))| {
                    assert_eq!(name, key, "{place}");
                    same(value, json, &format!("{place}.{name}"))
                })
                .sum();
        }
    }
    1
}

/// Compares what is not a call.
fn same_fields(body: &Body, args: &serde_json::Map<String, Json>, place: &str) -> u64 {
    let fields: Vec<(&str, Value)> = match body {
        Body::FillMemory { memory, offset, data } => {
            vec![("memory", (*memory).into()), ("offset", (*offset).into()), ("data", Value::Bytes(data.clone()))]
        }
        Body::InitBuffer { device, buffer, data } => {
            vec![("device", (*device).into()), ("buffer", (*buffer).into()), ("data", Value::Bytes(data.clone()))]
        }
        Body::InitImage { device, image, aspect, layout, levels, data } => vec![
            ("device", (*device).into()),
            ("image", (*image).into()),
            ("aspect", (*aspect).into()),
            ("layout", (*layout).into()),
            ("level_sizes", levels.clone().into()),
            ("data", Value::Bytes(data.clone())),
        ],
        Body::ResizeWindow { surface, width, height, .. } => {
            vec![("surface", (*surface).into()), ("width", (*width).into()), ("height", (*height).into())]
        }
        Body::SwapchainImages { device, swapchain, last_presented, images } => {
            let names = ["image", "index", "layout", "acquired", "device_mask", "semaphore", "fence", "queue"];
            let mut agreed = 0;
            for (image, json) in images.iter().zip(args["images"].as_array().expect("images")) {
                let values: [Value; 8] = [
                    image.image.into(),
                    image.index.into(),
                    image.layout.into(),
                    image.acquired.into(),
                    image.device_mask.into(),
                    image.semaphore.into(),
                    image.fence.into(),
                    image.queue.into(),
                ];
                agreed += names.iter().zip(&values).map(|(name, value)| same(value, &json[*name], place)).sum::<u64>();
            }
            let count = images.len() as u32;
            let names = ["device", "swapchain", "last_presented", "count"];
            let values: [Value; 4] = [(*device).into(), (*swapchain).into(), (*last_presented).into(), count.into()];
            return agreed + names.iter().zip(&values).map(|(name, value)| same(value, &args[*name], place)).sum::<u64>();
        }
        Body::BeginResources { device, size, largest_copy } => {
            vec![("device", (*device).into()), ("total", (*size).into()), ("max", (*largest_copy).into())]
        }
        Body::EndResources { device } => vec![("device", (*device).into())],
        Body::DeviceProperties(of) => vec![
            ("physical", of.physical_device.into()),
            ("api", of.api_version.into()),
            ("driver", of.driver_version.into()),
            ("vendor", of.vendor.into()),
            ("id", of.device.into()),
            ("type", of.device_type.into()),
            ("name", of.name.clone().into()),
        ],
        Body::MemoryProperties { physical_device, types, heaps } => vec![
            ("physical", (*physical_device).into()),
            ("memory_types", types.iter().map(|(flags, heap)| [*flags, *heap]).collect::<Vec<_>>().into()),
            ("memory_heaps", heaps.iter().map(|(size, flags)| [*size, u64::from(*flags)]).collect::<Vec<_>>().into()),
        ],
        Body::State { number, .. } => vec![("frame", (*number).into())],
        Body::Annotation { form, text, .. } => vec![("type", (*form).into()), ("text", text.clone().into())],
        _ => vec![],
    };
    fields.iter().map(|(name, value)| same(value, &args[*name], &format!("{place}, {name}"))).sum()
}
