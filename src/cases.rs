//! How many random cases a property test runs. Tests from outside include this file as well.

use proptest::test_runner::Config;

/// This many, or in proportion to `PROPTEST_CASES`, which stands for 10,000; if that is fewer, no
/// property runs more than it. No files are left behind by cases that fail: the shrunk case is in
/// the message.
pub(crate) fn cases(usual: u32) -> Config {
    let given = std::env::var("PROPTEST_CASES").ok().and_then(|cases| cases.parse().ok());
    let given: u64 = given.unwrap_or(10_000);
    let scaled = (u64::from(usual) * given / 10_000).clamp(1, u64::from(u32::MAX));
    let cases = if given < 10_000 { given.min(u64::from(usual)) } else { scaled };
    Config { cases: cases as u32, failure_persistence: None, ..Config::default() }
}
