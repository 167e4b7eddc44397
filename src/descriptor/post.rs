//! Post-processing of learned descriptors: fitted on the references, and done to each query (method 1.10).

use serde::{Deserialize, Serialize};

use super::projection;
use super::whiten::principal;
use crate::distance::products;
use crate::error::Error;
use crate::isa::Isa;
use crate::parallel::each;

/// The most numbers that a projection gives.
const MOST: usize = 1 << 20;

/// One step of post-processing, as it is asked for. In a chain, each works on what the one before gives.
///
/// As JSON: `{"step": "standardize"}`, `{"step": "pca", "dim": 512, "whiten": true}`, `{"step": "normalize"}`,
/// `{"step": "projection", "dim": 512, "seed": 0}`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "step", rename_all = "lowercase", deny_unknown_fields)]
#[non_exhaustive]
pub enum Step {
    /// Each dimension less its mean over the references, in units of its population standard deviation; 0 where all references have
    /// the same number.
    Standardize,
    /// The coordinates along the `dim` directions in which the references differ most (principal component analysis).
    Pca {
        /// How many, up to what the references span.
        dim: usize,
        /// Whether each is divided by its standard deviation over the references (with `n - 1`).
        whiten: bool,
    },
    /// To the length 1.
    Normalize,
    /// The products with `dim` vectors of random signs, divided by `sqrt(dim)`: distances stay about what they are (Achlioptas, 2003).
    Projection {
        /// How many.
        dim: usize,
        /// Which signs.
        seed: u64,
    },
}

/// A step that knows what it does: all are `matrix (x - offset) scale`, or the division by the length.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Stage {
    pub(crate) step: Step,
    /// What is subtracted, a number a dimension; or nothing.
    pub(crate) offset: Vec<f64>,
    /// What is multiplied with, a number a dimension; or nothing.
    pub(crate) scale: Vec<f64>,
    /// Rows that are multiplied with; or nothing.
    pub(crate) matrix: Vec<f32>,
}

/// A chain of steps that has been fitted on the references, so that queries are treated as these were.
///
/// ```
/// use surefix::descriptor::{Post, Step};
/// let rows = [1.0_f32, 2.0, 3.0, 7.0, 5.0, 9.0];
/// let (post, done) = Post::fit(&[Step::Standardize, Step::Normalize], &rows, 2)?;
/// assert_eq!(done[..2], post.apply(&rows[..2])?);
/// assert!((done[0].hypot(done[1]) - 1.0).abs() < 1e-6);
/// # Ok::<(), surefix::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Post {
    stages: Vec<Stage>,
    input: usize,
    output: usize,
}

/// The memory that one vector passes through.
#[derive(Debug, Default)]
pub(crate) struct Passage {
    now: Vec<f32>,
    next: Vec<f32>,
}

impl Clone for Passage {
    /// A copy with room for as much, so that it need not grow.
    fn clone(&self) -> Self {
        Self { now: Vec::with_capacity(self.now.capacity()), next: Vec::with_capacity(self.next.capacity()) }
    }
}

impl Passage {
    pub(crate) fn new(post: &Post) -> Self {
        let (mut width, mut room) = (post.input, post.input);
        for stage in &post.stages {
            let output = stage.output(width);
            // Principal components are computed beside the centred vector.
            room = room.max(width + output);
            width = output;
        }
        Self { now: Vec::with_capacity(room), next: Vec::with_capacity(room) }
    }
}

impl Post {
    /// Fits the steps on references, rows of `dim` numbers, one after the other: each on what those before it make of them. Gives the chain,
    /// and the references as the chain makes them.
    ///
    /// # Errors
    /// [`Error::Shape`] where `dim` does not divide the numbers; [`Error::NotFinite`] for a NaN or an infinity, in the references or
    /// after a step; [`Error::Option`] for a `dim` of 0, or of more than the references span or memory holds;
    /// [`Error::NoDirection`] for a row of zeros that is to have the length 1; [`Error::TooFewPlaces`] below two rows.
    pub fn fit(steps: &[Step], rows: &[f32], dim: usize) -> Result<(Self, Vec<f32>), Error> {
        if dim == 0 || !rows.len().is_multiple_of(dim) {
            let expected = "rows of at least one number, all of one length".to_owned();
            let got = format!("{} numbers in rows of {dim}", rows.len());
            return Err(Error::Shape { what: "references", expected, got });
        }
        if rows.len() < 2 * dim {
            return Err(Error::TooFewPlaces { what: "references", got: rows.len() / dim });
        }
        crate::distance::View::from(rows).check_finite("references", dim)?;
        let mut post = Self { stages: Vec::new(), input: dim, output: dim };
        let mut rows = rows.to_vec();
        for step in steps {
            let stage = Stage::fit(*step, &rows, post.output)?;
            let output = stage.output(post.output);
            rows = apply(std::slice::from_ref(&stage), &rows, post.output, output, true)?;
            post.stages.push(stage);
            post.output = output;
        }
        Ok((post, rows))
    }

    /// A chain of stages that were fitted before: those of a file.
    ///
    /// # Errors
    /// What does not fit, in words.
    pub(crate) fn of_stages(stages: Vec<Stage>, output: usize) -> Result<Self, String> {
        let mut width = output;
        // From the last to the first: what each must take in.
        for (index, stage) in stages.iter().enumerate().rev() {
            let name = |part: &str| format!("post.{index}.{part}");
            let finite = stage.offset.iter().chain(&stage.scale).all(|x| x.is_finite())
                && stage.matrix.iter().all(|x| x.is_finite());
            if !finite {
                return Err(format!("{}: expected finite numbers", name("*")));
            }
            if stage.output(width) != width || width == 0 {
                return Err(format!(
                    "{}: expected {width} numbers a vector, got {}",
                    name("*"),
                    stage.output(width)
                ));
            }
            width = match stage.step {
                Step::Pca { .. } | Step::Projection { .. } => {
                    if stage.matrix.is_empty() || !stage.matrix.len().is_multiple_of(width) {
                        let got = stage.matrix.len();
                        return Err(format!("{}: expected {width} rows, got {got} numbers", name("matrix")));
                    }
                    stage.matrix.len() / width
                }
                _ if stage.matrix.is_empty() => width,
                _ => return Err(format!("{}: expected none in such a step", name("matrix"))),
            };
            let (offset, scale) = match stage.step {
                Step::Standardize => (width, width),
                Step::Pca { .. } => (width, 0),
                _ => (0, 0),
            };
            for (part, expected, got) in
                [("offset", offset, stage.offset.len()), ("scale", scale, stage.scale.len())]
            {
                if expected != got {
                    return Err(format!("{}: expected {expected} numbers, got {got}", name(part)));
                }
            }
        }
        Ok(Self { stages, input: width, output })
    }

    pub(crate) fn stages(&self) -> &[Stage] {
        &self.stages
    }

    /// The steps, in order.
    pub fn steps(&self) -> Vec<Step> {
        self.stages.iter().map(|stage| stage.step).collect()
    }

    /// How many numbers a vector has before.
    pub fn input(&self) -> usize {
        self.input
    }

    /// How many numbers a vector has after.
    pub fn output(&self) -> usize {
        self.output
    }

    /// Does the steps to vectors of [`input`](Self::input) numbers, one after the other, on all cores.
    ///
    /// # Errors
    /// [`Error::Shape`] where these are no such vectors, [`Error::NotFinite`] for a NaN or an infinity, in them or after a step, and
    /// [`Error::NoDirection`] for one of zeros that is to have the length 1; each names the row.
    pub fn apply(&self, rows: &[f32]) -> Result<Vec<f32>, Error> {
        if !rows.len().is_multiple_of(self.input) {
            let expected = format!("rows of {} numbers", self.input);
            return Err(Error::Shape { what: "vectors", expected, got: format!("{} numbers", rows.len()) });
        }
        let several = rows.len() > self.input;
        apply(&self.stages, rows, self.input, self.output, several)
    }

    /// Does the steps to one vector, in memory that is used again.
    ///
    /// # Errors
    /// [`Error::Length`] for another length, and those of [`apply`](Self::apply).
    pub(crate) fn pass<'a>(&self, vector: &[f32], through: &'a mut Passage) -> Result<&'a [f32], Error> {
        if vector.len() != self.input {
            let (what, expected, got) = ("descriptor", self.input, vector.len());
            return Err(Error::Length { what, expected, got });
        }
        pass(&self.stages, vector, through, None)
    }
}

/// Does the stages to each row. `named` says whether errors name the row.
fn apply(
    stages: &[Stage],
    rows: &[f32],
    input: usize,
    output: usize,
    named: bool,
) -> Result<Vec<f32>, Error> {
    let done = each(0..rows.len() / input, Passage::default, |through, row| {
        let vector = &rows[row * input..(row + 1) * input];
        pass(stages, vector, through, named.then_some(row)).map(<[f32]>::to_vec)
    });
    let mut all = Vec::with_capacity(rows.len() / input * output);
    for row in done {
        all.extend(row?);
    }
    Ok(all)
}

fn pass<'a>(
    stages: &[Stage],
    vector: &[f32],
    through: &'a mut Passage,
    row: Option<usize>,
) -> Result<&'a [f32], Error> {
    let check = |what, numbers: &[f32]| match crate::distance::first_not_finite(numbers) {
        Some((index, value)) => Err(Error::NotFinite { what, row, index, value }),
        None => Ok(()),
    };
    check("descriptor", vector)?;
    through.now.clear();
    through.now.extend_from_slice(vector);
    for stage in stages {
        let zeros = Error::NoDirection { what: "descriptor, when normalized", row };
        stage.pass(&through.now, &mut through.next).ok_or(zeros)?;
        std::mem::swap(&mut through.now, &mut through.next);
        check(stage.name(), &through.now)?;
    }
    Ok(&through.now)
}

impl Stage {
    /// Without any numbers yet.
    pub(crate) fn new(step: Step) -> Self {
        Self { step, offset: Vec::new(), scale: Vec::new(), matrix: Vec::new() }
    }

    fn fit(step: Step, rows: &[f32], dim: usize) -> Result<Self, Error> {
        let mut stage = Self::new(step);
        match step {
            Step::Standardize => {
                let (mean, deviation) = moments(rows, dim);
                stage.scale = deviation.iter().map(|&s| if s > 0.0 { s.recip() } else { 0.0 }).collect();
                stage.offset = mean;
            }
            Step::Pca { dim: wanted, whiten } => {
                (stage.offset, stage.matrix) = principal(rows, dim, wanted, whiten)?;
            }
            Step::Projection { dim: wanted, seed } => {
                let refused = |expected: String| {
                    let (name, got) = ("projection dim", wanted.to_string());
                    Error::Option { name, expected, got }
                };
                if !(1..=MOST).contains(&wanted) {
                    return Err(refused(format!("from 1 to {MOST}")));
                }
                let signs = projection::signs(wanted, dim, seed);
                stage.matrix = signs.ok_or_else(|| {
                    refused(format!("so few that {dim} signs for each, of 4 bytes, fit into memory"))
                })?;
            }
            Step::Normalize => {}
        }
        Ok(stage)
    }

    /// What a vector is after this, for errors.
    fn name(&self) -> &'static str {
        match self.step {
            Step::Standardize => "descriptor, standardized",
            Step::Pca { .. } => "descriptor, as principal components",
            Step::Projection { .. } => "descriptor, projected",
            Step::Normalize => "descriptor, normalized",
        }
    }

    /// How many numbers a vector has after this, of `input` before.
    pub(crate) fn output(&self, input: usize) -> usize {
        match self.step {
            Step::Pca { dim, .. } | Step::Projection { dim, .. } => dim,
            Step::Standardize | Step::Normalize => input,
        }
    }

    /// Does the step; nothing for zeros that have no direction.
    fn pass(&self, vector: &[f32], out: &mut Vec<f32>) -> Option<()> {
        out.clear();
        let dim = vector.len();
        match self.step {
            Step::Standardize => {
                let parts = vector.iter().zip(self.offset.iter().zip(&self.scale));
                out.extend(parts.map(|(&x, (&offset, &scale))| ((f64::from(x) - offset) * scale) as f32));
            }
            Step::Pca { dim: wanted, .. } => {
                // The centred vector first, and then the products behind it.
                out.extend(vector.iter().zip(&self.offset).map(|(&x, &mean)| (f64::from(x) - mean) as f32));
                out.resize(dim + wanted, 0.0);
                let (centred, coordinates) = out.split_at_mut(dim);
                products(Isa::best(), centred, &self.matrix, coordinates);
                out.drain(..dim);
            }
            Step::Projection { dim: wanted, .. } => {
                out.resize(wanted, 0.0);
                products(Isa::best(), vector, &self.matrix, out);
                let unit = (wanted as f64).sqrt().recip();
                for x in out.iter_mut() {
                    *x = (f64::from(*x) * unit) as f32;
                }
            }
            Step::Normalize => {
                let length = crate::distance::norm(vector.into());
                if length == 0.0 {
                    return None;
                }
                out.extend(vector.iter().map(|&x| (f64::from(x) / length) as f32));
            }
        }
        Some(())
    }
}

/// The mean of each dimension over the rows, and its population standard deviation: exactly 0 where all are the same.
pub(super) fn moments(rows: &[f32], dim: usize) -> (Vec<f64>, Vec<f64>) {
    let count = (rows.len() / dim) as f64;
    let mut mean = vec![0.0; dim];
    for row in rows.chunks_exact(dim) {
        mean.iter_mut().zip(row).for_each(|(mean, &x)| *mean += f64::from(x));
    }
    for mean in &mut mean {
        *mean /= count;
    }
    let mut square = vec![0.0; dim];
    let mut differs = vec![false; dim];
    for row in rows.chunks_exact(dim) {
        for (((square, differs), mean), (&x, &first)) in
            square.iter_mut().zip(&mut differs).zip(&mean).zip(row.iter().zip(rows))
        {
            *square += (f64::from(x) - mean).powi(2);
            *differs |= x != first;
        }
    }
    let deviation = square.iter().zip(&differs);
    let deviation = deviation.map(|(square, &differs)| if differs { (square / count).sqrt() } else { 0.0 });
    (mean, deviation.collect())
}

/// Rows standardised by their own statistics, as [`Step::Standardize`] does: for a whole drive that is there before it is matched.
///
/// ```
/// let rows = [1.0_f32, 5.0, 3.0, 5.0];
/// assert_eq!(surefix::descriptor::standardized(&rows, 2)?, [-1.0, 0.0, 1.0, 0.0]);
/// # Ok::<(), surefix::Error>(())
/// ```
///
/// # Errors
/// As for [`Post::fit`].
pub fn standardized(rows: &[f32], dim: usize) -> Result<Vec<f32>, Error> {
    Post::fit(&[Step::Standardize], rows, dim).map(|(_, rows)| rows)
}
