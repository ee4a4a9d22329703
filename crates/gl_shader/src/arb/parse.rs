//! The parser of ARB_vertex_program 1.0 and ARB_fragment_program 1.0.

use std::collections::BTreeMap;

use super::lex::{ProgramLocation, Word, Wrong, words};
use super::program::*;
use crate::consts as e;
use crate::glsl::stage::way;
use crate::{STAGE_IMAGES, TARGETS};

/// Maximum number of instructions, of temporaries and of parameters of a program.
const MOST: usize = 1 << 14;

/// Instructions: name, operands (`v` a vector, `s` a scalar), and the stages that have them: 1 vertex, 2 fragment, 3 both.
const INSTRUCTIONS: &[(&str, &str, u8)] = &[
    ("ABS", "v", 3),
    ("ADD", "vv", 3),
    ("CMP", "vvv", 2),
    ("COS", "s", 2),
    ("DP3", "vv", 3),
    ("DP4", "vv", 3),
    ("DPH", "vv", 3),
    ("DST", "vv", 3),
    ("EX2", "s", 3),
    ("EXP", "s", 1),
    ("FLR", "v", 3),
    ("FRC", "v", 3),
    ("LG2", "s", 3),
    ("LIT", "v", 3),
    ("LOG", "s", 1),
    ("LRP", "vvv", 2),
    ("MAD", "vvv", 3),
    ("MAX", "vv", 3),
    ("MIN", "vv", 3),
    ("MOV", "v", 3),
    ("MUL", "vv", 3),
    ("POW", "ss", 3),
    ("RCP", "s", 3),
    ("RSQ", "s", 3),
    ("SCS", "s", 2),
    ("SGE", "vv", 3),
    ("SIN", "s", 2),
    ("SLT", "vv", 3),
    ("SUB", "vv", 3),
    ("XPD", "vv", 3),
];

/// The meaning of a name.
#[derive(Clone)]
pub(super) enum Named {
    Temp(usize),
    Address(usize),
    Input(u32),
    Output(Output),
    /// First parameter, and their number; none: not an array.
    Param(usize, Option<usize>),
}

/// The state of the parser.
pub(super) struct Parser {
    words: Vec<(Word, ProgramLocation)>,
    pub(super) at: usize,
    pub(super) names: BTreeMap<String, Named>,
    pub(super) program: Program,
    /// Whether textures of depths may be compared.
    shadow: bool,
}

type ParseResult<T = ()> = Result<T, Wrong>;

/// Reads a program; `wanted` is the stage that it is bound to.
pub fn parse(text: &str, wanted: ProgramStage) -> ParseResult<Program> {
    let text = text.trim_start_matches(['\u{feff}', ' ', '\t', '\r', '\n']);
    let start = ProgramLocation { line: 1, column: 1 };
    let (header, stage) = match text.get(..10) {
        Some("!!ARBvp1.0") => (10, ProgramStage::Vertex),
        Some("!!ARBfp1.0") => (10, ProgramStage::Fragment),
        _ => {
            let first: String = text.lines().next().unwrap_or("").chars().take(24).collect();
            return Err(Wrong { place: start, reason: format!("begins with {first:?}, not with !!ARBvp1.0 or !!ARBfp1.0") });
        }
    };
    if stage != wanted {
        return Err(Wrong { place: start, reason: "a program of the other stage".into() });
    }
    // The header is replaced by blanks, so columns do not change.
    let body = format!("{}{}", " ".repeat(header), &text[header..]);
    let program = Program::new(stage);
    let mut parser = Parser { words: words(&body)?, at: 0, names: BTreeMap::new(), program, shadow: false };
    parser.whole()?;
    Ok(parser.program)
}

impl Parser {
    pub(super) fn fail<T>(&self, reason: impl Into<String>) -> ParseResult<T> {
        // The place is that of the last word that was read, or of the current word.
        Err(Wrong { place: self.words[self.at.min(self.words.len() - 1)].1, reason: reason.into() })
    }

    pub(super) fn fail_at<T>(&self, place: ProgramLocation, reason: impl Into<String>) -> ParseResult<T> {
        Err(Wrong { place, reason: reason.into() })
    }

    pub(super) fn peek(&self) -> &Word {
        &self.words[self.at].0
    }

    pub(super) fn place(&self) -> ProgramLocation {
        self.words[self.at].1
    }

    pub(super) fn next(&mut self) -> Word {
        let word = self.words[self.at].0.clone();
        self.at = (self.at + 1).min(self.words.len() - 1);
        word
    }

    pub(super) fn take(&mut self, sign: char) -> bool {
        let found = *self.peek() == Word::Sign(sign);
        if found {
            self.next();
        }
        found
    }

    pub(super) fn expect(&mut self, sign: char) -> ParseResult {
        if self.take(sign) { Ok(()) } else { self.fail(format!("`{sign}` is missing before {}", self.peek())) }
    }

    pub(super) fn name(&mut self) -> ParseResult<String> {
        match self.peek().clone() {
            Word::Name(name) => {
                self.next();
                Ok(name)
            }
            other => self.fail(format!("{other} where a name is needed")),
        }
    }

    /// The name after a `.`, if it is one of these; nothing is read otherwise.
    pub(super) fn member(&mut self, wanted: &[&str]) -> Option<usize> {
        let (Word::Sign('.'), Some((Word::Name(name), _))) = (self.peek(), self.words.get(self.at + 1)) else { return None };
        let found = wanted.iter().position(|wanted| wanted == name)?;
        self.at += 2;
        Some(found)
    }

    /// As [`Parser::member`]; any other name is an error.
    pub(super) fn must(&mut self, wanted: &[&str]) -> ParseResult<usize> {
        match self.member(wanted) {
            Some(found) => Ok(found),
            None => self.fail(format!("after this one of {} must follow", wanted.join(", "))),
        }
    }

    /// An integer below `most`.
    pub(super) fn index(&mut self, most: u32, what: &str) -> ParseResult<u32> {
        match *self.peek() {
            Word::Number(number, true) if number < most as f32 => {
                self.next();
                Ok(number as u32)
            }
            _ => self.fail(format!("{} is no number of a {what}: there are {most}", self.peek())),
        }
    }

    /// `[n]`, or 0 if there is none.
    pub(super) fn bracket(&mut self, most: u32, what: &str) -> ParseResult<u32> {
        if !self.take('[') {
            return Ok(0);
        }
        let index = self.index(most, what)?;
        self.expect(']')?;
        Ok(index)
    }

    /// `[n]` or `[n..m]`.
    pub(super) fn range(&mut self, most: u32, what: &str) -> ParseResult<std::ops::Range<u32>> {
        self.expect('[')?;
        let first = self.index(most, what)?;
        let mut last = first;
        if *self.peek() == Word::Range {
            self.next();
            last = self.index(most, what)?;
            if last < first {
                return self.fail(format!("a range from {first} to {last}"));
            }
        }
        self.expect(']')?;
        Ok(first..last + 1)
    }

    fn whole(&mut self) -> ParseResult {
        loop {
            let place = self.place();
            let name = self.name()?;
            match name.as_str() {
                "END" => return Ok(()),
                "OPTION" => self.option()?,
                "ATTRIB" => {
                    let name = self.declared()?;
                    self.expect('=')?;
                    let input = self.input()?;
                    self.names.insert(name, Named::Input(input));
                }
                "OUTPUT" => {
                    let name = self.declared()?;
                    self.expect('=')?;
                    let output = self.output()?;
                    self.names.insert(name, Named::Output(output));
                }
                "PARAM" => self.param()?,
                "TEMP" | "ADDRESS" => loop {
                    let declared = self.declared()?;
                    let list = if name == "TEMP" { &mut self.program.temps } else { &mut self.program.addresses };
                    if list.len() >= MOST {
                        return self.fail(format!("more than {MOST} registers"));
                    }
                    list.push(declared.clone());
                    let number = list.len() - 1;
                    let named = if name == "TEMP" { Named::Temp(number) } else { Named::Address(number) };
                    self.names.insert(declared, named);
                    if !self.take(',') {
                        break;
                    }
                },
                "ALIAS" => {
                    let name = self.declared()?;
                    self.expect('=')?;
                    let of = self.name()?;
                    let Some(named) = self.names.get(&of).cloned() else { return self.fail(format!("{of} is not declared")) };
                    self.names.insert(name, named);
                }
                _ => self.instruction(&name, place)?,
            }
            self.expect(';')?;
        }
    }

    /// A name that is not in use.
    fn declared(&mut self) -> ParseResult<String> {
        let place = self.place();
        let name = self.name()?;
        if self.names.contains_key(&name) {
            return self.fail_at(place, format!("{name} is declared twice"));
        }
        Ok(name)
    }

    fn option(&mut self) -> ParseResult {
        let place = self.place();
        let name = self.name()?;
        let fog = |parser: &mut Parser, mode| {
            parser.program.fog = Some(mode);
            parser.program.inputs |= 1 << input::FOG;
        };
        match (name.as_str(), self.program.stage) {
            ("ARB_precision_hint_nicest" | "ARB_precision_hint_fastest", ProgramStage::Fragment) => {}
            ("ARB_fragment_program_shadow", ProgramStage::Fragment) => self.shadow = true,
            ("ARB_position_invariant", ProgramStage::Vertex) => self.program.invariant = true,
            ("ARB_fog_linear", ProgramStage::Fragment) => fog(self, e::LINEAR),
            ("ARB_fog_exp", ProgramStage::Fragment) => fog(self, e::EXP),
            ("ARB_fog_exp2", ProgramStage::Fragment) => fog(self, e::EXP2),
            _ => return self.fail_at(place, format!("option {name} is not supported")),
        }
        if self.program.invariant {
            self.program.inputs |= 1 << input::POSITION;
        }
        Ok(())
    }

    /// `PARAM name = ...` and `PARAM name[n] = { ... }`.
    fn param(&mut self) -> ParseResult {
        let name = self.declared()?;
        let first = self.program.params.len();
        let array = self.take('[');
        let place = self.place();
        if array {
            let stated = match *self.peek() {
                Word::Number(..) => Some(self.index(MOST as u32, "size")?),
                _ => None,
            };
            self.expect(']')?;
            self.expect('=')?;
            self.expect('{')?;
            loop {
                let list = self.bound()?;
                self.append(list)?;
                if !self.take(',') {
                    break;
                }
            }
            self.expect('}')?;
            let count = self.program.params.len() - first;
            if stated.is_some_and(|stated| stated as usize != count) {
                return self.fail_at(place, format!("{name} has {count} elements, not as many as stated"));
            }
            self.names.insert(name, Named::Param(first, Some(count)));
        } else {
            self.expect('=')?;
            let list = self.bound()?;
            if list.len() != 1 {
                return self.fail_at(place, format!("{name} is no array, but bound to {} parameters", list.len()));
            }
            self.append(list)?;
            self.names.insert(name, Named::Param(first, None));
        }
        Ok(())
    }

    pub(super) fn append(&mut self, list: Vec<Param>) -> ParseResult {
        if self.program.params.len() + list.len() > MOST {
            return self.fail(format!("more than {MOST} parameters"));
        }
        self.program.params.extend(list);
        Ok(())
    }

    /// A constant or a binding: one parameter or several.
    fn bound(&mut self) -> ParseResult<Vec<Param>> {
        match self.peek().clone() {
            Word::Name(name) if name == "state" || name == "program" => {
                self.next();
                self.binding(name == "state")
            }
            _ => Ok(vec![Param::Literal(self.literal()?)]),
        }
    }

    fn instruction(&mut self, written: &str, place: ProgramLocation) -> ParseResult {
        let stage = self.program.stage;
        let (name, saturate) = match written.strip_suffix("_SAT") {
            Some(name) if stage == ProgramStage::Fragment => (name, true),
            _ => (written, false),
        };
        if self.program.instructions.len() >= MOST {
            return self.fail_at(place, format!("more than {MOST} instructions"));
        }
        let mut instruction = Instruction { name: "", saturate, destination: None, sources: Vec::new(), unit: 0 };
        match (name, stage) {
            ("KIL", ProgramStage::Fragment) => {
                instruction.name = "KIL";
                let source = self.source(false)?;
                instruction.sources.push(source);
            }
            ("TEX" | "TXP" | "TXB", ProgramStage::Fragment) => {
                instruction.name = ["TEX", "TXP", "TXB"][["TEX", "TXP", "TXB"].iter().position(|n| *n == name).unwrap_or(0)];
                instruction.destination = Some(self.destination()?);
                self.expect(',')?;
                let source = self.source(false)?;
                instruction.sources.push(source);
                self.expect(',')?;
                instruction.unit = self.texture()?;
                if name == "TXB" {
                    let images = &mut self.program.images;
                    // All of its reads have a bias then, which may be 0.
                    images.iter_mut().filter(|image| image.unit == instruction.unit).for_each(|image| image.ways = way::BIAS);
                }
            }
            ("ARL", ProgramStage::Vertex) => {
                instruction.name = "ARL";
                let place = self.place();
                let destination = self.destination()?;
                let x = matches!(destination.register, Register::Address(_)) && destination.mask == [true, false, false, false];
                if !x {
                    return self.fail_at(place, "ARL writes component x of an address register");
                }
                instruction.destination = Some(destination);
                self.expect(',')?;
                let source = self.source(true)?;
                instruction.sources.push(source);
            }
            ("SWZ", _) => {
                instruction.name = "SWZ";
                instruction.destination = Some(self.written()?);
                self.expect(',')?;
                let source = self.extended()?;
                instruction.sources.push(source);
            }
            _ => {
                let bit = stage as u8;
                let found = INSTRUCTIONS.iter().find(|(known, _, stages)| *known == name && stages & bit != 0);
                let Some(&(known, operands, _)) = found else {
                    return self.fail_at(place, format!("{written:.40} is no instruction of this stage"));
                };
                instruction.name = known;
                instruction.destination = Some(self.written()?);
                for operand in operands.chars() {
                    self.expect(',')?;
                    let source = self.source(operand == 's')?;
                    instruction.sources.push(source);
                }
            }
        }
        self.program.instructions.push(instruction);
        Ok(())
    }

    /// `texture[n], 2D`
    fn texture(&mut self) -> ParseResult<usize> {
        let place = self.place();
        if self.name()? != "texture" {
            return self.fail_at(place, "`texture[n]` is missing");
        }
        let unit = self.bracket(STAGE_IMAGES as u32, "texture unit")? as usize;
        self.expect(',')?;
        let place = self.place();
        let name = self.name()?;
        let target = match name.as_str() {
            "1D" => e::TEXTURE_1D,
            "2D" => e::TEXTURE_2D,
            "3D" => e::TEXTURE_3D,
            "CUBE" => e::TEXTURE_CUBE_MAP,
            "RECT" => e::TEXTURE_RECTANGLE,
            // The texture decides whether depths are compared; if its mode and this name differ, the result is undefined.
            "SHADOW1D" if self.shadow => e::TEXTURE_1D,
            "SHADOW2D" if self.shadow => e::TEXTURE_2D,
            "SHADOWRECT" if self.shadow => e::TEXTURE_RECTANGLE,
            _ if name.starts_with("SHADOW") => {
                return self.fail_at(place, format!("texture target {name:.40} needs OPTION ARB_fragment_program_shadow"));
            }
            _ => return self.fail_at(place, format!("texture target {name:.40} is not supported")),
        };
        let target = TARGETS.iter().position(|&known| known == target).unwrap_or(0);
        match self.program.image(unit) {
            Some(image) if image.target != target => {
                return self.fail_at(place, format!("texture unit {unit} is read with two targets"));
            }
            Some(_) => {}
            None => self.program.reads(unit, target, way::PLAIN),
        }
        Ok(unit)
    }
}
