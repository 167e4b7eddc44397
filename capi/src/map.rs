//! Maps.

use std::ffi::{CString, c_char};
use std::ptr;
use std::sync::Arc;

use once_cell::race::OnceBox;
use surefix::Recipe;

use crate::door::{ErrorText, Failure, Status, door, getter, give, object, object_mut, path, take};
use crate::fix::Position;

/// A known route, as `surefix map build` makes one. Any number of localizers can share it; each
/// holds a reference of its own, so that it may be freed before them.
pub struct Map {
    pub(crate) map: Arc<surefix::Map>,
    names: OnceBox<Vec<CString>>,
}

impl Map {
    fn new(map: surefix::Map) -> Self {
        Self { map: Arc::new(map), names: OnceBox::new() }
    }

    fn name(&self, place: usize) -> Option<*const c_char> {
        let names = self.map.names()?;
        // A name holds no zero byte: maps are refused that have one.
        let names = self.names.get_or_init(|| {
            let names = names.iter().map(|name| CString::new(name.as_str()).unwrap_or_default());
            Box::new(names.collect())
        });
        names.get(place).map(|name| name.as_ptr())
    }
}

/// Reads a map's file into memory. Free the map with surefix_map_free.
///
/// Errors: SUREFIX_STATUS_FILE if the file cannot be read, SUREFIX_STATUS_FORMAT if it is no map or
/// a damaged one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn surefix_map_open(
    path: *const c_char,
    map: *mut *mut Map,
    error: *mut ErrorText,
) -> Status {
    door(error, || {
        // SAFETY: the contract of the header.
        unsafe { give(map, || Ok(Map::new(surefix::Map::open(self::path(path)?)?))) }
    })
}

/// Maps a map's file into memory instead: it is ready at once, whatever its size, processes share
/// its memory, and its rows are read from the disk as they are needed. As long as the map or a
/// localizer on it lives, the file must not be changed or made shorter (to put another one in its
/// place is safe); else the program may end with SIGBUS. Free the map with surefix_map_free.
///
/// Errors: as for surefix_map_open.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn surefix_map_open_mapped(
    path: *const c_char,
    map: *mut *mut Map,
    error: *mut ErrorText,
) -> Status {
    door(error, || {
        // SAFETY: the contract of the header, which says what the file must not do.
        unsafe { give(map, || Ok(Map::new(surefix::Map::open_mapped(self::path(path)?)?))) }
    })
}

/// Ends the caller's use of a map. Localizers go on with it. NULL is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn surefix_map_free(map: *mut Map) {
    // SAFETY: the contract of the header.
    unsafe { take(map) }
}

/// The number of places, of which the first is 0; 0 for NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn surefix_map_places(map: *const Map) -> usize {
    // SAFETY: the contract of the header.
    getter(0, || unsafe { map.as_ref() }.map_or(0, |map| map.map.places()))
}

/// How many numbers a descriptor has that is pushed; 0 for NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn surefix_map_descriptor_size(map: *const Map) -> usize {
    // SAFETY: the contract of the header.
    getter(0, || unsafe { map.as_ref() }.map_or(0, |map| map.map.input_dim()))
}

/// Whether images can be pushed: the map then describes them as its own were. If not, it was made
/// of descriptors that surefix cannot compute, such as a network's; push those.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn surefix_map_takes_images(map: *const Map) -> bool {
    getter(false, || {
        // SAFETY: the contract of the header.
        let map = unsafe { map.as_ref() };
        map.is_some_and(|map| matches!(map.map.recipe(), Recipe::Sad(_)))
    })
}

/// The size of the images that the map was made of, in pixels. Queries may have another, if they
/// show the same. False, with nothing written, if it is not known.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn surefix_map_image_size(
    map: *const Map,
    width: *mut usize,
    height: *mut usize,
) -> bool {
    getter(false, || {
        // SAFETY: the contract of the header.
        let (map, width, height) = unsafe { (map.as_ref(), width.as_mut(), height.as_mut()) };
        let size = map.and_then(|map| map.map.image_size());
        let (Some(size), Some(width), Some(height)) = (size, width, height) else { return false };
        (*width, *height) = size;
        true
    })
}

/// The name of a place, such as its image's file. It lives as long as the map is not freed. NULL if
/// the map has no names, or no such place.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn surefix_map_name(map: *const Map, place: usize) -> *const c_char {
    // SAFETY: the contract of the header.
    getter(None, || unsafe { map.as_ref() }?.name(place)).unwrap_or(ptr::null())
}

/// Where a place is. On a map without positions it has 0 axes.
///
/// Errors: SUREFIX_STATUS_ARGUMENT if there is no such place.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn surefix_map_position(
    map: *const Map,
    place: usize,
    position: *mut Position,
    error: *mut ErrorText,
) -> Status {
    door(error, || {
        // SAFETY: the contract of the header.
        let map = unsafe { object(map, "map") }?;
        // SAFETY: the contract of the header.
        let position = unsafe { object_mut(position, "position") }?;
        let places = map.map.places();
        if place >= places {
            let message = format!("place: expected one from 0 to {}, got {place}", places - 1);
            return Err(Failure::argument(message));
        }
        let at = map.map.positions().and_then(|positions| positions.at(place));
        *position = Position::new(at);
        Ok(())
    })
}
