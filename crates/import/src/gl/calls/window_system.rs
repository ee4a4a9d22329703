//! Calls of the window systems (GLX, EGL, WGL, CGL): contexts, what is current, drawables, and swaps of their buffers.

use crate::gl::call::{Arg, Call, Fault, GlResult, INVALID_OPERATION, Shape};
use crate::gl::calls::ignored::nothing;
use crate::gl::calls::{buffers, framebuffer};
use crate::gl::draw::frames::check_size;
use crate::gl::machine::{CallClass, Gl, Run};
use crate::gl::state::contexts::Current;

/// The function of a name; what is not known has no effect on pictures.
pub fn find(name: &str) -> (CallClass, Run) {
    let run: Run = match name {
        "glXSwapBuffers"
        | "glXSwapBuffersMscOML"
        | "eglSwapBuffers"
        | "eglSwapBuffersWithDamageKHR"
        | "eglSwapBuffersWithDamageEXT" => swap::<1>,
        "wglSwapBuffers" | "wglSwapLayerBuffers" | "SwapBuffers" | "CGLFlushDrawable" => swap::<0>,
        "glXCreateContext" | "eglCreateContext" | "glXCreateContextAttribsARB" => create::<2>,
        "glXCreateNewContext" | "glXCreateContextWithConfigSGIX" => create::<3>,
        "wglCreateContextAttribsARB" => create::<1>,
        "wglCreateContext" | "wglCreateLayerContext" => create::<UNSHARED>,
        "CGLCreateContext" => create_cgl,
        "glXDestroyContext" | "eglDestroyContext" => destroy::<1>,
        "CGLDestroyContext" | "CGLReleaseContext" => destroy::<0>,
        "wglDeleteContext" => delete_wgl,
        "glXMakeCurrent" => make_current::<1, 1, 2>,
        "glXMakeContextCurrent" | "glXMakeCurrentReadSGI" | "eglMakeCurrent" => make_current::<1, 2, 3>,
        "wglMakeCurrent" => make_current::<0, 0, 1>,
        "wglMakeContextCurrentARB" | "wglMakeContextCurrentEXT" => make_current::<0, 1, 2>,
        "CGLSetCurrentContext" => make_current_cgl,
        "eglReleaseThread" => release_thread,
        "wglShareLists" => share_wgl,
        "glXCreateWindow" => create_glx_window,
        "glXCreatePbuffer" => create_pbuffer::<2, 0x8041, 0x8040>,
        "eglCreatePbufferSurface" => create_pbuffer::<2, 0x3057, 0x3056>,
        "glXCreateGLXPbufferSGIX" | "wglCreatePbufferARB" => create_pbuffer_of_size,
        "wglGetPbufferDCARB" => pbuffer_dc,
        "glXDestroyWindow"
        | "glXDestroyPbuffer"
        | "glXDestroyPixmap"
        | "glXDestroyGLXPixmap"
        | "glXDestroyGLXPbufferSGIX"
        | "eglDestroySurface" => destroy_window::<1>,
        "wglDestroyPbufferARB" => destroy_window::<0>,
        "glXCopyContext"
        | "wglCopyContext"
        | "CGLCopyContext"
        | "glXBindTexImageEXT"
        | "eglBindTexImage"
        | "wglBindTexImageARB"
        | "CGLTexImagePBuffer"
        | "CGLTexImageIOSurface2D" => refused,
        "eglChooseConfig" | "glXChooseFBConfig" | "glXChooseVisual" => framebuffer::choose,
        "memcpy" => buffers::copy,
        _ => return (CallClass::Ignored, nothing),
    };
    (CallClass::System, run)
}

/// The value by which a recording calls a context or a drawable; none: there is none.
fn handle(arg: &Arg) -> Option<u64> {
    match arg {
        Arg::Pointer(0) => None,
        Arg::Pointer(handle) => Some(*handle),
        Arg::Num(number) if *number > 0.0 => Some(*number as u64),
        Arg::Nums(numbers) => numbers.first().filter(|&&number| number > 0.0).map(|&number| number as u64),
        Arg::List(list) => list.first().and_then(handle),
        _ => None,
    }
}

/// Whether a call has failed, as the recording says. GLX, EGL and WGL return whether a call succeeded, CGL an error.
fn failed(call: &Call) -> bool {
    let cgl = call.function.name.starts_with("CGL");
    matches!(call.result, Arg::Num(result) if (result == 0.0) != cgl)
}

fn refused(_: &mut Gl, call: &Call, _: Shape) -> GlResult {
    Err(Fault::Unsupported(call.function.name.to_string()))
}

/// The argument of [`create`] where no context is shared.
const UNSHARED: usize = usize::MAX;

/// A call that returns a new context; the argument `SHARE` is the one whose objects it shares.
fn create<const SHARE: usize>(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    match handle(&call.result) {
        Some(context) => gl.create_context(context, handle(call.arg(SHARE))),
        None => Ok(()),
    }
}

/// `CGLCreateContext(format, share, context)`
fn create_cgl(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    match handle(call.arg(2)) {
        Some(context) if !failed(call) => gl.create_context(context, handle(call.arg(1))),
        _ => Ok(()),
    }
}

fn destroy<const CONTEXT: usize>(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    match handle(call.arg(CONTEXT)) {
        Some(context) => gl.destroy_context(context),
        None => Ok(()),
    }
}

/// `wglDeleteContext(context)`: it is current no more in the thread that calls.
fn delete_wgl(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    if failed(call) {
        return Ok(());
    }
    if let Some(context) = handle(call.arg(0))
        && gl.contexts.now.context.is_some_and(|now| gl.contexts.known(context) == Some(now))
    {
        gl.make_current(Current::NONE)?;
    }
    destroy::<0>(gl, call, shape)
}

/// A call that makes a context current, with the drawables that it draws to and reads.
fn make_current<const DRAW: usize, const READ: usize, const CONTEXT: usize>(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    if failed(call) {
        return Ok(());
    }
    let drawables = [call.arg(DRAW), call.arg(READ)].map(handle);
    current(gl, handle(call.arg(CONTEXT)), drawables)
}

/// `CGLSetCurrentContext(context)`: a context of CGL has one drawable.
fn make_current_cgl(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    if failed(call) {
        return Ok(());
    }
    let context = handle(call.arg(0));
    current(gl, context, [context; 2])
}

fn current(gl: &mut Gl, context: Option<u64>, [draw, read]: [Option<u64>; 2]) -> GlResult {
    let Some(context) = context else { return gl.make_current(Current::NONE) };
    let context = gl.known_context(context)?;
    let draw_number = draw.map(|draw| gl.card.windows.number(draw)).transpose()?;
    let read_number = read.map(|read| gl.card.windows.number(read)).transpose()?;
    // Pixel buffers get their images when they are current.
    for (handle, number) in [(draw, draw_number), (read, read_number)] {
        if let (Some(handle), Some(number)) = (handle, number)
            && let Some(size) = gl.card.windows.take_size(handle)
        {
            check_size(size)?;
            gl.card.open_off_screen(number, size);
        }
    }
    gl.make_current(Current { context: Some(context), draw: draw_number, read: read_number })
}

fn release_thread(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    if failed(call) { Ok(()) } else { gl.make_current(Current::NONE) }
}

/// `wglShareLists(context, other)`: the other one shares the objects of the first.
fn share_wgl(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    match (handle(call.arg(0)), handle(call.arg(1))) {
        (Some(from), Some(with)) if !failed(call) => gl.share(from, with),
        _ => Ok(()),
    }
}

/// `glXCreateWindow(display, config, window, attributes)`
fn create_glx_window(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    if let (Some(window), Some(of)) = (handle(&call.result), handle(call.arg(2))) {
        gl.card.windows.alias(window, of);
    }
    Ok(())
}

/// A call that returns a new pixel buffer with this list of attributes, among them the width and the height.
fn create_pbuffer<const LIST: usize, const WIDTH: u32, const HEIGHT: u32>(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let Some(buffer) = handle(&call.result) else { return Ok(()) };
    let list = call.numbers(LIST).unwrap_or_default();
    let of = |name: u32| {
        let pair = list.chunks_exact(2).find(|pair| pair[0] == f64::from(name));
        pair.map_or(0, |pair| pair[1] as u32)
    };
    gl.card.windows.off_screen(buffer, [of(WIDTH), of(HEIGHT)]);
    Ok(())
}

/// `glXCreateGLXPbufferSGIX(display, config, width, height, attributes)`, `wglCreatePbufferARB(dc, format, width, height, attributes)`
fn create_pbuffer_of_size(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    if let Some(buffer) = handle(&call.result) {
        gl.card.windows.off_screen(buffer, [call.size(2)?, call.size(3)?]);
    }
    Ok(())
}

/// `wglGetPbufferDCARB(buffer)`
fn pbuffer_dc(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    if let (Some(dc), Some(buffer)) = (handle(&call.result), handle(call.arg(0))) {
        gl.card.windows.alias(dc, buffer);
    }
    Ok(())
}

fn destroy_window<const WINDOW: usize>(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    if let Some(window) = handle(call.arg(WINDOW)).filter(|_| !failed(call)) {
        gl.destroy_window(window);
    }
    Ok(())
}

/// A call that swaps the buffers of a drawable, of a context for CGL.
fn swap<const DRAWABLE: usize>(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    if gl.context.open_primitive.is_some() {
        return Err(INVALID_OPERATION);
    }
    let drawable = handle(call.arg(DRAWABLE)).unwrap_or(0);
    if !gl.contexts.explicit {
        if gl.card.size() == [0; 2] {
            // Nothing has been drawn that could be shown.
            return gl.flush();
        }
        let number = unnamed(gl, drawable);
        return gl.swap(number);
    }
    let number = match (gl.card.windows.known(drawable), gl.contexts.now.draw) {
        (Some(number), _) => number,
        // A window has several device contexts.
        (None, Some(now)) if call.function.name.starts_with(['w', 'S']) => now,
        (None, _) => gl.card.windows.number(drawable)?,
    };
    gl.swap(number)
}

/// The window of a drawable in a recording without a call that makes a context current: all that is drawn goes to one window. A drawable that
/// replaces another is the same window.
fn unnamed(gl: &mut Gl, drawable: u64) -> u32 {
    let windows = &mut gl.card.windows;
    let again = windows.known(drawable).is_some() && windows.last != Some(drawable);
    windows.last = Some(drawable);
    windows.rename(drawable, 0);
    if again {
        gl.log.refuse("windows that are drawn in turn, without a call that makes a context current".into());
    }
    0
}
