//! Calls of built-in numeric functions.

use super::types::{F32, I32, U32};
use super::{Generator, Scalar, Ty};

const FLOAT_1: [&str; 30] = [
    "abs",
    "acos",
    "acosh",
    "asin",
    "asinh",
    "atan",
    "atanh",
    "ceil",
    "cos",
    "cosh",
    "degrees",
    "exp",
    "exp2",
    "floor",
    "fract",
    "inverseSqrt",
    "log",
    "log2",
    "radians",
    "round",
    "saturate",
    "sign",
    "sin",
    "sinh",
    "sqrt",
    "tan",
    "tanh",
    "trunc",
    "abs",
    "floor",
];
const INTEGER_1: [&str; 7] =
    ["abs", "countLeadingZeros", "countOneBits", "countTrailingZeros", "firstLeadingBit", "firstTrailingBit", "reverseBits"];

impl Generator<'_, '_> {
    /// A built-in function with a result of a numeric scalar or vector type.
    pub fn builtin(&mut self, ty: &Ty, d: u32) -> String {
        match ty {
            Ty::Scalar(s) | Ty::Vector(_, s) if s.is_float() => self.float_builtin(ty, *s, d),
            Ty::Scalar(s) | Ty::Vector(_, s) => self.integer_builtin(ty, *s, d),
            _ => self.live(ty),
        }
    }

    fn some(&mut self, ty: &Ty, d: u32) -> String {
        if d == 0 { self.live(ty) } else { self.expr(ty, d) }
    }

    fn float_builtin(&mut self, ty: &Ty, s: Scalar, d: u32) -> String {
        let a = self.live(ty);
        let b = self.some(ty, d);
        let same = |s| match ty {
            Ty::Vector(n, _) => Ty::Vector(*n, s),
            _ => Ty::Scalar(s),
        };
        let pick = match ty {
            // Vectors have functions of their own.
            Ty::Vector(..) if self.r.percent(40) => 21,
            Ty::Scalar(_) if self.r.percent(20) => 19,
            _ => self.r.below(20),
        };
        match (pick, ty) {
            (0..=4, _) => format!("{}({a})", self.r.one(&FLOAT_1)),
            // A known exponent becomes products, whose bits are the general function's where all is exact.
            (5, Ty::Scalar(Scalar::F32)) => {
                let (n, c) = (self.live(&U32), self.condition(0));
                let base = format!("exp2(f32({n} & 7u))");
                let base = if self.r.percent(50) { base } else { format!("select({base}, -{base}, {c})") };
                format!("pow({base}, {}f)", self.r.one(&["1.0", "2.0", "3.0", "5.0", "8.0", "128.0"]))
            }
            (5 | 6, _) => format!("{a} * {}({b})", self.r.one(&FLOAT_1)),
            (7, _) => format!("atan2({a}, {b})"),
            (8, _) => format!("max({a}, {b})"),
            (9, _) => format!("min({a}, {b})"),
            // The exponent is nothing that the compiler knows.
            (10, Ty::Vector(n, _)) => {
                let e = if s == Scalar::F16 { "vec4<f16>(uni.f)" } else { "uni.f" };
                format!("pow({a}, {e}.{})", &"xyzw"[..*n as usize])
            }
            (10, _) => format!("pow({a}, {}(uni.f.y))", s.text()),
            (11, _) => format!("step({a}, {b})"),
            (12, _) => format!("clamp({a}, {b}, {})", self.live(ty)),
            (13, _) => format!("fma({a}, {b}, {})", self.live(ty)),
            (14, Ty::Vector(..)) if self.r.percent(50) => format!("mix({a}, {b}, {})", self.live(&Ty::Scalar(s))),
            (14, _) => format!("mix({a}, {b}, {})", self.live(ty)),
            (15, _) => format!("smoothstep({a}, {}, {b})", self.live(ty)),
            (16, _) => format!("ldexp({a}, {})", self.live(&same(Scalar::I32))),
            (17, _) => format!("modf({a}).{}", self.r.one(&["fract", "whole"])),
            (18, _) if s == Scalar::F32 => format!("frexp({a}).fract"),
            (18, _) => format!("saturate({a})"),
            (_, Ty::Scalar(_)) => {
                let n = 2 + self.r.below(3);
                let v = Ty::Vector(n, s);
                let (a, b) = (self.live(&v), self.some(&v, d));
                match self.r.below(6) {
                    0 => format!("dot({a}, {b})"),
                    // A component that is known to be one needs no product.
                    1 => format!("dot(vec2<{0}>({1}, 1.0), vec2<{0}>({2}))", s.text(), self.live(ty), self.live(ty)),
                    2 => format!("length({a})"),
                    3 => format!("distance({a}, {b})"),
                    4 => format!("length({})", self.live(ty)),
                    _ => format!("determinant({})", self.live(&Ty::Matrix(n, n, s))),
                }
            }
            (_, Ty::Vector(n, _)) => match self.r.below(9) {
                0 | 1 => format!("normalize({a})"),
                2 => format!("reflect({a}, {b})"),
                3 => format!("refract({a}, {b}, {})", self.live(&Ty::Scalar(s))),
                4 => format!("faceForward({a}, {b}, {})", self.live(ty)),
                5..=7 if *n == 3 => format!("cross({a}, {b})"),
                5..=7 if *n == 4 && s == Scalar::F32 => {
                    format!("{}({})", self.r.one(&["unpack4x8snorm", "unpack4x8unorm"]), self.live(&U32))
                }
                5..=7 if *n == 2 && s == Scalar::F32 => {
                    let f = *self.r.one(&["unpack2x16snorm", "unpack2x16unorm", "unpack2x16float"]);
                    format!("{f}({})", self.live(&U32))
                }
                _ if s == Scalar::F32 => format!("quantizeToF16({a})"),
                _ => format!("fract({a})"),
            },
            _ => a,
        }
    }

    fn integer_builtin(&mut self, ty: &Ty, s: Scalar, d: u32) -> String {
        let a = self.live(ty);
        let b = self.some(ty, d);
        let floats = self.style.scalars.contains(&Scalar::F32);
        match (self.r.below(14), ty) {
            (0..=3, _) => format!("{}({a})", self.r.one(&INTEGER_1)),
            (4, _) => format!("max({a}, {b})"),
            (5, _) => format!("min({a}, {b})"),
            (6, _) => format!("clamp({a}, {b}, {})", self.live(ty)),
            (7, _) => format!("extractBits({a}, {}, {})", self.live(&U32), self.live(&U32)),
            (8, _) => format!("insertBits({a}, {b}, {}, {})", self.live(&U32), self.live(&U32)),
            (9, Ty::Scalar(_)) => {
                let v = Ty::Vector(2 + self.r.below(3), s);
                format!("dot({}, {})", self.live(&v), self.some(&v, d))
            }
            (10, Ty::Scalar(_)) => {
                let f = if s == Scalar::I32 { "dot4I8Packed" } else { "dot4U8Packed" };
                format!("{f}({}, {})", self.live(&U32), self.live(&U32))
            }
            (9 | 10, Ty::Vector(4, _)) => {
                let f = if s == Scalar::I32 { "unpack4xI8" } else { "unpack4xU8" };
                format!("{f}({})", self.live(&U32))
            }
            (11, Ty::Scalar(Scalar::U32)) if floats => {
                let (f, n) = *self.r.one(&[
                    ("pack4x8snorm", 4),
                    ("pack4x8unorm", 4),
                    ("pack2x16snorm", 2),
                    ("pack2x16unorm", 2),
                    ("pack2x16float", 2),
                ]);
                let parts: Vec<String> = (0..n).map(|_| format!("number({})", self.live(&F32))).collect();
                format!("{f}(vec{n}<f32>({}))", parts.join(", "))
            }
            (12, Ty::Scalar(Scalar::U32)) => match self.r.below(2) {
                0 => format!("{}({})", self.r.one(&["pack4xI8", "pack4xI8Clamp"]), self.live(&Ty::Vector(4, Scalar::I32))),
                _ => format!("{}({})", self.r.one(&["pack4xU8", "pack4xU8Clamp"]), self.live(&Ty::Vector(4, Scalar::U32))),
            },
            (11, _) if s == Scalar::I32 => format!("sign({a})"),
            (12, Ty::Scalar(Scalar::I32)) if floats => format!("frexp({}).exp", self.live(&F32)),
            (13, Ty::Scalar(Scalar::U32)) if floats => format!("bits_of({})", self.live(&F32)),
            (13, Ty::Scalar(Scalar::I32)) => format!("i32({})", self.live(&I32)),
            _ => format!("{}({a})", self.r.one(&INTEGER_1)),
        }
    }
}
