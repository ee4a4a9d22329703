//! Tables of a number or a few for each frame. They are not kept in memory: sequences are long.

use std::io;
use std::marker::PhantomData;
use std::ops::Range;

use ::host::Spool;
use bytemuck::Pod;

/// Rows that a pass has in memory at a time.
const ROWS: usize = 256;

/// Rows of as many numbers each.
#[derive(Debug)]
pub struct Table<T> {
    width: usize,
    rows: usize,
    spool: Spool,
    of: PhantomData<T>,
}

impl<T: Pod> Table<T> {
    /// A table without rows. Each row will have `width` numbers.
    pub fn new(width: usize) -> Table<T> {
        Table { width, rows: 0, spool: Spool::default(), of: PhantomData }
    }

    /// Numbers of a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// How many rows there are.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Adds a row, or several one behind the other.
    ///
    /// # Errors
    /// As [`Spool::add`].
    pub fn add(&mut self, rows: &[T]) -> io::Result<()> {
        assert_eq!(rows.len() % self.width, 0, "rows of {} numbers", self.width);
        self.spool.add(bytemuck::cast_slice(rows))?;
        self.rows += rows.len() / self.width;
        Ok(())
    }

    /// One row.
    ///
    /// # Errors
    /// As [`Spool::read`].
    pub fn row(&self, at: usize) -> io::Result<Vec<T>> {
        let mut row = vec![T::zeroed(); self.width];
        self.spool.read(self.place(at), bytemuck::cast_slice_mut(&mut row))?;
        Ok(row)
    }

    /// Fills a buffer with the rows of a range.
    ///
    /// # Errors
    /// As [`Spool::read`].
    pub fn fill(&self, range: &Range<usize>, rows: &mut Vec<T>) -> io::Result<()> {
        rows.resize(range.len() * self.width, T::zeroed());
        self.spool.read(self.place(range.start), bytemuck::cast_slice_mut(rows))
    }

    /// Replaces rows from one on.
    ///
    /// # Errors
    /// As [`Spool::replace`].
    pub fn replace(&mut self, from: usize, rows: &[T]) -> io::Result<()> {
        self.spool.replace(self.place(from), bytemuck::cast_slice(rows))
    }

    /// Goes through all rows in order, some at a time.
    ///
    /// # Errors
    /// As [`Spool::read`].
    pub fn each(&self, mut each: impl FnMut(usize, &[T])) -> io::Result<()> {
        let mut rows = Vec::new();
        parts(self.rows).try_for_each(|range| {
            self.fill(&range, &mut rows)?;
            rows.chunks_exact(self.width).zip(range).for_each(|(row, at)| each(at, row));
            Ok(())
        })
    }

    fn place(&self, row: usize) -> u64 {
        (row * self.width * size_of::<T>()) as u64
    }
}

/// The ranges of rows, of `rows` in all, that a pass over the table takes at a time.
pub fn parts(rows: usize) -> impl Iterator<Item = Range<usize>> {
    (0..rows).step_by(ROWS).map(move |from| from..(from + ROWS).min(rows))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_come_back_in_order_and_can_be_replaced() {
        let mut table = Table::<f64>::new(3);
        let row = |at: usize| [at as f64, at as f64 * 0.5, -1.0];
        let rows = 4 * ROWS + 5;
        (0..rows).for_each(|at| table.add(&row(at)).expect("added"));
        table.replace(700, &[row(7), row(8)].concat()).expect("replaced");
        let own = |at| if (700..702).contains(&at) { row(at - 693) } else { row(at) };
        let mut next = 0;
        table
            .each(|at, found| {
                assert_eq!((at, found), (next, &own(at)[..]));
                next += 1;
            })
            .expect("read");
        assert_eq!((next, table.rows()), (rows, rows));
        assert_eq!(table.row(701).expect("read"), row(8));
        assert!(table.row(rows).is_err());
    }
}
