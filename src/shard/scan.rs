//! A shard's scan: the distances to the rows of its places, and the column that they become.

use std::ops::Range;

use super::message::Numbers;
use crate::error::Error;
use crate::map::{Map, Means, RowSums};
use crate::method::Layout;
use crate::sums::BLOCK;

/// The rows that a shard looks at, and their distances to the newest query.
#[derive(Clone, Debug)]
pub(super) struct Scan {
    /// Whose distances they are.
    query: Option<Numbers>,
    traverses: Vec<Traverse>,
    /// The column of the places of all spans, in order.
    places: Vec<f32>,
    /// The column of the line, and of the ends of segments.
    column: Vec<f32>,
}

/// The rows of one traverse.
#[derive(Clone, Debug)]
struct Traverse {
    /// Which row of all is its first.
    start: usize,
    spans: Vec<Span>,
    distances: Vec<f32>,
}

/// Rows that follow each other.
#[derive(Clone, Debug)]
struct Span {
    rows: Range<usize>,
    /// The index of the first one's distance.
    at: usize,
}

impl Traverse {
    fn new(map: &Map, traverse: usize, places: &[Range<usize>]) -> Self {
        let (mut spans, mut at) = (Vec::new(), 0);
        for places in places {
            let (rows, _) = map.rows_of(traverse, places);
            at += rows.len();
            spans.push(Span { at: at - rows.len(), rows });
        }
        let (_, start) = map.rows_of(traverse, &(0..0));
        Self { start, spans, distances: vec![0.0; at] }
    }

    /// Where some of its rows are, of one span.
    fn at(&self, rows: &Range<usize>) -> Range<usize> {
        if rows.is_empty() {
            return 0..0;
        }
        let span = &self.spans[self.spans.partition_point(|span| span.rows.end <= rows.start)];
        let start = span.at + (rows.start - span.rows.start);
        start..start + rows.len()
    }
}

impl Scan {
    pub(super) fn new(map: &Map, layout: &Layout) -> Self {
        let ends = layout.ends().flatten().map(|place| place..place + 1);
        let mut ranges: Vec<Range<usize>> = layout.ranges().map(|(range, _)| range).collect();
        ranges.push(layout.own());
        ranges.extend(ends);
        ranges.sort_unstable_by_key(|range| range.start);
        let mut spans: Vec<Range<usize>> = Vec::new();
        for range in ranges {
            match spans.last_mut() {
                Some(last) if range.start <= last.end => last.end = last.end.max(range.end),
                _ => spans.push(range),
            }
        }
        let traverses = 0..=map.further();
        let traverses: Vec<_> = traverses.map(|index| Traverse::new(map, index, &spans)).collect();
        let places = vec![0.0; traverses[0].distances.len()];
        let column = vec![0.0; layout.len() + 4 * layout.ends().count()];
        Self { query: None, traverses, places, column }
    }

    /// Computes the distances to a query, unless they are there.
    ///
    /// # Errors
    /// Those of [`Map::distances_into`] about the query.
    pub(super) fn run(&mut self, map: &Map, numbers: &Numbers) -> Result<(), Error> {
        if self.query.as_ref() == Some(numbers) {
            return Ok(());
        }
        let values = numbers.values()?;
        let query = map.query(values.view())?;
        self.query = None;
        for Traverse { start, spans, distances } in &mut self.traverses {
            for Span { rows, at } in spans {
                let out = &mut distances[*at..*at + rows.len()];
                map.scan(query, *start + rows.start..*start + rows.end, out);
            }
        }
        self.query = Some(numbers.clone());
        Ok(())
    }

    /// What the rows of each own block come to, number by number.
    pub(super) fn sums(&self, map: &Map, nothing: bool, own: &Range<usize>) -> Vec<f64> {
        let starts = own.clone().step_by(BLOCK);
        let blocks = starts.map(|start| start..own.end.min(start + BLOCK));
        let sums = blocks.map(|block| map.row_sums(nothing, block, self.rows()));
        sums.flat_map(|sums: RowSums| sums.numbers(map.further()).collect::<Vec<_>>()).collect()
    }

    /// The column of the line and of the ends: as the means say, if they are needed.
    pub(super) fn column(&mut self, map: &Map, layout: &Layout, means: Option<&Means>) -> &[f32] {
        let mut places = std::mem::take(&mut self.places);
        match means {
            None => places.copy_from_slice(&self.traverses[0].distances),
            Some(means) => {
                for Span { rows, at } in &self.traverses[0].spans {
                    let column = &mut places[*at..*at + rows.len()];
                    map.settle(means, rows.clone(), self.rows(), column);
                }
            }
        }
        let first = &self.traverses[0];
        for (range, at) in layout.ranges() {
            self.column[at..at + range.len()].copy_from_slice(&places[first.at(&range)]);
        }
        for (place, out) in layout.ends().flatten().zip(&mut self.column[layout.len()..]) {
            *out = places[first.at(&(place..place + 1)).start];
        }
        self.places = places;
        &self.column
    }

    /// Gives the distances to rows of a traverse.
    fn rows<'a>(&'a self) -> impl Fn(usize, Range<usize>) -> &'a [f32] {
        |traverse, rows| {
            let traverse = &self.traverses[traverse];
            &traverse.distances[traverse.at(&rows)]
        }
    }
}
