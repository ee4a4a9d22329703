//! Misses of a cache whose users wait in order, as behind a latency-covering FIFO (Igehy, Eldridge and Proudfoot 1998).
//!
//! Misses are numbered as they are sent. An entry of the FIFO knows the number after the last miss it needs; it can go on when all
//! misses before that number are back. That is exact although answers come in any order: an entry that needed an earlier miss is
//! ahead in the FIFO and has gone on before.

/// Numbered misses in flight.
#[derive(Clone, Debug)]
pub struct Misses {
    /// The number of the next miss.
    issued: u32,
    /// All misses before this number are back.
    frontier: u32,
    /// Which of those after it are back, by number modulo the capacity.
    back: Vec<bool>,
    capacity: u32,
}

impl Misses {
    /// None in flight, and room for `capacity`.
    pub fn new(capacity: u32) -> Misses {
        Misses { issued: 0, frontier: 0, back: vec![false; capacity.next_power_of_two() as usize], capacity }
    }

    /// How many more can be sent.
    #[inline(always)]
    pub fn room(&self) -> u32 {
        self.capacity - self.issued.wrapping_sub(self.frontier)
    }

    /// Whether any miss is in flight.
    #[inline(always)]
    pub fn any(&self) -> bool {
        self.issued != self.frontier
    }

    /// Misses in flight or back out of turn.
    pub fn in_flight(&self) -> u32 {
        self.issued.wrapping_sub(self.frontier)
    }

    /// Numbers a miss; the tag comes back with the answer.
    ///
    /// # Panics
    /// If there is no room for it, which is a bug: its tag would be that of another miss in flight.
    #[inline(always)]
    pub fn issue(&mut self) -> u32 {
        assert!(self.room() > 0, "misses in flight have tags of their own");
        let tag = self.issued & (self.back.len() as u32 - 1);
        self.issued = self.issued.wrapping_add(1);
        tag
    }

    /// The number after the last miss sent: what an entry that needs it waits for.
    #[inline(always)]
    pub fn issued(&self) -> u32 {
        self.issued
    }

    /// All misses before this number are back.
    #[inline(always)]
    pub fn frontier(&self) -> u32 {
        self.frontier
    }

    /// The later of what an entry needs already and another number.
    #[inline(always)]
    pub fn later(&self, needs: Option<u32>, number: u32) -> Option<u32> {
        match needs {
            Some(needs) if needs.wrapping_sub(number) as i32 >= 0 => Some(needs),
            _ => Some(number),
        }
    }

    /// An answer has come.
    #[inline(always)]
    pub fn answer(&mut self, tag: u32) {
        let mask = self.back.len() as u32 - 1;
        self.back[(tag & mask) as usize] = true;
        while self.frontier != self.issued && self.back[(self.frontier & mask) as usize] {
            self.back[(self.frontier & mask) as usize] = false;
            self.frontier = self.frontier.wrapping_add(1);
        }
    }

    /// Whether all misses before a number are back.
    #[inline(always)]
    pub fn reached(&self, number: u32) -> bool {
        // Numbers wrap; what is in flight never spans more than the capacity.
        self.frontier.wrapping_sub(number) as i32 >= 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_out_of_order_release_in_order() {
        let mut misses = Misses::new(4);
        let tags: Vec<u32> = (0..4).map(|_| misses.issue()).collect();
        assert_eq!(misses.room(), 0);
        misses.answer(tags[2]);
        assert!(misses.reached(0) && !misses.reached(1));
        misses.answer(tags[0]);
        assert!(misses.reached(1) && !misses.reached(2));
        misses.answer(tags[1]);
        assert!(misses.reached(3) && !misses.reached(4));
        assert_eq!(misses.room(), 3);
        misses.answer(tags[3]);
        assert!(!misses.any());
    }
}
