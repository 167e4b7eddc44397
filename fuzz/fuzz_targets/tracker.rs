#![cfg_attr(fuzzing, no_main)]
//! The target `tracker`.

surefix_fuzz::program!("tracker");
