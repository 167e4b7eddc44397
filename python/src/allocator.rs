//! The extension's allocator: the system's, which counts while it is asked to.
#![allow(
    unsafe_code,
    reason = "an allocator is an unsafe trait; this one hands everything on to the system's"
)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering};

/// How many measurements are running. While there are none, counting costs one relaxed read a call.
static COUNTING: AtomicUsize = AtomicUsize::new(0);

thread_local! {
    /// What this thread has asked of the allocator while anything was being counted.
    static CALLS: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator. Giving memory back can take as long as getting it, so both are counted.
struct Counting;

#[inline]
fn count() {
    if COUNTING.load(Ordering::Relaxed) != 0 {
        CALLS.set(CALLS.get() + 1);
    }
}

// SAFETY: every method hands its arguments on to `System` unchanged; a counter without a destructor
// allocates nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller's promise is `System`'s.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        count();
        // SAFETY: the caller's promise is `System`'s.
        unsafe { System.dealloc(memory, layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller's promise is `System`'s.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: the caller's promise is `System`'s.
        unsafe { System.realloc(memory, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// What `work` gives, and how often it called the allocator on this thread.
pub(crate) fn counted<R>(work: impl FnOnce() -> R) -> (R, u64) {
    COUNTING.fetch_add(1, Ordering::Relaxed);
    let before = CALLS.get();
    let result = work();
    let calls = CALLS.get() - before;
    COUNTING.fetch_sub(1, Ordering::Relaxed);
    (result, calls)
}
