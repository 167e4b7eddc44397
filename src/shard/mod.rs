//! One route in shards: a map that outgrows one machine, with a [`Localizer`](crate::Localizer)'s
//! fixes, to the last bit.
//!
//! A [`Shard`] scans the rows of its own places and keeps what the method knows of them. A
//! [`Driver`] takes queries as a localizer does; it asks all shards a [`Question`] each, two times a
//! query (three if the map has several traverses or places that show nothing, or if the query
//! shows nothing), and makes a [`Fix`](crate::Fix) of their [`Answer`]s. How questions and answers
//! travel is not its concern: they are serde's.
//!
//! ```
//! use std::sync::Arc;
//! use surefix::shard::{Driver, Next, Shard};
//! use surefix::{Config, Given, Input, Map, Metric, View};
//! let rows: Vec<f32> = (0..10_000).flat_map(|at| [at as f32, (at % 7) as f32]).collect();
//! let map = Arc::new(Map::from_descriptors(rows, 2, Metric::Manhattan)?);
//! let config = Config::default();
//! let shard = |index| Shard::new(Arc::clone(&map), &config, index, 3);
//! let mut shards = (0..3).map(shard).collect::<Result<Vec<_>, _>>()?;
//! let mut driver = Driver::new(Arc::clone(&map), &config, 3)?;
//! let query = Input::Descriptor(View::F32(&[8_191.2, 1.0]));
//! let mut next = driver.push(query, Given::default())?;
//! let fix = loop {
//!     let questions = match next {
//!         Next::Ask(questions) => questions,
//!         Next::Fix(fix) => break fix,
//!     };
//!     let each = shards.iter_mut().zip(&questions);
//!     let answers = each.map(|(shard, question)| shard.answer(question));
//!     next = driver.answer(&answers.collect::<Result<Vec<_>, _>>()?)?;
//! };
//! assert_eq!(fix.place, 8_191);
//! # Ok::<(), surefix::Error>(())
//! ```

mod driver;
mod flight;
mod mark;
mod message;
mod one;
mod scan;
mod snapshot;

pub use driver::{Driver, Next};
pub use mark::{Header, PROTOCOL};
pub use message::{Answer, Question, Stage};
pub use one::Shard;
