//! Operations on fragments.

use gfx::state::*;
use gl_shader::{COLORS_MAX, consts as e};

use crate::gl::call::{Fault, GlResult, INVALID_ENUM};
use crate::gl::names;

/// Stencil state of one side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stencil {
    /// Comparison.
    pub compare: u32,
    /// Reference.
    pub reference: i32,
    /// Mask of the comparison.
    pub read: u32,
    /// Operations: fail, depth fail, pass.
    pub ops: [u32; 3],
    /// Mask of writes.
    pub write: u32,
}

/// The stencil test.
#[derive(Clone, Debug)]
pub struct StencilTest {
    /// Front and back.
    pub sides: [Stencil; 2],
    /// The active face, if the program has set one (EXT_stencil_two_side).
    pub active_face: Option<u32>,
    /// Clear value.
    pub clear: i32,
}

impl Default for StencilTest {
    fn default() -> Self {
        let side = Stencil { compare: e::ALWAYS, reference: 0, read: !0, ops: [e::KEEP; 3], write: !0 };
        StencilTest { sides: [side; 2], active_face: None, clear: 0 }
    }
}

/// The depth test.
#[derive(Clone, Debug)]
pub struct DepthTest {
    /// Comparison.
    pub func: u32,
    /// Whether depths are written.
    pub write: bool,
    /// Clear value.
    pub clear: f32,
}

impl Default for DepthTest {
    fn default() -> Self {
        DepthTest { func: e::LESS, write: true, clear: 1.0 }
    }
}

/// How colours are tested, blended and written.
#[derive(Clone, Debug)]
pub struct ColorState {
    /// Alpha test: comparison and reference.
    pub alpha_test: (u32, f32),
    /// How each of the colour buffers is blended and written, in the order in which they are drawn to.
    pub writes: [ColorWrites; COLORS_MAX],
    /// Blend constant.
    pub blend_constant: [f32; 4],
    /// Logic operation.
    pub logic: u32,
    /// Clear value.
    pub clear: [f32; 4],
    /// The window's colour buffer that is drawn to.
    pub draw_buffer: u32,
}

impl Default for ColorState {
    fn default() -> Self {
        ColorState {
            alpha_test: (e::ALWAYS, 0.0),
            writes: [ColorWrites::default(); COLORS_MAX],
            blend_constant: [0.0; 4],
            logic: e::COPY,
            clear: [0.0; 4],
            draw_buffer: e::BACK,
        }
    }
}

/// How a colour buffer is blended and written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ColorWrites {
    /// Whether colours are blended.
    pub blended: bool,
    /// Blend factors: source and destination of colour, of alpha.
    pub factors: [u32; 4],
    /// Blend equations of colour and alpha.
    pub ops: [u32; 2],
    /// Channels that are written.
    pub mask: u8,
}

impl Default for ColorWrites {
    fn default() -> Self {
        ColorWrites { blended: false, factors: [e::ONE, e::ZERO, e::ONE, e::ZERO], ops: [e::FUNC_ADD; 2], mask: 15 }
    }
}

/// A comparison of the card.
pub fn compare(value: u32) -> Compare {
    match value {
        e::NEVER => Compare::Never,
        e::LESS => Compare::Less,
        e::EQUAL => Compare::Equal,
        e::LEQUAL => Compare::LessEqual,
        e::GREATER => Compare::Greater,
        e::NOTEQUAL => Compare::NotEqual,
        e::GEQUAL => Compare::GreaterEqual,
        _ => Compare::Always,
    }
}

/// A stencil operation of the card.
pub fn stencil_operation(op: u32) -> GlResult<StencilOp> {
    use gfx::state::StencilOp;
    Ok(match op {
        e::KEEP => StencilOp::Keep,
        e::ZERO => StencilOp::Zero,
        e::REPLACE => StencilOp::Replace,
        e::INCR => StencilOp::IncrementClamp,
        e::DECR => StencilOp::DecrementClamp,
        e::INVERT => StencilOp::Invert,
        e::INCR_WRAP => StencilOp::IncrementWrap,
        e::DECR_WRAP => StencilOp::DecrementWrap,
        _ => return Err(INVALID_ENUM),
    })
}

/// A blend factor of the card.
pub fn blend_factor(factor: u32, alpha: bool) -> GlResult<BlendFactor> {
    use gfx::state::BlendFactor as F;
    Ok(match factor {
        e::ZERO => F::Zero,
        e::ONE => F::One,
        e::SRC_COLOR => F::Src,
        e::ONE_MINUS_SRC_COLOR => F::OneMinusSrc,
        e::SRC_ALPHA => F::SrcAlpha,
        e::ONE_MINUS_SRC_ALPHA => F::OneMinusSrcAlpha,
        e::DST_COLOR => F::Dst,
        e::ONE_MINUS_DST_COLOR => F::OneMinusDst,
        e::DST_ALPHA => F::DstAlpha,
        e::ONE_MINUS_DST_ALPHA => F::OneMinusDstAlpha,
        e::SRC_ALPHA_SATURATE => F::SrcAlphaSaturated,
        e::SRC1_COLOR => F::Src1,
        e::ONE_MINUS_SRC1_COLOR => F::OneMinusSrc1,
        e::SRC1_ALPHA => F::Src1Alpha,
        e::ONE_MINUS_SRC1_ALPHA => F::OneMinusSrc1Alpha,
        // Either this is an alpha factor, or all channels of the card's constant are its alpha.
        e::CONSTANT_ALPHA if alpha => F::Constant,
        e::ONE_MINUS_CONSTANT_ALPHA if alpha => F::OneMinusConstant,
        e::CONSTANT_COLOR => F::Constant,
        e::ONE_MINUS_CONSTANT_COLOR => F::OneMinusConstant,
        e::CONSTANT_ALPHA | e::ONE_MINUS_CONSTANT_ALPHA => {
            return Err(Fault::Unsupported(format!(
                "blend factor {} beside one of the constant's colour",
                names::name(factor)
            )));
        }
        _ => return Err(INVALID_ENUM),
    })
}

/// A blend operation of the card.
pub fn blend_operation(op: u32) -> GlResult<BlendOp> {
    use gfx::state::BlendOp;
    Ok(match op {
        e::FUNC_ADD => BlendOp::Add,
        e::FUNC_SUBTRACT => BlendOp::Subtract,
        e::FUNC_REVERSE_SUBTRACT => BlendOp::ReverseSubtract,
        e::MIN => BlendOp::Min,
        e::MAX => BlendOp::Max,
        _ => return Err(INVALID_ENUM),
    })
}
