//! Miss status: who waits for which sectors of which line.

use super::cache::CacheSlot;

/// No node.
const NONE: u32 = u32::MAX;

#[derive(Clone, Copy, Debug)]
struct Waiter {
    who: u32,
    needs: u8,
    next: u32,
}

/// Miss status holding registers. A register belongs to a line with sectors on their way; all who need any of these wait in its
/// list, so that a line is asked for once however many want it.
#[derive(Clone, Debug)]
pub struct Misses {
    /// First and last waiter of each place of the cache.
    lists: Vec<(u32, u32)>,
    waiters: Vec<Waiter>,
    free: u32,
    registers: u32,
    registers_left: u32,
    waiters_left: u32,
}

impl Misses {
    /// Registers for `registers` lines at a time and room for `waiters` in all, for a cache of `places` lines.
    pub fn new(places: u32, registers: u32, waiters: u32) -> Misses {
        let next = |index| if index + 1 < waiters { index + 1 } else { NONE };
        Misses {
            lists: vec![(NONE, NONE); places as usize],
            waiters: (0..waiters).map(|index| Waiter { who: 0, needs: 0, next: next(index) }).collect(),
            free: if waiters > 0 { 0 } else { NONE },
            registers,
            registers_left: registers,
            waiters_left: waiters,
        }
    }

    /// Lines with sectors on their way.
    pub fn len(&self) -> u32 {
        self.registers - self.registers_left
    }

    /// Whether no line has sectors on their way.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether a register is free.
    #[inline(always)]
    pub fn has_register(&self) -> bool {
        self.registers_left > 0
    }

    /// Whether one more can wait.
    #[inline(always)]
    pub fn has_waiter(&self) -> bool {
        self.waiters_left > 0
    }

    /// Takes a register for a line that has nothing on its way yet.
    #[inline(always)]
    pub fn open(&mut self) {
        self.registers_left -= 1;
    }

    /// Gives the register of a line back: nothing of it is on its way any more.
    #[inline(always)]
    pub fn close(&mut self, place: CacheSlot) {
        debug_assert_eq!(self.lists[place.0 as usize].0, NONE, "somebody still waits");
        self.registers_left += 1;
    }

    /// `who` waits until all of `needs` are there.
    #[inline(always)]
    pub fn wait(&mut self, place: CacheSlot, who: u32, needs: u8) {
        let node = self.free;
        self.free = self.waiters[node as usize].next;
        self.waiters_left -= 1;
        self.waiters[node as usize] = Waiter { who, needs, next: NONE };
        let list = &mut self.lists[place.0 as usize];
        if list.0 == NONE {
            *list = (node, node);
        } else {
            self.waiters[list.1 as usize].next = node;
            list.1 = node;
        }
    }

    /// Sectors have come: calls `served` with each whose needs are among the valid ones, in the order of their coming.
    #[inline(always)]
    pub fn serve(&mut self, place: CacheSlot, valid: u8, mut served: impl FnMut(u32)) {
        let (mut node, _) = self.lists[place.0 as usize];
        let mut list = (NONE, NONE);
        while node != NONE {
            let Waiter { who, needs, next } = self.waiters[node as usize];
            if needs & !valid == 0 {
                served(who);
                self.waiters[node as usize].next = self.free;
                self.free = node;
                self.waiters_left += 1;
            } else {
                self.waiters[node as usize].next = NONE;
                if list.0 == NONE {
                    list.0 = node;
                } else {
                    self.waiters[list.1 as usize].next = node;
                }
                list.1 = node;
            }
            node = next;
        }
        self.lists[place.0 as usize] = list;
    }
}
