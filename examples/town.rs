//! A map of several roads: a ring, a road that leads into it, and one that leads out.
//!
//! `cargo run --release --example town`

use std::process::ExitCode;
use std::sync::Arc;

use surefix::{Config, Localizer, Map, Motion, Sad, Segments, quiet};
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
    // Three generated roads replace your recordings: a map of each.
    let (width, height) = (96, 48);
    let road = |places, seed| {
        let config = RouteConfig { places, width, height, seed, ..RouteConfig::default() };
        Route::new(config)
    };
    let roads = [road(100, 1)?, road(120, 2)?, road(80, 3)?];
    let mut maps = Vec::new();
    for road in &roads {
        let summer = road.traverse(Conditions::reference())?;
        maps.push(Map::from_images(&summer, Sad::default(), &mut quiet)?);
    }

    // Together they are the town's: the first road is a ring, the second leads into it, and the
    // third leaves it halfway.
    let town = Map::join(&maps.iter().collect::<Vec<_>>())?;
    let breaks = [100, 220];
    let links = [(219, 0), (50, 220)];
    let segments = Segments::new(300, &breaks)?.with_closed(&[0])?.with_links(&links)?;
    let town = town.with_segments(segments)?;

    // In winter: in, once round the ring and on, and out.
    let mut config = Config::default();
    config.motion = Some(Motion::any());
    let mut localizer = Localizer::new(Arc::new(town), config)?;
    let mut pixels = vec![0; width * height * 3];
    for (road, frames) in [(1, 120), (0, 100), (0, 51), (2, 80)] {
        let winter = roads[road].traverse(Conditions::revisit())?;
        for frame in 0..frames.min(winter.len()) {
            winter.render(frame, &mut pixels);
            let image = surefix::ImageView::new(width, height, surefix::Channels::Rgb, &pixels)?;
            let fix = localizer.push_image(image)?;
            if frame % 25 == 10 {
                println!(
                    "road {road}, frame {frame}: segment {}, place {}, {:.0} % sure",
                    fix.segment,
                    fix.segment_place,
                    100.0 * fix.confidence().unwrap_or_default()
                );
            }
        }
    }
    Ok(())
}
