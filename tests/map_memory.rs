//! How much memory maps take while they are made: an allocator that knows its peak.
#![allow(unsafe_code, reason = "an allocator is an unsafe trait")]
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::fs;
use std::ops::ControlFlow;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};

use surefix::{Channels, Error, Image, ImageSource, Map, Metric, Sad};
use tempfile::tempdir;

/// The system's allocator, with the bytes that are in use and the most that ever were.
struct Peak;

static USED: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);

fn grown(by: usize) {
    let used = USED.fetch_add(by, SeqCst) + by;
    MOST.fetch_max(used, SeqCst);
}

// SAFETY: every method hands its arguments on to `System` unchanged; counters need no allocation.
unsafe impl GlobalAlloc for Peak {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        grown(layout.size());
        // SAFETY: the caller's promise is `System`'s.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        USED.fetch_sub(layout.size(), SeqCst);
        // SAFETY: the caller's promise is `System`'s.
        unsafe { System.dealloc(memory, layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        grown(layout.size());
        // SAFETY: the caller's promise is `System`'s.
        unsafe { System.alloc_zeroed(layout) }
    }

    // Large memory grows in place, or its pages move: no second copy.
    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        USED.fetch_sub(layout.size(), SeqCst);
        grown(size);
        // SAFETY: the caller's promise is `System`'s.
        unsafe { System.realloc(memory, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Peak = Peak;

/// One measurement at a time.
static TURN: Mutex<()> = Mutex::new(());

/// The most bytes that `work` had in use beyond those in use before it.
fn peak(work: impl FnOnce()) -> usize {
    let before = USED.load(SeqCst);
    MOST.store(before, SeqCst);
    work();
    MOST.load(SeqCst) - before
}

fn quietly(_done: usize, _total: usize) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Images of 320 x 240 RGB, made when they are asked for.
struct Drive(usize);

const IMAGE: usize = 320 * 240 * 3;

impl ImageSource for Drive {
    fn len(&self) -> usize {
        self.0
    }

    fn load(&self, index: usize) -> Result<Image, Error> {
        Image::new(320, 240, Channels::Rgb, vec![(index % 251) as u8; IMAGE])
    }
}

#[test]
fn a_map_is_built_in_the_memory_of_a_few_images_however_many_there_are() {
    let _turn = TURN.lock().unwrap();
    let folder = tempdir().unwrap();
    let path = folder.path().join("route.safetensors");
    let threads = std::thread::available_parallelism().unwrap().get();
    // The threads of the pool stay, and so does what each keeps.
    Map::build(&path, &Drive(threads * 4), Sad::default(), None, &mut quietly).unwrap();
    let build = |places| {
        peak(|| Map::build(&path, &Drive(places), Sad::default(), None, &mut quietly).unwrap())
    };
    // An image, its grey form and a describer each; a batch of descriptors; the file's buffer.
    let bound = (threads + 1) * 3 * IMAGE + threads * 32 * 2048 + (2 << 20);
    let (few, many) = (build(500), build(3000));
    assert!(few < bound && many < bound, "{few} and {many} bytes, with {threads} threads");
    let append = peak(|| Map::append_images(&path, &Drive(1000), None, &mut quietly).unwrap());
    assert!(append < bound, "{append} bytes");
    let from_images =
        peak(|| drop(Map::from_images(&Drive(3000), Sad::default(), &mut quietly).unwrap()));
    assert!(from_images < bound + 3000 * 2048, "{from_images} bytes");
}

const DIM: usize = 1000;
/// Bytes of all rows.
const ROWS: usize = 4 * DIM * 4000;

#[test]
fn opening_and_appending_hold_no_second_copy_of_the_rows() {
    let _turn = TURN.lock().unwrap();
    let folder = tempdir().unwrap();
    let path = folder.path().join("route.safetensors");
    let slack = 2 << 20;
    let numbers: Vec<f32> = (0..ROWS / 4).map(|i| 1.0 + (i % 13) as f32).collect();
    let mut map = None;
    let taken_over =
        peak(|| map = Some(Map::from_descriptors(numbers, DIM, Metric::Cosine).unwrap()));
    assert!(taken_over < slack, "{taken_over} bytes more than the vector had");
    let map = map.unwrap();
    let saved = peak(|| map.save(&path).unwrap());
    assert!(saved < slack, "{saved} bytes");
    // With `mmap` large rows lie in pages of their own, which the allocator does not see.
    let rows = if cfg!(feature = "mmap") { 0 } else { ROWS };
    let opened = peak(|| drop(Map::open(&path).unwrap()));
    assert!(opened < rows + slack, "{opened} bytes for {ROWS}");
    let appended = peak(|| Map::append(&path, &map).unwrap());
    assert!(appended < slack, "{appended} bytes");
    assert!(fs::metadata(&path).unwrap().len() as usize > 2 * ROWS);
    let extended = peak(|| drop(map.extended(&map).unwrap()));
    assert!(extended < slack, "{extended} bytes: its rows are those of the shorter maps");
    let cloned = peak(|| drop(map.clone()));
    assert!(cloned < slack, "{cloned} bytes");
    let slice = peak(|| drop(map.slice(10..3990).unwrap()));
    assert!(slice < slack, "{slice} bytes");
    #[cfg(feature = "mmap")]
    {
        // SAFETY: nobody else knows the file.
        let mapped = peak(|| drop(unsafe { Map::open_mapped(&path) }.unwrap()));
        assert!(mapped < slack, "{mapped} bytes");
    }
}
