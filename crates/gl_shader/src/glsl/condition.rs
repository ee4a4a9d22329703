//! Conditions of `#if` and `#elif`.

use super::lexemes::{Lexeme, LexemeKind};

/// A value; or why there is none, which is an error only where the value counts.
type Value = Result<i64, &'static str>;

/// What waits for its right operand.
enum Pending {
    Open,
    Unary(&'static str),
    Binary(&'static str, u8),
}

/// Operators that have a left operand, and how tightly they bind.
fn binding(mark: &str) -> Option<u8> {
    Some(match mark {
        "*" | "/" | "%" => 10,
        "+" | "-" => 9,
        "<<" | ">>" => 8,
        "<" | ">" | "<=" | ">=" => 7,
        "==" | "!=" => 6,
        "&" => 5,
        "^" => 4,
        "|" => 3,
        "&&" => 2,
        "||" => 1,
        _ => return None,
    })
}

/// The value of a condition whose macros are replaced. Its operators wait in a list, so that no condition takes more stack than another.
pub fn evaluate(lexemes: &[Lexeme]) -> Result<i64, String> {
    let (mut values, mut pending): (Vec<Value>, Vec<Pending>) = Default::default();
    let mut complete = false;
    for lexeme in lexemes {
        match (&lexeme.kind, complete) {
            (&LexemeKind::Whole(value, _), false) => {
                values.push(Ok(value as i64));
                complete = true;
            }
            (LexemeKind::Mark("("), false) => pending.push(Pending::Open),
            (&LexemeKind::Mark(mark @ ("+" | "-" | "!" | "~")), false) => pending.push(Pending::Unary(mark)),
            (LexemeKind::Mark(")"), true) => {
                reduce(&mut values, &mut pending, 0);
                if pending.pop().is_none() {
                    return Err("`)` without `(` in a condition".to_owned());
                }
            }
            (&LexemeKind::Mark(mark), true) if binding(mark).is_some() => {
                let tightness = binding(mark).unwrap_or(0);
                reduce(&mut values, &mut pending, tightness);
                pending.push(Pending::Binary(mark, tightness));
                complete = false;
            }
            _ => return Err(format!("`{}` in a condition", lexeme.text())),
        }
    }
    if !complete {
        return Err("a condition without an end".to_owned());
    }
    reduce(&mut values, &mut pending, 0);
    match (values.pop(), pending.is_empty()) {
        (Some(value), true) => Ok(value?),
        _ => Err("`(` without `)` in a condition".to_owned()),
    }
}

/// Applies the operators that bind at least so tightly, back to the last open bracket.
fn reduce(values: &mut Vec<Value>, pending: &mut Vec<Pending>, tightness: u8) {
    while let Some(operator) = pending.pop_if(|operator| match operator {
        Pending::Open => false,
        Pending::Unary(_) => true,
        Pending::Binary(_, own) => *own >= tightness,
    }) {
        let right = values.pop().unwrap_or(Ok(0));
        let value = match operator {
            Pending::Unary(mark) => unary(mark, right),
            Pending::Binary(mark, _) => binary(mark, values.pop().unwrap_or(Ok(0)), right),
            Pending::Open => right,
        };
        values.push(value);
    }
}

fn unary(mark: &str, value: Value) -> Value {
    let value = value?;
    match mark {
        "-" => value.checked_neg().ok_or("a number that is too large in a condition"),
        "!" => Ok(i64::from(value == 0)),
        "~" => Ok(!value),
        _ => Ok(value),
    }
}

fn binary(mark: &str, left: Value, right: Value) -> Value {
    // What the left operand decides does not evaluate the right one.
    match (mark, left) {
        ("&&", Ok(0)) => return Ok(0),
        ("||", Ok(value)) if value != 0 => return Ok(1),
        _ => {}
    }
    let (left, right) = (left?, right?);
    let large = "a number that is too large in a condition";
    let shift = || u32::try_from(right).map_err(|_| "a shift by a number that is not possible");
    match mark {
        "*" => left.checked_mul(right).ok_or(large),
        "/" => left.checked_div(right).ok_or("a division by zero in a condition"),
        "%" => left.checked_rem(right).ok_or("a division by zero in a condition"),
        "+" => left.checked_add(right).ok_or(large),
        "-" => left.checked_sub(right).ok_or(large),
        "<<" => left.checked_shl(shift()?).ok_or(large),
        ">>" => left.checked_shr(shift()?).ok_or(large),
        "<" => Ok(i64::from(left < right)),
        ">" => Ok(i64::from(left > right)),
        "<=" => Ok(i64::from(left <= right)),
        ">=" => Ok(i64::from(left >= right)),
        "==" => Ok(i64::from(left == right)),
        "!=" => Ok(i64::from(left != right)),
        "&" => Ok(left & right),
        "^" => Ok(left ^ right),
        "|" => Ok(left | right),
        "&&" => Ok(i64::from(left != 0 && right != 0)),
        _ => Ok(i64::from(left != 0 || right != 0)),
    }
}

#[cfg(test)]
mod tests {
    use super::super::lexemes::Lexer;
    use super::*;

    fn value(text: &str) -> Result<i64, String> {
        let lexemes: Vec<Lexeme> =
            Lexer::new(text).expect("a text").filter(|lexeme| lexeme.kind != LexemeKind::NewLine).collect();
        evaluate(&lexemes)
    }

    #[test]
    fn operators_bind_as_in_the_language() {
        for (text, wanted) in [
            ("1 + 2 * 3 - 4", 3),
            ("(1 + 2) * 3", 9),
            ("10 - 2 - 3", 5),
            ("-2 * -3", 6),
            ("!0 + 1", 2),
            ("~0 == -1", 1),
            ("1 << 2 + 1", 8),
            ("1 | 2 ^ 3 & 2", 1),
            ("1 < 2 == 1", 1),
            ("0 && 1 || 1", 1),
            ("1 || 0 && 0", 1),
            ("7 % 4 / 2", 1),
            ("- - !(0)", 1),
            ("0x10 >= 020", 1),
            ("1 != 2 && 3 > 2 && 2 <= 2", 1),
            ("64 >> 3", 8),
        ] {
            assert_eq!(value(text), Ok(wanted), "{text}");
        }
    }

    #[test]
    fn what_does_not_count_is_no_error() {
        assert_eq!(value("0 && 1 / 0"), Ok(0));
        assert_eq!(value("1 || 1 % 0"), Ok(1));
        assert!(value("1 && 1 / 0").is_err_and(|reason| reason.contains("division")));
        assert!(value("9223372036854775807 + 1").is_err());
        assert!(value("1 << 64").is_err());
        assert!(value("1 << -1").is_err());
    }

    #[test]
    fn malformed_conditions_are_refused() {
        for text in ["", "1 +", "(1", "1)", "1 2", "* 1", "()", "1.5", "--1", "1 = 1"] {
            assert!(value(text).is_err(), "{text}");
        }
    }

    #[test]
    fn depth_takes_no_stack() {
        let n = 100_000;
        assert_eq!(value(&format!("{}1{}", "(".repeat(n), ")".repeat(n))), Ok(1));
        assert_eq!(value(&format!("{}1", "!".repeat(n))), Ok(1));
        assert_eq!(value(&format!("{}1", "1 || ".repeat(n))), Ok(1));
    }
}
