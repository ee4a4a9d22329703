//! Loops on all threads of the present pool. rayon's iterators are compiled anew for each loop (about 4,500 lines of the compiler's intermediate
//! code); here one loop over numbers serves all of them. No result may depend on which thread does what.

use std::ops::RangeInclusive;
use std::sync::{Mutex, OnceLock, PoisonError};

use rayon::prelude::*;

/// Numbers that one thread takes at a time: as rayon likes it.
pub const ANY: RangeInclusive<usize> = 1..=usize::MAX;

/// Does `work` for every number below `count`. A thread takes about `together` numbers at a time.
pub fn each_number(count: usize, together: RangeInclusive<usize>, work: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().with_min_len(*together.start()).with_max_len(*together.end()).for_each(work);
}

/// Does `work` for every item, with its number.
pub fn each<T: Send>(items: impl Iterator<Item = T>, together: RangeInclusive<usize>, work: impl Fn(usize, T) + Sync) {
    let items: Vec<Mutex<Option<T>>> = items.map(|item| Mutex::new(Some(item))).collect();
    each_number(items.len(), together, &|number| {
        let item = items[number].lock().unwrap_or_else(PoisonError::into_inner).take();
        work(number, item.expect("a number comes once"));
    });
}

/// The results of `work` for all items, in the order of the items.
pub fn map<T: Send, R: Send + Sync>(
    items: impl Iterator<Item = T>,
    together: RangeInclusive<usize>,
    work: impl Fn(usize, T) -> R + Sync,
) -> impl Iterator<Item = R> {
    let items: Vec<T> = items.collect();
    let results: Vec<OnceLock<R>> = items.iter().map(|_| OnceLock::new()).collect();
    each(items.into_iter(), together, |number, item| {
        let _ = results[number].set(work(number, item));
    });
    results.into_iter().filter_map(OnceLock::into_inner)
}
