//! Errors of captures, with their place.

use std::fmt;

/// An error with its place in the capture.
#[derive(Debug)]
pub struct Error {
    /// The number of the block. None before the first.
    pub block: Option<u64>,
    /// The byte of the file at which the block begins, or up to which the header was read.
    pub offset: u64,
    /// The call or the kind of block.
    pub name: Option<&'static str>,
    /// The path of the member, such as `pCreateInfo.pNext[2].pCode`. Empty if no member is to blame.
    pub member: String,
    /// The fault.
    pub cause: Cause,
}

/// A fault of a capture.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Cause {
    /// The file cannot be read or written.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// The first bytes are others.
    #[error("this is no capture by GFXReconstruct")]
    Magic,
    /// A version of the format that is not known.
    #[error("version {0}.{1} of the format is not supported, only 0.0 and 0.1")]
    Version(u32, u32),
    /// The header ends early.
    #[error("the file ends in its header")]
    Header,
    /// The header names more options than the format has.
    #[error("the header has {0} options")]
    Options(u32),
    /// A way to compress that is not known.
    #[error("compression {0} is not known")]
    Compression(u32),
    /// A compressed block in a file that says that it is not compressed.
    #[error("the block is compressed, and the header names no compression")]
    Uncompressed,
    /// More bytes than the limit of the reader.
    #[error("{0} bytes exceed the limit of {1}")]
    Limit(u64, u64),
    /// The compressed data are damaged.
    #[error("the compressed data are damaged: {0}")]
    Damaged(String),
    /// The decompressed data are of another length than the block says.
    #[error("the data have {found} bytes, not {said}")]
    Size {
        /// The bytes by the block's own field.
        said: u64,
        /// The bytes that are there.
        found: u64,
    },
    /// The content of a block ends early.
    #[error("the data end here")]
    End,
    /// The content of a block goes on after its last field.
    #[error("{0} bytes are left after the last value")]
    Left(u64),
    /// A length that the rest of the block cannot hold.
    #[error("a length of {0} exceeds the data")]
    Length(u64),
    /// An attribute word that does not fit the declaration.
    #[error("the attributes {0:#x} do not fit the type")]
    Attributes(u32),
    /// A structure in a chain that the table does not have.
    #[error("structure type {0} is not known")]
    Structure(u32),
    /// A union whose form is not known.
    #[error("the form of {0} is not known")]
    Union(&'static str),
    /// A type of descriptor in the data of an update template that has no form there.
    #[error("descriptor type {0} cannot stand in the data of an update template")]
    Descriptor(u32),
    /// Values within values without end.
    #[error("values are nested more than {0} deep")]
    Depth(usize),
    /// A marker that is neither a beginning nor an end.
    #[error("marker {0} is neither a beginning nor an end")]
    Marker(u32),
    /// A value that the writer is given does not fit the declaration.
    #[error("{0}")]
    Value(String),
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        Some(&self.cause)
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.block {
            Some(block) => write!(f, "block {block} at byte {}", self.offset)?,
            None => write!(f, "byte {}", self.offset)?,
        }
        if let Some(name) = self.name {
            write!(f, ", {name}")?;
        }
        if !self.member.is_empty() {
            write!(f, ", {}", self.member)?;
        }
        write!(f, ": {}", self.cause)
    }
}

/// A cause with the path of the member, while values are read or written: innermost first.
#[derive(Debug)]
pub(crate) struct Fault {
    pub cause: Cause,
    path: Vec<Step>,
}

#[derive(Debug)]
enum Step {
    Member(&'static str),
    Index(usize),
}

impl From<Cause> for Fault {
    fn from(cause: Cause) -> Self {
        Fault { cause, path: Vec::new() }
    }
}

impl Fault {
    pub fn member(mut self, name: &'static str) -> Self {
        self.path.push(Step::Member(name));
        self
    }

    pub fn index(mut self, index: usize) -> Self {
        self.path.push(Step::Index(index));
        self
    }

    /// The path, outermost first. A chain is shortened to its length.
    pub fn path(&self) -> String {
        let mut text = String::new();
        for step in self.path.iter().rev() {
            match step {
                Step::Member(name) if text.is_empty() => text += name,
                Step::Member(name) => {
                    text += ".";
                    text += name;
                }
                Step::Index(index) => text += &format!("[{index}]"),
            }
        }
        text
    }
}
