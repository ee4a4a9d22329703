//! How the C library's allocator shares memory out among threads.
#![allow(unsafe_code, reason = "a call of the C library")]

/// Makes glibc's allocator keep one heap for all threads. Call it before there are other threads. With other allocators it does nothing. The
/// environment variable `MALLOC_ARENA_MAX`, glibc's own setting for this, takes precedence.
///
/// By default it keeps up to eight heaps for each processor, and a thread that begins takes any of them. Machines of runs of frames are threads
/// that begin and end: each heap came to hold what one of them left between pieces that live, and memory grew with a sequence though what was
/// alive did not. Threads seldom wait for the one heap, as hot loops allocate nothing.
pub fn share_one_heap() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    if std::env::var_os("MALLOC_ARENA_MAX").is_none() {
        // SAFETY: the call changes a parameter of the allocator under that library's own lock; it takes two numbers and keeps no pointer. One that
        // is refused leaves the parameter as it is, which costs memory only.
        unsafe { libc::mallopt(libc::M_ARENA_MAX, 1) };
    }
}
