//! Post-processing of learned descriptors: fitted on the references, and done to each query (method
//! 1.10).

use super::fit::{check_references, fit};
use super::running::Running;
use super::step::{FittedStep, Step};
use crate::error::Error;
use crate::numbers::first_not_finite;
use crate::parallel::each;

/// A chain of steps that has been fitted on the references, so that queries are treated as these
/// were.
///
/// ```
/// use surefix::{Post, Step};
/// let rows = [1.0_f32, 2.0, 3.0, 7.0, 5.0, 9.0];
/// let (post, done) = Post::fit(&[Step::Standardize, Step::Normalize], &rows, 2)?;
/// assert_eq!(done[..2], post.apply(&rows[..2])?);
/// assert!((done[0].hypot(done[1]) - 1.0).abs() < 1e-6);
/// # Ok::<(), surefix::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Post {
    steps: Vec<FittedStep>,
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
        check_references(rows, dim)?;
        let mut post = Self { steps: Vec::new(), input: dim, output: dim };
        let mut rows = rows.to_vec();
        for step in steps {
            let fitted = fit(*step, &rows, post.output)?;
            let output = fitted.output(post.output);
            rows = apply(std::slice::from_ref(&fitted), &rows, post.output, output, true)?;
            post.steps.push(fitted);
            post.output = output;
        }
        Ok((post, rows))
    }

    /// A chain of steps that were fitted before: those of a file.
    ///
    /// # Errors
    /// What does not fit, in words.
    pub(crate) fn from_fitted(steps: Vec<FittedStep>, output: usize) -> Result<Self, String> {
        let mut width = output;
        // From the last to the first: what each must take in.
        for (index, fitted) in steps.iter().enumerate().rev() {
            let name = |part: &str| format!("post.{index}.{part}");
            let finite = fitted.offset.iter().chain(&fitted.scale).all(|x| x.is_finite())
                && fitted.matrix.iter().all(|x| x.is_finite())
                && (fitted.step != Step::StandardizeRunning
                    || fitted.variances().all(f64::is_finite));
            if !finite {
                return Err(format!("{}: expected finite numbers", name("*")));
            }
            if fitted.output(width) != width || width == 0 {
                return Err(format!(
                    "{}: expected {width} numbers a vector, got {}",
                    name("*"),
                    fitted.output(width)
                ));
            }
            width = match fitted.step {
                Step::Pca { .. } | Step::Projection { .. } => {
                    if fitted.matrix.is_empty() || !fitted.matrix.len().is_multiple_of(width) {
                        let got = fitted.matrix.len();
                        return Err(format!(
                            "{}: expected {width} rows, got {got} numbers",
                            name("matrix")
                        ));
                    }
                    fitted.matrix.len() / width
                }
                _ if fitted.matrix.is_empty() => width,
                _ => return Err(format!("{}: expected none in such a step", name("matrix"))),
            };
            let (offset, scale) = match fitted.step {
                Step::Standardize | Step::StandardizeRunning => (width, width),
                Step::Pca { .. } => (width, 0),
                _ => (0, 0),
            };
            for (part, expected, got) in
                [("offset", offset, fitted.offset.len()), ("scale", scale, fitted.scale.len())]
            {
                if expected != got {
                    return Err(format!("{}: expected {expected} numbers, got {got}", name(part)));
                }
            }
        }
        Ok(Self { steps, input: width, output })
    }

    pub(crate) fn fitted_steps(&self) -> &[FittedStep] {
        &self.steps
    }

    /// The steps, in order.
    pub fn steps(&self) -> Vec<Step> {
        self.steps.iter().map(|fitted| fitted.step).collect()
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
    pub(super) fn running(&self) -> impl Iterator<Item = &FittedStep> {
        self.steps.iter().filter(|fitted| fitted.step == Step::StandardizeRunning)
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
        apply(&self.steps, rows, self.input, self.output, several)
    }

    /// Does the steps to one vector, in memory that is used again.
    ///
    /// # Errors
    /// [`Error::Length`] for another length, and those of [`apply`](Self::apply).
    pub(crate) fn pass<'a>(
        &self,
        vector: &[f32],
        state: &'a mut ChainState,
    ) -> Result<&'a [f32], Error> {
        if vector.len() != self.input {
            let (what, expected, got) = ("descriptor", self.input, vector.len());
            return Err(Error::Length { what, expected, got });
        }
        pass(&self.steps, vector, state, None)
    }
}

/// Does the steps to each row. `named` says whether errors name the row.
fn apply(
    steps: &[FittedStep],
    rows: &[f32],
    input: usize,
    output: usize,
    named: bool,
) -> Result<Vec<f32>, Error> {
    let done = each(0..rows.len() / input, ChainState::default, |state, row| {
        let vector = &rows[row * input..(row + 1) * input];
        pass(steps, vector, state, named.then_some(row)).map(<[f32]>::to_vec)
    });
    let mut all = Vec::with_capacity(rows.len() / input * output);
    for row in done {
        all.extend(row?);
    }
    Ok(all)
}

fn pass<'a>(
    steps: &[FittedStep],
    vector: &[f32],
    state: &'a mut ChainState,
    row: Option<usize>,
) -> Result<&'a [f32], Error> {
    let check = |what, numbers: &[f32]| match first_not_finite(numbers) {
        Some((index, value)) => Err(Error::NotFinite { what, row, index, value }),
        None => Ok(()),
    };
    check("descriptor", vector)?;
    state.now.clear();
    state.now.extend_from_slice(vector);
    let mut running = state.running.iter_mut();
    for fitted in steps {
        let own = if fitted.step == Step::StandardizeRunning { running.next() } else { None };
        if let Some(own) = own {
            own.peek(&state.now, &mut state.next);
        } else {
            let zeros = Error::NoDirection { what: "descriptor, when normalized", row };
            fitted.apply(&state.now, &mut state.next).ok_or(zeros)?;
        }
        std::mem::swap(&mut state.now, &mut state.next);
        check(fitted.name(), &state.now)?;
    }
    Ok(&state.now)
}

/// Rows standardised by their own statistics, as [`Step::Standardize`] does: for a whole drive that
/// is there before it is matched.
///
/// ```
/// let rows = [1.0_f32, 5.0, 3.0, 5.0];
/// assert_eq!(surefix::standardized(&rows, 2)?, [-1.0, 0.0, 1.0, 0.0]);
/// # Ok::<(), surefix::Error>(())
/// ```
///
/// # Errors
/// As for [`Post::fit`].
pub fn standardized(rows: &[f32], dim: usize) -> Result<Vec<f32>, Error> {
    Post::fit(&[Step::Standardize], rows, dim).map(|(_, rows)| rows)
}

/// By itself, for vectors that are treated as the references were; [`of_drive`](Self::of_drive) for
/// the queries of a drive.
#[derive(Debug, Default)]
pub(crate) struct ChainState {
    now: Vec<f32>,
    next: Vec<f32>,
    /// One for each step that runs along; or none.
    running: Vec<RunningStep>,
}

/// A drive's statistics at one step.
#[derive(Clone, Debug)]
struct RunningStep {
    so_far: Running,
    /// With the newest query, which may still be refused.
    with_newest: Running,
}

impl Clone for ChainState {
    /// A copy with room for as much, so that it need not grow.
    fn clone(&self) -> Self {
        Self {
            now: Vec::with_capacity(self.now.capacity()),
            next: Vec::with_capacity(self.next.capacity()),
            running: self.running.clone(),
        }
    }
}

impl ChainState {
    /// Through `post`, without a drive.
    pub(crate) fn new(post: &Post) -> Self {
        let (mut width, mut room) = (post.input(), post.input());
        for step in &post.steps {
            let output = step.output(width);
            // Principal components are computed beside the centred vector.
            room = room.max(width + output);
            width = output;
        }
        Self { now: Vec::with_capacity(room), next: Vec::with_capacity(room), running: Vec::new() }
    }

    /// Through `post`, at the beginning of a drive.
    pub(crate) fn of_drive(post: &Post) -> Self {
        let running =
            post.running().map(|step| RunningStep::from(Running::after_step(step))).collect();
        Self { running, ..Self::new(post) }
    }

    /// The newest query counts.
    pub(crate) fn commit(&mut self) {
        for RunningStep { so_far, with_newest } in &mut self.running {
            std::mem::swap(so_far, with_newest);
        }
    }

    /// Begins another drive.
    pub(crate) fn reset(&mut self, post: &Post) {
        for (drive, step) in self.running.iter_mut().zip(post.running()) {
            drive.so_far.become_after(step);
        }
    }

    /// What is known of the drive.
    pub(crate) fn running(&self) -> impl ExactSizeIterator<Item = &Running> {
        self.running.iter().map(|drive| &drive.so_far)
    }

    /// Goes on with what was known of a drive; false where it does not fit.
    pub(crate) fn resume(&mut self, known: Vec<Running>) -> bool {
        let fits = known.len() == self.running.len()
            && known.iter().zip(self.running()).all(|(known, own)| known.dim() == own.dim());
        if fits {
            self.running = known.into_iter().map(RunningStep::from).collect();
        }
        fits
    }
}

impl RunningStep {
    /// Writes a query, standardised, to `out`. It counts once it is [kept](ChainState::commit).
    fn peek(&mut self, vector: &[f32], out: &mut Vec<f32>) {
        out.clear();
        out.resize(vector.len(), 0.0);
        self.so_far.peek(vector, &mut self.with_newest, out);
    }
}

impl From<Running> for RunningStep {
    fn from(so_far: Running) -> Self {
        Self { with_newest: so_far.clone(), so_far }
    }
}
