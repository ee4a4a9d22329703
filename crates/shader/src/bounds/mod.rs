//! Bounds of a program's outputs, found without running it for any invocation: interval analysis (Hasselgren and Akenine-Möller 2007,
//! "Automatic pixel culling by interval analysis"; Tupper 2001).
//!
//! The register program runs once, on ranges instead of lanes. A range holds the values that a register has in all invocations whose
//! inputs lie in given ranges. Operations on single values are done by the instruction set itself ([`Code::fold`], the executor's
//! kernels), so that a value that all invocations share stays exact; for ranges see [`arithmetic`].
//!
//! Control flow follows the execution mask as the executor does, but with three values: all invocations are active, some, or none.
//! Where only some are, both sides of a branch are walked. An operation that writes under the mask (`Mov`, `StoreIndexed`) joins its value
//! with the old one. All other operations write all lanes, active or not, as in the executor. A loop repeats as long as any
//! invocation may stay in it. A program that takes more than [`STEPS`] steps has no bounds.
//!
//! The results of textures, of storage at addresses that differ, and of functions that are not known to be monotone may be anything. A program with side
//! effects or subgroup operations is refused.

mod arithmetic;
mod range;
mod run;

use std::cell::Cell;

use super::exec::{InputRegister, Uniforms};
use super::program::{NO_REG, Program};
use super::resources::Resources;
pub use range::Range;

/// Most operations that are walked for one program.
pub const STEPS: usize = 1 << 13;

/// A register file of ranges; reused from program to program.
#[derive(Default)]
pub struct Encloser {
    file: Vec<Cell<Range>>,
    masks: Vec<run::Share>,
}

impl Encloser {
    /// An encloser with an empty register file.
    pub fn new() -> Encloser {
        Encloser::default()
    }

    /// Finds the bounds of a program's outputs for inputs in the ranges `inputs`. An input that is not in the list may be anything. Returns
    /// whether there are bounds: [`Encloser::output`] gives them.
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

    /// The range of a component of an output of the last program that was enclosed.
    pub fn output(&self, program: &Program, slot: usize, component: usize) -> Range {
        let register = program.outputs.get(slot).and_then(|components| components.get(component));
        match register {
            Some(&register) if register != NO_REG => self.file[usize::from(register)].get(),
            _ => Range::ANY,
        }
    }
}
