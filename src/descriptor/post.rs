//! Post-processing of learned descriptors: fitted on the references, and done to each query (method
//! 1.10).

use serde::{Deserialize, Serialize};

use super::passage::Passage;
use super::stage::Stage;
use crate::error::Error;
use crate::parallel::each;

/// One step of post-processing, as it is asked for. In a chain, each works on what the one before
/// gives.
///
/// As JSON: `{"step": "standardize"}`, `{"step": "standardize_running"}`, `{"step": "pca", "dim":
/// 512, "whiten": true}`, `{"step": "normalize"}`, `{"step": "projection", "dim": 512, "seed": 0}`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "step", rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum Step {
    /// Each dimension less its mean over the references, in units of its population standard
    /// deviation; 0 where all references have the same number.
    Standardize,
    /// The references as by [`Standardize`](Self::Standardize); each query of a drive by the mean
    /// and the deviation of the drive's queries so far, which begin with the references' own as if
    /// those were one query ([`Running::after`](super::Running::after)). A
    /// [`Localizer`](crate::Localizer) keeps these, in its snapshots too.
    StandardizeRunning,
    /// The coordinates along the `dim` directions in which the references differ most (principal
    /// component analysis).
    Pca {
        /// How many, up to what the references span.
        dim: usize,
        /// Whether each is divided by its standard deviation over the references (with `n - 1`).
        whiten: bool,
    },
    /// To the length 1.
    Normalize,
    /// The products with `dim` vectors of random signs, divided by `sqrt(dim)`: distances stay
    /// about what they are (Achlioptas, 2003).
    Projection {
        /// How many.
        dim: usize,
        /// Which signs.
        seed: u64,
    },
}

/// A chain of steps that has been fitted on the references, so that queries are treated as these
/// were.
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

impl Post {
    /// Fits the steps on references, rows of `dim` numbers, one after the other: each on what those
    /// before it make of them. Gives the chain, and the references as the chain makes them.
    ///
    /// # Errors
    /// [`Error::Shape`] where `dim` does not divide the numbers; [`Error::NotFinite`] for a NaN or
    /// an infinity, in the references or after a step; [`Error::Option`] for a `dim` of 0, or of
    /// more than the references span or memory holds; [`Error::NoDirection`] for a row of zeros
    /// that is to have the length 1; [`Error::TooFewPlaces`] below two rows.
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
                && stage.matrix.iter().all(|x| x.is_finite())
                && (stage.step != Step::StandardizeRunning
                    || stage.variances().all(f64::is_finite));
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
                        return Err(format!(
                            "{}: expected {width} rows, got {got} numbers",
                            name("matrix")
                        ));
                    }
                    stage.matrix.len() / width
                }
                _ if stage.matrix.is_empty() => width,
                _ => return Err(format!("{}: expected none in such a step", name("matrix"))),
            };
            let (offset, scale) = match stage.step {
                Step::Standardize | Step::StandardizeRunning => (width, width),
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

    /// The steps whose statistics run along with a drive.
    pub(super) fn running(&self) -> impl Iterator<Item = &Stage> {
        self.stages.iter().filter(|stage| stage.step == Step::StandardizeRunning)
    }

    /// Whether what a query becomes depends on those before it.
    pub(crate) fn runs(&self) -> bool {
        self.running().next().is_some()
    }

    /// Does the steps to vectors of [`input`](Self::input) numbers, one after the other, on all
    /// cores. Each is treated as the references were: statistics of a drive are a localizer's.
    ///
    /// # Errors
    /// [`Error::Shape`] where these are no such vectors, [`Error::NotFinite`] for a NaN or an
    /// infinity, in them or after a step, and [`Error::NoDirection`] for one of zeros that is to
    /// have the length 1; each names the row.
    pub fn apply(&self, rows: &[f32]) -> Result<Vec<f32>, Error> {
        if !rows.len().is_multiple_of(self.input) {
            let expected = format!("rows of {} numbers", self.input);
            return Err(Error::Shape {
                what: "vectors",
                expected,
                got: format!("{} numbers", rows.len()),
            });
        }
        let several = rows.len() > self.input;
        apply(&self.stages, rows, self.input, self.output, several)
    }

    /// Does the steps to one vector, in memory that is used again.
    ///
    /// # Errors
    /// [`Error::Length`] for another length, and those of [`apply`](Self::apply).
    pub(crate) fn pass<'a>(
        &self,
        vector: &[f32],
        through: &'a mut Passage,
    ) -> Result<&'a [f32], Error> {
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
    let mut drives = through.drives.iter_mut();
    for stage in stages {
        let drive = if stage.step == Step::StandardizeRunning { drives.next() } else { None };
        if let Some(drive) = drive {
            drive.look(&through.now, &mut through.next);
        } else {
            let zeros = Error::NoDirection { what: "descriptor, when normalized", row };
            stage.pass(&through.now, &mut through.next).ok_or(zeros)?;
        }
        std::mem::swap(&mut through.now, &mut through.next);
        check(stage.name(), &through.now)?;
    }
    Ok(&through.now)
}

/// Rows standardised by their own statistics, as [`Step::Standardize`] does: for a whole drive that
/// is there before it is matched.
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
