//! Memory of the process: large blocks lie in large pages.
//!
//! A page of 4 KiB costs an interrupt when it is first touched, some microseconds on a virtual machine, and a line of
//! the table that translates addresses ever after. Blocks from half a large page on begin at one, and the kernel is
//! asked to take such pages for them; it need not. Smaller blocks are left to the system's allocator, which is kept
//! from a habit: once a block with pages of its own is freed, it puts the next of that size between the small ones, and
//! a heap that long batches leave in pieces grows without an end.

use std::alloc::{GlobalAlloc, Layout, System};
use std::ffi::{c_int, c_void};
use std::sync::atomic::{AtomicBool, Ordering};

/// Bytes of a large page: of x86-64, and of 64-bit ARM with small pages of 4 KiB.
const PAGE: usize = 1 << 21;
/// Blocks from here on get pages of their own.
const LARGE: usize = PAGE / 2;
/// `MADV_HUGEPAGE` of Linux.
const ADVICE: c_int = 14;
/// What `malloc` aligns to.
const ALIGNED: usize = 16;
/// `M_MMAP_THRESHOLD` of the C library, and the bytes from which blocks have pages of their own: those that it begins with.
const OWN_PAGES: (c_int, c_int) = (-3, 128 << 10);

unsafe extern "C" {
    fn posix_memalign(out: *mut *mut c_void, align: usize, size: usize) -> c_int;
    fn calloc(count: usize, size: usize) -> *mut c_void;
    fn free(block: *mut c_void);
    fn madvise(start: *mut c_void, length: usize, advice: c_int) -> c_int;
    fn mallopt(parameter: c_int, value: c_int) -> c_int;
    fn write(file: c_int, bytes: *const c_void, length: usize) -> isize;
}

/// Keeps blocks that have pages of their own so, whatever was freed before: to be called once, at the start.
pub fn keep_large_blocks_apart() {
    // SAFETY: a number is set; a library that does not know it leaves all as it was.
    unsafe { mallopt(OWN_PAGES.0, OWN_PAGES.1) };
}

/// Whether the system has refused memory.
static REFUSED: AtomicBool = AtomicBool::new(false);

/// `block`, which is null where the system has refused it.
fn noted(block: *mut u8) -> *mut u8 {
    if block.is_null() {
        REFUSED.store(true, Ordering::Relaxed);
    }
    block
}

/// Lets the process end with `exit_code` and a sentence where it cannot go on without memory that the system refuses, as under
/// `ulimit -v`: the library aborts it. To be called once, at the start; where it cannot be, a signal ends the process as before.
pub fn end_in_words(exit_code: c_int) {
    let end = move || {
        const SAID: &str = "error: the system gives no more memory (ulimit -v?)\n";
        if REFUSED.load(Ordering::Relaxed) {
            // SAFETY: of `SAID` no more than its bytes are read.
            unsafe { write(2, SAID.as_ptr().cast(), SAID.len()) };
            signal_hook::low_level::exit(exit_code);
        }
    };
    // SAFETY: `end` only does what a handler of signals may: it allocates nothing, takes no lock and does not panic.
    let _ = unsafe { signal_hook::low_level::register(signal_hook::consts::SIGABRT, end) };
}

/// The allocator.
pub struct LargePages;

fn is_large(layout: &Layout) -> bool {
    layout.size() >= LARGE && layout.align() <= PAGE
}

/// Asks for large pages where whole ones lie between `start` and `start + length`.
fn advise(start: *mut u8, length: usize) {
    let skipped = start.align_offset(PAGE);
    let whole = length.saturating_sub(skipped) / PAGE * PAGE;
    if whole > 0 && !start.is_null() {
        // SAFETY: the range lies in one block, and the advice changes nothing but how it is backed.
        unsafe { madvise(start.wrapping_add(skipped).cast(), whole, ADVICE) };
    }
}

// SAFETY: what is large comes from and goes to the C library, where `free` takes back what any of its functions gave;
// all else comes from and goes to the system's allocator with the layout that it was asked for. A block is aligned to
// a page, or to what `calloc` promises where that is enough.
unsafe impl GlobalAlloc for LargePages {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if !is_large(&layout) {
            // SAFETY: as the caller's.
            return noted(unsafe { System.alloc(layout) });
        }
        let Some(size) = layout.size().checked_next_multiple_of(PAGE) else { return noted(std::ptr::null_mut()) };
        let mut block = std::ptr::null_mut();
        // SAFETY: the alignment is a power of two and a multiple of the size of a pointer.
        if unsafe { posix_memalign(&mut block, PAGE, size) } != 0 {
            return noted(std::ptr::null_mut());
        }
        advise(block.cast(), size);
        block.cast()
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        if !is_large(&layout) {
            // SAFETY: as the caller's.
            return noted(unsafe { System.alloc_zeroed(layout) });
        }
        if layout.align() <= ALIGNED {
            // Pages that nobody touches stay none, so they are not made large.
            // SAFETY: any size is allowed.
            return noted(unsafe { calloc(1, layout.size()) }.cast());
        }
        // SAFETY: as the caller's; the block has the size of the layout at least.
        unsafe {
            let block = self.alloc(layout);
            if !block.is_null() {
                block.write_bytes(0, layout.size());
            }
            block
        }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        if is_large(&layout) {
            // SAFETY: what is large came from the C library.
            unsafe { free(block.cast()) };
        } else {
            // SAFETY: as the caller's.
            unsafe { System.dealloc(block, layout) };
        }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: the caller promises that the size does not overflow with the alignment.
        let new = unsafe { Layout::from_size_align_unchecked(size, layout.align()) };
        if !is_large(&layout) && !is_large(&new) {
            // SAFETY: as the caller's.
            return noted(unsafe { System.realloc(block, layout, size) });
        }
        // SAFETY: both blocks hold what is copied, and they are distinct.
        unsafe {
            let moved = self.alloc(new);
            if !moved.is_null() {
                std::ptr::copy_nonoverlapping(block, moved, layout.size().min(size));
                self.dealloc(block, layout);
            }
            moved
        }
    }
}
