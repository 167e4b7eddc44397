//! Numbers that look random and are the same each time, of each type, and images and distances.
#![allow(dead_code, reason = "each benchmark takes what it needs")]

#[path = "../../src/random.rs"]
mod generator;

pub(crate) use generator::SplitMix64;
use half::f16;
use surefix::{Channels, Dtype, Image, Values};

impl SplitMix64 {
    pub(crate) fn bytes(&mut self, count: usize) -> Vec<u8> {
        (0..count).map(|_| (self.next() >> 32) as u8).collect()
    }

    pub(crate) fn numbers(&mut self, dtype: Dtype, count: usize) -> Values {
        match dtype {
            Dtype::U8 => Values::U8(self.bytes(count)),
            Dtype::I8 => Values::I8(self.bytes(count).into_iter().map(u8::cast_signed).collect()),
            Dtype::F16 => Values::F16((0..count).map(|_| f16::from_f32(self.share())).collect()),
            Dtype::F32 => Values::F32((0..count).map(|_| self.share()).collect()),
        }
    }

    pub(crate) fn image(
        &mut self,
        width: usize,
        height: usize,
        channels: Channels,
    ) -> Option<Image> {
        Image::new(width, height, channels, self.bytes(width * height * channels.count())).ok()
    }

    /// Distances of a drive: noise, and a dip at the true place, which is one further with each
    /// query.
    pub(crate) fn drive(&mut self, places: usize, queries: usize) -> Vec<Vec<f32>> {
        let column = |query| {
            let mut column: Vec<f32> = (0..places).map(|_| 0.5 + self.share()).collect();
            column[places / 3 + query] *= 0.2;
            column
        };
        (0..queries).map(column).collect()
    }
}
