#![cfg_attr(fuzzing, no_main)]
//! The target `screen`.

surefix_fuzz::program!("screen");
