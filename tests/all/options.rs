//! Options for tests and benchmarks: the struct cannot be made outside of the crate.

/// Options that differ from the default, or from others: `config! { base => weight: 0.5 }`.
macro_rules! config {
    (@ $name:ident $value:expr) => { $value };
    (@ $name:ident) => { $name };
    ($base:expr => $($name:ident $(: $value:expr)?),* $(,)?) => {{
        let mut config: surefix::Config = $base;
        $(config.$name = config!(@ $name $($value)?);)*
        config
    }};
    ($($options:tt)*) => { config!(surefix::Config::default() => $($options)*) };
}
