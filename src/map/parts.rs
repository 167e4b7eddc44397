//! The parts of a map's file, and what is read of them beside the rows.

use std::borrow::Cow;
use std::ops::Range;

use super::layout::{Layout, PostKind, PostPart, Refusal};
use super::names::Names;
use super::{Map, Positions};
use crate::error::Error;
use crate::post::{FittedStep, Post, Step};

/// A part of the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    Positions,
    Norms,
    /// A tensor of post-processing, by its number.
    Post(usize),
    Rows,
    Names,
}

impl Layout {
    /// The parts that there are with their places in the file, in the order in which they lie
    /// there.
    pub(super) fn parts(&self) -> Vec<(Part, Range<usize>)> {
        let each = [
            (Part::Positions, self.positions.clone()),
            (Part::Norms, self.norms.clone()),
            (Part::Rows, Some(self.rows.clone())),
            (Part::Names, self.names.clone()),
        ];
        let mut parts: Vec<_> =
            each.into_iter().filter_map(|(part, span)| span.map(|span| (part, span))).collect();
        let post = self.post_parts.iter().enumerate();
        parts.extend(post.map(|(index, part)| (Part::Post(index), part.span.clone())));
        parts.sort_by_key(|(_, span)| (span.start, span.end));
        parts
    }
}

/// All that a file holds but for the rows: small beside them.
#[derive(Default)]
pub(super) struct Small {
    pub(super) positions: Option<Positions>,
    pub(super) norms: Option<Vec<f64>>,
    pub(super) names: Option<Names>,
    /// What the steps of the post-processing have been told so far.
    stages: Vec<FittedStep>,
}

impl Small {
    /// Takes a part's bytes.
    pub(super) fn take(
        &mut self,
        layout: &Layout,
        part: Part,
        bytes: Cow<'_, [u8]>,
    ) -> Result<(), Refusal> {
        match part {
            Part::Positions => self.positions = Some(Positions::new(floats(&bytes), layout.axes)?),
            Part::Norms => self.norms = Some(checked_norms(floats(&bytes))?),
            Part::Names => {
                let count = bytes.len();
                let refused = || Error::Shape {
                    what: "names",
                    expected: "UTF-8 text".to_owned(),
                    got: format!("{count} bytes that are none"),
                };
                let names = Names::from_bytes(bytes.into_owned()).ok_or_else(refused)?;
                if names.len() != layout.places {
                    let (expected, got) = (layout.places, names.len());
                    return Err(Error::Length { what: "names", expected, got }.into());
                }
                self.names = Some(names);
            }
            Part::Post(index) => {
                if self.stages.is_empty() {
                    self.stages = untold(&layout.post);
                }
                let PostPart { step, kind, .. } = layout.post_parts[index];
                match kind {
                    PostKind::Offset => self.stages[step].offset = floats(&bytes),
                    PostKind::Scale => self.stages[step].scale = floats(&bytes),
                    PostKind::Matrix => {
                        let numbers = bytes.as_chunks().0.iter();
                        self.stages[step].matrix =
                            numbers.map(|x| f32::from_le_bytes(*x)).collect();
                    }
                }
            }
            Part::Rows => {}
        }
        Ok(())
    }

    /// The post-processing, where there is some.
    ///
    /// # Errors
    /// What does not fit together.
    pub(super) fn post(&mut self, layout: &Layout) -> Result<Option<Post>, Refusal> {
        if layout.post.is_empty() {
            return Ok(None);
        }
        let mut stages = std::mem::take(&mut self.stages);
        if stages.is_empty() {
            // None of the steps has a tensor.
            stages = untold(&layout.post);
        }
        Post::from_fitted(stages, layout.dim).map(Some).map_err(Refusal::Foreign)
    }

    /// The map with its names and positions, and what its queries go through.
    pub(super) fn finish(mut self, layout: &Layout, mut map: Map) -> Result<Map, Refusal> {
        map.post = self.post(layout)?.map(Into::into);
        map.learned.clone_from(&layout.learned);
        map.positions = self.positions;
        map.names = self.names;
        Ok(map)
    }
}

/// The lengths of rows, which are no lengths where a row holds a NaN or only zeros.
pub(super) fn checked_norms(norms: Vec<f64>) -> Result<Vec<f64>, Refusal> {
    match norms.iter().position(|norm| !(norm.is_finite() && *norm > 0.0)) {
        None => Ok(norms),
        Some(row) => {
            let got = norms[row];
            Err(Refusal::Foreign(format!(
                "norms: expected finite numbers above 0, got {got} at row {row}"
            )))
        }
    }
}

/// Steps that have been told nothing yet.
fn untold(steps: &[Step]) -> Vec<FittedStep> {
    steps.iter().map(|&step| FittedStep::new(step)).collect()
}

fn floats(bytes: &[u8]) -> Vec<f64> {
    bytes.as_chunks().0.iter().map(|x| f64::from_le_bytes(*x)).collect()
}
