//! Vectors and matrices as a whole.

use naga::MathFunction;

use super::Fault;
use super::number::to_f16;
use super::value::{Number, Value, broken};

/// The floats of a scalar or vector, and whether they are `f16`.
fn floats(x: &Value) -> Result<(Vec<f32>, bool), Fault> {
    Ok((x.floats()?, matches!(x.numbers()?.first(), Some(Number::Half(_)))))
}

/// Floats as a value, rounded to the type.
fn value(x: &[f32], half: bool) -> Value {
    let number = |&x: &f32| if half { Number::Half(to_f16(x)) } else { Number::Float(x) };
    Value::of_numbers(&x.iter().map(number).collect::<Vec<_>>())
}

/// The sum of products, from the first on. Of `f16` each product and each sum is rounded.
fn dot(a: &[f32], b: &[f32], half: bool) -> f32 {
    let round = |x: f32| if half { to_f16(x) } else { x };
    let products = a.iter().zip(b).map(|(x, y)| round(x * y));
    products.reduce(|sum, p| round(sum + p)).unwrap_or(0.0)
}

/// The length, computed in 32 bits also for `f16`, whose squares would overflow.
fn length(x: &[f32]) -> f32 {
    if let [one] = *x { one.abs() } else { dot(x, x, false).sqrt() }
}

/// The columns of a matrix, and whether its numbers are `f16`.
fn columns(m: &Value) -> Result<(Vec<Vec<f32>>, bool), Fault> {
    let Value::Parts(parts) = m else { return broken("a matrix was expected") };
    let columns = parts.iter().map(Value::floats).collect::<Result<Vec<_>, _>>()?;
    let half = matches!(parts.first().map(Value::numbers), Some(Ok([Number::Half(_), ..])));
    Ok((columns, half))
}

/// A matrix of these columns.
fn matrix(columns: &[Vec<f32>], half: bool) -> Value {
    Value::Parts(columns.iter().map(|c| value(c, half)).collect())
}

/// The product where one operand or both are matrices: each number of it is a dot product.
pub fn product(a: &Value, b: &Value) -> Result<Value, Fault> {
    match (a, b) {
        (Value::Parts(_), Value::Vector(_)) => {
            let ((m, half), v) = (columns(a)?, b.floats()?);
            Ok(value(&matrix_times(&m, &v, half), half))
        }
        (Value::Vector(_), Value::Parts(_)) => {
            let (v, (m, half)) = (a.floats()?, columns(b)?);
            Ok(value(&m.iter().map(|column| dot(&v, column, half)).collect::<Vec<_>>(), half))
        }
        (Value::Parts(_), Value::Parts(_)) => {
            let ((m, half), (n, _)) = (columns(a)?, columns(b)?);
            Ok(matrix(&n.iter().map(|column| matrix_times(&m, column, half)).collect::<Vec<_>>(), half))
        }
        _ => broken("a product of matrices without a matrix"),
    }
}

/// A matrix times a vector.
fn matrix_times(m: &[Vec<f32>], v: &[f32], half: bool) -> Vec<f32> {
    let row = |r: usize| m.iter().map(|column| column[r]).collect::<Vec<f32>>();
    (0..m[0].len()).map(|r| dot(&row(r), v, half)).collect()
}

/// A square matrix without one column and one row.
fn without(m: &[Vec<f32>], column: usize, row: usize) -> Vec<Vec<f32>> {
    let rest = |c: &Vec<f32>| c.iter().enumerate().filter(|&(r, _)| r != row).map(|(_, &x)| x).collect();
    m.iter().enumerate().filter(|&(c, _)| c != column).map(|(_, c)| rest(c)).collect()
}

/// The determinant, by expansion along the first column.
fn determinant(m: &[Vec<f32>]) -> f32 {
    match m {
        [only] => only[0],
        [a, b] => a[0] * b[1] - b[0] * a[1],
        _ => {
            let mut sum = 0.0;
            for r in 0..m.len() {
                let term = m[0][r] * determinant(&without(m, 0, r));
                sum = match r {
                    0 => term,
                    _ if r % 2 == 0 => sum + term,
                    _ => sum - term,
                };
            }
            sum
        }
    }
}

/// The inverse: the adjugate times one over the determinant.
fn inverse(m: &[Vec<f32>]) -> Vec<Vec<f32>> {
    let scale = 1.0 / determinant(m);
    let entry = |column: usize, row: usize| {
        // The cofactor of the transposed place.
        let cofactor = determinant(&without(m, row, column)) * scale;
        if (row + column).is_multiple_of(2) { cofactor } else { -cofactor }
    };
    (0..m.len()).map(|c| (0..m.len()).map(|r| entry(c, r)).collect()).collect()
}

fn refract(i: &[f32], n: &[f32], eta: f32, half: bool) -> Vec<f32> {
    let d = dot(n, i, half);
    let k = 1.0 - (eta * eta) * (1.0 - d * d);
    let q = eta * d + k.sqrt();
    i.iter().zip(n).map(|(&i, &n)| if k < 0.0 { 0.0 } else { eta * i - q * n }).collect()
}

/// The dot product of two vectors of integers.
fn integer_dot(a: &[Number], b: &[Number]) -> Result<Value, Fault> {
    let mut sum = 0u32;
    for (x, y) in a.iter().zip(b) {
        sum = sum.wrapping_add(x.bits().wrapping_mul(y.bits()));
    }
    Ok(Value::Number(match a.first() {
        Some(Number::Sint(_)) => Number::Sint(sum as i32),
        Some(Number::Uint(_)) => Number::Uint(sum),
        _ => return broken("`dot` of vectors of `bool`"),
    }))
}

/// A built-in function of vectors or matrices.
pub fn call(fun: MathFunction, args: &[Value]) -> Result<Value, Fault> {
    use MathFunction as M;
    match fun {
        M::Transpose => {
            let (m, half) = columns(&args[0])?;
            let turned: Vec<Vec<f32>> = (0..m[0].len()).map(|r| m.iter().map(|c| c[r]).collect()).collect();
            return Ok(matrix(&turned, half));
        }
        M::Determinant => {
            let (m, half) = columns(&args[0])?;
            return Ok(value(&[determinant(&m)], half));
        }
        M::Inverse => {
            let (m, half) = columns(&args[0])?;
            return Ok(matrix(&inverse(&m), half));
        }
        M::Dot if !matches!(args[0].numbers()?[0], Number::Float(_) | Number::Half(_)) => {
            return integer_dot(args[0].numbers()?, args[1].numbers()?);
        }
        _ => {}
    }
    let (x, half) = floats(&args[0])?;
    let others = args[1..].iter().map(Value::floats).collect::<Result<Vec<_>, _>>()?;
    let [y, z] = [others.first(), others.get(1)].map(|v| v.map_or(&[][..], Vec::as_slice));
    Ok(match fun {
        M::Dot => value(&[dot(&x, y, half)], half),
        M::Length => value(&[length(&x)], half),
        M::Distance => value(&[length(&x.iter().zip(y).map(|(a, b)| a - b).collect::<Vec<_>>())], half),
        M::Normalize => {
            let scale = 1.0 / dot(&x, &x, false).sqrt();
            value(&x.iter().map(|a| a * scale).collect::<Vec<_>>(), half)
        }
        M::Cross => {
            let term = |i: usize, j: usize| x[i] * y[j] - x[j] * y[i];
            value(&[term(1, 2), term(2, 0), term(0, 1)], half)
        }
        M::FaceForward => {
            let facing = dot(y, z, half) < 0.0;
            value(&x.iter().map(|&a| if facing { a } else { -a }).collect::<Vec<_>>(), half)
        }
        M::Reflect => {
            let k = 2.0 * dot(y, &x, half);
            value(&x.iter().zip(y).map(|(a, n)| a - k * n).collect::<Vec<_>>(), half)
        }
        M::Refract => value(&refract(&x, y, z[0], half), half),
        M::Outer => matrix(&y.iter().map(|c| x.iter().map(|r| r * c).collect()).collect::<Vec<Vec<f32>>>(), half),
        other => return Err(Fault::Unsupported(format!("the built-in function {other:?}"))),
    })
}
