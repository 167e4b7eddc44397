//! The method in parts (docs/explanation/shards.md): each shard has its part of every column, and
//! [`Whole`] makes fixes of what they say. They are the matcher's, to the last bit: minima, peaks
//! and least sums of parts are those of the whole, and sums over places are made of the sums of
//! blocks, in order.

mod part;
mod said;
mod saved;
mod whole;

pub(crate) use part::Part;
pub(crate) use said::{First, FirstSaid, Second, SecondSaid};
pub(crate) use saved::{PartSaved, VIEW, WholeSaved};
pub(crate) use whole::{Decided, Whole, check, cuts};
