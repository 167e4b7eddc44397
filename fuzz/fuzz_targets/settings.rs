#![cfg_attr(fuzzing, no_main)]
//! The target `settings`.

surefix_fuzz::program!("settings");
