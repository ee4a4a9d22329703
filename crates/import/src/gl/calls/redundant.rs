//! Calls that set what is set already. Programs make many of them, above all in display lists. They end a batch as other calls do, but what is
//! prepared for draws stays.

use gl_shader::{TARGETS, consts as e};

use crate::gl::machine::{Gl, IsRedundant};
use crate::gl::state::server::capability;
use crate::gl::state::texturing::target_of;

/// The test for a function, by its name; none: it always changes something.
pub fn test(core: &str) -> Option<IsRedundant> {
    Some(match core {
        "ActiveTexture" => |_, call| Ok(call.image_unit(0).is_ok()),
        "AlphaFunc" => |gl, call| Ok((call.u32(0)?, call.f32(1)?) == gl.state.color.alpha_test),
        "BindTexture" => |gl, call| {
            let (target, name) = (target_of(call.u32(0)?)?, call.u32(1)?);
            Ok(gl.state.texturing.units[gl.state.texturing.active].bound[target] == name
                && (name == 0 || gl.objects.textures.contains(name)))
        },
        "BlendFunc" => |gl, call| {
            let [source, destination] = [call.u32(0)?, call.u32(1)?];
            Ok(gl.state.color.writes.iter().all(|writes| writes.factors == [source, destination, source, destination]))
        },
        "CullFace" => |gl, call| Ok(call.u32(0)? == gl.state.polygon.cull),
        "DepthFunc" => |gl, call| Ok(call.u32(0)? == gl.state.depth.func),
        "DepthMask" => |gl, call| Ok(call.bool(0)? == gl.state.depth.write),
        "Disable" => |gl, call| Ok(is(gl, call.u32(0)?) == Some(false)),
        "Enable" => |gl, call| Ok(is(gl, call.u32(0)?) == Some(true)),
        "FrontFace" => |gl, call| Ok(call.u32(0)? == gl.state.polygon.front),
        "LineWidth" => |gl, call| Ok(call.f32(0)? == gl.state.line.width),
        "PolygonMode" => |gl, call| Ok(call.u32(0)? == e::FRONT_AND_BACK && gl.state.polygon.modes == [call.u32(1)?; 2]),
        "ShadeModel" => |gl, call| Ok(call.u32(0)? == if gl.state.lighting.flat { e::FLAT } else { e::SMOOTH }),
        _ => return None,
    })
}

/// Whether a capability is enabled, of those that many programs switch.
fn is(gl: &Gl, cap: u32) -> Option<bool> {
    if capability(cap).is_some() {
        return Some(gl.state.is(cap));
    }
    if let Some(k) = TARGETS.iter().position(|&target| target == cap) {
        return Some(gl.state.texturing.units[gl.state.texturing.active].enabled & 1 << k != 0);
    }
    let [first, others @ ..] = &gl.state.color.writes;
    (cap == e::BLEND && others.iter().all(|writes| writes.blended == first.blended)).then_some(first.blended)
}
