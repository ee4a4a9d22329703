//! Pools of what is too large for a token.

/// Things with an index, allocated and freed all the time.
#[derive(Clone, Debug)]
pub struct Pool<T> {
    items: Vec<T>,
    free: Vec<u32>,
}

impl<T: Copy + Default> Default for Pool<T> {
    fn default() -> Pool<T> {
        Pool { items: Vec::new(), free: Vec::new() }
    }
}

impl<T: Copy + Default> Pool<T> {
    /// Takes in an item. Grows only until as many are in flight as ever will be.
    #[inline(always)]
    pub fn insert(&mut self, item: T) -> u32 {
        match self.free.pop() {
            Some(index) => {
                self.items[index as usize] = item;
                index
            }
            None => {
                self.items.push(item);
                (self.items.len() - 1) as u32
            }
        }
    }

    /// Gives an item up.
    #[inline(always)]
    pub fn remove(&mut self, index: u32) {
        self.free.push(index);
    }

    /// Items held.
    pub fn len(&self) -> usize {
        self.items.len() - self.free.len()
    }

    /// The items held, by index.
    pub fn held(&self) -> impl Iterator<Item = &T> {
        let mut free = vec![false; self.items.len()];
        self.free.iter().for_each(|&index| free[index as usize] = true);
        self.items.iter().zip(free).filter_map(|(item, free)| (!free).then_some(item))
    }

    /// Whether the pool holds no item.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl<T> std::ops::Index<u32> for Pool<T> {
    type Output = T;

    #[inline(always)]
    fn index(&self, index: u32) -> &T {
        &self.items[index as usize]
    }
}

impl<T> std::ops::IndexMut<u32> for Pool<T> {
    #[inline(always)]
    fn index_mut(&mut self, index: u32) -> &mut T {
        &mut self.items[index as usize]
    }
}
