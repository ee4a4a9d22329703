//! The states of draws in flight, of which a card holds a few.

use std::collections::VecDeque;

/// States of draws in flight. Draws that follow each other with the same state share it.
#[derive(Clone)]
pub(super) struct States {
    /// The most states with segments in flight.
    most: usize,
    /// The state of the last draw, by its number in the work; none at the beginning of a pass.
    current: Option<u32>,
    /// Segments in flight of each state in the order of their draws, the current one last; and the number of the first of them.
    segments: VecDeque<u32>,
    first: u32,
    /// For each slot the number of its state.
    of: Vec<u32>,
}

impl States {
    /// None in flight, and room for `most`; segments are in that many slots.
    pub fn new(most: u32, slots: usize) -> States {
        States { most: most as usize, current: None, segments: VecDeque::new(), first: 0, of: vec![0; slots] }
    }

    /// A pass begins: its first draw sets its state.
    pub fn begin_pass(&mut self) {
        self.current = None;
    }

    /// Whether a draw with this state changes it.
    pub fn differs(&self, state: u32) -> bool {
        self.current != Some(state)
    }

    /// Whether there is room for another state.
    pub fn has_room(&self) -> bool {
        self.segments.iter().filter(|&&segments| segments > 0).count() < self.most
    }

    /// The next draws have this state.
    pub fn change(&mut self, state: u32) {
        self.current = Some(state);
        self.segments.push_back(0);
        self.forget();
    }

    /// A segment of the current state goes into a slot.
    pub fn install(&mut self, slot: u16) {
        let number = self.first.wrapping_add(self.segments.len() as u32 - 1);
        self.of[usize::from(slot)] = number;
        if let Some(segments) = self.segments.back_mut() {
            *segments += 1;
        }
    }

    /// The segment in a slot no longer needs its state.
    pub fn retire(&mut self, slot: u16) {
        let place = self.of[usize::from(slot)].wrapping_sub(self.first);
        self.segments[place as usize] -= 1;
        self.forget();
    }

    /// Forgets states before the current one that no segment has.
    fn forget(&mut self) {
        while self.segments.len() > 1 && self.segments.front() == Some(&0) {
            self.segments.pop_front();
            self.first = self.first.wrapping_add(1);
        }
    }
}
