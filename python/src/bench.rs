//! What `surefix bench` measures in Rust, where no call from Python is in the way.

use std::hint::black_box;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::thread;
use std::time::Instant;

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;
use surefix::{Channels, Config, Error, Image, Isa, Localizer, Map, Matcher, Sad};

use crate::allocator::counted;
use crate::error::OrRaise as _;

/// How many different frames are pushed, over and over.
const FRAMES: usize = 64;
/// Microseconds, more or less, between two looks at whether the user has pressed Ctrl-C.
const PATIENCE: u128 = 100_000;

/// Nanoseconds of each of many pushes, and how often they called the allocator.
type Latency<'py> = (Bound<'py, PyArray1<u64>>, u64);

/// The instruction set that the kernels run on here: "scalar", "avx2", "avx512" or "neon".
#[pyfunction]
pub(crate) fn instruction_set() -> String {
    Isa::best().to_string()
}

/// Times pushes of distances one by one, once the sequence's window is full.
///
/// Parameters
/// ----------
/// places, sequence_length : int
///     As for ``Matcher``.
/// pushes : int
///     How many.
///
/// Returns ------- (array of uint64, shape (pushes,), int) Nanoseconds of each, the clock's own few
/// tens among them, and how often all of them together called the allocator.
#[pyfunction]
pub(crate) fn bench_latency(
    py: Python<'_>,
    places: usize,
    sequence_length: usize,
    pushes: usize,
) -> PyResult<Latency<'_>> {
    let config = Config { sequence_length, ..Config::default() };
    let mut matcher = Matcher::new(places, config).or_raise(py)?;
    let mut dice = Dice(1);
    let columns: Vec<Vec<f32>> = (0..FRAMES)
        .map(|frame| {
            let mut column: Vec<f32> = (0..places).map(|_| 0.5 + dice.unit()).collect();
            // A drive: the true place is one further with each frame.
            column[frame % places] *= 0.1;
            column
        })
        .collect();
    timed(py, pushes, sequence_length, |frame| matcher.push(&columns[frame % FRAMES]).map(|_| ()))
}

/// Times pushes of 640 x 480 RGB images on a SAD map one by one, once the sequence's window is
/// full.
///
/// Parameters and results are those of ``bench_latency``.
#[pyfunction]
pub(crate) fn bench_image_latency(
    py: Python<'_>,
    places: usize,
    sequence_length: usize,
    pushes: usize,
) -> PyResult<Latency<'_>> {
    let config = Config { sequence_length, ..Config::default() };
    let mut dice = Dice(2);
    let small =
        (0..places).map(|_| dice.image(64, 32, Channels::Grey)).collect::<Result<Vec<_>, _>>();
    let large =
        (0..FRAMES / 8).map(|_| dice.image(640, 480, Channels::Rgb)).collect::<Result<Vec<_>, _>>();
    let (small, large) = (small.or_raise(py)?, large.or_raise(py)?);
    let map = Map::from_images(&small, Sad::default(), &mut |_, _| ControlFlow::Continue(()))
        .or_raise(py)?;
    let mut localizer = Localizer::new(Arc::new(map), config).or_raise(py)?;
    timed(py, pushes, sequence_length, |frame| {
        localizer.push_image(large[frame % large.len()].view()).map(|_| ())
    })
}

/// The time of each push, without the first `warm_up`; Ctrl-C is heard on the way.
fn timed(
    py: Python<'_>,
    pushes: usize,
    warm_up: usize,
    mut push: impl FnMut(usize) -> Result<(), Error> + Send,
) -> PyResult<Latency<'_>> {
    let mut took: Vec<u64> = Vec::new();
    took.try_reserve_exact(pushes).map_err(|_| PyMemoryError::new_err("a time for each push"))?;
    took.resize(pushes, 0);
    py.detach(|| (0..warm_up).try_for_each(&mut push)).or_raise(py)?;
    let (mut done, mut allocations) = (0, 0);
    while done < pushes {
        let (result, calls) = py.detach(|| {
            let begin = Instant::now();
            let mut work = || -> Result<(), Error> {
                while done < pushes && begin.elapsed().as_micros() < PATIENCE {
                    let start = Instant::now();
                    push(warm_up + done)?;
                    took[done] = start.elapsed().as_nanos() as u64;
                    done += 1;
                }
                Ok(())
            };
            counted(&mut work)
        });
        result.or_raise(py)?;
        allocations += calls;
        py.check_signals()?;
    }
    Ok((PyArray1::from_vec(py, took), allocations))
}

/// How fast plain code reads memory here: the ceiling of every scan.
///
/// Parameters
/// ----------
/// words : array of uint64, shape (k,)
///     What is read, over and over.
/// seconds : float
///     How long.
/// threads : int
///     How many read, each a part of its own.
///
/// Returns
/// -------
/// float
///     Bytes a second, in the fastest round.
#[pyfunction]
#[pyo3(signature = (words, seconds, threads=1))]
pub(crate) fn bench_read(
    py: Python<'_>,
    words: PyReadonlyArray1<'_, u64>,
    seconds: f64,
    threads: usize,
) -> PyResult<f64> {
    let words = words.as_slice()?;
    let begin = Instant::now();
    let mut best = f64::INFINITY;
    while best.is_infinite() || begin.elapsed().as_secs_f64() < seconds {
        // Which of the two keeps the memory busier depends on the processor.
        for sum in [one_stream, four_streams] {
            best = best.min(py.detach(|| read_once(words, threads.max(1), sum)));
        }
        py.check_signals()?;
    }
    Ok(size_of_val(words) as f64 / best)
}

/// Seconds of reading all words once; of little memory, the mean of several times.
fn read_once(words: &[u64], threads: usize, sum: fn(&[u64]) -> u64) -> f64 {
    let times = (1 << 20) / words.len().max(1) + 1;
    let start = Instant::now();
    for _ in 0..times {
        if threads == 1 {
            black_box(sum(black_box(words)));
        } else {
            thread::scope(|scope| {
                for part in words.chunks(words.len().div_ceil(threads).max(1)) {
                    scope.spawn(move || black_box(sum(black_box(part))));
                }
            });
        }
    }
    start.elapsed().as_secs_f64() / times as f64
}

/// So many sums side by side fill the vector registers.
const LANES: usize = 16;

fn one_stream(words: &[u64]) -> u64 {
    let mut lanes = [0_u64; LANES];
    for block in words.chunks_exact(LANES) {
        for (sum, &word) in lanes.iter_mut().zip(block) {
            *sum = sum.wrapping_add(word);
        }
    }
    lanes.iter().fold(0, |sum, &lane| sum.wrapping_add(lane))
}

fn four_streams(words: &[u64]) -> u64 {
    let part = words.len() / (4 * LANES) * LANES;
    let (a, rest) = words.split_at(part);
    let (b, rest) = rest.split_at(part);
    let (c, d) = rest.split_at(part);
    let mut lanes = [0_u64; LANES];
    let first = a.chunks_exact(LANES).zip(b.chunks_exact(LANES));
    for ((a, b), (c, d)) in first.zip(c.chunks_exact(LANES).zip(d.chunks_exact(LANES))) {
        for ((((sum, &a), &b), &c), &d) in lanes.iter_mut().zip(a).zip(b).zip(c).zip(d) {
            *sum = sum.wrapping_add((a ^ b) ^ (c ^ d));
        }
    }
    lanes.iter().fold(0, |sum, &lane| sum.wrapping_add(lane))
}

/// Numbers that look random and are the same each time (xorshift).
struct Dice(u64);

impl Dice {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1 << 24) as f32
    }

    fn image(&mut self, width: usize, height: usize, channels: Channels) -> Result<Image, Error> {
        let pixels =
            (0..width * height * channels.count()).map(|_| (self.next() >> 32) as u8).collect();
        Image::new(width, height, channels, pixels)
    }
}
