#![cfg_attr(fuzzing, no_main)]
//! The target `image`.

surefix_fuzz::program!("image");
