#![cfg_attr(fuzzing, no_main)]
//! The target `matcher`.

surefix_fuzz::program!("matcher");
