//! The options of a loop closer.

use std::path::PathBuf;

use crate::error::Error;
use crate::motion::Motion;

/// The options of a [`LoopCloser`](crate::LoopCloser), all with defaults.
///
/// ```
/// use surefix::LoopConfig;
/// let mut config = LoopConfig::default();
/// config.exclude = 100;
/// config.memory = Some(64 << 20);
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LoopConfig {
    /// The newest places, with which a frame is not compared: it looks like them because the robot
    /// has only just left them. At least 1; 30 by default.
    pub exclude: usize,
    /// Confidence is the belief within this many places of the most probable one. 3 by default.
    pub tolerance: usize,
    /// The least confidence of an edge, from 0 to 1. 0.9 by default.
    pub confidence: f64,
    /// The frames in a row that must be as sure, at places that follow each other, before the last
    /// of them makes an edge: places that look alike by chance do not for long. At least 1; 10 by
    /// default.
    pub lasting: usize,
    /// How the robot moves along the earlier places, and how often it comes to one:
    /// [`Motion::loops`] by default.
    pub motion: Motion,
    /// The most memory, in bytes: before it is passed, the oldest blocks of places go to a file.
    /// `None`, the default, for no limit.
    pub memory: Option<usize>,
    /// The folder of that file, which has no name and ends with the program; `None`, the default,
    /// for the system's folder for temporary files.
    pub folder: Option<PathBuf>,
}

impl Default for LoopConfig {
    fn default() -> Self {
        Self {
            exclude: 30,
            tolerance: 3,
            confidence: 0.9,
            lasting: 10,
            motion: Motion::loops(),
            memory: None,
            folder: None,
        }
    }
}

impl LoopConfig {
    /// Checks every option against its range.
    ///
    /// # Errors
    /// [`Error::Option`] for the first option outside its range.
    pub fn validate(&self) -> Result<(), Error> {
        for (name, number) in [("exclude", self.exclude), ("lasting", self.lasting)] {
            if number == 0 {
                let expected = "a whole number of 1 or more".to_owned();
                return Err(Error::Option { name, expected, got: "0".to_owned() });
            }
        }
        if !(0.0..=1.0).contains(&self.confidence) {
            let (expected, got) = ("a number from 0 to 1".to_owned(), self.confidence.to_string());
            return Err(Error::Option { name: "confidence", expected, got });
        }
        if let Some(folder) = self.folder.as_ref().filter(|folder| !folder.is_dir()) {
            let (expected, got) = ("a folder".to_owned(), folder.display().to_string());
            return Err(Error::Option { name: "folder", expected, got });
        }
        self.motion.validate()
    }
}
