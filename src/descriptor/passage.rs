//! What one vector passes through on its way along a chain: memory that is used again, and the
//! statistics of its drive.

use super::post::Post;
use super::running::Running;

/// By itself, for vectors that are treated as the references were; [`of_drive`](Self::of_drive) for
/// the queries of a drive.
#[derive(Debug, Default)]
pub(crate) struct Passage {
    pub(super) now: Vec<f32>,
    pub(super) next: Vec<f32>,
    /// One for each step that runs along; or none.
    pub(super) drives: Vec<Drive>,
}

/// A drive's statistics at one step.
#[derive(Clone, Debug)]
pub(super) struct Drive {
    so_far: Running,
    /// With the newest query, which may still be refused.
    with_newest: Running,
}

impl Clone for Passage {
    /// A copy with room for as much, so that it need not grow.
    fn clone(&self) -> Self {
        Self {
            now: Vec::with_capacity(self.now.capacity()),
            next: Vec::with_capacity(self.next.capacity()),
            drives: self.drives.clone(),
        }
    }
}

impl Passage {
    /// Through `post`, without a drive.
    pub(crate) fn new(post: &Post) -> Self {
        let (mut width, mut room) = (post.input(), post.input());
        for stage in post.stages() {
            let output = stage.output(width);
            // Principal components are computed beside the centred vector.
            room = room.max(width + output);
            width = output;
        }
        Self { now: Vec::with_capacity(room), next: Vec::with_capacity(room), drives: Vec::new() }
    }

    /// Through `post`, at the beginning of a drive.
    pub(crate) fn of_drive(post: &Post) -> Self {
        let drives = post.running().map(|stage| Drive::from(Running::after_stage(stage))).collect();
        Self { drives, ..Self::new(post) }
    }

    /// The newest query counts.
    pub(crate) fn keep(&mut self) {
        for Drive { so_far, with_newest } in &mut self.drives {
            std::mem::swap(so_far, with_newest);
        }
    }

    /// Begins another drive.
    pub(crate) fn reset(&mut self, post: &Post) {
        for (drive, stage) in self.drives.iter_mut().zip(post.running()) {
            drive.so_far.become_after(stage);
        }
    }

    /// What is known of the drive.
    pub(crate) fn running(&self) -> impl ExactSizeIterator<Item = &Running> {
        self.drives.iter().map(|drive| &drive.so_far)
    }

    /// Goes on with what was known of a drive; false where it does not fit.
    pub(crate) fn go_on(&mut self, known: Vec<Running>) -> bool {
        let fits = known.len() == self.drives.len()
            && known.iter().zip(self.running()).all(|(known, own)| known.dim() == own.dim());
        if fits {
            self.drives = known.into_iter().map(Drive::from).collect();
        }
        fits
    }
}

impl Drive {
    /// Writes a query, standardised, to `out`. It counts once it is [kept](Passage::keep).
    pub(super) fn look(&mut self, vector: &[f32], out: &mut Vec<f32>) {
        out.clear();
        out.resize(vector.len(), 0.0);
        self.so_far.look(vector, &mut self.with_newest, out);
    }
}

impl From<Running> for Drive {
    fn from(so_far: Running) -> Self {
        Self { with_newest: so_far.clone(), so_far }
    }
}
