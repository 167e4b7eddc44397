#![cfg_attr(fuzzing, no_main)]
//! The target `snapshot`.

surefix_fuzz::program!("snapshot");
