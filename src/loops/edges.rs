//! The edges as CSV, and as the g2o text that pose-graph optimisers read.

use std::fmt::{self, Write as _};
use std::io::{self, Write};

use super::LoopCloser;
use crate::error::Error;

/// The poses of frames: in the plane (`x`, `y` and the heading in radians), or in space (`x`, `y`,
/// `z` and the quaternion `qx`, `qy`, `qz`, `qw`), in metres.
///
/// ```
/// use surefix::Poses;
/// let poses = Poses::new(vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.1], 3)?;
/// assert_eq!(poses.len(), 2);
/// # Ok::<(), surefix::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Poses {
    numbers: Vec<f64>,
    axes: usize,
}

impl Poses {
    /// Poses of `axes` (3 or 7) numbers each, one after the other. Quaternions are made of length
    /// 1.
    ///
    /// # Errors
    /// [`Error::Shape`] for other axes or a count that they do not divide, [`Error::NotFinite`] for
    /// a NaN or an infinity, [`Error::NoDirection`] for a quaternion of zeros.
    pub fn new(mut numbers: Vec<f64>, axes: usize) -> Result<Self, Error> {
        if !matches!(axes, 3 | 7) || !numbers.len().is_multiple_of(axes) {
            let expected = "3 numbers a frame (x, y, heading) or 7 (x, y, z, qx, qy, qz, qw)";
            let got = format!("{} numbers in rows of {axes}", numbers.len());
            return Err(Error::Shape { what: "poses", expected: expected.to_owned(), got });
        }
        if let Some(at) = numbers.iter().position(|x| !x.is_finite()) {
            let (row, value) = (Some(at / axes), numbers[at] as f32);
            return Err(Error::NotFinite { what: "poses", row, index: at % axes, value });
        }
        if axes == 7 {
            for (row, pose) in numbers.chunks_exact_mut(axes).enumerate() {
                let length = pose[3..].iter().map(|x| x * x).sum::<f64>().sqrt();
                if !length.is_normal() {
                    return Err(Error::NoDirection { what: "poses", row: Some(row) });
                }
                pose[3..].iter_mut().for_each(|x| *x /= length);
            }
        }
        Ok(Self { numbers, axes })
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.numbers.len() / self.axes
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.numbers.is_empty()
    }

    fn iter(&self) -> impl Iterator<Item = &[f64]> {
        self.numbers.chunks_exact(self.axes)
    }
}

/// What a g2o file says beside the loop edges: [`LoopCloser::write_g2o`].
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Graph {
    /// The pose of each frame. `None`, the default, writes the loop edges alone, as those of a
    /// graph in the plane.
    pub poses: Option<Poses>,
    /// The vertex of frame 0. 0 by default.
    pub first: u64,
    /// The standard deviations of a sure loop edge, in metres and radians: how far apart the camera
    /// may be at what counts as one place. `(2.0, 0.2)` by default.
    pub deviation: (f64, f64),
    /// Those of an odometry edge. `(0.1, 0.02)` by default.
    pub odometry_deviation: (f64, f64),
}

impl Default for Graph {
    fn default() -> Self {
        Self { poses: None, first: 0, deviation: (2.0, 0.2), odometry_deviation: (0.1, 0.02) }
    }
}

impl LoopCloser {
    /// Writes the edges as CSV: the line `frame,place,confidence`, then a line an edge.
    ///
    /// # Errors
    /// Whatever `out` gives.
    pub fn write_csv(&self, out: &mut impl Write) -> io::Result<()> {
        writeln!(out, "frame,place,confidence")?;
        for edge in self.edges() {
            writeln!(out, "{},{},{}", edge.frame, edge.place, edge.confidence)?;
        }
        Ok(())
    }

    /// Writes a pose graph in the text format of g2o, as GTSAM reads it too. With poses: a vertex a
    /// frame, an edge from each frame to the next by the difference of their poses, and the loop
    /// edges. Without: the loop edges alone, to be added to the graph of an odometry whose vertices
    /// are the frames.
    ///
    /// A loop edge leads from the place to the frame. A camera says that they are at one place, and
    /// not how they lie to each other: the measurement is the identity, and the information matrix
    /// is diagonal, `confidence / deviation^2`. That confidence is a belief of the filter, and an
    /// edge can be wrong: give these edges a robust kernel.
    ///
    /// ```
    /// use surefix::{Graph, LoopCloser, LoopConfig, Metric};
    /// let mut closer = LoopCloser::of_descriptors(1, Metric::Euclidean, LoopConfig::default())?;
    /// closer.push_descriptor([1.0_f32].as_slice())?;
    /// let mut text = Vec::new();
    /// closer.write_g2o(&mut text, &Graph::default())?;
    /// assert!(text.is_empty(), "no loop, no edge");
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Length`] unless there is a pose a frame, [`Error::Option`] for a deviation that is not
    /// a number above 0; those of `out` as [`Error::Io`].
    pub fn write_g2o(&self, out: &mut impl Write, graph: &Graph) -> Result<(), Error> {
        let text = self.g2o(graph)?;
        out.write_all(text.as_bytes()).map_err(|source| Error::Io {
            path: "the pose graph".into(),
            action: "write",
            source,
        })
    }

    fn g2o(&self, graph: &Graph) -> Result<String, Error> {
        let Graph { poses, first, deviation, odometry_deviation } = graph;
        for (name, (metres, radians)) in
            [("deviation", deviation), ("odometry_deviation", odometry_deviation)]
        {
            let weights = weights((*metres, *radians), 1.0);
            let counts = weights.iter().all(|weight| weight.is_normal());
            if !(*metres > 0.0 && *radians > 0.0 && counts) {
                let expected =
                    "two numbers above 0, in metres and radians, whose squares are numbers"
                        .to_owned();
                let got = format!("({metres}, {radians})");
                return Err(Error::Option { name, expected, got });
            }
        }
        if first.checked_add(self.frames).is_none() {
            let expected = format!("a number up to {}", u64::MAX - self.frames);
            return Err(Error::Option { name: "first", expected, got: first.to_string() });
        }
        let mut text = String::new();
        let axes = poses.as_ref().map_or(3, |poses| poses.axes);
        let edge = |text: &mut String, from: u64, to: u64, pose: &[f64], weights| {
            let tag = if axes == 3 { "EDGE_SE2" } else { "EDGE_SE3:QUAT" };
            line(text, format_args!("{tag} {from} {to}"), pose);
            information(text, axes, weights);
        };
        if let Some(poses) = poses {
            let (expected, got) = (usize::try_from(self.frames).unwrap_or(usize::MAX), poses.len());
            if expected != got {
                return Err(Error::Length { what: "poses, one for each frame", expected, got });
            }
            let tag = if axes == 3 { "VERTEX_SE2" } else { "VERTEX_SE3:QUAT" };
            for (vertex, pose) in (*first..).zip(poses.iter()) {
                line(&mut text, format_args!("{tag} {vertex}"), pose);
                text.push('\n');
            }
            let pairs = poses.iter().zip(poses.iter().skip(1));
            for (vertex, (from, to)) in (*first..).zip(pairs) {
                let by = if axes == 3 { in_plane(from, to) } else { in_space(from, to) };
                if by[..axes].iter().any(|number| !number.is_finite()) {
                    let (what, row) = ("poses", Some((vertex - first) as usize + 1));
                    return Err(Error::NotFinite { what, row, index: 0, value: f32::INFINITY });
                }
                edge(&mut text, vertex, vertex + 1, &by[..axes], weights(*odometry_deviation, 1.0));
            }
        }
        let mut same = [0.0; 7];
        same[6] = if axes == 7 { 1.0 } else { 0.0 };
        for closed in &self.edges {
            let (from, to) = (first + closed.place as u64, first + closed.frame);
            edge(&mut text, from, to, &same[..axes], weights(*deviation, closed.confidence));
        }
        Ok(text)
    }
}

/// The begin of a line and its numbers. (Writing to a string does not fail.)
fn line(text: &mut String, begin: fmt::Arguments<'_>, numbers: &[f64]) {
    let _ = text.write_fmt(begin);
    for number in numbers {
        let _ = write!(text, " {number}");
    }
}

/// The information of a metre and of a radian.
fn weights((metres, radians): (f64, f64), confidence: f64) -> [f64; 2] {
    [confidence / (metres * metres), confidence / (radians * radians)]
}

/// The upper triangle of the information matrix, row by row, and the end of the line.
fn information(text: &mut String, axes: usize, [metre, radian]: [f64; 2]) {
    let (moves, all) = if axes == 3 { (2, 3) } else { (3, 6) };
    for row in 0..all {
        for column in row..all {
            let on_diagonal = if row < moves { metre } else { radian };
            let number = if row == column { on_diagonal } else { 0.0 };
            let _ = write!(text, " {number}");
        }
    }
    text.push('\n');
}

/// The second pose as seen from the first.
fn in_plane(from: &[f64], to: &[f64]) -> [f64; 7] {
    let (sin, cos) = from[2].sin_cos();
    let (x, y) = (to[0] - from[0], to[1] - from[1]);
    let turn = to[2] - from[2];
    let turn = turn.sin().atan2(turn.cos());
    [cos * x + sin * y, cos * y - sin * x, turn, 0.0, 0.0, 0.0, 0.0]
}

fn in_space(from: &[f64], to: &[f64]) -> [f64; 7] {
    let back = [-from[3], -from[4], -from[5], from[6]];
    let moved = [to[0] - from[0], to[1] - from[1], to[2] - from[2], 0.0];
    let forth = [from[3], from[4], from[5], from[6]];
    let [x, y, z, _] = product(product(back, moved), forth);
    let [a, b, c, d] = product(back, [to[3], to[4], to[5], to[6]]);
    [x, y, z, a, b, c, d]
}

/// The product of two quaternions, `w` last.
fn product([a, b, c, d]: [f64; 4], [e, f, g, h]: [f64; 4]) -> [f64; 4] {
    [
        d * e + a * h + b * g - c * f,
        d * f - a * g + b * h + c * e,
        d * g + a * f - b * e + c * h,
        d * h - a * e - b * f - c * g,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_difference_of_poses_leads_from_one_to_the_other() {
        let turn = std::f64::consts::FRAC_PI_2;
        let by = in_plane(&[1.0, 2.0, turn, 0.0], &[1.0, 5.0, -turn, 0.0]);
        assert!((by[0] - 3.0).abs() < 1e-12 && by[1].abs() < 1e-12);
        assert!((by[2].abs() - 2.0 * turn).abs() < 1e-12);
        let half = 0.5_f64.sqrt();
        // A quarter turn to the left, about z; and another.
        let by =
            in_space(&[1.0, 2.0, 0.0, 0.0, 0.0, half, half], &[1.0, 5.0, 4.0, 0.0, 0.0, 1.0, 0.0]);
        let expected = [3.0, 0.0, 4.0, 0.0, 0.0, half, half];
        assert!(by.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{by:?}");
    }

    #[test]
    fn impossible_poses_are_refused() {
        assert!(Poses::new(vec![0.0; 4], 2).is_err());
        assert!(Poses::new(vec![0.0; 4], 3).is_err());
        assert!(Poses::new(vec![0.0, f64::NAN, 0.0], 3).is_err());
        let error = Poses::new(vec![0.0; 7], 7).unwrap_err().to_string();
        assert!(error.contains("poses (row 0)"), "{error}");
    }
}
