//! The table of the machine's functions by call name.

use crate::gl::call::{Arg, Call, Fault, GlResult, Scalar, Shape, core_name, shape};
use crate::gl::calls::elements::{BASED, INSTANCED, RANGE};
use crate::gl::calls::ignored::{nothing, pop_group, push_group};
use crate::gl::calls::indirect::{INDEXED, SEVERAL};
use crate::gl::calls::{
    accumulate, arb, arrays, buffers, elements, environment, evaluator, fragments, framebuffer, glsl, immediate, indirect,
    lists, packed, pixels, raster, rectangles, restart, samplers, saved, texturing, transform, uniforms, window_system,
};
use crate::gl::draw::quads;
use crate::gl::machine::{CallClass, Gl, Handler, Immediate, Run};

fn immediate(core: &str, stem: Option<&str>) -> Immediate {
    match (core, stem) {
        ("Begin", _) => Immediate::Begin,
        ("End", _) => Immediate::End,
        ("EdgeFlag" | "EdgeFlagv", _) => Immediate::Attribute(5),
        ("CallList" | "CallLists" | "PopAttrib", _) => Immediate::Attributes,
        (_, Some("Vertex")) => Immediate::Vertex,
        (_, Some("Normal")) => Immediate::Attribute(1),
        (_, Some("Color")) => Immediate::Attribute(2),
        (_, Some("SecondaryColor")) => Immediate::Attribute(3),
        (_, Some("FogCoord")) => Immediate::Attribute(4),
        (_, Some("TexCoord")) => Immediate::Attribute(8),
        (_, Some("MultiTexCoord")) => Immediate::Unit,
        (_, Some("VertexAttrib" | "VertexAttrib4N" | "VertexAttribP")) => Immediate::Attributes,
        (_, Some("VertexP" | "NormalP" | "ColorP" | "SecondaryColorP" | "TexCoordP" | "MultiTexCoordP")) => {
            Immediate::Attributes
        }
        _ => Immediate::Other,
    }
}

/// `glGetString(GL_VERSION)`: the recorded driver has answered with the version of its context.
fn version(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    if let (Ok(VERSION), Arg::Str(text)) = (call.u32(0), &call.result)
        && gl.log.versions.len() < VERSIONS_MAX
    {
        gl.log.versions.get_or_insert_with(text, || ());
    }
    Ok(())
}

const VERSION: u32 = 0x1f02;
/// Maximum number of versions that are remembered.
const VERSIONS_MAX: usize = 16;

fn unknown(_: &mut Gl, call: &Call, _: Shape) -> GlResult {
    Err(Fault::Unsupported(call.function.name.to_string()))
}

/// The entry of a function by name; an unknown function is refused by name when it is called.
pub fn find(name: &str) -> Handler {
    let plain = Shape { count: 0, scalar: Scalar::Float, vector: false };
    let handler = |(class, run): (CallClass, Run), shape, immediate| Handler { run, class, shape, immediate, factor: None };
    let Some(core) = core_name(name) else { return handler(window_system::find(name), plain, Immediate::Other) };
    if let Some(window) = core.starts_with('X').then(|| window_system::find(name)) {
        return handler(window, plain, Immediate::Other);
    }
    // Its arguments differ from those of the core function with this name.
    if name == "glStencilFuncSeparateATI" {
        return handler((CallClass::Server, fragments::stencil_func_both), plain, Immediate::Other);
    }
    if let Some(found) = exact(core) {
        return Handler { factor: transform::factor(core), ..handler(found, plain, immediate(core, None)) };
    }
    if let Some((stem, shape)) = shape(core)
        && let Some(found) = typed(stem)
    {
        return Handler { factor: transform::factor(stem), ..handler(found, shape, immediate(core, Some(stem))) };
    }
    // It is refused between Begin and End, too.
    handler((CallClass::Element, unknown), plain, Immediate::Other)
}

/// Functions whose names have no types.
fn exact(name: &str) -> Option<(CallClass, Run)> {
    use CallClass::{Arrays, Client, Element, Ignored, Matrix, Server, Vertex};
    let found: (CallClass, Run) = match name {
        "Begin" => (Vertex, immediate::begin),
        "End" => (Vertex, immediate::end),
        "EdgeFlag" | "EdgeFlagv" => (Vertex, immediate::edge_flag),
        "ArrayElement" => (Element, arrays::array_element),
        "CallList" => (Vertex, lists::call_list),
        "CallLists" => (Vertex, lists::call_lists),
        "NewList" => (Client, lists::new_list),
        "EndList" => (Client, lists::end_list),
        "ListBase" => (Server, lists::list_base),
        "DeleteLists" => (Client, lists::delete_lists),
        "EnableClientState" => (Arrays, arrays::enable),
        "DisableClientState" => (Arrays, arrays::disable),
        "ClientActiveTexture" => (Arrays, arrays::client_active),
        "VertexPointer" => (Arrays, arrays::vertex_pointer),
        "NormalPointer" => (Arrays, arrays::normal_pointer),
        "ColorPointer" => (Arrays, arrays::color_pointer),
        "SecondaryColorPointer" => (Arrays, arrays::secondary_pointer),
        "TexCoordPointer" => (Arrays, arrays::texture_pointer),
        "FogCoordPointer" => (Arrays, arrays::fog_pointer),
        "EdgeFlagPointer" => (Arrays, arrays::edge_pointer),
        "InterleavedArrays" => (Arrays, arrays::interleaved),
        "DrawArrays" => (Arrays, elements::draw_arrays),
        "MultiDrawElements" => (Arrays, elements::multi_draw_elements),
        "MultiDrawElementsBaseVertex" => (Arrays, elements::multi_draw_elements),
        "MultiDrawArrays" => (Arrays, elements::multi_draw_arrays),
        "DrawArraysIndirect" => (Client, indirect::draw::<0>),
        "DrawElementsIndirect" => (Client, indirect::draw::<INDEXED>),
        "MultiDrawArraysIndirect" => (Client, indirect::draw::<SEVERAL>),
        "MultiDrawElementsIndirect" => (Client, indirect::draw::<{ INDEXED | SEVERAL }>),
        "DrawElements" => (Arrays, elements::draw_elements::<0>),
        "DrawRangeElements" => (Arrays, elements::draw_elements::<RANGE>),
        "DrawElementsBaseVertex" => (Arrays, elements::draw_elements::<BASED>),
        "DrawRangeElementsBaseVertex" => (Arrays, elements::draw_elements::<{ RANGE | BASED }>),
        "DrawArraysInstanced" => (Arrays, elements::draw_arrays_instanced),
        "DrawElementsInstanced" => (Arrays, elements::draw_elements::<INSTANCED>),
        "DrawElementsInstancedBaseVertex" => (Arrays, elements::draw_elements::<{ INSTANCED | BASED }>),
        "VertexAttribDivisor" => (Arrays, arrays::divisor),
        "PushClientAttrib" => (Client, arrays::push_client),
        "PopClientAttrib" => (Client, arrays::pop_client),
        "BindBuffer" => (Client, buffers::bind),
        "BindBufferBase" => (Server, buffers::bind_part::<false>),
        "BindBufferRange" => (Server, buffers::bind_part::<true>),
        "GetUniformBlockIndex" => (Client, glsl::block_index),
        "GetActiveUniformBlockName" => (Client, glsl::block_name),
        "UniformBlockBinding" => (Server, glsl::block_binding),
        "BufferData" => (Client, buffers::data),
        "BufferStorage" => (Client, buffers::storage),
        "BufferSubData" => (Client, buffers::sub_data),
        "CopyBufferSubData" => (Client, buffers::copy_part),
        "PrimitiveRestart" => (Vertex, immediate::restart),
        "PrimitiveRestartIndex" => (Arrays, restart::index),
        "DeleteBuffers" => (Client, buffers::delete),
        "EnableVertexAttribArray" => (Arrays, arrays::enable_generic),
        "DisableVertexAttribArray" => (Arrays, arrays::disable_generic),
        "VertexAttribPointer" => (Arrays, arrays::generic_pointer),
        "VertexAttribIPointer" => (Arrays, arrays::whole_pointer),
        "BindProgram" => (Server, arb::bind),
        "ProgramString" => (Client, arb::string),
        "DeletePrograms" => (Client, arb::delete),
        "CreateShader" | "CreateShaderObject" => (Client, glsl::create_shader),
        "ShaderSource" => (Client, glsl::shader_source),
        "CompileShader" => (Client, glsl::compile_shader),
        "CreateProgram" | "CreateProgramObject" => (Client, glsl::create_program),
        "AttachShader" | "AttachObject" => (Client, glsl::attach),
        "DetachShader" | "DetachObject" => (Client, glsl::detach),
        "LinkProgram" => (Client, glsl::link_program),
        "UseProgram" | "UseProgramObject" => (Server, glsl::use_program),
        "GetProgramiv" | "GetObjectParameteriv" => (Client, glsl::link_status),
        "DeleteShader" => (Client, glsl::delete_shader),
        "DeleteProgram" => (Client, glsl::delete_program),
        "DeleteObject" => (Client, glsl::delete_object),
        "BindAttribLocation" => (Client, glsl::bind_attribute),
        "BindFragDataLocation" => (Client, glsl::bind_output),
        "BindFragDataLocationIndexed" => (Client, glsl::bind_indexed_output),
        "GetAttribLocation" => (Client, glsl::attribute_location),
        "GetFragDataLocation" => (Client, glsl::output_location),
        "GetUniformLocation" => (Client, glsl::uniform_location),
        "GenVertexArrays" => (Ignored, nothing),
        "BindVertexArray" => (Arrays, arrays::bind_vertex_array),
        "DeleteVertexArrays" => (Client, arrays::delete_vertex_arrays),
        "MatrixMode" => (Matrix, transform::matrix_mode),
        "LoadIdentity" => (Matrix, transform::load_identity),
        "PushMatrix" => (Matrix, transform::push_matrix),
        "PopMatrix" => (Matrix, transform::pop_matrix),
        "Ortho" => (Matrix, transform::ortho),
        "Frustum" => (Matrix, transform::frustum),
        "Viewport" => (Server, transform::viewport),
        "DepthRange" => (Server, transform::depth_range),
        "ClipPlane" => (Server, transform::clip_plane),
        "Enable" => (Server, raster::enable),
        "Disable" => (Server, raster::disable),
        "Enablei" | "EnableIndexed" => (Server, raster::set_of_buffer::<true>),
        "Disablei" | "DisableIndexed" => (Server, raster::set_of_buffer::<false>),
        "PushAttrib" => (Server, saved::push),
        "PopAttrib" => (Server, saved::pop),
        "ShadeModel" => (Server, raster::shade_model),
        "ProvokingVertex" => (Server, raster::provoking_vertex),
        "ColorMaterial" => (Server, raster::color_material),
        "CullFace" => (Server, raster::cull_face),
        "FrontFace" => (Server, raster::front_face),
        "PolygonMode" => (Server, raster::polygon_mode),
        "PolygonOffset" => (Server, raster::polygon_offset),
        "PolygonStipple" => (Server, raster::polygon_stipple),
        "LineWidth" => (Server, raster::line_width),
        "LineStipple" => (Server, raster::line_stipple),
        "PointSize" => (Server, raster::point_size),
        "Scissor" => (Server, fragments::scissor),
        "AlphaFunc" => (Server, fragments::alpha_func),
        "ActiveStencilFace" => (Server, fragments::active_stencil_face),
        "StencilFunc" => (Server, fragments::stencil_func),
        "StencilFuncSeparate" => (Server, fragments::stencil_func_separate),
        "StencilOp" => (Server, fragments::stencil_op),
        "StencilOpSeparate" => (Server, fragments::stencil_op_separate),
        "StencilMaskSeparate" => (Server, fragments::stencil_mask_separate),
        "StencilMask" => (Server, fragments::stencil_mask),
        "DepthFunc" => (Server, fragments::depth_func),
        "DepthMask" => (Server, fragments::depth_mask),
        "BlendFunc" => (Server, fragments::blend_func::<false>),
        "BlendFunci" | "BlendFuncIndexed" => (Server, fragments::blend_func::<true>),
        "BlendFuncSeparate" => (Server, fragments::blend_func_separate::<false>),
        "BlendFuncSeparatei" | "BlendFuncSeparateIndexed" => (Server, fragments::blend_func_separate::<true>),
        "BlendEquation" => (Server, fragments::blend_equation::<false>),
        "BlendEquationi" | "BlendEquationIndexed" => (Server, fragments::blend_equation::<true>),
        "BlendEquationSeparate" => (Server, fragments::blend_equation_separate::<false>),
        "BlendEquationSeparatei" | "BlendEquationSeparateIndexed" => (Server, fragments::blend_equation_separate::<true>),
        "BlendColor" => (Server, fragments::blend_color),
        "LogicOp" => (Server, fragments::logic_op),
        "ColorMask" => (Server, fragments::color_mask::<false>),
        "ColorMaski" | "ColorMaskIndexed" => (Server, fragments::color_mask::<true>),
        "DrawBuffer" => (Server, framebuffer::draw_buffer),
        "DrawBuffers" => (Server, framebuffer::draw_buffers),
        "ReadBuffer" => (Server, framebuffer::read_buffer),
        "BindFramebuffer" => (Server, framebuffer::bind),
        "CheckFramebufferStatus" => (Client, framebuffer::status),
        "DeleteFramebuffers" => (Client, framebuffer::delete),
        "FramebufferTexture1D" | "FramebufferTexture2D" => (Server, framebuffer::texture_1d_or_2d),
        "FramebufferTexture" => (Server, framebuffer::texture_any),
        "FramebufferRenderbuffer" => (Server, framebuffer::renderbuffer),
        "BindRenderbuffer" => (Server, framebuffer::bind_renderbuffer),
        "DeleteRenderbuffers" => (Client, framebuffer::delete_renderbuffers),
        "RenderbufferStorage" => (Server, framebuffer::renderbuffer_storage),
        "RenderbufferStorageMultisample" => (Server, framebuffer::renderbuffer_storage_multisample),
        "BlitFramebuffer" => (Server, framebuffer::blit),
        "GenerateMipmap" => (Server, framebuffer::generate_mipmap),
        "Bitmap" => (Server, rectangles::bitmap),
        "DrawPixels" => (Server, rectangles::draw_pixels),
        "CopyPixels" => (Server, rectangles::copy_pixels),
        "PixelZoom" => (Server, pixels::pixel_zoom),
        "Accum" => (Server, accumulate::accumulate),
        "ClearAccum" => (Server, accumulate::clear_value),
        "BeginQuery" => (Server, accumulate::begin_query),
        "EndQuery" => (Server, accumulate::end_query),
        "MapBuffer" => (Client, buffers::map),
        "MapBufferRange" => (Client, buffers::map_range),
        "UnmapBuffer" => (Client, buffers::unmap),
        "CompressedTexImage2D" => (Server, texturing::compressed_2d),
        "CompressedTexSubImage2D" => (Server, texturing::compressed_part_2d),
        "Clear" => (Server, fragments::clear),
        "ClearBufferfv" | "ClearBufferiv" | "ClearBufferuiv" | "ClearBufferfi" => (Server, fragments::clear_buffer),
        "ClearColor" => (Server, fragments::clear_color),
        "ClearDepth" | "ClearDepthf" => (Server, fragments::clear_depth),
        "ClearStencil" => (Server, fragments::clear_stencil),
        "ActiveTexture" => (Server, texturing::active),
        "BindTexture" => (Server, texturing::bind),
        "BindSampler" => (Server, samplers::bind),
        "DeleteSamplers" => (Client, samplers::delete),
        "DeleteTextures" => (Client, texturing::delete),
        "TexImage1D" => (Server, texturing::image_1d),
        "TexImage2D" => (Server, texturing::image_2d),
        "TexImage3D" => (Server, texturing::image_3d),
        "TexStorage1D" => (Server, texturing::storage_1d),
        "TexStorage2D" => (Server, texturing::storage_2d),
        "TexStorage3D" => (Server, texturing::storage_3d),
        "TexSubImage1D" => (Server, texturing::sub_image_1d),
        "TexSubImage2D" => (Server, texturing::sub_image_2d),
        "TexSubImage3D" => (Server, texturing::sub_image_3d),
        "CopyTexImage1D" => (Server, texturing::copy_image_1d),
        "CopyTexImage2D" => (Server, texturing::copy_image_2d),
        "CopyTexSubImage1D" => (Server, texturing::copy_sub_image_1d),
        "CopyTexSubImage3D" => (Server, texturing::copy_sub_image_3d),
        "CopyTexSubImage2D" => (Server, texturing::copy_sub_image_2d),
        "RenderMode" => (Client, pixels::render_mode),
        "EvalMesh1" => (Server, evaluator::mesh_1),
        "EvalMesh2" => (Server, evaluator::mesh_2),
        "EvalPoint1" => (Vertex, evaluator::point_1),
        "EvalPoint2" => (Vertex, evaluator::point_2),
        "ReadPixels" | "ReadnPixels" | "GetTexImage" | "GetnTexImage" | "GetCompressedTexImage" => {
            (Ignored, buffers::read_back)
        }
        // Calls without an effect on pictures.
        "Flush" | "Finish" => (Ignored, quads::separate),
        "Hint"
        | "FeedbackBuffer"
        | "SelectBuffer"
        | "InitNames"
        | "PushName"
        | "PopName"
        | "LoadName"
        | "PassThrough"
        | "GenFramebuffers"
        | "GenRenderbuffers"
        | "DeleteQueries"
        | "FlushMappedBufferRange"
        | "GenLists"
        | "GenTextures"
        | "GenSamplers"
        | "GenBuffers"
        | "GenQueries"
        | "QueryCounter"
        | "InvalidateFramebuffer"
        | "InvalidateSubFramebuffer"
        | "InvalidateBufferData"
        | "InvalidateBufferSubData"
        | "InvalidateTexImage"
        | "InvalidateTexSubImage"
        | "DiscardFramebuffer"
        | "GenPrograms"
        | "ValidateProgram"
        | "ReleaseShaderCompiler"
        | "LockArrays"
        | "UnlockArrays"
        | "ClearIndex"
        | "IndexMask"
        | "IndexPointer"
        | "PrioritizeTextures"
        | "AreTexturesResident"
        | "SampleCoverage"
        | "DebugMessageCallback"
        | "DebugMessageControl"
        | "DebugMessageInsert"
        | "ObjectLabel"
        | "ObjectPtrLabel"
        | "InsertEventMarker"
        | "FenceSync"
        | "ClientWaitSync"
        | "WaitSync"
        | "DeleteSync"
        | "StringMarkerGREMEDY"
        | "GetError"
        | "GetStringi" => (Ignored, nothing),
        "PushDebugGroup" | "PushGroupMarker" => (Ignored, push_group),
        "PopDebugGroup" | "PopGroupMarker" => (Ignored, pop_group),
        "GetString" => (Ignored, version),
        _ if name.starts_with("Get") || name.starts_with("Is") => (Ignored, nothing),
        _ => return None,
    };
    Some(found)
}

/// Functions whose names end in a type.
fn typed(stem: &str) -> Option<(CallClass, Run)> {
    use CallClass::{Client, Ignored, Matrix, Server, Vertex};
    let found: (CallClass, Run) = match stem {
        "Vertex" => (Vertex, immediate::vertex),
        "Normal" => (Vertex, immediate::normal),
        "Color" => (Vertex, immediate::color),
        "SecondaryColor" => (Vertex, immediate::secondary),
        "FogCoord" => (Vertex, immediate::fog_coordinate),
        "TexCoord" => (Vertex, immediate::texture),
        "MultiTexCoord" => (Vertex, immediate::multi_texture),
        "VertexP" => (Vertex, packed::vertex),
        "NormalP" => (Vertex, packed::normal),
        "ColorP" => (Vertex, packed::color),
        "SecondaryColorP" => (Vertex, packed::secondary),
        "TexCoordP" => (Vertex, packed::texture),
        "MultiTexCoordP" => (Vertex, packed::multi_texture),
        "VertexAttribP" => (Vertex, packed::attribute),
        "VertexAttrib" => (Vertex, arb::attribute),
        "VertexAttrib4N" => (Vertex, arb::attribute_normalized),
        "ProgramEnvParameter" => (Server, arb::environment),
        "ProgramLocalParameter" => (Server, arb::local),
        "ProgramEnvParameters" => (Server, arb::environments),
        "ProgramLocalParameters" => (Server, arb::locals),
        "Uniform" => (Server, uniforms::uniform::<false>),
        "UniformMatrix" => (Server, uniforms::uniform_matrix::<false>),
        "UniformMatrix2x" | "UniformMatrix3x" | "UniformMatrix4x" => (Server, uniforms::uniform_matrix_of::<false>),
        "ProgramUniform" => (Server, uniforms::uniform::<true>),
        "ProgramUniformMatrix" => (Server, uniforms::uniform_matrix::<true>),
        "ProgramUniformMatrix2x" | "ProgramUniformMatrix3x" | "ProgramUniformMatrix4x" => {
            (Server, uniforms::uniform_matrix_of::<true>)
        }
        "Rect" => (Server, immediate::rectangle),
        "EvalCoord" => (Vertex, evaluator::coordinate),
        "Material" => (Vertex, raster::material),
        "Light" => (Server, raster::light),
        "LightModel" => (Server, raster::light_model),
        "Fog" => (Server, raster::fog),
        "PointParameter" => (Server, raster::point_parameter),
        "LoadMatrix" => (Matrix, transform::load_matrix),
        "LoadTransposeMatrix" => (Matrix, transform::load_transposed),
        "MultMatrix" => (Matrix, transform::multiply_matrix),
        "MultTransposeMatrix" => (Matrix, transform::multiply_transposed),
        "Rotate" => (Matrix, transform::rotate),
        "Scale" => (Matrix, transform::scale),
        "Translate" => (Matrix, transform::translate),
        "DepthRange" => (Server, transform::depth_range),
        "TexParameter" => (Server, samplers::parameter),
        "SamplerParameter" => (Server, samplers::sampler_parameter),
        "TexEnv" => (Server, environment::environment),
        "TexGen" => (Server, environment::generation),
        "PixelStore" => (Client, pixels::pixel_store),
        "PixelTransfer" => (Server, pixels::pixel_transfer),
        "PixelMap" => (Server, pixels::pixel_map),
        "RasterPos" => (Server, pixels::raster_position),
        "WindowPos" => (Server, pixels::window_position),
        "Map" => (Server, evaluator::map),
        "MapGrid" => (Server, evaluator::grid),
        "Index" => (Ignored, nothing),
        _ => return None,
    };
    Some(found)
}
