//! Whole runs at once: the same answers as the stream, on all cores.

mod descriptors;
mod distances;

use std::io::{self, Write};

pub use descriptors::match_descriptors;
pub use distances::match_distances;

use crate::error::Error;
use crate::method::Fix;

/// The fixes of a whole run, one a query, in order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Run {
    /// One fix a query.
    pub fixes: Vec<Fix>,
    /// How many places the route has.
    pub places: usize,
}

impl Run {
    /// Writes the fixes as CSV: a line of names, then a line a query. Warm-up leaves `anchors` and
    /// `speed` empty.
    ///
    /// # Errors
    /// Whatever `out` gives.
    pub fn write_csv(&self, out: &mut impl Write) -> io::Result<()> {
        writeln!(
            out,
            "frame,place,score,trusted,ready,anchors,speed,single_place,single_distance,gradient_place,gradient_value"
        )?;
        for fix in &self.fixes {
            let Fix { frame, place, score, trusted, single, gradient, sequence } = fix;
            let (ready, anchors, speed) = match sequence {
                Some(s) => (true, s.anchors.to_string(), s.speed.to_string()),
                None => (false, String::new(), String::new()),
            };
            writeln!(
                out,
                "{frame},{place},{score},{trusted},{ready},{anchors},{speed},{},{},{},{}",
                single.place, single.distance, gradient.place, gradient.value
            )?;
        }
        Ok(())
    }
}

/// For each query, whether there is a gap before it.
fn cut_before(gaps: &[usize], queries: usize) -> Result<Vec<bool>, Error> {
    let mut cut = vec![false; queries];
    for &query in gaps {
        *cut.get_mut(query).ok_or_else(|| Error::Option {
            name: "gaps",
            expected: match queries.checked_sub(1) {
                Some(last) => format!("indices of queries, from 0 to {last}"),
                None => "none, as there is no query".to_owned(),
            },
            got: query.to_string(),
        })? = true;
    }
    Ok(cut)
}
