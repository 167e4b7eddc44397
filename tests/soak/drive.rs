//! The drive: mostly along the map, with stops, stretches off it, gaps, refused frames, resets, and
//! robots that are saved and restored.

use std::sync::Arc;
use std::time::{Duration, Instant};
use std::{fs, thread};

use hdrhistogram::Histogram;
use surefix::{Error, Given, Localizer};

use crate::cases::bits;
use crate::counting::calls;
use crate::kinds::{Kind, PLACES};
use crate::random::SplitMix64;
use crate::report::Report;

/// Pushes from reset to reset.
const LEG: u64 = 1000;
/// One leg in this many is driven by the plain localizer, too, and each fix compared.
const COMPARED: u64 = 16;
/// Pushes between two looks at the memory.
const LOOK: u64 = 100 * LEG;

/// Pushes the kind's localizer that many times, after the first legs, which are not counted.
pub(crate) fn soak(kind: &Kind, pushes: u64) -> Report {
    let folder = tempfile::tempdir().unwrap();
    let [tested, plain] = kind.pair(folder.path());
    let mut drive = Drive {
        tested,
        plain,
        rows: kind.rows(),
        query: vec![0.0; kind.dim()],
        spoilt: vec![f32::NAN; kind.dim()],
        random: SplitMix64(2),
        at: 0.0,
        off_map: 0,
        aside: 0,
        compared: 0,
        spared: 0,
        times: Histogram::new_with_bounds(1, 60_000_000_000, 3).unwrap(),
    };
    for leg in 0..3 {
        drive.leg(kind, leg, LEG);
    }
    settle();
    // Touches the pages of the counts.
    drive.times.reset();
    (drive.aside, drive.compared, drive.spared) = (0, 0, 0);
    let first = resident();
    let (mut most, before) = (first, calls());
    for (leg, start) in (0..pushes).step_by(LEG as usize).enumerate() {
        drive.leg(kind, leg as u64, LEG.min(pushes - start));
        if start % LOOK == 0 || start + LEG >= pushes {
            let before = calls();
            most = most.max(resident());
            drive.aside += calls() - before;
        }
    }
    let allocator_calls = calls() - before - drive.aside;
    assert_eq!(drive.spared > 0, kind.screened, "a screen spares rows, and nothing else does");
    let drift = most.zip(first).map(|(most, first)| most - first);
    Report { kind: kind.name, allocator_calls, drift, compared: drive.compared, times: drive.times }
}

struct Drive {
    tested: Localizer,
    plain: Localizer,
    rows: Vec<f32>,
    query: Vec<f32>,
    spoilt: Vec<f32>,
    random: SplitMix64,
    /// The place.
    at: f64,
    /// How many frames the robot will be off the map.
    off_map: usize,
    /// Calls of the allocator that are no push's.
    aside: usize,
    compared: u64,
    /// Pushes that did not look at all places' rows.
    spared: u64,
    times: Histogram<u64>,
}

impl Drive {
    fn leg(&mut self, kind: &Kind, leg: u64, pushes: u64) {
        self.tested.reset();
        self.plain.reset();
        let beside = leg.is_multiple_of(COMPARED);
        for push in 0..pushes {
            if push == 500 && leg % 2 == 1 && kind.threads == 1 {
                self.restored();
            }
            self.frame(kind, beside);
        }
    }

    /// Goes on with a robot that is restored from a snapshot of this one.
    fn restored(&mut self) {
        let before = calls();
        let snapshot = self.tested.snapshot().unwrap();
        let map = Arc::clone(self.tested.map());
        self.tested = Localizer::restore(map, &snapshot, None).unwrap();
        drop(snapshot);
        self.aside += calls() - before;
    }

    fn frame(&mut self, kind: &Kind, beside: bool) {
        match self.random.below(500) {
            0 => self.off_map = 50,
            1..5 => self.gap(kind),
            5..7 => {
                let refused = self.tested.push_descriptor(&self.spoilt);
                assert!(matches!(refused, Err(Error::NotFinite { .. })), "{refused:?}");
            }
            _ => {}
        }
        // Stands in one frame of six.
        let advance = if self.random.below(6) == 0 { 0.0 } else { f64::from(self.random.share()) };
        self.at = (self.at + 2.0 * advance) % PLACES as f64;
        let dim = self.query.len();
        let row = &self.rows[self.at as usize * dim..][..dim];
        let off_map = self.off_map > 0;
        self.off_map = self.off_map.saturating_sub(1);
        for (number, of_row) in self.query.iter_mut().zip(row) {
            let noise = 2.0 * self.random.share() - 1.0;
            *number = if off_map { noise } else { of_row + 0.5 * noise };
        }
        let mut given = Given::default();
        if kind.tracks && self.random.below(3) > 0 {
            given.advance = Some(2.0 * advance);
        }
        let began = Instant::now();
        let fix = self.tested.push_descriptor_with(&self.query, given);
        let took = began.elapsed();
        self.times.saturating_record(took.as_nanos() as u64);
        self.spared += u64::from(self.tested.looked_at() < PLACES);
        if beside {
            let expected = self.plain.push_descriptor_with(&self.query, given).unwrap();
            assert_eq!(bits(&fix.unwrap()), bits(&expected), "{}", kind.name);
            self.compared += 1;
        } else {
            fix.unwrap();
        }
    }

    fn gap(&mut self, kind: &Kind) {
        let advance = f64::from(10.0 * self.random.share());
        for localizer in [&mut self.tested, &mut self.plain] {
            if kind.tracks && advance > 5.0 {
                localizer.gap_with_advance(advance).unwrap();
            } else {
                localizer.gap();
            }
        }
    }
}

/// Waits for threads that are still being started: they allocate for themselves.
fn settle() {
    let mut before = usize::MAX;
    while before != calls() {
        before = calls();
        thread::sleep(Duration::from_millis(300));
    }
}

/// The process's resident memory in bytes, if the system says it as Linux does.
fn resident() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kilobytes: u64 = line.trim().trim_end_matches(" kB").parse().ok()?;
    Some(1024 * kilobytes)
}
