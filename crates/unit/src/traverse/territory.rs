//! Which blocks of the screen a rasteriser finds, and which of them are its pipeline's own.

use super::Traverse;
use crate::card::{Card, Work};
use work::{BLOCK, TILE, Triangle, Visit};

/// The part of the screen in which a rasteriser finds blocks, and the pipelines that own these blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Territory {
    /// In the tiles that its pipeline owns.
    Tiles,
    /// On the whole screen; each block belongs to the pipeline that owns its tile.
    Screen,
    /// On the whole screen, all of which is its pipeline's own.
    Copy,
    /// In one tile after the other. The number is the edge of a tile in blocks. Each triangle comes with the number of its tile.
    Bins(u32),
}

/// Where a block is, in the order of traversal: tile, row and column.
pub(super) type BlockAt = (u32, u16, u16);

impl Traverse {
    /// Whether this unit traverses what a pipeline owns of the current triangle.
    #[inline(always)]
    pub(super) fn enters(&self, owner: u8) -> bool {
        self.territory != Territory::Tiles && !self.place.shared || owner == self.pipeline
    }

    /// Whether this unit, which has its triangle for one tile, traverses a block.
    #[inline(always)]
    pub(super) fn in_bin(&self, card: &Card, x: u32, y: u32) -> bool {
        let Territory::Bins(side) = self.territory else { return true };
        let across = card.passes.current().map_or(1, |pass| pass.blocks_across).div_ceil(side);
        y / side * across + x / side == self.place.sequence
    }

    /// The visit of a triangle that its tile is in. Visits are in the order of tiles, and a tile to be drawn is no larger than those.
    pub(super) fn visit_of_bin(&self, card: &Card, work: &Work, triangle: &Triangle, number: u32, side: u32) -> u32 {
        let across = card.passes.current().map_or(1, |pass| pass.blocks_across).div_ceil(side);
        let (x, y) = (number % across * side * BLOCK / TILE, number / across * side * BLOCK / TILE);
        let visits = work.visits(triangle);
        let at = |visit: &Visit| {
            let tile = &work.segment.tiles[visit.tile as usize];
            (u32::from(tile.y), u32::from(tile.x))
        };
        visits.partition_point(|visit| at(visit) < (y, x)) as u32
    }

    /// The triangle's visit of this unit's tile, if there is one.
    pub(super) fn bin_visits<'a>(&self, card: &Card, work: &'a Work, triangle: &Triangle) -> &'a [Visit] {
        let visits = work.visits(triangle);
        if self.past_bin(card, work, triangle) { &[] } else { &visits[self.place.visit as usize..][..1] }
    }

    /// Whether the current visit is no longer that of the tile that the triangle came for.
    pub(super) fn past_bin(&self, card: &Card, work: &Work, triangle: &Triangle) -> bool {
        let Territory::Bins(side) = self.territory else { return false };
        let Some(visit) = work.visits(triangle).get(self.place.visit as usize) else { return true };
        let across = card.passes.current().map_or(1, |pass| pass.blocks_across).div_ceil(side);
        let number = self.place.sequence;
        let (x, y) = (number % across * side * BLOCK / TILE, number / across * side * BLOCK / TILE);
        let tile = &work.segment.tiles[visit.tile as usize];
        (u32::from(tile.x), u32::from(tile.y)) != (x, y)
    }

    /// Goes on to the next block of the current triangle that is this unit's; where it is.
    pub(super) fn skip_foreign(&mut self, card: &Card) -> Option<BlockAt> {
        let work = card.work(self.place.slot);
        let triangle = &work.segment.triangles[self.place.triangle as usize];
        let bins = matches!(self.territory, Territory::Bins(_));
        loop {
            if bins && self.past_bin(card, work, triangle) {
                return None;
            }
            let visit = work.visits(triangle).get(self.place.visit as usize)?;
            let whole = work.owners.get(visit.tile as usize).filter(|_| !bins);
            if self.place.block == visit.blocks || whole.is_some_and(|&owner| !self.enters(owner)) {
                self.place.visit += 1;
                self.place.block = 0;
                continue;
            }
            let block = &work.segment.tiles[visit.tile as usize].blocks[(visit.first_block + self.place.block) as usize];
            let (x, y) = (u32::from(block.x), u32::from(block.y));
            if whole.is_some() || self.in_bin(card, x, y) && (bins || self.enters(card.interleave.owner(x, y))) {
                return Some((visit.tile, block.y, block.x));
            }
            self.place.block += 1;
        }
    }

    /// Blocks of this pipeline in the bounding box of a triangle that covers no sample; with none at all, one.
    pub(super) fn blocks_in_vain(&self, card: &Card, triangle: &Triangle) -> u32 {
        let [x0, y0, x1, y1] = triangle.bounds.map(u32::from);
        let mine = |x: u32, y: u32| match self.territory {
            Territory::Bins(_) => self.in_bin(card, x, y),
            Territory::Tiles | Territory::Screen | Territory::Copy => self.enters(card.interleave.owner(x, y)),
        };
        (y0..y1).map(|y| (x0..x1).filter(|&x| mine(x, y)).count() as u32).sum::<u32>().max(1)
    }

    /// Blocks of this pipeline in a triangle's bounding box that it does not cover, in the tiles that it touches; with none at all
    /// to be tested, one. And those that it covers.
    pub(super) fn empty_blocks(&self, card: &Card, work: &Work, triangle: &Triangle) -> [u32; 2] {
        let [x0, y0, x1, y1] = triangle.bounds.map(u32::from);
        let (mut inside, mut covered) = (0, 0);
        let bins = matches!(self.territory, Territory::Bins(_));
        let visits = if bins { self.bin_visits(card, work, triangle) } else { work.visits(triangle) };
        for visit in visits {
            let tile = &work.segment.tiles[visit.tile as usize];
            let side = TILE / BLOCK;
            let (tx, ty) = (u32::from(tile.x) * side, u32::from(tile.y) * side);
            let (left, right) = (x0.max(tx), x1.min(tx + side));
            let (top, bottom) = (y0.max(ty), y1.min(ty + side));
            match work.owners.get(visit.tile as usize).filter(|_| !bins) {
                Some(&owner) if self.enters(owner) => {
                    inside += right.saturating_sub(left) * bottom.saturating_sub(top);
                    covered += visit.blocks;
                }
                Some(_) => {}
                // Several pipelines share the tile.
                None => {
                    let mine = |x: u32, y: u32| u32::from(self.in_bin(card, x, y) && self.enters(card.interleave.owner(x, y)));
                    inside += (top..bottom).map(|y| (left..right).map(|x| mine(x, y)).sum::<u32>()).sum::<u32>();
                    let blocks = &tile.blocks[visit.first_block as usize..][..visit.blocks as usize];
                    covered += blocks.iter().map(|block| mine(block.x.into(), block.y.into())).sum::<u32>();
                }
            }
        }
        [inside.saturating_sub(covered).max(u32::from(covered == 0)), covered]
    }
}
