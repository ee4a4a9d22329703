//! The calls, structures and constants of Vulkan, as `table.txt` has them.

use std::collections::HashMap;
use std::sync::LazyLock;

/// The form in which a value is stored.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    U8,
    U16,
    U32,
    I32,
    U64,
    I64,
    F32,
    F64,
    Handle,
    /// A constant of the type named.
    Enum(&'static str),
    /// A structure by value, by its place in the table.
    Struct(usize),
    /// A union, which each has its own form.
    Union(&'static str),
    /// A pointer to one value.
    Pointer(Box<Kind>),
    /// A pointer to several values, or an array of a fixed length.
    Array(Box<Kind>),
    Str,
    /// A string of 16-bit units.
    WideStr,
    /// The next structure of a chain, known by its first member.
    Next,
    /// The data of an update template.
    Template,
}

impl Kind {
    /// The name, for messages.
    pub fn name(&self) -> &'static str {
        match self {
            Kind::U8 => "u8",
            Kind::U16 => "u16",
            Kind::U32 => "u32",
            Kind::I32 => "i32",
            Kind::U64 => "u64",
            Kind::I64 => "i64",
            Kind::F32 => "f32",
            Kind::F64 => "f64",
            Kind::Handle => "a handle",
            Kind::Enum(name) | Kind::Union(name) => name,
            Kind::Struct(place) => layout().structs[*place].name,
            Kind::Pointer(_) => "a pointer",
            Kind::Array(_) => "an array",
            Kind::Str | Kind::WideStr => "a string",
            Kind::Next => "a structure",
            Kind::Template => "the data of an update template",
        }
    }
}

/// A parameter or a member.
#[derive(Debug)]
pub(crate) struct Field {
    pub name: &'static str,
    pub kind: Kind,
}

/// A structure.
#[derive(Debug)]
pub(crate) struct StructLayout {
    pub name: &'static str,
    pub fields: Vec<Field>,
    /// The constant in `sType`, if it can stand in a chain.
    pub tag: Option<u32>,
}

/// A call.
#[derive(Debug)]
pub(crate) struct CallLayout {
    pub name: &'static str,
    /// The number in a capture, with the family in its upper half.
    pub number: u32,
    pub parameters: Vec<Field>,
    pub result: Option<Kind>,
}

/// The whole table.
#[derive(Debug)]
pub(crate) struct Layout {
    pub structs: Vec<StructLayout>,
    calls: HashMap<u32, CallLayout>,
    numbers: HashMap<&'static str, u32>,
    by_name: HashMap<&'static str, usize>,
    by_tag: HashMap<u32, usize>,
    /// The constants of each type.
    names: HashMap<&'static str, HashMap<i64, &'static str>>,
    values: HashMap<&'static str, i64>,
}

/// The family of Vulkan in the upper half of the number of a call.
pub(crate) const VULKAN: u32 = 1 << 16;

static LAYOUT: LazyLock<Layout> =
    LazyLock::new(|| Layout::parse(include_str!("table.txt")).expect("the table is part of the package"));

/// The table.
pub(crate) fn layout() -> &'static Layout {
    &LAYOUT
}

impl Layout {
    /// The call of a number, if the table has it.
    pub fn call(&self, number: u32) -> Option<&CallLayout> {
        self.calls.get(&number)
    }

    pub fn call_of_name(&self, name: &str) -> Option<&CallLayout> {
        self.call(*self.numbers.get(name)?)
    }

    pub fn structure(&self, name: &str) -> Option<&StructLayout> {
        Some(&self.structs[*self.by_name.get(name)?])
    }

    /// The structure that has this constant as its `sType`.
    pub fn chained(&self, tag: u32) -> Option<&StructLayout> {
        Some(&self.structs[*self.by_tag.get(&tag)?])
    }

    fn parse(text: &'static str) -> Result<Self, &'static str> {
        let rows = |head: &'static str| text.lines().filter_map(move |line| line.strip_prefix(head));
        let (mut names, mut values) = (HashMap::<_, HashMap<i64, &str>>::new(), HashMap::new());
        let mut kind = "";
        for line in text.lines() {
            if let Some(name) = line.strip_prefix("enum ") {
                kind = name;
            } else if line.starts_with(|first: char| first == '-' || first.is_ascii_digit()) {
                let (value, name) = line.split_once(' ').ok_or(line)?;
                // Bit 63 of flags is a number without a sign.
                let value = value.parse().or_else(|_| value.parse().map(u64::cast_signed)).map_err(|_| line)?;
                // The first name is the one in use.
                names.entry(kind).or_default().entry(value).or_insert(name);
                values.insert(name, value);
            }
        }
        // Members name structures that stand further down.
        let heads = || {
            let chained = rows("chain ").filter_map(|line| line.split_once(' ').map(|(tag, rest)| (Some(tag), rest)));
            rows("struct ").map(|line| (None, line)).chain(chained)
        };
        let name_of = |line: &'static str| line.split(' ').next().unwrap_or(line);
        let by_name: HashMap<_, _> = heads().enumerate().map(|(place, (_, line))| (name_of(line), place)).collect();
        let fields = |words: std::str::Split<'static, char>| {
            let field = |word: &'static str| {
                let (name, kind) = word.split_once(':').ok_or(word)?;
                Ok(Field { name, kind: kind_of(kind, &by_name) })
            };
            words.map(field).collect::<Result<Vec<_>, &'static str>>()
        };
        let (mut structs, mut by_tag) = (Vec::new(), HashMap::new());
        for (tag, line) in heads() {
            let mut words = line.split(' ');
            let name = words.next().ok_or(line)?;
            let tag: Option<u32> = tag.map(str::parse).transpose().map_err(|_| line)?;
            let mut members = Vec::new();
            if let Some(tag) = tag {
                by_tag.insert(tag, structs.len());
                members.push(Field { name: "sType", kind: Kind::Enum("VkStructureType") });
                members.push(Field { name: "pNext", kind: Kind::Next });
            }
            members.extend(fields(words)?);
            structs.push(StructLayout { name, fields: members, tag });
        }
        let (mut calls, mut numbers) = (HashMap::new(), HashMap::new());
        for line in rows("call ") {
            let mut words = line.split(' ');
            let (Some(number), Some(name), Some(result)) = (words.next(), words.next(), words.next()) else { return Err(line) };
            let number = VULKAN | u32::from_str_radix(number, 16).map_err(|_| line)?;
            let result = match result {
                "-" => None,
                "enum" => Some(Kind::Enum("VkResult")),
                other => Some(kind_of(other, &by_name)),
            };
            calls.insert(number, CallLayout { name, number, parameters: fields(words)?, result });
            numbers.insert(name, number);
        }
        Ok(Layout { structs, calls, numbers, by_name, by_tag, names, values })
    }
}

fn kind_of(text: &'static str, structs: &HashMap<&'static str, usize>) -> Kind {
    if let Some(inner) = text.strip_prefix("[]") {
        return Kind::Array(Box::new(kind_of(inner, structs)));
    }
    if let Some(inner) = text.strip_prefix('*') {
        return Kind::Pointer(Box::new(kind_of(inner, structs)));
    }
    let (base, of) = text.split_once('(').map_or((text, ""), |(base, of)| (base, of.trim_end_matches(')')));
    match base {
        "u8" => Kind::U8,
        "u16" => Kind::U16,
        "u32" | "flags" => Kind::U32,
        "i32" => Kind::I32,
        "u64" | "flags64" | "addr" | "fn" => Kind::U64,
        "i64" => Kind::I64,
        "f32" => Kind::F32,
        "f64" => Kind::F64,
        "handle" => Kind::Handle,
        "enum" => Kind::Enum(of),
        "str" => Kind::Str,
        "wstr" => Kind::WideStr,
        "next" => Kind::Next,
        "template" => Kind::Template,
        // All are stored as the number.
        "VkDeviceOrHostAddressKHR"
        | "VkDeviceOrHostAddressConstKHR"
        | "VkDeviceOrHostAddressConstAMDX"
        | "VkPipelineExecutableStatisticValueKHR" => Kind::U64,
        // Both are stored as the bits of the four components.
        "VkClearColorValue" | "VkClearValue" => Kind::Array(Box::new(Kind::U32)),
        name => structs.get(name).map_or(Kind::Union(name), |&place| Kind::Struct(place)),
    }
}

/// The name of a constant, by its type and value: `constant_name("VkFormat", 37)` is `VK_FORMAT_R8G8B8A8_UNORM`. None if the type
/// has no constant of this value.
///
/// Types of flags have their constants under the name of the bits: `VkImageUsageFlagBits`.
pub fn constant_name(kind: &str, value: i64) -> Option<&'static str> {
    layout().names.get(kind)?.get(&value).copied()
}

/// The value of a constant by its name. None if Vulkan has no constant of this name. A flag of 64 bits gives its bits.
pub fn constant(name: &str) -> Option<i64> {
    layout().values.get(name).copied()
}

/// The names of all calls, in the order of their numbers.
pub fn call_names() -> impl Iterator<Item = &'static str> {
    let mut calls: Vec<_> = layout().calls.values().map(|call| (call.number, call.name)).collect();
    calls.sort_unstable();
    calls.into_iter().map(|(_, name)| name)
}

/// The names of all structures.
pub fn structure_names() -> impl Iterator<Item = &'static str> {
    layout().structs.iter().map(|structure| structure.name)
}
