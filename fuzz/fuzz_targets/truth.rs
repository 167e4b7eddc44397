#![cfg_attr(fuzzing, no_main)]
//! The target `truth`.

surefix_fuzz::program!("truth");
