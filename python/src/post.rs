//! `surefix.post`: the post-processing of descriptors.

use numpy::PyUntypedArrayMethods as _;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use surefix::Running as Statistics;
use surefix::{Step, View};

use crate::arrays::{as_array, check_axes, float32s, rows_to_py};
use crate::error::{OrRaise as _, busy, value};
use crate::options::whole;
use crate::pickle::pickled;
use crate::signals::detached;

/// A chain of steps of post-processing that has been fitted on references.
///
/// ``surefix.post.fit`` makes one; ``Map.from_descriptors(..., post=[...])`` fits one on the map's
/// own rows, and ``Map.post`` is it.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from surefix.post import Normalize, Pca, Standardize, fit
/// >>> rows = np.random.default_rng(0).standard_normal((50, 8), np.float32)
/// >>> chain = fit(rows, [Standardize(), Pca(3), Normalize()])
/// >>> chain
/// Post(Standardize(), Pca(dim=3, whiten=True), Normalize(), from 8 to 3 numbers)
/// >>> chain.apply(rows[:2]).shape
/// (2, 3)
#[pyclass(frozen, eq, module = "surefix.post")]
#[derive(PartialEq)]
pub(crate) struct Post(pub(crate) surefix::Post);

pickled!(Post);

#[pymethods]
impl Post {
    /// Does the steps to one vector, (input_dim,), or to many, (n, input_dim), as they were done to
    /// the references. (Statistics of a drive, ``Standardize("running")``, are kept by a
    /// ``Localizer``, and by ``match``.)
    ///
    /// Returns
    /// -------
    /// array of float32, shape (output_dim,) or (n, output_dim)
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     For another shape or type than float32, a NaN or an infinity; it names the row.
    fn apply<'py>(
        &self,
        py: Python<'py>,
        vectors: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let array = as_array(vectors, "vectors")?;
        if array.ndim() != 1 {
            check_axes(&array, "vectors", 2)?;
        }
        let width = array.shape()[array.ndim() - 1];
        if width != self.0.input() {
            let (what, expected) = ("vectors: each", self.0.input());
            return Err(surefix::Error::Length { what, expected, got: width }).or_raise(py);
        }
        let numbers = float32s(&array, "vectors")?;
        let rows = numbers.as_slice()?;
        let done = detached(py, || self.0.apply(rows))?;
        let many = [done.len() / self.0.output(), self.0.output()];
        rows_to_py(py, View::F32(&done), if array.ndim() == 1 { &many[1..] } else { &many })
    }

    /// How many numbers a vector has before.
    #[getter]
    fn input_dim(&self) -> usize {
        self.0.input()
    }

    /// How many numbers a vector has after.
    #[getter]
    fn output_dim(&self) -> usize {
        self.0.output()
    }

    /// The steps, each as it would be asked for: ``{"step": "pca", "dim": 3, "whiten": True}``.
    #[getter]
    fn steps<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = serde_json::to_string(&self.0.steps()).map_err(|e| value(py, e.to_string()))?;
        py.import("json")?.call_method1("loads", (text,))
    }

    fn __repr__(&self) -> String {
        let flag = |flag| if flag { "True" } else { "False" };
        let say = |step: &Step| match *step {
            Step::Standardize => "Standardize()".to_owned(),
            Step::StandardizeRunning => "Standardize(statistics='running')".to_owned(),
            Step::Pca { dim, whiten } => format!("Pca(dim={dim}, whiten={})", flag(whiten)),
            Step::Normalize => "Normalize()".to_owned(),
            Step::Projection { dim, seed } => format!("RandomProjection(dim={dim}, seed={seed})"),
            _ => "...".to_owned(),
        };
        let mut parts: Vec<String> = self.0.steps().iter().map(say).collect();
        parts.push(format!("from {} to {} numbers", self.0.input(), self.0.output()));
        format!("Post({})", parts.join(", "))
    }
}

/// Fits steps, given as JSON, on references (n, dim) of float32. Gives the chain, and the
/// references as it makes them.
#[pyfunction]
pub(crate) fn fit_post<'py>(
    py: Python<'py>,
    references: &Bound<'py, PyAny>,
    steps: &str,
) -> PyResult<(Post, Bound<'py, PyAny>)> {
    let steps: Vec<Step> =
        serde_json::from_str(steps).map_err(|e| value(py, format!("post: {e}")))?;
    let array = as_array(references, "references")?;
    check_axes(&array, "references", 2)?;
    let numbers = float32s(&array, "references")?;
    let (rows, dim) = (numbers.as_slice()?, array.shape()[1]);
    let (post, rows) = detached(py, || surefix::Post::fit(&steps, rows, dim))?;
    let shape = [rows.len() / post.output().max(1), post.output()];
    let rows = rows_to_py(py, View::F32(&rows), &shape)?;
    Ok((Post(post), rows))
}

/// The most numbers of a vector whose statistics are kept: memory that is asked for is there.
const LONGEST: usize = 1 << 24;

/// Standardises vector after vector by the mean and standard deviation of those that came, the
/// newest among them: the statistics that a stream can have of itself (Welford, 1962).
///
/// Parameters
/// ----------
/// dim : int, optional
///     How many numbers a vector has.
/// references : array of float32, shape (n, dim), optional
///     Instead of ``dim``: begins with their statistics, as if these were one vector. So the first
///     vectors of a drive are standardised by the references, and what follows more and more by the
///     drive. Without, the first vector becomes zeros.
///
/// Examples
/// --------
/// >>> import numpy as np
/// >>> from surefix.post import Running
/// >>> running = Running(2)
/// >>> [running.push(np.float32(v)).tolist() for v in ([1, 5], [3, 5], [5, 6])]
/// [[0.0, 0.0], [1.0, 0.0], [1.2247449159622192, 1.4142135381698608]]
#[pyclass(module = "surefix.post")]
pub(crate) struct Running(Statistics);

pickled!(Running);

#[pymethods]
impl Running {
    #[new]
    #[pyo3(signature = (dim=None, *, references=None))]
    fn new(
        py: Python<'_>,
        dim: Option<&Bound<'_, PyAny>>,
        references: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        match (dim.map(|dim| whole("dim", dim)).transpose()?, references) {
            (Some(dim), None) if (1..=LONGEST).contains(&dim) => Ok(Self(Statistics::new(dim))),
            (None, Some(references)) => {
                let array = as_array(references, "references")?;
                check_axes(&array, "references", 2)?;
                let numbers = float32s(&array, "references")?;
                let (rows, dim) = (numbers.as_slice()?, array.shape()[1]);
                Ok(Self(detached(py, || Statistics::after(rows, dim))?))
            }
            _ => {
                Err(value(py, format!("Running: expected dim, from 1 to {LONGEST}, or references")))
            }
        }
    }

    /// Takes a vector in, float32 (dim,), and gives it standardised.
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     For another length or type, a NaN or an infinity; nothing has changed then.
    fn push<'py>(
        slf: &Bound<'py, Self>,
        vector: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = slf.py();
        let array = as_array(vector, "vector")?;
        check_axes(&array, "vector", 1)?;
        let numbers = float32s(&array, "vector")?;
        let vector = numbers.as_slice()?;
        let mut this = slf.try_borrow_mut().map_err(|_| busy(py, "Running"))?;
        let mut out = vec![0.0; this.0.dim()];
        this.0.push(vector, &mut out).or_raise(py)?;
        rows_to_py(py, View::F32(&out), &[out.len()])
    }

    /// How many vectors have come, the references as one.
    #[getter]
    fn count(&self) -> u64 {
        self.0.count()
    }

    /// The state as bytes; ``Running.restore`` goes on from it bit-identically. Keep it beside the
    /// localizer's own snapshot, which does not hold it.
    fn snapshot<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyBytes>> {
        let py = slf.py();
        let this = slf.try_borrow().map_err(|_| busy(py, "Running"))?;
        Ok(PyBytes::new(py, &this.0.snapshot().or_raise(py)?))
    }

    /// Statistics that go on where the snapshot was taken.
    ///
    /// Raises
    /// ------
    /// SurefixValueError
    ///     If the bytes are damaged, no such snapshot, or of a newer version.
    ///
    /// Examples
    /// --------
    /// >>> import numpy as np
    /// >>> from surefix.post import Running
    /// >>> running = Running(2)
    /// >>> _ = running.push(np.float32([1, 5]))
    /// >>> Running.restore(running.snapshot()).count
    /// 1
    #[staticmethod]
    fn restore(py: Python<'_>, blob: &[u8]) -> PyResult<Self> {
        Ok(Self(Statistics::restore(blob).or_raise(py)?))
    }

    /// Forgets all vectors, and the references.
    fn reset(slf: &Bound<'_, Self>) -> PyResult<()> {
        slf.try_borrow_mut().map_err(|_| busy(slf.py(), "Running"))?.0.reset();
        Ok(())
    }

    fn __repr__(&self) -> String {
        format!("Running(dim={}, count={})", self.0.dim(), self.0.count())
    }
}

fn float32<'a>(py: Python<'_>, numbers: View<'a>, what: &str) -> PyResult<&'a [f32]> {
    match numbers {
        View::F32(numbers) => Ok(numbers),
        other => Err(value(py, format!("{what}: expected float32, got {}", other.dtype()))),
    }
}

/// A chain for rows of `dim` numbers, and the rows as it makes them: `given` is fitted already, or
/// steps that are fitted now.
pub(crate) fn fitted(
    given: &Bound<'_, PyAny>,
    rows: View<'_>,
    dim: usize,
) -> PyResult<(surefix::Post, Vec<f32>)> {
    let py = given.py();
    let rows = float32(py, rows, "descriptors: with post")?;
    if let Ok(post) = given.cast::<Post>() {
        let post = &post.get().0;
        if post.input() != dim {
            let (what, expected) = ("descriptors: each", post.input());
            return Err(surefix::Error::Length { what, expected, got: dim }).or_raise(py);
        }
        let done = detached(py, || post.apply(rows))?;
        return Ok((post.clone(), done));
    }
    let steps: String = py.import("surefix.post")?.call_method1("as_json", (given,))?.extract()?;
    let steps: Vec<Step> =
        serde_json::from_str(&steps).map_err(|e| value(py, format!("post: {e}")))?;
    detached(py, || surefix::Post::fit(&steps, rows, dim))
}
