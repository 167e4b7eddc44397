//! `surefix._core.Shard` and `ShardDriver`: messages are bytes here.

use std::fmt;
use std::io::Cursor;
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use serde::de::{DeserializeOwned, IgnoredAny, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use surefix::shard::{Answer, Header, Next, Question, Stage};
use surefix::{Error, Floor};

use crate::error::{OrRaise as _, busy, value};
use crate::fix::Fix;
use crate::inputs::{Input, descriptors, maps};
use crate::options::{config, given, settings, whole};
use crate::signals::detached;

/// The only map.
fn one_map(given: &Bound<'_, PyAny>) -> PyResult<Arc<surefix::Map>> {
    let mut maps = maps(given)?;
    match (maps.pop(), maps.len()) {
        (Some(map), 0) => Ok(map),
        (_, rest) => {
            let got = if rest == 0 { "none".to_owned() } else { (rest + 1).to_string() };
            let message =
                format!("map: expected one map, as shards do not fuse several, got {got}");
            Err(value(given.py(), message))
        }
    }
}

/// The bytes of a message.
fn packed(message: &impl Serialize) -> Result<Vec<u8>, Error> {
    rmp_serde::to_vec(message).map_err(|e| Error::Shard { reason: e.to_string() })
}

/// A message of its bytes. Its head is compared first: the rest of one of another version can be
/// unreadable.
fn unpacked<T: DeserializeOwned>(
    bytes: &[u8],
    check: impl FnOnce(&Header) -> Result<(), Error>,
) -> Result<T, Error> {
    let Head(header) = whole_of(bytes)?;
    check(&header)?;
    whole_of(bytes)
}

/// What all of the bytes say.
fn whole_of<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, Error> {
    let damaged = |why: &dyn fmt::Display| Error::Shard {
        reason: format!("damaged, or not a message of surefix ({why})"),
    };
    let mut from = rmp_serde::Deserializer::new(Cursor::new(bytes));
    let message = T::deserialize(&mut from).map_err(|e| damaged(&e))?;
    let read = from.get_ref().position();
    if read != bytes.len() as u64 {
        return Err(damaged(&format!("expected {read} bytes, got {}", bytes.len())));
    }
    Ok(message)
}

/// The first part of a message.
struct Head(Header);

impl<'de> Deserialize<'de> for Head {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct First;
        impl<'de> Visitor<'de> for First {
            type Value = Head;

            fn expecting(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
                to.write_str("a list that begins with a header")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut parts: A) -> Result<Head, A::Error> {
                let Some(header) = parts.next_element()? else {
                    return Err(serde::de::Error::invalid_length(0, &self));
                };
                while parts.next_element::<IgnoredAny>()?.is_some() {}
                Ok(Head(header))
            }
        }
        from.deserialize_seq(First)
    }
}

/// A range of a map's places: it scans their rows and keeps what is known of them.
///
/// Parameters
/// ----------
/// map : Map
///     The whole map, best opened with ``mmap=True``: only the rows of the shard are read.
/// index : int
///     Which shard, from 0.
/// shards : int
///     How many there are: at most one for every 4,096 places.
/// **options
///     As for ``Localizer``, the same as the driver's.
///
/// Raises
/// ------
/// SurefixValueError
///     For an option outside its range, or one that shards do not have.
#[pyclass(module = "surefix._core")]
pub(crate) struct Shard(surefix::shard::Shard);

#[pymethods]
impl Shard {
    #[new]
    #[pyo3(signature = (map, index, shards, **options))]
    fn new(
        py: Python<'_>,
        map: &Bound<'_, PyAny>,
        index: &Bound<'_, PyAny>,
        shards: &Bound<'_, PyAny>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let config = config(py, options, Floor::Running)?;
        let map = one_map(map)?;
        let (index, shards) = (whole("index", index)?, whole("shards", shards)?);
        detached(py, || surefix::shard::Shard::new(map, &config, index, shards)).map(Self)
    }

    /// Answers a question of the stage ``census``: the means over its places.
    fn census<'py>(slf: &Bound<'py, Self>, question: &[u8]) -> PyResult<Bound<'py, PyBytes>> {
        answered(slf, question, Stage::Census)
    }

    /// Answers a question of the stage ``first``: what the query's column says in its places. It
    /// may be asked again.
    fn first<'py>(slf: &Bound<'py, Self>, question: &[u8]) -> PyResult<Bound<'py, PyBytes>> {
        answered(slf, question, Stage::First)
    }

    /// Answers a question of the stage ``second``: it keeps the query.
    fn second<'py>(slf: &Bound<'py, Self>, question: &[u8]) -> PyResult<Bound<'py, PyBytes>> {
        answered(slf, question, Stage::Second)
    }

    /// The state as bytes, after the queries that it has kept.
    fn snapshot<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyBytes>> {
        let py = slf.py();
        let this = slf.try_borrow().map_err(|_| busy(py, "Shard"))?;
        let shard = &this.0;
        let bytes = detached(py, || shard.snapshot())?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Goes on where a snapshot of the same shard was taken.
    fn restore(slf: &Bound<'_, Self>, snapshot: &[u8]) -> PyResult<()> {
        let py = slf.py();
        let mut this = slf.try_borrow_mut().map_err(|_| busy(py, "Shard"))?;
        let shard = &mut this.0;
        detached(py, || shard.restore(snapshot))
    }

    /// Its own places: the first, and the one after the last.
    #[getter]
    fn places(slf: &Bound<'_, Self>) -> PyResult<(usize, usize)> {
        let this = slf.try_borrow().map_err(|_| busy(slf.py(), "Shard"))?;
        let places = this.0.places();
        Ok((places.start, places.end))
    }

    /// The places whose rows it reads, as ranges: the first of each, and the one after its last.
    fn rows(slf: &Bound<'_, Self>) -> PyResult<Vec<(usize, usize)>> {
        let this = slf.try_borrow().map_err(|_| busy(slf.py(), "Shard"))?;
        Ok(this.0.rows().map(|places| (places.start, places.end)).collect())
    }

    /// How many queries it has kept since the start of the drive.
    #[getter]
    fn frames(slf: &Bound<'_, Self>) -> PyResult<u64> {
        Ok(slf.try_borrow().map_err(|_| busy(slf.py(), "Shard"))?.0.frames())
    }
}

fn answered<'py>(
    shard: &Bound<'py, Shard>,
    question: &[u8],
    stage: Stage,
) -> PyResult<Bound<'py, PyBytes>> {
    let py = shard.py();
    let mut this = shard.try_borrow_mut().map_err(|_| busy(py, "Shard"))?;
    let shard = &mut this.0;
    let answer = detached(py, || {
        let question: Question = unpacked(question, |header| shard.check_header(header))?;
        let got = question.stage();
        if got != stage {
            let reason = format!("expected a question of the stage {stage}, got {got}");
            return Err(Error::Shard { reason });
        }
        packed(&shard.answer(&question)?)
    })?;
    Ok(PyBytes::new(py, &answer))
}

/// Takes frames, asks the shards of a map, and makes fixes of their answers: those of a
/// ``Localizer``, to the last bit.
///
/// Parameters
/// ----------
/// map : Map
///     The whole map.
/// shards : int
///     How many shards there are.
/// descriptor : surefix.descriptors.Descriptor, optional
///     As for ``Localizer``.
/// **options
///     As for ``Localizer``.
#[pyclass(module = "surefix._core")]
pub(crate) struct ShardDriver(surefix::shard::Driver, Option<Py<PyAny>>);

#[pymethods]
impl ShardDriver {
    #[new]
    #[pyo3(signature = (map, shards, *, descriptor=None, **options))]
    fn new(
        py: Python<'_>,
        map: &Bound<'_, PyAny>,
        shards: &Bound<'_, PyAny>,
        descriptor: Option<&Bound<'_, PyAny>>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let settings = settings(py, options, Floor::Running, false)?;
        let (map, shards) = (one_map(map)?, whole("shards", shards)?);
        let descriptor = descriptors(descriptor, std::slice::from_ref(&map))?.pop().flatten();
        let driver = detached(py, || {
            settings.check_maps([&*map])?;
            let driver = surefix::shard::Driver::new(map, &settings.config, shards)?;
            match settings.threshold {
                Some(threshold) => driver.with_threshold(threshold),
                None => Ok(driver),
            }
        })?;
        Ok(Self(driver, descriptor))
    }

    /// Begins a query, given as to ``Localizer.push``: a stage, and a question for each shard.
    #[pyo3(signature = (frame, advance=None, trusted=None))]
    fn push<'py>(
        slf: &Bound<'py, Self>,
        frame: &Bound<'py, PyAny>,
        advance: Option<f64>,
        trusted: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = slf.py();
        let given = given(trusted, advance);
        let input = {
            let this = slf.try_borrow().map_err(|_| busy(py, "ShardDriver"))?;
            Input::new(frame, this.0.map(), this.1.as_ref().map(|given| given.bind(py)))?
        };
        let view = input.view(py)?;
        step(slf, |driver| driver.push(view, given))
    }

    /// Takes the shards' answers, in their order: the next stage and its questions, or the fix.
    fn answer<'py>(
        slf: &Bound<'py, Self>,
        answers: Vec<Bound<'py, PyBytes>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let answers: Vec<&[u8]> = answers.iter().map(PyBytesMethods::as_bytes).collect();
        step(slf, |driver| {
            let each = answers.iter();
            let each = each.map(|bytes| unpacked(bytes, |header| driver.check_header(header)));
            let answers: Vec<Answer> = each.collect::<Result<_, _>>()?;
            driver.answer(&answers)
        })
    }

    /// Gives up the query in hand. Once ``second`` has been asked, it cannot be given up.
    fn abandon(slf: &Bound<'_, Self>) -> PyResult<()> {
        changed(slf, surefix::shard::Driver::abandon)
    }

    /// As ``Localizer.gap``.
    #[pyo3(signature = (advance=None))]
    fn gap(slf: &Bound<'_, Self>, advance: Option<f64>) -> PyResult<()> {
        changed(slf, |driver| match advance {
            Some(advance) => driver.gap_with_advance(advance),
            None => driver.gap(),
        })
    }

    /// As ``Localizer.reset``. The shards forget their queries when the next one comes.
    fn reset(slf: &Bound<'_, Self>) -> PyResult<()> {
        changed(slf, surefix::shard::Driver::reset)
    }

    /// The state as bytes, between two queries.
    fn snapshot<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyBytes>> {
        let py = slf.py();
        let this = slf.try_borrow().map_err(|_| busy(py, "ShardDriver"))?;
        Ok(PyBytes::new(py, &this.0.snapshot().or_raise(py)?))
    }

    /// Goes on where a snapshot of a driver of the same map and options was taken.
    fn restore(slf: &Bound<'_, Self>, snapshot: &[u8]) -> PyResult<()> {
        changed(slf, |driver| driver.restore(snapshot))
    }

    /// The places of each shard: the first, and the one after the last.
    #[getter]
    fn places(slf: &Bound<'_, Self>) -> PyResult<Vec<(usize, usize)>> {
        let this = slf.try_borrow().map_err(|_| busy(slf.py(), "ShardDriver"))?;
        Ok(this.0.shards().iter().map(|places| (places.start, places.end)).collect())
    }

    /// How many frames it has taken since the start or the last reset.
    #[getter]
    fn frames(slf: &Bound<'_, Self>) -> PyResult<u64> {
        Ok(slf.try_borrow().map_err(|_| busy(slf.py(), "ShardDriver"))?.0.frames())
    }

    /// As ``Localizer.alarm``.
    #[getter]
    fn alarm(slf: &Bound<'_, Self>) -> PyResult<bool> {
        let this = slf.try_borrow().map_err(|_| busy(slf.py(), "ShardDriver"))?;
        Ok(this.0.alarm().is_some_and(surefix::calibration::Alarm::raised))
    }
}

/// Changes a driver.
fn changed(
    driver: &Bound<'_, ShardDriver>,
    change: impl FnOnce(&mut surefix::shard::Driver) -> Result<(), Error>,
) -> PyResult<()> {
    let py = driver.py();
    let mut this = driver.try_borrow_mut().map_err(|_| busy(py, "ShardDriver"))?;
    change(&mut this.0).or_raise(py)
}

/// A step of a query, without the GIL.
fn step<'py>(
    driver: &Bound<'py, ShardDriver>,
    step: impl FnOnce(&mut surefix::shard::Driver) -> Result<Next, Error> + Send,
) -> PyResult<Bound<'py, PyAny>> {
    let py = driver.py();
    let mut this = driver.try_borrow_mut().map_err(|_| busy(py, "ShardDriver"))?;
    let driver = &mut this.0;
    let next = detached(py, || match step(driver)? {
        Next::Fix(fix) => Ok((Some(fix), None)),
        Next::Ask(questions) => {
            let stage = questions.first().map(|question| question.stage().to_string());
            let bytes = questions.iter().map(packed).collect::<Result<Vec<_>, _>>()?;
            Ok((None, Some((stage, bytes))))
        }
    })?;
    match next {
        (Some(fix), _) => Ok(Bound::new(py, Fix(fix, driver.position(&fix)))?.into_any()),
        (None, asked) => {
            let (stage, bytes) = asked.unwrap_or_default();
            let bytes: Vec<_> = bytes.iter().map(|bytes| PyBytes::new(py, bytes)).collect();
            Ok((stage, bytes).into_pyobject(py)?.into_any())
        }
    }
}
