//! Texture objects and their images.

use gfx::format::Format;
use gl_shader::consts as e;
use gl_shader::key::Base;
use num::float_bytes;

use crate::gl::call::{Call, Fault, GlResult, INVALID_ENUM, INVALID_OPERATION, INVALID_VALUE, Shape};
use crate::gl::card::device::Card;
use crate::gl::machine::Gl;
use crate::gl::names;
use crate::gl::state::texture::{Level, Texture};
use crate::gl::state::texturing::{kind_of, target_of};
use crate::gl::texels::image::base_of;
use crate::gl::texels::image::{self, StoredFormat};
use crate::gl::texels::s3tc;
use crate::gl::texels::unpack::can_have;

/// Limits: size of textures, size of 3D textures, and texels of one image.
const EDGE_MAX: u32 = 16_384;
const EDGE_3D_MAX: u32 = 2_048;
const TEXELS_MAX: u64 = 1 << 26;

pub fn active(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let unit = call.image_unit(0)?;
    gl.state.texturing.reach(unit);
    gl.state.texturing.active = unit;
    Ok(())
}

pub fn bind(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (target, name) = (target_of(call.u32(0)?)?, call.u32(1)?);
    let kind = kind_of(target);
    if name != 0 && gl.objects.textures.get_or_insert_with(name, || Texture::new(kind)).kind != kind {
        return Err(INVALID_OPERATION);
    }
    gl.state.texturing.units[gl.state.texturing.active].bound[target] = name;
    Ok(())
}

pub fn delete(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.flush()?;
    for &name in call.numbers(1)?.iter() {
        let name = name as u32;
        if let Some(mut texture) = gl.objects.textures.remove(name).filter(|_| name != 0) {
            gl.contexts.sharing().for_each(|context| context.lose_texture(name));
            gl.part_from_texture(name);
            texture.free(&mut gl.card);
            for bound in gl.state.texturing.units.iter_mut().flat_map(|unit| &mut unit.bound).filter(|bound| **bound == name) {
                *bound = 0;
            }
        }
    }
    Ok(())
}

/// The target and face of an image call; none for a proxy.
fn image_target(target: u32, allowed: &[u32]) -> GlResult<Option<(usize, u32)>> {
    let proxies =
        [e::PROXY_TEXTURE_1D, e::PROXY_TEXTURE_2D, e::PROXY_TEXTURE_3D, e::PROXY_TEXTURE_CUBE_MAP, e::PROXY_TEXTURE_RECTANGLE];
    if proxies.contains(&target) {
        return Ok(None);
    }
    let face = target.wrapping_sub(e::TEXTURE_CUBE_MAP_POSITIVE_X);
    if face < 6 && allowed.contains(&e::TEXTURE_2D) {
        return Ok(Some((target_of(e::TEXTURE_CUBE_MAP)?, face)));
    }
    let found = target_of(target)?;
    if allowed.contains(&target) { Ok(Some((found, 0))) } else { Err(INVALID_ENUM) }
}

const PLANAR: &[u32] = &[e::TEXTURE_2D, e::TEXTURE_RECTANGLE];

/// Runs a function on the texture bound to a target of the active unit, and the card.
pub fn with<T>(gl: &mut Gl, target: usize, run: impl FnOnce(&mut Texture, &mut Card) -> GlResult<T>) -> GlResult<T> {
    let unit = gl.state.texturing.active;
    gl.texture(unit, target);
    let name = gl.state.texturing.units[unit].bound[target];
    let texture =
        if name == 0 { gl.objects.default_textures.get_mut(target as u32) } else { gl.objects.textures.get_mut(name) };
    run(texture.ok_or(INVALID_OPERATION)?, &mut gl.card)
}

/// Checks the limits common to all images.
fn checked(level: i32, size: [u32; 3], border: i32) -> GlResult<u32> {
    let most = if size[2] > 1 { EDGE_3D_MAX } else { EDGE_MAX };
    if !(0..=14).contains(&level) || size.iter().any(|&edge| edge > most) || !(0..=1).contains(&border) {
        return Err(INVALID_VALUE);
    }
    let texels: u64 = size.iter().map(|&edge| u64::from(edge)).product();
    if texels > TEXELS_MAX {
        return Err(Fault::Limit(format!("an image of {texels} texels, at most {TEXELS_MAX}")));
    }
    Ok(level as u32)
}

/// `glTexImage`: level, internal format, size, border, format and type from these arguments on.
fn define(gl: &mut Gl, call: &Call, allowed: &[u32], dimensions: usize) -> GlResult {
    let Some((target, face)) = image_target(call.u32(0)?, allowed)? else { return Ok(()) };
    let mut size = [1; 3];
    let border = call.i32(3 + dimensions)?;
    for (k, edge) in size.iter_mut().enumerate().take(dimensions) {
        *edge = call.size(3 + k)?;
    }
    let level = checked(call.i32(1)?, size, border)?;
    let internal = call.u32(2)?;
    let (format, kind) = (call.u32(4 + dimensions)?, call.u32(5 + dimensions)?);
    let base = base_of(internal, format, kind)?;
    can_have(format, kind)?;
    let given = gl.pixel_bytes(call.arg(6 + dimensions))?;
    if (base == Base::Depth) != matches!(format, e::DEPTH_COMPONENT | e::DEPTH_STENCIL) {
        return Err(INVALID_OPERATION);
    }
    let mut bytes = match given {
        Some(bytes) if base == Base::Depth => Some(depth_bytes(gl, target, size, [format, kind], &bytes)?),
        // Contents are undefined.
        None if base == Base::Depth => None,
        Some(bytes) => Some(gl.encoded(base, size, [format, kind], &bytes)?),
        // Contents are undefined: zeros are allowed.
        None => Some(vec![0; size.iter().product::<u32>() as usize * base.format().block_bytes() as usize]),
    };
    if border == 1 {
        if size[..dimensions].iter().any(|&edge| edge < 2) {
            return Err(INVALID_VALUE);
        }
        // Only the texels inside the border are stored. The border has the border colour, as in Mesa.
        let inner: [u32; 3] = std::array::from_fn(|k| if k < dimensions { size[k] - 2 } else { 1 });
        bytes = bytes.map(|bytes| inside_of(&bytes, base.format().block_bytes() as usize, size, inner, dimensions));
        size = inner;
    }
    install(gl, target, face, level, Level::plain(size, base, bytes))
}

/// The stored depths of pixels. Stencil values beside them are not stored, but it is noted that the texture was given some.
fn depth_bytes(gl: &mut Gl, target: usize, size: [u32; 3], [format, kind]: [u32; 2], bytes: &[u8]) -> GlResult<Vec<u8>> {
    if format != e::DEPTH_STENCIL {
        return Ok(float_bytes(&gl.depths(size, kind, bytes)?));
    }
    let (depths, values) = gl.depths_and_stencil(size, kind, bytes)?;
    with(gl, target, |texture, _| {
        texture.given_stencil |= values.iter().any(|&value| value != 0);
        Ok(())
    })?;
    Ok(float_bytes(&depths))
}

/// The texels inside a border of one texel.
fn inside_of(texels: &[u8], texel: usize, size: [u32; 3], inner: [u32; 3], dimensions: usize) -> Vec<u8> {
    let skip = |k: usize| usize::from(k < dimensions);
    let mut out = Vec::new();
    for z in 0..inner[2] as usize {
        for y in 0..inner[1] as usize {
            let row = (z + skip(2)) * size[1] as usize + y + skip(1);
            let at = (row * size[0] as usize + skip(0)) * texel;
            out.extend_from_slice(&texels[at..at + inner[0] as usize * texel]);
        }
    }
    out
}

/// Defines an image, and generates mipmap levels from it if that is enabled.
fn install(gl: &mut Gl, target: usize, face: u32, level: u32, image: Level) -> GlResult {
    let (size, base) = (image.size, image.base);
    with(gl, target, |texture, card| {
        let generate = texture.generate && level == texture.range[0];
        let made = if generate { image.bytes.clone() } else { None };
        let plain = base != Base::Depth && image.format == base.format();
        texture.define(card, face, level, image);
        if generate && !size.contains(&0) {
            let Some(bytes) = made.filter(|_| plain) else {
                return Err(Fault::Unsupported("automatic mipmaps of depth textures".into()));
            };
            smaller_levels(texture, card, face, level, size, bytes);
        }
        Ok(())
    })
}

/// Generates all levels below one.
fn smaller_levels(texture: &mut Texture, card: &mut Card, face: u32, level: u32, size: [u32; 3], texels: Vec<u8>) {
    let Some(base) = texture.levels.get((face, level)).map(|image| image.base) else { return };
    let (mut smaller, mut texels, mut at) = (size, texels, level);
    while smaller != [1; 3] {
        (smaller, texels) = image::half(smaller, base, &texels);
        at += 1;
        let image = Level::plain(smaller, base, Some(texels.clone()));
        texture.define(card, face, at, image);
    }
}

/// The card's format of a compressed internal format.
fn s3tc(internal: u32) -> Option<Format> {
    Some(match internal {
        e::COMPRESSED_RGB_S3TC_DXT1_EXT | e::COMPRESSED_RGBA_S3TC_DXT1_EXT => Format::Bc1RgbaUnorm,
        COMPRESSED_RGBA_S3TC_DXT3 => Format::Bc2RgbaUnorm,
        e::COMPRESSED_RGBA_S3TC_DXT5_EXT => Format::Bc3RgbaUnorm,
        _ => return None,
    })
}

const COMPRESSED_RGBA_S3TC_DXT3: u32 = 0x83f2;

/// The blocks of a compressed image or part.
fn blocks(gl: &Gl, call: &Call, format: Format, size: [u32; 3], length: usize) -> GlResult<Vec<u8>> {
    let count = size[0].div_ceil(4) * size[1].div_ceil(4);
    let wanted = (count * format.block_bytes()) as usize;
    if call.size(length)? as usize != wanted {
        return Err(INVALID_VALUE);
    }
    let bytes = gl.pixel_bytes(call.arg(length + 1))?.ok_or_else(|| Fault::Damaged("the image was not recorded".into()))?;
    let bytes = bytes.get(..wanted);
    bytes.map(<[u8]>::to_vec).ok_or_else(|| Fault::Damaged(format!("the image has fewer than {wanted} bytes")))
}

pub fn compressed_2d(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let Some((target, face)) = image_target(call.u32(0)?, PLANAR)? else { return Ok(()) };
    let (internal, size) = (call.u32(2)?, [call.size(3)?, call.size(4)?, 1]);
    let level = checked(call.i32(1)?, size, call.i32(5)?)?;
    let format = s3tc(internal)
        .ok_or_else(|| Fault::Unsupported(format!("compressed textures of internal format {}", names::name(internal))))?;
    if call.i32(5)? != 0 {
        return Err(INVALID_OPERATION);
    }
    let bytes = blocks(gl, call, format, size, 6)?;
    // The largest image of the card's compressed textures has whole blocks; other images are stored as texels.
    let largest = with(gl, target, |texture, _| {
        let first = texture.range[0];
        Ok(texture.levels.get((face, first)).filter(|_| level > first).map(|image| image.format))
    })?;
    // Mipmap generation needs texels.
    let generates = with(gl, target, |texture, _| Ok(texture.generate && level == texture.range[0]))?;
    let whole = match largest {
        _ if generates => false,
        Some(format) => format.is_compressed(),
        None => size[0].is_multiple_of(4) && size[1].is_multiple_of(4),
    };
    let base = Base::of(internal)?;
    let image = if whole {
        Level { format, ..Level::plain(size, base, Some(bytes)) }
    } else {
        Level::plain(size, base, Some(decoded(format, size, &bytes)))
    };
    install(gl, target, face, level, image)
}

/// Decodes compressed blocks to texels.
fn decoded(format: Format, size: [u32; 3], blocks: &[u8]) -> Vec<u8> {
    let [width, height, _] = size.map(|edge| edge as usize);
    let across = width.div_ceil(4);
    let mut out = vec![0; width * height * 4];
    for (k, block) in blocks.chunks_exact(format.block_bytes() as usize).enumerate() {
        for texel in 0..16 {
            let (x, y) = (k % across * 4 + texel % 4, k / across * 4 + texel / 4);
            if x < width && y < height {
                let color = s3tc::texel(format, block, texel);
                out[(y * width + x) * 4..][..4].copy_from_slice(&color);
            }
        }
    }
    out
}

pub fn compressed_part_2d(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (target, face) = image_target(call.u32(0)?, PLANAR)?.ok_or(INVALID_ENUM)?;
    let level = call.size(1)?;
    let (origin, size) = ([call.size(2)?, call.size(3)?, 0], [call.size(4)?, call.size(5)?, 1]);
    let format = s3tc(call.u32(6)?).ok_or(INVALID_ENUM)?;
    let bytes = blocks(gl, call, format, size, 7)?;
    with(gl, target, |texture, card| {
        let image = texture.levels.get((face, level)).ok_or(INVALID_OPERATION)?;
        if !inside(image, origin, size) {
            return Err(INVALID_VALUE);
        }
        // Parts consist of whole blocks, except at the end of the image.
        let aligned =
            (0..2).all(|k| origin[k].is_multiple_of(4) && (size[k].is_multiple_of(4) || origin[k] + size[k] == image.size[k]));
        if !aligned {
            return Err(INVALID_OPERATION);
        }
        if image.format == format {
            texture.write(card, face, level, origin, size, &bytes);
        } else if !image.format.is_compressed() && image.base != Base::Depth {
            let texels: Vec<[u8; 4]> =
                decoded(format, size, &bytes).chunks_exact(4).map(|t| [t[0], t[1], t[2], t[3]]).collect();
            let kept = image.base.encode(&texels);
            texture.write(card, face, level, origin, size, &kept);
        } else {
            return Err(INVALID_OPERATION);
        }
        Ok(())
    })
}

pub fn image_1d(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.unpacking(1, |gl| define(gl, call, &[e::TEXTURE_1D], 1))
}

pub fn image_2d(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.unpacking(2, |gl| define(gl, call, PLANAR, 2))
}

pub fn image_3d(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.unpacking(3, |gl| define(gl, call, &[e::TEXTURE_3D], 3))
}

/// `glTexStorage(target, levels, internal format, size)`: all levels, without contents.
fn storage(gl: &mut Gl, call: &Call, allowed: &[u32], dimensions: usize) -> GlResult {
    let cube = call.u32(0)? == e::TEXTURE_CUBE_MAP && allowed.contains(&e::TEXTURE_2D);
    let target = match cube {
        true => target_of(e::TEXTURE_CUBE_MAP)?,
        false => match image_target(call.u32(0)?, allowed)? {
            Some((target, _)) => target,
            None => return Ok(()),
        },
    };
    let mut size = [1; 3];
    for (k, edge) in size.iter_mut().enumerate().take(dimensions) {
        *edge = call.size(3 + k)?;
    }
    let levels = call.u32(1)?;
    let most = 32 - size.into_iter().max().unwrap_or(1).leading_zeros();
    checked(0, size, 0)?;
    if levels == 0 || size.contains(&0) {
        return Err(INVALID_VALUE);
    }
    if levels > most {
        return Err(INVALID_OPERATION);
    }
    let internal = call.u32(2)?;
    if s3tc(internal).is_some() {
        return Err(Fault::Unsupported("storage of compressed textures without contents".into()));
    }
    let base = Base::of(internal)?;
    for level in 0..levels {
        let size: [u32; 3] = std::array::from_fn(|k| if k < dimensions { (size[k] >> level).max(1) } else { 1 });
        let bytes = size.iter().product::<u32>() as usize * base.format().block_bytes() as usize;
        for face in 0..if cube { 6 } else { 1 } {
            // Contents are undefined: zeros are allowed.
            let zeros = (base != Base::Depth).then(|| vec![0; bytes]);
            install(gl, target, face, level, Level::plain(size, base, zeros))?;
        }
    }
    with(gl, target, |texture, _| {
        texture.range[1] = texture.range[1].min(levels - 1);
        Ok(())
    })
}

pub fn storage_1d(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    storage(gl, call, &[e::TEXTURE_1D], 1)
}

pub fn storage_2d(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    storage(gl, call, PLANAR, 2)
}

pub fn storage_3d(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    storage(gl, call, &[e::TEXTURE_3D], 3)
}

/// Whether a part lies inside an image.
fn inside(image: &Level, origin: [u32; 3], size: [u32; 3]) -> bool {
    (0..3).all(|k| u64::from(origin[k]) + u64::from(size[k]) <= u64::from(image.size[k]))
}

fn write_part(gl: &mut Gl, call: &Call, allowed: &[u32], dimensions: usize) -> GlResult {
    let (target, face) = image_target(call.u32(0)?, allowed)?.ok_or(INVALID_ENUM)?;
    let level = call.size(1)?;
    let (mut origin, mut size) = ([0; 3], [1; 3]);
    for k in 0..dimensions {
        origin[k] = call.size(2 + k)?;
        size[k] = call.size(2 + dimensions + k)?;
    }
    let (format, kind) = (call.u32(2 + 2 * dimensions)?, call.u32(3 + 2 * dimensions)?);
    let base = with(gl, target, |texture, _| {
        let image = texture.levels.get((face, level)).ok_or(INVALID_OPERATION)?;
        if !inside(image, origin, size) {
            return Err(INVALID_VALUE);
        }
        if image.format != image.base.format() {
            return Err(Fault::Unsupported("texels that are written into compressed textures".into()));
        }
        Ok(image.base)
    })?;
    can_have(format, kind)?;
    if (base == Base::Depth) != matches!(format, e::DEPTH_COMPONENT | e::DEPTH_STENCIL) {
        return Err(INVALID_OPERATION);
    }
    if size.contains(&0) {
        return Ok(());
    }
    let Some(bytes) = gl.pixel_bytes(call.arg(4 + 2 * dimensions))? else {
        return Err(Fault::Damaged("the image was not recorded".into()));
    };
    let kept = match base {
        Base::Depth => depth_bytes(gl, target, size, [format, kind], &bytes)?,
        base => gl.encoded(base, size, [format, kind], &bytes)?,
    };
    let generates = with(gl, target, |texture, card| {
        texture.write(card, face, level, origin, size, &kept);
        Ok(texture.generate && level == texture.range[0])
    })?;
    if generates { gl.generate_levels(target, face..face + 1) } else { Ok(()) }
}

pub fn sub_image_1d(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.unpacking(1, |gl| write_part(gl, call, &[e::TEXTURE_1D], 1))
}

pub fn sub_image_2d(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.unpacking(2, |gl| write_part(gl, call, PLANAR, 2))
}

pub fn sub_image_3d(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.unpacking(3, |gl| write_part(gl, call, &[e::TEXTURE_3D], 3))
}

/// Copies from the framebuffer to a part of an image.
fn copy(gl: &mut Gl, target: usize, face: u32, level: u32, to: [u32; 2], from: [i32; 2], size: [u32; 2]) -> GlResult {
    let depth =
        with(gl, target, |texture, _| Ok(texture.levels.get((face, level)).is_some_and(|image| image.base == Base::Depth)))?;
    gl.flush()?;
    let source = gl.read_source(depth)?;
    let generates = with(gl, target, |texture, card| {
        texture.copy(card, face, level, to, source, from, size)?;
        Ok(texture.generate && level == texture.range[0])
    })?;
    if generates { gl.generate_levels(target, face..face + 1) } else { Ok(()) }
}

fn copy_image(gl: &mut Gl, call: &Call, allowed: &[u32], height: Option<u32>) -> GlResult {
    let (target, face) = image_target(call.u32(0)?, allowed)?.ok_or(INVALID_ENUM)?;
    let from = [call.i32(3)?, call.i32(4)?];
    let (height, border) = match height {
        Some(height) => (height, call.i32(6)?),
        None => (call.size(6)?, call.i32(7)?),
    };
    let size = [call.size(5)?, height, 1];
    let level = checked(call.i32(1)?, size, border)?;
    let base = Base::of(call.u32(2)?)?;
    if border != 0 {
        return Err(Fault::Unsupported("copies into textures with a border".into()));
    }
    // What the source does not cover stays 0.
    gl.flush()?;
    let (_, extent, _) = gl.read_source(base == Base::Depth)?;
    let covered = (0..2).all(|k| from[k] >= 0 && i64::from(from[k]) + i64::from(size[k]) <= i64::from(extent[k]));
    with(gl, target, |texture, card| {
        let same = texture.levels.get((face, level)).is_some_and(|image| image.size == size && image.base == base);
        if !same {
            let zeros = || vec![0; (size[0] * size[1] * base.format().block_bytes()) as usize];
            let bytes = (base != Base::Depth && !covered).then(zeros);
            texture.define(card, face, level, Level::plain(size, base, bytes));
        }
        Ok(())
    })?;
    copy(gl, target, face, level, [0; 2], from, [size[0], size[1]])
}

pub fn copy_image_1d(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    copy_image(gl, call, &[e::TEXTURE_1D], Some(1))
}

pub fn copy_image_2d(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    copy_image(gl, call, PLANAR, None)
}

fn copy_part(gl: &mut Gl, target: usize, face: u32, level: u32, to: [u32; 2], from: [i32; 2], size: [u32; 2]) -> GlResult {
    with(gl, target, |texture, _| {
        let image = texture.levels.get((face, level)).ok_or(INVALID_OPERATION)?;
        if inside(image, [to[0], to[1], 0], [size[0], size[1], 1]) { Ok(()) } else { Err(INVALID_VALUE) }
    })?;
    copy(gl, target, face, level, to, from, size)
}

pub fn copy_sub_image_1d(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (target, face) = image_target(call.u32(0)?, &[e::TEXTURE_1D])?.ok_or(INVALID_ENUM)?;
    let from = [call.i32(3)?, call.i32(4)?];
    copy_part(gl, target, face, call.size(1)?, [call.size(2)?, 0], from, [call.size(5)?, 1])
}

pub fn copy_sub_image_2d(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (target, face) = image_target(call.u32(0)?, PLANAR)?.ok_or(INVALID_ENUM)?;
    let (to, from) = ([call.size(2)?, call.size(3)?], [call.i32(4)?, call.i32(5)?]);
    copy_part(gl, target, face, call.size(1)?, to, from, [call.size(6)?, call.size(7)?])
}

/// `glCopyTexSubImage3D(target, level, x, y, z, from x, from y, width, height)`
pub fn copy_sub_image_3d(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (target, _) = image_target(call.u32(0)?, &[e::TEXTURE_3D])?.ok_or(INVALID_ENUM)?;
    let (level, to) = (call.size(1)?, [call.size(2)?, call.size(3)?, call.size(4)?]);
    let (from, size) = ([call.i32(5)?, call.i32(6)?], [call.size(7)?, call.size(8)?]);
    let depth = with(gl, target, |texture, _| {
        let image = texture.levels.get((0, level)).ok_or(INVALID_OPERATION)?;
        let generates = texture.generate && level == texture.range[0];
        match inside(image, to, [size[0], size[1], 1]) {
            true if generates => Err(Fault::Unsupported("automatic mipmaps of copies into 3D textures".into())),
            true => Ok(image.base == Base::Depth),
            false => Err(INVALID_VALUE),
        }
    })?;
    gl.flush()?;
    let source = gl.read_source(depth)?;
    with(gl, target, |texture, card| texture.copy_slice(card, level, to, source, from, size))
}
