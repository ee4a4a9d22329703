//! Accepted programs, refused programs, and damaged ones.

use super::lex::ProgramLocation;
use super::parse::parse;
use super::program::*;
use crate::glsl::stage::way;

const VERTEX: &str = "!!ARBvp1.0 # a comment\nATTRIB p = vertex.position;\nPARAM m[4] = { state.matrix.mvp };\nTEMP r;\n\
                      DP4 r.x, m[0], p;\nDP4 r.y, m[1], p;\nMOV result.position, r;\nMOV result.color, vertex.color;\nEND\nnot read";
const FRAGMENT: &str = "!!ARBfp1.0\nOPTION ARB_fog_exp2;\nTEMP t;\nTXB t, fragment.texcoord[2], texture[1], RECT;\n\
                        MAD_SAT result.color.rgb, -t.x, {0.5, 1}, fragment.color.secondary;\nEND";

#[test]
fn a_program_is_read_as_it_is_written() {
    let vertex = parse(VERTEX, ProgramStage::Vertex).expect("a program");
    assert_eq!(vertex.inputs, 1 << input::POSITION | 1 << input::COLOR);
    assert_eq!(vertex.outputs, [Output::Position, Output::Color(0)]);
    let row = |row| Param::Row { matrix: Matrix::Mvp, inverse: false, transpose: false, row };
    assert_eq!(vertex.params, [row(0), row(1), row(2), row(3)]);
    let second = &vertex.instructions[1];
    let to = second.destination.expect("a destination");
    assert_eq!((second.name, to.register, to.mask), ("DP4", Register::Temp(0), [false, true, false, false]));
    assert_eq!(second.sources[0].register, Register::Param(1));

    let fragment = parse(FRAGMENT, ProgramStage::Fragment).expect("a program");
    let rectangle = 2;
    let image = Image { unit: 1, target: rectangle, ways: way::BIAS };
    assert_eq!((&fragment.images[..], fragment.fog), (&[image][..], Some(0x801)));
    assert_eq!(fragment.inputs, 1 << input::FOG | 1 << (input::TEXTURE + 2) | 1 << input::SECONDARY);
    assert_eq!(fragment.params, [Param::Literal([0.5, 1.0, 0.0, 1.0])]);
    let last = &fragment.instructions[1];
    assert!(last.saturate && last.sources[0].negate == [true; 4] && last.sources[0].swizzle == [0; 4]);
    let mut text = String::new();
    super::wgsl::body(&fragment, "params", &[1], &mut text);
    assert!(text.contains("t0_t = texel1(in_texture2.xyz, in_texture2.w);"), "{text}");
    let sum = "let v = saturate((-t0_t.xxx * vec4f(0.5, 1.0, 0.0, 1.0).xyz + in_secondary.xyz));";
    assert!(text.contains(sum), "{text}");
}

#[test]
fn a_damaged_program_ends_with_a_program_or_a_place() {
    let mut wrong = 0;
    for (text, stage) in [(VERTEX, ProgramStage::Vertex), (FRAGMENT, ProgramStage::Fragment)] {
        for at in 0..text.len() {
            for letter in ["", "[", "9", ".", "x", "-", "\u{e9}", "\0", "..", "{"] {
                let damaged = format!("{}{letter}{}", &text[..at], &text[at + 1..]);
                if let Err(error) = parse(&damaged, stage) {
                    assert!(error.place != ProgramLocation::default() && !error.reason.is_empty());
                    wrong += 1;
                }
            }
        }
    }
    assert!(wrong > 1000, "{wrong} of them are wrong");
}
