#![cfg_attr(fuzzing, no_main)]
//! The target `map`.

surefix_fuzz::program!("map");
