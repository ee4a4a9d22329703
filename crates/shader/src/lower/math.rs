//! Numeric built-in functions.

use naga::{Expression, Handle, MathFunction, Scalar, ScalarKind, TypeInner};

use super::{Lowerer, Result, Val};
use crate::code::Code;
use crate::ir::V;

impl<'a> Lowerer<'a> {
    fn op(&mut self, code: Code, src: &[V]) -> V {
        self.b.op(code, src)
    }

    /// Applies a code to corresponding components of the arguments (single ones are repeated), rounded to the type.
    fn zip(&mut self, args: &[std::rc::Rc<[V]>], code: Code, scalar: Option<Scalar>) -> Val {
        let n = args.iter().map(|a| a.len()).max().unwrap_or(0);
        Val::Data(
            (0..n)
                .map(|i| {
                    let s: Vec<V> = args.iter().map(|a| a[if a.len() == 1 { 0 } else { i }]).collect();
                    let v = self.op(code, &s);
                    scalar.map_or(v, |s| self.rounded(v, s))
                })
                .collect(),
        )
    }

    pub fn math(&mut self, fun: MathFunction, arg: Handle<Expression>, more: Vec<Handle<Expression>>) -> Result<Val> {
        use MathFunction as M;
        let scalar = self.scalar_of(arg)?;
        let mut a = vec![self.data(arg)?];
        for h in more {
            a.push(self.data(h)?);
        }
        let x = a[0].clone();
        let float = scalar.kind == ScalarKind::Float;
        let signed = scalar.kind == ScalarKind::Sint;
        let pick = |f: Code, s: Code, u: Code| {
            if float {
                f
            } else if signed {
                s
            } else {
                u
            }
        };
        let rounding = Some(scalar);
        Ok(match fun {
            M::Abs if !float && !signed => Val::Data(x),
            M::Abs => self.map(&x, pick(Code::FAbs, Code::IAbs, Code::IAbs)),
            M::Min => self.zip(&a, pick(Code::FMin, Code::SMin, Code::UMin), None),
            M::Max => self.zip(&a, pick(Code::FMax, Code::SMax, Code::UMax), None),
            M::Clamp if float => self.zip(&a, Code::FClamp, None),
            M::Clamp => {
                let low = self.zip(&a[..2], if signed { Code::SMax } else { Code::UMax }, None);
                let Val::Data(low) = low else { return Ok(low) };
                self.zip(&[low, a[2].clone()], if signed { Code::SMin } else { Code::UMin }, None)
            }
            M::Saturate => self.map(&x, Code::FSaturate),
            M::Cos => self.zip(&a, Code::Cos, rounding),
            M::Cosh => self.zip(&a, Code::Cosh, rounding),
            M::Sin => self.zip(&a, Code::Sin, rounding),
            M::Sinh => self.zip(&a, Code::Sinh, rounding),
            M::Tan => self.zip(&a, Code::Tan, rounding),
            M::Tanh => self.zip(&a, Code::Tanh, rounding),
            M::Acos => self.zip(&a, Code::Acos, rounding),
            M::Asin => self.zip(&a, Code::Asin, rounding),
            M::Atan => self.zip(&a, Code::Atan, rounding),
            M::Atan2 => self.zip(&a, Code::Atan2, rounding),
            M::Asinh => self.zip(&a, Code::Asinh, rounding),
            M::Acosh => self.zip(&a, Code::Acosh, rounding),
            M::Atanh => self.zip(&a, Code::Atanh, rounding),
            M::Radians => self.scaled(&x, std::f32::consts::PI / 180.0, scalar),
            M::Degrees => self.scaled(&x, 180.0 / std::f32::consts::PI, scalar),
            M::Ceil => self.map(&x, Code::FCeil),
            M::Floor => self.map(&x, Code::FFloor),
            M::Round => self.map(&x, Code::FRound),
            M::Fract => self.zip(&a, Code::FFract, rounding),
            M::Trunc => self.map(&x, Code::FTrunc),
            M::Modf => {
                let mut out = Vec::new();
                let mut whole = Vec::new();
                for &v in x.iter() {
                    let w = self.op(Code::FTrunc, &[v]);
                    out.push(self.op(Code::FSub, &[v, w]));
                    whole.push(w);
                }
                out.extend(whole);
                Val::Data(out.into())
            }
            M::Frexp => {
                let mut out: Vec<V> = x.iter().map(|&v| self.op(Code::FrexpFraction, &[v])).collect();
                out.extend(x.iter().map(|&v| self.b.op(Code::FrexpExponent, &[v])));
                Val::Data(out.into())
            }
            M::Ldexp => self.zip(&a, Code::Ldexp, rounding),
            M::Exp => self.zip(&a, Code::Exp, rounding),
            M::Exp2 => self.zip(&a, Code::Exp2, rounding),
            M::Log => self.zip(&a, Code::Log, rounding),
            M::Log2 => self.zip(&a, Code::Log2, rounding),
            M::Pow => {
                let out: Vec<V> = (0..x.len())
                    .map(|i| {
                        let v = self.power(x[i], a[1][i]);
                        self.rounded(v, scalar)
                    })
                    .collect();
                Val::Data(out.into())
            }
            M::Dot if float => Val::Data([self.dot(&x, &a[1], scalar)].into()),
            M::Dot => {
                let mut sum = self.op(Code::IMul, &[x[0], a[1][0]]);
                for i in 1..x.len() {
                    let p = self.op(Code::IMul, &[x[i], a[1][i]]);
                    sum = self.op(Code::IAdd, &[sum, p]);
                }
                Val::Data([sum].into())
            }
            M::Dot4I8Packed => self.zip(&a, Code::Dot4I8, None),
            M::Dot4U8Packed => self.zip(&a, Code::Dot4U8, None),
            M::Outer => {
                let mut out = Vec::new();
                for &c in a[1].iter() {
                    for &r in x.iter() {
                        let p = self.op(Code::FMul, &[r, c]);
                        out.push(self.rounded(p, scalar));
                    }
                }
                Val::Data(out.into())
            }
            M::Cross => {
                let y = a[1].clone();
                let out = [(1, 2), (2, 0), (0, 1)].map(|(i, j)| {
                    let p = self.op(Code::FMul, &[x[i], y[j]]);
                    let q = self.op(Code::FMul, &[x[j], y[i]]);
                    let d = self.op(Code::FSub, &[p, q]);
                    self.rounded(d, scalar)
                });
                Val::Data(out.to_vec().into())
            }
            M::Distance => {
                let d: Vec<V> = x.iter().zip(a[1].iter()).map(|(&p, &q)| self.b.op(Code::FSub, &[p, q])).collect();
                Val::Data([self.length(&d, scalar)].into())
            }
            M::Length => Val::Data([self.length(&x, scalar)].into()),
            M::Normalize => self.normalize(&x, scalar),
            M::FaceForward => {
                let d = self.dot(&a[1], &a[2], scalar);
                let zero = self.b.float(0.0);
                let c = self.op(Code::FLt, &[d, zero]);
                let out = x.iter().map(|&v| {
                    let n = self.b.op(Code::FNeg, &[v]);
                    self.b.op(Code::Select, &[c, v, n])
                });
                Val::Data(out.collect())
            }
            M::Reflect => {
                // e1 - 2 dot(e2, e1) e2
                let d = self.dot(&a[1], &x, scalar);
                let two = self.b.float(2.0);
                let k = self.op(Code::FMul, &[two, d]);
                let out: Vec<V> = (0..x.len())
                    .map(|i| {
                        let p = self.op(Code::FMul, &[k, a[1][i]]);
                        let v = self.op(Code::FSub, &[x[i], p]);
                        self.rounded(v, scalar)
                    })
                    .collect();
                Val::Data(out.into())
            }
            M::Refract => self.refract(&x, &a[1].clone(), a[2][0], scalar),
            M::Sign => self.map(&x, if float { Code::FSign } else { Code::ISign }),
            M::Fma => {
                let p = self.zip(&a[..2], Code::FMul, None);
                let Val::Data(p) = p else { return Ok(p) };
                self.zip(&[p, a[2].clone()], Code::FAdd, rounding)
            }
            M::Mix => {
                let one = self.b.float(1.0);
                let t = |i: usize| a[2][if a[2].len() == 1 { 0 } else { i }];
                let out: Vec<V> = (0..x.len())
                    .map(|i| {
                        let rest = self.op(Code::FSub, &[one, t(i)]);
                        let p = self.op(Code::FMul, &[x[i], rest]);
                        let q = self.op(Code::FMul, &[a[1][i], t(i)]);
                        let s = self.op(Code::FAdd, &[p, q]);
                        self.rounded(s, scalar)
                    })
                    .collect();
                Val::Data(out.into())
            }
            M::Step => {
                // 1 where edge <= x
                let out: Vec<V> = (0..x.len())
                    .map(|i| {
                        let c = self.op(Code::FLe, &[x[i], a[1][i]]);
                        self.op(Code::BoolToF, &[c])
                    })
                    .collect();
                Val::Data(out.into())
            }
            M::SmoothStep => {
                let (two, three) = (self.b.float(2.0), self.b.float(3.0));
                let n = a.iter().map(|v| v.len()).max().unwrap_or(0);
                let at = |k: usize, i: usize| a[k][if a[k].len() == 1 { 0 } else { i }];
                let out: Vec<V> = (0..n)
                    .map(|i| {
                        let (low, high, v) = (at(0, i), at(1, i), at(2, i));
                        let p = self.op(Code::FSub, &[v, low]);
                        let q = self.op(Code::FSub, &[high, low]);
                        let t = self.op(Code::FDiv, &[p, q]);
                        let t = self.op(Code::FSaturate, &[t]);
                        let k = self.op(Code::FMul, &[two, t]);
                        let k = self.op(Code::FSub, &[three, k]);
                        let t2 = self.op(Code::FMul, &[t, t]);
                        let r = self.op(Code::FMul, &[t2, k]);
                        self.rounded(r, scalar)
                    })
                    .collect();
                Val::Data(out.into())
            }
            M::Sqrt => self.zip(&a, Code::FSqrt, rounding),
            M::InverseSqrt => self.zip(&a, Code::FInvSqrt, rounding),
            M::Transpose => {
                let (columns, rows) = self.matrix(arg)?;
                let out = (0..rows).flat_map(|r| (0..columns).map(move |c| c * rows + r)).map(|k| x[k]);
                Val::Data(out.collect())
            }
            M::Determinant => {
                let (n, _) = self.matrix(arg)?;
                let v = self.determinant(&x, n);
                Val::Data([self.rounded(v, scalar)].into())
            }
            M::Inverse => {
                let (n, _) = self.matrix(arg)?;
                self.inverse(&x, n, scalar)
            }
            M::QuantizeToF16 => self.map(&x, Code::Quantize),
            M::CountTrailingZeros => self.map(&x, Code::Ctz),
            M::CountLeadingZeros => self.map(&x, Code::Clz),
            M::CountOneBits => self.map(&x, Code::PopCount),
            M::ReverseBits => self.map(&x, Code::ReverseBits),
            M::FirstTrailingBit => self.map(&x, Code::FirstTrailing),
            M::FirstLeadingBit => self.map(&x, if signed { Code::FirstLeadingS } else { Code::FirstLeadingU }),
            M::ExtractBits => self.zip(&a, if signed { Code::ExtractS } else { Code::ExtractU }, None),
            M::InsertBits => {
                let (offset, count) = (a[2][0], a[3][0]);
                let mask = self.op(Code::FieldMask, &[offset, count]);
                let out: Vec<V> = (0..x.len())
                    .map(|i| {
                        let moved = self.op(Code::Shl, &[a[1][i], offset]);
                        self.op(Code::Merge, &[mask, moved, x[i]])
                    })
                    .collect();
                Val::Data(out.into())
            }
            M::Pack4x8snorm => self.pack(&x, Code::ToSnorm8, 8),
            M::Pack4x8unorm => self.pack(&x, Code::ToUnorm8, 8),
            M::Pack2x16snorm => self.pack(&x, Code::ToSnorm16, 16),
            M::Pack2x16unorm => self.pack(&x, Code::ToUnorm16, 16),
            M::Pack2x16float => self.pack(&x, Code::ToHalf, 16),
            M::Pack4xI8 | M::Pack4xU8 => self.pack_bytes(&x),
            M::Pack4xI8Clamp => {
                let (low, high) = (self.b.constant(-128i32 as u32), self.b.constant(127));
                let out: Vec<V> = x
                    .iter()
                    .map(|&v| {
                        let v = self.op(Code::SMax, &[v, low]);
                        self.op(Code::SMin, &[v, high])
                    })
                    .collect();
                self.pack_bytes(&out)
            }
            M::Pack4xU8Clamp => {
                let high = self.b.constant(255);
                let out: Vec<V> = x.iter().map(|&v| self.op(Code::UMin, &[v, high])).collect();
                self.pack_bytes(&out)
            }
            M::Unpack4x8snorm => self.unpack_norm(x[0], 4, true, 127.0),
            M::Unpack4x8unorm => self.unpack_norm(x[0], 4, false, 255.0),
            M::Unpack2x16snorm => self.unpack_norm(x[0], 2, true, 32767.0),
            M::Unpack2x16unorm => self.unpack_norm(x[0], 2, false, 65535.0),
            M::Unpack2x16float => {
                let sixteen = self.b.constant(16);
                let high = self.op(Code::ShrU, &[x[0], sixteen]);
                Val::Data([self.op(Code::FromHalf, &[x[0]]), self.op(Code::FromHalf, &[high])].into())
            }
            M::Unpack4xI8 => self.unpack_bytes(x[0], true),
            M::Unpack4xU8 => self.unpack_bytes(x[0], false),
        })
    }

    fn scaled(&mut self, x: &[V], by: f32, scalar: Scalar) -> Val {
        let k = self.b.float(by);
        Val::Data(
            x.iter()
                .map(|&v| {
                    let p = self.b.op(Code::FMul, &[v, k]);
                    self.rounded(p, scalar)
                })
                .collect(),
        )
    }

    /// `x` to the power `y`. A small constant whole `y` becomes products, which are faster and nearer to the truth; a negative
    /// `x` gives NaN as the general function does.
    fn power(&mut self, x: V, y: V) -> V {
        let n = match self.b.known(y).map(f32::from_bits) {
            Some(n) if n.fract() == 0.0 && (1.0..=64.0).contains(&n) => n as u32,
            Some(n) if n == 128.0 || n == 256.0 => n as u32,
            _ => return self.op(Code::Pow, &[x, y]),
        };
        let (mut square, mut out, mut left) = (x, None, n);
        while left != 0 {
            if left & 1 != 0 {
                out = Some(out.map_or(square, |o| self.b.op(Code::FMul, &[o, square])));
            }
            left >>= 1;
            if left != 0 {
                square = self.op(Code::FMul, &[square, square]);
            }
        }
        let out = out.unwrap_or(x);
        if self.b.is_nonnegative(x) {
            return out;
        }
        let (zero, nan) = (self.b.float(0.0), self.b.float(f32::NAN));
        let negative = self.op(Code::FLt, &[x, zero]);
        self.op(Code::Select, &[negative, nan, out])
    }

    fn length(&mut self, d: &[V], scalar: Scalar) -> V {
        if let [v] = *d {
            return self.op(Code::FAbs, &[v]);
        }
        // Of 16-bit numbers: computed in 32 bits, where the squares do not overflow, and rounded once.
        let wide = Scalar { kind: scalar.kind, width: 4 };
        let s = self.dot(d, d, wide);
        let l = self.op(Code::FSqrt, &[s]);
        self.rounded(l, scalar)
    }

    fn normalize(&mut self, d: &[V], scalar: Scalar) -> Val {
        let code = match d.len() {
            2 => Some(Code::Normalize2),
            3 => Some(Code::Normalize3),
            _ => None,
        };
        if let Some(code) = code
            && d.iter().any(|&v| self.b.known(v).is_none())
        {
            let first = self.b.ops(code, d, 0, d.len(), true);
            return Val::Data((0..d.len() as V).map(|i| first + i).map(|v| self.rounded(v, scalar)).collect());
        }
        let wide = Scalar { kind: scalar.kind, width: 4 };
        let s = self.dot(d, d, wide);
        let s = self.op(Code::FInvSqrt, &[s]);
        let out = d.iter().map(|&v| {
            let p = self.b.op(Code::FMul, &[v, s]);
            self.rounded(p, scalar)
        });
        Val::Data(out.collect())
    }

    /// k = 1 - e3^2 (1 - dot(e2, e1)^2); 0 where k < 0, else e3 e1 - (e3 dot(e2, e1) + sqrt(k)) e2.
    fn refract(&mut self, i: &[V], n: &[V], eta: V, scalar: Scalar) -> Val {
        let (one, zero) = (self.b.float(1.0), self.b.float(0.0));
        let d = self.dot(n, i, scalar);
        let d2 = self.op(Code::FMul, &[d, d]);
        let rest = self.op(Code::FSub, &[one, d2]);
        let eta2 = self.op(Code::FMul, &[eta, eta]);
        let p = self.op(Code::FMul, &[eta2, rest]);
        let k = self.op(Code::FSub, &[one, p]);
        let bad = self.op(Code::FLt, &[k, zero]);
        let root = self.op(Code::FSqrt, &[k]);
        let ed = self.op(Code::FMul, &[eta, d]);
        let q = self.op(Code::FAdd, &[ed, root]);
        let out: Vec<V> = (0..i.len())
            .map(|c| {
                let a = self.op(Code::FMul, &[eta, i[c]]);
                let b = self.op(Code::FMul, &[q, n[c]]);
                let v = self.op(Code::FSub, &[a, b]);
                let v = self.rounded(v, scalar);
                self.op(Code::Select, &[bad, zero, v])
            })
            .collect();
        Val::Data(out.into())
    }

    /// Columns and rows of a matrix expression.
    fn matrix(&self, h: Handle<Expression>) -> Result<(usize, usize)> {
        match *self.inner(h) {
            TypeInner::Matrix { columns, rows, .. } => Ok((columns as usize, rows as usize)),
            _ => self.refuse("not a matrix"),
        }
    }

    /// Determinant by expansion along the first column; entry (row r, column c) is `m[c * n + r]`.
    fn determinant(&mut self, m: &[V], n: usize) -> V {
        if n == 1 {
            return m[0];
        }
        if n == 2 {
            let p = self.op(Code::FMul, &[m[0], m[3]]);
            let q = self.op(Code::FMul, &[m[2], m[1]]);
            return self.op(Code::FSub, &[p, q]);
        }
        let mut sum = None;
        for r in 0..n {
            let minor = minor(m, n, r, 0);
            let d = self.determinant(&minor, n - 1);
            let p = self.op(Code::FMul, &[m[r], d]);
            sum = Some(match sum {
                None => p,
                Some(s) => self.op(if r % 2 == 0 { Code::FAdd } else { Code::FSub }, &[s, p]),
            });
        }
        sum.unwrap_or(m[0])
    }

    /// Inverse: the adjugate over the determinant.
    fn inverse(&mut self, m: &[V], n: usize, scalar: Scalar) -> Val {
        let det = self.determinant(m, n);
        let one = self.b.float(1.0);
        let scale = self.op(Code::FDiv, &[one, det]);
        let mut out = Vec::new();
        for c in 0..n {
            for r in 0..n {
                // Entry (r, c) of the inverse is the cofactor of (c, r).
                let minor = minor(m, n, c, r);
                let d = self.determinant(&minor, n - 1);
                let v = self.op(Code::FMul, &[d, scale]);
                let v = self.rounded(v, scalar);
                out.push(if (r + c) % 2 == 0 { v } else { self.op(Code::FNeg, &[v]) });
            }
        }
        Val::Data(out.into())
    }

    /// Converts each component and puts them side by side, the first lowest.
    fn pack(&mut self, x: &[V], code: Code, bits: u32) -> Val {
        let parts: Vec<V> = x.iter().map(|&v| self.op(code, &[v])).collect();
        self.join(&parts, bits)
    }

    fn join(&mut self, parts: &[V], bits: u32) -> Val {
        let mut out = parts[0];
        for (i, &p) in parts.iter().enumerate().skip(1) {
            let shift = self.b.constant(bits * i as u32);
            let moved = self.op(Code::Shl, &[p, shift]);
            out = self.op(Code::Or, &[out, moved]);
        }
        Val::Data([out].into())
    }

    fn pack_bytes(&mut self, x: &[V]) -> Val {
        let mask = self.b.constant(255);
        let parts: Vec<V> = x.iter().map(|&v| self.op(Code::And, &[v, mask])).collect();
        self.join(&parts, 8)
    }

    /// The parts of a packed word, sign-extended or not.
    fn fields(&mut self, x: V, n: u32, signed: bool) -> Vec<V> {
        let width = 32 / n;
        (0..n)
            .map(|i| {
                let left = self.b.constant(32 - width * (i + 1));
                let right = self.b.constant(32 - width);
                let v = self.op(Code::Shl, &[x, left]);
                self.op(if signed { Code::ShrS } else { Code::ShrU }, &[v, right])
            })
            .collect()
    }

    fn unpack_bytes(&mut self, x: V, signed: bool) -> Val {
        Val::Data(self.fields(x, 4, signed).into())
    }

    fn unpack_norm(&mut self, x: V, n: u32, signed: bool, scale: f32) -> Val {
        let (scale, low) = (self.b.float(scale), self.b.float(-1.0));
        let parts = self.fields(x, n, signed);
        let out: Vec<V> = parts
            .into_iter()
            .map(|v| {
                let v = self.op(if signed { Code::SToF } else { Code::UToF }, &[v]);
                let v = self.op(Code::FDiv, &[v, scale]);
                if signed { self.op(Code::FMax, &[v, low]) } else { v }
            })
            .collect();
        Val::Data(out.into())
    }
}

/// A matrix without one row and one column.
fn minor(m: &[V], n: usize, row: usize, column: usize) -> Vec<V> {
    let mut out = Vec::with_capacity((n - 1) * (n - 1));
    for c in (0..n).filter(|&c| c != column) {
        out.extend((0..n).filter(|&r| r != row).map(|r| m[c * n + r]));
    }
    out
}
