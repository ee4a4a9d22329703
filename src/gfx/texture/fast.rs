//! The common case.

use super::{Sample, Sampler, View};
use crate::num::Lanes;

/// Samples where the view, sampler and operands allow; says whether they did.
pub(super) fn sample(_view: &View, _sampler: &Sampler, _args: &Sample<'_>, _out: &mut [Lanes; 4]) -> bool {
    false
}
