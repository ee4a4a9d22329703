//! Operands of instructions: destinations and sources.

use super::lex::{Word, Wrong};
use super::parse::{Named, Parser};
use super::program::*;

type ParseResult<T = ()> = Result<T, Wrong>;

impl Parser {
    pub(super) fn literal(&mut self) -> ParseResult<[f32; 4]> {
        if !self.take('{') {
            return Ok([self.signed()?; 4]);
        }
        let mut value = [0.0, 0.0, 0.0, 1.0];
        for component in &mut value {
            *component = self.signed()?;
            if !self.take(',') {
                break;
            }
        }
        self.expect('}')?;
        Ok(value)
    }

    fn signed(&mut self) -> ParseResult<f32> {
        let negative = self.take('-');
        let _plus = !negative && self.take('+');
        match *self.peek() {
            Word::Number(number, _) => {
                self.next();
                Ok(if negative { -number } else { number })
            }
            _ => self.fail(format!("{} where a number or a declared name is needed", self.peek())),
        }
    }

    /// A destination that is not an address register.
    pub(super) fn written(&mut self) -> ParseResult<Destination> {
        let place = self.place();
        let destination = self.destination()?;
        if matches!(destination.register, Register::Address(_)) {
            return self.fail_at(place, "only ARL writes an address register");
        }
        Ok(destination)
    }

    pub(super) fn destination(&mut self) -> ParseResult<Destination> {
        let place = self.place();
        let register = match self.name()?.as_str() {
            "result" => {
                self.at -= 1;
                Register::Output(self.output()?)
            }
            name => match self.names.get(name) {
                Some(Named::Temp(number)) => Register::Temp(*number),
                Some(Named::Address(number)) => Register::Address(*number),
                Some(Named::Output(output)) => Register::Output(*output),
                Some(_) => return self.fail_at(place, format!("{name} cannot be written")),
                None => return self.fail_at(place, format!("{name:.40} is not declared")),
            },
        };
        if let Register::Output(output) = register {
            if output == Output::Position && self.program.invariant {
                return self.fail_at(place, "ARB_position_invariant writes the position");
            }
            if !self.program.outputs.contains(&output) {
                self.program.outputs.push(output);
            }
        }
        let mut mask = [true; 4];
        if self.take('.') {
            let place = self.place();
            let letters = self.name()?;
            let list = components(&letters, self.program.stage);
            let rising = |list: &Vec<u8>| list.windows(2).all(|pair| pair[0] < pair[1]);
            let Some(list) = list.filter(rising) else {
                return self.fail_at(place, format!("{letters:.40} is no write mask"));
            };
            mask = std::array::from_fn(|k| list.contains(&(k as u8)));
        }
        Ok(Destination { register, mask })
    }

    pub(super) fn source(&mut self, scalar: bool) -> ParseResult<SourceOperand> {
        let negative = self.take('-');
        let _plus = !negative && self.take('+');
        let register = self.operand()?;
        let mut swizzle = [0, 1, 2, 3];
        if self.take('.') {
            let place = self.place();
            let letters = self.name()?;
            let list = components(&letters, self.program.stage).filter(|list| matches!(list.len(), 1 | 4));
            let Some(list) = list.filter(|list| !scalar || list.len() == 1) else {
                let what = if scalar { "component of a scalar operand" } else { "swizzle" };
                return self.fail_at(place, format!("{letters:.40} is no {what}"));
            };
            swizzle = std::array::from_fn(|k| list[k % list.len()]);
        } else if scalar {
            let whole = matches!(register, Register::Param(k) if matches!(self.program.params[k], Param::Literal([a, b, c, d]) if a == b && b == c && c == d));
            if !whole {
                return self.fail("a scalar operand needs one component");
            }
        }
        Ok(SourceOperand { register, swizzle, negate: [negative; 4] })
    }

    /// `r, x, -y, 0, 1`
    pub(super) fn extended(&mut self) -> ParseResult<SourceOperand> {
        let register = self.operand()?;
        let mut source = SourceOperand { register, swizzle: [0; 4], negate: [false; 4] };
        for k in 0..4 {
            self.expect(',')?;
            let negative = self.take('-');
            source.negate[k] = negative;
            let _plus = !negative && self.take('+');
            let place = self.place();
            source.swizzle[k] = match self.next() {
                Word::Number(0.0, true) => 4,
                Word::Number(1.0, true) => 5,
                Word::Name(letter) if letter.len() == 1 => match components(&letter, self.program.stage) {
                    Some(list) => list[0],
                    None => return self.fail_at(place, format!("{letter} is no component")),
                },
                other => return self.fail_at(place, format!("{other} is no component")),
            };
        }
        Ok(source)
    }

    fn operand(&mut self) -> ParseResult<Register> {
        let place = self.place();
        let name = match self.peek().clone() {
            Word::Name(name) => name,
            _ => {
                let literal = self.literal()?;
                return self.parameter(Param::Literal(literal));
            }
        };
        match name.as_str() {
            "vertex" | "fragment" => return Ok(Register::Input(self.input()?)),
            "state" | "program" => {
                self.next();
                let list = self.binding(name == "state")?;
                let [one] = list[..] else {
                    return self.fail_at(place, format!("an operand that is bound to {} parameters", list.len()));
                };
                return self.parameter(one);
            }
            _ => {}
        }
        self.next();
        let Some(named) = self.names.get(&name).cloned() else {
            return self.fail_at(place, format!("{name:.40} is not declared"));
        };
        match named {
            Named::Temp(number) => Ok(Register::Temp(number)),
            Named::Input(bit) => Ok(Register::Input(bit)),
            Named::Param(first, None) => Ok(Register::Param(first)),
            Named::Param(first, Some(count)) => self.element(first, count),
            Named::Output(_) | Named::Address(_) => self.fail_at(place, format!("{name} cannot be read here")),
        }
    }

    /// `[3]`, or `[A0.x + 3]`.
    fn element(&mut self, first: usize, count: usize) -> ParseResult<Register> {
        self.expect('[')?;
        let place = self.place();
        let register = match self.peek().clone() {
            Word::Name(name) => {
                self.next();
                let Some(&Named::Address(address)) = self.names.get(&name) else {
                    return self.fail_at(place, format!("{name:.40} is no address register"));
                };
                self.must(&["x"])?;
                let mut offset = 0;
                if self.take('+') {
                    offset = self.index(64, "offset")? as i32;
                } else if self.take('-') {
                    offset = -(self.index(65, "offset")? as i32);
                }
                Register::Relative { first: first as i32 + offset, address }
            }
            _ => Register::Param(first + self.index(count as u32, "element")? as usize),
        };
        self.expect(']')?;
        Ok(register)
    }

    fn parameter(&mut self, param: Param) -> ParseResult<Register> {
        if let Some(known) = self.program.params.iter().position(|known| *known == param) {
            return Ok(Register::Param(known));
        }
        self.append(vec![param])?;
        Ok(Register::Param(self.program.params.len() - 1))
    }
}

/// Component numbers of letters; the letters of colours are valid in fragment programs only.
fn components(letters: &str, stage: ProgramStage) -> Option<Vec<u8>> {
    let of = |set: &str| letters.chars().map(|c| set.find(c).map(|k| k as u8)).collect::<Option<Vec<u8>>>();
    let list = of("xyzw").or_else(|| if stage == ProgramStage::Fragment { of("rgba") } else { None })?;
    (1..=4).contains(&list.len()).then_some(list)
}
