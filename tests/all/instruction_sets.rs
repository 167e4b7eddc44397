//! The answers do not depend on the processor: every instruction set gives the plain one's, to the
//! last bit.

use crate::cases::{Told, bits, cases, columns, config, given, kind};
use proptest::prelude::*;
use surefix::{Config, Error, Isa, Matcher};

proptest! {
    #![proptest_config(cases(2_000))]

    #[test]
    fn every_instruction_set_gives_the_same_fixes(
        (n, config) in (2..700_usize).prop_flat_map(|n| (Just(n), config(n.min(150)))),
        m in 1..40_usize, kind in kind(), seed: u64, odometry: bool,
    ) {
        let (d, told) = (columns(kind, n, m, seed), Told::new(m, seed, false, odometry));
        let on = |isa: Isa| Matcher::new(n, config.clone()).unwrap().with_isa(isa).unwrap();
        let mut plain = on(Isa::Scalar);
        let mut others: Vec<Matcher> = Isa::available().map(on).collect();
        for (query, column) in d.iter().enumerate() {
            let given = given(told.drive(), query);
            let expected = bits(&plain.push_with(column, given)?);
            for other in &mut others {
                prop_assert_eq!(bits(&other.push_with(column, given)?), expected, "{}", other.isa());
            }
        }
    }
}

#[test]
fn a_matcher_runs_on_what_it_is_told_and_refuses_what_the_processor_lacks() {
    for isa in Isa::ALL {
        let matcher = Matcher::new(5, Config::default()).unwrap().with_isa(isa);
        if isa.is_available() {
            assert_eq!(matcher.unwrap().isa(), isa);
        } else {
            assert!(matches!(matcher, Err(Error::Option { name: "isa", .. })));
        }
    }
    assert_eq!(Matcher::new(5, Config::default()).unwrap().isa(), Isa::best());
}
