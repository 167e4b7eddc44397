//! Post-processing of learned descriptors: fitted on the references, and done to each query (method
//! 1.10).

use super::fit::{check_references, fit};
use super::running::Running;
use super::step::{FittedStep, Step};
use crate::error::Error;
use crate::numbers::first_not_finite;
use crate::parallel::each;
use serde::{Deserialize, Serialize};

/// The most steps of a chain: each has tensors in a map's file.
pub(crate) const MAX_STEPS: usize = 64;

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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
    /// [`Error::Shape`] if `dim` does not divide the numbers; [`Error::NotFinite`] for a NaN or
    /// an infinity, in the references or after a step; [`Error::Option`] for a `dim` of 0, or of
    /// more than the references span or memory holds, and for more than 64 steps;
    /// [`Error::TooFewPlaces`] below two rows.
    pub fn fit(steps: &[Step], rows: &[f32], dim: usize) -> Result<(Self, Vec<f32>), Error> {
        if steps.len() > MAX_STEPS {
            let (expected, got) = (format!("at most {MAX_STEPS}"), steps.len().to_string());
            return Err(Error::Option { name: "steps", expected, got });
        }
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

    /// A chain of steps that were fitted before, such as those of a file.
    ///
    /// # Errors
    /// The part that does not fit, in words.
    pub(crate) fn from_fitted(steps: Vec<FittedStep>, output: usize) -> Result<Self, String> {
        let mut width = output;
        // From the last to the first: each must give `width` numbers.
        for (index, fitted) in steps.iter().enumerate().rev() {
            let FittedStep { step, offset, scale, matrix } = fitted;
            let refused = |part, expected: &str, got: usize| {
                Err(format!("post.{index}.{part}: expected {expected}, got {got} numbers"))
            };
            // Means and deviations of float32 numbers are of their size.
            let sized = |x: f64| (x as f32).is_finite();
            let finite = offset.iter().all(|&x| sized(x))
                && scale.iter().all(|x| x.is_finite())
                && matrix.iter().all(|x| x.is_finite())
                && (*step != Step::StandardizeRunning
                    || fitted.variances().all(|variance| sized(variance.sqrt())));
            if !finite {
                return Err(format!("post.{index}.*: expected finite numbers"));
            }
            if fitted.output(width) != width || width == 0 {
                return refused("*", &format!("{width} numbers a vector"), fitted.output(width));
            }
            if matches!(step, Step::Pca { .. } | Step::Projection { .. }) {
                if matrix.is_empty() || !matrix.len().is_multiple_of(width) {
                    return refused("matrix", &format!("{width} rows"), matrix.len());
                }
                width = matrix.len() / width;
            } else if !matrix.is_empty() {
                return refused("matrix", "none in such a step", matrix.len());
            }
            let (offsets, scales) = match step {
                Step::Standardize | Step::StandardizeRunning => (width, width),
                Step::Pca { .. } => (width, 0),
                _ => (0, 0),
            };
            for (part, expected, got) in
                [("offset", offsets, offset.len()), ("scale", scales, scale.len())]
            {
                if expected != got {
                    return refused(part, &format!("{expected} numbers"), got);
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

    /// The numbers of a vector before the chain.
    pub fn input(&self) -> usize {
        self.input
    }

    /// The numbers of a vector after the chain.
    pub fn output(&self) -> usize {
        self.output
    }

    /// The steps that keep statistics of the queries.
    pub(super) fn running(&self) -> impl Iterator<Item = &FittedStep> {
        self.steps.iter().filter(|fitted| fitted.step == Step::StandardizeRunning)
    }

    /// Whether a query's result depends on the queries before it.
    pub(crate) fn runs(&self) -> bool {
        self.running().next().is_some()
    }

    /// Applies the chain to each row of [`input`](Self::input) numbers, on all cores, with the
    /// references' statistics. Running ones live in a [`Localizer`](crate::Localizer).
    ///
    /// # Errors
    /// [`Error::Shape`] if these are no such vectors, [`Error::NotFinite`] for a NaN or an
    /// infinity, in them or after a step; it names the row.
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

    /// Applies the chain to one vector, in memory that is used again.
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

/// Applies the steps to each row. `named` says whether errors name the row.
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
    })?;
    let mut all = Vec::with_capacity(rows.len() / input * output);
    for row in done {
        all.extend(row);
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
            fitted.apply(&state.now, &mut state.next);
        }
        std::mem::swap(&mut state.now, &mut state.next);
        check(fitted.name(), &state.now)?;
    }
    Ok(&state.now)
}

/// Rows standardised by their own statistics, as [`Step::Standardize`] does: for queries that are
/// all recorded before they are matched.
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

/// The memory of one vector on its way along a chain and, if it is [`of_drive`](Self::of_drive),
/// the statistics of the queries.
#[derive(Debug, Default)]
pub(crate) struct ChainState {
    now: Vec<f32>,
    next: Vec<f32>,
    /// One for each running step, or none.
    running: Vec<RunningStep>,
}

/// The queries' statistics at one step.
#[derive(Clone, Debug)]
struct RunningStep {
    so_far: Running,
    /// With the newest query, which may still be refused.
    with_newest: Running,
}

impl Clone for ChainState {
    /// A copy with the same capacity, so that it need not grow.
    fn clone(&self) -> Self {
        Self {
            now: Vec::with_capacity(self.now.capacity()),
            next: Vec::with_capacity(self.next.capacity()),
            running: self.running.clone(),
        }
    }
}

impl ChainState {
    /// For vectors that are treated as the references were.
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

    /// For the queries of a drive that begins.
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

    /// The statistics so far.
    pub(crate) fn running(&self) -> impl ExactSizeIterator<Item = &Running> {
        self.running.iter().map(|drive| &drive.so_far)
    }

    /// Goes on with known statistics; false if they do not fit.
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
    /// Writes a query, standardised, to `out`. It counts after [`commit`](ChainState::commit).
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
