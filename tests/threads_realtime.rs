//! A push with several threads allocates nothing, on none of them. (The counter is the whole
//! process's: one test, by itself.)
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

#[macro_use]
#[path = "all/options.rs"]
mod options;

#[path = "all/cases.rs"]
mod cases;
#[path = "all/counting.rs"]
mod counting;
#[path = "../src/random.rs"]
mod random;

use std::sync::Arc;

use cases::{DTYPES, numbers};
use counting::calls;
use surefix::{Config, Dtype, Localizer, Map, Metric};

#[test]
fn a_pool_allocates_nothing_after_its_first_frame() {
    const DIM: usize = 500;
    for dtype in DTYPES {
        let map =
            Map::from_descriptors(numbers(dtype, 1501 * DIM, 7), DIM, Metric::Cosine).unwrap();
        let localizer = Localizer::new(Arc::new(map), Config::default()).unwrap();
        let mut localizer = localizer.with_threads(Some(3)).unwrap();
        let (own, float) = (numbers(dtype, DIM, 8), numbers(Dtype::F32, DIM, 9));
        let spoilt = vec![f32::NAN; DIM];
        let mut push = || {
            localizer.push_descriptor(&own).unwrap();
            localizer.push_descriptor(&float).unwrap();
            assert!(localizer.push_descriptor(&spoilt).is_err());
        };
        push();
        // A thread that is still being started allocates for itself: it has had its time.
        std::thread::sleep(std::time::Duration::from_millis(200));
        push();
        let before = calls();
        (0..20).for_each(|_| push());
        assert_eq!(calls() - before, 0, "{dtype}");
    }
}
