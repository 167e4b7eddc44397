//! Structured input: routes, options and columns from the fuzzer's bytes.

use arbitrary::{Result, Unstructured};
use surefix::{Config, Floor, Gradient, Motion, Segments};

/// Whether the next choice is `yes` times in `of`; never if the bytes are at their end.
pub(crate) fn rarely(u: &mut Unstructured<'_>, of: u8) -> Result<bool> {
    Ok(u.int_in_range(1..=of)? == of)
}

/// A number from 0 to 1 in steps, both ends often.
pub(crate) fn share(u: &mut Unstructured<'_>) -> Result<f64> {
    Ok(match u.int_in_range(0..=3)? {
        0 => 0.0,
        1 => 1.0,
        _ => f64::from(u.arbitrary::<u8>()?) / 255.0,
    })
}

/// A distance, or a number of a descriptor: ties, extremes and denormals among them.
pub(crate) fn number(u: &mut Unstructured<'_>) -> Result<f32> {
    const ODD: [f32; 12] = [
        0.0,
        -0.0,
        f32::MAX,
        -f32::MAX,
        f32::MIN_POSITIVE,
        1e-45,
        -1e-45,
        1.0,
        1.0 + f32::EPSILON,
        1.0 - f32::EPSILON / 2.0,
        1e30,
        1e-30,
    ];
    Ok(match u.int_in_range(0..=7)? {
        0..=3 => f32::from(u.arbitrary::<u8>()?) / 16.0,
        4 | 5 => f32::from(u.arbitrary::<u16>()?) / 65_535.0,
        6 => ODD[u.choose_index(ODD.len())?],
        _ => Some(f32::from_bits(u.arbitrary()?)).filter(|x| x.is_finite()).unwrap_or(0.5),
    })
}

/// A column of a road on which the robot drives: a seed stands for most of its numbers.
pub(crate) fn column(
    u: &mut Unstructured<'_>,
    before: Option<&[f32]>,
    n: usize,
) -> Result<Vec<f32>> {
    let kind = u.int_in_range(0..=6)?;
    if kind == 0 {
        let all = number(u)?;
        return Ok(vec![all; n]);
    }
    if let (1, Some(before)) = (kind, before) {
        return Ok(before.to_vec());
    }
    if kind == 2 && n <= 64 {
        return (0..n).map(|_| number(u)).collect();
    }
    let mut state = u64::from(u.arbitrary::<u32>()?);
    let levels = [1, 3, 16, 1 << 20][u.int_in_range(0..=3)?];
    let mut column: Vec<f32> = Vec::with_capacity(n);
    for _ in 0..n {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        column.push((state >> 33) as f32 % levels as f32 / levels as f32 + 0.25);
    }
    // Valleys, and other numbers, at some places.
    for _ in 0..u.int_in_range(0..=3)? {
        let at = u.choose_index(n)?;
        column[at] = number(u)?;
    }
    Ok(column)
}

/// Some places in one or several segments, some of them closed, perhaps with links.
pub(crate) fn route(u: &mut Unstructured<'_>, most: usize) -> Result<Segments> {
    let few = most.min(30);
    let places = match u.int_in_range(0..=40)? {
        40 => u.int_in_range(2..=most)?,
        _ => u.int_in_range(2..=few)?,
    };
    let mut breaks = Vec::new();
    for _ in 0..u.int_in_range(0..=3)? {
        breaks.push(u.int_in_range(1..=places - 1)?);
    }
    breaks.sort_unstable();
    breaks.dedup();
    let mut route = Segments::new(places, &breaks).expect("breaks in order");
    let mut closed = Vec::new();
    for (index, segment) in route.iter().enumerate() {
        if segment.len() > 2 && u.arbitrary()? {
            closed.push(index);
        }
    }
    route = route.with_closed(&closed).expect("segments of three places");
    if rarely(u, 4)? && places <= few {
        let mut links = Vec::new();
        for _ in 0..u.int_in_range(1..=4)? {
            let link = (u.choose_index(places)?, u.choose_index(places)?);
            if !links.contains(&link) && route.clone().with_links(&[link]).is_ok() {
                links.push(link);
            }
        }
        route = route.with_links(&links).expect("links to other places");
    }
    Ok(route)
}

/// The paper's options.
pub(crate) fn config(u: &mut Unstructured<'_>) -> Result<Config> {
    let mut config = Config::default();
    config.sequence_length = u.int_in_range(1..=9)?;
    config.weight = share(u)?;
    config.tolerance = match u.int_in_range(0..=4)? {
        0 => 0,
        1 => usize::MAX,
        2 => usize::from(u.arbitrary::<u8>()?),
        _ => 1,
    };
    config.smoothing = match u.int_in_range(0..=7)? {
        0 => u.int_in_range(1..=50)?,
        1 => 1,
        2 => 2,
        _ => 3,
    };
    config.gradient = if u.arbitrary()? { Gradient::Halved } else { Gradient::Unhalved };
    config.floor = match u.int_in_range(0..=2)? {
        0 => Floor::Fixed(f64::from(number(u)?)),
        _ => Floor::Running,
    };
    if u.arbitrary()? {
        let count = u.int_in_range(1..=5)?;
        let speed = |u: &mut Unstructured<'_>| Ok(f64::from(u.int_in_range(0..=20_u8)?) / 8.0);
        config.speeds = (0..count).map(|_| speed(u)).collect::<Result<_>>()?;
    }
    Ok(config)
}

/// A kind of motion, with its options changed or not.
pub(crate) fn motion(u: &mut Unstructured<'_>) -> Result<Motion> {
    let kinds = [Motion::steady, Motion::free, Motion::any, Motion::loops];
    let mut motion = kinds[u.choose_index(4)?]();
    let rate = |u: &mut Unstructured<'_>| share(u);
    for _ in 0..u.int_in_range(0..=4)? {
        match u.int_in_range(0..=11)? {
            0 => motion.pace = 0.01 + f64::from(u.arbitrary::<u8>()?) / 50.0,
            1 => motion.switching = rate(u)?,
            2 => motion.jitter = rate(u)? / 4.0,
            3 => motion.restart = rate(u)?,
            4 => motion.leave = rate(u)?,
            5 => motion.rejoin = rate(u)?,
            6 => motion.evidence = rate(u)? * 10.0,
            7 => motion.clip = rate(u)? * 10.0,
            8 => motion.hubness = rate(u)? * 20.0,
            9 => motion.repeat = rate(u)?,
            10 => motion.by_distance = u.arbitrary()?,
            _ => {
                let mut speeds = Vec::new();
                for _ in 0..u.int_in_range(1..=5)? {
                    speeds.push(f64::from(u.int_in_range(0..=40_u8)?) / 8.0);
                }
                speeds.sort_by(f64::total_cmp);
                speeds.dedup();
                motion.speeds = speeds;
            }
        }
    }
    Ok(motion)
}

/// How far the robot has moved.
pub(crate) fn advance(u: &mut Unstructured<'_>) -> Result<f64> {
    const ODD: [f64; 8] = [0.0, -0.0, 0.5, -0.5, 1e12, -1e12, 1e9 + 0.5, -64.5];
    Ok(match u.int_in_range(0..=3)? {
        0 => ODD[u.choose_index(ODD.len())?],
        _ => f64::from(u.arbitrary::<i8>()?) / 32.0,
    })
}
