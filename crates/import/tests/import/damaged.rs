//! Captures of Vulkan programs that are whole but for some changes: whatever they are, import answers.

use std::path::Path;

use gfxr::{Body, Value};
use trace::Reading;

use super::capture;

/// Numbers that are likely to be wrong.
const NUMBERS: [u64; 12] = [0, 1, 2, 3, 7, 255, 65_536, 0x7fff_ffff, 0x8000_0000, 0xffff_ffff, 1 << 40, u64::MAX];
const FLOATS: [f32; 6] = [f32::NAN, f32::INFINITY, -1.0, 0.0, 1e30, 0.5];
/// Objects of the captures, and one that there is not.
const HANDLES: [u64; 20] = [0, 10, 11, 12, 13, 20, 30, 31, 32, 34, 50, 51, 52, 53, 55, 60, 61, 62, 120, 99];

/// Changes the value that is the `at`th of those that hold no others.
fn change(value: &mut Value, at: &mut usize, by: u8) -> bool {
    match value {
        Value::Array(all) => return all.iter_mut().any(|own| change(own, at, by)),
        Value::Struct(of) => {
            // A structure can be left out as a whole.
            if *at == 0 && by > 250 {
                *value = Value::Null;
                return true;
            }
            return of.members.iter_mut().any(|(_, own)| change(own, at, by));
        }
        _ if *at > 0 => {
            *at -= 1;
            return false;
        }
        _ => {}
    }
    let number = NUMBERS[usize::from(by) % NUMBERS.len()];
    match value {
        Value::U8(own) => *own = number as u8,
        Value::U16(own) => *own = number as u16,
        Value::U32(own) => *own = number as u32,
        Value::I32(own) => *own = number as i32,
        Value::U64(own) => *own = number,
        Value::I64(own) => *own = number as i64,
        Value::F32(own) => *own = FLOATS[usize::from(by) % FLOATS.len()],
        Value::F64(own) => *own = FLOATS[usize::from(by) % FLOATS.len()].into(),
        Value::Handle(own) => *own = HANDLES[usize::from(by) % HANDLES.len()],
        Value::Enum(own) => own.value = number as i32,
        Value::Bytes(own) => own.truncate(usize::from(by)),
        Value::Words(own) if own.len() > 8 && by < 128 => {
            let place = usize::from(by) * own.len() / 128;
            own[place] = own[place].wrapping_add(u32::from(by) << 8);
        }
        Value::Words(own) => own.truncate(usize::from(by) % 8),
        Value::Str(own) => own.clear(),
        _ => {}
    }
    true
}

/// Changes one block: six choices.
fn damage(blocks: &mut Vec<Body>, choices: &[u8]) {
    let choice = |at: usize| choices.get(at).copied().unwrap_or(0);
    let place = |at: usize, blocks: &[Body]| (usize::from(choice(at)) << 8 | usize::from(choice(at + 1))) % blocks.len().max(1);
    let (from, to) = (place(1, blocks), place(3, blocks));
    if blocks.is_empty() {
        return;
    }
    match choice(0) % 8 {
        0 => drop(blocks.remove(from)),
        1 => blocks.insert(to, blocks[from].clone()),
        2 => blocks.swap(from, to),
        _ => match &mut blocks[from] {
            Body::Call(call) => {
                let mut at = usize::from(choice(3)) % 48;
                let _ = call.parameters.iter_mut().any(|(_, value)| change(value, &mut at, choice(5)));
            }
            Body::FillMemory { memory, offset, .. } => {
                let by = usize::from(choice(5));
                (*memory, *offset) = (HANDLES[by % HANDLES.len()], NUMBERS[by % NUMBERS.len()]);
            }
            _ => {}
        },
    }
}

/// Damages a capture as the choices say, and imports it: the answer is a trace, which can be checked, or an error that names a block.
pub fn import_damaged(path: &Path, choices: &[u8]) {
    let (first, rest) = choices.split_first().unwrap_or((&0, &[]));
    let mut capture = match first % 8 {
        0 => capture::cleared_twice(),
        1 => capture::converted(),
        2 => capture::sampled(),
        3 => capture::multisampled_attachment(),
        4 => capture::numbered(naga::BuiltIn::BaseInstance),
        5 => capture::numbered(naga::BuiltIn::DrawIndex),
        6 => capture::dispatched_from(),
        _ => capture::two_passes(true, true),
    };
    rest.chunks(6).take(16).for_each(|choices| damage(&mut capture.blocks, choices));
    std::fs::write(path, capture.bytes()).expect("a file");
    for lenient in [false, true] {
        match import::open_with(path, &Reading { lenient, ..Reading::default() }) {
            // The checker may refuse it, with a message.
            Ok(made) => {
                if let Err(error) = trace::check(&made) {
                    assert!(!error.to_string().is_empty());
                }
            }
            Err(error) => {
                assert!(error.to_string().contains("block "), "without a block: {error}");
                assert!(!lenient || !error.unsupported, "refused all the same: {error}");
            }
        }
    }
}
