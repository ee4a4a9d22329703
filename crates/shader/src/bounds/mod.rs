//! Bounds of what a program leaves, found without running it for any invocation: interval analysis (Hasselgren and Akenine-Möller 2007,
//! "Automatic pixel culling by interval analysis"; Tupper 2001).
//!
//! The register program runs once, on ranges instead of lanes. A range holds the values that a register has in all invocations whose
//! inputs lie in given ranges. Operations on single values are done by the instruction set itself ([`Code::fold`], the executor's
//! kernels), so that what is the same for all invocations stays exact; for ranges see [`arithmetic`].
//!
//! Control flow follows the execution mask as the executor does, but with three values: all invocations are active, some, or none.
//! Where only some are, both sides of a branch are walked, and what is written under the mask (`Mov`, `StoreIndexed`) is joined with
//! what was there. Everything else the executor writes in all lanes, active or not, and so it is here. A loop goes round as long as
//! any invocation may; a program that takes more than [`STEPS`] steps has no bounds.
//!
//! Textures, storage at addresses that differ, and functions that are not known to rise or fall give anything. A program with side
//! effects or subgroup operations is refused.

mod arithmetic;
mod range;
mod run;

use std::cell::Cell;

use super::exec::{InputRegister, Uniforms};
use super::program::{NO_REG, Program};
use super::resources::Resources;
pub use range::Range;

/// Operations after which a program is given up.
pub const STEPS: usize = 1 << 13;

/// A register file of ranges; reused from program to program.
#[derive(Default)]
pub struct Encloser {
    file: Vec<Cell<Range>>,
    masks: Vec<run::Share>,
}

impl Encloser {
    /// An empty one.
    pub fn new() -> Encloser {
        Encloser::default()
    }

    /// Finds the bounds of a program's outputs, its inputs lying in `inputs`; an input that is not among them may be anything. Returns
    /// whether there are any: [`Encloser::output`] tells them.
    pub fn enclose(
        &mut self,
        program: &Program,
        resources: &Resources<'_>,
        uniforms: &Uniforms,
        inputs: &[(InputRegister, Range)],
    ) -> bool {
        let interface = program.interface();
        if interface.side_effects || interface.subgroups || interface.barriers {
            return false;
        }
        self.file.clear();
        let shared = uniforms.values().iter().chain(&program.constants).map(|&bits| Cell::new(Range::point(bits)));
        self.file.extend(shared);
        self.file.resize(self.file.len().max(program.body.registers), Cell::new(Range::ANY));
        for (register, range) in inputs {
            self.file[register.index()].set(*range);
        }
        self.masks.clear();
        self.masks.resize(program.body.slots, run::Share::None);
        run::run(&program.body, resources, &self.file, &mut self.masks)
    }

    /// The range of a component of an output of the program that was enclosed last.
    pub fn output(&self, program: &Program, slot: usize, component: usize) -> Range {
        let register = program.outputs.get(slot).and_then(|components| components.get(component));
        match register {
            Some(&register) if register != NO_REG => self.file[usize::from(register)].get(),
            _ => Range::ANY,
        }
    }
}
