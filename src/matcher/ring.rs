//! The last few columns, in memory that is laid out once.

use crate::error::Error;

/// The newest `capacity` columns of `height` numbers each, oldest overwritten first.
#[derive(Clone, Debug)]
pub(crate) struct Ring {
    numbers: Vec<f32>,
    height: usize,
    capacity: usize,
    /// Where the newest column lies.
    newest: usize,
    filled: usize,
}

impl Ring {
    /// Room for `capacity` columns, taken and touched now.
    pub(crate) fn new(capacity: usize, height: usize) -> Result<Self, Error> {
        let count = capacity
            .checked_mul(height)
            .ok_or(Error::Memory { places: height, columns: capacity })?;
        let mut numbers = Vec::new();
        let refused = |_| Error::Memory { places: height, columns: capacity };
        numbers.try_reserve_exact(count).map_err(refused)?;
        numbers.resize(count, 0.0);
        Ok(Self { numbers, height, capacity, newest: 0, filled: 0 })
    }

    /// How many columns it holds at most.
    pub(crate) fn capacity(&self) -> usize {
        self.capacity
    }

    /// Numbers a column.
    pub(crate) fn height(&self) -> usize {
        self.height
    }

    /// How many columns it holds now.
    pub(crate) fn len(&self) -> usize {
        self.filled
    }

    pub(crate) fn clear(&mut self) {
        self.filled = 0;
    }

    /// Makes room for a new column, to be written by the caller.
    pub(crate) fn advance(&mut self) -> &mut [f32] {
        self.newest = if self.newest + 1 == self.capacity { 0 } else { self.newest + 1 };
        self.filled = (self.filled + 1).min(self.capacity);
        let start = self.newest * self.height;
        &mut self.numbers[start..start + self.height]
    }

    /// The column of `age` pushes ago: 0 is the newest. `age` is below `len()`.
    pub(crate) fn column(&self, age: usize) -> &[f32] {
        let start = self.start(age);
        &self.numbers[start..start + self.height]
    }

    /// The same, to be written.
    pub(crate) fn column_mut(&mut self, age: usize) -> &mut [f32] {
        let start = self.start(age);
        &mut self.numbers[start..start + self.height]
    }

    fn start(&self, age: usize) -> usize {
        debug_assert!(age < self.filled, "column {age} of {}", self.filled);
        let slot =
            if age <= self.newest { self.newest - age } else { self.newest + self.capacity - age };
        slot * self.height
    }
}
