//! Fixes through C are those of Rust, to the last bit.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;

use surefix::calibration::{Calibrate, calibrate};
use surefix::evaluate::Match;
use surefix::{
    Channels, Config, Dtype, Fix, Given, Image, ImageView, Localizer, Map, MapMark, Metric, Motion,
    Settings, View,
};

use crate::library::compiled;
use crate::route::{
    DIM, Files, PLACES, SIZE, channel, descriptors, image_map, thermal, view, winter,
};

/// A fix as drive.c prints it.
fn row(localizer: &Localizer, fix: &Fix) -> String {
    let at = localizer.position(fix);
    let metres = at.as_ref().map_or(&[][..], |at| at.metres());
    let metre = |axis: usize| metres.get(axis).copied().unwrap_or(f64::NAN).to_bits();
    let [latitude, longitude] = at.and_then(|at| at.degrees()).unwrap_or([f64::NAN; 2]);
    let bits = |number: Option<f64>| number.unwrap_or(f64::NAN).to_bits();
    let flag = u8::from;
    let none = usize::MAX;
    let interval = fix.track.map_or((none, none), |track| track.interval);
    let mut row = format!("{} {} {} {}", fix.frame, fix.place, fix.segment, fix.segment_place);
    let mut add = |text: std::fmt::Arguments<'_>| row.write_fmt(text).unwrap();
    add(format_args!(" {} {:016x} {:016x} {:016x}", metres.len(), metre(0), metre(1), metre(2)));
    add(format_args!(" {:016x} {:016x}", latitude.to_bits(), longitude.to_bits()));
    add(format_args!(" {:08x}", fix.score.to_bits()));
    add(format_args!(" {} {} {}", flag(fix.is_ready()), flag(fix.trusted), flag(fix.blank)));
    let alarm = localizer.alarm().is_some_and(surefix::calibration::Alarm::raised);
    let judged = fix.accepted.is_some();
    add(format_args!(" {} {} {}", flag(judged), flag(fix.accepted == Some(true)), flag(alarm)));
    add(format_args!(" {:016x} {:016x}", bits(fix.probability), bits(fix.speed())));
    add(format_args!(" {}", flag(fix.track.is_some())));
    add(format_args!(" {:016x} {:016x}", bits(fix.confidence()), bits(fix.off_map())));
    add(format_args!(" {} {}", interval.0, interval.1));
    let sequence = fix.sequence;
    let place = sequence.map_or(none, |sequence| sequence.place);
    let score = sequence.map_or(f32::NAN, |sequence| sequence.score);
    add(format_args!(" {} {place} {:08x}", flag(sequence.is_some()), score.to_bits()));
    add(format_args!(" {}", sequence.map_or(0, |sequence| sequence.anchors)));
    add(format_args!(" {:016x}", bits(sequence.map(|sequence| sequence.speed))));
    add(format_args!(" {} {:08x}", fix.single.place, fix.single.distance.to_bits()));
    add(format_args!(" {} {:08x}", fix.gradient.place, fix.gradient.value.to_bits()));
    row
}

/// A script for drive.c beside the same steps in Rust, whose rows it collects.
pub(crate) struct Drive {
    files: Files,
    localizer: Localizer,
    script: String,
    rows: Vec<String>,
}

impl Drive {
    pub(crate) fn new(localizer: Localizer, options: &str) -> Self {
        let files = Files::new();
        files.save("map.safetensors", localizer.map());
        Self { files, localizer, script: format!("{options}start\n"), rows: Vec::new() }
    }

    fn advance(given: Option<f64>) -> String {
        given.map_or_else(|| "-".to_owned(), |advance| advance.to_string())
    }

    fn given(advance: Option<f64>) -> Given {
        advance.map_or(Given::default(), |advance| Given::default().advance(advance))
    }

    fn file(&self, bytes: &[u8]) -> String {
        let path = self.files.write(&self.rows.len().to_string(), bytes);
        path.display().to_string()
    }

    /// An image as Rust takes it, and in the memory of a camera, of a format and a stride.
    fn image(
        &mut self,
        image: ImageView<'_>,
        memory: &[u8],
        layout: (usize, i32),
        advance: Option<f64>,
    ) {
        let (name, (stride, format)) = (self.file(memory), layout);
        let (width, height, moved) = (image.width(), image.height(), Self::advance(advance));
        writeln!(self.script, "image {name} {width} {height} {stride} {format} {moved}").unwrap();
        let fix = self.localizer.push_image_with(image, Self::given(advance)).unwrap();
        self.rows.push(row(&self.localizer, &fix));
    }

    fn values(&mut self, values: View<'_>, advance: Option<f64>) {
        let (dtype, bytes) = match values {
            View::F32(numbers) => (0, numbers.iter().flat_map(|x| x.to_ne_bytes()).collect()),
            View::F16(numbers) => (1, numbers.iter().flat_map(|x| x.to_ne_bytes()).collect()),
            View::I8(numbers) => (2, numbers.iter().map(|&x| x as u8).collect()),
            View::U8(numbers) => (3, numbers.to_vec()),
        };
        let bytes: Vec<u8> = bytes;
        let (name, count, moved) = (self.file(&bytes), values.len(), Self::advance(advance));
        writeln!(self.script, "values {name} {count} {dtype} {moved}").unwrap();
        let fix = self.localizer.push_descriptor_with(values, Self::given(advance)).unwrap();
        self.rows.push(row(&self.localizer, &fix));
    }

    fn gap(&mut self, advance: Option<f64>) {
        writeln!(self.script, "gap {}", Self::advance(advance)).unwrap();
        match advance {
            Some(advance) => self.localizer.gap_with_advance(advance).unwrap(),
            None => self.localizer.gap(),
        }
    }

    fn reset(&mut self) {
        self.script.push_str("reset\n");
        self.localizer.reset();
    }

    /// In C, out of a snapshot; in Rust the localizer goes on.
    fn restart(&mut self) {
        self.script.push_str("restart\n");
    }

    /// What the program prints, run by `runner` if there is one.
    pub(crate) fn check(&self, program: &Path, runner: &[&str]) {
        let mut words = runner.iter().copied().map(AsRef::as_ref).chain([program.as_os_str()]);
        let mut command = Command::new(words.next().unwrap());
        command.args(words).arg(self.files.path().join("map.safetensors"));
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        child.stdin.take().unwrap().write_all(self.script.as_bytes()).unwrap();
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && said.is_empty(), "{}\n{said}", output.status);
        let printed = String::from_utf8(output.stdout).unwrap();
        let printed: Vec<&str> = printed.lines().collect();
        assert_eq!(printed.len(), self.rows.len());
        for (got, expected) in printed.iter().zip(&self.rows) {
            assert_eq!(got, expected);
        }
    }
}

/// The left part of an image in colour.
fn narrow(image: &Image, width: usize) -> Image {
    let rows = image.pixels().chunks_exact(3 * image.width());
    let pixels = rows.flat_map(|row| &row[..3 * width]).copied().collect();
    Image::new(width, image.height(), Channels::Rgb, pixels).unwrap()
}

/// Every format and stride, an advance, gaps, a reset and a restart, with a track.
pub(crate) fn images() -> Drive {
    let mut config = Config::default();
    (config.sequence_length, config.weight) = (4, 0.9);
    (config.speeds, config.motion) = (vec![0.9, 1.0, 1.1], Some(Motion::any()));
    config.motion.as_mut().unwrap().pace = 0.5;
    let options = "number sequence_length 4\nset weight 0.9\nset speeds 0.9,1,1.1\nset motion any\n\
                   number motion.pace 0.5\nset threads 1\n";
    let localizer = Localizer::new(image_map(), config).unwrap();
    let mut drive = Drive::new(localizer, options);
    for (frame, image) in winter().iter().enumerate() {
        let (width, height) = (SIZE.0 - frame % 7, SIZE.1);
        let image = &narrow(image, width);
        let order: &[usize] = match frame % 5 {
            0 => &[0, 1, 2],
            1 => &[2, 1, 0],
            2 => &[0, 1, 2, 0],
            3 => &[2, 1, 0, 1],
            _ => &[1],
        };
        let format = [2, 3, 4, 5, 0][frame % 5];
        let row = width * order.len();
        let more = [0, 0, 1, 7][frame % 4];
        // The bytes between the rows are no pixels; the last row has none after it.
        let mut memory = Vec::new();
        for pixels in image.pixels().chunks_exact(3 * width) {
            memory.resize(memory.len().next_multiple_of(row + more), 0xAA);
            memory.extend(pixels.chunks_exact(3).flat_map(|rgb| order.iter().map(|&at| rgb[at])));
        }
        let grey = channel(image, 1);
        let view = if order.len() == 1 {
            ImageView::new(width, height, Channels::Grey, &grey).unwrap()
        } else {
            image.view()
        };
        let stride = if more == 0 && frame % 2 == 0 { 0 } else { row + more };
        drive.image(view, &memory, (stride, format), (frame % 3 == 1).then_some(1.25));
        match frame {
            20 => drive.gap(None),
            30 => drive.gap(Some(2.5)),
            35 => drive.restart(),
            50 => drive.reset(),
            _ => {}
        }
    }
    drive
}

#[test]
fn of_images_in_every_format() {
    images().check(&compiled("tests/c/programs/drive.c", &[]), &[]);
}

#[test]
fn of_deep_images_and_of_descriptors_of_every_type() {
    let program = compiled("tests/c/programs/drive.c", &[]);
    let (map, frames) = thermal();
    let mut drive = Drive::new(Localizer::new(map, Config::default()).unwrap(), "");
    for (index, frame) in frames.iter().enumerate() {
        // Rows at odd addresses, too.
        let more = index % 3;
        let mut memory = Vec::new();
        for row in frame.chunks_exact(SIZE.0) {
            memory.extend(row.iter().flat_map(|sample| sample.to_ne_bytes()));
            memory.resize(memory.len() + more, 0xAA);
        }
        drive.image(view(frame), &memory, (2 * SIZE.0 + more, 1), None);
    }
    drive.check(&program, &[]);

    for (dtype, metric) in [
        (Dtype::F32, Metric::Cosine),
        (Dtype::F16, Metric::Euclidean),
        (Dtype::I8, Metric::Cosine),
        (Dtype::U8, Metric::Manhattan),
    ] {
        let map = Map::from_descriptors(descriptors(dtype, 0), DIM, metric).unwrap();
        let mut config = Config::default();
        (config.smoothing, config.floor) = (5, surefix::Floor::Fixed(0.125));
        config.gradient = surefix::Gradient::Unhalved;
        let options = "set smoothing 5\nset floor 0.125\nset gradient unhalved\n";
        let mut drive = Drive::new(Localizer::new(Arc::new(map), config).unwrap(), options);
        let queries = descriptors(dtype, 7);
        for query in 0..PLACES {
            drive.values(queries.view().row(query, DIM).unwrap(), None);
        }
        drive.check(&program, &[]);
    }
}

/// With the settings of a file: a threshold, probabilities, and an alarm.
#[test]
fn judged_by_the_settings_of_a_file() {
    let rows = descriptors(Dtype::F32, 0);
    let map = Arc::new(Map::from_descriptors(rows, DIM, Metric::Euclidean).unwrap());
    let mut settings = Settings::default();
    (settings.config.sequence_length, settings.maps) = (2, vec![MapMark::of(&map)]);
    let mut localizer = settings.localizer(vec![Arc::clone(&map)]).unwrap();
    let mut matches = Vec::new();
    for turn in 1..6 {
        localizer.reset();
        let queries = descriptors(Dtype::F32, turn);
        for query in 0..PLACES {
            let fix = localizer.push_descriptor(queries.view().row(query, DIM).unwrap()).unwrap();
            let (place, score, ready) = (fix.place, fix.score, fix.is_ready());
            matches.push(Match { place, score, ready, accepted: true });
        }
    }
    let wrong = |(at, found): (usize, &Match)| {
        Some(f64::from(u8::from(found.place.abs_diff(at % PLACES) > 1)))
    };
    let wrong: Vec<_> = matches.iter().enumerate().map(wrong).collect();
    let mut options = Calibrate::default();
    (options.wrong, options.block) = (0.2, Some(1));
    settings.threshold = Some(calibrate(&matches, &wrong, &options).unwrap());

    let files = Files::new();
    let program = compiled("tests/c/programs/drive.c", &[]);
    let file = files.path().join("route.toml");
    settings.save(&file).unwrap();
    let localizer = settings.localizer(vec![map]).unwrap();
    let mut drive = Drive::new(localizer, &format!("load {}\n", file.display()));
    for turn in [9, 10] {
        let queries = descriptors(Dtype::F32, turn);
        for query in 0..PLACES {
            drive.values(queries.view().row(query, DIM).unwrap(), None);
        }
    }
    // Scores that are no longer those of the calibration drive.
    for query in 0..300 {
        let far: Vec<f32> = (0..DIM).map(|at| (query * (at + 3) % 17 * 40) as f32).collect();
        drive.values(View::F32(&far), None);
    }
    let flags = |row: &String| row.split(' ').skip(14).take(3).collect::<Vec<_>>().join("");
    let seen: Vec<String> = drive.rows.iter().map(flags).collect();
    for kind in ["100", "110", "101"] {
        assert!(
            seen.iter().any(|flags| flags == kind),
            "judged, accepted, alarm: no fix of {kind}"
        );
    }
    drive.check(&program, &[]);
    // Beside a threshold no option changes.
    let refused = Command::new("sh")
        .args(["-c", "printf 'load %s\\nset weight 0.5\\nstart\\n' \"$2\" | \"$0\" \"$1\""])
        .args([&program, &drive.files.path().join("map.safetensors"), &file])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&refused.stderr);
    assert!(!refused.status.success() && said.contains("calibrated with it"), "{said}");
}
