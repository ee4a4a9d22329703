//! A client's way to memory: requests out, answers in. What is behind it is not known here.

use bytemuck::{Pod, Zeroable};

use sim::{In, Out, Wires};

/// Most bytes of one request, which never crosses a multiple of them. The slices of the second-level cache are interleaved at no
/// less, so that a request is the business of one of them.
pub const REQUEST_BYTES: u64 = 256;

/// Cuts a run of bytes into requests: address and bytes of each.
#[inline(always)]
pub fn requests(address: u64, bytes: u32) -> impl Iterator<Item = (u64, u32)> {
    let end = address + u64::from(bytes);
    let mut start = address;
    std::iter::from_fn(move || {
        let address = start;
        start = end.min((address / REQUEST_BYTES + 1) * REQUEST_BYTES);
        (address < end).then(|| (address, (start - address) as u32))
    })
}

/// What a request does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub enum AccessKind {
    /// Reads; answered when the bytes are there.
    Read = 0,
    /// Writes; never answered.
    Write = 1,
    /// Reads and writes in place; answered.
    Atomic = 2,
}

impl AccessKind {
    #[inline(always)]
    fn from_bits(bits: u16) -> AccessKind {
        match bits {
            0 => AccessKind::Read,
            1 => AccessKind::Write,
            _ => AccessKind::Atomic,
        }
    }

    /// Whether an answer comes.
    #[inline(always)]
    pub fn is_answered(self) -> bool {
        self != AccessKind::Write
    }
}

/// A request of a client.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Request {
    /// Address in bytes.
    pub address: u64,
    /// Comes back with the answer.
    pub tag: u32,
    /// Bytes, 1 to [`REQUEST_BYTES`], all within one multiple of that.
    pub bytes: u16,
    kind: u16,
}

impl Request {
    /// A request.
    #[inline(always)]
    pub fn new(kind: AccessKind, address: u64, bytes: u32, tag: u32) -> Request {
        debug_assert!(
            bytes > 0 && address / REQUEST_BYTES == (address + u64::from(bytes) - 1) / REQUEST_BYTES,
            "{bytes} bytes at {address} are not one request"
        );
        Request { address, tag, bytes: bytes as u16, kind: kind as u16 }
    }

    /// What it does.
    #[inline(always)]
    pub fn kind(&self) -> AccessKind {
        AccessKind::from_bits(self.kind)
    }
}

/// An answer to a read or an atomic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Answer {
    /// The request's tag.
    pub tag: u32,
}

/// A client's memory port.
#[derive(Clone, Debug)]
pub struct MemoryPort {
    /// Number among the ports of the memory.
    pub number: u16,
    /// Requests.
    pub requests: Out<Request>,
    /// Answers to reads and atomics.
    pub answers: In<Answer>,
}

/// Bytes of a request on a link in addition to the data it carries.
pub const HEADER: u32 = 8;

impl MemoryPort {
    /// Whether a request can be sent in this cycle.
    #[inline(always)]
    pub fn can_send(&self, wires: &mut Wires) -> bool {
        wires.can_push(&self.requests)
    }

    /// Asks for bytes; the tag comes back when they are there.
    #[inline(always)]
    pub fn read(&self, wires: &mut Wires, address: u64, bytes: u32, tag: u32) {
        wires.push_sized(&self.requests, Request::new(AccessKind::Read, address, bytes, tag), HEADER);
    }

    /// Writes bytes. Nothing comes back.
    #[inline(always)]
    pub fn write(&self, wires: &mut Wires, address: u64, bytes: u32) {
        wires.push_sized(&self.requests, Request::new(AccessKind::Write, address, bytes, 0), HEADER + bytes);
    }

    /// Reads and writes bytes where they are; the tag comes back when it is done.
    #[inline(always)]
    pub fn atomic(&self, wires: &mut Wires, address: u64, bytes: u32, tag: u32) {
        wires.push_sized(&self.requests, Request::new(AccessKind::Atomic, address, bytes, tag), HEADER + bytes);
    }

    /// The next answer's tag.
    #[inline(always)]
    pub fn answer(&self, wires: &mut Wires) -> Option<u32> {
        wires.pop(&self.answers).map(|answer| answer.tag)
    }
}

/// A request on its way to a slice: whose it is, and the address within the slice.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct SliceRequest {
    /// Address in bytes, the slices' interleaving taken out.
    pub address: u64,
    /// The client's tag.
    pub tag: u32,
    /// Number of the client's port.
    pub client: u16,
    /// Bytes less one, and from bit 8 the kind.
    meta: u16,
}

impl SliceRequest {
    /// The client's request, at an address within the slice.
    #[inline(always)]
    pub fn new(request: Request, client: u16, address: u64) -> SliceRequest {
        SliceRequest { address, tag: request.tag, client, meta: (request.bytes - 1) | request.kind << 8 }
    }

    /// Bytes.
    #[inline(always)]
    pub fn bytes(&self) -> u32 {
        u32::from(self.meta & 0xff) + 1
    }

    /// What it does.
    #[inline(always)]
    pub fn kind(&self) -> AccessKind {
        AccessKind::from_bits(self.meta >> 8)
    }
}

/// A slice's answer on its way back.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct SliceAnswer {
    /// The client's tag.
    pub tag: u32,
    /// Number of the client's port.
    pub client: u16,
    /// Bytes.
    pub bytes: u16,
}

/// A slice's request to its DRAM channel.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct DramRequest {
    /// Address in bytes within the channel.
    pub address: u64,
    /// Comes back with the answer to a read.
    pub id: u32,
    /// Bytes, all within one row.
    pub bytes: u16,
    /// 1 for a write, which is not answered.
    pub write: u16,
}

/// The data of a read have come.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct DramAnswer {
    /// The request's.
    pub id: u32,
}
