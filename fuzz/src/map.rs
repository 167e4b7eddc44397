//! Target `map`: bytes as a map's file. Every door gives the same map or the same refusal, and what
//! opens can be saved, appended to, screened and localized on.

use std::cell::OnceCell;
use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

use surefix::{Config, Dtype, Localizer, Map, Values};

use crate::bits::bits;
use crate::signed::signed;

/// Larger maps take too long.
const MOST_NUMBERS: usize = 1 << 14;

thread_local! {
    static FOLDER: OnceCell<tempfile::TempDir> = const { OnceCell::new() };
}

/// A file of this process.
fn path(name: &str) -> PathBuf {
    FOLDER.with(|folder| {
        folder.get_or_init(|| tempfile::tempdir().expect("a folder")).path().join(name)
    })
}

pub(crate) fn map(data: &[u8]) {
    // As they are: the checksum refuses nearly all.
    drop(Map::from_bytes(data));
    let bytes = signed(data);
    let opened = Map::from_bytes(&bytes);
    let file = path("map.safetensors");
    fs::write(&file, &bytes).expect("a file");
    let from_file = Map::open(&file);
    // SAFETY: it stays as it is until the map is dropped, at the end of this function.
    #[expect(unsafe_code, reason = "mapping a file")]
    let mapped = unsafe { Map::open_mapped(&file) };
    let map = match (&opened, &from_file, &mapped) {
        (Ok(map), Ok(read), Ok(mapped)) => {
            let bytes = map.to_bytes().expect("it was opened");
            assert!(read.to_bytes().expect("it was opened") == bytes);
            mapped.verify().expect("a right checksum");
            assert!(mapped.to_bytes().expect("it was opened") == bytes);
            let again = Map::from_bytes(&bytes).expect("its own bytes");
            assert!(again.to_bytes().expect("it was opened") == bytes);
            map
        }
        // A mapped file's rows are not looked at.
        (Err(_), Err(_), Ok(mapped)) => {
            drop(mapped.verify());
            return use_it(mapped);
        }
        (Err(_), Err(_), Err(_)) => return,
        _ => panic!("{opened:?}, {from_file:?}, {mapped:?}"),
    };
    if map.places() * map.input_dim().max(map.dim()) > MOST_NUMBERS {
        return;
    }
    save(map);
    edit(map);
    use_it(map);
    use_it(mapped.as_ref().expect("it was opened"));
}

fn save(map: &Map) {
    let file = path("saved.safetensors");
    map.save(&file).expect("a file");
    let bytes = map.to_bytes().expect("it was opened");
    assert!(fs::read(&file).expect("a file") == bytes);
    let appended = Map::append(&file, map);
    match (appended, map.extended(map)) {
        (Ok(()), Ok(extended)) => {
            let opened = Map::open(&file).expect("what was appended to");
            assert!(opened.to_bytes().expect("a map") == extended.to_bytes().expect("a map"));
            assert_eq!(opened.places(), 2 * map.places());
        }
        (Err(_), extended) => {
            assert!(fs::read(&file).expect("a file") == bytes);
            drop(extended);
        }
        (Ok(()), Err(error)) => {
            // A map of several traverses is longer in the file alone.
            drop(Map::open(&file).expect("what was appended to"));
            drop(error);
        }
    }
}

fn edit(map: &Map) {
    let bytes = |map: &Map| map.to_bytes().expect("a map");
    let half = map.places() / 2;
    let all: Vec<usize> = (0..map.places()).collect();
    if let Ok(kept) = map.keep(&all) {
        // Which rows show nothing, a file says; for what is kept, it is found anew.
        let again = kept.keep(&all).expect("the same places");
        assert!(bytes(&again) == bytes(&kept));
        assert_eq!(bytes(&kept).len(), bytes(map).len());
    }
    let parts = [map.slice(0..half), map.thin(1.0), Map::join(&[map, map]), map.without_blank()];
    for part in parts.into_iter().flatten() {
        let again = Map::from_bytes(&bytes(&part)).expect("its own bytes");
        assert!(bytes(&again) == bytes(&part));
    }
    let _ = (map.names(), map.positions(), map.segments(), map.blank(), format!("{map:?}"));
}

/// Localizes on a map, with and without a screen, and goes on from a snapshot.
fn use_it(map: &Map) {
    if map.places() * map.input_dim().max(map.dim()) > MOST_NUMBERS {
        return;
    }
    let mut query = Values::zeros(map.dtype(), map.input_dim());
    if let Values::F32(numbers) = &mut query {
        numbers.iter_mut().enumerate().for_each(|(at, x)| *x = (at % 7) as f32 * 0.25);
    }
    let mut config = Config::default();
    config.sequence_length = 1;
    let Ok(mut plain) = Localizer::new(Arc::new(map.clone()), config.clone()) else { return };
    let distances = map.distances(&query);
    let fix = plain.push_descriptor(&query);
    if let (Ok(distances), Ok(fix)) = (&distances, &fix) {
        // Statistics of the drive change what is compared.
        let least = distances.iter().copied().fold(f32::INFINITY, f32::min);
        let known = fix.single.distance == least;
        assert!(known || map.input_dim() != map.dim() || has_post(map), "{fix:?} {least}");
    }
    let Ok(bytes) = plain.snapshot() else { return };
    let mut restored =
        Localizer::restore(Arc::clone(plain.map()), &bytes, Some(&config)).expect("its own");
    let next = (plain.push_descriptor(&query), restored.push_descriptor(&query));
    if let (Ok(one), Ok(other)) = &next {
        assert_eq!(bits(one), bits(other));
    }
    assert_eq!(next.0.is_ok(), next.1.is_ok());
    if let Ok(screened) = map.clone().with_screen(Dtype::I8) {
        let mut screened = Localizer::new(Arc::new(screened), config).expect("the same options");
        match (fix, screened.push_descriptor(&query)) {
            (Ok(plain), Ok(screened)) => assert_eq!(bits(&plain), bits(&screened)),
            (Err(plain), Err(screened)) => assert_eq!(plain.to_string(), screened.to_string()),
            (plain, screened) => panic!("{plain:?}, {screened:?}"),
        }
    }
}

fn has_post(map: &Map) -> bool {
    map.post().is_some()
}
