//! Memory of fixed latency and bandwidth, with the same ports.

use std::collections::VecDeque;

use super::crossbar::ClientCounts;
use super::port::{Answer, Request};
use num::Cycle;
use sim::{In, Out, Tick, Unit, Wires};

/// An ideal memory.
#[derive(Clone, Copy, Debug)]
pub struct IdealConfig {
    /// Cycles from a request's last byte to its answer.
    pub latency: u32,
    /// Bytes read or written per cycle, over all clients.
    pub bytes_per_cycle: u32,
}

/// An ideal memory. Its items are requests.
#[derive(Clone, Debug)]
pub struct Ideal {
    config: IdealConfig,
    turn: usize,
    /// When the memory is free, in cycles times bytes per cycle.
    free_at: u64,
    /// By client, what is under way: when it is there, its tag and its bytes.
    flight: Vec<VecDeque<(Cycle, u32, u16)>>,
    items: u64,
    resident: u64,
    counts: Vec<ClientCounts>,
    /// Cycles times bytes per cycle in which bytes moved.
    busy: u64,
    inputs: Vec<In<Request>>,
    outputs: Vec<Out<Answer>>,
}

impl Ideal {
    /// A memory with nothing under way.
    pub fn new(config: IdealConfig, inputs: Vec<In<Request>>, outputs: Vec<Out<Answer>>) -> Ideal {
        Ideal {
            config,
            turn: 0,
            free_at: 0,
            flight: vec![VecDeque::new(); inputs.len()],
            items: 0,
            resident: 0,
            counts: vec![ClientCounts::default(); inputs.len()],
            busy: 0,
            inputs,
            outputs,
        }
    }

    /// What each port asked for.
    pub fn counts(&self) -> &[ClientCounts] {
        &self.counts
    }

    /// Cycles' worth of bytes moved.
    pub fn busy_cycles(&self) -> u64 {
        self.busy / u64::from(self.config.bytes_per_cycle)
    }
}

impl<C> Unit<C> for Ideal {
    #[inline]
    fn tick(&mut self, wires: &mut Wires, _: &mut C) -> Tick {
        let now = wires.now();
        let rate = u64::from(self.config.bytes_per_cycle);
        let mut did = if self.resident > 0 { Tick::Working } else { Tick::Starved };
        // 1. What has waited for the latency is answered.
        for (client, flight) in self.flight.iter_mut().enumerate() {
            while let Some(&(at, tag, bytes)) = flight.front() {
                if at > now {
                    wires.sleep_until(at);
                    break;
                }
                if !wires.can_push(&self.outputs[client]) {
                    did = did.or(Tick::Blocked);
                    break;
                }
                wires.push_sized(&self.outputs[client], Answer { tag }, u32::from(bytes));
                flight.pop_front();
                self.resident -= 1;
                self.items += 1;
                did = Tick::Moved;
            }
        }
        // 2. Clients in turn are served until the cycle's bytes are spent.
        let end = (now + 1) * rate;
        let mut served = true;
        while served {
            served = false;
            for step in 0..self.inputs.len() {
                let client = (self.turn + step) % self.inputs.len();
                if self.free_at >= end {
                    // Requests that arrive find the memory occupied until then.
                    if self.inputs.iter().any(|input| wires.can_pop(input)) {
                        wires.sleep_until(self.free_at / rate);
                        did = did.or(Tick::Working);
                    }
                    return did;
                }
                let Some(request) = wires.pop(&self.inputs[client]) else { continue };
                self.free_at = self.free_at.max(now * rate) + u64::from(request.bytes);
                self.busy += u64::from(request.bytes);
                self.counts[client].count(&request);
                if request.kind().is_answered() {
                    let there = self.free_at.div_ceil(rate) - 1 + Cycle::from(self.config.latency);
                    self.flight[client].push_back((there, request.tag, request.bytes));
                    self.resident += 1;
                } else {
                    self.items += 1;
                }
                self.turn = (client + 1) % self.inputs.len();
                did = Tick::Moved;
                served = true;
                break;
            }
        }
        did
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        self.resident
    }
}
