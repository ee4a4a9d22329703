//! Reading a large trace copies nothing: 100 MB of blobs are used where they lie in their files.
#![allow(unsafe_code, reason = "an allocator that counts")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use trace::command::Data;
use trace::{Builder, Packing, Trace, write, write_zip};

/// Counts the bytes that are ever allocated.
struct Counting;

static ALLOCATED: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call goes to the system allocator as it is.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATED.fetch_add(layout.size(), Ordering::Relaxed);
        // SAFETY: the caller's promise, passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise, passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

#[test]
fn a_hundred_megabytes_cost_no_copies() {
    const SIZE: usize = 25_000_000;
    let dir = tempfile::tempdir().unwrap();
    {
        let mut builder = Builder::new("large");
        for index in 0..4u8 {
            builder.add_blob(&format!("{index}.bin"), vec![index; SIZE]).unwrap();
        }
        let trace = builder.finish();
        write(&trace, dir.path().join("folder")).unwrap();
        write_zip(&trace, dir.path().join("a.zip"), Packing::Stored).unwrap();
    }
    for name in ["folder", "a.zip"] {
        let before = ALLOCATED.load(Ordering::Relaxed);
        let trace = Trace::open(dir.path().join(name)).unwrap();
        for index in 0..4u8 {
            let blob = format!("{index}.bin");
            let data = trace.data(&Data { blob: blob.clone(), offset: 10, size: 1000 }).unwrap();
            assert!(data.iter().all(|&byte| byte == index));
            // A range of the blob is a range of the same memory in every call.
            let whole = trace.blob(&blob).unwrap();
            assert_eq!((whole.len(), data.as_ptr()), (SIZE, whole[10..].as_ptr()));
            assert!(whole.is_mapped());
            assert_eq!(whole.as_ptr().align_offset(64), 0, "{name}");
        }
        let allocated = ALLOCATED.load(Ordering::Relaxed) - before;
        assert!(allocated < 100_000, "{name}: {allocated} bytes allocated");
    }
}
