//! A small assembler of SPIR-V, in the notation of `spirv-dis`.

use std::collections::HashMap;
use std::str::FromStr;

use grammar::{
    AddressingModel, BuiltIn, Capability, Decoration, Dim, ExecutionMode, ExecutionModel, ImageFormat, MemoryModel, Op,
    StorageClass,
};

/// The words of a module of version 1.`minor`.
pub fn assemble(minor: u32, text: &str) -> Vec<u32> {
    let mut ids: HashMap<String, u32> = HashMap::new();
    let mut words = vec![grammar::MAGIC_NUMBER, 0x0001_0000 | minor << 8, 0, 0, 0];
    let names: HashMap<String, u32> =
        (0..7000).filter_map(|code| Some((format!("Op{:?}", Op::from_u32(code)?), code))).collect();
    for line in text.lines() {
        let tokens = tokens(line);
        if tokens.is_empty() {
            continue;
        }
        let mut id = |name: &str| {
            let next = ids.len() as u32 + 1;
            *ids.entry(name.to_owned()).or_insert(next)
        };
        let (result, rest) = match &tokens[..] {
            [result, equals, rest @ ..] if equals == "=" => (Some(id(result)), rest),
            rest => (None, rest),
        };
        let code = *names.get(&rest[0]).unwrap_or_else(|| panic!("no instruction {}", rest[0]));
        let op = Op::from_u32(code).expect("it has a name");
        let mut operands = Vec::new();
        let mut is_builtin = false;
        for (n, token) in rest[1..].iter().enumerate() {
            if let Some(text) = token.strip_prefix('"') {
                let mut bytes = text.as_bytes().to_vec();
                bytes.resize((bytes.len() + 1).next_multiple_of(4), 0);
                operands.extend(bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])));
            } else if token.starts_with('%') {
                operands.push(id(token));
            } else {
                operands.push(number(op, n, token, is_builtin));
            }
            is_builtin = token == "BuiltIn";
        }
        if let Some(result) = result {
            // A value has its type before it; what declares a type, a label or a set of instructions has none.
            let is_typed = !format!("{op:?}").starts_with("Type") && !matches!(op, Op::Label | Op::ExtInstImport | Op::String);
            operands.insert(usize::from(is_typed), result);
        }
        words.push(code | (operands.len() as u32 + 1) << 16);
        words.extend(operands);
    }
    words[3] = ids.len() as u32 + 1;
    words
}

/// Words of a line, with texts behind a quotation mark. A semicolon begins a comment.
fn tokens(line: &str) -> Vec<String> {
    let mut found = Vec::new();
    for (n, piece) in line.split(';').next().unwrap_or_default().split('"').enumerate() {
        if n % 2 == 1 {
            found.push(format!("\"{piece}"));
        } else {
            found.extend(piece.split_whitespace().map(str::to_owned));
        }
    }
    found
}

fn number(op: Op, operand: usize, token: &str, is_builtin: bool) -> u32 {
    if let Ok(number) = token.parse::<i64>() {
        return number as u32;
    }
    if let Ok(number) = token.parse::<f32>() {
        return number.to_bits();
    }
    fn of<T: FromStr>(text: &str, code: impl Fn(T) -> u32) -> Option<u32> {
        text.parse().ok().map(code)
    }
    let found = match (op, operand) {
        _ if is_builtin => of(token, |value: BuiltIn| value as u32),
        (Op::Capability, _) => of(token, |value: Capability| value as u32),
        (Op::MemoryModel, 0) => of(token, |value: AddressingModel| value as u32),
        (Op::MemoryModel, _) => of(token, |value: MemoryModel| value as u32),
        (Op::EntryPoint, _) => of(token, |value: ExecutionModel| value as u32),
        (Op::ExecutionMode | Op::ExecutionModeId, _) => of(token, |value: ExecutionMode| value as u32),
        (Op::Decorate | Op::MemberDecorate | Op::DecorateId, _) => of(token, |value: Decoration| value as u32),
        (Op::TypePointer | Op::Variable, _) => of(token, |value: StorageClass| value as u32),
        (Op::TypeImage, 1) => of(&format!("Dim{token}"), |value: Dim| value as u32),
        (Op::TypeImage, _) => of(token, |value: ImageFormat| value as u32),
        // `OpSpecConstantOp` names the operation without its prefix.
        (Op::SpecConstantOp, _) => (0..700).find(|&code| Op::from_u32(code).is_some_and(|op| format!("{op:?}") == token)),
        _ => None,
    };
    let mask = |token: &str| match token {
        "None" => 0,
        "Bias" | "Volatile" => 1,
        "Lod" | "Aligned" => 2,
        "Grad" => 4,
        "ConstOffset" => 8,
        "Offset" | "MakePointerVisible" => 16,
        "NonPrivatePointer" => 32,
        "Sample" => 64,
        "MinLod" => 128,
        "NonPrivateTexel" => 1024,
        _ => panic!("Op{op:?}: no number {token}"),
    };
    found.unwrap_or_else(|| token.split('|').map(mask).fold(0, |all, bit| all | bit))
}
