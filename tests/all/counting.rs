//! The system's allocator, counting its calls, for test programs that make it their own.
#![allow(unsafe_code, reason = "an allocator is an unsafe trait")]
#![allow(dead_code, reason = "each test program uses its part")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering};

struct Counting;

thread_local! {
    static HERE: Cell<usize> = const { Cell::new(0) };
}
static ALL: AtomicUsize = AtomicUsize::new(0);

fn count() {
    HERE.set(HERE.get() + 1);
    ALL.fetch_add(1, Ordering::Relaxed);
}

// SAFETY: every method hands its arguments on to `System` unchanged; a counter without a destructor
// is no allocation.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller's promise is `System`'s.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // Giving memory back can take as long as getting it: it counts.
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

/// How often `work` called the allocator, on this thread.
pub(crate) fn allocations(work: impl FnOnce()) -> usize {
    let before = HERE.get();
    work();
    HERE.get() - before
}

/// The calls of all threads so far.
pub(crate) fn calls() -> usize {
    ALL.load(Ordering::Relaxed)
}
