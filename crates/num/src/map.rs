//! Values by a number or a name, for packages with many kinds of them. The compiler makes a `BTreeMap` anew for each kind of value (about
//! 7,500 lines of its intermediate code); here only the list of values is made anew, and the search tree is one for all.

use std::collections::BTreeMap;
use std::marker::PhantomData;
use std::ops::Range;

/// What a value of a [`NumberMap`] is found by.
pub trait Number: Copy {
    /// It as a number; another number for each.
    fn to_number(self) -> u64;

    /// What a number was made of.
    fn of_number(number: u64) -> Self;
}

impl Number for u64 {
    fn to_number(self) -> u64 {
        self
    }

    fn of_number(number: u64) -> u64 {
        number
    }
}

impl Number for u32 {
    fn to_number(self) -> u64 {
        u64::from(self)
    }

    fn of_number(number: u64) -> u32 {
        number as u32
    }
}

/// In order of the first, then of the second.
impl Number for (u32, u32) {
    fn to_number(self) -> u64 {
        u64::from(self.0) << 32 | u64::from(self.1)
    }

    fn of_number(number: u64) -> (u32, u32) {
        ((number >> 32) as u32, number as u32)
    }
}

/// Values by keys that are numbers, in the order of the numbers.
#[derive(Clone, Debug)]
pub struct NumberMap<K, T> {
    places: Numbers,
    slots: Slots<T>,
    key: PhantomData<K>,
}

/// Values by a name, in alphabetical order.
#[derive(Clone, Debug)]
pub struct NameMap<T> {
    places: Names,
    slots: Slots<T>,
}

impl<K, T> Default for NumberMap<K, T> {
    fn default() -> Self {
        NumberMap { places: Numbers::default(), slots: Slots::default(), key: PhantomData }
    }
}

impl<T> Default for NameMap<T> {
    fn default() -> Self {
        NameMap { places: Names::default(), slots: Slots::default() }
    }
}

impl<K: Number, T> NumberMap<K, T> {
    /// An empty map.
    pub fn new() -> NumberMap<K, T> {
        NumberMap::default()
    }

    /// Number of values.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether this key has a value.
    pub fn contains(&self, key: K) -> bool {
        self.places.find(key.to_number()).is_some()
    }

    /// The value of a key.
    pub fn get(&self, key: K) -> Option<&T> {
        self.slots.get(self.places.find(key.to_number())?)
    }

    /// The value of a key, to change.
    pub fn get_mut(&mut self, key: K) -> Option<&mut T> {
        self.slots.get_mut(self.places.find(key.to_number())?)
    }

    /// Gives a key its value; the one that it had before.
    pub fn insert(&mut self, key: K, value: T) -> Option<T> {
        let place = self.places.place(key.to_number(), self.slots.next());
        self.slots.put(place, value)
    }

    /// The value of a key; where it has none, it is given this one.
    pub fn get_or_insert_with(&mut self, key: K, value: impl FnOnce() -> T) -> &mut T {
        let place = self.places.place(key.to_number(), self.slots.next());
        self.slots.get_or_put(place, value)
    }

    /// Takes a value out.
    pub fn remove(&mut self, key: K) -> Option<T> {
        let place = self.places.remove(key.to_number())?;
        self.slots.take(place)
    }

    /// All keys and values, in the order of the keys. It makes a list of them first.
    pub fn iter(&self) -> impl Iterator<Item = (K, &T)> {
        self.places.all().into_iter().filter_map(|(number, place)| Some((K::of_number(number), self.slots.get(place)?)))
    }

    /// All keys, in their order.
    pub fn keys(&self) -> impl DoubleEndedIterator<Item = K> + use<K, T> {
        self.places.all().into_iter().map(|(number, _)| K::of_number(number))
    }

    /// The keys of a range, in their order.
    pub fn keys_in(&self, range: Range<K>) -> impl DoubleEndedIterator<Item = K> + use<K, T> {
        let range = range.start.to_number()..range.end.to_number();
        self.places.list(range).into_iter().map(|(number, _)| K::of_number(number))
    }

    /// All values, in the order of the keys.
    pub fn values(&self) -> impl Iterator<Item = &T> {
        self.iter().map(|(_, value)| value)
    }

    /// All values, to change, in no order that means anything.
    pub fn values_mut(&mut self) -> impl Iterator<Item = &mut T> {
        self.slots.values.iter_mut().flatten()
    }
}

impl<T> NameMap<T> {
    /// An empty map.
    pub fn new() -> NameMap<T> {
        NameMap::default()
    }

    /// Number of values.
    pub fn len(&self) -> usize {
        self.places.0.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The value of a name.
    pub fn get(&self, name: &str) -> Option<&T> {
        self.slots.get(self.places.find(name)?)
    }

    /// Gives a name its value; the one that it had before.
    pub fn insert(&mut self, name: &str, value: T) -> Option<T> {
        let place = self.places.place(name, self.slots.next());
        self.slots.put(place, value)
    }

    /// The value of a name; where it has none, it is given this one.
    pub fn get_or_insert_with(&mut self, name: &str, value: impl FnOnce() -> T) -> &mut T {
        let place = self.places.place(name, self.slots.next());
        self.slots.get_or_put(place, value)
    }

    /// All names and values, in alphabetical order.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &T)> {
        self.places.0.iter().filter_map(|(name, &place)| Some((&**name, self.slots.get(place)?)))
    }
}

/// Values at places that do not move. Places of values that were taken are used again.
#[derive(Clone, Debug)]
struct Slots<T> {
    values: Vec<Option<T>>,
    free: Vec<usize>,
}

impl<T> Default for Slots<T> {
    fn default() -> Self {
        Slots { values: Vec::new(), free: Vec::new() }
    }
}

impl<T> Slots<T> {
    fn get(&self, place: usize) -> Option<&T> {
        self.values[place].as_ref()
    }

    fn get_mut(&mut self, place: usize) -> Option<&mut T> {
        self.values[place].as_mut()
    }

    /// The place that a new value gets.
    fn next(&self) -> usize {
        self.free.last().copied().unwrap_or(self.values.len())
    }

    /// The slot of a place that is in use or the next one.
    fn slot(&mut self, place: usize) -> &mut Option<T> {
        if self.free.last() == Some(&place) {
            self.free.pop();
        } else if place == self.values.len() {
            self.values.push(None);
        }
        &mut self.values[place]
    }

    fn put(&mut self, place: usize, value: T) -> Option<T> {
        self.slot(place).replace(value)
    }

    fn get_or_put(&mut self, place: usize, value: impl FnOnce() -> T) -> &mut T {
        self.slot(place).get_or_insert_with(value)
    }

    fn take(&mut self, place: usize) -> Option<T> {
        self.free.push(place);
        self.values[place].take()
    }
}

/// Places by number. Its functions are compiled here and nowhere else.
#[derive(Clone, Debug, Default)]
struct Numbers {
    /// Of numbers below its length: one more than the place, or 0. Most numbers are those of objects that were made one after the other, and
    /// every command looks some of them up.
    low: Vec<u32>,
    /// Of the others.
    high: BTreeMap<u64, usize>,
    /// How many numbers below that length have a place.
    count: usize,
}

/// Numbers below this always go into the table [`Numbers::low`].
const TABLE: u64 = 64;
/// For each number that has a place, the table may have this number of entries more.
const TABLE_EACH: u64 = 16;

impl Numbers {
    #[inline(never)]
    fn len(&self) -> usize {
        self.count + self.high.len()
    }

    #[inline(never)]
    fn find(&self, number: u64) -> Option<usize> {
        if self.is_low(number) {
            return (self.low[number as usize] as usize).checked_sub(1);
        }
        self.high.get(&number).copied()
    }

    fn is_low(&self, number: u64) -> bool {
        number < self.low.len() as u64
    }

    /// The place of a number; this one where it has none.
    #[inline(never)]
    fn place(&mut self, number: u64, next: usize) -> usize {
        if let Some(place) = self.find(number) {
            return place;
        }
        if !self.is_low(number) && number < TABLE + TABLE_EACH * self.len() as u64 {
            self.low.resize(number as usize + 1, 0);
            let above = self.high.split_off(&(number + 1));
            for (number, place) in std::mem::replace(&mut self.high, above) {
                self.low[number as usize] = place as u32 + 1;
                self.count += 1;
            }
        }
        if self.is_low(number) {
            self.low[number as usize] = next as u32 + 1;
            self.count += 1;
        } else {
            self.high.insert(number, next);
        }
        next
    }

    #[inline(never)]
    fn remove(&mut self, number: u64) -> Option<usize> {
        let place = self.find(number)?;
        if self.is_low(number) {
            self.low[number as usize] = 0;
            self.count -= 1;
        } else {
            self.high.remove(&number);
        }
        Some(place)
    }

    #[inline(never)]
    fn all(&self) -> Vec<(u64, usize)> {
        self.list(0..u64::MAX).into_iter().chain(self.high.get(&u64::MAX).map(|&place| (u64::MAX, place))).collect()
    }

    #[inline(never)]
    fn list(&self, range: Range<u64>) -> Vec<(u64, usize)> {
        if range.is_empty() {
            return Vec::new();
        }
        let ends = [range.start, range.end].map(|end| end.min(self.low.len() as u64) as usize);
        let low = self.low[ends[0]..ends[1]].iter().zip(range.start..);
        let low = low.filter_map(|(&place, number)| Some((number, (place as usize).checked_sub(1)?)));
        low.chain(self.high.range(range).map(|(&number, &place)| (number, place))).collect()
    }
}

/// Places by name.
#[derive(Clone, Debug, Default)]
struct Names(BTreeMap<Box<str>, usize>);

impl Names {
    #[inline(never)]
    fn find(&self, name: &str) -> Option<usize> {
        self.0.get(name).copied()
    }

    /// The place of a name; this one where it has none.
    #[inline(never)]
    fn place(&mut self, name: &str, next: usize) -> usize {
        if let Some(&place) = self.0.get(name) {
            return place;
        }
        self.0.insert(name.into(), next);
        next
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::Random;

    /// Both maps do what a `BTreeMap` does.
    #[test]
    fn maps_agree_with_the_standard_one() {
        let mut random = Random::new(3);
        let (mut numbers, mut names, mut expected) = (NumberMap::new(), NameMap::new(), BTreeMap::new());
        for step in 0..4000_u32 {
            // Some in the table, some beyond it, and the table grows.
            let key = (random.below(3), random.below(30) * (1 + random.below(2) * step / 16));
            match random.below(4) {
                0 => assert_eq!(numbers.remove(key), expected.remove(&key)),
                1 => assert_eq!(numbers.insert(key, step), expected.insert(key, step)),
                2 => assert_eq!(numbers.get_or_insert_with(key, || step), expected.entry(key).or_insert(step)),
                _ => assert_eq!(numbers.get_mut(key), expected.get_mut(&key)),
            }
            assert_eq!(
                (numbers.len(), numbers.get(key), numbers.contains(key)),
                (expected.len(), expected.get(&key), expected.contains_key(&key))
            );
        }
        assert!(numbers.iter().eq(expected.iter().map(|(&key, value)| (key, value))));
        assert!(numbers.keys().eq(expected.keys().copied()));
        assert!(numbers.values().eq(expected.values()));
        assert!(numbers.keys_in((1, 5)..(2, 7)).eq(expected.range((1, 5)..(2, 7)).map(|(&key, _)| key)));
        assert_eq!(numbers.keys_in((2, 7)..(1, 5)).count(), 0);
        let mut all: Vec<u32> = numbers.values_mut().map(|value| *value).collect();
        let mut sorted: Vec<u32> = expected.values().copied().collect();
        all.sort_unstable();
        sorted.sort_unstable();
        assert_eq!(all, sorted);

        let mut expected = BTreeMap::new();
        for step in 0..500_u32 {
            let name = random.below(90).to_string();
            if step % 2 == 0 {
                assert_eq!(names.insert(&name, step), expected.insert(name.clone(), step));
            } else {
                assert_eq!(names.get_or_insert_with(&name, || step), expected.entry(name.clone()).or_insert(step));
            }
            assert_eq!(names.get(&name), expected.get(&name));
        }
        assert!(names.iter().eq(expected.iter().map(|(name, value)| (name.as_str(), value))));
        assert_eq!(names.get("none"), None);
    }
}
