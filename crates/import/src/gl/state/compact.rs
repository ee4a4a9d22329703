//! Calls in compact form: display lists have millions of calls, most with a few numbers.

use std::rc::Rc;

use crate::gl::call::{Arg, Call};

/// A call whose arguments are numbers in single precision, the last one possibly an array. The numbers are stored in a separate list.
#[derive(Clone, Copy, Debug)]
pub struct CompactCall {
    /// The number of its function.
    pub function: u32,
    /// Its number in the recording.
    number: u32,
    /// The index of its first argument in the list.
    at: u32,
    /// Number of scalar arguments, and of elements of the array.
    scalars: u8,
    elements: u8,
}

/// The value of `elements` if there is no array.
const NONE: u8 = u8::MAX;

impl CompactCall {
    /// Appends the arguments of a call, if they have this form.
    pub fn of(call: &Call, numbers: &mut Vec<f32>) -> Option<CompactCall> {
        let start = numbers.len();
        let compact = CompactCall::put(call, numbers);
        if compact.is_none() {
            numbers.truncate(start);
        }
        compact
    }

    fn put(call: &Call, numbers: &mut Vec<f32>) -> Option<CompactCall> {
        let exact = |value: f64| Some(value as f32).filter(|&short| f64::from(short) == value);
        let at = u32::try_from(numbers.len()).ok()?;
        let (scalars, array) = match call.args.split_last() {
            Some((Arg::Nums(array), scalars)) => (scalars, Some(array)),
            _ => (&call.args[..], None),
        };
        for arg in scalars {
            let Arg::Num(value) = arg else { return None };
            numbers.push(exact(*value)?);
        }
        for &value in array.iter().flat_map(|array| array.iter()) {
            numbers.push(exact(value)?);
        }
        let few = |count: usize| u8::try_from(count).ok().filter(|&count| count < NONE);
        Some(CompactCall {
            function: call.function.id,
            number: u32::try_from(call.number).ok()?,
            at,
            scalars: few(scalars.len())?,
            elements: array.map_or(Some(NONE), |array| few(array.len()))?,
        })
    }

    /// The index of its first argument.
    pub fn first(&self) -> usize {
        self.at as usize
    }

    /// Writes the arguments into a call of the same function.
    pub fn fill(&self, numbers: &[f32], call: &mut Call) {
        let (first, scalars) = (self.at as usize, usize::from(self.scalars));
        call.number = u64::from(self.number);
        let room = if self.elements != NONE { call.args.pop() } else { None };
        call.args.clear();
        call.args.extend(numbers[first..first + scalars].iter().map(|&value| Arg::Num(f64::from(value))));
        if self.elements != NONE {
            let values = numbers[first + scalars..][..usize::from(self.elements)].iter().copied().map(f64::from);
            // Most calls of a list have arrays as long as the one before.
            let array = match room {
                Some(Arg::Nums(mut room)) if room.len() == values.len() => {
                    Rc::make_mut(&mut room).iter_mut().zip(values).for_each(|(number, value)| *number = value);
                    room
                }
                _ => values.collect(),
            };
            call.args.push(Arg::Nums(array));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gl::call::Function;

    #[test]
    fn calls_come_back_as_they_were_and_what_does_not_fit_is_left() {
        let function = Rc::new(Function { id: 7, name: "glF".into() });
        let call =
            |args: Vec<Arg>| Call { number: 9, place: 3, thread: 0, function: function.clone(), args, result: Arg::Null };
        let mut numbers = vec![5.0];
        let fits = [
            vec![],
            vec![Arg::Num(1.5), Arg::Num(5126.0)],
            vec![Arg::Num(1032.0), Arg::Num(-0.0), Arg::Nums([0.25, 1.0, f64::INFINITY].into())],
            vec![Arg::Nums([].into())],
        ];
        let compact: Vec<CompactCall> =
            fits.iter().map(|args| CompactCall::of(&call(args.clone()), &mut numbers).expect("it fits")).collect();
        for (compact, args) in compact.iter().zip(fits) {
            let mut back = call(vec![Arg::Null]);
            back.number = 0;
            compact.fill(&numbers, &mut back);
            assert_eq!((compact.function, back.number, &back.args), (7, 9, &args));
            // Into arguments like them; what others hold of these stays as it was.
            let (before, other) = (back.args.clone(), CompactCall { at: compact.at + 1, ..*compact });
            other.fill(&[&numbers[..], &[7.0]].concat(), &mut back);
            assert_eq!(before, args);
            compact.fill(&numbers, &mut back);
            assert_eq!(back.args, args);
        }
        let length = numbers.len();
        for args in [
            vec![Arg::Num(0.1)],
            vec![Arg::Num(1.0), Arg::Nums([1.0, f64::NAN].into())],
            vec![Arg::Nums([1.0].into()), Arg::Num(1.0)],
            vec![Arg::Blob([1].into())],
        ] {
            assert!(CompactCall::of(&call(args), &mut numbers).is_none() && numbers.len() == length);
        }
    }
}
