//! Workgroups.
//!
//! Invocations of a group fill batches in the order of their local index. A group of several batches runs batch after batch
//! from barrier to barrier, which is one of the orders that the specification allows. Groups that share nothing are packed
//! into one batch, each from a multiple of four lanes on.

use std::ops::Range;

use crate::interface::{BuiltIn, Connection};
use crate::program::NO_REG;
use num::{LANES, Lanes, Mask, Words};

use super::record::{QuadCost, Recorder, Scratch};
use super::run::{self, BatchState, PAUSE, Stop};
use super::{BoundProgram, CHUNKS, Executor, ShaderFault, load_shared};

/// A batch of a workgroup of several batches.
#[derive(Default)]
pub(super) struct Waiting {
    file: Vec<Lanes>,
    masks: Vec<Mask>,
    scratch: Scratch,
}

/// Which invocation each lane of a batch runs.
struct Assignment {
    group: [[u32; LANES]; 3],
    local: [u32; LANES],
    mask: Mask,
}

impl BoundProgram<'_> {
    /// Runs workgroups `range` of a dispatch of `count` groups, numbered x first. With a recorder, one entry for each four
    /// invocations is appended to `packets`: `ceil(invocations / 4)` a group, in order.
    ///
    /// # Errors
    /// If a loop does not end.
    pub fn run_groups(
        &mut self,
        range: Range<u64>,
        count: [u32; 3],
        recorder: Option<(&mut Recorder, &mut Vec<QuadCost>)>,
    ) -> Result<(), ShaderFault> {
        match recorder {
            None => self.groups::<false>(range, count, &mut Recorder::default(), &mut Vec::new()),
            Some((recorder, packets)) => self.groups::<true>(range, count, recorder, packets),
        }
    }

    fn groups<const RECORD: bool>(
        &mut self,
        range: Range<u64>,
        count: [u32; 3],
        recorder: &mut Recorder,
        packets: &mut Vec<QuadCost>,
    ) -> Result<(), ShaderFault> {
        let interface = self.program.interface();
        let [sx, sy, sz] = interface.workgroup_size;
        let invocations = sx as usize * sy as usize * sz as usize;
        let padded = invocations.next_multiple_of(4);
        let apart = interface.barriers || interface.subgroups || self.program.shared_bytes > 0;
        let side = if apart || padded > LANES { 1 } else { LANES / padded };
        let batches = invocations.div_ceil(LANES);
        if self.executor.shared.len() != u64::from(self.program.shared_bytes) {
            self.executor.shared = Words::new(u64::from(self.program.shared_bytes));
        }
        self.prepare(batches);
        let mut at = range.start;
        while at < range.end {
            let together = (side as u64).min(range.end - at) as usize;
            if self.program.shared_bytes > 0 {
                for i in 0..self.executor.shared.words().len() {
                    self.executor.shared.store(i, 0);
                }
            }
            let mut stops = vec![None; batches];
            for (b, stop) in stops.iter_mut().enumerate() {
                let mut a = Assignment { group: [[0; LANES]; 3], local: [0; LANES], mask: 0 };
                for lane in 0..LANES {
                    let (g, local) = if side > 1 { (lane / padded, lane % padded) } else { (0, LANES * b + lane) };
                    if g < together && local < invocations {
                        let g = at + g as u64;
                        let (w, h) = (u64::from(count[0].max(1)), u64::from(count[1].max(1)));
                        a.group[0][lane] = (g % w) as u32;
                        a.group[1][lane] = (g / w % h) as u32;
                        a.group[2][lane] = (g / w / h) as u32;
                        a.local[lane] = local as u32;
                        a.mask |= 1 << lane;
                    }
                }
                self.fill(b, &a, count);
                *stop = Some(a.mask);
            }
            self.run_batches::<RECORD>(&stops, recorder)?;
            if RECORD {
                for b in 0..batches {
                    let scratch = if b == 0 { &mut self.executor.scratch } else { &mut self.executor.waiting[b - 1].scratch };
                    recorder.finish(scratch);
                    let quads = if side > 1 { together * padded / 4 } else { (padded / 4 - 16 * b).min(16) };
                    packets.extend_from_slice(&recorder.quads[..quads]);
                }
                self.tell_recorded(recorder)?;
            }
            at += together as u64;
        }
        Ok(())
    }

    /// Makes register files for all batches of a group; the executor's own is the first.
    fn prepare(&mut self, batches: usize) {
        self.load(CHUNKS);
        let Executor { waiting, .. } = &mut *self.executor;
        waiting.resize_with(waiting.len().max(batches - 1), Waiting::default);
        for w in &mut waiting[..batches - 1] {
            w.file.resize(self.program.body.registers.max(w.file.len()), Lanes::ZERO);
            w.masks.clear();
            w.masks.resize(self.program.body.slots, 0);
            load_shared(&mut w.file, self.program, self.uniforms, 0..CHUNKS);
        }
    }

    /// Writes the inputs of a batch.
    fn fill(&mut self, batch: usize, a: &Assignment, count: [u32; 3]) {
        let interface = self.program.interface();
        let size = interface.workgroup_size;
        let invocations = size.iter().product::<u32>();
        let file = if batch == 0 { &mut self.executor.file } else { &mut self.executor.waiting[batch - 1].file };
        for (slot, registers) in interface.inputs.iter().zip(&self.program.inputs) {
            let Connection::BuiltIn(builtin) = slot.connection else { continue };
            for (c, &r) in registers.iter().enumerate() {
                if r == NO_REG {
                    continue;
                }
                let local = |i: usize| match c {
                    0 => a.local[i] % size[0],
                    1 => a.local[i] / size[0] % size[1],
                    _ => a.local[i] / size[0] / size[1],
                };
                let value = |i: usize| match builtin {
                    BuiltIn::GlobalInvocationId => a.group[c][i].wrapping_mul(size[c]).wrapping_add(local(i)),
                    BuiltIn::LocalInvocationId => local(i),
                    BuiltIn::LocalInvocationIndex => a.local[i],
                    BuiltIn::WorkGroupId => a.group[c][i],
                    BuiltIn::NumWorkGroups => count[c],
                    BuiltIn::SubgroupSize => LANES as u32,
                    BuiltIn::SubgroupInvocationId => a.local[i] % LANES as u32,
                    BuiltIn::SubgroupId => a.local[i] / LANES as u32,
                    BuiltIn::NumSubgroups => invocations.div_ceil(LANES as u32),
                    _ => 0,
                };
                file[usize::from(r)] = Lanes(std::array::from_fn(value));
            }
        }
    }

    /// Runs the batches of one group (or of packed groups) from barrier to barrier.
    fn run_batches<const RECORD: bool>(
        &mut self,
        masks_of: &[Option<Mask>],
        recorder: &mut Recorder,
    ) -> Result<(), ShaderFault> {
        let BoundProgram { executor, program, resources, uniforms, allowance, .. } = &mut *self;
        let Executor { file, masks, waiting, shared, scratch, spent } = &mut **executor;
        let mut machines: Vec<_> = masks_of
            .iter()
            .map(|mask| {
                let mask = mask.unwrap_or(0);
                BatchState::new(&program.body, resources, shared, mask, mask)
            })
            .collect();
        if RECORD {
            let scratches = std::iter::once(&mut *scratch).chain(waiting.iter_mut().map(|w| &mut w.scratch));
            for (scratch, mask) in scratches.zip(masks_of) {
                scratch.begin(recorder.extra, &uniforms.work, mask.unwrap_or(0));
            }
        }
        let mut ended = vec![false; machines.len()];
        *spent += program.body.all_steps() * machines.len() as u64;
        while ended.contains(&false) {
            for (b, machine) in machines.iter_mut().enumerate() {
                if ended[b] {
                    continue;
                }
                // Until its barrier or its end: pauses between are passed over.
                loop {
                    let stop = if b == 0 {
                        run::dispatch::<RECORD>(machine, file, masks, scratch)
                    } else {
                        let w = &mut waiting[b - 1];
                        run::dispatch::<RECORD>(machine, &mut w.file, &mut w.masks, &mut w.scratch)
                    };
                    *spent += std::mem::take(&mut machine.spent);
                    if *spent >= PAUSE {
                        let mut told = allowance.tell_steps(spent);
                        if RECORD && told.is_ok() {
                            let staged = scratch.bytes() + waiting.iter().map(|w| w.scratch.bytes()).sum::<u64>();
                            told = allowance.tell_recorded(recorder, staged).map(drop);
                        }
                        told.map_err(|over| program.fault(over.into(), None))?;
                    }
                    match stop {
                        Stop::Pause => {}
                        Stop::Loop(number) => return Err(program.loop_fault(number)),
                        Stop::Barrier => break,
                        Stop::End => {
                            ended[b] = true;
                            break;
                        }
                    }
                }
            }
        }
        Ok(())
    }
}
