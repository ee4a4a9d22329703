//! Sprites: small pictures that the display lays over its lines, outside the frame buffer, and which of them meet.
//!
//! Their texels are in the display's own memory, so that no line waits for them: the command processor moves them there at the end of each frame.

use std::ops::Range;

use work::{Sprite, Surface};

stats::counters! {
    /// What the display has laid over its lines.
    pub struct SpriteCounts {
        /// Sprites laid over a picture, of all pictures sent to the screen.
        shown: "sprites",
        /// Pairs of them of which opaque texels met on a pixel, of all pictures.
        collisions: "pairs",
    }
}

/// Two sprites whose opaque texels meet, the lower index first, and the first line on which they do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Collision {
    /// Indices.
    pub pair: [u8; 2],
    /// First line.
    pub line: u32,
}

impl Collision {
    /// The bit of a pair in a display's collision register: pairs in the order 0+1, 0+2, ... 0+7, 1+2, ...
    pub fn bit(&self) -> u32 {
        let [low, high] = self.pair.map(u32::from);
        1 << (low * (15 - low) / 2 + high - low - 1)
    }
}

/// The columns of a line of `width` pixels that a sprite covers, and the texels there, 4 bytes each.
fn row(sprite: &Sprite, width: u32, line: u32) -> Option<(Range<i64>, &[u8])> {
    let [x, y] = sprite.at.map(i64::from);
    let [columns, rows] = sprite.size.map(i64::from);
    let of = i64::from(line) - y;
    let covered = x.max(0)..(x + columns).min(i64::from(width));
    if !(0..rows).contains(&of) || covered.is_empty() {
        return None;
    }
    let first = of * columns - x;
    let texels = &sprite.texels[4 * (first + covered.start) as usize..4 * (first + covered.end) as usize];
    Some((covered, texels))
}

/// Lays sprites over some lines of a picture, whose bytes these are; those of a lower index come out on top.
pub fn lay(sprites: &[Sprite], surface: &Surface, bytes: &mut [u8], lines: Range<u32>) {
    for line in lines {
        let pixels = &mut bytes[4 * line as usize * surface.width as usize..][..4 * surface.width as usize];
        for sprite in sprites.iter().rev() {
            let Some((covered, texels)) = row(sprite, surface.width, line) else { continue };
            let pixels = pixels[4 * covered.start as usize..4 * covered.end as usize].chunks_exact_mut(4);
            for (pixel, texel) in pixels.zip(texels.chunks_exact(4)).filter(|(_, texel)| texel[3] != 0) {
                pixel.copy_from_slice(texel);
            }
        }
    }
}

/// The pairs of which opaque texels meet on some lines of a picture of such a width.
pub fn collisions(sprites: &[Sprite], width: u32, lines: Range<u32>) -> Vec<Collision> {
    let mut found = Vec::new();
    for (at, low) in sprites.iter().enumerate() {
        for high in &sprites[at + 1..] {
            let meet = |&line: &u32| {
                let (Some((a, of_a)), Some((b, of_b))) = (row(low, width, line), row(high, width, line)) else { return false };
                let opaque =
                    |range: &Range<i64>, texels: &[u8], column: i64| texels[4 * (column - range.start) as usize + 3] != 0;
                (a.start.max(b.start)..a.end.min(b.end)).any(|column| opaque(&a, of_a, column) && opaque(&b, of_b, column))
            };
            // Lines on which both are.
            let [y, z] = [i64::from(low.at[1]), i64::from(high.at[1])];
            let end = (y + i64::from(low.size[1])).min(z + i64::from(high.size[1])).clamp(0, i64::from(lines.end)) as u32;
            let begin = y.max(z).clamp(i64::from(lines.start), i64::from(lines.end)) as u32;
            let line = (begin..end).find(meet);
            found.extend(line.map(|line| Collision { pair: [low.index, high.index], line }));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use gfx::format::Format;
    use work::SurfaceKey;

    const SIZE: [u32; 2] = [40, 24];

    fn surface() -> Surface {
        let key = SurfaceKey { texture: 0, level: 0, layer: 0 };
        Surface { key, format: Format::Rgba8Unorm, width: SIZE[0], height: SIZE[1], samples: 1, address: 0, opaque: false }
    }

    #[test]
    fn random_placements_are_those_of_brute_force() {
        let mut chance = num::Random::new(1);
        let mut random = |below: u32| chance.below(below);
        let (mut met, mut torn) = (0, 0);
        for _ in 0..10_000 {
            let count = random(9) as u8;
            let sprites: Vec<Sprite> = (0..8_u8)
                .filter(|index| *index < count)
                .map(|index| {
                    let size = [1 + random(18), 1 + random(18)];
                    let at = [random(56) as i32 - 16, random(40) as i32 - 16];
                    let texel = |_| [random(256) as u8, index, 7, if random(3) == 0 { 0 } else { 1 + random(255) as u8 }];
                    let texels: Vec<u8> = (0..size[0] * size[1]).flat_map(texel).collect();
                    Sprite { index, at, size, texels: texels.into() }
                })
                .collect();
            // A part of the lines, as behind a tear.
            let first = random(SIZE[1] + 1) * random(2);
            let lines = first..if random(2) == 0 { SIZE[1] } else { first + random(SIZE[1] - first + 1) };
            torn += u32::from(first > 0);

            // Pixel after pixel, from the definition.
            let mut expected = vec![9_u8; 4 * (SIZE[0] * SIZE[1]) as usize];
            let mut pairs = std::collections::BTreeMap::new();
            for line in lines.clone() {
                for column in 0..SIZE[0] {
                    let on = |sprite: &&Sprite| {
                        let [x, y] = [column as i32 - sprite.at[0], line as i32 - sprite.at[1]];
                        let inside = x >= 0 && y >= 0 && x < sprite.size[0] as i32 && y < sprite.size[1] as i32;
                        inside && sprite.texels[4 * (y as usize * sprite.size[0] as usize + x as usize) + 3] != 0
                    };
                    let here: Vec<&Sprite> = sprites.iter().filter(on).collect();
                    for (at, low) in here.iter().enumerate() {
                        here[at + 1..].iter().for_each(|high| {
                            pairs.entry([low.index, high.index]).or_insert(line);
                        });
                    }
                    if let Some(top) = here.first() {
                        let [x, y] = [column as i32 - top.at[0], line as i32 - top.at[1]].map(|of| of as usize);
                        let from = 4 * (y * top.size[0] as usize + x);
                        let to = 4 * (line * SIZE[0] + column) as usize;
                        expected[to..to + 4].copy_from_slice(&top.texels[from..from + 4]);
                    }
                }
            }
            let mut laid = vec![9_u8; expected.len()];
            lay(&sprites, &surface(), &mut laid, lines.clone());
            assert!(laid == expected, "{sprites:?} on {lines:?}");
            let found = collisions(&sprites, SIZE[0], lines);
            let told: std::collections::BTreeMap<[u8; 2], u32> = found.iter().map(|found| (found.pair, found.line)).collect();
            assert_eq!(told, pairs);
            met += found.len();
        }
        assert!(met > 4_000 && torn > 1_000, "{met} pairs, {torn} pictures in parts");
    }

    #[test]
    fn each_pair_has_a_bit_of_its_own() {
        let pairs = (0..8).flat_map(|low| (low + 1..8).map(move |high| Collision { pair: [low, high], line: 0 }));
        let bits: Vec<u32> = pairs.map(|pair| pair.bit()).collect();
        assert_eq!(bits, (0..28).map(|bit| 1 << bit).collect::<Vec<u32>>());
    }

    #[test]
    fn a_place_far_outside_is_no_place_on_the_screen() {
        let texels: Vec<u8> = vec![255; 4];
        for at in [[i32::MIN, 0], [i32::MAX, 0], [0, i32::MIN], [0, i32::MAX]] {
            let sprite = Sprite { index: 0, at, size: [1, 1], texels: texels.clone().into() };
            let mut bytes = vec![0; 4 * (SIZE[0] * SIZE[1]) as usize];
            lay(&[sprite.clone(), Sprite { index: 1, ..sprite.clone() }], &surface(), &mut bytes, 0..SIZE[1]);
            assert!(bytes.iter().all(|&byte| byte == 0));
            assert!(collisions(&[sprite.clone(), Sprite { index: 1, ..sprite }], SIZE[0], 0..SIZE[1]).is_empty());
        }
    }
}
