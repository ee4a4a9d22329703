//! Writes recordings as apitrace does: for tests, and for the measurement of their readers (`benches/recordings.rs`).

/// A value of a call.
#[derive(Clone, Debug)]
#[allow(dead_code, reason = "the measurement of readers needs few of them")]
pub enum Value {
    Float(f32),
    Uint(u64),
    Sint(u64),
    /// An enumerant, whose signature is given once.
    Enum(u64),
    Floats(Vec<f32>),
    Blob(Vec<u8>),
    Pointer(u64),
    Null,
}

/// Writes recordings as apitrace does.
pub struct Writer {
    version: u64,
    /// What the chunks of the file expand to.
    pub bytes: Vec<u8>,
    functions: Vec<String>,
    enum_known: bool,
    /// Calls so far.
    pub calls: u64,
}

fn uint(out: &mut Vec<u8>, mut value: u64) {
    while value > 0x7f {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

fn string(out: &mut Vec<u8>, text: &str) {
    uint(out, text.len() as u64);
    out.extend_from_slice(text.as_bytes());
}

impl Writer {
    /// An empty recording of a version of the container.
    pub fn new(version: u64) -> Writer {
        let mut bytes = Vec::new();
        uint(&mut bytes, version);
        if version >= 6 {
            uint(&mut bytes, 6);
            string(&mut bytes, "process.name");
            string(&mut bytes, "test");
            string(&mut bytes, "");
        }
        Writer { version, bytes, functions: Vec::new(), enum_known: false, calls: 0 }
    }

    fn value(&mut self, value: &Value) {
        let out = &mut self.bytes;
        match value {
            Value::Null => out.push(0),
            Value::Float(value) => {
                out.push(5);
                out.extend_from_slice(&value.to_le_bytes());
            }
            Value::Uint(value) => {
                out.push(4);
                uint(out, *value);
            }
            Value::Sint(value) => {
                out.push(3);
                uint(out, *value);
            }
            Value::Enum(value) => {
                out.push(9);
                if self.version >= 3 {
                    uint(out, 0);
                    if !std::mem::replace(&mut self.enum_known, true) {
                        uint(out, 1);
                        string(out, "GL_SOMETHING");
                        out.push(4);
                        uint(out, 1);
                    }
                    out.push(4);
                    uint(out, *value);
                } else {
                    // Each use is a signature of its own.
                    uint(out, 1000 + self.calls * 16 + out.len() as u64);
                    string(out, "GL_SOMETHING");
                    out.push(4);
                    uint(out, *value);
                }
            }
            Value::Floats(values) => {
                out.push(11);
                uint(out, values.len() as u64);
                for value in values {
                    out.push(5);
                    out.extend_from_slice(&value.to_le_bytes());
                }
            }
            Value::Pointer(address) => {
                out.push(13);
                uint(out, *address);
            }
            Value::Blob(bytes) => {
                out.push(8);
                uint(out, bytes.len() as u64);
                out.extend_from_slice(bytes);
            }
        }
    }

    /// A call, which one thread enters and leaves.
    #[allow(dead_code, reason = "tests of threads say which one calls")]
    pub fn call(&mut self, name: &str, args: &[Value]) {
        self.call_in(0, name, args, None);
    }

    /// A call of a thread, and what it returns.
    pub fn call_in(&mut self, thread: u64, name: &str, args: &[Value], result: Option<Value>) {
        self.bytes.push(0);
        if self.version >= 4 {
            uint(&mut self.bytes, thread);
        }
        let known = self.functions.iter().position(|known| known == name);
        let id = known.unwrap_or(self.functions.len());
        uint(&mut self.bytes, id as u64);
        if known.is_none() {
            self.functions.push(name.to_owned());
            string(&mut self.bytes, name);
            uint(&mut self.bytes, args.len() as u64);
            for k in 0..args.len() {
                string(&mut self.bytes, &format!("a{k}"));
            }
        }
        for (k, arg) in args.iter().enumerate() {
            self.bytes.push(1);
            uint(&mut self.bytes, k as u64);
            self.value(arg);
        }
        self.bytes.extend([0, 1]);
        uint(&mut self.bytes, self.calls);
        if let Some(result) = result {
            self.bytes.push(2);
            self.value(&result);
        }
        self.bytes.push(0);
        self.calls += 1;
    }

    /// The file, compressed by Snappy in chunks of `chunk` bytes.
    pub fn file(&self, chunk: usize) -> Vec<u8> {
        let mut file = b"at".to_vec();
        for piece in self.bytes.chunks(chunk) {
            let packed = snap::raw::Encoder::new().compress_vec(piece).expect("a small piece");
            file.extend_from_slice(&(packed.len() as u32).to_le_bytes());
            file.extend_from_slice(&packed);
        }
        file
    }
}
