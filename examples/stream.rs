//! The real-time loop: a map made once, then a fix for every camera frame, without allocating.
//!
//! `cargo run --release --example stream`

use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;

use surefix::{Channels, Config, ImageView, Localizer, Map, Sad, quiet};
use surefix_simulate::{Conditions, Route, RouteConfig};

fn main() -> ExitCode {
    match drive() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn drive() -> Result<(), surefix::Error> {
    // A generated road replaces your robot's camera: one drive in summer, one on a winter
    // afternoon.
    let (width, height) = (160, 80);
    let route = Route::new(RouteConfig { places: 300, width, height, ..RouteConfig::default() })?;
    let summer = route.traverse(Conditions::reference())?;
    let winter = route.traverse(Conditions::revisit())?;
    let truth = winter.truth(&summer);

    // Once: the map. `Map::open("route.safetensors")` is the other way to get one.
    let map = Map::from_images(&summer, Sad::default(), &mut quiet)?;
    let mut config = Config::default();
    config.sequence_length = 3;
    let mut localizer = Localizer::new(Arc::new(map), config)?;

    // For every frame: where am I, and may I trust that answer?
    let mut pixels = vec![0; width * height * 3];
    let (mut trusted, mut right, mut slowest) = (0, 0, std::time::Duration::ZERO);
    for (frame, truth) in truth.iter().enumerate() {
        winter.render(frame, &mut pixels);
        let image = ImageView::new(width, height, Channels::Rgb, &pixels)?;

        let start = Instant::now();
        let fix = localizer.push_image(image)?;
        slowest = slowest.max(start.elapsed());

        if fix.trusted {
            trusted += 1;
            right += usize::from(truth.is_some_and(|truth| truth.abs_diff(fix.single.place) <= 1));
        }
        if frame % 50 == 0 {
            println!(
                "frame {frame:3}: place {:3}, score {:.3}, trusted {}",
                fix.place, fix.score, fix.trusted
            );
        }
    }
    println!(
        "{} frames, {trusted} trusted, {right} of those right; the slowest fix took {slowest:?}",
        truth.len()
    );
    Ok(())
}
