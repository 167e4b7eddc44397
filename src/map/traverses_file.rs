//! Several traverses in a map's file: the first one's rows are the tensor `descriptors`, and those
//! of all further ones lie one after the other in tensors of their own.

use std::io;
use std::ops::Range;
use std::sync::Arc;

use once_cell::race::OnceBox;
use safetensors::tensor::Dtype as FileDtype;

use super::blank::{flagged, flags};
use super::block::{Blocks, lengths};
use super::contents::{Head, checked_norms, file_dtype};
use super::file::check_norms;
use super::recipe::Kind;
use super::route::Names;
use super::storage::Storage;
use super::traverses::{Further, LONGEST_LABEL, MOST, Traverses};
use crate::archive::{Refusal, Tensors, Writer, swap_to_file_order};
use crate::distance::Metric;
use crate::dtype::Dtype;

/// The rows of the further traverses.
pub(super) const ROWS: &str = "traverse.rows";
/// How many rows each has.
const COUNTS: &str = "traverse.counts";
/// The place of each row.
const PLACES: &str = "traverse.places";
const NORMS: &str = "traverse.norms";
const BLANK: &str = "traverse.blank";
/// The labels of all traverses, a NUL after each.
const LABELS: &str = "traverse.labels";

impl Traverses {
    /// Adds the tensors whose numbers are aligned to 8 bytes.
    pub(super) fn write_head<'a>(&'a self, kind: &Kind, writer: &mut Writer<'a>) {
        if self.further.is_empty() {
            return;
        }
        let counts: Vec<u64> = self.further.iter().map(|one| one.places.len() as u64).collect();
        writer.stream(COUNTS, FileDtype::U64, vec![counts.len()], move |out| {
            out.numbers(bytemuck::must_cast_slice(&counts), size_of::<u64>())
        });
        writer.stream(PLACES, FileDtype::U64, vec![self.further_rows()], |out| {
            let places = self.further.iter().flat_map(|one| &*one.places);
            let places: Vec<u64> = places.map(|&place| u64::from(place)).collect();
            out.numbers(bytemuck::must_cast_slice(&places), size_of::<u64>())
        });
        if kind.metric == Metric::Cosine {
            let norms = self.further.iter().flat_map(|one| one.blocks.iter());
            let norms = norms.map(|block| block.norms()).collect();
            writer.numbers(NORMS, vec![self.further_rows()], norms);
        }
    }

    pub(super) fn write_rows<'a>(&'a self, kind: &'a Kind, writer: &mut Writer<'a>) {
        if self.further.is_empty() {
            return;
        }
        let shape = vec![self.further_rows(), kind.dim];
        writer.stream(ROWS, file_dtype(kind.dtype), shape, |out| {
            let mut blocks = self.further.iter().flat_map(|one| one.blocks.iter());
            blocks.try_for_each(|block| out.numbers(block.rows().bytes(), kind.dtype.size()))
        });
    }

    pub(super) fn write_tail<'a>(&'a self, kind: &'a Kind, writer: &mut Writer<'a>) {
        if !self.further.is_empty() {
            writer.stream(BLANK, FileDtype::U8, vec![self.further_rows()], |out| {
                self.further
                    .iter()
                    .try_for_each(|one| out.bytes(&flags(one.blank(kind), one.places.len())))
            });
        }
        if !(self.further.is_empty() && self.first.is_empty()) {
            let labels = self.further.iter().map(|one| &one.label);
            let labels: String =
                [&self.first].into_iter().chain(labels).flat_map(|label| [label, "\0"]).collect();
            writer.stream(LABELS, FileDtype::U8, vec![labels.len()], move |out| {
                out.bytes(labels.as_bytes())
            });
        }
    }
}

/// The further traverses of a file, without their rows.
pub(super) struct TraverseParts {
    labels: Vec<Arc<str>>,
    counts: Vec<usize>,
    places: Vec<u32>,
    norms: Option<Vec<f64>>,
    /// The rows that show nothing, if the file says so.
    blank: Option<Arc<[usize]>>,
    /// The bytes of the rows in the file; empty if there are none.
    #[cfg_attr(not(feature = "mmap"), expect(dead_code, reason = "for a mapped file"))]
    pub(super) rows: Range<usize>,
}

fn foreign<T>(reason: String) -> Result<T, Refusal> {
    Err(Refusal::Foreign(reason))
}

/// The labels of a file's traverses, the first's first.
fn labels_of(tensors: &Tensors<'_>) -> Result<Vec<Arc<str>>, Refusal> {
    let labels = tensors.numbers::<u8>(LABELS, "(bytes), UTF-8 text", |s| s.len() == 1)?;
    let labels = labels.map(|(_, bytes)| Names::from_bytes(bytes));
    let labels: Vec<Arc<str>> = match &labels {
        None => vec!["".into()],
        Some(Some(labels)) if (1..=MOST + 1).contains(&labels.len()) => {
            labels.list().iter().map(|label| label.as_str().into()).collect()
        }
        Some(_) => return foreign(format!("{LABELS}: expected 1 to {} texts", MOST + 1)),
    };
    if labels.iter().any(|label| label.len() > LONGEST_LABEL) {
        return foreign(format!("{LABELS}: expected at most {LONGEST_LABEL} bytes each"));
    }
    Ok(labels)
}

impl Traverses {
    /// The first alone, with its label.
    pub(super) fn first_of(tensors: &Tensors<'_>) -> Result<Self, Refusal> {
        let first = labels_of(tensors)?.swap_remove(0);
        Ok(Self::new(first, Vec::new()))
    }
}

impl TraverseParts {
    pub(super) fn of(head: &Head, tensors: &Tensors<'_>) -> Result<Self, Refusal> {
        let (header, labels) = (&tensors.header, labels_of(tensors)?);
        let Some(info) = header.info(ROWS) else {
            if labels.len() > 1 {
                return foreign(format!("{ROWS}: expected a tensor of that name, got none"));
            }
            let (counts, places, norms, blank) = (Vec::new(), Vec::new(), None, None);
            return Ok(Self { labels, counts, places, norms, blank, rows: 0..0 });
        };
        let (dim, dtype) = (head.dim, file_dtype(head.dtype));
        let fits = matches!(info.shape[..], [rows, width] if rows > 0 && width == dim);
        if info.dtype != dtype || !fits {
            let expected = format!("a tensor of {dtype:?} (rows, {dim})");
            let got = format!("{:?} {:?}", info.dtype, info.shape);
            return foreign(format!("{ROWS}: expected {expected}, got {got}"));
        }
        let (rows, further) = (info.shape[0], labels.len() - 1);
        let expected = format!("({further}), a number for each traverse but the first");
        let (_, counts) = tensors.required::<u64>(COUNTS, &expected, |s| s == [further])?;
        let expected = format!("({rows}), a place for each row");
        let (_, places) = tensors.required::<u64>(PLACES, &expected, |s| s == [rows])?;
        let mut left = &places[..];
        for &count in &counts {
            let own = usize::try_from(count).ok().filter(|&count| count > 0);
            let Some((own, rest)) = own.and_then(|count| left.split_at_checked(count)) else {
                return foreign(format!("{COUNTS}: expected {rows} rows in all, each above 0"));
            };
            let ascend = own.windows(2).all(|pair| pair[0] < pair[1]);
            if !ascend || own.last().is_some_and(|&last| last >= head.places as u64) {
                let last = head.places - 1;
                return foreign(format!("{PLACES}: expected places from 0 to {last}, ascending"));
            }
            left = rest;
        }
        if !left.is_empty() {
            return foreign(format!("{COUNTS}: expected {rows} rows in all"));
        }
        let mut norms = None;
        if head.entry.metric == Metric::Cosine {
            let expected = format!("({rows}), a number for each row");
            norms = tensors.numbers(NORMS, &expected, |s| s == [rows])?;
        }
        let norms = norms.map(|(_, norms)| checked_norms(norms)).transpose()?;
        let expected = format!("({rows}), 0 or 1 for each row");
        let blank = tensors.numbers::<u8>(BLANK, &expected, |s| s == [rows])?;
        let blank = blank.map(|(_, flags)| {
            let reason = || Refusal::Foreign(format!("{BLANK}: expected {expected}"));
            flagged(&flags).ok_or_else(reason)
        });
        let blank = blank.transpose()?;
        let places = places.iter().map(|&place| place as u32).collect();
        let counts = counts.iter().map(|&count| count as usize).collect();
        Ok(Self { labels, counts, places, norms, blank, rows: header.span(info) })
    }

    /// Memory for the rows, with their bytes; `None` if there are none.
    pub(super) fn storage(dtype: Dtype, bytes: &[u8]) -> Result<Option<Storage>, Refusal> {
        if bytes.is_empty() {
            return Ok(None);
        }
        let memory = Storage::try_zeros(dtype, bytes.len() / dtype.size());
        let mut memory = memory.ok_or_else(|| io::Error::from(io::ErrorKind::OutOfMemory))?;
        memory.bytes_mut().copy_from_slice(bytes);
        swap_to_file_order(memory.bytes_mut(), dtype.size());
        Ok(Some(memory))
    }

    /// The traverses with their rows, which are checked unless they are only `mapped`.
    pub(super) fn with_rows(
        self,
        rows: Option<Storage>,
        kind: (usize, Metric),
        mapped: bool,
    ) -> Result<Traverses, Refusal> {
        let Self { labels, counts, places, norms, blank, .. } = self;
        let (dim, metric) = kind;
        let Some(rows) = rows else {
            return Ok(Traverses::new(labels[0].clone(), Vec::new()));
        };
        if !mapped {
            rows.view().check_finite(ROWS, dim)?;
        }
        let norms = match norms {
            Some(norms) if mapped => norms,
            None if mapped => checked_norms(lengths(rows.view(), dim, metric)?)?,
            norms => {
                let own = lengths(rows.view(), dim, metric)?;
                if let Some(norms) = &norms {
                    check_norms(norms, &own, 0)?;
                }
                norms.unwrap_or(own)
            }
        };
        let all = Blocks::of(rows, dim, &norms);
        let mut start = 0;
        let further = labels[1..].iter().zip(counts).map(|(label, count)| {
            let own = start..start + count;
            start = own.end;
            let within = |blank: &Arc<[usize]>| -> Arc<[usize]> {
                let within = blank.iter().filter(|row| own.contains(row));
                within.map(|row| row - own.start).collect()
            };
            Further {
                label: label.clone(),
                places: places[own.clone()].into(),
                blocks: all.slice(own.clone()),
                blank: blank.as_ref().map_or_else(OnceBox::new, |blank| {
                    OnceBox::with_value(Box::new(within(blank)))
                }),
            }
        });
        let further = further.collect();
        Ok(Traverses::new(labels[0].clone(), further))
    }
}
