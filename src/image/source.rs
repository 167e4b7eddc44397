//! Many images from a list, from files, or from the generated route.

use std::ops::ControlFlow;

use super::view::Image;
use crate::error::Error;

/// A traverse's images, in route order, each loaded when it is needed.
///
/// ```
/// use std::ops::ControlFlow;
/// use surefix::{Channels, Error, Image, ImageSource, Map, Sad};
///
/// /// Grey frames that lie in one long buffer.
/// struct Recording(Vec<u8>);
///
/// impl ImageSource for Recording {
///     fn len(&self) -> usize {
///         self.0.len() / (64 * 32)
///     }
///
///     fn load(&self, index: usize) -> Result<Image, Error> {
///         let frame = &self.0[index * 64 * 32..(index + 1) * 64 * 32];
///         Image::new(64, 32, Channels::Grey, frame.to_vec())
///     }
/// }
///
/// let frames = Recording((0..5 * 64 * 32).map(|i: usize| (i * i % 251) as u8).collect());
/// let map = Map::from_images(&frames, Sad::default(), &mut |_, _| ControlFlow::Continue(()))?;
/// assert_eq!(map.places(), 5);
/// # Ok::<(), Error>(())
/// ```
pub trait ImageSource: Sync {
    /// The number of images.
    fn len(&self) -> usize;

    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The image `index`, below `len()`.
    ///
    /// # Errors
    /// [`Error::Image`], or [`Error::Io`], if it cannot be read; the error names it.
    fn load(&self, index: usize) -> Result<Image, Error>;

    /// The name of the image `index`: its file's, if it has one, else the index.
    fn name(&self, index: usize) -> String {
        index.to_string()
    }

    /// Whether a map may be made of them if they are not all of one size.
    fn has_mixed_sizes(&self) -> bool {
        false
    }
}

impl ImageSource for [Image] {
    fn len(&self) -> usize {
        <[Image]>::len(self)
    }

    fn load(&self, index: usize) -> Result<Image, Error> {
        Ok(self[index].clone())
    }
}

impl ImageSource for Vec<Image> {
    fn len(&self) -> usize {
        self.as_slice().len()
    }

    fn load(&self, index: usize) -> Result<Image, Error> {
        self.as_slice().load(index)
    }
}

/// Is told the number of images done and of all, on the calling thread; `Break` stops the work.
/// [`quiet`] is told and does nothing.
pub type Progress<'a> = &'a mut (dyn FnMut(usize, usize) -> ControlFlow<()> + Send);

/// The answer of a [`Progress`] as a result.
pub(crate) fn go_on(answer: ControlFlow<()>, done: usize, total: usize) -> Result<(), Error> {
    if answer.is_break() { Err(Error::Interrupted { done, total }) } else { Ok(()) }
}

/// For those who want no report of [`Progress`], and no stop.
///
/// ```
/// assert!(surefix::quiet(3, 10).is_continue());
/// ```
pub fn quiet(_done: usize, _total: usize) -> ControlFlow<()> {
    ControlFlow::Continue(())
}
