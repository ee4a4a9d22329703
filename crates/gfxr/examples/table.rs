//! Makes `src/table.txt` from the long layout of calls, structures and constants that comes with a set of captures.
//!
//! `cargo run -p fillrate-gfxr --example table -- vk_layout.txt > crates/gfxr/src/table.txt`
//!
//! The long layout has a line for each constant and repeats the first two members of each structure that can stand in a chain. The
//! table says both once. Its own first lines describe it.

use std::fmt::Write;

const HEAD: &str = "\
# Calls, structures and constants of Vulkan in the order of a capture, from the Khronos registry (vk.xml, Apache-2.0 OR MIT).
# Made by examples/table.rs. Lines: `enum TYPE`, then `VALUE NAME` for each constant; `struct NAME MEMBER:KIND ...`;
# `chain STYPE NAME MEMBER:KIND ...`, a structure whose first members are sType and pNext; `call NUMBER NAME RESULT PARAMETER:KIND ...`.
";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("the long layout is missing")?;
    let text = std::fs::read_to_string(path)?;
    let mut table = HEAD.to_owned();
    let mut open = "";
    for line in text.lines().filter(|line| line.starts_with("enum ")) {
        let [_, kind, value, name] = words::<4>(line)?;
        if kind != open {
            writeln!(table, "enum {kind}")?;
            open = kind;
        }
        writeln!(table, "{value} {name}")?;
    }
    for line in text.lines().filter(|line| line.starts_with("struct ")) {
        let (head, members) = line.split_once(" |").ok_or("a structure has no members")?;
        match head.split(' ').collect::<Vec<_>>()[..] {
            // They stand for any structure of a chain and never occur.
            [_, "VkBaseOutStructure" | "VkBaseInStructure"] => {}
            [_, name] => writeln!(table, "struct {name}{members}")?,
            [_, name, number] => {
                let rest = members.strip_prefix(" sType:enum(VkStructureType) pNext:next").ok_or("a chain begins otherwise")?;
                writeln!(table, "chain {number} {name}{rest}")?;
            }
            _ => return Err(format!("unknown line: {line}").into()),
        }
    }
    for line in text.lines().filter(|line| line.starts_with("call ")) {
        let (head, parameters) = line.split_once(" |").ok_or("a call has no parameters")?;
        let [_, number, name, result] = words::<4>(head)?;
        let number = number.strip_prefix("0x").ok_or("a number is not hexadecimal")?;
        writeln!(table, "call {number} {name} {result}{parameters}")?;
    }
    // The data of an update template are stored in a form of their own.
    for line in table.lines() {
        println!(
            "{}",
            if line.contains("SetWithTemplate") { line.replace("pData:addr", "pData:template") } else { line.to_owned() }
        );
    }
    Ok(())
}

/// The words of a line that has `N`.
fn words<const N: usize>(line: &str) -> Result<[&str; N], String> {
    line.split(' ').collect::<Vec<_>>().try_into().map_err(|_| format!("{N} words expected: {line}"))
}
